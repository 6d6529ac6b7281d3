// Bytes in and out, little-endian on every processor, never beyond the end. A reader that ran out, or met what cannot
// be, stays failed and reads zeros, so a whole record is read first and judged once; a writer that ran out writes
// nothing more. Both have fields(), field_as() and zeros(): one list of a record's fields serves both ways.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace stillmesh {

// Whether `bytes` begin with `letters`, as far as they go: what is cut off within the letters may still be meant.
[[nodiscard]] constexpr bool begins_with(std::span<const std::byte> bytes,
                                         const std::array<char, 8>& letters) noexcept {
    for (std::size_t i = 0; i < letters.size() && i < bytes.size(); ++i) {
        if (bytes[i] != static_cast<std::byte>(letters[i])) return false;
    }
    return true;
}

// What reader and writer have in common: where they are in `Byte`s.
template <typename Byte>
class ByteCursor {
public:
    [[nodiscard]] constexpr std::size_t remaining() const noexcept { return bytes_.size() - position_; }
    [[nodiscard]] constexpr std::size_t position() const noexcept { return position_; }
    [[nodiscard]] constexpr bool is_ok() const noexcept { return !failed_; }

protected:
    // A number's bits, whatever its type.
    template <typename T>
    using Bits =
        std::conditional_t<sizeof(T) == 8, std::uint64_t,
                           std::conditional_t<sizeof(T) == 4, std::uint32_t,
                                              std::conditional_t<sizeof(T) == 2, std::uint16_t, std::uint8_t>>>;

    explicit constexpr ByteCursor(std::span<Byte> bytes) noexcept : bytes_(bytes) {}
    // The next `count`; none when fewer are left, and none from then on.
    [[nodiscard]] constexpr std::span<Byte> take(std::size_t count) noexcept {
        if (failed_ || count > remaining()) {
            failed_ = true;
            return {};
        }
        position_ += count;
        return bytes_.subspan(position_ - count, count);
    }

    std::span<Byte> bytes_;
    std::size_t position_ = 0;
    bool failed_ = false;
};

class ByteReader : public ByteCursor<const std::byte> {
public:
    explicit constexpr ByteReader(std::span<const std::byte> bytes) noexcept : ByteCursor(bytes) {}

    [[nodiscard]] constexpr std::uint8_t u8() noexcept { return number<std::uint8_t>(); }
    [[nodiscard]] constexpr std::uint16_t u16() noexcept { return number<std::uint16_t>(); }
    [[nodiscard]] constexpr std::uint32_t u32() noexcept { return number<std::uint32_t>(); }
    [[nodiscard]] constexpr std::uint64_t u64() noexcept { return number<std::uint64_t>(); }
    [[nodiscard]] constexpr std::int64_t i64() noexcept { return number<std::int64_t>(); }
    [[nodiscard]] constexpr float f32() noexcept { return number<float>(); }
    [[nodiscard]] constexpr double f64() noexcept { return number<double>(); }
    // The next `count` bytes, borrowed from the input; empty when fewer are left.
    [[nodiscard]] constexpr std::span<const std::byte> bytes(std::size_t count) noexcept { return take(count); }

    // Numbers and arrays of them, one after the other. A bool is one byte; any but 0 and 1 fails.
    template <typename... T>
    constexpr void fields(T&... values) noexcept {
        (field(values), ...);
    }
    // A number that lies there as another type; one that `value` cannot hold fails.
    template <typename As, typename T>
    constexpr void field_as(T& value) noexcept {
        const As read = number<As>();
        value = static_cast<T>(read);
        if (static_cast<As>(value) != read) failed_ = true;
    }
    // Any that is not 0 fails.
    constexpr void zeros(std::size_t count) noexcept {
        for (std::size_t i = 0; i < count; ++i) {
            if (u8() != 0) failed_ = true;
        }
    }

private:
    template <typename T>
    [[nodiscard]] constexpr T number() noexcept {
        std::uint64_t bits = 0;
        std::uint32_t shift = 0;
        for (const std::byte byte : take(sizeof(T))) {
            bits |= std::to_integer<std::uint64_t>(byte) << shift;
            shift += 8;
        }
        return std::bit_cast<T>(static_cast<Bits<T>>(bits));
    }
    template <typename T>
    constexpr void field(T& value) noexcept {
        if constexpr (std::is_same_v<T, bool>) {
            field_as<std::uint8_t>(value);
        } else if constexpr (requires { std::size(value); }) {
            for (auto& element : value) field(element);
        } else {
            value = number<T>();
        }
    }
};

class ByteWriter : public ByteCursor<std::byte> {
public:
    explicit constexpr ByteWriter(std::span<std::byte> bytes) noexcept : ByteCursor(bytes) {}

    constexpr void u8(std::uint8_t value) noexcept { number(value); }
    constexpr void u16(std::uint16_t value) noexcept { number(value); }
    constexpr void u32(std::uint32_t value) noexcept { number(value); }
    constexpr void u64(std::uint64_t value) noexcept { number(value); }
    constexpr void i64(std::int64_t value) noexcept { number(value); }
    constexpr void f32(float value) noexcept { number(value); }
    constexpr void f64(double value) noexcept { number(value); }
    constexpr void bytes(std::span<const std::byte> source) noexcept {
        std::size_t i = 0;
        for (std::byte& byte : take(source.size())) byte = source[i++];
    }

    template <typename... T>
    constexpr void fields(const T&... values) noexcept {
        (field(values), ...);
    }
    template <typename As, typename T>
    constexpr void field_as(const T& value) noexcept {
        number(static_cast<As>(value));
    }
    constexpr void zeros(std::size_t count) noexcept {
        for (std::size_t i = 0; i < count; ++i) u8(0);
    }

    [[nodiscard]] constexpr std::span<const std::byte> written() const noexcept { return bytes_.first(position_); }

private:
    template <typename T>
    constexpr void number(T value) noexcept {
        std::uint64_t bits = std::bit_cast<Bits<T>>(value);
        for (std::byte& byte : take(sizeof(T))) {
            byte = static_cast<std::byte>(bits & 0xffU);
            bits >>= 8;
        }
    }
    template <typename T>
    constexpr void field(const T& value) noexcept {
        if constexpr (requires { std::size(value); }) {
            for (const auto& element : value) field(element);
        } else {
            number(value);
        }
    }
};

}  // namespace stillmesh
