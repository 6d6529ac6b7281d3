// Reads a recording record by record in fixed memory, up to its last whole frame, and says how it ends.
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "platform/record/recording_format.hpp"

namespace stillmesh {

class RecordingReader {
public:
    // kUnavailable, kInvalid, kCorrupt: message() says why.
    [[nodiscard]] Status open(const std::string& file);
    [[nodiscard]] const RecordingHeader& header() const { return header_; }
    // kOk: a whole frame, in its place.   kEnd: the recording is over; ending() says how.
    // kUnavailable: the disk failed; message() says how.
    [[nodiscard]] Status next(RecordedFrame& frame);
    [[nodiscard]] const std::string& message() const { return message_; }
    // The first key of the header that this program does not know; empty: there is none.
    [[nodiscard]] const std::string& unknown_key() const { return unknown_key_; }

    // Whole: it has its end mark. Else a sentence about what is missing behind the last whole frame.
    [[nodiscard]] bool is_whole() const { return is_whole_; }
    [[nodiscard]] const std::string& ending() const { return ending_; }

private:
    struct FileCloser {
        void operator()(std::FILE* file) const { static_cast<void>(std::fclose(file)); }
    };
    // Makes sure that a whole record lies in the buffer, unless the file ends before.
    void fill();
    [[nodiscard]] std::span<const std::byte> ahead() const { return std::span(buffer_).subspan(begin_, end_ - begin_); }

    std::string file_;
    std::string message_;
    std::string unknown_key_;
    std::string ending_;
    std::unique_ptr<std::FILE, FileCloser> stream_;
    std::vector<std::byte> buffer_;
    std::size_t begin_ = 0, end_ = 0;
    std::uint64_t frames_ = 0;
    bool is_over_ = false;
    bool is_whole_ = false;
    RecordingHeader header_;
};

}  // namespace stillmesh
