#include "hal/ros2/packed_images.hpp"

#include "hal/replay/image_reader.hpp"
#include "hal/replay/packed_depth.hpp"
#include "hal/replay/png_reader.hpp"
#include "hal/ros2/ros2_images.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] bool read_header(std::span<const std::uint8_t> bytes, ImageHeader& header, std::string& problem) {
    const Status status = is_png(bytes) ? decode_png_header(bytes, "it", header, problem)
                                        : decode_other_image(bytes, "it", header, {}, problem);
    if (status != Status::kOk) {
        problem = "cannot be unpacked: " + problem;
        return false;
    }
    if (header.width <= kRosImageSideMax && header.height <= kRosImageSideMax) return true;
    problem = "is " + std::to_string(header.width) + "x" + std::to_string(header.height) + ": larger than 4096 px.";
    return false;
}

[[nodiscard]] bool read_pixels(std::span<const std::uint8_t> bytes, ImageHeader header, std::span<std::uint8_t> pixels,
                               std::string& problem) {
    const Status status = is_png(bytes) ? decode_png(bytes, "it", header, pixels, problem)
                                        : decode_other_image(bytes, "it", header, pixels, problem);
    if (status == Status::kOk) return true;
    problem = "cannot be unpacked: " + problem;
    return false;
}

}  // namespace

bool is_packed_topic(std::string_view name) {
    return name.ends_with("/compressed") || name.ends_with("/compressedDepth");
}

bool packed_colour_of(const RosPackedView& image, std::vector<std::uint8_t>& pixels, ImageHeader& header,
                      std::string& problem) {
    if (!read_header(image.bytes, header, problem)) return false;
    if (header.kind == ImageKind::kGrey16) {
        problem = "has 16 bits, as depth has; give the topic of colour first.";
        return false;
    }
    pixels.resize(std::size_t{header.width} * header.height * bytes_per_pixel(header.kind));
    return read_pixels(image.bytes, header, pixels, problem);
}

bool packed_depth_of(const RosPackedView& image, std::vector<std::uint16_t>& pixels, ImageHeader& header,
                     double& units_per_m, std::string& problem) {
    PackedDepth packed{.png = image.bytes};
    if (image.format.find("compressedDepth") != std::string_view::npos &&
        !open_packed_depth(image.format, image.bytes, packed)) {
        problem = "has the format '" + std::string(image.format.substr(0, 48)) + "'; of compressedDepth, PNG is known.";
        return false;
    }
    if (!read_header(packed.png, header, problem)) return false;
    if (header.kind != ImageKind::kGrey16) {
        problem = "has no 16 bits, as depth has.";
        return false;
    }
    pixels.resize(std::size_t{header.width} * header.height);
    if (!read_pixels(packed.png, header, {reinterpret_cast<std::uint8_t*>(pixels.data()), pixels.size() * 2}, problem))
        return false;
    units_per_m = packed.is_in_metres ? kQuarters : kMillimetres;
    if (!packed.is_in_metres) return true;
    for (std::uint16_t& value : pixels) value = units_of_packed(packed.a, packed.b, value, kQuarters);
    return true;
}

}  // namespace stillmesh
