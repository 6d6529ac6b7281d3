#include "platform/record/recording_writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

namespace stillmesh {
namespace {

// What a power cut may take; a kill of the process takes less.
constexpr std::chrono::seconds kSyncInterval{1};
constexpr int kPatience_ms = 1000;

}  // namespace

RecordingWriter::RecordingWriter(std::size_t slots) : ring_(slots) {}

RecordingWriter::~RecordingWriter() {
    static_cast<void>(close());
}

bool RecordingWriter::open(const std::string& file, const RecordingHeader& header, std::string& message) {
    file_ = file;
    // O_NONBLOCK: a pipe is not waited for, neither for its reader now nor longer than kPatience_ms later.
    descriptor_ = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0644);
    header_.resize(kRecordingHeaderBytesMax);
    const Result<std::size_t> size = encode_header(header, header_);
    STILLMESH_CHECK(size.is_ok());
    header_.resize(size.value());
    // What is there already is another run's, until this one has its first frame: its start may still be refused.
    struct stat status {};
    if (descriptor_ >= 0 && ::fstat(descriptor_, &status) != 0) error_ = errno;
    if (descriptor_ < 0 || error_ != 0 || (status.st_size == 0 && !begin())) {
        message = fmt::format("{}: cannot be written: {}; choose another place for the recording.", file,
                              std::strerror(descriptor_ < 0 ? errno : error_.load()));
        if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
        descriptor_ = -1;
        return false;
    }
    try {
        thread_ = std::jthread([this] { write_all(); });
    } catch (const std::system_error& error) {
        message = fmt::format("{}: there is no thread to write it: {}.", file, error.what());
        static_cast<void>(::close(descriptor_));
        descriptor_ = -1;
        return false;
    }
    return true;
}

bool RecordingWriter::begin() {
    if (header_.empty()) return true;
    // EINVAL: a pipe or a device, which has nothing to be cut.
    if (::ftruncate(descriptor_, 0) != 0 && errno != EINVAL) error_ = errno;
    const bool is_written = error_ == 0 && write(header_);
    header_.clear();
    return is_written;
}

bool RecordingWriter::write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        pollfd room{descriptor_, POLLOUT, 0};
        if (count < 0 && errno == EAGAIN && ::poll(&room, 1, kPatience_ms) == 1) continue;
        if (count <= 0) {
            error_ = count < 0 ? errno : ENOSPC;
            return false;
        }
        bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
    return true;
}

void RecordingWriter::write_all() {
    auto synced = std::chrono::steady_clock::now();
    while (Record* const record = ring_.wait()) {
        // After an error the ring is still emptied: whoever waits for room must not wait for ever.
        if (error_ == 0) static_cast<void>(write(std::span(record->bytes).first(record->size)));
        ring_.release();
        const auto now = std::chrono::steady_clock::now();
        if (now - synced < kSyncInterval) continue;
        static_cast<void>(::fdatasync(descriptor_));
        synced = std::chrono::steady_clock::now();
    }
}

void RecordingWriter::add(RecordedFrame& frame) {
    if (descriptor_ < 0) return;
    static_cast<void>(begin());
    if (missed_ > 0 || error_ != 0) {
        ++missed_;
        return;
    }
    Record* const record = ring_.claim();
    if (record == nullptr) {
        has_overflown_ = true;
        ++missed_;
        return;
    }
    frame.index = frames_++;
    const Result<std::size_t> size = encode_frame(frame, record->bytes);
    STILLMESH_CHECK(size.is_ok());
    record->size = size.value();
    ring_.publish();
}

std::string RecordingWriter::close() {
    if (descriptor_ < 0) return {};
    ring_.close();
    thread_.join();
    if (error_ == 0 && header_.empty()) {
        std::array<std::byte, kRecordingEntryBytesMax> bytes{};
        const auto size = encode_end(has_overflown_ ? RecordingEnd::kOverflow : RecordingEnd::kDone, frames_, bytes);
        if (write(std::span(bytes).first(size.value())) && ::fdatasync(descriptor_) != 0 && errno != EINVAL) {
            error_ = errno;  // EINVAL: a pipe or device, which has no disk behind it
        }
    }
    if (::close(descriptor_) != 0 && error_ == 0) error_ = errno;
    descriptor_ = -1;
    if (error_ != 0) {
        return fmt::format(
            "{}: cannot be written: {}; the recording ends before frame {} at the latest, 'stillmesh rerun' "
            "reads what is whole.",
            file_, std::strerror(error_), frames_);
    }
    if (missed_ > 0) {
        return fmt::format(
            "{}: the disk was too slow for the recording: it ends after {} frames, {} later ones were "
            "tracked without it.",
            file_, frames_, missed_);
    }
    return {};
}

}  // namespace stillmesh
