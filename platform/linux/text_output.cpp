#include "platform/linux/text_output.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>

namespace stillmesh {
namespace {

constexpr const char* kNoReader = "nobody reads it";
constexpr int kReaderPatience_ms = 5000;  // between one piece and the next
constexpr std::string_view kStandardOutput = "-";
constexpr const char* kSlowReader = "its reader does not keep up";

[[nodiscard]] std::string reason(int error) {
    if (error == ENXIO || error == EPIPE) return kNoReader;
    if (error == EAGAIN) return kSlowReader;
    return std::strerror(error);
}

}  // namespace

bool LineFile::open_with(int flags, std::string& message) {
    // O_NONBLOCK: opening a named pipe would wait for its reader.
    const int descriptor = file_ == kStandardOutput
                               ? ::fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 0)
                               : ::open(file_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK | flags, 0644);
    const int error = errno;
    struct stat status {};
    if (descriptor < 0) {
        // A named pipe without a reader is tried again at each line.
        if (error == ENXIO && ::stat(file_.c_str(), &status) == 0 && S_ISFIFO(status.st_mode)) {
            is_regular_ = false;
            return true;
        }
        message = file_ + ": cannot be written: " + std::strerror(error) + "; choose another place.";
        return false;
    }
    is_regular_ = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
    if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
    descriptor_ = descriptor;
    return true;
}

bool LineFile::open(const std::string& file, std::string& message) {
    close();
    file_ = file;
    if (!open_with(is_added_to_ ? O_APPEND : O_TRUNC, message)) {
        file_.clear();
        return false;
    }
    if (is_added_to_ && is_regular_ && file_ != kStandardOutput) {
        const int reader = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
        char last = '\n';
        const off_t end = reader >= 0 ? ::lseek(reader, 0, SEEK_END) : 0;
        is_torn_ = end > 0 && ::pread(reader, &last, 1, end - 1) == 1 && last != '\n';
        if (reader >= 0) static_cast<void>(::close(reader));
    }
    return true;
}

// Where it cannot be renamed, or opened anew, the old one grows on: better a large file than none.
void LineFile::begin_anew_if_large() {
    if (bytes_max_ == 0 || !is_regular_ || file_ == kStandardOutput) return;
    const off_t end = ::lseek(descriptor_, 0, SEEK_END);
    if (end < 0 || static_cast<std::uint64_t>(end) < bytes_max_) return;
    std::string ignored;
    if (std::rename(file_.c_str(), (file_ + ".1").c_str()) == 0) static_cast<void>(open_with(O_TRUNC, ignored));
}

bool LineFile::reopen(std::string& message) {
    std::string why;
    if (open_with(O_APPEND, why)) {
        is_torn_ = false;
        return true;
    }
    message = file_ + ": cannot be opened anew: " + std::strerror(errno) + "; the old file is written on.";
    return false;
}

bool LineFile::write_all(std::string_view lines) {
    if (!is_regular_) {
        // At most PIPE_BUF bytes go into a pipe whole or not at all, and where poll() says so, at once.
        for (std::size_t at = 0; at < lines.size();) {
            const std::string_view piece = lines.substr(at, PIPE_BUF);
            pollfd ready{descriptor_, POLLOUT, 0};
            if (::poll(&ready, 1, patience_ms_) != 1) {
                errno = EAGAIN;
                return false;
            }
            if ((ready.revents & POLLERR) != 0) {  // of a pipe: the reader is gone
                errno = EPIPE;
                return false;
            }
            const ssize_t count = ::write(descriptor_, piece.data(), piece.size());
            if (count < 0 && errno == EINTR) continue;
            if (count < 0) return false;
            at += static_cast<std::size_t>(count);
        }
        return true;
    }
    std::size_t done = 0;
    while (done < lines.size()) {
        const ssize_t count = ::write(descriptor_, lines.data() + done, lines.size() - done);
        if (count < 0 && errno == EINTR) continue;
        if (count > 0) {
            done += static_cast<std::size_t>(count);
            continue;
        }
        const int error = count < 0 ? errno : ENOSPC;
        // Half a line is worse than none: whoever reads the file would refuse it.
        const off_t end = ::lseek(descriptor_, 0, SEEK_CUR);
        const auto taken_back = static_cast<off_t>(done);
        if (done > 0 && (end < taken_back || ::ftruncate(descriptor_, end - taken_back) != 0 ||
                         ::lseek(descriptor_, end - taken_back, SEEK_SET) < 0)) {
            is_torn_ = true;
        }
        errno = error;
        return false;
    }
    return true;
}

