// An image, packed or not, and a calibration of ROS 2 whose fields say anything: refused with a sentence, or pixels of
// the size that they say and a lens of finite numbers.
#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "fuzz/fuzz.hpp"
#include "hal/ros2/packed_images.hpp"
#include "hal/ros2/ros2_images.hpp"

namespace {

using namespace stillmesh;

void read_image(const RosImageView& image) {
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    PixelFormat format{};
    double units_per_m = 0;
    std::string problem;
    const std::size_t pixels = std::size_t{image.width} * image.height;
    if (colour_of(image, colour, format, problem)) {
        fuzz::expect(colour.size() == pixels * channels_of(format), "colour has the size that it says");
    } else {
        fuzz::expect(!problem.empty(), "a refusal has a reason");
    }
    problem.clear();
    if (depth_of(image, depth, units_per_m, problem)) {
        fuzz::expect(depth.size() == pixels && units_per_m >= 1000, "depth has the size that it says");
    } else {
        fuzz::expect(!problem.empty(), "a refusal has a reason");
    }
}

void read_packed(const RosPackedView& image) {
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    ImageHeader header;
    double units_per_m = 0;
    std::string problem;
    if (packed_colour_of(image, colour, header, problem)) {
        fuzz::expect(colour.size() == std::size_t{header.width} * header.height * bytes_per_pixel(header.kind) &&
                         header.kind != ImageKind::kGrey16 && header.width <= kRosImageSideMax,
                     "colour has the size that it says");
    } else {
        fuzz::expect(!problem.empty(), "a refusal has a reason");
    }
    problem.clear();
    if (packed_depth_of(image, depth, header, units_per_m, problem)) {
        fuzz::expect(depth.size() == std::size_t{header.width} * header.height && units_per_m >= 1000,
                     "depth has the size that it says");
    } else {
        fuzz::expect(!problem.empty(), "a refusal has a reason");
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    constexpr std::array<std::string_view, 8> kEncodings = {"rgb8",  "bgr8",   "mono8", "16UC1",
                                                            "32FC1", "mono16", "",      "bayer_rggb8"};
    fuzz::Bytes bytes({data, size_bytes});
    const std::uint8_t kind = bytes.u8();
    constexpr std::array<std::string_view, 4> kFormats = {"16UC1; compressedDepth png", "32FC1; compressedDepth", "",
                                                          "rgb8; jpeg compressed bgr8"};
    if ((kind & 0xC0U) == 0xC0U) {
        read_packed({kFormats[kind & 3U], bytes.rest()});
        return 0;
    }
    if ((kind & 0x80U) != 0) {
        RosImageView image;
        image.encoding = kEncodings[kind & 7U];
        image.is_bigendian = (kind & 8U) != 0;
        const bool is_small = (kind & 16U) != 0;
        image.width = is_small ? bytes.u8() : bytes.u32();
        image.height = is_small ? bytes.u8() : bytes.u32();
        image.step = is_small ? bytes.u16() : bytes.u32();
        image.bytes = bytes.rest();
        read_image(image);
        return 0;
    }
    std::array<double, 9> k{};
    for (double& number : k) number = std::bit_cast<double>(bytes.u64());
    std::vector<double> d(kind & 15U);
    for (double& number : d) number = std::bit_cast<double>(bytes.u64());
    RosLensView lens{bytes.u16(), bytes.u16(), {}, d, k, (kind & 16U) != 0};
    lens.model = {reinterpret_cast<const char*>(bytes.rest().data()), bytes.rest().size()};
    CameraInfo info;
    std::string problem;
    if (lens_of(lens, info, problem) != Status::kOk) {
        fuzz::expect(!problem.empty(), "a refusal has a reason");
        return 0;
    }
    const CameraModel& model = info.model;
    fuzz::expect(model.fx == k[0] && model.cy == k[5], "the lens is that of the message");
    for (const double number : {model.fx, model.fy, model.cx, model.cy, model.k1, model.k2, model.p1, model.p2,
                                model.k3, model.k4, model.k5, model.k6}) {
        fuzz::expect(std::isfinite(number), "a lens has finite numbers");
    }
    return 0;
}
