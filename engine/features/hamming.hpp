// Hamming distance of two descriptors. In plain integers four words at once share most of the counting, so that it
// needs no population count instruction (x86-64's baseline has none; arm64 has one: the dearest hostile frame 163 to
// 140 million instructions there).
#pragma once

#include <cstdint>

#include "engine/features/features.hpp"
#ifdef __aarch64__
#include <arm_neon.h>
#endif

namespace stillmesh {

[[nodiscard]] inline std::uint32_t hamming_distance(const Descriptor& a, const Descriptor& b) noexcept {
#ifdef __aarch64__
    const auto count = [&](int i) {
        return vcntq_u8(vreinterpretq_u8_u64(veorq_u64(vld1q_u64(&a.words[i]), vld1q_u64(&b.words[i]))));
    };
    return vaddlvq_u8(vaddq_u8(count(0), count(2)));
#else
    constexpr std::uint64_t k1 = 0x5555555555555555ULL, k2 = 0x3333333333333333ULL, k4 = 0x0f0f0f0f0f0f0f0fULL;
    std::uint64_t bytes = 0;
    for (int i = 0; i < 2; ++i) {  // of a pair of words and the next, which are two registers of SSE2
        std::uint64_t x = a.words[i] ^ b.words[i];
        std::uint64_t y = a.words[i + 2] ^ b.words[i + 2];
        x -= (x >> 1) & k1;
        y -= (y >> 1) & k1;
        x = (x & k2) + ((x >> 2) & k2) + (y & k2) + ((y >> 2) & k2);  // nibbles up to 8
        bytes += (x & k4) + ((x >> 4) & k4);                          // bytes up to 16, 32 over both rounds
    }
    // Bytes up to 32, eight of them: the sum may reach 256, so it is taken over 16-bit lanes.
    constexpr std::uint64_t k8 = 0x00ff00ff00ff00ffULL;
    const std::uint64_t halves = (bytes & k8) + ((bytes >> 8) & k8);
    return static_cast<std::uint32_t>((halves * 0x0001000100010001ULL) >> 48);
#endif
}

}  // namespace stillmesh
