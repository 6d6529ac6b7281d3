// A vocabulary of binary descriptors: a tree of medians whose leaves are words, each with the weight that its rarity
// gives it (Galvez-Lopez and Tardos 2012). It is a view over bytes that somebody else keeps, read-only and for as long
// as it is used: checked once at open(), then used in place, without a copy. The format is specified with the source
// (SPEC-vocabulary). Limits: 65535 words, 32 children, 8 levels. A word costs `branching` descriptor distances per
// level.
//
// Words are numbered in the order of the tree, so that the words below any node are one range: a list of features
// sorted by word is a direct index for every level at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/api.hpp"
#include "engine/base/check.hpp"
#include "engine/base/status.hpp"
#include "engine/features/features.hpp"

namespace stillmesh {

inline constexpr std::size_t kVocabularyHeaderBytes = 128;
inline constexpr std::uint32_t kVocabularyVersion = 1;
inline constexpr std::uint32_t kVocabularyBranchingMax = 32;
inline constexpr std::uint32_t kVocabularyLevelsMax = 8;
inline constexpr std::uint32_t kVocabularyWordsMax = 65535;
inline constexpr std::size_t kVocabularyNameBytes = 48;
// Of a word; the trainer's unit is 2^-16.
inline constexpr std::uint32_t kVocabularyWeightMax = (1U << 24U) - 1;

// What the header tells.
struct VocabularyInfo {
    std::uint32_t branching = 0;     // children of a node, at most
    std::uint32_t levels = 0;        // words lie at most so deep; the root's children are level 1
    std::uint32_t direct_level = 0;  // at which features are compared by node
    std::uint32_t blocks = 0;        // inner nodes
    std::uint32_t words = 0;
    std::uint32_t images = 0;       // that it was trained from
    std::uint64_t descriptors = 0;  // likewise
    std::uint64_t seed = 0;
    std::uint32_t pattern_crc = 0;      // of the descriptor's sampling pattern; 0: not told
    char name[kVocabularyNameBytes]{};  // printable ASCII, ends with a zero
};

// Words [begin, end): those below one node.
struct WordRange {
    std::uint32_t begin = 0, end = 0;
};

class Vocabulary {
public:
    // `bytes` is borrowed for as long as the vocabulary is used. No alignment is asked for; 64 is fastest.
    //   kEnd      fewer bytes than it says of itself     kNotFound  no vocabulary (the magic letters are not there)
    //   kCorrupt  a check sum or the tree is wrong       kInvalid   another version
    //   kFull     more than `words_max` words
    // `sentence` then says so in words; nullptr when all is well. On failure the vocabulary is empty.
    [[nodiscard]] STILLMESH_API Status open(std::span<const std::byte> bytes, std::uint32_t words_max,
                                            const char*& sentence) noexcept;

    // No vocabulary: nothing is ever recognised.
    [[nodiscard]] bool is_empty() const noexcept { return info_.words == 0; }
    [[nodiscard]] const VocabularyInfo& info() const noexcept { return info_; }
    [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }

    // The word of a descriptor: from the root to the nearest child, ties to the first. Must not be empty.
    [[nodiscard]] STILLMESH_API std::uint16_t word_of(const Descriptor& descriptor) const noexcept;
    // 0: the word says nothing.
    [[nodiscard]] STILLMESH_API std::uint32_t weight(std::uint32_t word) const noexcept;
    // All words below the node at `level` (1 to levels) that `word` lies under; of a word that ends above, itself.
    [[nodiscard]] STILLMESH_API WordRange node_of(std::uint32_t word, std::uint32_t level) const noexcept;

    // --- the tree, for whoever prints or compares it. Block 0 is the root.
    [[nodiscard]] STILLMESH_API std::uint32_t children(std::uint32_t block) const noexcept;
    [[nodiscard]] STILLMESH_API Descriptor median(std::uint32_t block, std::uint32_t child) const noexcept;
    // The block of a child, 0: the child is a word.
    [[nodiscard]] STILLMESH_API std::uint32_t block_of(std::uint32_t block, std::uint32_t child) const noexcept;
    [[nodiscard]] STILLMESH_API std::uint32_t first_word(std::uint32_t block, std::uint32_t child) const noexcept;

    // Bytes of a block, and of a whole vocabulary.
    [[nodiscard]] static constexpr std::size_t block_bytes(std::uint32_t branching) noexcept {
        return (std::size_t{branching} * (32 + 2 + 2) + 2 + 7) / 8 * 8;
    }
    [[nodiscard]] static constexpr std::size_t file_bytes(std::uint32_t branching, std::uint32_t blocks,
                                                          std::uint32_t words) noexcept {
        return kVocabularyHeaderBytes + block_bytes(branching) * blocks + std::size_t{4} * words;
    }

private:
    [[nodiscard]] bool is_tree() const noexcept;

    std::span<const std::byte> bytes_;
    const std::byte* blocks_ = nullptr;
    const std::byte* weights_ = nullptr;
    std::size_t block_bytes_ = 0;
    VocabularyInfo info_;
};

// --- for the trainer

// Writes the header of a vocabulary whose blocks and weights are in their place in `bytes` already, check sums
// included.
//   kFull  bytes is not file_bytes(...) long
[[nodiscard]] STILLMESH_API Status write_vocabulary_header(const VocabularyInfo& info,
                                                           std::span<std::byte> bytes) noexcept;

}  // namespace stillmesh
