// The state hash: field by field, little-endian meaning, the same on every processor. FNV-1a over 64-bit words with a
// final avalanche: for comparing states, not for security.
#pragma once

#include <bit>
#include <cstdint>

namespace stillmesh {

class StateHash {
public:
    constexpr void add(std::uint64_t word) noexcept {
        value_ ^= word;
        value_ *= 0x100000001b3ULL;
        value_ ^= value_ >> 29;
    }
    constexpr void add(std::int64_t word) noexcept { add(static_cast<std::uint64_t>(word)); }
    constexpr void add(std::uint32_t word) noexcept { add(static_cast<std::uint64_t>(word)); }
    constexpr void add(std::int32_t word) noexcept { add(static_cast<std::uint64_t>(static_cast<std::int64_t>(word))); }
    // By its bits: 0.0 and -0.0 differ, as they do to whoever divides by them.
    constexpr void add(double number) noexcept { add(std::bit_cast<std::uint64_t>(number)); }
    constexpr void add(float number) noexcept { add(std::bit_cast<std::uint32_t>(number)); }

    [[nodiscard]] constexpr std::uint64_t value() const noexcept {
        std::uint64_t z = value_;
        z = (z ^ (z >> 33)) * 0xff51afd7ed558ccdULL;
        z = (z ^ (z >> 33)) * 0xc4ceb9fe1a85ec53ULL;
        return z ^ (z >> 33);
    }

private:
    std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

}  // namespace stillmesh
