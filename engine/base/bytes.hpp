// Bytes in and out, little-endian on every processor, never beyond the end. A reader that ran out stays failed and
// reads zeros, so a whole record is read first and judged once; a writer that ran out writes nothing more.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "engine/base/status.hpp"

namespace stillmesh {

class ByteReader {
public:
    explicit constexpr ByteReader(std::span<const std::byte> bytes) noexcept : bytes_(bytes) {}

    [[nodiscard]] constexpr std::uint8_t u8() noexcept { return unsigned_number<std::uint8_t>(); }
    [[nodiscard]] constexpr std::uint16_t u16() noexcept { return unsigned_number<std::uint16_t>(); }
    [[nodiscard]] constexpr std::uint32_t u32() noexcept { return unsigned_number<std::uint32_t>(); }
    [[nodiscard]] constexpr std::uint64_t u64() noexcept { return unsigned_number<std::uint64_t>(); }
    [[nodiscard]] constexpr std::int32_t i32() noexcept { return std::bit_cast<std::int32_t>(u32()); }
    [[nodiscard]] constexpr std::int64_t i64() noexcept { return std::bit_cast<std::int64_t>(u64()); }
    [[nodiscard]] constexpr float f32() noexcept { return std::bit_cast<float>(u32()); }
    [[nodiscard]] constexpr double f64() noexcept { return std::bit_cast<double>(u64()); }
    // The next `count` bytes, borrowed from the input; empty when fewer are left.
    [[nodiscard]] constexpr std::span<const std::byte> bytes(std::size_t count) noexcept {
        if (!can_take(count)) return {};
        const std::span<const std::byte> taken = bytes_.subspan(position_, count);
        position_ += count;
        return taken;
    }
    // A count that must be at most `limit`, and whose elements of `element_bytes` must still be there: checked before
    // anybody makes room for them. 0 and failed otherwise.
    [[nodiscard]] constexpr std::uint32_t count(std::uint32_t limit, std::size_t element_bytes) noexcept {
        const std::uint32_t value = u32();
        if (failed_ || value > limit || (element_bytes != 0 && value > remaining() / element_bytes)) {
            failed_ = true;
            return 0;
        }
        return value;
    }

    [[nodiscard]] constexpr std::size_t remaining() const noexcept { return bytes_.size() - position_; }
    [[nodiscard]] constexpr std::size_t position() const noexcept { return position_; }
    [[nodiscard]] constexpr bool is_ok() const noexcept { return !failed_; }
    // kOk or kCorrupt (more was read than there was, or a count was beyond its limit).
    [[nodiscard]] constexpr Status status() const noexcept { return failed_ ? Status::kCorrupt : Status::kOk; }

private:
    [[nodiscard]] constexpr bool can_take(std::size_t count) noexcept {
        if (failed_ || count > remaining()) failed_ = true;
        return !failed_;
    }
    template <typename T>
    [[nodiscard]] constexpr T unsigned_number() noexcept {
        static_assert(std::is_unsigned_v<T>);
        if (!can_take(sizeof(T))) return 0;
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < sizeof(T); ++i) {
            value |= std::to_integer<std::uint64_t>(bytes_[position_ + i]) << (8 * i);
        }
        position_ += sizeof(T);
        return static_cast<T>(value);
    }

    std::span<const std::byte> bytes_;
    std::size_t position_ = 0;
    bool failed_ = false;
};

class ByteWriter {
public:
    explicit constexpr ByteWriter(std::span<std::byte> bytes) noexcept : bytes_(bytes) {}

    constexpr void u8(std::uint8_t value) noexcept { unsigned_number(value); }
    constexpr void u16(std::uint16_t value) noexcept { unsigned_number(value); }
    constexpr void u32(std::uint32_t value) noexcept { unsigned_number(value); }
    constexpr void u64(std::uint64_t value) noexcept { unsigned_number(value); }
    constexpr void i32(std::int32_t value) noexcept { u32(std::bit_cast<std::uint32_t>(value)); }
    constexpr void i64(std::int64_t value) noexcept { u64(std::bit_cast<std::uint64_t>(value)); }
    constexpr void f32(float value) noexcept { u32(std::bit_cast<std::uint32_t>(value)); }
    constexpr void f64(double value) noexcept { u64(std::bit_cast<std::uint64_t>(value)); }
    constexpr void bytes(std::span<const std::byte> source) noexcept {
        if (!can_take(source.size())) return;
        for (std::size_t i = 0; i < source.size(); ++i) bytes_[position_ + i] = source[i];
        position_ += source.size();
    }

    [[nodiscard]] constexpr std::span<const std::byte> written() const noexcept { return bytes_.first(position_); }
    [[nodiscard]] constexpr std::size_t remaining() const noexcept { return bytes_.size() - position_; }
    [[nodiscard]] constexpr std::size_t position() const noexcept { return position_; }
    [[nodiscard]] constexpr bool is_ok() const noexcept { return !failed_; }
    // kOk or kFull (something did not fit; everything before it was written, nothing after it).
    [[nodiscard]] constexpr Status status() const noexcept { return failed_ ? Status::kFull : Status::kOk; }

private:
    [[nodiscard]] constexpr bool can_take(std::size_t count) noexcept {
        if (failed_ || count > remaining()) failed_ = true;
        return !failed_;
    }
    template <typename T>
    constexpr void unsigned_number(T value) noexcept {
        static_assert(std::is_unsigned_v<T>);
        if (!can_take(sizeof(T))) return;
        for (std::size_t i = 0; i < sizeof(T); ++i) {
            bytes_[position_ + i] = static_cast<std::byte>((value >> (8 * i)) & 0xffU);
        }
        position_ += sizeof(T);
    }

    std::span<std::byte> bytes_;
    std::size_t position_ = 0;
    bool failed_ = false;
};

}  // namespace stillmesh
