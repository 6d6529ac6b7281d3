#include "hal/bag/bag_images.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "hal/replay/image_reader.hpp"
#include "hal/replay/packed_depth.hpp"
#include "hal/replay/png_reader.hpp"

namespace stillmesh {
namespace {

using Bytes = std::span<const std::uint8_t>;

struct Encoding {
    std::string_view name;
    PixelCoding coding;
};
constexpr Encoding kEncodings[] = {
    {"mono8", PixelCoding::kMono8},   {"8UC1", PixelCoding::kMono8},       {"rgb8", PixelCoding::kRgb8},
    {"bgr8", PixelCoding::kBgr8},     {"8UC3", PixelCoding::kBgr8},        {"rgba8", PixelCoding::kRgba8},
    {"bgra8", PixelCoding::kBgra8},   {"8UC4", PixelCoding::kBgra8},       {"yuv422", PixelCoding::kUyvy},
    {"uyvy", PixelCoding::kUyvy},     {"yuv422_yuy2", PixelCoding::kYuyv}, {"yuyv", PixelCoding::kYuyv},
    {"16UC1", PixelCoding::kDepth16}, {"mono16", PixelCoding::kDepth16},   {"32FC1", PixelCoding::kDepthFloat}};

[[nodiscard]] std::size_t source_bytes(PixelCoding coding) {
    switch (coding) {
        case PixelCoding::kMono8: return 1;
        case PixelCoding::kRgb8:
        case PixelCoding::kBgr8: return 3;
        case PixelCoding::kUyvy:
        case PixelCoding::kYuyv:
        case PixelCoding::kDepth16: return 2;
        default: return 4;
    }
}
[[nodiscard]] bool is_rgb(PixelCoding coding) {
    return coding >= PixelCoding::kRgb8 && coding <= PixelCoding::kBgra8;
}

Status fail(Status status, const std::string& topic, const std::string& sentence, std::string& message) {
    message = "topic " + topic + ": " + sentence;
    return status;
}

[[nodiscard]] float float_at(const std::uint8_t* p, bool is_bigendian) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, p, 4);
    if (is_bigendian == (std::endian::native == std::endian::little)) {
        bits = bits >> 24U | (bits >> 8U & 0xff00U) | (bits << 8U & 0xff0000U) | bits << 24U;
    }
    return std::bit_cast<float>(bits);
}

[[nodiscard]] std::uint16_t units_of(double metres, double units_per_m) {
    const double units = metres * units_per_m + 0.5;
    return units >= 1 && units < 65536 ? static_cast<std::uint16_t>(units) : std::uint16_t{0};
}

Status read_raw(const BagTopic& topic, Bytes bytes, BagImage& out, std::string& message) {
    ImageMessage image;
    if (!read_message(bytes, topic.layout, image)) {
        return fail(Status::kCorrupt, topic.name, "a message that is no Image: passed over.", message);
    }
    out.header = image.header;
    out.size = {image.width, image.height};
    out.encoding = image.encoding;
    out.is_bigendian = image.is_bigendian;
    out.step = image.step;
    out.data = image.data;
    const auto* const known = std::find_if(std::begin(kEncodings), std::end(kEncodings),
                                           [&](const Encoding& e) { return e.name == image.encoding; });
    out.coding = known == std::end(kEncodings) ? PixelCoding::kOther : known->coding;
    if (out.coding == PixelCoding::kOther) return Status::kOk;
    out.kind = is_depth(out.coding) ? ImageKind::kGrey16 : is_rgb(out.coding) ? ImageKind::kRgb8 : ImageKind::kGrey8;
    const std::size_t row_bytes = source_bytes(out.coding) * image.width;
    if (image.width == 0 || image.height == 0 || image.width > kBagImageSideMax || image.height > kBagImageSideMax ||
        out.step < row_bytes || image.data.size() / out.step < image.height - 1 ||
        image.data.size() - out.step * (image.height - 1) < row_bytes) {
        return fail(Status::kCorrupt, topic.name,
                    "an image of " + std::to_string(image.width) + "x" + std::to_string(image.height) +
                        " that has other bytes than that: passed over.",
                    message);
    }
    return Status::kOk;
}

Status read_packed_header(const BagTopic& topic, BagImage& out, std::string& message) {
    ImageHeader header;
    STILLMESH_TRY(is_png(out.data) ? decode_png_header(out.data, "topic " + topic.name, header, message)
                                   : decode_other_image(out.data, "topic " + topic.name, header, {}, message));
    out.size = {header.width, header.height};
    out.kind = header.kind;
    return Status::kOk;
}

