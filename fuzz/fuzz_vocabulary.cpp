// A vocabulary (engine/place), any bytes, as they are and with check sums that fit: refused, or a tree in which every
// descriptor finds a word and every word its nodes, and which is written back to the same bytes.
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/place/bag_of_words.hpp"
#include "engine/place/vocabulary.hpp"
#include "fuzz/fuzz.hpp"

namespace {

using namespace stillmesh;

void put(std::vector<std::byte>& bytes, std::size_t at, std::uint64_t value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
}

void open(const std::vector<std::byte>& bytes) {
    Vocabulary vocabulary;
    const char* sentence = nullptr;
    const Status status = vocabulary.open(bytes, 5000, sentence);
    fuzz::expect((status == Status::kOk) == (sentence == nullptr), "a sentence for every refusal");
    fuzz::expect((status == Status::kOk) != vocabulary.is_empty(), "what is refused is empty");
    if (status != Status::kOk) {
        fuzz::expect(status == Status::kEnd || status == Status::kNotFound || status == Status::kCorrupt ||
                         status == Status::kInvalid || status == Status::kFull,
                     "a closed list of answers");
        return;
    }
    const VocabularyInfo& info = vocabulary.info();
    fuzz::expect(info.words <= 5000, "no more words than asked for");
    // Written again from what can be read of it.
    std::vector<std::byte> again(Vocabulary::file_bytes(info.branching, info.blocks, info.words));
    for (std::uint32_t block = 0; block < info.blocks; ++block) {
        const std::size_t at = kVocabularyHeaderBytes + Vocabulary::block_bytes(info.branching) * block;
        for (std::uint32_t child = 0; child < vocabulary.children(block); ++child) {
            const Descriptor median = vocabulary.median(block, child);
            for (std::size_t i = 0; i < 4; ++i) put(again, at + 32 * child + 8 * i, median.words[i], 8);
            put(again, at + 32 * info.branching + 2 * child, vocabulary.first_word(block, child), 2);
            put(again, at + 34 * info.branching + 2 * child, vocabulary.block_of(block, child), 2);
            const std::uint32_t word = vocabulary.word_of(median);
            for (std::uint32_t level = 1; level <= info.levels; ++level) {
                const WordRange node = vocabulary.node_of(word, level);
                fuzz::expect(node.begin <= word && word < node.end && node.end <= info.words, "a word is in its nodes");
            }
        }
        put(again, at + 36 * info.branching, vocabulary.children(block), 2);
    }
    const std::size_t weights = again.size() - std::size_t{4} * info.words;
    for (std::uint32_t word = 0; word < info.words; ++word) put(again, weights + 4 * word, vocabulary.weight(word), 4);
    fuzz::expect(write_vocabulary_header(info, again) == Status::kOk && again == bytes, "one way to write a tree");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    std::vector<std::byte> bytes(first, first + size_bytes);
    open(bytes);
    if (size_bytes < kVocabularyHeaderBytes) return 0;
    // Sizes and check sums that fit, so that what lies behind them is reached.
    std::memcpy(bytes.data(), "STILLVOC", 8);
    put(bytes, 8, kVocabularyVersion, 4);
    put(bytes, 12, kVocabularyHeaderBytes, 4);
    put(bytes, 16, size_bytes, 8);
    const std::span<const std::byte> all(bytes);
    put(bytes, 24, crc32(all.subspan(kVocabularyHeaderBytes)), 4);
    put(bytes, 124, crc32(all.first(kVocabularyHeaderBytes - 4)), 4);
    open(bytes);
    return 0;
}
