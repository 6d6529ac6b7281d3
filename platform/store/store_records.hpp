// The records of a store's files, one function each way (docs/SPEC-map-store.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace stillmesh::store_records {

inline constexpr std::uint32_t kStoreVersion = 1;
inline constexpr std::size_t kSegmentHeaderBytes = 64;
inline constexpr std::size_t kHeadBytes = 88;
inline constexpr std::size_t kWordBytes = 6;
inline constexpr std::uint32_t kWordsMax = 16000;
inline constexpr std::uint32_t kBodyBytesMax = 8U << 20U;
// Of sequences and ids: no store comes near it, and what is counted on from it does not wrap around.
inline constexpr std::uint64_t kNumberMax = std::uint64_t{1} << 62U;

// What all segments of a store have in common; a run with something else is refused.
struct StoreOrigin {
    std::uint32_t vocabulary_crc = 0;
    std::uint32_t camera_crc = 0;    // of its numbers
    std::uint32_t features_crc = 0;  // of extractor, levels and scale factor
    friend bool operator==(const StoreOrigin&, const StoreOrigin&) = default;
};

enum class SegmentFault : std::uint8_t { kNone, kNoSegment, kOtherVersion, kDamaged };

void write_segment_header(std::span<std::byte, kSegmentHeaderBytes> out, const StoreOrigin& origin,
                          std::uint64_t number);
[[nodiscard]] SegmentFault read_segment_header(std::span<const std::byte> bytes, StoreOrigin& origin,
                                               std::uint64_t& number, std::uint32_t& version);

enum class RecordKind : std::uint8_t { kRegion = 1, kUse = 2, kGone = 3 };

// The head of a record; words and body follow it.
struct RecordHead {
    RecordKind kind = RecordKind::kRegion;
    std::uint32_t words = 0;
    std::uint32_t body_bytes = 0;
    std::uint32_t words_crc = 0;
    std::uint32_t body_crc = 0;
    std::uint64_t sequence = 0;  // 1 for the first record of a store
    std::uint64_t id = 0;
    std::uint64_t used = 0;  // of a region: sequence of its last use
    std::int64_t time_ns = 0;
    float position_m[3] = {};
    float axis[3] = {};

    [[nodiscard]] std::size_t size() const { return kHeadBytes + kWordBytes * words + body_bytes; }
};

void write_head(std::span<std::byte, kHeadBytes> out, const RecordHead& head);
// False: this is no whole head.
[[nodiscard]] bool read_head(std::span<const std::byte> bytes, RecordHead& head);
// Where in `bytes` the letters of a head stand next, from `from` on; bytes.size(): nowhere.
[[nodiscard]] std::size_t find_letters(std::span<const std::byte> bytes, std::size_t from);

}  // namespace stillmesh::store_records