bool LineFile::write(std::string_view lines, std::string& message) {
    std::string why;
    if (descriptor_ < 0) {
        if (!open_with(O_APPEND, why) || descriptor_ < 0) {
            message = file_ + ": cannot be written: " + (why.empty() ? kNoReader : why) + ".";
            return false;
        }
    }
    if (is_torn_) {
        if (!write_all("\n")) {
            message = file_ + ": cannot be written: " + reason(errno) + ".";
            return false;
        }
        is_torn_ = false;
    }
    if (write_all(lines)) {
        begin_anew_if_large();
        return true;
    }
    message = file_ + ": cannot be written: " + reason(errno) + ".";
    return false;
}

void LineFile::close() {
    if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
    descriptor_ = -1;
    file_.clear();
    is_torn_ = false;
}

std::string CountedLines::write(std::string_view lines) {
    const auto count = static_cast<std::uint64_t>(std::count(lines.begin(), lines.end(), '\n'));
    std::string message;
    if (lines.empty() || lines_.write(lines, message)) {
        written_ += count;
        return {};
    }
    missing_ += count;
    if (!first_message_.empty()) return {};
    first_message_ = message;
    return message + " The run goes on without these lines.";
}

std::string CountedLines::problem() const {
    if (missing_ == 0) return {};
    return first_message_ + " " + std::to_string(missing_) + " of " + std::to_string(written_ + missing_) +
           " lines are missing there.";
}

bool write_whole_file(const std::string& file, std::string_view text, std::string& message) {
    LineFile output;
    struct stat status {};
    if (::stat(file.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode)) {
        output.wait_for_reader(kReaderPatience_ms);
        return output.open(file, message) && output.write(text, message);
    }
    const std::string beside = file + ".part";
    if (!output.open(beside, message) || !output.write(text, message)) {
        static_cast<void>(std::remove(beside.c_str()));
        return false;
    }
    output.close();
    if (std::rename(beside.c_str(), file.c_str()) == 0) return true;
    message = file + ": cannot be written: " + std::strerror(errno) + ".";
    static_cast<void>(std::remove(beside.c_str()));
    return false;
}

std::string printable(std::string text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto byte = static_cast<unsigned char>(text[i]);
        if ((byte < 0x20 && byte != '\n' && byte != '\t') || byte == 0x7f) text[i] = '?';
        if (byte == 0xc2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xa0) {
            text.replace(i, 2, "?");
        }
    }
    return text;
}

bool write_standard_output(std::string_view text, std::string& message) {
    errno = 0;
    const bool is_written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() &&
                            std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    if (is_written) return true;
    message = "standard output cannot be written" + (errno != 0 ? ": " + reason(errno) : std::string()) + ".";
    return false;
}

bool write_for_reader(std::string_view text, std::string& message) {
    while (!text.empty()) {
        const ssize_t count = ::write(STDOUT_FILENO, text.data(), text.size());
        if (count < 0 && errno == EINTR) continue;
        if (count < 0 && errno == EPIPE) return true;
        if (count <= 0) {
            message = "standard output cannot be written: " + reason(count < 0 ? errno : ENOSPC) + ".";
            return false;
        }
        text.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
}

void write_standard_error(std::string_view text) {
    pollfd ready{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&ready, 1, 0) != 1 || (ready.revents & POLLERR) != 0) return;
    static_cast<void>(std::fwrite(text.data(), 1, std::min<std::size_t>(text.size(), PIPE_BUF), stderr));
    static_cast<void>(std::fflush(stderr));
}

}  // namespace stillmesh
