#include "platform/linux/atomic_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>

#include "platform/linux/memory_block.hpp"

namespace stillmesh {
namespace {

// Writes down the names in the folder of a file. File systems that cannot (EINVAL) have nothing to write down.
[[nodiscard]] bool sync_folder(const std::string& file) {
    // Without asking for memory: a map is saved where there is none left.
    char folder[PATH_MAX] = ".";
    if (const std::size_t slash = file.rfind('/'); slash != std::string::npos && slash + 2 <= sizeof folder) {
        folder[file.copy(folder, slash + 1)] = '\0';
    }
    const int descriptor = ::open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) return false;
    const bool is_done = ::fsync(descriptor) == 0 || errno == EINVAL;
    static_cast<void>(::close(descriptor));
    return is_done;
}

}  // namespace

bool AtomicFile::fail(int error, std::string& message) {
    message = file_ + ": cannot be written: " + std::strerror(error) + "; what was there before is untouched.";
    discard();
    return false;
}

bool AtomicFile::open(const std::string& file, std::string& message) {
    discard();
    file_ = file;
    part_.assign(file).append(".part");
    struct stat status {};
    if (::stat(file.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
        message = file + ": is no regular file; choose another place.";
        return false;
    }
    for (;;) {
        const int descriptor = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
        if (descriptor < 0) return fail(errno, message);
        descriptor_ = descriptor;
        if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0) {
            const int error = errno;
            static_cast<void>(::close(descriptor_));
            descriptor_ = -1;
            if (error != EWOULDBLOCK) return fail(error, message);
            message = file + ": another program is writing it; nothing was changed.";
            return false;
        }
        // Whoever held it until just now may have renamed it: then it is no longer the part, but the file.
        struct stat ours {};
        struct stat there {};
        if (::fstat(descriptor_, &ours) == 0 && ::stat(part_.c_str(), &there) == 0 && ours.st_ino == there.st_ino &&
            ours.st_dev == there.st_dev) {
            break;
        }
        static_cast<void>(::close(descriptor_));
        descriptor_ = -1;
    }
    if (::ftruncate(descriptor_, 0) != 0) return fail(errno, message);
    return true;
}

bool AtomicFile::write(std::span<const std::byte> bytes, std::string& message) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return fail(count < 0 ? errno : ENOSPC, message);
        bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
    return true;
}

bool AtomicFile::commit(std::string& message) {
    if (::fsync(descriptor_) != 0) return fail(errno, message);
    if (std::rename(part_.c_str(), file_.c_str()) != 0) return fail(errno, message);
    static_cast<void>(::close(descriptor_));
    descriptor_ = -1;
    if (sync_folder(file_)) return true;
    message = file_ + ": is written, but its folder could not be: " + std::strerror(errno) +
              "; a power cut may bring the old one back.";
    return false;
}

void AtomicFile::discard() {
    if (descriptor_ < 0) return;
    static_cast<void>(std::remove(part_.c_str()));  // while it is still locked: it is ours
    static_cast<void>(::close(descriptor_));
    descriptor_ = -1;
}

bool read_whole_file(const std::string& file, std::size_t bytes_max, MemoryBlock& block,
                     std::span<const std::byte>& bytes, std::string& message) {
    const auto fail = [&](const char* why) {
        message = file + ": cannot be read: " + why + ".";
        return false;
    };
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe must not let us wait
    if (descriptor < 0) return fail(std::strerror(errno));
    struct stat status {};
    const char* problem = nullptr;
    std::size_t size = 0;
    if (::fstat(descriptor, &status) != 0) {
        problem = std::strerror(errno);
    } else if (!S_ISREG(status.st_mode)) {
        problem = "it is no regular file";
    } else if (status.st_size < 0 || static_cast<std::uint64_t>(status.st_size) > bytes_max) {
        problem = "it is larger than such a file can be";
    } else if (size = static_cast<std::size_t>(status.st_size); size > 0 && !block.allocate(size)) {
        problem = "there is not enough memory left";
    }
    std::size_t done = 0;
    while (problem == nullptr && done < size) {
        const ssize_t count = ::read(descriptor, block.bytes().data() + done, size - done);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) problem = std::strerror(errno);
        if (count <= 0) break;  // shorter by now: what is missing will be noticed
        done += static_cast<std::size_t>(count);
    }
    static_cast<void>(::close(descriptor));
    if (problem != nullptr) return fail(problem);
    bytes = block.bytes().first(done);
    return true;
}

}  // namespace stillmesh
