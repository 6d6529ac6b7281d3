#include "engine/frame/kernels.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "engine/base/random.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/images.hpp"

namespace stillmesh::kernels_test {
namespace {

using testing::hard_images;
using testing::Image;

std::vector<const Kernels*> fast_kernels() {
    std::vector<const Kernels*> all;
    if (sse2_kernels() != nullptr) all.push_back(sse2_kernels());
    if (&cpu_kernels() == neon_kernels()) all.push_back(neon_kernels());
    // Only what this processor can run.
    if (&cpu_kernels() == avx2_kernels()) all.push_back(avx2_kernels());
    return all;
}

// Promise: grey conversion of every kernel is the BT.601 formula, for every length of a row.
TEST(Kernels, grey) {
    Random random(1);
    std::vector<std::uint8_t> colour(3 * 700);
    for (std::uint8_t& value : colour) value = static_cast<std::uint8_t>(random.below(256));
    for (std::size_t i = 0; i < 90; ++i) colour[i] = i < 45 ? 255 : 0;
    std::vector<const Kernels*> all = fast_kernels();
    all.push_back(&plain_kernels());
    for (const Kernels* kernels : all) {
        for (std::uint32_t width = 1; width < 200; width += width < 70 ? 1 : 13) {
            const std::vector<std::uint8_t> exact(colour.begin(),
                                                  colour.begin() + static_cast<std::ptrdiff_t>(3 * width));
            std::vector<std::uint8_t> rgb(width + kKernelSlackBytes);
            std::vector<std::uint8_t> bgr(width + kKernelSlackBytes);
            kernels->grey_from_rgb(exact.data(), width, rgb.data());
            kernels->grey_from_bgr(exact.data(), width, bgr.data());
            for (std::uint32_t x = 0; x < width; ++x) {
                const std::uint32_t a = exact[3 * x];
                const std::uint32_t b = exact[3 * x + 1];
                const std::uint32_t c = exact[3 * x + 2];
                ASSERT_EQ(rgb[x], (77 * a + 150 * b + 29 * c + 128) / 256) << kernels->name;
                ASSERT_EQ(bgr[x], (29 * a + 150 * b + 77 * c + 128) / 256) << kernels->name;
            }
        }
    }
}

// Promise: FAST, its local maxima, blur, moments and tensors of every kernel have the plain kernel's bits.
TEST(Kernels, equal_plain_bits) {
    for (const std::uint32_t width : {40u, 63u, 64u, 65u, 97u, 161u}) {
        const std::uint32_t height = 40;
        for (Image& image : hard_images(width, height)) {
            const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(image.stride);
            for (const Kernels* kernels : fast_kernels()) {
                SCOPED_TRACE(std::string(kernels->name) + " width " + std::to_string(width));
                const Kernels& plain = plain_kernels();
                for (const int threshold : {0, 1, 7, 20, 100, 254, 255}) {
                    std::vector<std::uint8_t> rows[2][3];
                    for (std::uint32_t y = 3; y + 3 < height; ++y) {
                        for (int k = 0; k < 2; ++k) {
                            std::vector<std::uint8_t>& row = rows[k][y % 3];
                            row.assign(width + kKernelSlackBytes, 0);
                            const bool any = (k == 0 ? plain : *kernels)
                                                 .fast_row(image.row(y), stride, 3, width - 3,
                                                           static_cast<std::uint8_t>(threshold), row.data());
                            bool expected = false;
                            for (std::uint32_t x = 3; x < width - 3; ++x) expected = expected || row[x] != 0;
                            ASSERT_EQ(any, expected);
                        }
                        ASSERT_EQ(0, std::memcmp(rows[0][y % 3].data() + 3, rows[1][y % 3].data() + 3, width - 6))
                            << "row " << y << " threshold " << threshold;
                        if (y < 5) continue;
                        std::uint16_t maxima[2][300];
                        std::uint32_t counts[2];
                        for (int k = 0; k < 2; ++k)
                            counts[k] = (k == 0 ? plain : *kernels)
                                            .local_maxima(rows[k][(y - 2) % 3].data(), rows[k][(y - 1) % 3].data(),
                                                          rows[k][y % 3].data(), 4, width - 4, maxima[k]);
                        ASSERT_EQ(counts[0], counts[1]);
                        ASSERT_EQ(0, std::memcmp(maxima[0], maxima[1], counts[0] * sizeof(std::uint16_t)));
                    }
                }
                for (std::uint32_t y = 3; y + 3 < height; y += 2) {
                    const std::uint8_t* sources[7];
                    for (std::uint32_t i = 0; i < 7; ++i) sources[i] = image.row(y + i - 3);
                    std::vector<std::uint8_t> out[2];
                    for (int k = 0; k < 2; ++k) {
                        std::vector<std::uint8_t> scratch(width + 2 * kKernelSlackBytes, 99);
                        out[k].assign(width + kKernelSlackBytes, 0);
                        (k == 0 ? plain : *kernels)
                            .blur_row(sources, width, scratch.data() + kKernelSlackBytes, out[k].data());
                    }
                    ASSERT_EQ(0, std::memcmp(out[0].data(), out[1].data(), width));
                }
                for (std::uint32_t y = 16; y < height - 16; y += 3) {
                    for (std::uint32_t x = 16; x < width - 16; ++x) {
                        const Moments a = plain.moments(image.row(y) + x, stride);
                        const Moments b = kernels->moments(image.row(y) + x, stride);
                        ASSERT_TRUE(a.x == b.x && a.y == b.y) << x << " " << y;
                        const std::uint32_t here[2] = {y << 16 | x, 16 << 16 | 16};
                        Tensor c;
                        Tensor both[2];
                        plain.tensors(image.row(0), stride, here, 1, &c);
                        kernels->tensors(image.row(0), stride, here, 2, both);
                        const Tensor& d = both[0];
                        ASSERT_TRUE(c.xx == d.xx && c.xy == d.xy && c.yy == d.yy) << x << " " << y;
                    }
                }
            }
        }
    }
}

// Promise: the plain kernels write what they were asked for and no byte beside it, and scale a row as the formula says.
TEST(Kernels, plain_writes_no_more) {
    Random random(6);
    const Kernels& plain = plain_kernels();
    for (std::uint32_t width = 9; width < 80; ++width) {
        std::vector<std::uint8_t> rows[7];
        const std::uint8_t* starts[7];
        for (std::uint32_t i = 0; i < 7; ++i) {
            for (std::uint32_t x = 0; x < width; ++x) rows[i].push_back(static_cast<std::uint8_t>(random.below(256)));
            starts[i] = rows[i].data();
        }
        const auto is_untouched = [&](const std::vector<std::uint8_t>& bytes, std::size_t begin) {
            for (std::size_t i = begin; i < bytes.size(); ++i)
                if (bytes[i] != 77) return false;
            return true;
        };
        // Rows, and what a smaller level's pixels are made of.
        const std::uint32_t out_width = 1 + random.below(width - 1);
        std::vector<ScaleBlock> blocks(out_width / kScaleBlock + 1);
        for (ScaleBlock& block : blocks) {
            block.first = static_cast<std::uint16_t>(random.below(width / 2));
            for (std::uint32_t i = 0; i < kScaleBlock; ++i) {
                block.picks[2 * i] = static_cast<std::uint8_t>(random.below(width / 2));
                block.picks[2 * i + 1] = static_cast<std::uint8_t>(random.below(width / 2));
                block.weights[2 * i] = static_cast<std::uint8_t>(1 + random.below(127));
                block.weights[2 * i + 1] = static_cast<std::uint8_t>(128 - block.weights[2 * i]);
            }
        }
        const auto below = static_cast<std::uint8_t>(1 + random.below(127));
        std::vector<std::uint8_t> scratch(width + 8, 77), out(width + 8, 77);
        plain.scale_row(starts[0], starts[1], width, below, blocks.data(), out_width, scratch.data(), out.data());
        EXPECT_TRUE(is_untouched(scratch, width) && is_untouched(out, out_width)) << width;
        for (std::uint32_t x = 0; x < out_width; ++x) {
            const ScaleBlock& block = blocks[x / kScaleBlock];
            const auto at = [&](std::uint32_t side) {
                const std::uint32_t i = 2 * (x % kScaleBlock) + side, from = block.first + block.picks[i];
                return block.weights[i] * (((128 - below) * rows[0][from] + below * rows[1][from] + 64) / 128);
            };
            ASSERT_EQ(out[x], (at(0) + at(1) + 64) / 128) << width << " " << x;
        }
        // The blur has three bytes to each side of its scratch.
        std::vector<std::uint8_t> wide(width + 2 * kBlurRadius + 2, 77);
        out.assign(width + 8, 77);
        plain.blur_row(starts, width, wide.data() + 1 + kBlurRadius, out.data());
        EXPECT_TRUE(wide.front() == 77 && wide.back() == 77 && is_untouched(out, width)) << width;
        // Corners within [4, width - 4), or fewer; none of the neighbours is asked to be one.
        Image image(width, 7);
        fill_noise(image, width);
        out.assign(width + 8, 77);
        const std::uint32_t end = width - 4;
        static_cast<void>(
            plain.fast_row(image.row(3), static_cast<std::ptrdiff_t>(image.stride), 4, end, 5, out.data()));
        EXPECT_TRUE(is_untouched(out, end) && out[3] == 77 && out[4] != 77) << width;
        std::vector<std::uint8_t> low(width, 0), high(width, 0);
        for (std::uint32_t x = 1; x < width; x += 2) high[x] = 9;
        std::vector<std::uint16_t> maxima(width, 777);
        const std::uint32_t count = plain.local_maxima(low.data(), high.data(), low.data(), 3, end, maxima.data());
        std::uint32_t expected = 0;
        for (std::uint32_t x = 3; x < end; x += 2) ASSERT_EQ(maxima[expected++], x);
        EXPECT_EQ(count, expected);
        EXPECT_EQ(maxima[count], 777);
    }
}

// Promise: moments are the plain sums over the disc u^2 + v^2 <= 15^2 + 15.
TEST(Kernels, moments_are_sums) {
    Image image(40, 40);
    fill_noise(image, 5);
    std::int32_t x = 0;
    std::int32_t y = 0;
    for (std::int32_t v = -15; v <= 15; ++v) {
        for (std::int32_t u = -15; u <= 15; ++u) {
            if (u * u + v * v > 240) continue;
            x += u * image.row(static_cast<std::uint32_t>(20 + v))[20 + u];
            y += v * image.row(static_cast<std::uint32_t>(20 + v))[20 + u];
        }
    }
    const Moments moments = plain_kernels().moments(image.row(20) + 20, 40);
    EXPECT_EQ(moments.x, x);
    EXPECT_EQ(moments.y, y);
}

// Promise: Hamming distances of every kernel count the different bits.
TEST(Kernels, hamming) {
    Random random(3);
    std::vector<const Kernels*> all = fast_kernels();
    all.push_back(&plain_kernels());
    std::vector<std::uint64_t> words(4 * 200);
    for (std::size_t i = 0; i < words.size(); ++i) words[i] = i < 8 ? (i < 4 ? 0 : ~0ULL) : random.next();
    for (const Kernels* kernels : all) {
        for (std::uint32_t i = 0; i < 3; ++i) {
            std::uint16_t distances[200];
            kernels->hamming_many(words.data() + 4 * i, words.data(), 200, distances);
            for (std::uint32_t k = 0; k < 200; ++k) {
                std::uint32_t expected = 0;
                for (std::uint32_t bit = 0; bit < 256; ++bit)
                    expected += static_cast<std::uint32_t>(
                        (words[4 * i + bit / 64] ^ words[4 * k + bit / 64]) >> (bit % 64) & 1);
                ASSERT_EQ(distances[k], expected) << kernels->name;
                ASSERT_EQ(kernels->hamming(words.data() + 4 * i, words.data() + 4 * k), expected) << kernels->name;
            }
        }
    }
}

// Promise: the environment can name any kernels that this processor can run; plain is what anything else means.
TEST(Kernels, NamedByTheEnvironment) {
    const char* const before = std::getenv("STILLMESH_KERNELS");
    const std::string kept = before == nullptr ? "" : before;
    ::unsetenv("STILLMESH_KERNELS");
    std::vector<const Kernels*> all = fast_kernels();
    all.push_back(&cpu_kernels());
    all.push_back(&plain_kernels());
    for (const Kernels* kernels : all) {
        ::setenv("STILLMESH_KERNELS", kernels->name, 1);
        EXPECT_EQ(&cpu_kernels(), kernels) << kernels->name;
    }
    ::setenv("STILLMESH_KERNELS", "mmx", 1);
    EXPECT_EQ(&cpu_kernels(), &plain_kernels());
    ::setenv("STILLMESH_KERNELS", "", 1);
    EXPECT_EQ(&cpu_kernels(), all[all.size() - 2]);
    kept.empty() ? ::unsetenv("STILLMESH_KERNELS") : ::setenv("STILLMESH_KERNELS", kept.c_str(), 1);
}

}  // namespace
}  // namespace stillmesh::kernels_test
