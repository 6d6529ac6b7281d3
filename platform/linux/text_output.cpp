#include "platform/linux/text_output.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace stillmesh {

bool LineFile::open(const std::string& file, std::string& message) {
    close();
    file_ = file;
    descriptor_ = ::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (descriptor_ >= 0) return true;
    message = file + ": cannot be written: " + std::strerror(errno) + "; choose another place.";
    return false;
}

bool LineFile::reopen(std::string& message) {
    const int descriptor = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    if (descriptor < 0) {
        message = file_ + ": cannot be opened anew: " + std::strerror(errno) + "; the old file is written on.";
        return false;
    }
    close();
    descriptor_ = descriptor;
    return true;
}

bool LineFile::write(std::string_view lines, std::string& message) {
    while (!lines.empty()) {
        const ssize_t count = ::write(descriptor_, lines.data(), lines.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) {
            message = file_ + ": cannot be written: " + std::strerror(errno) + "; what was written before is kept.";
            return false;
        }
        lines.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
}

void LineFile::close() {
    if (descriptor_ >= 0) static_cast<void>(::close(descriptor_));
    descriptor_ = -1;
}

bool write_whole_file(const std::string& file, std::string_view text, std::string& message) {
    const std::string beside = file + ".part";
    LineFile output;
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

}  // namespace stillmesh
