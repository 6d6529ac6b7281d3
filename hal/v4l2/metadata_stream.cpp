#include "hal/v4l2/metadata_stream.hpp"

#include <cerrno>

namespace stillmesh::v4l2 {
namespace {

constexpr std::uint32_t kMetadataFormatsMax = 16;
constexpr std::uint32_t kBytesMin = 64, kBytesMax = 1 << 20;

}  // namespace

int MetadataStream::set_format() {
    std::uint32_t best = 0;
    for (std::uint32_t i = 0; i < kMetadataFormatsMax; ++i) {
        std::uint32_t code = 0;
        if (link_.format_at(handle_, i, code) != 0) break;
        if (code == kD4xxMetadata || (code == kUvcMetadata && best == 0)) best = code;
    }
    if (best == 0) return ENOTSUP;
    format_ = {.fourcc = best};
    if (const int error = link_.set_format(handle_, format_); error != 0) return error;
    return format_.fourcc == best && format_.bytes >= kBytesMin && format_.bytes <= kBytesMax ? 0 : ERANGE;
}

int MetadataStream::open(const std::string& path) {
    stop();
    if (path.empty()) return ENOTSUP;
    int handle = -1;
    if (const int error = link_.open(path, handle); error != 0) return error;
    handle_ = handle;
    std::uint32_t capabilities = 0;
    int error = link_.query_capability(handle_, capabilities);
    if (error == 0 && (capabilities & kV4l2Metadata) == 0) error = ENOTSUP;
    if (error == 0) error = set_format();
    if (error != 0) stop();
    return error;
}

int MetadataStream::start() {
    if (handle_ < 0) return ENOTSUP;
    int error = buffers_.map(link_, handle_, 1, 0);
    if (error == 0) error = link_.set_streaming(handle_, true);
    is_on_ = error == 0;
    if (error != 0) stop();
    return error;
}

void MetadataStream::stop() noexcept {
    if (handle_ < 0) return;
    if (is_on_) static_cast<void>(link_.set_streaming(handle_, false));
    is_on_ = false;
    buffers_.unmap(link_, handle_);
    link_.close(handle_);
    handle_ = -1;
    read_ = {};
}

void MetadataStream::read_all() noexcept {
    // So many that none is left behind, and an end where a driver never runs out of errors.
    for (std::uint32_t i = 0; i < 2 * kBuffers; ++i) {
        V4l2Buffer buffer;
        const int error = link_.dequeue(handle_, buffer);
        if (error == EAGAIN || error == ENODEV) return;
        if (error != 0 || buffer.index >= buffers_.size()) continue;
        const std::span<const std::uint8_t> bytes = buffers_[buffer.index];
        Read& read = read_[buffer.sequence % kBuffers];
        read = {.sequence = buffer.sequence, .is_there = true, .facts = {}};
        const bool is_whole = !buffer.is_broken && buffer.bytes_used <= bytes.size();
        if (is_whole) static_cast<void>(parse_metadata(bytes.first(buffer.bytes_used), read.facts));
        // What cannot be given back is lost; without buffers there is no more of it, and images go on.
        static_cast<void>(link_.queue(handle_, buffer.index));
    }
}

ImageFacts MetadataStream::find(std::uint32_t sequence) noexcept {
    if (!is_on_) return {};
    read_all();
    Read& read = read_[sequence % kBuffers];
    if (!read.is_there || read.sequence != sequence) return {};
    read.is_there = false;
    return read.facts;
}

}  // namespace stillmesh::v4l2
