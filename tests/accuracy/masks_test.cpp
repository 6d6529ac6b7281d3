#include "bench/accuracy/masks.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

namespace stillmesh::accuracy::masks_test {
namespace {

constexpr std::uint32_t kWidth = 128, kHeight = 64;

// Where the mask of the last of `frames` frames is white, in which one pixel moves, a column further each frame.
std::vector<std::uint32_t> columns_of(const std::string& name, std::uint32_t frames) {
    MaskMaker maker(mask_kind(name));
    ImageView<std::uint8_t> mask;
    for (std::uint32_t i = 0; i < frames; ++i) {
        std::vector<std::uint8_t> truth(kWidth * kHeight, 0);
        truth[5 * kWidth + i] = 255;
        mask = maker.mask({truth.data(), kWidth, kHeight, kWidth});
    }
    std::vector<std::uint32_t> out;
    for (std::uint32_t x = 0; mask.data != nullptr && x < kWidth; ++x) {
        if (mask.at(x, 5) == 255) out.push_back(x);
    }
    return out;
}

// Promise: each kind is what it says: the right one, all the rest, ten frames late and none before, whole squares, and
// left for right; without a kind, or without a truth, there is none.
TEST(Masks, AreWhatTheySay) {
    EXPECT_EQ(columns_of("right", 4), (std::vector<std::uint32_t>{3}));
    EXPECT_EQ(columns_of("mirrored", 4), (std::vector<std::uint32_t>{kWidth - 4}));
    EXPECT_EQ(columns_of("inverted", 4).size(), kWidth - 1);
    EXPECT_EQ(columns_of("late", 10).size(), 0U);
    EXPECT_EQ(columns_of("late", 12), (std::vector<std::uint32_t>{1}));
    EXPECT_EQ(columns_of("boxes", 4).size(), kWidth / 2);
    EXPECT_EQ(columns_of("no such", 4).size(), 0U);
    EXPECT_EQ(MaskMaker(mask_kind("right")).mask({}).data, nullptr);
}

}  // namespace
}  // namespace stillmesh::accuracy::masks_test
