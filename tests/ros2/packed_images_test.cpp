#include "hal/ros2/packed_images.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/replay/small_jpeg.hpp"
#include "tests/ros2/png_bytes.hpp"

namespace stillmesh::packed_images_test {
namespace {

using test::png_bytes;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kWidth = 7, kHeight = 5;

[[nodiscard]] std::vector<std::uint16_t> depth_values() {
    std::vector<std::uint16_t> values(kWidth * kHeight);
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::uint16_t>(i * 1800);
    return values;
}
// As the transport of ROS packs it.
[[nodiscard]] Bytes packed_depth(float a, float b) {
    Bytes bytes(12);
    std::memcpy(bytes.data() + 4, &a, 4);
    std::memcpy(bytes.data() + 8, &b, 4);
    const Bytes png = png_bytes(depth_values().data(), kWidth, kHeight, PngPixels::kGrey16);
    bytes.insert(bytes.end(), png.begin(), png.end());
    return bytes;
}

// Promise: a PNG's colours come back to the bit, in RGB or grey; a JPEG's nearly, where the build reads it, and else
// the sentence says how it would.
TEST(PackedImages, ColourIsUnpacked) {
    Bytes rgb(std::size_t{kWidth} * kHeight * 3), grey(std::size_t{kWidth} * kHeight), pixels;
    for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<std::uint8_t>(i * 11);
    for (std::size_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<std::uint8_t>(i * 5);
    ImageHeader header;
    std::string problem;
    const Bytes coloured = png_bytes(rgb.data(), kWidth, kHeight, PngPixels::kRgb8);
    ASSERT_TRUE(packed_colour_of({"bgr8; png compressed bgr8", coloured}, pixels, header, problem)) << problem;
    EXPECT_EQ(header.kind, ImageKind::kRgb8);
    EXPECT_EQ(header.width, kWidth);
    EXPECT_EQ(header.height, kHeight);
    EXPECT_EQ(pixels, rgb);
    ASSERT_TRUE(packed_colour_of({"mono8; png", png_bytes(grey.data(), kWidth, kHeight, PngPixels::kGrey8)}, pixels,
                                 header, problem))
        << problem;
    EXPECT_EQ(header.kind, ImageKind::kGrey8);
    EXPECT_EQ(pixels, grey);
    if (packed_colour_of({"rgb8; jpeg compressed bgr8", test::kSmallJpeg}, pixels, header, problem)) {
        ASSERT_EQ(pixels.size(), 16U * 16 * 3);
        EXPECT_NEAR(pixels[0], 200, 8);  // red, left
        EXPECT_NEAR(pixels[2], 40, 8);
        EXPECT_NEAR(pixels[3 * 15 + 2], 200, 8);  // blue, right
    } else {
        EXPECT_NE(problem.find("-DSTILLMESH_WITH_JPEG=ON"), std::string::npos) << problem;
    }
}

// Promise: millimetres stay as they are, plainly packed or by compressedDepth; metres are a / (value - b), in quarters
// of a millimetre, and what is nearer, farther or nothing is 0.
TEST(PackedImages, DepthIsUnpacked) {
    const std::vector<std::uint16_t> values = depth_values();
    std::vector<std::uint16_t> pixels;
    ImageHeader header;
    double units = 0;
    std::string problem;
    const Bytes plain = png_bytes(values.data(), kWidth, kHeight, PngPixels::kGrey16);
    ASSERT_TRUE(packed_depth_of({"16UC1; png compressed ", plain}, pixels, header, units, problem)) << problem;
    EXPECT_EQ(units, 1000);
    EXPECT_EQ(pixels, values);
    EXPECT_EQ(header.width, kWidth);
    ASSERT_TRUE(packed_depth_of({"16UC1; compressedDepth png", packed_depth(0, 0)}, pixels, header, units, problem));
    EXPECT_EQ(units, 1000);
    EXPECT_EQ(pixels, values);
    const float a = 10000.5F, b = 599.25F;
    ASSERT_TRUE(packed_depth_of({"32FC1; compressedDepth", packed_depth(a, b)}, pixels, header, units, problem));
    EXPECT_EQ(units, 4000);
    std::size_t measured = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double metres = static_cast<double>(a) / (static_cast<double>(values[i]) - static_cast<double>(b));
        const bool is_known = values[i] != 0 && metres > 0 && metres * 4000 < 65535.5;
        EXPECT_EQ(pixels[i], is_known ? std::floor(metres * 4000 + 0.5) : 0) << i;
        measured += pixels[i] != 0 ? 1U : 0U;
    }
    EXPECT_GT(measured, values.size() - 3);
}

// Promise: what is cut, damaged, of the other kind, too large or packed otherwise is refused with a sentence, and never
// read beyond its end.
TEST(PackedImages, AnythingElseIsRefused) {
    Bytes pixels;
    std::vector<std::uint16_t> depth;
    ImageHeader header;
    double units = 0;
    std::string problem;
    const Bytes whole = packed_depth(1, 2);
    for (std::size_t size = 0; size < whole.size(); ++size) {
        const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        if (packed_depth_of({"16UC1; compressedDepth png", cut}, depth, header, units, problem)) {
            EXPECT_GE(size + 16, whole.size());  // without a checksum of pixels that are all there, and the end's mark
        }
        EXPECT_FALSE(packed_colour_of({"rgb8; jpeg", cut}, pixels, header, problem)) << size;
        EXPECT_FALSE(problem.empty());
    }
    const Bytes grey(64), png = png_bytes(grey.data(), 8, 8, PngPixels::kGrey8);
    EXPECT_FALSE(packed_depth_of({"16UC1; png", png}, depth, header, units, problem));
    EXPECT_EQ(problem, "has no 16 bits, as depth has.");
    EXPECT_FALSE(packed_depth_of({"16UC1; compressedDepth rvl", grey}, depth, header, units, problem));
    EXPECT_NE(problem.find("compressedDepth rvl"), std::string::npos) << problem;
    const std::vector<std::uint16_t> values = depth_values();
    EXPECT_FALSE(
        packed_colour_of({"", png_bytes(values.data(), kWidth, kHeight, PngPixels::kGrey16)}, pixels, header, problem));
    const Bytes wide(4097, 7);
    EXPECT_FALSE(packed_colour_of({"", png_bytes(wide.data(), 4097, 1, PngPixels::kGrey8)}, pixels, header, problem));
    EXPECT_NE(problem.find("4097x1"), std::string::npos) << problem;
}

// Promise: a topic is known as packed by what image_transport puts behind its name.
TEST(PackedImages, TopicsAreKnownByName) {
    EXPECT_TRUE(is_packed_topic("/camera/color/image_raw/compressed"));
    EXPECT_TRUE(is_packed_topic("/camera/depth/image_raw/compressedDepth"));
    EXPECT_FALSE(is_packed_topic("/camera/color/image_raw"));
    EXPECT_FALSE(is_packed_topic("/compressed/image_raw"));
}

}  // namespace
}  // namespace stillmesh::packed_images_test
