// A vocabulary for a program: the default one, which is part of it, or a file, mapped into memory read-only and used in
// place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "engine/place/vocabulary.hpp"

namespace stillmesh {

// The one in vocabulary/default.voc, read-only, for the life of the program.
[[nodiscard]] std::span<const std::byte> default_vocabulary() noexcept;

class VocabularyFile {
public:
    VocabularyFile() = default;
    ~VocabularyFile() { close(); }
    VocabularyFile(const VocabularyFile&) = delete;
    VocabularyFile& operator=(const VocabularyFile&) = delete;

    // "default" or empty: the default vocabulary. "none": an empty one. False: `message` is a sentence that names the
    // file.
    [[nodiscard]] bool open(const std::string& file, std::uint32_t words_max, std::string& message);
    void close() noexcept;
    // Of its bytes, to know it again; 0: there is none.
    [[nodiscard]] std::uint32_t crc() const noexcept;

    [[nodiscard]] const Vocabulary& vocabulary() const noexcept { return vocabulary_; }
    [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return vocabulary_.bytes(); }
    [[nodiscard]] const std::string& name() const noexcept { return name_; }

private:
    Vocabulary vocabulary_;
    std::string name_;
    void* mapped_ = nullptr;
    std::size_t mapped_bytes_ = 0;
};

}  // namespace stillmesh
