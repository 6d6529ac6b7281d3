#include "engine/place/vocabulary.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/features/hamming.hpp"
#include "tests/place/vocabularies.hpp"

namespace stillmesh::vocabulary_test {
namespace {

using ByteVector = std::vector<std::byte>;

Status open_status(const ByteVector& bytes, std::uint32_t words_max = kVocabularyWordsMax) {
    // A copy of exactly this size: reading beyond it is seen by sanitizers.
    const ByteVector copy(bytes);
    Vocabulary vocabulary;
    const char* sentence = "";
    const Status status = vocabulary.open(copy, words_max, sentence);
    EXPECT_EQ(sentence == nullptr, status == Status::kOk);
    EXPECT_EQ(vocabulary.is_empty(), status != Status::kOk);
    EXPECT_TRUE(sentence == nullptr || std::strlen(sentence) > 5);
    return status;
}

void put(ByteVector& bytes, std::size_t at, std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
}
std::uint64_t get(const ByteVector& bytes, std::size_t at, std::size_t size) {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value |= std::to_integer<std::uint64_t>(bytes[at + i]) << (8 * i);
    return value;
}
// Check sums that fit again, as somebody would make them who writes such files.
void seal(ByteVector& bytes) {
    const std::span<const std::byte> all(bytes);
    put(bytes, 24, crc32(all.subspan(kVocabularyHeaderBytes)), 4);
    put(bytes, 124, crc32(all.first(124)), 4);
}

std::vector<test::RandomTree> shapes() {
    std::vector<test::RandomTree> out;
    std::uint64_t seed = 1;
    for (const std::uint32_t branching : {2U, 3U, 10U, 32U}) {
        for (const std::uint32_t levels : {1U, 2U, 4U}) {
            if (branching == 32 && levels == 4) continue;  // too many words
            for (const std::uint32_t leaf_percent : {0U, 40U}) out.push_back({branching, levels, leaf_percent, seed++});
        }
    }
    out.push_back({2, 8, 10, seed});
    return out;
}

// Promise: a tree written by the page is read as it is: header, medians, links, weights.
TEST(Vocabulary, ReadsWhatThePageSays) {
    for (const test::RandomTree& shape : shapes()) {
        const test::Node root = shape.grow();
        test::TreeBytes tree(root, shape.branching);
        const VocabularyInfo info = test::info_of(shape, tree);
        ASSERT_EQ(write_vocabulary_header(info, tree.bytes), Status::kOk);
        Vocabulary vocabulary;
        const char* sentence = "";
        ASSERT_EQ(vocabulary.open(tree.bytes, kVocabularyWordsMax, sentence), Status::kOk) << sentence;
        EXPECT_EQ(sentence, nullptr);
        EXPECT_EQ(vocabulary.info().branching, info.branching);
        EXPECT_EQ(vocabulary.info().levels, info.levels);
        EXPECT_EQ(vocabulary.info().direct_level, info.direct_level);
        EXPECT_EQ(vocabulary.info().blocks, info.blocks);
        EXPECT_EQ(vocabulary.info().words, info.words);
        EXPECT_EQ(vocabulary.info().seed, info.seed);
        EXPECT_EQ(vocabulary.info().images, info.images);
        EXPECT_EQ(vocabulary.info().descriptors, info.descriptors);
        EXPECT_EQ(vocabulary.info().pattern_crc, info.pattern_crc);
        EXPECT_STREQ(vocabulary.info().name, info.name);
        for (std::uint32_t word = 0; word < info.words; ++word) {
            ASSERT_EQ(vocabulary.weight(word), tree.words[word]->weight);
        }
        std::uint32_t words = 0;
        const std::function<void(const test::Node&, std::uint32_t)> compare = [&](const test::Node& node,
                                                                                  std::uint32_t block) {
            ASSERT_EQ(vocabulary.children(block), node.children.size());
            for (std::uint32_t i = 0; i < node.children.size(); ++i) {
                ASSERT_EQ(vocabulary.median(block, i), node.children[i].median);
                ASSERT_EQ(vocabulary.first_word(block, i), words);
                const std::uint32_t below = vocabulary.block_of(block, i);
                ASSERT_EQ(below == 0, node.children[i].children.empty());
                if (below == 0) {
                    ++words;
                } else {
                    compare(node.children[i], below);
                }
            }
        };
        compare(root, 0);
        EXPECT_EQ(words, info.words);
    }
}

// Promise: a descriptor's word is found by going to the nearest child, the first of equals, at every level; the nodes
// it passes are the ranges of node_of.
TEST(Vocabulary, WordsAndNodesAreThoseOfTheTree) {
    Random random(7);
    for (const test::RandomTree& shape : shapes()) {
        const test::Node root = shape.grow();
        const ByteVector bytes = test::vocabulary_bytes(shape);
        Vocabulary vocabulary;
        const char* sentence = "";
        ASSERT_EQ(vocabulary.open(bytes, kVocabularyWordsMax, sentence), Status::kOk) << sentence;
        const std::function<std::uint32_t(const test::Node&)> leaves = [&](const test::Node& node) {
            std::uint32_t sum = node.children.empty() ? 1 : 0;
            for (const test::Node& child : node.children) sum += leaves(child);
            return sum;
        };
        for (int i = 0; i < 200; ++i) {
            Descriptor descriptor = test::random_descriptor(random);
            if (i == 0) descriptor = Descriptor{};  // ties among equals
            const test::Node* node = &root;
            std::uint32_t first = 0;
            std::vector<WordRange> way;
            while (!node->children.empty()) {
                std::size_t best = 0;
                for (std::size_t c = 1; c < node->children.size(); ++c) {
                    if (hamming_distance(descriptor, node->children[c].median) <
                        hamming_distance(descriptor, node->children[best].median)) {
                        best = c;
                    }
                }
                for (std::size_t c = 0; c < best; ++c) first += leaves(node->children[c]);
                node = &node->children[best];
                way.push_back({first, first + leaves(*node)});
            }
            const std::uint32_t word = vocabulary.word_of(descriptor);
            ASSERT_EQ(word, first);
            for (std::uint32_t level = 1; level <= shape.levels; ++level) {
                const WordRange expected = way[std::min<std::size_t>(level, way.size()) - 1];
                const WordRange range = vocabulary.node_of(word, level);
                ASSERT_EQ(range.begin, expected.begin);
                ASSERT_EQ(range.end, expected.end);
            }
        }
    }
}

// Promise: a file that was cut anywhere, or has something behind its end, is refused.
TEST(Vocabulary, RefusesEveryTruncation) {
    const ByteVector whole = test::vocabulary_bytes({3, 3, 20, 5});
    ASSERT_EQ(open_status(whole), Status::kOk);
    for (std::size_t size = 0; size < whole.size(); ++size) {
        const ByteVector cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        ASSERT_EQ(open_status(cut), Status::kEnd) << size;
    }
    ByteVector longer = whole;
    longer.push_back(std::byte{0});
    EXPECT_EQ(open_status(longer), Status::kCorrupt);
}

// Promise: no bit of a file can change without being seen.
TEST(Vocabulary, RefusesEveryFlippedBit) {
    const ByteVector whole = test::vocabulary_bytes({3, 2, 20, 5});
    for (std::size_t at = 0; at < whole.size(); ++at) {
        for (std::uint32_t bit = 0; bit < 8; ++bit) {
            ByteVector bytes = whole;
            bytes[at] ^= static_cast<std::byte>(1U << bit);
            const Status status = open_status(bytes);
            ASSERT_EQ(status, at < 8 ? Status::kNotFound : at < 12 ? Status::kInvalid : Status::kCorrupt) << at;
        }
    }
}

// Promise: a word that weighs more than scores have room for is refused, whichever it is; the most is taken.
TEST(Vocabulary, NoWordWeighsTooMuch) {
    const ByteVector whole = test::vocabulary_bytes({3, 2, 0, 5});
    const auto words = static_cast<std::size_t>(get(whole, 40, 4));
    for (const std::size_t word : {std::size_t{0}, words / 2, words - 1}) {
        for (const std::uint64_t more : {0U, 1U, 1'000'000U}) {
            ByteVector bytes = whole;
            put(bytes, whole.size() - 4 * (words - word), kVocabularyWeightMax + more, 4);
            seal(bytes);
            EXPECT_EQ(open_status(bytes), more == 0 ? Status::kOk : Status::kCorrupt) << word << ": " << more;
        }
    }
}

// Promise: a header whose check sum is right and whose numbers are not is refused; what only informs may be anything.
TEST(Vocabulary, RefusesContradictions) {
    const ByteVector whole = test::vocabulary_bytes({3, 2, 0, 5});
    const struct {
        std::size_t at, size;
        std::vector<std::uint64_t> values;
    } wrong[] = {
        {12, 4, {0, 127, 129, 0xffffffff}},
        {16, 8, {0, whole.size() - 1, whole.size() + 1, ~std::uint64_t{0}}},
        {28, 2, {0, 1, 2, 4, 33, 0xffff}},
        {30, 2, {0, 1, 9, 0xffff}},
        {32, 2, {0, 3, 0xffff}},
        {34, 2, {1}},
        {36, 4, {0, get(whole, 36, 4) + 1, 65536, 0xffffffff}},
        {40, 4, {0, 1, get(whole, 40, 4) + 1, 65536, 0xffffffff}},
        {44, 4, {0, 111, 113, 0xffffffff}},
        {72, 1, {7, 200}},
        {119, 1, {'x'}},
        {120, 4, {1}},
    };
    for (const auto& [at, size, values] : wrong) {
        for (const std::uint64_t value : values) {
            ByteVector bytes = whole;
            put(bytes, at, value, size);
            ASSERT_NE(bytes, whole) << at;
            seal(bytes);
            EXPECT_EQ(open_status(bytes), Status::kCorrupt) << at << ": " << value;
        }
    }
    for (const std::size_t at : {48U, 56U, 60U, 64U, 73U}) {
        ByteVector bytes = whole;
        put(bytes, at, 'y', 1);
        seal(bytes);
        EXPECT_EQ(open_status(bytes), Status::kOk) << at;
    }
    const auto words = static_cast<std::uint32_t>(get(whole, 40, 4));
    EXPECT_EQ(open_status(whole, words), Status::kOk);
    EXPECT_EQ(open_status(whole, words - 1), Status::kFull);
}

// Promise: bytes with right check sums are refused or are a tree: whoever follows its links stays inside and arrives.
TEST(Vocabulary, WhatIsOpenedCanBeWalked) {
    const test::RandomTree shape{3, 3, 30, 9};
    const ByteVector whole = test::vocabulary_bytes(shape);
    const std::size_t block_bytes = Vocabulary::block_bytes(shape.branching);
    const std::size_t blocks_end = kVocabularyHeaderBytes + block_bytes * static_cast<std::size_t>(get(whole, 36, 4));
    Random random(3);
    std::uint32_t opened = 0;
    std::uint32_t refused_links = 0;
    for (std::size_t at = kVocabularyHeaderBytes; at < whole.size(); ++at) {
        for (const std::uint32_t value : {0U, 1U, 2U, 255U}) {
            ByteVector bytes = whole;
            if (bytes[at] == static_cast<std::byte>(value)) continue;
            bytes[at] = static_cast<std::byte>(value);
            seal(bytes);
            Vocabulary vocabulary;
            const char* sentence = "";
            const Status status = vocabulary.open(bytes, kVocabularyWordsMax, sentence);
            const std::size_t in_block = (at - kVocabularyHeaderBytes) % block_bytes;
            const bool is_link = at < blocks_end && in_block >= std::size_t{32} * shape.branching;
            if (is_link) {  // the one way to write this tree is the one we had
                ASSERT_EQ(status, Status::kCorrupt) << at;
                ++refused_links;
                continue;
            }
            if (status != Status::kOk) continue;
            ++opened;
            const std::uint32_t word = vocabulary.word_of(test::random_descriptor(random));
            ASSERT_LT(word, vocabulary.info().words);
            for (std::uint32_t level = 1; level <= shape.levels; ++level) {
                const WordRange node = vocabulary.node_of(word, level);
                ASSERT_TRUE(node.begin <= word && word < node.end);
            }
        }
    }
    EXPECT_GT(opened, 100U);
    EXPECT_GT(refused_links, 100U);
    EXPECT_EQ(open_status(ByteVector(64, std::byte{'S'})), Status::kNotFound);
}

// Promise: a name is printable letters and then zeros, one at least; a file with any other is refused, whatever is
// wrong with it and where.
TEST(Vocabulary, NamesAreLettersThenZeros) {
    ByteVector file = test::vocabulary_bytes({});
    constexpr std::size_t kNameAt = 72;
    Random random(5);
    int good = 0;
    for (int round = 0; round < 2000; ++round) {
        char name[kVocabularyNameBytes];
        const std::uint32_t letters = round == 1 ? kVocabularyNameBytes : random.below(kVocabularyNameBytes + 1);
        for (std::uint32_t i = 0; i < kVocabularyNameBytes; ++i)
            name[i] = i >= letters ? '\0' : random.below(2) == 0 ? ' ' : '~';
        if (round % 2 == 0) {
            constexpr char kOther[] = {'\0', '\x1f', ' ', '~', '\x7f'};
            name[random.below(kVocabularyNameBytes)] = kOther[random.below(5)];
        }
        std::uint32_t end = 0;
        while (end < kVocabularyNameBytes && name[end] != '\0') ++end;
        bool is_name = end < kVocabularyNameBytes;
        for (std::uint32_t i = 0; i < kVocabularyNameBytes; ++i) {
            const bool is_printable = name[i] >= ' ' && name[i] <= '~';
            is_name = is_name && (i < end ? is_printable : name[i] == '\0');
            file[kNameAt + i] = static_cast<std::byte>(name[i]);
        }
        seal(file);
        ASSERT_EQ(open_status(file) == Status::kOk, is_name) << round;
        good += is_name ? 1 : 0;
    }
    EXPECT_GT(good, 900);
    EXPECT_LT(good, 1900);
}

}  // namespace
}  // namespace stillmesh::vocabulary_test
