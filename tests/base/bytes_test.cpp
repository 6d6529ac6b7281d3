#include "engine/base/bytes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <string_view>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/base/random.hpp"

namespace stillmesh::bytes_test {
namespace {

// One record with every type, as a file would hold it: 1 + 2 + 4 + 8 + 4 + 8 + 4 + 8 + 3 = 42 bytes.
constexpr std::size_t kRecordBytes = 42;
constexpr std::array<std::byte, 3> kTail = {std::byte{0xaa}, std::byte{0xbb}, std::byte{0xcc}};

void write_record(ByteWriter& writer) {
    writer.u8(0x12);
    writer.u16(0x3456);
    writer.u32(0x789abcdeU);
    writer.u64(0x0123456789abcdefULL);
    writer.fields(std::int32_t{-2});
    writer.i64(std::numeric_limits<std::int64_t>::min());
    writer.f32(-0.0F);
    writer.f64(1.5);
    writer.bytes(kTail);
}

// Promise: the layout is little-endian, byte by byte, on every processor.
TEST(ByteWriter, LayoutIsLittleEndian) {
    std::array<std::byte, kRecordBytes> buffer{};
    ByteWriter writer(buffer);
    write_record(writer);
    ASSERT_TRUE(writer.is_ok());
    ASSERT_EQ(writer.position(), kRecordBytes);
    const std::array<unsigned, kRecordBytes> expected = {
        0x12, 0x56, 0x34, 0xde, 0xbc, 0x9a, 0x78, 0xef, 0xcd, 0xab, 0x89, 0x67, 0x45, 0x23,
        0x01, 0xfe, 0xff, 0xff, 0xff, 0,    0,    0,    0,    0,    0,    0,    0x80, 0,
        0,    0,    0x80, 0,    0,    0,    0,    0,    0,    0xf8, 0x3f, 0xaa, 0xbb, 0xcc};
    for (std::size_t i = 0; i < kRecordBytes; ++i) {
        EXPECT_EQ(std::to_integer<unsigned>(buffer[i]), expected[i]) << "byte " << i;
    }
}

// Promise: a record cut at any byte reads true up to the cut, zeros behind it, and fails; never reads beyond.
TEST(ByteReader, TruncationAtEveryOffset) {
    std::array<std::byte, kRecordBytes> buffer{};
    ByteWriter writer(buffer);
    write_record(writer);
    for (std::size_t cut = 0; cut <= kRecordBytes; ++cut) {
        // An allocation of exactly the cut size, so that the sanitizers see one byte too many.
        const std::vector<std::byte> bytes(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(cut));
        ByteReader reader(bytes);
        EXPECT_EQ(reader.u8(), cut >= 1 ? 0x12 : 0);
        EXPECT_EQ(reader.u16(), cut >= 3 ? 0x3456 : 0);
        EXPECT_EQ(reader.u32(), cut >= 7 ? 0x789abcdeU : 0U);
        EXPECT_EQ(reader.u64(), cut >= 15 ? 0x0123456789abcdefULL : 0U);
        std::int32_t negative = 1;
        reader.fields(negative);
        EXPECT_EQ(negative, cut >= 19 ? -2 : 0);
        EXPECT_EQ(reader.i64(), cut >= 27 ? std::numeric_limits<std::int64_t>::min() : 0);
        EXPECT_EQ(std::bit_cast<std::uint32_t>(reader.f32()), cut >= 31 ? 0x80000000U : 0U);
        EXPECT_EQ(reader.f64(), cut >= 39 ? 1.5 : 0.0);
        EXPECT_EQ(reader.bytes(3).size(), cut >= 42 ? 3U : 0U);
        EXPECT_EQ(reader.is_ok(), cut == kRecordBytes) << cut;
        EXPECT_EQ(reader.remaining(), bytes.size() - reader.position());
    }
}

// Promise: once failed, a reader stays failed, even when a smaller number would still fit.
TEST(ByteReader, StaysFailed) {
    const std::array<std::byte, 3> bytes = {std::byte{1}, std::byte{2}, std::byte{3}};
    ByteReader reader(bytes);
    EXPECT_EQ(reader.u32(), 0U);
    EXPECT_EQ(reader.u8(), 0U);
    EXPECT_EQ(reader.position(), 0U);
    EXPECT_FALSE(reader.is_ok());
}

// Promise: one list of fields writes a record and reads it again: numbers, arrays, truths, numbers of another type.
TEST(Bytes, FieldsServeBothWays) {
    struct Record {
        std::uint16_t number = 0;
        bool is_true = false;
        std::array<float, 2> floats{};
        std::uint32_t narrow[2] = {};
        std::int64_t negative = 0;
    };
    const auto fields = [](auto& bytes, auto& record) {
        bytes.fields(record.number, record.is_true, record.floats);
        bytes.zeros(1);
        for (auto& n : record.narrow) bytes.template field_as<std::uint8_t>(n);
        bytes.fields(record.negative);
    };
    const Record written{7, true, {1.5F, -0.25F}, {3, 255}, -9};
    std::array<std::byte, 22> buffer{};
    ByteWriter writer(buffer);
    fields(writer, written);
    ASSERT_TRUE(writer.is_ok());
    ASSERT_EQ(writer.remaining(), 0U);
    Record read;
    ByteReader reader(buffer);
    fields(reader, read);
    EXPECT_TRUE(reader.is_ok());
    EXPECT_EQ(read.number, 7);
    EXPECT_TRUE(read.is_true);
    EXPECT_EQ(read.floats, written.floats);
    EXPECT_EQ(read.narrow[1], 255U);
    EXPECT_EQ(read.negative, -9);
}

// Promise: a truth that is neither 0 nor 1, a number too large for its place and a zero that is none fail.
TEST(ByteReader, RefusesWhatCannotBe) {
    const std::array<std::byte, 2> bytes = {std::byte{2}, std::byte{1}};
    bool is_true = false;
    std::uint8_t narrow = 0;
    for (int what = 0; what < 4; ++what) {
        ByteReader reader(bytes);
        if (what == 0) reader.fields(is_true);
        if (what == 1) reader.field_as<std::uint16_t>(narrow);
        if (what == 2) reader.zeros(1);
        EXPECT_EQ(reader.is_ok(), what == 3) << what;
    }
}

// Promise: bytes begin with letters as far as they go.
TEST(Bytes, BeginsWith) {
    constexpr std::array<char, 8> kLetters = {'S', 'T', 'I', 'L', 'L', 'X', 'Y', 'Z'};
    const auto begins = [&](std::string_view text) {
        return begins_with(std::as_bytes(std::span(text.data(), text.size())), kLetters);
    };
    EXPECT_TRUE(begins("STILLXYZ and more"));
    EXPECT_TRUE(begins("STI"));
    EXPECT_TRUE(begins(""));
    EXPECT_FALSE(begins("STILLXYA"));
    EXPECT_FALSE(begins("T"));
}

// Promise: a writer that runs out writes what came before, nothing of what did not fit, nothing after.
TEST(ByteWriter, EndAtEveryOffset) {
    std::array<std::byte, kRecordBytes> whole{};
    ByteWriter whole_writer(whole);
    write_record(whole_writer);
    for (std::size_t size = 0; size < kRecordBytes; ++size) {
        std::vector<std::byte> bytes(size, std::byte{0x77});
        ByteWriter writer(bytes);
        write_record(writer);
        EXPECT_FALSE(writer.is_ok());
        EXPECT_LE(writer.position(), size);
        for (std::size_t i = 0; i < size; ++i) {
            EXPECT_EQ(bytes[i], i < writer.position() ? whole[i] : std::byte{0x77}) << size << " " << i;
        }
    }
}

// Promise: random numbers of every width come back as they were written.
TEST(Bytes, RoundTrip) {
    Random random(3);
    for (int round = 0; round < 200; ++round) {
        std::array<std::byte, 1024> buffer{};
        ByteWriter writer(buffer);
        const std::uint64_t seed = random.next();
        Random values(seed);
        for (int i = 0; i < 60; ++i) {
            const std::uint64_t v = values.next();
            switch (v % 5) {
                case 0: writer.u8(static_cast<std::uint8_t>(v >> 32)); break;
                case 1: writer.u16(static_cast<std::uint16_t>(v >> 32)); break;
                case 2: writer.u32(static_cast<std::uint32_t>(v >> 32)); break;
                case 3: writer.i64(static_cast<std::int64_t>(v)); break;
                default: writer.f64(static_cast<double>(v));
            }
        }
        ASSERT_TRUE(writer.is_ok());
        ByteReader reader(writer.written());
        Random again(seed);
        for (int i = 0; i < 60; ++i) {
            const std::uint64_t v = again.next();
            switch (v % 5) {
                case 0: ASSERT_EQ(reader.u8(), static_cast<std::uint8_t>(v >> 32)); break;
                case 1: ASSERT_EQ(reader.u16(), static_cast<std::uint16_t>(v >> 32)); break;
                case 2: ASSERT_EQ(reader.u32(), static_cast<std::uint32_t>(v >> 32)); break;
                case 3: ASSERT_EQ(reader.i64(), static_cast<std::int64_t>(v)); break;
                default: ASSERT_EQ(reader.f64(), static_cast<double>(v));
            }
        }
        ASSERT_TRUE(reader.is_ok());
        ASSERT_EQ(reader.remaining(), 0U);
    }
}

std::span<const std::byte> bytes_of(std::string_view text) {
    return std::as_bytes(std::span(text.data(), text.size()));
}

// Promise: the CRC is the one of zlib, PNG and Ethernet (published check values).
TEST(Crc32, KnownVectors) {
    EXPECT_EQ(crc32(bytes_of("")), 0U);
    EXPECT_EQ(crc32(bytes_of("a")), 0xe8b7be43U);
    EXPECT_EQ(crc32(bytes_of("123456789")), 0xcbf43926U);
    EXPECT_EQ(crc32(bytes_of("The quick brown fox jumps over the lazy dog")), 0x414fa339U);
    EXPECT_EQ(crc32(bytes_of("IEND")), 0xae426082U);
    const std::array<std::byte, 32> zeros{};
    EXPECT_EQ(crc32(zeros), 0x190a55adU);
}

// Promise: it does not matter how the bytes are cut into calls, and every single flipped bit shows.
TEST(Crc32, PiecesAndFlippedBits) {
    Random random(11);
    std::vector<std::byte> bytes(257);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random.below(256));
    const std::uint32_t whole = crc32(bytes);
    for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
        Crc32 crc;
        crc.add(std::span(bytes).first(cut));
        crc.add(std::span(bytes).subspan(cut));
        ASSERT_EQ(crc.value(), whole);
    }
    for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
        const auto mask = static_cast<std::byte>(1U << (bit % 8));
        bytes[bit / 8] ^= mask;
        ASSERT_NE(crc32(bytes), whole);
        bytes[bit / 8] ^= mask;
    }
}

}  // namespace
}  // namespace stillmesh::bytes_test
