#include "platform/library/frame_conversion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace stillmesh::frame_conversion_test {
namespace {

// Promise: float metres become the nearest unit; what is no distance, or does not fit, is not measured; rows may be
// farther apart than they are long.
TEST(FrameConversion, DepthOfFloatMetres) {
    const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    const std::vector<float> metres = {1.0F,    0.00009F, 0.0F, -1.0F, 77, nan,  inf,  //
                                       13.107F, 13.1072F, -inf, 2.5F,  77, 6.0F, 0.3F};
    const PixelBytes image{metres.data(), 4, 2, 7 * sizeof(float)};
    std::vector<std::uint16_t> out(8, 9);
    const DepthView depth = depth_from_float(image, 5000, out);
    EXPECT_EQ(out, (std::vector<std::uint16_t>{5000, 0, 0, 0, 65535, 0, 0, 12500}));
    EXPECT_EQ(depth.stride, 4U);
    EXPECT_EQ(depth.at(3, 1), 12500);
    // Every whole unit comes back as itself.
    for (std::uint32_t units = 1; units < 65536; ++units) {
        const float one = static_cast<float>(units) / 5000.0F;
        std::uint16_t back = 0;
        static_cast<void>(depth_from_float({&one, 1, 1, sizeof(one)}, 5000, {&back, 1}));
        ASSERT_EQ(back, units);
    }
}

// Promise: a stride in bytes becomes one in pixels; half a pixel dies where it is said.
TEST(FrameConversion, DepthStrideIsInPixels) {
    const std::vector<std::uint16_t> depth = {1, 2, 99, 3, 4, 99};
    const DepthView view = depth_view({depth.data(), 2, 2, 6});
    EXPECT_EQ(view.stride, 3U);
    EXPECT_EQ(view.at(0, 1), 3);
    EXPECT_DEATH(static_cast<void>(depth_view({depth.data(), 2, 2, 5})), "");
}

// Promise: of four channels the first three are kept in their order, of YUYV and UYVY the luma.
TEST(FrameConversion, ColourLosesWhatIsNotNeeded) {
    const std::vector<std::uint8_t> bgra = {1, 2, 3, 255, 4, 5, 6, 255, 77, 77, 7, 8, 9, 0, 10, 11, 12, 0, 77, 77};
    std::vector<std::uint8_t> bgr(12);
    const auto colour = colour_from_four({bgra.data(), 2, 2, 10}, bgr);
    EXPECT_EQ(bgr, (std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
    EXPECT_EQ(colour.stride, 6U);
    const std::vector<std::uint8_t> yuyv = {10, 128, 11, 129, 12, 130, 13, 131};
    std::vector<std::uint8_t> grey(4);
    EXPECT_EQ(grey_from_yuyv({yuyv.data(), 2, 2, 4}, grey).stride, 2U);
    EXPECT_EQ(grey, (std::vector<std::uint8_t>{10, 11, 12, 13}));
    static_cast<void>(grey_from_yuyv({yuyv.data(), 2, 2, 4}, grey, false));
    EXPECT_EQ(grey, (std::vector<std::uint8_t>{128, 129, 130, 131}));
    EXPECT_DEATH(static_cast<void>(colour_from_four({bgra.data(), 2, 2, 10}, {bgr.data(), 11})), "");
}

}  // namespace
}  // namespace stillmesh::frame_conversion_test
