#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "tests/record/recordings.hpp"

namespace stillmesh::format_test {
namespace {

using test::ByteVector;
using test::some_frame;
using test::some_header;

// Whether two plain structs of numbers without padding between them hold the same, through their own encoding.
bool are_equal(const RecordedFrame& a, const RecordedFrame& b) {
    return test::frame_bytes(a) == test::frame_bytes(b);
}

// Promise: what is encoded is decoded to the same values, key by key, and with the same bytes used.
TEST(RecordingFormat, RoundTrip) {
    RecordingHeader header = some_header();
    // Every parameter with a value of its own.
    std::uint32_t k = 0;
    visit_parameters(header.configuration, [&k](const char*, auto& value, double, double, const char*, const char*) {
        using T = std::decay_t<decltype(value)>;
        value = static_cast<T>(++k % 2 == 0 && std::is_same_v<T, bool> ? 0 : k);
    });
    visit_limits(header.limits,
                 [&k](const char*, auto& value, double, double, const char*, const char*) { value = ++k; });
    header.extractor = 1;
    const ByteVector bytes = test::header_bytes(header);
    RecordingHeader read;
    RecordingProblem problem;
    const auto size = decode_header(bytes, read, problem);
    ASSERT_TRUE(size.is_ok());
    EXPECT_EQ(size.value(), bytes.size());
    EXPECT_EQ(test::header_bytes(read), bytes);
    EXPECT_EQ(std::memcmp(&read.limits, &header.limits, sizeof(Limits)), 0);
    EXPECT_EQ(read.configuration.seed, header.configuration.seed);
    EXPECT_EQ(read.configuration.pose.sure_sigma_m, header.configuration.pose.sure_sigma_m);
    EXPECT_EQ(read.camera.k3, header.camera.k3);
    EXPECT_EQ(read.extractor, 1);

    RecordedFrame frame = some_frame(7);
    while (frame.add_grant(frame.grant_runs)) {
    }
    EXPECT_EQ(frame.grant_runs, kGrantRunsMax);
    const ByteVector record = test::frame_bytes(frame);
    EXPECT_LE(record.size(), kRecordingEntryBytesMax);
    RecordingEntry entry;
    const auto used = decode_entry(record, entry);
    ASSERT_TRUE(used.is_ok());
    EXPECT_EQ(used.value(), record.size());
    EXPECT_FALSE(entry.is_end);
    EXPECT_TRUE(are_equal(entry.frame, frame));

    const ByteVector end = test::end_bytes(RecordingEnd::kOverflow, 8);
    ASSERT_TRUE(decode_entry(end, entry).is_ok());
    EXPECT_TRUE(entry.is_end);
    EXPECT_EQ(entry.end, RecordingEnd::kOverflow);
    EXPECT_EQ(entry.end_frames, 8U);
}

// Promise: a hint of the motion comes back bit by bit, beside what is said of a store or without; a recording that may
// have hints says so in its version, and one without is as older programs write and read it.
TEST(RecordingFormat, HintsComeBack) {
    for (const bool has_store : {false, true}) {
        RecordedFrame frame = some_frame(3);
        frame.has_store = has_store;
        const std::size_t without = test::frame_bytes(frame).size();
        frame.has_hint = true;
        frame.hint = {{{0.1, 0.2, 0.3, 0.9}, {1, -2, 3}}, 0.01, -1};
        const ByteVector bytes = test::frame_bytes(frame);
        EXPECT_EQ(bytes.size(), without + 72);
        RecordingEntry entry;
        ASSERT_TRUE(decode_entry(bytes, entry).is_ok());
        EXPECT_TRUE(entry.frame.has_hint);
        EXPECT_EQ(entry.frame.has_store, has_store);
        EXPECT_EQ(entry.frame.hint.last_from_camera.translation_m[1], -2);
        EXPECT_EQ(entry.frame.hint.sigma_rad, -1);
        EXPECT_TRUE(are_equal(entry.frame, frame));
    }
    RecordingHeader header = some_header();
    EXPECT_EQ(test::header_bytes(header)[8], std::byte{2});
    header.has_hints = true;
    const ByteVector bytes = test::header_bytes(header);
    EXPECT_EQ(bytes[8], std::byte{3});
    RecordingHeader read;
    RecordingProblem problem;
    ASSERT_TRUE(decode_header(bytes, read, problem).is_ok());
    EXPECT_TRUE(read.has_hints);
}

// Promise: equal grants in a row are one run; more calls than the limit are refused, and nothing is lost of the others.
TEST(RecordingFormat, GrantsAreRuns) {
    RecordedFrame frame;
    for (const std::uint32_t units : {5U, 5U, 0U, 0U, 0U, 5U}) ASSERT_TRUE(frame.add_grant(units));
    EXPECT_EQ(frame.grant_runs, 3U);
    EXPECT_EQ(frame.grants[0].calls, 2U);
    EXPECT_EQ(frame.grants[1].calls, 3U);
    EXPECT_EQ(frame.grants[2].calls, 1U);
    frame = {};
    for (std::uint32_t i = 0; i < kGrantCallsMax; ++i) ASSERT_TRUE(frame.add_grant(1));
    EXPECT_FALSE(frame.add_grant(1));
    EXPECT_FALSE(frame.add_grant(2));
}

// Promise: a buffer that is too small by any number of bytes is kFull, never written beyond.
TEST(RecordingFormat, SmallBuffers) {
    const ByteVector header = test::header_bytes(some_header());
    const ByteVector frame = test::frame_bytes(some_frame(0));
    for (std::size_t size = 0; size < header.size(); ++size) {
        ByteVector out(size + 8, std::byte{0x5a});
        ASSERT_EQ(encode_header(some_header(), std::span(out).first(size)).status(), Status::kFull);
        for (std::size_t i = size; i < out.size(); ++i) ASSERT_EQ(out[i], std::byte{0x5a});
    }
    for (std::size_t size = 0; size < frame.size(); ++size) {
        ByteVector out(size + 8, std::byte{0x5a});
        ASSERT_EQ(encode_frame(some_frame(0), std::span(out).first(size)).status(), Status::kFull);
        for (std::size_t i = size; i < out.size(); ++i) ASSERT_EQ(out[i], std::byte{0x5a});
    }
}

// Promise: cut anywhere, header and records say kEnd: more bytes are needed.
TEST(RecordingFormat, CutAnywhere) {
    const ByteVector header = test::header_bytes(some_header());
    RecordingHeader read;
    RecordingProblem problem;
    for (std::size_t size = 0; size < header.size(); ++size) {
        ASSERT_EQ(decode_header(std::span(header).first(size), read, problem).status(), Status::kEnd) << size;
    }
    const ByteVector frame = test::frame_bytes(some_frame(0));
    RecordingEntry entry;
    for (std::size_t size = 0; size < frame.size(); ++size) {
        ASSERT_EQ(decode_entry(std::span(frame).first(size), entry).status(), Status::kEnd) << size;
    }
}

// Promise: no flipped bit is taken for good: a record is refused, or asks for more bytes.
TEST(RecordingFormat, FlippedBits) {
    ByteVector frame = test::frame_bytes(some_frame(0));
    const ByteVector good = frame;
    test::append(frame, good);  // something behind it
    RecordingEntry entry;
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
        frame[bit / 8] ^= std::byte{1} << (bit % 8);
        ASSERT_FALSE(decode_entry(frame, entry).is_ok()) << bit;
        frame[bit / 8] ^= std::byte{1} << (bit % 8);
    }
    ByteVector header = test::header_bytes(some_header());
    RecordingHeader read;
    RecordingProblem problem;
    for (std::size_t bit = 0; bit < 8 * header.size(); ++bit) {
        header[bit / 8] ^= std::byte{1} << (bit % 8);
        ASSERT_FALSE(decode_header(header, read, problem).is_ok()) << bit;
        header[bit / 8] ^= std::byte{1} << (bit % 8);
    }
}

void set_crc(ByteVector& bytes) {
    ByteWriter writer{std::span<std::byte>(bytes).last(4)};
    writer.u32(crc32(std::span(bytes).first(bytes.size() - 4)));
}

// Promise: bytes with a good CRC and wrong contents are refused as well: whoever wrote them can compute a CRC.
TEST(RecordingFormat, WrongContentsWithGoodCrc) {
    RecordingEntry entry;
    std::uint32_t taken = 0;
    const ByteVector good = test::frame_bytes(some_frame(0));
    for (std::size_t i = 4; i + 4 < good.size(); ++i) {
        for (const std::byte value : {std::byte{0}, std::byte{0x7f}, std::byte{0xff}}) {
            ByteVector bytes = good;
            bytes[i] = value;
            set_crc(bytes);
            if (!decode_entry(bytes, entry).is_ok()) continue;
            ++taken;  // a number like another: what is decoded must be what is there
            ASSERT_FALSE(entry.is_end);
            ASSERT_EQ(test::frame_bytes(entry.frame), bytes) << i;
        }
    }
    EXPECT_GT(taken, 100U);
    for (const std::size_t i : {4U, 29U, 30U, 31U}) {  // kind, status, state, keyframe
        ByteVector bytes = good;
        bytes[i] = std::byte{0x7f};
        set_crc(bytes);
        EXPECT_EQ(decode_entry(bytes, entry).status(), Status::kCorrupt) << i;
    }
    // More grants than there are bytes, and no calls in a grant.
    ByteVector bytes = good;
    bytes[64] = std::byte{2};
    set_crc(bytes);
    EXPECT_EQ(decode_entry(bytes, entry).status(), Status::kCorrupt);
    bytes = good;
    std::fill_n(bytes.begin() + 72, 4, std::byte{0});
    set_crc(bytes);
    EXPECT_EQ(decode_entry(bytes, entry).status(), Status::kCorrupt);
}

// Promise: a header of another format version says so.
TEST(RecordingFormat, OtherVersionsAreNamed) {
    const ByteVector good = test::header_bytes(some_header());
    RecordingHeader read;
    RecordingProblem problem;
    ByteVector bytes = good;
    bytes[8] = std::byte{kRecordingVersion + 1};
    EXPECT_EQ(decode_header(bytes, read, problem).status(), Status::kInvalid);
    EXPECT_NE(std::string(problem.sentence).find("version"), std::string::npos);
    bytes = good;
    bytes[0] = std::byte{'X'};
    EXPECT_EQ(decode_header(bytes, read, problem).status(), Status::kNotFound);
}

// Promise: keys are read by name. One that this program does not know is counted, named and passed over, and the key
// that is absent for it has its default: a new key makes no old recording unreadable. A type that does not fit is
// damage.
TEST(RecordingFormat, KeysAreReadByName) {
    RecordingHeader written = some_header();
    written.limits.image_width_max = 320;
    written.limits.image_height_max = 200;
    ByteVector bytes = test::header_bytes(written);
    RecordingHeader read;
    RecordingProblem problem;
    ASSERT_TRUE(decode_header(bytes, read, problem).is_ok());
    EXPECT_EQ(read.unknown_keys, 0U);
    EXPECT_EQ(problem.key[0], '\0');
    // The name of the first limit, spelled otherwise.
    bytes[19] = std::byte{'L'};
    set_crc(bytes);
    read = RecordingHeader{};
    ASSERT_TRUE(decode_header(bytes, read, problem).is_ok());
    EXPECT_EQ(read.unknown_keys, 1U);
    EXPECT_STREQ(problem.key.data(), "Limits.image_width_max");
    EXPECT_EQ(read.limits.image_width_max, Limits{}.image_width_max);
    EXPECT_EQ(read.limits.image_height_max, 200U);
    EXPECT_EQ(read.camera.k3, written.camera.k3);

    bytes = test::header_bytes(written);
    bytes[19 + 22] = std::byte{3};  // its type: a double
    set_crc(bytes);
    EXPECT_EQ(decode_header(bytes, read, problem).status(), Status::kCorrupt);
    EXPECT_STREQ(problem.key.data(), "limits.image_width_max");
}

// Promise: a lens beyond Brown's five numbers comes back to the bit; without one a header is what it was before there
// were others, and a tail that says nothing is refused.
TEST(RecordingFormat, Lenses) {
    const RecordingHeader plain = some_header();
    RecordingHeader read, wide = plain;
    RecordingProblem problem;
    for (const Lens lens : {Lens::kBrown, Lens::kFisheye}) {
        wide.camera.lens = lens;
        wide.camera.k4 = 0.25;
        wide.camera.k6 = lens == Lens::kBrown ? -1.5 : 0;
        ByteVector bytes = test::header_bytes(wide);
        EXPECT_EQ(bytes.size(), test::header_bytes(plain).size() + 25);
        ASSERT_TRUE(decode_header(bytes, read, problem).is_ok());
        EXPECT_EQ(read.camera, wide.camera);
        EXPECT_EQ(test::header_bytes(read), bytes);
        bytes[bytes.size() - 29] = std::byte{2};
        set_crc(bytes);
        EXPECT_EQ(decode_header(bytes, read, problem).status(), Status::kCorrupt) << "no such lens";
    }
    ASSERT_TRUE(decode_header(test::header_bytes(plain), read, problem).is_ok());
    EXPECT_EQ(read.camera, plain.camera) << "nothing is left of the header read before";
}

// Promise: the order of keys does not matter.
TEST(RecordingFormat, KeysAreInAnyOrder) {
    RecordingHeader written = some_header();
    written.limits.image_width_max = 320;
    written.limits.image_height_max = 200;
    ByteVector bytes = test::header_bytes(written);
    constexpr std::size_t kFirst = 18, kSize = 1 + 22 + 1 + 8, kNext = 1 + 23 + 1 + 8;
    std::rotate(bytes.begin() + kFirst, bytes.begin() + kFirst + kSize, bytes.begin() + kFirst + kSize + kNext);
    set_crc(bytes);
    RecordingHeader read;
    RecordingProblem problem;
    ASSERT_TRUE(decode_header(bytes, read, problem).is_ok());
    EXPECT_EQ(read.unknown_keys, 0U);
    EXPECT_EQ(test::header_bytes(read), test::header_bytes(written));
}

GreyView grey(const std::vector<std::uint8_t>& pixels, std::size_t stride = 20) {
    return {pixels.data(), 20, 6, stride};
}

// Promise: the digest sees every pixel, size, format, factor and lag, and not the padding between rows or the time.
TEST(FrameDigest, SeesWhatTrackingSees) {
    std::vector<std::uint8_t> colour(20 * 6);
    std::vector<std::uint16_t> depth(20 * 6);
    for (std::size_t i = 0; i < colour.size(); ++i) {
        colour[i] = static_cast<std::uint8_t>(7 * i);
        depth[i] = static_cast<std::uint16_t>(4000 + 13 * i);
    }
    Frame frame;
    frame.colour = grey(colour);
    frame.depth = {depth.data(), 20, 6, 20};
    const std::uint64_t digest = frame_digest(frame);
    for (std::size_t i = 0; i < colour.size(); ++i) {
        for (std::uint32_t bit = 0; bit < 8; ++bit) {
            colour[i] = static_cast<std::uint8_t>(colour[i] ^ (1U << bit));
            ASSERT_NE(frame_digest(frame), digest) << i;
            colour[i] = static_cast<std::uint8_t>(colour[i] ^ (1U << bit));
        }
        for (std::uint32_t bit = 0; bit < 16; ++bit) {
            depth[i] = static_cast<std::uint16_t>(depth[i] ^ (1U << bit));
            ASSERT_NE(frame_digest(frame), digest) << i;
            depth[i] = static_cast<std::uint16_t>(depth[i] ^ (1U << bit));
        }
    }
    EXPECT_EQ(frame_digest(frame), digest);
    std::vector<std::uint8_t> padded(32 * 6, 0xee);
    for (std::size_t y = 0; y < 6; ++y) std::memcpy(&padded[32 * y], &colour[20 * y], 20);
    Frame other = frame;
    other.colour = grey(padded, 32);
    EXPECT_EQ(frame_digest(other), digest);
    other = frame;
    other.time_ns = other.depth_time_ns = 12345;
    EXPECT_EQ(frame_digest(other), digest);
    other.depth_time_ns = 12346;
    EXPECT_NE(frame_digest(other), digest);
    other = frame;
    other.depth_units_per_m = 1000;
    EXPECT_NE(frame_digest(other), digest);
    other = frame;
    other.depth.height = 5;
    EXPECT_NE(frame_digest(other), digest);
    other = frame;
    other.colour.stride = 19;
    EXPECT_EQ(frame_digest(other), 0U);
    other.colour.data = nullptr;
    EXPECT_EQ(frame_digest(other), 0U);
}

// Promise: two frames in two places, exchanged, are not one digest; nor are two rows.
TEST(FrameDigest, SeesOrder) {
    std::vector<std::uint8_t> colour(20 * 6, 10);
    std::vector<std::uint16_t> depth(20 * 6, 4000);
    Frame frame;
    frame.colour = grey(colour);
    frame.depth = {depth.data(), 20, 6, 20};
    colour[3] = 1;
    colour[43] = 2;
    const std::uint64_t digest = frame_digest(frame);
    std::swap(colour[3], colour[43]);
    EXPECT_NE(frame_digest(frame), digest);
}

// Promise: the digest of a picture is that of its colours, in whichever order the channels lie in memory, for rows of
// every length; with red and blue exchanged it is another picture.
TEST(FrameDigest, KnowsColoursNotChannels) {
    constexpr std::uint32_t kWidthMax = 700;
    std::vector<std::uint8_t> rgb(3 * kWidthMax * 2), bgr(rgb.size());
    for (std::size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<std::uint8_t>(37 * i + i / 251);
    for (std::size_t i = 0; i < rgb.size(); ++i) bgr[i] = rgb[i - i % 3 + 2 - i % 3];
    const std::vector<std::uint16_t> depth(kWidthMax * 2, 5000);
    for (std::uint32_t width = 1; width <= kWidthMax; ++width) {
        Frame frame;
        frame.format = PixelFormat::kRgb8;
        frame.colour = {rgb.data(), width, 2, 3 * kWidthMax};
        frame.depth = {depth.data(), width, 2, kWidthMax};
        const std::uint64_t digest = frame_digest(frame);
        frame.format = PixelFormat::kBgr8;
        ASSERT_NE(frame_digest(frame), digest) << width;
        frame.colour.data = bgr.data();
        ASSERT_EQ(frame_digest(frame), digest) << width;
    }
}

// The hexadecimal dump behind `heading` in the SPEC page.
ByteVector dump_behind(const std::string& page, const std::string& heading) {
    ByteVector bytes;
    std::size_t at = page.find(heading);
    if (at == std::string::npos) return bytes;
    at = page.find("```\n", at) + 4;
    const std::size_t end = page.find("```", at);
    while (at < end) {
        const std::string line = page.substr(at, page.find('\n', at) - at);
        for (std::size_t i = 6; i + 1 < line.size() && i < 6 + 3 * 16 && line[i] != '|'; i += 3) {
            bytes.push_back(static_cast<std::byte>(std::stoul(line.substr(i, 2), nullptr, 16)));
        }
        at += line.size() + 1;
    }
    return bytes;
}

std::string dump_of(const ByteVector& bytes) {
    std::string text;
    char part[40];
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        if (i % 16 == 0) {
            std::snprintf(part, sizeof(part), "%s%04zx  ", i == 0 ? "" : "\n", i);
            text += part;
        }
        std::snprintf(part, sizeof(part), "%02x ", std::to_integer<unsigned>(bytes[i]));
        text += part;
    }
    return text + "\n";
}

// Promise: the examples in docs/SPEC-recording.md are what the program writes, byte for byte.
TEST(RecordingFormat, SpecIsTrue) {
    std::ifstream stream(STILLMESH_SPEC);
    const std::string page{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    const ByteVector frame = test::frame_bytes(some_frame(0));
    EXPECT_EQ(dump_behind(page, "### Example: a frame"), frame) << dump_of(frame);
    const ByteVector end = test::end_bytes(RecordingEnd::kDone, 1);
    EXPECT_EQ(dump_behind(page, "### Example: an end"), end) << dump_of(end);
    ByteVector header = test::header_bytes(some_header());
    header.resize(64);
    // Size and number of limits grow with the method.
    header[12] = header[13] = header[16] = std::byte{0};
    ByteVector in_page = dump_behind(page, "### Example: the begin of a header");
    ASSERT_EQ(in_page.size(), 64U) << dump_of(header);
    in_page[12] = in_page[13] = in_page[16] = std::byte{0};
    EXPECT_EQ(in_page, header) << dump_of(header);
}

}  // namespace
}  // namespace stillmesh::format_test
