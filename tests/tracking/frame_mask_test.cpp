#include "engine/tracking/frame_mask.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

namespace stillmesh {
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

}  // namespace
}  // namespace stillmesh
