#include "hal/replay/png_reader.hpp"

#include <fcntl.h>
#include <spng.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace stillmesh {
namespace {

struct CloseContext {
    void operator()(spng_ctx* context) const noexcept { spng_ctx_free(context); }
};
using Context = std::unique_ptr<spng_ctx, CloseContext>;

// What libspng and zlib take while they decode one image (48 KiB for 640x480): cut from one block a thread, which is
// taken with its first image and emptied before each. Else every image is eight calls of the heap, 32 KiB among them.
class Scratch {
public:
    [[nodiscard]] bool begin() noexcept {
        if (block_ == nullptr) block_.reset(static_cast<std::byte*>(std::malloc(kBytes)));
        used_ = 0;
        return block_ != nullptr;
    }
    [[nodiscard]] void* take(std::size_t size) noexcept {
        if (size > kBytes || kBytes - used_ < kHead + size)
            return std::malloc(size);  // an image of another kind of size
        std::byte* const head = block_.get() + used_;
        std::memcpy(head, &size, sizeof size);
        used_ += kHead + (size + kHead - 1) / kHead * kHead;
        used_ = std::min(used_, kBytes);
        return head + kHead;
    }
    void give(void* memory) noexcept {
        if (!is_inside(memory)) std::free(memory);
    }
    [[nodiscard]] void* resize(void* memory, std::size_t size) noexcept {
        if (memory == nullptr) return take(size);
        if (!is_inside(memory)) return std::realloc(memory, size);
        std::size_t held = 0;
        std::memcpy(&held, static_cast<std::byte*>(memory) - kHead, sizeof held);
        void* const larger = take(size);
        if (larger != nullptr) std::memcpy(larger, memory, std::min(held, size));
        return larger;
    }

private:
    static constexpr std::size_t kBytes = std::size_t{96} * 1024;
    static constexpr std::size_t kHead = alignof(std::max_align_t) < 16 ? 16 : alignof(std::max_align_t);
    struct Free {
        void operator()(std::byte* block) const noexcept { std::free(block); }
    };
    [[nodiscard]] bool is_inside(const void* memory) const noexcept {
        return memory >= block_.get() && memory < block_.get() + kBytes;
    }

    std::unique_ptr<std::byte, Free> block_;
    std::size_t used_ = 0;
};
// libspng hands no pointer of ours to its allocator; a context never outlives the call that made it.
thread_local Scratch scratch;

[[nodiscard]] void* scratch_calloc(std::size_t count, std::size_t size) {
    if (size != 0 && count > static_cast<std::size_t>(-1) / size) return nullptr;
    void* const memory = scratch.take(count * size);
    if (memory != nullptr) std::memset(memory, 0, count * size);
    return memory;
}

// A regular file, read through a buffer of its own: stdio's would be two more calls of the heap.
class File {
public:
    File() = default;
    ~File() {
        if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
    }
    File(const File&) = delete;
    File& operator=(const File&) = delete;

