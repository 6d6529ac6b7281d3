// Hamming distance of two descriptors. Four words at once share most of the counting, so that it needs no population
// count instruction: x86-64's baseline has none (in SSE2, with the sum of bytes that it has, .9 of 72.4 million
// instructions of a frame less than in plain integers). arm64 has one: the dearest hostile frame 163 to 140 million
// instructions there.
#pragma once

#include <cstdint>

#include "engine/features/features.hpp"
#ifdef __aarch64__
#include <arm_neon.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace stillmesh {

[[nodiscard]] inline std::uint32_t hamming_distance(const Descriptor& a, const Descriptor& b) noexcept {
#ifdef __aarch64__
    const auto count = [&](int i) {
        return vcntq_u8(vreinterpretq_u8_u64(veorq_u64(vld1q_u64(&a.words[i]), vld1q_u64(&b.words[i]))));
    };
    return vaddlvq_u8(vaddq_u8(count(0), count(2)));
#elif defined(__SSE2__)
    const auto pairs = [&](int i) {  // bits of each two
        const __m128i bits = _mm_xor_si128(_mm_loadu_si128(reinterpret_cast<const __m128i*>(&a.words[i])),
                                           _mm_loadu_si128(reinterpret_cast<const __m128i*>(&b.words[i])));
        return _mm_sub_epi8(bits, _mm_and_si128(_mm_srli_epi16(bits, 1), _mm_set1_epi8(0x55)));
    };
    const __m128i low = pairs(0), high = pairs(2);
    const __m128i k2 = _mm_set1_epi8(0x33), k4 = _mm_set1_epi8(0x0f);
    const __m128i nibbles =  // up to 8
        _mm_add_epi8(
            _mm_add_epi8(_mm_and_si128(low, k2), _mm_and_si128(high, k2)),
            _mm_add_epi8(_mm_and_si128(_mm_srli_epi16(low, 2), k2), _mm_and_si128(_mm_srli_epi16(high, 2), k2)));
    const __m128i bytes = _mm_add_epi8(_mm_and_si128(nibbles, k4), _mm_and_si128(_mm_srli_epi16(nibbles, 4), k4));
    const __m128i halves = _mm_sad_epu8(bytes, _mm_setzero_si128());
    return static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_add_epi64(halves, _mm_unpackhi_epi64(halves, halves))));
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
