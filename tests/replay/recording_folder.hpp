// Writes small recordings in the TUM layout for tests: PNGs of known pixels in a folder that vanishes afterwards.
#pragma once

#include <spng.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.hpp"

namespace stillmesh::test {

inline void write_text(const std::string& file, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(file).parent_path());
    std::ofstream stream(file, std::ios::binary);
    stream << text;
    if (!stream.flush()) throw std::runtime_error("cannot write " + file);
}

[[nodiscard]] inline std::string read_text(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// `pixels` in the processor's byte order; colour_type and bit_depth as PNG numbers them.
[[nodiscard]] inline std::vector<std::uint8_t> encode_png(std::uint32_t width, std::uint32_t height,
                                                          std::uint8_t colour_type, std::uint8_t bit_depth,
                                                          const std::vector<std::uint8_t>& pixels) {
    spng_ctx* const context = spng_ctx_new(SPNG_CTX_ENCODER);
    spng_ihdr ihdr{};
    ihdr.width = width;
    ihdr.height = height;
    ihdr.color_type = colour_type;
    ihdr.bit_depth = bit_depth;
    int error = spng_set_option(context, SPNG_ENCODE_TO_BUFFER, 1);
    error = error != 0 ? error : spng_set_option(context, SPNG_IMG_COMPRESSION_LEVEL, 1);
    error = error != 0 ? error : spng_set_ihdr(context, &ihdr);
    error = error != 0 ? error
                       : spng_encode_image(context, pixels.data(), pixels.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
    if (error != 0) throw std::runtime_error(spng_strerror(error));
    std::size_t size = 0;
    auto* const bytes = static_cast<std::uint8_t*>(spng_get_png_buffer(context, &size, &error));
    std::vector<std::uint8_t> result(bytes, bytes + size);
    std::free(bytes);
    spng_ctx_free(context);
    return result;
}

inline void write_bytes(const std::string& file, const std::vector<std::uint8_t>& bytes) {
    write_text(file, std::string(bytes.begin(), bytes.end()));
}

// What a pixel of image number `index` is: any formula that tells rows, columns and images apart.
[[nodiscard]] inline std::uint8_t colour_byte(std::uint32_t index, std::size_t at) {
    return static_cast<std::uint8_t>(at * 7 + at / 31 + index * 13);
}
[[nodiscard]] inline std::uint16_t depth_value(std::uint32_t index, std::size_t at) {
    return static_cast<std::uint16_t>(5000 + at * 3 + index * 257);
}

inline void write_colour(const std::string& file, std::uint32_t width, std::uint32_t height, bool is_rgb,
                         std::uint32_t index) {
    std::vector<std::uint8_t> pixels(std::size_t{width} * height * (is_rgb ? 3 : 1));
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = colour_byte(index, i);
    write_bytes(file,
                encode_png(width, height, is_rgb ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE, 8, pixels));
}

inline void write_depth(const std::string& file, std::uint32_t width, std::uint32_t height, std::uint32_t index) {
    std::vector<std::uint8_t> bytes(std::size_t{width} * height * 2);
    auto* const values = reinterpret_cast<std::uint16_t*>(bytes.data());
    for (std::size_t i = 0; i < bytes.size() / 2; ++i) values[i] = depth_value(index, i);
    write_bytes(file, encode_png(width, height, SPNG_COLOR_TYPE_GRAYSCALE, 16, bytes));
}

inline constexpr const char* kCameraToml =
    "width = 64\nheight = 48\nfx = 52.5\nfy = 52.5\ncx = 31.5\ncy = 23.5\ndepth_units_per_m = 5000\n";

// Three frames of 64x48, 1/30 s apart, depth 2 ms behind colour.
inline void write_recording(const std::string& folder, bool is_rgb = false) {
    std::string rgb = "# colour\n";
    std::string depth = "# depth\n";
    for (std::uint32_t i = 0; i < 3; ++i) {
        const std::string number = std::to_string(i);
        write_colour(folder + "/rgb/" + number + ".png", 64, 48, is_rgb, i);
        write_depth(folder + "/depth/" + number + ".png", 64, 48, i);
        rgb += "100." + std::to_string(100 + 33 * i) + " rgb/" + number + ".png\n";
        depth += "100." + std::to_string(102 + 33 * i) + " depth/" + number + ".png\n";
    }
    write_text(folder + "/rgb.txt", rgb);
    write_text(folder + "/depth.txt", depth);
    write_text(folder + "/camera.toml", kCameraToml);
}

}  // namespace stillmesh::test
