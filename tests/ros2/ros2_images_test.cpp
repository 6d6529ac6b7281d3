#include "hal/ros2/ros2_images.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <vector>

namespace stillmesh::ros2_images_test {
namespace {

[[nodiscard]] std::vector<std::uint8_t> counted(std::size_t count) {
    std::vector<std::uint8_t> bytes(count);
    for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
    return bytes;
}

// Promise: colour keeps every byte of every pixel, whatever stands between the rows.
TEST(Ros2Images, ColourIsKept) {
    struct Case {
        const char* encoding;
        PixelFormat format;
        std::uint32_t channels;
    };
    for (const Case& c : {Case{"rgb8", PixelFormat::kRgb8, 3}, Case{"bgr8", PixelFormat::kBgr8, 3},
                          Case{"mono8", PixelFormat::kGrey8, 1}}) {
        const std::uint32_t step = 5 * c.channels + 3;
        const std::vector<std::uint8_t> bytes = counted(step * 3);
        std::vector<std::uint8_t> pixels;
        PixelFormat format{};
        std::string problem;
        ASSERT_TRUE(colour_of({5, 3, step, false, c.encoding, bytes}, pixels, format, problem)) << problem;
        EXPECT_EQ(format, c.format);
        ASSERT_EQ(pixels.size(), 15U * c.channels);
        for (std::size_t y = 0; y < 3; ++y) {
            EXPECT_EQ(std::memcmp(pixels.data() + y * 5 * c.channels, bytes.data() + y * step, 5 * c.channels), 0);
        }
    }
}

// Promise: millimetres stay as they are, metres become quarters of a millimetre; what is no measurement is 0.
TEST(Ros2Images, DepthIsKept) {
    const std::array<std::uint16_t, 4> millimetres{0, 1, 1234, 65535};
    std::vector<std::uint8_t> bytes(8);
    std::memcpy(bytes.data(), millimetres.data(), 8);
    std::vector<std::uint16_t> pixels;
    double units = 0;
    std::string problem;
    ASSERT_TRUE(depth_of({2, 2, 4, false, "16UC1", bytes}, pixels, units, problem)) << problem;
    EXPECT_EQ(units, 1000);
    EXPECT_TRUE(std::equal(pixels.begin(), pixels.end(), millimetres.begin()));

    constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
    const std::array<float, 9> metres{0, 1.25F, 2.0002F, kNan, kInf, -kInf, -1, 16.3F, 17};
    bytes.resize(36);
    std::memcpy(bytes.data(), metres.data(), 36);
    ASSERT_TRUE(depth_of({3, 3, 12, false, "32FC1", bytes}, pixels, units, problem)) << problem;
    EXPECT_EQ(units, 4000);
    EXPECT_EQ(pixels, (std::vector<std::uint16_t>{0, 5000, 8001, 0, 0, 0, 0, 65200, 0}));
}

// Promise: an image that says what it is not, or is of a kind that is not known, is refused and not read.
TEST(Ros2Images, WrongImagesAreRefused) {
    const std::vector<std::uint8_t> bytes = counted(30);
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    PixelFormat format{};
    double units = 0;
    const auto refuses = [&](const RosImageView& image, const char* words) {
        std::string problem;
        const bool is_refused = image.encoding.find('C') == std::string_view::npos
                                    ? !colour_of(image, colour, format, problem)
                                    : !depth_of(image, depth, units, problem);
        EXPECT_NE(problem.find(words), std::string::npos) << problem;
        return is_refused;
    };
    const std::uint32_t huge = std::numeric_limits<std::uint32_t>::max();
    EXPECT_TRUE(refuses({5, 2, 15, false, "yuv422", bytes}, "encoding 'yuv422'"));
    EXPECT_TRUE(refuses({5, 3, 15, false, "rgb8", bytes}, "5x3"));
    EXPECT_TRUE(refuses({5, 2, 14, false, "rgb8", bytes}, "14 bytes a row"));
    EXPECT_TRUE(refuses({0, 2, 15, false, "rgb8", bytes}, "0x2"));
    EXPECT_TRUE(refuses({huge, huge, huge, false, "mono8", bytes}, "4096"));
    EXPECT_TRUE(refuses({4096, 4096, huge, false, "mono8", bytes}, "4096"));
    EXPECT_TRUE(refuses({5, 3, 12, false, "16UC1", bytes}, "5x3"));
    EXPECT_TRUE(refuses({5, 3, 10, true, "16UC1", bytes}, "big-endian"));
    EXPECT_TRUE(refuses({5, 3, 10, false, "8UC1", bytes}, "encoding '8UC1'"));
    EXPECT_TRUE(refuses({2, 4, 8, false, "32FC1", bytes}, "2x4"));
}

// Promise: CameraInfo is read to the bit, with each lens that ROS names; what cannot be used is refused with its
// reason.
TEST(Ros2Images, LensesAreRead) {
    const std::array<double, 9> k{517.306408, 0, 318.64304, 0, 516.469215, 255.313989, 0, 0, 1};
    const std::array<double, 5> brown{0.262383, -0.953104, -0.005358, 0.002628, 1.163314};
    CameraInfo info;
    std::string problem;
    ASSERT_EQ(lens_of({640, 480, "plumb_bob", brown, k, false}, info, problem), Status::kOk) << problem;
    const CameraModel& model = info.model;
    EXPECT_EQ(model.width, 640U);
    EXPECT_EQ(model.height, 480U);
    EXPECT_EQ(model.fx, k[0]);
    EXPECT_EQ(model.fy, k[4]);
    EXPECT_EQ(model.cx, k[2]);
    EXPECT_EQ(model.cy, k[5]);
    EXPECT_EQ((std::array{model.k1, model.k2, model.p1, model.p2, model.k3}), brown);
    EXPECT_EQ(model.lens, Lens::kBrown);

    const std::array<double, 8> rational{0.1, 0.2, 0.001, 0.002, 0.03, 0.4, 0.05, 0.06};
    ASSERT_EQ(lens_of({640, 480, "rational_polynomial", rational, k, false}, info, problem), Status::kOk) << problem;
    EXPECT_EQ(info.model.k6, 0.06);
    const std::array<double, 4> fisheye{0.01, 0.02, -0.003, 0.0004};
    ASSERT_EQ(lens_of({640, 480, "equidistant", fisheye, k, false}, info, problem), Status::kOk) << problem;
    EXPECT_EQ(info.model.lens, Lens::kFisheye);
    ASSERT_EQ(lens_of({640, 480, "", {}, k, false}, info, problem), Status::kOk) << problem;
    EXPECT_EQ(info.model.k1, 0);

    const std::array<double, 9> none{};
    EXPECT_EQ(lens_of({640, 480, "plumb_bob", brown, none, false}, info, problem), Status::kInvalid);
    EXPECT_NE(problem.find("not calibrated"), std::string::npos) << problem;
    EXPECT_EQ(lens_of({640, 480, "plumb_bob", brown, k, true}, info, problem), Status::kInvalid);
    EXPECT_NE(problem.find("binned or cut"), std::string::npos) << problem;
    EXPECT_EQ(lens_of({640, 480, "plumb_bob\nfx: 3", brown, k, false}, info, problem), Status::kInvalid);
    EXPECT_EQ(lens_of({640, 480, "omnidirectional", brown, k, false}, info, problem), Status::kInvalid);
    const std::array<double, 9> by_columns{517, 0, 0, 0, 516, 0, 318, 255, 1};
    EXPECT_EQ(lens_of({640, 480, "plumb_bob", brown, by_columns, false}, info, problem), Status::kInvalid);
    EXPECT_NE(problem.find("last row"), std::string::npos) << problem;
    const std::array<double, 9> nan{std::numeric_limits<double>::quiet_NaN(), 0, 1, 0, 1, 1, 0, 0, 1};
    EXPECT_EQ(lens_of({640, 480, "plumb_bob", brown, nan, false}, info, problem), Status::kInvalid);
}

}  // namespace
}  // namespace stillmesh::ros2_images_test
