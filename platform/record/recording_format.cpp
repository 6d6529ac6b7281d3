#include "platform/record/recording_format.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "engine/base/hash.hpp"

namespace stillmesh {
namespace {

constexpr std::array<char, 8> kMagic = {'S', 'T', 'I', 'L', 'L', 'R', 'E', 'C'};
constexpr std::size_t kPrefixBytes = 16;  // magic, version, size of the body
constexpr std::size_t kCrcBytes = 4;
constexpr std::size_t kHintBytes = 72;

enum class ValueType : std::uint8_t { kBool = 0, kU32 = 1, kU64 = 2, kF64 = 3 };
enum class EntryKind : std::uint8_t { kFrame = 1, kEnd = 2 };

template <typename T>
constexpr ValueType type_of() noexcept {
    if constexpr (std::is_same_v<T, bool>) return ValueType::kBool;
    if constexpr (std::is_same_v<T, std::uint32_t>) return ValueType::kU32;
    if constexpr (std::is_same_v<T, std::uint64_t>) return ValueType::kU64;
    if constexpr (std::is_same_v<T, double>) return ValueType::kF64;
}

constexpr std::size_t kNameBytesMax = 63;

std::span<const std::byte> bytes_of(const char* name) noexcept {
    std::size_t size = 0;
    while (size <= kNameBytesMax && name[size] != '\0') ++size;  // bounded: else compilers call strlen
    STILLMESH_CHECK(size <= kNameBytesMax);
    return {reinterpret_cast<const std::byte*>(name), size};
}

void write_u32_at(std::span<std::byte> bytes, std::size_t at, std::uint32_t value) noexcept {
    ByteWriter writer(bytes.subspan(at, 4));
    writer.u32(value);
}

template <typename Visit>
constexpr std::uint16_t count_of(Visit&& visit) noexcept {
    std::uint16_t count = 0;
    visit([&count](const char*, const auto&, double, double, const char*, const char*) { ++count; });
    return count;
}

static_assert(sizeof(Limits) == sizeof(std::uint32_t) * count_of([](auto&& visitor) {
                                    Limits limits;
                                    visit_limits(limits, visitor);
                                }),
              "a limit that visit_limits does not name would be missing in recordings");

// `visit` is visit_parameters or visit_limits, bound to its object.
template <typename Visit>
void write_values(ByteWriter& writer, Visit&& visit) noexcept {
    writer.u16(count_of(visit));
    visit([&writer](const char* name, const auto& value, double, double, const char*, const char*) {
        using T = std::decay_t<decltype(value)>;
        const std::span<const std::byte> text = bytes_of(name);
        writer.u8(static_cast<std::uint8_t>(text.size()));
        writer.bytes(text);
        writer.u8(static_cast<std::uint8_t>(type_of<T>()));
        if constexpr (std::is_same_v<T, double>) {
            writer.f64(value);
        } else {
            writer.u64(static_cast<std::uint64_t>(value));
        }
    });
}

// A key and its value as they stand in a recording.
struct NamedValue {
    std::span<const std::byte> name;
    std::uint8_t type = 0;
    std::uint64_t bits = 0;
};

// Whether `in` is a number of the type of `value`, which becomes it.
template <typename T>
bool take_value(const NamedValue& in, T& value) noexcept {
    if constexpr (std::is_same_v<T, double>) {
        value = std::bit_cast<double>(in.bits);
    } else {
        constexpr std::uint64_t kMax = std::is_same_v<T, bool>            ? 1U
                                       : std::is_same_v<T, std::uint32_t> ? 0xffffffffU
                                                                          : 0xffffffffffffffffU;
        if (in.bits > kMax) return false;
        value = static_cast<T>(in.bits);
    }
    return in.type == static_cast<std::uint8_t>(type_of<T>());
}

void name_problem(RecordingProblem& problem, const char* sentence, std::span<const std::byte> key) noexcept {
    problem.sentence = sentence;
    const std::size_t size = std::min(key.size(), problem.key.size() - 1);
    for (std::size_t i = 0; i < size; ++i) problem.key[i] = std::to_integer<char>(key[i]);
    problem.key[size] = '\0';
}

// Keys by name, in any order. What is absent keeps its default, so that a new key makes no old recording unreadable;
// what this program does not know is counted, and its first name kept: the run may come out otherwise.
template <typename Visit>
Status read_values(ByteReader& reader, RecordingHeader& header, RecordingProblem& problem, Visit&& visit) noexcept {
    const std::uint16_t count = reader.u16();
    for (std::uint16_t i = 0; i < count; ++i) {
        NamedValue in;
        in.name = reader.bytes(reader.u8());
        in.type = reader.u8();
        in.bits = reader.u64();
        if (!reader.is_ok()) {
            name_problem(problem, "ends inside its parameters", {});
            return Status::kCorrupt;
        }
        bool is_known = false, is_good = true;
        visit([&](const char* name, auto& value, double, double, const char*, const char*) {
            const std::span<const std::byte> known = bytes_of(name);
            if (known.size() != in.name.size() || std::memcmp(known.data(), in.name.data(), known.size()) != 0) return;
            is_known = true;
            is_good = take_value(in, value);
        });
        if (!is_good) {
            name_problem(problem, "has a number that does not fit its type, at", in.name);
            return Status::kCorrupt;
        }
        if (!is_known && header.unknown_keys++ == 0) name_problem(problem, "", in.name);
    }
    return Status::kOk;
}

// A record: length of the body, body, CRC of both. The body was written behind 4 bytes left free.
Result<std::size_t> finish_entry(std::span<std::byte> out, const ByteWriter& body) noexcept {
    const std::size_t size = 4 + body.position() + kCrcBytes;
    if (!body.is_ok() || out.size() < size) return Status::kFull;
    write_u32_at(out, 0, static_cast<std::uint32_t>(body.position()));
    write_u32_at(out, size - kCrcBytes, crc32(out.first(size - kCrcBytes)));
    return size;
}

std::span<std::byte> behind(std::span<std::byte> out, std::size_t count) noexcept {
    return out.size() < count ? std::span<std::byte>{} : out.subspan(count);
}

// What a header says behind limits and configuration, for a ByteWriter and a ByteReader alike.
template <typename Bytes, typename Header>
void header_fields(Bytes& bytes, Header& header) noexcept {
    auto& c = header.camera;
    bytes.fields(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3);
    bytes.fields(header.depth_units_per_m, header.extractor, header.vocabulary_crc);
    if (header.limits.store_features_max != 0)
        bytes.fields(header.store_regions, header.store_sequence, header.store_checksum);
}

// Behind the header of a camera that needs it: older recordings end before it.
template <typename Bytes, typename Camera>
void lens_fields(Bytes& bytes, Camera& camera) noexcept {
    bytes.template field_as<std::uint8_t>(camera.lens);
    bytes.fields(camera.k4, camera.k5, camera.k6);
}

// A frame up to what it says of a store, likewise. Of more grants than there is room for only those.
template <typename Bytes, typename F>
void frame_fields(Bytes& bytes, F& frame) noexcept {
    bytes.fields(frame.index, frame.time_ns, frame.digest, frame.status, frame.pose_state, frame.is_keyframe);
    bytes.fields(frame.features, frame.matches, frame.static_matches, frame.groups);
    bytes.fields(frame.hash_tracked, frame.hash, frame.grant_runs);
    for (std::uint32_t i = 0; i < frame.grant_runs && i < kGrantRunsMax; ++i) {
        bytes.fields(frame.grants[i].units, frame.grants[i].calls);
    }
}

template <typename Bytes, typename Hint>
void hint_fields(Bytes& bytes, Hint& hint) noexcept {
    auto& q = hint.last_from_camera.rotation_xyzw;
    auto& t = hint.last_from_camera.translation_m;
    bytes.fields(q[0], q[1], q[2], q[3], t[0], t[1], t[2], hint.sigma_m, hint.sigma_rad);
}

bool read_frame(ByteReader& reader, RecordedFrame& frame) noexcept {
    frame_fields(reader, frame);
    if (frame.grant_runs > kGrantRunsMax) return false;
    std::uint64_t calls = 0;
    for (std::uint32_t i = 0; i < frame.grant_runs; ++i) {
        calls += frame.grants[i].calls;
        if (frame.grants[i].calls == 0) return false;
    }
    // What of a store and of a hint there is shows in what is left: 9 bytes, 72 or both.
    frame.has_hint = reader.remaining() >= kHintBytes;
    frame.has_store = reader.remaining() % kHintBytes != 0;
    if (frame.has_store) reader.fields(frame.store_answered, frame.is_store_accepting);
    if (frame.has_hint) hint_fields(reader, frame.hint);
    return reader.is_ok() && calls <= kGrantCallsMax && frame.status <= Status::kEnd && frame.pose_state <= 3;
}

// 8 bytes of a row, the first byte or value lowest, whatever the processor's order.
template <typename T>
std::uint64_t word_of(const T* p) noexcept {
    std::uint64_t word = 0;
    if constexpr (std::endian::native == std::endian::little) {
        std::memcpy(&word, p, sizeof(word));  // the same as below: gcc 12 leaves that a loop
    } else {
        for (std::uint32_t i = 0; i < 8 / sizeof(T); ++i) word |= std::uint64_t{p[i]} << (8 * sizeof(T) * i);
    }
    return word;
}

// Four chains side by side: one alone would wait for its multiplications. Every step is a bijection of the chain's
// state and of the word, so that one changed word always changes the end.
struct RowDigest {
    static constexpr std::uint32_t kLanes = 4;
    std::uint64_t lanes[kLanes] = {1, 2, 3, 4};

