#include "platform/report/picture_writer.hpp"

#include <spng.h>

#include <cstdlib>

#include "platform/report/jpeg_writer.hpp"

namespace stillmesh {

std::vector<std::uint8_t> encode_grey_png(const Frame& frame) {
    const std::uint32_t width = frame.colour.width;
    const std::uint32_t height = frame.colour.height;
    std::vector<std::uint8_t> grey;
    grey.reserve(std::size_t{width} * height);
    for (std::uint32_t y = 0; y < height; ++y) {
        const std::uint8_t* const row = frame.colour.row(y);
        for (std::uint32_t x = 0; x < width; ++x) {
            const std::size_t at = std::size_t{x} * channels_of(frame.format);
            // The mean of three: a picture to look at, nothing is measured in it.
            grey.push_back(channels_of(frame.format) == 1
                               ? row[at]
                               : static_cast<std::uint8_t>((row[at] + 2 * row[at + 1] + row[at + 2]) / 4));
        }
    }
    spng_ctx* const context = spng_ctx_new(SPNG_CTX_ENCODER);
    if (context == nullptr) return {};
    spng_ihdr ihdr{};
    ihdr.width = width;
    ihdr.height = height;
    ihdr.color_type = SPNG_COLOR_TYPE_GRAYSCALE;
    ihdr.bit_depth = 8;
    std::vector<std::uint8_t> result;
    int error = spng_set_option(context, SPNG_ENCODE_TO_BUFFER, 1);
    if (error == 0) error = spng_set_option(context, SPNG_IMG_COMPRESSION_LEVEL, 4);
    if (error == 0) error = spng_set_ihdr(context, &ihdr);
    if (error == 0) error = spng_encode_image(context, grey.data(), grey.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
    if (error == 0) {
        std::size_t size = 0;
        auto* const bytes = static_cast<std::uint8_t*>(spng_get_png_buffer(context, &size, &error));
        if (bytes != nullptr) result.assign(bytes, bytes + size);
        std::free(bytes);
    }
    spng_ctx_free(context);
    return result;
}

std::vector<std::uint8_t> encode_small_picture(std::span<const std::uint8_t> grey, std::uint32_t width,
                                               std::uint32_t height, bool& is_jpeg) {
    std::vector<std::uint8_t> bytes;
    is_jpeg = encode_grey_jpeg(grey, width, height, bytes);
    if (is_jpeg || width == 0 || height == 0) return bytes;
    Frame frame;
    frame.colour = {grey.data(), width, height, width};
    return encode_grey_png(frame);
}

std::string base64(std::span<const std::uint8_t> bytes) {
    constexpr const char* kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t word = static_cast<std::uint32_t>(bytes[i]) << 16U;
        if (i + 1 < bytes.size()) word |= static_cast<std::uint32_t>(bytes[i + 1]) << 8U;
        if (i + 2 < bytes.size()) word |= bytes[i + 2];
        text += kLetters[word >> 18U];
        text += kLetters[(word >> 12U) & 63U];
        text += i + 1 < bytes.size() ? kLetters[(word >> 6U) & 63U] : '=';
        text += i + 2 < bytes.size() ? kLetters[word & 63U] : '=';
    }
    return text;
}

}  // namespace stillmesh
