#include "hal/v4l2/pixel_formats.hpp"

#include <algorithm>

#include "engine/base/check.hpp"
#include "hal/replay/jpeg_decoder.hpp"

namespace stillmesh::v4l2 {
namespace {

[[nodiscard]] std::uint8_t clamped(int value) noexcept {
    return static_cast<std::uint8_t>(std::clamp(value, 0, 255));
}

// ITU-R BT.601 with luma from 16 to 235, which USB video cameras send unless they say otherwise; coefficients times
// 256, rounded.
void write_rgb(int y, int u, int v, std::uint8_t* rgb) noexcept {
    const int luma = 298 * (y - 16) + 128;
    rgb[0] = clamped((luma + 409 * (v - 128)) >> 8);
    rgb[1] = clamped((luma - 100 * (u - 128) - 208 * (v - 128)) >> 8);
    rgb[2] = clamped((luma + 516 * (u - 128)) >> 8);
}

// Two pixels share one U and one V. `luma`: where Y stands in each pair of bytes. An odd last column takes the pair's U
// and, where the row ends before V, none of it.
void convert_yuv(const V4l2Format& format, const std::uint8_t* bytes, std::uint32_t luma, std::uint8_t* out) noexcept {
    const std::uint32_t chroma = 1 - luma;
    for (std::uint32_t y = 0; y < format.height; ++y) {
        const std::uint8_t* row = bytes + std::size_t{y} * format.bytes_per_line;
        std::uint8_t* rgb = out + std::size_t{y} * format.width * 3;
        std::uint32_t x = 0;
        for (; x + 1 < format.width; x += 2, row += 4, rgb += 6) {
            const int u = row[chroma], v = row[chroma + 2];
            write_rgb(row[luma], u, v, rgb);
            write_rgb(row[luma + 2], u, v, rgb + 3);
        }
        if (x < format.width) write_rgb(row[luma], row[chroma], 128, rgb);
    }
}

Status convert_jpeg(const V4l2Format& format, std::span<const std::uint8_t> bytes, std::span<std::uint8_t> pixels,
                    std::string& message) {
    ImageHeader header;
    const std::string name = "a JPEG image of the camera";
    STILLMESH_TRY(decode_jpeg(bytes, name, header, {}, message));
    if (header.width != format.width || header.height != format.height) {
        message = name + " has " + std::to_string(header.width) + "x" + std::to_string(header.height) + " pixels.";
        return Status::kCorrupt;
    }
    const bool is_grey = header.kind == ImageKind::kGrey8;
    const std::size_t count = std::size_t{format.width} * format.height;
    // A grey one fills the last third, and is spread from there.
    const std::span<std::uint8_t> target = is_grey ? pixels.last(count) : pixels;
    STILLMESH_TRY(decode_jpeg(bytes, name, header, target, message));
    for (std::size_t i = 0; is_grey && i < count; ++i) {
        const std::uint8_t grey = target[i];
        pixels[3 * i] = pixels[3 * i + 1] = pixels[3 * i + 2] = grey;
    }
    return Status::kOk;
}

}  // namespace

std::string fourcc_text(std::uint32_t code) {
    std::string text;
    for (std::uint32_t i = 0; i < 4; ++i) {
        const char letter = static_cast<char>(code >> (8 * i) & 0xffU);
        text += letter >= ' ' && letter <= '~' ? letter : '?';
    }
    while (!text.empty() && text.back() == ' ') text.pop_back();
    return text;
}

std::uint32_t bytes_per_pixel(std::uint32_t code) noexcept {
    switch (code) {
        case kZ16:
        case kY16:
        case kY8i:
        case kUyvy:
        case kYuyv: return 2;
        case kRgb3: return 3;
        case kGrey: return 1;
        default: return 0;
    }
}

bool has_jpeg() noexcept {
#ifdef STILLMESH_HAS_JPEG
    return true;
#else
    return false;
#endif
}

bool is_whole(const V4l2Format& format, std::size_t bytes_used) noexcept {
    if (format.width == 0 || format.height == 0) return false;
    const std::uint32_t bytes = bytes_per_pixel(format.fourcc);
    if (bytes == 0) return bytes_used > 0 && bytes_used <= format.bytes;
    const std::size_t row = std::size_t{format.width} * bytes;
    return format.bytes_per_line >= row && bytes_used <= format.bytes &&
           bytes_used >= std::size_t{format.bytes_per_line} * (format.height - 1) + row;
}

Status convert_colour(const V4l2Format& format, std::span<const std::uint8_t> bytes, std::span<std::uint8_t> pixels,
                      std::string& message) {
    const std::size_t channels = channels_of(engine_format(format.fourcc));
    STILLMESH_CHECK(is_colour(format.fourcc) && is_whole(format, bytes.size()));
    STILLMESH_CHECK(pixels.size() == std::size_t{format.width} * format.height * channels);
    if (format.fourcc == kMjpg) return convert_jpeg(format, bytes, pixels, message);
    if (format.fourcc == kYuyv || format.fourcc == kUyvy) {
        convert_yuv(format, bytes.data(), format.fourcc == kUyvy ? 1 : 0, pixels.data());
        return Status::kOk;
    }
    const std::size_t row_bytes = std::size_t{format.width} * channels;
    for (std::uint32_t y = 0; y < format.height; ++y) {
        const std::uint8_t* const row = bytes.data() + std::size_t{y} * format.bytes_per_line;
        std::uint8_t* const out = pixels.data() + y * row_bytes;
        if (format.fourcc == kY8i) {
            // Left and right camera take turns; depth is in the left one's view.
            for (std::uint32_t x = 0; x < format.width; ++x) out[x] = row[std::size_t{2} * x];
        } else {
            std::copy_n(row, row_bytes, out);
        }
    }
    return Status::kOk;
}

}  // namespace stillmesh::v4l2
