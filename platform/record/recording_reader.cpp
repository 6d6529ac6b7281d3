#include "platform/record/recording_reader.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace stillmesh {

Status RecordingReader::open(const std::string& file) {
    file_ = file;
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe must not let us wait
    struct stat status {};
    const bool is_other = descriptor >= 0 && ::fstat(descriptor, &status) == 0 && !S_ISREG(status.st_mode);
    stream_.reset(descriptor >= 0 && !is_other ? ::fdopen(descriptor, "rb") : nullptr);
    if (stream_ == nullptr) {
        message_ =
            fmt::format("{}: cannot be read: {}.", file, is_other ? "it is no regular file" : std::strerror(errno));
        if (descriptor >= 0) static_cast<void>(::close(descriptor));
        return Status::kUnavailable;
    }
    buffer_.resize(2 * kRecordingHeaderBytesMax);
    begin_ = end_ = 0;
    frames_ = 0;
    is_over_ = is_whole_ = false;
    fill();
    if (std::ferror(stream_.get()) != 0) {
        message_ = fmt::format("{}: cannot be read: {}.", file, std::strerror(errno));
        return Status::kUnavailable;
    }
    RecordingProblem problem;
    const Result<std::size_t> size = decode_header(ahead(), header_, problem);
    if (size.is_ok()) {
        begin_ += size.value();
        unknown_key_ = problem.key.data();
        return Status::kOk;
    }
    switch (size.status()) {
        case Status::kEnd:
            message_ = end_ == 0 ? file + ": is empty; this is no recording."
                                 : file + ": ends inside its header: the run was stopped before its first frame.";
            return Status::kCorrupt;
        case Status::kNotFound:
            message_ = file + ": is no recording; 'stillmesh run --record FILE' writes one.";
            return Status::kInvalid;
        case Status::kInvalid:
            message_ = fmt::format("{}: {}{}; repeat it with the version that made it.", file, problem.sentence,
                                   problem.key[0] == '\0' ? "" : fmt::format(" '{}'", problem.key.data()));
            return Status::kInvalid;
        default:
            message_ = fmt::format("{}: its header is damaged{}{}; nothing of it can be trusted.", file,
                                   problem.sentence[0] == '\0' ? "" : fmt::format(": it {}", problem.sentence),
                                   problem.key[0] == '\0' ? "" : fmt::format(" '{}'", problem.key.data()));
            return Status::kCorrupt;
    }
}

void RecordingReader::fill() {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    end_ -= begin_;
    begin_ = 0;
    end_ += std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, stream_.get());
}

Status RecordingReader::next(RecordedFrame& frame) {
    if (is_over_) return Status::kEnd;
    if (end_ - begin_ < kRecordingEntryBytesMax) fill();
    if (std::ferror(stream_.get()) != 0) {
        message_ = fmt::format("{}: cannot be read behind frame {}: {}.", file_, frames_, std::strerror(errno));
        return Status::kUnavailable;
    }
    RecordingEntry entry;
    const Result<std::size_t> size = decode_entry(ahead(), entry);
    const bool is_in_place =
        size.is_ok() && (entry.is_end ? entry.end_frames == frames_ : entry.frame.index == frames_);
    if (is_in_place && !entry.is_end) {
        begin_ += size.value();
        ++frames_;
        frame = entry.frame;
        return Status::kOk;
    }
    is_over_ = true;
    is_whole_ = is_in_place;
    if (is_in_place) {
        if (entry.end == RecordingEnd::kOverflow) {
            ending_ = fmt::format("the disk was too slow for it: it was ended after {} frames.", frames_);
        }
        begin_ += size.value();
        if (end_ - begin_ == 0) fill();
        if (end_ - begin_ > 0) ending_ += "there are bytes behind its end mark.";
    } else if (size.status() == Status::kEnd) {
        ending_ = end_ == begin_ ? fmt::format("it has no end mark: the run was killed after frame {}.", frames_)
                                 : fmt::format("it is torn: {} bytes behind frame {} are no whole record.",
                                               end_ - begin_, frames_);
    } else {
        ending_ = fmt::format("it is damaged behind frame {}: what follows cannot be trusted.", frames_);
    }
    return Status::kEnd;
}

}  // namespace stillmesh
