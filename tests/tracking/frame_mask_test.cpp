#include "engine/tracking/frame_mask.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"

namespace stillmesh::frame_mask_test {
namespace {

constexpr std::uint32_t kWidth = 64, kHeight = 48;

// A picture whose left half is `left_m` away and whose right half `right_m`, with a mask over one of them.
struct Picture {
    std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kWidth * kHeight);
    std::vector<std::uint8_t> mask = std::vector<std::uint8_t>(kWidth * kHeight);
    Frame frame;

    Picture(double left_m, double right_m, bool is_left_masked) {
        for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) {
            const bool is_left = i % kWidth < kWidth / 2;
            depth[i] = static_cast<std::uint16_t>(1000 * (is_left ? left_m : right_m));
            mask[i] = is_left == is_left_masked ? 128 : 127;
        }
        frame.depth = {depth.data(), kWidth, kHeight, kWidth};
        frame.mask = {mask.data(), kWidth, kHeight, kWidth};
        frame.depth_units_per_m = 1000;
    }
};

// A match on the left and one on the right, weighed: what is left of their weights.
std::array<double, 2> weighed(const Picture& picture, double left_weight, double right_weight,
                              const MaskParameters& parameters = {}) {
    FrameMask mask;
    mask.create(parameters);
    mask.begin(picture.frame);
    std::array<Keypoint, 2> keypoints{};
    keypoints[0].x = 3;
    keypoints[1].x = 63.7F;  // rounds beyond the picture
    keypoints[0].y = keypoints[1].y = 47.9F;
    std::array<Correspondence, 2> matches;
    for (std::uint32_t i = 0; i < 2; ++i) {
        matches[i].feature = i;
        matches[i].weight = i == 0 ? left_weight : right_weight;
        matches[i].has_depth = true;
        matches[i].p_camera = {0, 0, i == 0 ? 1.0 : 2.0};
    }
    mask.weigh(keypoints, matches);
    return {matches[0].weight, matches[1].weight};
}

// Promise: what a mask covers counts a tenth, the rest as before; switched off, all as before.
TEST(FrameMask, TakesTheWeightOfWhatItCovers) {
    EXPECT_EQ(weighed({1, 2, true}, 0.03, 0.04), (std::array{0.1 * 0.03, 0.04}));
    MaskParameters off;
    off.is_used = false;
    EXPECT_EQ(weighed({1, 2, true}, 0.03, 0.04, off), (std::array{0.03, 0.04}));
}

// Promise: pixels count by the area they see: of two halves the nearer one may be covered, the farther one not.
TEST(FrameMask, MayNotCoverMoreThanHalfOfTheAreaInView) {
    EXPECT_EQ(weighed({1.9, 2, true}, 0.03, 0.04), (std::array{0.1 * 0.03, 0.04}));
    EXPECT_EQ(weighed({1.9, 2, false}, 0.03, 0.04), (std::array{0.03, 0.04}));
}

// Promise: what is known to stand still speaks against a mask that covers most of it, by area; what is new does not.
TEST(FrameMask, MayNotCoverMostOfWhatIsKnownToStandStill) {
    EXPECT_EQ(weighed({1, 2, true}, 1, 0.04), (std::array{1.0, 0.04}));
    EXPECT_EQ(weighed({1, 2, true}, 1, 1), (std::array{0.1, 1.0}));
    EXPECT_EQ(weighed({1, 2, true}, 0.3, 0.04), (std::array{0.1 * 0.3, 0.04}));
}

// Promise: a mask is of its frame: the next without one has none.
TEST(FrameMask, GoesWithItsFrame) {
    const Picture picture(1, 2, true);
    FrameMask mask;
    mask.create({});
    mask.begin(picture.frame);
    EXPECT_TRUE(mask.is_plausible());
    mask.begin(Frame{});
    EXPECT_FALSE(mask.is_plausible());
}

// Promise: for any picture of any size, the area that decides is that of every eighth pixel of every eighth row from
// the fourth on, within the picture.
TEST(FrameMask, SumsOverAGrid) {
    Random random(1);
    int believed = 0;
    for (int round = 0; round < 400; ++round) {
        const std::uint32_t width = 30 + random.below(20), height = 30 + random.below(20);
        // Beside the picture and below it lies what would turn the balance.
        constexpr std::size_t kStride = 64;
        std::vector<std::uint16_t> depth(kStride * 64, 60000);
        std::vector<std::uint8_t> mask(kStride * 64, round % 2 == 0 ? 255 : 0);
        double all = 0, covered = 0;
        for (std::uint32_t y = 0; y < height; ++y) {
            for (std::uint32_t x = 0; x < width; ++x) {
                const std::size_t at = y * kStride + x;
                depth[at] = static_cast<std::uint16_t>(random.below(5000));
                mask[at] = static_cast<std::uint8_t>(127 + random.below(2));
                if (x % 8 != 4 || y % 8 != 4) continue;
                const double area = static_cast<double>(depth[at]) * depth[at];
                all += area;
                if (mask[at] == 128) covered += area;
            }
        }
        Frame frame;
        frame.depth = {depth.data(), width, height, kStride};
        frame.mask = {mask.data(), width, height, kStride};
        FrameMask here;
        here.create({});
        here.begin(frame);
        ASSERT_EQ(here.is_plausible(), covered <= MaskParameters{}.share_max * all) << round;
        believed += here.is_plausible() ? 1 : 0;
    }
    EXPECT_GT(believed, 100);
    EXPECT_LT(believed, 300);
}

// Promise: matches speak against a mask by weight and the square of their depth, from half the weight on, and none
// without depth.
TEST(FrameMask, SumsOverMatches) {
    Random random(2);
    const Picture picture(1, 2, true);
    int weighed_less = 0;
    for (int round = 0; round < 400; ++round) {
        std::array<Keypoint, 6> keypoints{};
        std::array<Correspondence, 6> matches, before;
        double proven = 0, covered = 0;
        for (std::uint32_t i = 0; i < 6; ++i) {
            keypoints[i].x = static_cast<float>(random.below(kWidth));
            matches[i].feature = i;
            matches[i].weight = 0.125 * random.below(9);
            matches[i].has_depth = random.below(4) != 0;
            matches[i].p_camera = {0, 0, 0.25 * (1 + random.below(8))};
            before[i] = matches[i];
            if (matches[i].weight < 0.5 || !matches[i].has_depth) continue;
            const double area = matches[i].weight * matches[i].p_camera.z() * matches[i].p_camera.z();
            proven += area;
            if (keypoints[i].x < kWidth / 2) covered += area;
        }
        FrameMask mask;
        mask.create({});
        mask.begin(picture.frame);
        mask.weigh(keypoints, matches);
        const bool is_believed = covered <= MaskParameters{}.share_max * proven;
        for (std::size_t i = 0; i < 6; ++i) {
            const bool is_less = is_believed && keypoints[i].x < kWidth / 2;
            ASSERT_EQ(matches[i].weight, (is_less ? MaskParameters{}.weight : 1.0) * before[i].weight) << round;
        }
        weighed_less += is_believed ? 1 : 0;
    }
    EXPECT_GT(weighed_less, 100);
    EXPECT_LT(weighed_less, 300);
}

}  // namespace
}  // namespace stillmesh::frame_mask_test
