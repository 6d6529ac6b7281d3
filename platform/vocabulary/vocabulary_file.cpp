#include "platform/vocabulary/vocabulary_file.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "engine/base/crc.hpp"

namespace stillmesh {

bool VocabularyFile::open(const std::string& file, std::uint32_t words_max, std::string& message) {
    close();
    if (file == "none") {
        name_ = "no vocabulary";
        return true;
    }
    std::span<const std::byte> bytes = default_vocabulary();
    name_ = "the default vocabulary";
    if (!file.empty() && file != "default") {
        name_ = file;
        const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe must not let us wait
        if (descriptor < 0) {
            message = file + ": " + std::strerror(errno) + ".";
            return false;
        }
        // Larger than any vocabulary: not even looked at.
        constexpr std::size_t kBytesMax =
            Vocabulary::file_bytes(kVocabularyBranchingMax, kVocabularyWordsMax, kVocabularyWordsMax);
        struct stat status {};
        const bool is_file = ::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
        const auto size = static_cast<std::size_t>(status.st_size);
        if (is_file && size > 0 && size <= kBytesMax) {
            mapped_ = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, descriptor, 0);
            if (mapped_ == MAP_FAILED) mapped_ = nullptr;
        }
        ::close(descriptor);
        if (mapped_ == nullptr) {
            message =
                file + ": is no vocabulary" + (is_file ? (size == 0 ? ": it is empty." : ".") : ": it is no file.");
            return false;
        }
        mapped_bytes_ = size;
        bytes = {static_cast<const std::byte*>(mapped_), size};
    }
    const char* sentence = nullptr;
    if (vocabulary_.open(bytes, words_max, sentence) == Status::kOk) return true;
    message = name_ + ": " + sentence + ".";
    close();
    return false;
}

std::uint32_t VocabularyFile::crc() const noexcept {
    return bytes().empty() ? 0 : crc32(bytes());
}

void VocabularyFile::close() noexcept {
    vocabulary_ = Vocabulary();
    if (mapped_ != nullptr) ::munmap(mapped_, mapped_bytes_);
    mapped_ = nullptr;
    mapped_bytes_ = 0;
}

}  // namespace stillmesh
