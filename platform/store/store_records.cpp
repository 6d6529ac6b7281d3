#include "platform/store/store_records.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"

namespace stillmesh::store_records {
namespace {

constexpr std::array<char, 8> kSegmentLetters = {'S', 'T', 'I', 'L', 'L', 'S', 'T', 'O'};
constexpr std::array<char, 8> kRecordLetters = {'S', 'T', 'I', 'L', 'L', 'R', 'E', 'G'};

void write_letters(ByteWriter& out, const std::array<char, 8>& letters) {
    for (const char letter : letters) out.u8(static_cast<std::uint8_t>(letter));
}
bool read_letters(ByteReader& in, const std::array<char, 8>& letters) {
    bool is_same = true;
    for (const char letter : letters) is_same = in.u8() == static_cast<std::uint8_t>(letter) && is_same;
    return is_same;
}

}  // namespace

void write_segment_header(std::span<std::byte, kSegmentHeaderBytes> out, const StoreOrigin& origin,
                          std::uint64_t number) {
    ByteWriter writer(out);
    write_letters(writer, kSegmentLetters);
    writer.u32(kStoreVersion);
    writer.u32(kSegmentHeaderBytes);
    writer.u64(number);
    writer.u32(origin.vocabulary_crc);
    writer.u32(origin.camera_crc);
    writer.u32(origin.features_crc);
    while (writer.position() < kSegmentHeaderBytes - 4) writer.u32(0);
    writer.u32(crc32(std::span(out).first(kSegmentHeaderBytes - 4)));
}

SegmentFault read_segment_header(std::span<const std::byte> bytes, StoreOrigin& origin, std::uint64_t& number,
                                 std::uint32_t& version) {
    ByteReader reader(bytes);
    if (!read_letters(reader, kSegmentLetters)) return SegmentFault::kNoSegment;
    version = reader.u32();
    if (!reader.is_ok()) return SegmentFault::kDamaged;
    if (version != kStoreVersion) return SegmentFault::kOtherVersion;
    const std::uint32_t size = reader.u32();
    number = reader.u64();
    origin.vocabulary_crc = reader.u32();
    origin.camera_crc = reader.u32();
    origin.features_crc = reader.u32();
    bool is_zero = true;
    while (reader.is_ok() && reader.position() < kSegmentHeaderBytes - 4) is_zero = reader.u32() == 0 && is_zero;
    const std::uint32_t crc = reader.u32();
    if (!reader.is_ok() || !is_zero || size != kSegmentHeaderBytes ||
        crc != crc32(bytes.first(kSegmentHeaderBytes - 4))) {
        return SegmentFault::kDamaged;
    }
    return SegmentFault::kNone;
}

void write_head(std::span<std::byte, kHeadBytes> out, const RecordHead& head) {
    ByteWriter writer(out);
    write_letters(writer, kRecordLetters);
    writer.u32(static_cast<std::uint32_t>(head.kind));
    writer.u32(head.words);
    writer.u32(head.body_bytes);
    writer.u32(head.words_crc);
    writer.u32(head.body_crc);
    writer.u64(head.sequence);
    writer.u64(head.id);
    writer.u64(head.used);
    writer.i64(head.time_ns);
    for (const float v : head.position_m) writer.f32(v);
    for (const float v : head.axis) writer.f32(v);
    writer.u32(crc32(std::span(out).first(kHeadBytes - 4)));
}

bool read_head(std::span<const std::byte> bytes, RecordHead& head) {
    ByteReader reader(bytes);
    if (!read_letters(reader, kRecordLetters)) return false;
    const std::uint32_t kind = reader.u32();
    head.kind = static_cast<RecordKind>(kind);
    head.words = reader.u32();
    head.body_bytes = reader.u32();
    head.words_crc = reader.u32();
    head.body_crc = reader.u32();
    head.sequence = reader.u64();
    head.id = reader.u64();
    head.used = reader.u64();
    head.time_ns = reader.i64();
    bool is_finite = true;
    for (float& v : head.position_m) {
        v = reader.f32();
        is_finite = std::isfinite(v) && is_finite;
    }
    for (float& v : head.axis) {
        v = reader.f32();
        is_finite = std::isfinite(v) && is_finite;
    }
    const std::uint32_t crc = reader.u32();
    if (!reader.is_ok() || crc != crc32(bytes.first(kHeadBytes - 4))) return false;
    const bool is_region = kind == static_cast<std::uint32_t>(RecordKind::kRegion);
    const bool is_mark =
        kind == static_cast<std::uint32_t>(RecordKind::kUse) || kind == static_cast<std::uint32_t>(RecordKind::kGone);
    if (!is_region && !is_mark) return false;
    if (head.words > kWordsMax || head.body_bytes > kBodyBytesMax || !is_finite) return false;
    if (is_mark && (head.words != 0 || head.body_bytes != 0)) return false;
    return head.sequence > 0 && head.sequence <= kNumberMax && head.used <= head.sequence && head.time_ns >= 0 &&
           head.id <= kNumberMax;
}

std::size_t find_letters(std::span<const std::byte> bytes, std::size_t from) {
    std::array<std::byte, 8> letters{};
    for (std::size_t i = 0; i < letters.size(); ++i) letters[i] = static_cast<std::byte>(kRecordLetters[i]);
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(from, bytes.size()));
    return static_cast<std::size_t>(std::search(begin, bytes.end(), letters.begin(), letters.end()) - bytes.begin());
}

}  // namespace stillmesh::store_records
