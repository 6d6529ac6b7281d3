// Integers of 128 bits for the exact checker: the compiler's where it has them, and on 32-bit processors a pair of
// words.
#pragma once

#include <compare>
#include <concepts>
#include <cstdint>

namespace stillmesh::mesh_checker {

// Two's complement; what leaves 128 bits is lost, as with any unsigned integer.
class PairOfWords {
public:
    constexpr PairOfWords(std::integral auto value) noexcept  // as implicit as between integers
        : high_(static_cast<std::uint64_t>(value < 0 ? -1 : 0)), low_(static_cast<std::uint64_t>(value)) {}
    constexpr PairOfWords(std::uint64_t high, std::uint64_t low) noexcept : high_(high), low_(low) {}

    [[nodiscard]] constexpr std::uint64_t high() const noexcept { return high_; }
    [[nodiscard]] constexpr std::uint64_t low() const noexcept { return low_; }

    friend constexpr PairOfWords operator+(PairOfWords a, PairOfWords b) noexcept {
        const std::uint64_t low = a.low_ + b.low_;
        return {a.high_ + b.high_ + (low < a.low_ ? 1 : 0), low};
    }
    friend constexpr PairOfWords operator-(PairOfWords a, PairOfWords b) noexcept {
        return {a.high_ - b.high_ - (a.low_ < b.low_ ? 1 : 0), a.low_ - b.low_};
    }
    // Modulo 2^128 the sign does not matter: the low words' full product, and the cross terms above it.
    friend constexpr PairOfWords operator*(PairOfWords a, PairOfWords b) noexcept {
        const std::uint64_t mask = 0xffffffffU;
        const std::uint64_t a0 = a.low_ & mask, a1 = a.low_ >> 32, b0 = b.low_ & mask, b1 = b.low_ >> 32;
        const std::uint64_t middle = a1 * b0 + (a0 * b0 >> 32);  // < 2^64
        const std::uint64_t carried = a0 * b1 + (middle & mask);
        const std::uint64_t high = a1 * b1 + (middle >> 32) + (carried >> 32);
        return {high + a.high_ * b.low_ + a.low_ * b.high_, a.low_ * b.low_};
    }
    PairOfWords& operator+=(PairOfWords other) noexcept { return *this = *this + other; }
    friend constexpr bool operator==(PairOfWords, PairOfWords) noexcept = default;
    friend constexpr std::strong_ordering operator<=>(PairOfWords a, PairOfWords b) noexcept {
        const auto by_high = static_cast<std::int64_t>(a.high_) <=> static_cast<std::int64_t>(b.high_);
        return by_high != 0 ? by_high : a.low_ <=> b.low_;
    }

private:
    std::uint64_t high_, low_;
};

#ifdef __SIZEOF_INT128__
__extension__ using Wide = __int128;
#else
using Wide = PairOfWords;
#endif

}  // namespace stillmesh::mesh_checker
