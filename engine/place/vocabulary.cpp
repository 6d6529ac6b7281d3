#include "engine/place/vocabulary.hpp"

#include <array>
#include <bit>
#include <cstring>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "engine/features/hamming.hpp"

namespace stillmesh {
namespace {

constexpr std::array<char, 8> kMagic = {'S', 'T', 'I', 'L', 'L', 'V', 'O', 'C'};
constexpr std::size_t kHeaderCrcAt = kVocabularyHeaderBytes - 4;

// Unaligned little-endian numbers; one load where the processor can.
std::uint32_t u16_at(const std::byte* at) noexcept {
    return std::to_integer<std::uint32_t>(at[0]) | std::to_integer<std::uint32_t>(at[1]) << 8U;
}
std::uint32_t u32_at(const std::byte* at) noexcept {
    return u16_at(at) | u16_at(at + 2) << 16U;
}
Descriptor descriptor_at(const std::byte* at) noexcept {
    Descriptor out;
    if constexpr (std::endian::native == std::endian::little) {
        std::memcpy(out.words, at, sizeof(out.words));
    } else {
        for (std::size_t i = 0; i < 4; ++i)
            out.words[i] = u32_at(at + 8 * i) | static_cast<std::uint64_t>(u32_at(at + 8 * i + 4)) << 32U;
    }
    return out;
}

// Printable ASCII, then zeros to the end.
bool is_name(const char (&name)[kVocabularyNameBytes]) noexcept {
    std::size_t length = 0;
    while (length < kVocabularyNameBytes && name[length] >= ' ' && name[length] <= '~') ++length;
    if (length == kVocabularyNameBytes) return false;
    for (std::size_t i = length; i < kVocabularyNameBytes; ++i) {
        if (name[i] != '\0') return false;
    }
    return true;
}

bool is_possible(const VocabularyInfo& info) noexcept {
    return info.branching >= 2 && info.branching <= kVocabularyBranchingMax && info.levels >= 1 &&
           info.levels <= kVocabularyLevelsMax && info.direct_level >= 1 && info.direct_level <= info.levels &&
           info.words >= 1 && info.words <= kVocabularyWordsMax && info.blocks >= 1 &&
           info.blocks <= kVocabularyWordsMax && is_name(info.name);
}

// What the header says behind magic letters and version, up to its own CRC, for a ByteWriter and a ByteReader alike.
// False: the sizes are not those of such a tree.
template <typename Bytes, typename Info>
bool header_fields(Bytes& bytes, Info& info, std::uint64_t& file_bytes, std::uint32_t& body_crc) noexcept {
    std::uint32_t header_bytes = kVocabularyHeaderBytes;
    auto block_bytes = static_cast<std::uint32_t>(Vocabulary::block_bytes(info.branching));
    bytes.fields(header_bytes, file_bytes, body_crc);
    bytes.template field_as<std::uint16_t>(info.branching);
    bytes.template field_as<std::uint16_t>(info.levels);
    bytes.template field_as<std::uint16_t>(info.direct_level);
    bytes.zeros(2);
    bytes.fields(info.blocks, info.words, block_bytes, info.seed, info.images, info.pattern_crc, info.descriptors);
    bytes.fields(info.name);
    bytes.zeros(4);
    return bytes.is_ok() && header_bytes == kVocabularyHeaderBytes && is_possible(info) &&
           block_bytes == Vocabulary::block_bytes(info.branching) &&
           file_bytes == Vocabulary::file_bytes(info.branching, info.blocks, info.words);
}

}  // namespace

Status Vocabulary::open(std::span<const std::byte> bytes, std::uint32_t words_max, const char*& sentence) noexcept {
    *this = Vocabulary();
    const auto refuse = [&sentence](Status status, const char* why) {
        sentence = why;
        return status;
    };
    if (!begins_with(bytes, kMagic)) return refuse(Status::kNotFound, "is no vocabulary");
    if (bytes.size() < kVocabularyHeaderBytes) return refuse(Status::kEnd, "ends within its header");
    ByteReader reader(bytes.first(kVocabularyHeaderBytes));
    static_cast<void>(reader.bytes(kMagic.size()));
    if (reader.u32() != kVocabularyVersion) return refuse(Status::kInvalid, "is a vocabulary of another version");
    if (crc32(bytes.first(kHeaderCrcAt)) != u32_at(bytes.data() + kHeaderCrcAt))
        return refuse(Status::kCorrupt, "has a damaged header");
    VocabularyInfo info;
    std::uint64_t file_bytes_told = 0;
    std::uint32_t body_crc = 0;
    if (!header_fields(reader, info, file_bytes_told, body_crc))
        return refuse(Status::kCorrupt, "has a header that contradicts itself");
    if (info.words > words_max) return refuse(Status::kFull, "has more words than limits.vocabulary_words_max");
    if (bytes.size() < file_bytes_told) return refuse(Status::kEnd, "is cut off");
    if (bytes.size() > file_bytes_told) return refuse(Status::kCorrupt, "has bytes behind its end");
    if (crc32(bytes.subspan(kVocabularyHeaderBytes)) != body_crc) return refuse(Status::kCorrupt, "is damaged");
    bytes_ = bytes;
    info_ = info;
    block_bytes_ = block_bytes(info.branching);
    blocks_ = bytes.data() + kVocabularyHeaderBytes;
    weights_ = blocks_ + block_bytes_ * info.blocks;
    if (!is_tree()) {
        *this = Vocabulary();
        return refuse(Status::kCorrupt, "is no tree");
    }
    sentence = nullptr;
    return Status::kOk;
}

// One way to write a tree: blocks in the order of a walk from the root, children before siblings; words in the order in
// which the walk meets them; what is not used is zero. So whoever follows links always arrives, within the bytes, after
// at most `levels` steps. The walk needs a stack of the tree's depth.
bool Vocabulary::is_tree() const noexcept {
    struct Place {
        std::uint32_t block = 0, child = 0;
    };
    Place stack[kVocabularyLevelsMax];
    std::uint32_t depth = 1;
    std::uint32_t next_block = 1;
    std::uint32_t next_word = 0;
    while (depth > 0) {
        Place& place = stack[depth - 1];
        const std::uint32_t count = children(place.block);
        if (place.child == 0 && (count == 0 || count > info_.branching)) return false;
        if (place.child < count) {
            const std::uint32_t child = place.child++;
            if (first_word(place.block, child) != next_word) return false;
            const std::uint32_t below = block_of(place.block, child);
            if (below == 0) {
                if (next_word == info_.words || weight(next_word) > kVocabularyWeightMax) return false;
                ++next_word;
                continue;
            }
            if (below != next_block || next_block == info_.blocks || depth == info_.levels) return false;
            ++next_block;
            stack[depth++] = {below, 0};
            continue;
        }
        const std::byte* const block = blocks_ + place.block * block_bytes_;
        for (std::uint32_t child = count; child < info_.branching; ++child) {
            if (median(place.block, child) != Descriptor{} || first_word(place.block, child) != 0 ||
                block_of(place.block, child) != 0) {
                return false;
            }
        }
        for (std::size_t i = std::size_t{36} * info_.branching + 2; i < block_bytes_; ++i) {
            if (block[i] != std::byte{0}) return false;
        }
        --depth;
    }
    return next_block == info_.blocks && next_word == info_.words;
}

std::uint16_t Vocabulary::word_of(const Descriptor& descriptor) const noexcept {
    STILLMESH_CHECK(!is_empty());
    std::uint32_t block = 0;
    for (;;) {
        const std::byte* const at = blocks_ + block * block_bytes_;
        const std::uint32_t count = children(block);
        std::uint32_t best = 0;
        std::uint32_t best_distance = 257;
        for (std::uint32_t child = 0; child < count; ++child) {
            const std::uint32_t distance = hamming_distance(descriptor, descriptor_at(at + std::size_t{32} * child));
            if (distance < best_distance) {
                best_distance = distance;
                best = child;
            }
        }
        const std::uint32_t below = block_of(block, best);
        if (below == 0) return static_cast<std::uint16_t>(first_word(block, best));
        block = below;
    }
}

std::uint32_t Vocabulary::weight(std::uint32_t word) const noexcept {
    STILLMESH_CHECK(word < info_.words);
    return u32_at(weights_ + std::size_t{4} * word);
}

WordRange Vocabulary::node_of(std::uint32_t word, std::uint32_t level) const noexcept {
    STILLMESH_CHECK(word < info_.words && level >= 1);
    WordRange range{0, info_.words};
    std::uint32_t block = 0;
    for (;;) {
        const std::uint32_t count = children(block);
        std::uint32_t child = count - 1;
        while (first_word(block, child) > word) --child;
        range.begin = first_word(block, child);
        if (child + 1 < count) range.end = first_word(block, child + 1);
        block = block_of(block, child);
        if (block == 0 || --level == 0) return range;
    }
}

std::uint32_t Vocabulary::children(std::uint32_t block) const noexcept {
    STILLMESH_CHECK(block < info_.blocks);
    return u16_at(blocks_ + block * block_bytes_ + std::size_t{36} * info_.branching);
}

Descriptor Vocabulary::median(std::uint32_t block, std::uint32_t child) const noexcept {
    STILLMESH_CHECK(block < info_.blocks && child < info_.branching);
    return descriptor_at(blocks_ + block * block_bytes_ + std::size_t{32} * child);
}

std::uint32_t Vocabulary::block_of(std::uint32_t block, std::uint32_t child) const noexcept {
    STILLMESH_CHECK(block < info_.blocks && child < info_.branching);
    return u16_at(blocks_ + block * block_bytes_ + std::size_t{34} * info_.branching + std::size_t{2} * child);
}

std::uint32_t Vocabulary::first_word(std::uint32_t block, std::uint32_t child) const noexcept {
    STILLMESH_CHECK(block < info_.blocks && child < info_.branching);
    return u16_at(blocks_ + block * block_bytes_ + std::size_t{32} * info_.branching + std::size_t{2} * child);
}

Status write_vocabulary_header(const VocabularyInfo& info, std::span<std::byte> bytes) noexcept {
    if (bytes.size() != Vocabulary::file_bytes(info.branching, info.blocks, info.words)) return Status::kFull;
    ByteWriter writer(bytes.first(kVocabularyHeaderBytes));
    writer.fields(kMagic, kVocabularyVersion);
    std::uint64_t file_bytes = bytes.size();
    std::uint32_t body_crc = crc32(bytes.subspan(kVocabularyHeaderBytes));
    STILLMESH_CHECK(header_fields(writer, info, file_bytes, body_crc));
    STILLMESH_CHECK(writer.position() == kHeaderCrcAt);
    writer.u32(crc32(bytes.first(kHeaderCrcAt)));
    return Status::kOk;
}

}  // namespace stillmesh
