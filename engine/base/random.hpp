// Seeded random numbers, the same on every processor and library: SplitMix64 (Steele, Lea, Flood 2014).
#pragma once

#include <cstdint>

#include "engine/base/check.hpp"

namespace stillmesh {

class Random {
public:
    explicit constexpr Random(std::uint64_t seed) noexcept : state_(seed) {}

    [[nodiscard]] constexpr std::uint64_t next() noexcept {
        state_ += 0x9e3779b97f4a7c15ULL;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
        return z ^ (z >> 31);
    }
    // Uniform in [0, bound), bound >= 1. Multiply-shift: its bias is below bound / 2^32.
    [[nodiscard]] constexpr std::uint32_t below(std::uint32_t bound) noexcept {
        STILLMESH_CHECK(bound >= 1);
        return static_cast<std::uint32_t>(((next() >> 32) * bound) >> 32);
    }
    // Uniform in [0, 1), 53 bits.
    [[nodiscard]] constexpr double uniform() noexcept { return static_cast<double>(next() >> 11) * 0x1p-53; }
    [[nodiscard]] constexpr double uniform(double low, double high) noexcept { return low + (high - low) * uniform(); }
    // Mean 0, variance 1: the sum of twelve uniforms (exact arithmetic everywhere, tails end at 6 sigma).
    [[nodiscard]] constexpr double normal() noexcept {
        double sum = -6.0;
        for (int i = 0; i < 12; ++i) sum += uniform();
        return sum;
    }

private:
    std::uint64_t state_;
};

}  // namespace stillmesh
