// What an image of a bag is, and its pixels: sensor_msgs/Image in the encodings that RGB-D cameras give, and
// CompressedImage (JPEG, PNG, compressedDepth). Colour becomes 8-bit grey or RGB (of YUV the luma: the engine tracks
// grey), depth 16 bits: what a bag has in millimetres as it is, what it has in metres in the units asked for. Source:
// sensor_msgs/image_encodings.hpp; compressedDepth: packed_depth.hpp. Cost: a pass over the pixels, or that of PNG or
// JPEG. Any bytes are safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/base/status.hpp"
#include "hal/bag/bag_reader.hpp"
#include "hal/replay/image_header.hpp"
#include "hal/replay/one_view.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kBagImageSideMax = 16384;  // px

enum class PixelCoding : std::uint8_t {
    kMono8,
    kRgb8,
    kBgr8,
    kRgba8,
    kBgra8,
    kUyvy,         // yuv422
    kYuyv,         // yuv422_yuy2
    kPacked,       // colour as JPEG or PNG
    kDepth16,      // millimetres
    kDepthFloat,   // metres
    kPacked16,     // millimetres as PNG
    kPackedFloat,  // compressedDepth of metres: quantised inverse depth as PNG
    kOther,
};
[[nodiscard]] constexpr bool is_depth(PixelCoding coding) noexcept {
    return coding >= PixelCoding::kDepth16 && coding != PixelCoding::kOther;
}
[[nodiscard]] constexpr bool is_colour(PixelCoding coding) noexcept {
    return coding < PixelCoding::kDepth16;
}
[[nodiscard]] constexpr bool is_in_metres(PixelCoding coding) noexcept {
    return coding == PixelCoding::kDepthFloat || coding == PixelCoding::kPackedFloat;
}

struct BagImage {
    MessageHeader header;
    ImageSize size;
    PixelCoding coding = PixelCoding::kOther;
    ImageKind kind = ImageKind::kGrey8;  // of what comes out
    std::string_view encoding;           // as the message calls it
    bool is_bigendian = false;
    std::size_t step = 0;                // bytes from row to row
    std::span<const std::uint8_t> data;  // rows, or a JPEG or PNG
    float a = 0, b = 0;                  // of kPackedFloat
};

// kOk, also for kOther, whose encoding is not read.    kCorrupt: no such message, or one that has less bytes than its
// size says; `message` names topic and problem.
[[nodiscard]] Status read_bag_image(const BagTopic& topic, std::span<const std::uint8_t> bytes, BagImage& out,
                                    std::string& message);

// Of an image that is_colour: all its pixels, without padding; `pixels` is exactly as large (CHECK). kCorrupt: its JPEG
// or PNG is broken.    kInvalid: a kind of JPEG that is not read.
[[nodiscard]] Status colour_pixels(const BagImage& image, const std::string& topic, std::span<std::uint8_t> pixels,
                                   std::string& message);
// Of an image that is_depth, likewise. `units_per_m` is used where it is in metres; what is nearer than half a unit,
// farther than 65535 or no number is 0.
[[nodiscard]] Status depth_pixels(const BagImage& image, const std::string& topic, double units_per_m,
                                  std::span<std::uint16_t> pixels, std::string& message);

}  // namespace stillmesh
