// A file that is replaced as a whole or not at all: written beside its place, down to the disk, then renamed, then the
// folder is written down too. Whenever the process is killed or the power fails, the old file is there, or the new one.
// Two programs that save to one place do not mix: whoever comes second is told so. What a killed program leaves beside
// (FILE.part) is overwritten by the next. Linux; costs two fsync per file.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace stillmesh {

class AtomicFile {
public:
    AtomicFile() = default;
    ~AtomicFile() { discard(); }
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    // All three: false: `message` says why, and the old file is untouched. Going well, the second time for one name,
    // they ask for no memory.
    [[nodiscard]] bool open(const std::string& file, std::string& message);
    [[nodiscard]] bool write(std::span<const std::byte> bytes, std::string& message);
    [[nodiscard]] bool commit(std::string& message);
    // Nothing is kept of what was written.
    void discard();

private:
    bool fail(int error, std::string& message);

    std::string file_;
    std::string part_;
    int descriptor_ = -1;
};

// A whole file in memory; false: `message` says why. `bytes_max`: larger ones are refused.
[[nodiscard]] bool read_whole_file(const std::string& file, std::size_t bytes_max, class MemoryBlock& block,
                                   std::span<const std::byte>& bytes, std::string& message);

}  // namespace stillmesh