Status read_compressed(const BagTopic& topic, Bytes bytes, BagImage& out, std::string& message) {
    CompressedMessage image;
    if (!read_message(bytes, topic.layout, image)) {
        return fail(Status::kCorrupt, topic.name, "a message that is no CompressedImage: passed over.", message);
    }
    out.header = image.header;
    out.encoding = image.format;
    out.data = image.data;
    const bool is_of_depth = image.format.find("compressedDepth") != std::string_view::npos;
    PackedDepth packed;
    if (is_of_depth) {
        if (!open_packed_depth(image.format, out.data, packed)) return Status::kOk;  // RVL
        out.a = packed.a;
        out.b = packed.b;
        out.data = packed.png;
    }
    STILLMESH_TRY(read_packed_header(topic, out, message));
    if (out.kind == ImageKind::kGrey16) {
        out.coding = packed.is_in_metres ? PixelCoding::kPackedFloat : PixelCoding::kPacked16;
    } else if (!is_of_depth) {
        out.coding = PixelCoding::kPacked;
    }
    return Status::kOk;
}

Status unpack_pixels(const BagImage& image, const std::string& topic, std::span<std::uint8_t> pixels,
                     std::string& message) {
    const std::string name = "topic " + topic;
    ImageHeader header{image.size.width, image.size.height, image.kind};
    return is_png(image.data) ? decode_png(image.data, name, header, pixels, message)
                              : decode_other_image(image.data, name, header, pixels, message);
}

}  // namespace

Status read_bag_image(const BagTopic& topic, std::span<const std::uint8_t> bytes, BagImage& out, std::string& message) {
    out = {};
    return topic.type == kImageType ? read_raw(topic, bytes, out, message)
                                    : read_compressed(topic, bytes, out, message);
}

Status colour_pixels(const BagImage& image, const std::string& topic, std::span<std::uint8_t> pixels,
                     std::string& message) {
    const std::size_t width = image.size.width;
    STILLMESH_CHECK(is_colour(image.coding) &&
                    pixels.size() == width * image.size.height * bytes_per_pixel(image.kind));
    if (image.coding == PixelCoding::kPacked) return unpack_pixels(image, topic, pixels, message);
    const std::size_t source = source_bytes(image.coding);
    const bool is_swapped = image.coding == PixelCoding::kBgr8 || image.coding == PixelCoding::kBgra8;
    const std::size_t luma = image.coding == PixelCoding::kUyvy ? 1 : 0;
    std::uint8_t* to = pixels.data();
    for (std::uint32_t y = 0; y < image.size.height; ++y) {
        const std::uint8_t* from = image.data.data() + y * image.step;
        if (!is_rgb(image.coding)) {
            for (std::size_t x = 0; x < width; ++x) *to++ = from[x * source + luma];
            continue;
        }
        for (std::size_t x = 0; x < width; ++x, from += source) {
            *to++ = from[is_swapped ? 2 : 0];
            *to++ = from[1];
            *to++ = from[is_swapped ? 0 : 2];
        }
    }
    return Status::kOk;
}

Status depth_pixels(const BagImage& image, const std::string& topic, double units_per_m,
                    std::span<std::uint16_t> pixels, std::string& message) {
    const std::size_t width = image.size.width;
    STILLMESH_CHECK(is_depth(image.coding) && pixels.size() == width * image.size.height);
    if (image.coding == PixelCoding::kPacked16 || image.coding == PixelCoding::kPackedFloat) {
        const std::span bytes(reinterpret_cast<std::uint8_t*>(pixels.data()), pixels.size() * 2);
        STILLMESH_TRY(unpack_pixels(image, topic, bytes, message));
        if (image.coding == PixelCoding::kPacked16) return Status::kOk;
        for (std::uint16_t& value : pixels) value = units_of_packed(image.a, image.b, value, units_per_m);
        return Status::kOk;
    }
    const std::size_t high = image.is_bigendian ? 0 : 1;
    for (std::uint32_t y = 0; y < image.size.height; ++y) {
        const std::uint8_t* const from = image.data.data() + y * image.step;
        std::uint16_t* const to = &pixels[y * width];
        if (image.coding == PixelCoding::kDepth16) {
            for (std::size_t x = 0; x < width; ++x) {
                to[x] = static_cast<std::uint16_t>(from[2 * x + high] << 8U | from[2 * x + 1 - high]);
            }
            continue;
        }
        for (std::size_t x = 0; x < width; ++x) {
            to[x] = units_of(double{float_at(from + 4 * x, image.is_bigendian)}, units_per_m);
        }
    }
    return Status::kOk;
}

}  // namespace stillmesh