    static constexpr std::uint64_t mixed(std::uint64_t state, std::uint64_t word) noexcept {
        state = (state ^ word) * 0x9e3779b97f4a7c15ULL;
        return state ^ state >> 32;
    }
    template <typename T>
    void row(const T* p, std::uint32_t count) noexcept {
        constexpr std::uint32_t kPerWord = 8 / sizeof(T);
        std::uint64_t a = lanes[0], b = lanes[1], c = lanes[2], d = lanes[3];
        std::uint32_t i = 0;
        for (; i + kLanes * kPerWord <= count; i += kLanes * kPerWord) {
            a = mixed(a, word_of(p + i));
            b = mixed(b, word_of(p + i + kPerWord));
            c = mixed(c, word_of(p + i + 2 * kPerWord));
            d = mixed(d, word_of(p + i + 3 * kPerWord));
        }
        lanes[0] = a;
        lanes[1] = b;
        lanes[2] = c;
        lanes[3] = d;
        // clang-tidy thinks of rows of BGR that end inside a pixel; there are none.
        // NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage)
        for (; i < count; ++i) lanes[i % kLanes] = mixed(lanes[i % kLanes], p[i]);
    }
};

// The same picture is the same digest in whichever order its channels come: files know RGB only, cameras both.
void digest_bgr_row(RowDigest& pixels, const std::uint8_t* row, std::uint32_t row_bytes) noexcept {
    constexpr std::uint32_t kPart = 16 * 3 * 8 * RowDigest::kLanes;  // whole pixels and whole rounds of the four chains
    std::uint8_t turned[kPart];
    for (std::uint32_t begin = 0; begin < row_bytes; begin += kPart) {
        const std::uint32_t count = row_bytes - begin < kPart ? row_bytes - begin : kPart;
        for (std::uint32_t i = 0; i + 2 < count; i += 3) {
            turned[i] = row[begin + i + 2];
            turned[i + 1] = row[begin + i + 1];
            turned[i + 2] = row[begin + i];
        }
        pixels.row(static_cast<const std::uint8_t*>(turned), count);
    }
}

}  // namespace

Result<std::size_t> encode_header(const RecordingHeader& header, std::span<std::byte> out) noexcept {
    ByteWriter body(behind(out, kPrefixBytes));
    Limits limits = header.limits;
    write_values(body, [&limits](auto&& visitor) { visit_limits(limits, visitor); });
    Configuration configuration = header.configuration;
    write_values(body, [&configuration](auto&& visitor) { visit_parameters(configuration, visitor); });
    header_fields(body, header);
    if (!header.camera.is_plain_brown()) lens_fields(body, header.camera);
    const std::size_t size = kPrefixBytes + body.position() + kCrcBytes;
    if (!body.is_ok() || out.size() < size || size > kRecordingHeaderBytesMax) return Status::kFull;
    ByteWriter prefix(out.first(kPrefixBytes));
    // Without hints it stays what older programs read.
    prefix.fields(kMagic, header.has_hints ? kRecordingVersion : kRecordingVersionWithout,
                  static_cast<std::uint32_t>(body.position()));
    write_u32_at(out, size - kCrcBytes, crc32(out.first(size - kCrcBytes)));
    return size;
}

Result<std::size_t> encode_frame(const RecordedFrame& frame, std::span<std::byte> out) noexcept {
    STILLMESH_CHECK(frame.grant_runs <= kGrantRunsMax);
    ByteWriter body(behind(out, 4));
    body.fields(EntryKind::kFrame);
    frame_fields(body, frame);
    if (frame.has_store) body.fields(frame.store_answered, frame.is_store_accepting);
    if (frame.has_hint) hint_fields(body, frame.hint);
    return finish_entry(out, body);
}

Result<std::size_t> encode_end(RecordingEnd end, std::uint64_t frames, std::span<std::byte> out) noexcept {
    ByteWriter body(behind(out, 4));
    body.fields(EntryKind::kEnd, end, frames);
    return finish_entry(out, body);
}

Result<std::size_t> decode_header(std::span<const std::byte> bytes, RecordingHeader& header,
                                  RecordingProblem& problem) noexcept {
    problem = {};
    if (!begins_with(bytes, kMagic)) return Status::kNotFound;
    if (bytes.size() < kPrefixBytes) return Status::kEnd;
    ByteReader prefix(bytes.subspan(kMagic.size(), kPrefixBytes - kMagic.size()));
    const std::uint32_t version = prefix.u32();
    header.has_hints = version == kRecordingVersion;
    if (!header.has_hints && version != kRecordingVersionWithout) {
        problem.sentence = "has another format version than this program reads";
        return Status::kInvalid;
    }
    const std::size_t body_bytes = prefix.u32();
    if (body_bytes > kRecordingHeaderBytesMax - kPrefixBytes - kCrcBytes) return Status::kCorrupt;
    const std::size_t size = kPrefixBytes + body_bytes + kCrcBytes;
    if (bytes.size() < size) return Status::kEnd;
    ByteReader crc(bytes.subspan(size - kCrcBytes, kCrcBytes));
    if (crc.u32() != crc32(bytes.first(size - kCrcBytes))) return Status::kCorrupt;
    ByteReader body(bytes.subspan(kPrefixBytes, body_bytes));
    header.unknown_keys = 0;
    STILLMESH_TRY(
        read_values(body, header, problem, [&header](auto&& visitor) { visit_limits(header.limits, visitor); }));
    STILLMESH_TRY(read_values(body, header, problem,
                              [&header](auto&& visitor) { visit_parameters(header.configuration, visitor); }));
    header.store_regions = header.store_sequence = header.store_checksum = 0;
    header_fields(body, header);
    header.camera.lens = Lens::kBrown;
    header.camera.k4 = header.camera.k5 = header.camera.k6 = 0;
    if (body.remaining() != 0) {
        lens_fields(body, header.camera);
        if (header.camera.is_plain_brown() || header.camera.lens > Lens::kFisheye) return Status::kCorrupt;
    }
    if (!body.is_ok() || body.remaining() != 0) return Status::kCorrupt;
    return size;
}

Result<std::size_t> decode_entry(std::span<const std::byte> bytes, RecordingEntry& entry) noexcept {
    if (bytes.size() < 4) return Status::kEnd;
    ByteReader length(bytes.first(4));
    const std::size_t body_bytes = length.u32();
    if (body_bytes > kRecordingEntryBytesMax - 4 - kCrcBytes) return Status::kCorrupt;
    const std::size_t size = 4 + body_bytes + kCrcBytes;
    if (bytes.size() < size) return Status::kEnd;
    ByteReader crc(bytes.subspan(size - kCrcBytes, kCrcBytes));
    if (crc.u32() != crc32(bytes.first(size - kCrcBytes))) return Status::kCorrupt;
    ByteReader body(bytes.subspan(4, body_bytes));
    EntryKind kind{};
    body.fields(kind);
    entry.is_end = kind == EntryKind::kEnd;
    if (entry.is_end) {
        body.fields(entry.end, entry.end_frames);
        if (entry.end > RecordingEnd::kOverflow) return Status::kCorrupt;
    } else if (kind != EntryKind::kFrame || !read_frame(body, entry.frame)) {
        return Status::kCorrupt;
    }
    if (!body.is_ok() || body.remaining() != 0) return Status::kCorrupt;
    return size;
}

std::uint64_t frame_digest(const Frame& frame) noexcept {
    const bool is_known =
        frame.format == PixelFormat::kGrey8 || frame.format == PixelFormat::kRgb8 || frame.format == PixelFormat::kBgr8;
    if (!is_known || frame.colour.is_empty() || frame.depth.is_empty()) return 0;
    const std::uint64_t row_bytes = std::uint64_t{frame.colour.width} * channels_of(frame.format);
    if (row_bytes > 0xffffffffU || frame.colour.stride < row_bytes || frame.depth.stride < frame.depth.width) return 0;
    RowDigest pixels;
    const bool is_bgr = frame.format == PixelFormat::kBgr8;
    for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
        if (is_bgr) {
            digest_bgr_row(pixels, frame.colour.row(y), static_cast<std::uint32_t>(row_bytes));
        } else {
            pixels.row(frame.colour.row(y), static_cast<std::uint32_t>(row_bytes));
        }
    }
    for (std::uint32_t y = 0; y < frame.depth.height; ++y) pixels.row(frame.depth.row(y), frame.depth.width);
    for (std::uint32_t y = 0; frame.mask.data != nullptr && y < frame.mask.height; ++y)
        pixels.row(frame.mask.row(y), frame.mask.width);
    StateHash hash;
    hash.add(frame.colour.width);
    hash.add(frame.colour.height);
    hash.add(frame.depth.width);
    hash.add(frame.depth.height);
    hash.add(static_cast<std::uint32_t>(is_bgr ? PixelFormat::kRgb8 : frame.format));
    hash.add(frame.depth_units_per_m);
    // Unsigned: whatever a caller's times are, this cannot overflow.
    hash.add(static_cast<std::uint64_t>(frame.depth_time_ns) - static_cast<std::uint64_t>(frame.time_ns));
    for (const std::uint64_t lane : pixels.lanes) hash.add(lane);
    return hash.value();
}

}  // namespace stillmesh
