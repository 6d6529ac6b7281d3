#include "platform/record/png_file.hpp"

#include <spng.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace stillmesh {

std::string write_png_file(const std::string& file, const void* pixels, std::uint32_t width, std::uint32_t height,
                           PngPixels kind) {
    const std::unique_ptr<spng_ctx, void (*)(spng_ctx*)> context(spng_ctx_new(SPNG_CTX_ENCODER), spng_ctx_free);
    if (context == nullptr) return file + ": out of memory.";
    static_cast<void>(spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1));
    static_cast<void>(spng_set_option(context.get(), SPNG_IMG_COMPRESSION_LEVEL, 1));
    static_cast<void>(spng_set_option(context.get(), SPNG_FILTER_CHOICE, SPNG_FILTER_CHOICE_SUB));
    spng_ihdr header{};
    header.width = width;
    header.height = height;
    header.bit_depth = kind == PngPixels::kGrey16 ? 16 : 8;
    header.color_type = kind == PngPixels::kRgb8 ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE;
    const std::size_t pixel_bytes = kind == PngPixels::kRgb8 ? 3 : kind == PngPixels::kGrey16 ? 2 : 1;
    int error = spng_set_ihdr(context.get(), &header);
    if (error == 0) {
        error = spng_encode_image(context.get(), pixels, std::size_t{width} * height * pixel_bytes, SPNG_FMT_PNG,
                                  SPNG_ENCODE_FINALIZE);
    }
    std::size_t png_size = 0;
    const std::unique_ptr<void, void (*)(void*)> png(
        error == 0 ? spng_get_png_buffer(context.get(), &png_size, &error) : nullptr, std::free);
    if (png == nullptr) return file + ": " + spng_strerror(error) + ".";
    std::FILE* const stream = std::fopen(file.c_str(), "wbe");
    if (stream == nullptr) return file + ": " + std::strerror(errno) + ".";
    const bool is_written = std::fwrite(png.get(), 1, png_size, stream) == png_size;
    if (std::fclose(stream) != 0 || !is_written) return file + ": " + std::strerror(errno) + ".";
    return {};
}

}  // namespace stillmesh
