// Vocabularies for tests: random trees, and their bytes written by the format's page rather than by our code.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/features/features.hpp"
#include "engine/place/vocabulary.hpp"

namespace stillmesh::test {

inline Descriptor random_descriptor(Random& random) {
    Descriptor out;
    for (std::uint64_t& word : out.words) word = random.next();
    return out;
}

// The same with some bits the other way.
inline Descriptor disturbed(const Descriptor& descriptor, std::uint32_t bits, Random& random) {
    Descriptor out = descriptor;
    for (std::uint32_t i = 0; i < bits; ++i) {
        const std::uint32_t bit = random.below(256);
        out.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    return out;
}

struct Node {
    Descriptor median;
    std::uint32_t weight = 0;  // of a leaf
    std::vector<Node> children;
};

struct RandomTree {
    std::uint32_t branching = 4;
    std::uint32_t levels = 3;
    std::uint32_t leaf_percent = 20;  // of the nodes above the last level
    std::uint64_t seed = 1;

    [[nodiscard]] Node grow() const {
        Random random(seed);
        Node root;
        grow(root, 1, random);
        return root;
    }

private:
    void grow(Node& node, std::uint32_t level, Random& random) const {
        const std::uint32_t count = level == 1 ? branching : 1 + random.below(branching);
        for (std::uint32_t i = 0; i < count; ++i) {
            Node child;
            child.median = disturbed(node.median, 200 >> level, random);
            child.weight = random.below(1U << 20U);
            if (level < levels && random.below(100) >= leaf_percent) grow(child, level + 1, random);
            node.children.push_back(child);
        }
    }
};

// What docs/SPEC-vocabulary.md says a body is.
struct TreeBytes {
    std::vector<std::byte> bytes;
    std::uint32_t blocks = 0;
    std::vector<const Node*> words;

    TreeBytes(const Node& root, std::uint32_t branching) : branching_(branching) {
        bytes.resize(kVocabularyHeaderBytes);
        block(root);
        for (const Node* const word : words) put(bytes.size(), word->weight, 4);
    }

private:
    void put(std::size_t at, std::uint64_t value, std::size_t size) {
        if (bytes.size() < at + size) bytes.resize(at + size);
        for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
    }
    void block(const Node& node) {
        const std::size_t at = bytes.size();
        ++blocks;
        const std::size_t k = branching_;
        bytes.resize(at + (36 * k + 2 + 7) / 8 * 8);
        put(at + 36 * k, node.children.size(), 2);
        for (std::size_t i = 0; i < node.children.size(); ++i) {
            const Node& child = node.children[i];
            for (std::size_t w = 0; w < 4; ++w) put(at + 32 * i + 8 * w, child.median.words[w], 8);
            put(at + 32 * k + 2 * i, words.size(), 2);
            if (child.children.empty()) {
                words.push_back(&child);
            } else {
                put(at + 34 * k + 2 * i, blocks, 2);
                block(child);
            }
        }
    }
    std::uint32_t branching_;
};

inline VocabularyInfo info_of(const RandomTree& shape, const TreeBytes& tree) {
    VocabularyInfo info;
    info.branching = shape.branching;
    info.levels = shape.levels;
    info.direct_level = 1 + shape.levels / 2;
    if (info.direct_level > info.levels) info.direct_level = info.levels;
    info.blocks = tree.blocks;
    info.words = static_cast<std::uint32_t>(tree.words.size());
    info.seed = shape.seed;
    info.images = 3;
    info.descriptors = 1000;
    info.pattern_crc = 0x12345678;
    std::strncpy(info.name, "a random tree", kVocabularyNameBytes - 1);
    return info;
}

// A whole vocabulary.
inline std::vector<std::byte> vocabulary_bytes(const RandomTree& shape) {
    const Node root = shape.grow();
    TreeBytes tree(root, shape.branching);
    const Status status = write_vocabulary_header(info_of(shape, tree), tree.bytes);
    return status == Status::kOk ? tree.bytes : std::vector<std::byte>{};
}

}  // namespace stillmesh::test
