#include "hal/replay/png_reader.hpp"

#include <fcntl.h>
#include <spng.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

namespace stillmesh {
namespace {

struct CloseContext {
    void operator()(spng_ctx* context) const noexcept { spng_ctx_free(context); }
};
using Context = std::unique_ptr<spng_ctx, CloseContext>;

struct CloseFile {
    void operator()(std::FILE* file) const noexcept { static_cast<void>(std::fclose(file)); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

// Larger than any image of ours; keeps a wild header from being worth anything.
constexpr std::uint32_t kSideMax = 16384;
// Text and colour profiles in a PNG are nothing to us; libspng may hold this much of them.
constexpr std::size_t kChunkBytesMax = 1024 * 1024;

[[nodiscard]] const char* kind_text(PngKind kind) noexcept {
    switch (kind) {
        case PngKind::kGrey8: return "8-bit grey";
        case PngKind::kRgb8: return "8-bit RGB";
        case PngKind::kGrey16: return "16-bit grey";
    }
    return "unknown";
}

Status spng_failure(const std::string& name, int error, std::string& message) {
    const bool is_short = error == SPNG_IO_EOF || error == SPNG_EOI;
    message = name + ": " +
              (is_short ? std::string("the PNG is truncated")
                        : std::string("cannot be read as PNG (") + spng_strerror(error) + ")") +
              "; copy the recording again or remove this image from its list.";
    return Status::kCorrupt;
}

Status open_context(Context& context, const std::string& name, std::string& message) {
    context.reset(spng_ctx_new(0));
    if (context == nullptr) {
        message = name + ": no memory left to decode it.";
        return Status::kUnavailable;
    }
    static_cast<void>(spng_set_image_limits(context.get(), kSideMax, kSideMax));
    static_cast<void>(spng_set_chunk_limits(context.get(), kChunkBytesMax, kChunkBytesMax));
    return Status::kOk;
}

Status header_of(spng_ctx* context, const std::string& name, PngHeader& header, std::string& message) {
    spng_ihdr ihdr{};
    if (const int error = spng_get_ihdr(context, &ihdr); error != 0) return spng_failure(name, error, message);
    const bool is_grey = ihdr.color_type == SPNG_COLOR_TYPE_GRAYSCALE;
    const bool is_rgb = ihdr.color_type == SPNG_COLOR_TYPE_TRUECOLOR;
    if (!(is_grey && (ihdr.bit_depth == 8 || ihdr.bit_depth == 16)) && !(is_rgb && ihdr.bit_depth == 8)) {
        message = name + ": this kind of PNG (" + std::to_string(ihdr.bit_depth) + " bit, colour type " +
                  std::to_string(ihdr.color_type) +
                  ") is not supported; convert colour to 8-bit grey or RGB and depth to 16-bit grey.";
        return Status::kInvalid;
    }
    header = {ihdr.width, ihdr.height,
              is_rgb ? PngKind::kRgb8 : (ihdr.bit_depth == 16 ? PngKind::kGrey16 : PngKind::kGrey8)};
    return Status::kOk;
}

Status pixels_of(spng_ctx* context, const std::string& name, const PngHeader& expected, std::span<std::uint8_t> pixels,
                 std::string& message) {
    PngHeader header;
    STILLMESH_TRY(header_of(context, name, header, message));
    if (header.width != expected.width || header.height != expected.height) {
        message = name + ": the image is " + std::to_string(header.width) + "x" + std::to_string(header.height) +
                  " pixels, expected " + std::to_string(expected.width) + "x" + std::to_string(expected.height) +
                  "; all images of a recording must have one size, depth registered to colour.";
        return Status::kCorrupt;
    }
    if (header.kind != expected.kind) {
        message = name + ": the image is " + kind_text(header.kind) + ", expected " + kind_text(expected.kind) +
                  "; convert it.";
        return Status::kCorrupt;
    }
    // SPNG_FMT_PNG: as stored, 16-bit samples in the processor's byte order.
    std::size_t size_bytes = 0;
    if (const int error = spng_decoded_image_size(context, SPNG_FMT_PNG, &size_bytes); error != 0) {
        return spng_failure(name, error, message);
    }
    if (size_bytes != pixels.size()) {
        message = name + ": the image does not fit its buffer.";
        return Status::kCorrupt;
    }
    if (const int error = spng_decode_image(context, pixels.data(), pixels.size(), SPNG_FMT_PNG, 0); error != 0) {
        return spng_failure(name, error, message);
    }
    return Status::kOk;
}

Status open_file(const std::string& name, File& file, std::string& message) {
    // O_NONBLOCK: opening a pipe would wait for its writer.
    const int descriptor = ::open(name.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat status {};
    const bool is_file = descriptor >= 0 && ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
    if (is_file) file.reset(::fdopen(descriptor, "rb"));
    if (file != nullptr) return Status::kOk;
    message = descriptor >= 0 && !is_file
                  ? name + ": is no regular file; is the recording complete?"
                  : name + ": cannot be opened: " + std::strerror(errno) + "; is the recording complete?";
    if (descriptor >= 0) static_cast<void>(::close(descriptor));
    return Status::kUnavailable;
}

}  // namespace

Status read_png_header(const std::string& file, PngHeader& header, std::string& message) {
    File stream;
    STILLMESH_TRY(open_file(file, stream, message));
    Context context;
    STILLMESH_TRY(open_context(context, file, message));
    if (const int error = spng_set_png_file(context.get(), stream.get()); error != 0) {
        return spng_failure(file, error, message);
    }
    return header_of(context.get(), file, header, message);
}

Status read_png(const std::string& file, const PngHeader& expected, std::span<std::uint8_t> pixels,
                std::string& message) {
    File stream;
    STILLMESH_TRY(open_file(file, stream, message));
    Context context;
    STILLMESH_TRY(open_context(context, file, message));
    if (const int error = spng_set_png_file(context.get(), stream.get()); error != 0) {
        return spng_failure(file, error, message);
    }
    return pixels_of(context.get(), file, expected, pixels, message);
}

Status decode_png_header(std::span<const std::uint8_t> bytes, const std::string& name, PngHeader& header,
                         std::string& message) {
    Context context;
    STILLMESH_TRY(open_context(context, name, message));
    if (const int error = spng_set_png_buffer(context.get(), bytes.data(), bytes.size()); error != 0) {
        return spng_failure(name, error, message);
    }
    return header_of(context.get(), name, header, message);
}

Status decode_png(std::span<const std::uint8_t> bytes, const std::string& name, const PngHeader& expected,
                  std::span<std::uint8_t> pixels, std::string& message) {
    Context context;
    STILLMESH_TRY(open_context(context, name, message));
    if (const int error = spng_set_png_buffer(context.get(), bytes.data(), bytes.size()); error != 0) {
        return spng_failure(name, error, message);
    }
    return pixels_of(context.get(), name, expected, pixels, message);
}

}  // namespace stillmesh