    Status open(const std::string& name, std::string& message) noexcept;
    // libspng's read function.
    static int read(spng_ctx* context, void* user, void* destination, std::size_t length) noexcept;

private:
    int descriptor_ = -1;
    std::size_t at_ = 0, end_ = 0;
    std::array<std::byte, 16384> buffer_;
};

// Larger than any image of ours; keeps a wild header from being worth anything.
constexpr std::uint32_t kPngSideMax = 16384;
// Text and colour profiles in a PNG are nothing to us; libspng may hold this much of them.
constexpr std::size_t kChunkBytesMax = 1024 * 1024;

Status spng_failure(const std::string& name, int error, std::string& message) {
    const bool is_short = error == SPNG_IO_EOF || error == SPNG_EOI;
    message = name + ": " +
              (is_short ? std::string("the PNG is truncated")
                        : std::string("cannot be read as PNG (") + spng_strerror(error) + ")") +
              "; copy the recording again or remove this image from its list.";
    return Status::kCorrupt;
}

Status open_context(Context& context, const std::string& name, std::string& message) {
    context.reset();
    spng_alloc heap{[](std::size_t size) { return scratch.take(size); },
                    [](void* memory, std::size_t size) { return scratch.resize(memory, size); }, scratch_calloc,
                    [](void* memory) { scratch.give(memory); }};
    if (scratch.begin()) context.reset(spng_ctx_new2(&heap, 0));
    if (context == nullptr) {
        message = name + ": no memory left to decode it.";
        return Status::kUnavailable;
    }
    static_cast<void>(spng_set_image_limits(context.get(), kPngSideMax, kPngSideMax));
    static_cast<void>(spng_set_chunk_limits(context.get(), kChunkBytesMax, kChunkBytesMax));
    return Status::kOk;
}

Status header_of(spng_ctx* context, const std::string& name, ImageHeader& header, std::string& message) {
    spng_ihdr ihdr{};
    if (const int error = spng_get_ihdr(context, &ihdr); error != 0) return spng_failure(name, error, message);
    const bool is_grey = ihdr.color_type == SPNG_COLOR_TYPE_GRAYSCALE;
    header = {ihdr.width, ihdr.height,
              is_grey && ihdr.bit_depth == 16  ? ImageKind::kGrey16
              : is_grey && ihdr.bit_depth == 8 ? ImageKind::kGrey8
                                               : ImageKind::kRgb8};
    return Status::kOk;
}

Status pixels_of(spng_ctx* context, const std::string& name, const ImageHeader& expected,
                 std::span<std::uint8_t> pixels, std::string& message) {
    ImageHeader header;
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
    // SPNG_FMT_PNG: as stored, 16-bit samples in the processor's byte order; SPNG_FMT_RGB8: their high bytes.
    const int format = header.kind == ImageKind::kRgb8 ? SPNG_FMT_RGB8 : SPNG_FMT_PNG;
    std::size_t size_bytes = 0;
    if (const int error = spng_decoded_image_size(context, format, &size_bytes); error != 0) {
        return spng_failure(name, error, message);
    }
    if (size_bytes != pixels.size()) {
        message = name + ": the image does not fit its buffer.";
        return Status::kCorrupt;
    }
    if (const int error = spng_decode_image(context, pixels.data(), pixels.size(), format, 0); error != 0) {
        return spng_failure(name, error, message);
    }
    return Status::kOk;
}

Status File::open(const std::string& name, std::string& message) noexcept {
    // O_NONBLOCK: opening a pipe would wait for its writer.
    descriptor_ = ::open(name.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat status {};
    if (descriptor_ >= 0 && ::fstat(descriptor_, &status) == 0 && S_ISREG(status.st_mode)) return Status::kOk;
    message = descriptor_ >= 0 ? name + ": is no regular file; is the recording complete?"
                               : name + ": cannot be opened: " + std::strerror(errno) + "; is the recording complete?";
    return Status::kUnavailable;
}

int File::read(spng_ctx* /*context*/, void* user, void* destination, std::size_t length) noexcept {
    File& file = *static_cast<File*>(user);
    auto* out = static_cast<std::byte*>(destination);
    while (length > 0) {
        if (file.at_ == file.end_) {
            ssize_t count = -1;
            do {
                count = ::read(file.descriptor_, file.buffer_.data(), file.buffer_.size());
            } while (count < 0 && errno == EINTR);
            if (count <= 0) return count == 0 ? SPNG_IO_EOF : SPNG_IO_ERROR;
            file.at_ = 0;
            file.end_ = static_cast<std::size_t>(count);
        }
        const std::size_t piece = std::min(length, file.end_ - file.at_);
        std::memcpy(out, file.buffer_.data() + file.at_, piece);
        file.at_ += piece;
        out += piece;
        length -= piece;
    }
    return 0;
}

}  // namespace

Status read_png_header(const std::string& file, ImageHeader& header, std::string& message) {
    File stream;
    STILLMESH_TRY(stream.open(file, message));
    Context context;
    STILLMESH_TRY(open_context(context, file, message));
    if (const int error = spng_set_png_stream(context.get(), File::read, &stream); error != 0) {
        return spng_failure(file, error, message);
    }
    return header_of(context.get(), file, header, message);
}

Status read_png(const std::string& file, const ImageHeader& expected, std::span<std::uint8_t> pixels,
                std::string& message) {
    File stream;
    STILLMESH_TRY(stream.open(file, message));
    Context context;
    STILLMESH_TRY(open_context(context, file, message));
    if (const int error = spng_set_png_stream(context.get(), File::read, &stream); error != 0) {
        return spng_failure(file, error, message);
    }
    return pixels_of(context.get(), file, expected, pixels, message);
}

Status decode_png_header(std::span<const std::uint8_t> bytes, const std::string& name, ImageHeader& header,
                         std::string& message) {
    Context context;
    STILLMESH_TRY(open_context(context, name, message));
    if (const int error = spng_set_png_buffer(context.get(), bytes.data(), bytes.size()); error != 0) {
        return spng_failure(name, error, message);
    }
    return header_of(context.get(), name, header, message);
}

Status decode_png(std::span<const std::uint8_t> bytes, const std::string& name, const ImageHeader& expected,
                  std::span<std::uint8_t> pixels, std::string& message) {
    Context context;
    STILLMESH_TRY(open_context(context, name, message));
    if (const int error = spng_set_png_buffer(context.get(), bytes.data(), bytes.size()); error != 0) {
        return spng_failure(name, error, message);
    }
    return pixels_of(context.get(), name, expected, pixels, message);
}

}  // namespace stillmesh
