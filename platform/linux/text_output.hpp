// A text file of which every finished line survives whatever happens to the process: each line is one write(2).
#pragma once

#include <string>
#include <string_view>

namespace stillmesh {

class LineFile {
public:
    LineFile() = default;
    ~LineFile() { close(); }
    LineFile(const LineFile&) = delete;
    LineFile& operator=(const LineFile&) = delete;

    // Replaces the file. False: `message` says why.
    [[nodiscard]] bool open(const std::string& file, std::string& message);
    // The file under the same name anew, after somebody moved it away; one that is still there is added to. False: as
    // open, and the old one is kept.
    [[nodiscard]] bool reopen(std::string& message);
    [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }
    // False: the disk is full or gone; what was written before stays.
    [[nodiscard]] bool write(std::string_view lines, std::string& message);
    void close();

private:
    std::string file_;
    int descriptor_ = -1;
};

// Writes beside the file and renames: readers see the old file or the new one, never half of it.
[[nodiscard]] bool write_whole_file(const std::string& file, std::string_view text, std::string& message);

}  // namespace stillmesh
