#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/base/hash.hpp"
#include "engine/base/random.hpp"
#include "engine/features/moving_cells.hpp"
#include "engine/features/orb_extractor.hpp"
#include "engine/features/orb_pattern.hpp"
#include "engine/features/own_extractor.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/images.hpp"
#include "tests/features/rig.hpp"

namespace stillmesh::extractor_test {
namespace {

using testing::Image;
using testing::Rig;

// Promise: the plan and what is used agree to the byte, for every preset.
TEST(OrbExtractor, plan_equals_use) {
    for (const Limits& limits : {Limits::room(), Limits::pocket(), Limits::tiny()}) {
        const Rig rig(limits, plain_kernels());
        EXPECT_EQ(rig.planned_bytes, rig.used_bytes);
    }
}

// Promise: a textured image fills features_max, no two features are the same, and all lie inside the image.
TEST(OrbExtractor, fills_up) {
    Image image(640, 480);
    fill_leaves(image, 1);
    Rig rig(Limits::room(), cpu_kernels());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    EXPECT_EQ(rig.features.size(), 1000u);
    std::set<std::tuple<float, float, int>> seen;
    for (const Keypoint& k : rig.features.keypoints.span()) {
        EXPECT_TRUE(k.x >= 0 && k.y >= 0 && k.x <= 639 && k.y <= 479);
        EXPECT_TRUE(seen.insert({k.x, k.y, k.level}).second);
    }
}

// A number for all that an extraction gives out, bit by bit.
std::uint64_t digest(const FeatureSet& features) {
    StateHash hash;
    for (std::size_t i = 0; i < features.size(); ++i) {
        const Keypoint& k = features.keypoints[i];
        hash.add(k.x);
        hash.add(k.y);
        hash.add(k.angle_rad);
        hash.add(static_cast<std::uint32_t>(k.score));
        hash.add(static_cast<std::uint32_t>(k.level));
        for (const std::uint64_t word : features.descriptors[i].words) hash.add(word);
    }
    return hash.value();
}

std::vector<const Kernels*> all_kernels() {
    std::vector<const Kernels*> all = {&plain_kernels()};
    if (sse2_kernels() != nullptr) all.push_back(sse2_kernels());
    if (&cpu_kernels() == neon_kernels()) all.push_back(neon_kernels());
    if (&cpu_kernels() != all.back()) all.push_back(&cpu_kernels());
    return all;
}

// Promise: any image of any size and stride gives the same bits with all kernels, twice, whatever was extracted before,
// and on every machine; features lie inside, without duplicates, descriptors beside keypoints, never more than fit.
TEST(OrbExtractor, GoldenBitsOfAnyImage) {
    std::vector<std::unique_ptr<Rig>> rigs;
    for (const Kernels* kernels : all_kernels()) rigs.push_back(std::make_unique<Rig>(Limits::tiny(), *kernels));
    Random random(5);
    StateHash golden;
    for (int round = 0; round < 150; ++round) {
        const std::uint32_t width = 33 + random.below(128);
        const std::uint32_t height = 33 + random.below(88);
        Image image(width, height, width + random.below(70));
        const std::uint64_t seed = random.next();  // one draw a statement: arguments have no order of evaluation
        const std::uint32_t contrast = random.below(230);
        switch (round % 6) {
            case 0: fill_noise(image, seed); break;
            case 1: fill_noise(image, seed, 120, 120 + contrast % 20); break;
            case 2: fill(image, round % 4 == 0 ? 0 : 255); break;
            case 3:
                for (std::uint32_t y = 0; y < height; ++y)
                    for (std::uint32_t x = 0; x < width; ++x) image.row(y)[x] = (x + y) % 2 == 0 ? 0 : 255;
                break;
            case 4: fill_leaves(image, seed, 100, 20 + contrast); break;
            default:  // bright points between which no circle runs: more corners than there is room for
                for (std::uint32_t y = 1; y < height; y += 4)
                    for (std::uint32_t x = 1; x < width; x += 2)
                        image.row(y)[x] = static_cast<std::uint8_t>(round % 4 == 1 ? 255 : 100 + random.below(156));
        }
        std::uint64_t expected = 0;
        for (std::size_t i = 0; i < rigs.size(); ++i) {
            Rig& rig = *rigs[i];
            for (int again = 0; again < 2; ++again) {
                ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
                ASSERT_LE(rig.features.size(), 100u);
                ASSERT_EQ(rig.features.keypoints.size(), rig.features.descriptors.size());
                if (i == 0 && again == 0) expected = digest(rig.features);
                ASSERT_EQ(digest(rig.features), expected) << "round " << round << " kernels " << i;
            }
            std::set<std::tuple<float, float, int>> seen;
            for (const Keypoint& k : rig.features.keypoints.span()) {
                ASSERT_TRUE(k.x >= 0 && k.y >= 0 && k.x <= static_cast<float>(width - 1) &&
                            k.y <= static_cast<float>(height - 1));
                ASSERT_TRUE(seen.insert({k.x, k.y, k.level}).second);
            }
        }
        golden.add(expected);
        if (round % 6 == 2) {
            EXPECT_EQ(rigs[0]->features.size(), 0u);
        }
        if ((round % 6 == 0 || round % 6 == 5) && width > 90 && height > 90) {
            EXPECT_EQ(rigs[0]->features.size(), 100u);
        }
    }
    EXPECT_EQ(golden.value(), 0x513f76fefc072d1dULL) << std::hex << golden.value();
}

// Promise: what is extracted is the same on every machine and at every optimisation: a golden digest.
TEST(OrbExtractor, GoldenBits) {
    Image image(640, 480);
    fill_leaves(image, 42);
    Rig rig(Limits::room(), cpu_kernels());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    EXPECT_EQ(digest(rig.features), 11812093216202693258ULL);
}

// Promise: what a vocabulary names its pattern by is the checksum of every offset of every turn, 16 bits each, the low
// byte first.
TEST(OrbExtractor, pattern_has_a_checksum) {
    std::vector<std::byte> bytes;
    for (const auto& turn : turned_pattern().offsets) {
        for (const std::int16_t offset : turn) {
            const int number = offset < 0 ? offset + 65536 : offset;
            bytes.push_back(static_cast<std::byte>(number % 256));
            bytes.push_back(static_cast<std::byte>(number / 256));
        }
    }
    EXPECT_EQ(descriptor_pattern_crc(), crc32(bytes));
}

// Promise: where there are strong corners they come before weak ones, and a dim corner of the image still gets
// features.
TEST(OrbExtractor, dim_places_are_served) {
    Image image(640, 480);
    fill_leaves(image, 9);
    for (std::uint32_t y = 0; y < 480; ++y)  // the left half at a sixth of the light
        for (std::uint32_t x = 0; x < 320; ++x) image.row(y)[x] = static_cast<std::uint8_t>(image.row(y)[x] / 6);
    Rig rig(Limits::room(), cpu_kernels());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    std::size_t dim = 0;
    for (const Keypoint& k : rig.features.keypoints.span()) dim += k.x < 310 ? 1 : 0;
    EXPECT_EQ(rig.features.size(), 1000u);
    EXPECT_GT(dim, 100u);
}

// Promise: features are spread: with even_permille 1000 far fewer of the 8x6 cells of an image, one corner of which has
// most of the contrast, are left without than with 0.
TEST(OrbExtractor, spread_over_the_image) {
    Image image(640, 480);
    fill_leaves(image, 11);
    // One corner of the image has far more contrast than all the rest.
    for (std::uint32_t y = 0; y < 480; ++y)
        for (std::uint32_t x = 0; x < 640; ++x)
            if (x > 200 || y > 200) image.row(y)[x] = static_cast<std::uint8_t>(100 + image.row(y)[x] / 4);
    std::size_t empty[2] = {0, 0};
    for (int i = 0; i < 2; ++i) {
        OrbOptions options;
        options.even_permille = i == 0 ? 0 : 1000;
        options.features_max = 200;
        Rig rig(Limits::room(), cpu_kernels(), options);
        ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
        std::size_t cells[48] = {};
        for (const Keypoint& k : rig.features.keypoints.span())
            ++cells[static_cast<std::size_t>(k.y / 80.0f) * 8 + static_cast<std::size_t>(k.x / 80.0f)];
        for (const std::size_t cell : cells) empty[i] += cell == 0 ? 1 : 0;
    }
    EXPECT_GT(empty[0], 10u) << "the image is no test of spreading";
    EXPECT_LT(3 * empty[1], 2 * empty[0]);
}

std::size_t on_the_left(const FeatureSet& features) {
    std::size_t count = 0;
    for (const Keypoint& k : features.keypoints.span()) count += k.x < 320 ? 1U : 0U;
    return count;
}
MovingCells left_half() {
    MovingCells cells;
    for (std::uint32_t row = 0; row < MovingCells::kSide; ++row) {
        for (std::uint32_t column = 0; column < MovingCells::kSide / 2; ++column) cells.add(column, row);
    }
    return cells;
}

// Promise: where bodies move lies a quarter of the features, none is lost by that, and nothing of it stays.
TEST(OrbExtractor, FewWhereBodiesMove) {
    Image image(640, 480);
    fill_leaves(image, 1);
    Rig rig(Limits::room(), cpu_kernels(), {.even_permille = 1000});
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    const std::uint64_t before = digest(rig.features);
    EXPECT_NEAR(static_cast<double>(on_the_left(rig.features)), 500, 50);
    rig.extractor.set_moving(left_half());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    EXPECT_EQ(rig.features.size(), 1000U);
    EXPECT_NEAR(static_cast<double>(on_the_left(rig.features)), 250, 15);  // corners are placed after they are chosen
    rig.extractor.set_moving({});
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    EXPECT_EQ(digest(rig.features), before);
}

// Promise: where nothing but what moves has corners it has all features, and of the few corners elsewhere none is left
// out.
TEST(OrbExtractor, BodiesFillUp) {
    Image image(640, 480);
    fill_leaves(image, 1);
    for (std::uint32_t y = 0; y < 480; ++y) {
        for (std::uint32_t x = 330; x < 640; ++x) image.row(y)[x] = 100;
    }
    for (const std::uint32_t y : {120U, 240U, 360U}) {
        for (std::uint32_t v = 0; v < 12; ++v) {
            for (std::uint32_t u = 0; u < 12; ++u) image.row(y + v)[480 + u] = 220;
        }
    }
    Rig rig(Limits::room(), cpu_kernels(), {.even_permille = 1000});
    const auto right = [&rig] { return rig.features.size() - on_the_left(rig.features); };
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    const std::size_t before = right();
    EXPECT_GT(before, 0U);
    rig.extractor.set_moving(left_half());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    EXPECT_EQ(rig.features.size(), 1000U);
    EXPECT_GE(right(), before);
}

// Promise: a corner is found at the same place of the full image on whatever level. The four corners of a square with
// soft edges: each has its own bias inwards, their mean has none, to a fifth of a pixel of the level.
TEST(OrbExtractor, no_bias_between_levels) {
    const double centre_x = 319.8;
    const double centre_y = 239.3;
    const double half = 100;
    const auto inside = [half](double distance) {
        const double ramp = (half - (distance < 0 ? -distance : distance)) / 6 + 0.5;  // 6 px wide
        return ramp < 0 ? 0.0 : ramp > 1 ? 1.0 : ramp;
    };
    Image image(640, 480);
    for (std::uint32_t y = 0; y < 480; ++y)
        for (std::uint32_t x = 0; x < 640; ++x)
            image.row(y)[x] = static_cast<std::uint8_t>(60.5 + 140 * inside(x - centre_x) * inside(y - centre_y));
    Rig rig(Limits::room(), cpu_kernels());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    std::size_t levels = 0;
    for (std::uint32_t i = 0; i < 8; ++i) {
        // The best of each quarter of the image.
        double x = 0;
        double y = 0;
        const Keypoint* best[4] = {};
        for (const Keypoint& k : rig.features.keypoints.span()) {
            if (k.level != i) continue;
            const Keypoint*& there = best[(k.x > 320 ? 1u : 0u) + (k.y > 240 ? 2u : 0u)];
            if (there == nullptr || k.score > there->score) there = &k;
        }
        if (best[0] == nullptr || best[1] == nullptr || best[2] == nullptr || best[3] == nullptr) continue;
        ++levels;
        const double scale = 640.0 / rig.extractor.pyramid().level(i).width;
        for (const Keypoint* k : best) {
            x += static_cast<double>(k->x) / 4;
            y += static_cast<double>(k->y) / 4;
        }
        EXPECT_NEAR(x, centre_x, 0.2 * scale) << "level " << i;
        EXPECT_NEAR(y, centre_y, 0.2 * scale) << "level " << i;
    }
    EXPECT_GE(levels, 6u);
}

}  // namespace
}  // namespace stillmesh::extractor_test
