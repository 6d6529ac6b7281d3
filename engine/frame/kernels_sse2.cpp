// What every x86-64 has.
#include "engine/frame/kernels.hpp"

#if defined(__SSE2__)

#include <emmintrin.h>

#include <cstring>

namespace stillmesh {
namespace {

__m128i load(const std::uint8_t* p) noexcept {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
}
void store(std::uint8_t* p, __m128i v) noexcept {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(p), v);
}
__m128i bytes(std::uint32_t value) noexcept {
    return _mm_set1_epi8(static_cast<char>(value));
}
__m128i shorts(std::int32_t value) noexcept {
    return _mm_set1_epi16(static_cast<short>(value));
}

// Signed 16 bits: without optimisation the insert is a macro whose operand is a short. The sign reaches lane 1 of the
// first load only, and the next insert overwrites it.
std::int16_t pair_at(const std::uint8_t* p) noexcept {
    std::int16_t pair;
    std::memcpy(&pair, p, sizeof pair);
    return pair;
}

// (weight_a * a + weight_b * b + 64) / 128 of eight 16-bit lanes.
__m128i blend(__m128i a, __m128i weight_a, __m128i b, __m128i weight_b) noexcept {
    const __m128i sum = _mm_add_epi16(_mm_mullo_epi16(a, weight_a), _mm_mullo_epi16(b, weight_b));
    return _mm_srli_epi16(_mm_add_epi16(sum, shorts(64)), 7);
}

void scale_row(const std::uint8_t* above, const std::uint8_t* below, std::uint32_t source_width,
               std::uint8_t weight_below, const ScaleBlock* blocks, std::uint32_t width, std::uint8_t* scratch,
               std::uint8_t* out) noexcept {
    const __m128i zero = _mm_setzero_si128();
    const __m128i weight_a = shorts(128 - weight_below);
    const __m128i weight_b = shorts(weight_below);
    for (std::uint32_t x = 0; x < source_width; x += 16) {
        const __m128i a = load(above + x);
        const __m128i b = load(below + x);
        const __m128i low = blend(_mm_unpacklo_epi8(a, zero), weight_a, _mm_unpacklo_epi8(b, zero), weight_b);
        const __m128i high = blend(_mm_unpackhi_epi8(a, zero), weight_a, _mm_unpackhi_epi8(b, zero), weight_b);
        store(scratch + x, _mm_packus_epi16(low, high));
    }
    const __m128i low_byte = shorts(255);
    for (std::uint32_t x = 0; x < width; x += kScaleBlock, ++blocks) {
        // A pick and its right neighbour are one 16-bit load.
        const std::uint8_t* const from = scratch + blocks->first;
        const std::uint8_t* const picks = blocks->picks;
        __m128i pairs = _mm_cvtsi32_si128(pair_at(from + picks[0]));
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[2]), 1);
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[4]), 2);
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[6]), 3);
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[8]), 4);
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[10]), 5);
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[12]), 6);
        pairs = _mm_insert_epi16(pairs, pair_at(from + picks[14]), 7);
        const __m128i weights = load(blocks->weights);
        const __m128i pixels = blend(_mm_and_si128(pairs, low_byte), _mm_and_si128(weights, low_byte),
                                     _mm_srli_epi16(pairs, 8), _mm_srli_epi16(weights, 8));
        _mm_storel_epi64(reinterpret_cast<__m128i*>(out + x), _mm_packus_epi16(pixels, zero));
    }
}

__m128i first_lanes(std::uint32_t count) noexcept {
    return _mm_cmpgt_epi8(bytes(count), _mm_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
}

using Lanes = __m128i;
constexpr std::uint32_t kLanes = 16;

Lanes least(Lanes a, Lanes b) noexcept {
    return _mm_min_epu8(a, b);
}
Lanes greatest(Lanes a, Lanes b) noexcept {
    return _mm_max_epu8(a, b);
}
Lanes plus(Lanes a, Lanes b) noexcept {
    return _mm_adds_epu8(a, b);
}
Lanes minus(Lanes a, Lanes b) noexcept {
    return _mm_subs_epu8(a, b);
}
std::uint32_t set_lanes(Lanes v) noexcept {
    return ~static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_cmpeq_epi8(v, _mm_setzero_si128()))) & 0xffffU;
}
Lanes where_above(Lanes a, Lanes b) noexcept {
    return _mm_andnot_si128(_mm_cmpeq_epi8(minus(a, b), _mm_setzero_si128()), a);
}

#include "engine/frame/kernels_x86.inc"

// The seven taps of the blur on 8 lanes; products and sums stay below 2^16, as unsigned numbers.
__m128i weigh(__m128i middle, __m128i sum1, __m128i sum2, __m128i sum3) noexcept {
    __m128i sum = _mm_add_epi16(_mm_mullo_epi16(middle, shorts(56)), _mm_mullo_epi16(sum1, shorts(49)));
    sum = _mm_add_epi16(sum, _mm_add_epi16(_mm_mullo_epi16(sum2, shorts(33)), _mm_mullo_epi16(sum3, shorts(18))));
    return _mm_srli_epi16(_mm_add_epi16(sum, shorts(128)), 8);
}

inline __attribute__((always_inline)) __m128i seven_taps(__m128i t0, __m128i t1, __m128i t2, __m128i t3, __m128i t4,
                                                         __m128i t5, __m128i t6) noexcept {
    const __m128i zero = _mm_setzero_si128();
    const __m128i low =
        weigh(_mm_unpacklo_epi8(t3, zero), _mm_add_epi16(_mm_unpacklo_epi8(t2, zero), _mm_unpacklo_epi8(t4, zero)),
              _mm_add_epi16(_mm_unpacklo_epi8(t1, zero), _mm_unpacklo_epi8(t5, zero)),
              _mm_add_epi16(_mm_unpacklo_epi8(t0, zero), _mm_unpacklo_epi8(t6, zero)));
    const __m128i high =
        weigh(_mm_unpackhi_epi8(t3, zero), _mm_add_epi16(_mm_unpackhi_epi8(t2, zero), _mm_unpackhi_epi8(t4, zero)),
              _mm_add_epi16(_mm_unpackhi_epi8(t1, zero), _mm_unpackhi_epi8(t5, zero)),
              _mm_add_epi16(_mm_unpackhi_epi8(t0, zero), _mm_unpackhi_epi8(t6, zero)));
    return _mm_packus_epi16(low, high);
}

#include "engine/frame/kernels_disc.inc"
constexpr Disc<std::int16_t> kDisc;

// As in the AVX2 kernel: the sum of v * row_sum(v) is built by adding the running sum once per row, from the outside
// in.
Moments moments(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    const __m128i zero = _mm_setzero_si128();
    const std::uint8_t* const left = centre - kPatchRadius;
    const auto across = [&zero](__m128i pixels, const std::int16_t* weights) noexcept {
        const __m128i* const w = reinterpret_cast<const __m128i*>(weights);
        return _mm_add_epi32(_mm_madd_epi16(_mm_unpacklo_epi8(pixels, zero), _mm_load_si128(w)),
                             _mm_madd_epi16(_mm_unpackhi_epi8(pixels, zero), _mm_load_si128(w + 1)));
    };
    __m128i x = _mm_add_epi32(across(load(left), kDisc.across[0]), across(load(left + 16), kDisc.across[0] + 16));
    __m128i running = zero;
    __m128i y = zero;
    for (std::int32_t v = kPatchRadius; v >= 1; --v) {
        for (std::int32_t k = 0; k < 32; k += 16) {
            const __m128i below = load(left + v * stride + k);
            const __m128i above = load(left - v * stride + k);
            x = _mm_add_epi32(x, _mm_add_epi32(across(below, kDisc.across[v] + k), across(above, kDisc.across[v] + k)));
            const __m128i inside = load(kDisc.inside[v] + k);
            running = _mm_add_epi64(running, _mm_sad_epu8(_mm_and_si128(below, inside), zero));
            running = _mm_sub_epi64(running, _mm_sad_epu8(_mm_and_si128(above, inside), zero));
        }
        y = _mm_add_epi64(y, running);
    }
    return {total(x), total_of_two(y)};
}

// Bits of the bytes by halves, then the bytes summed.
__m128i bit_counts(__m128i v) noexcept {
    v = _mm_sub_epi8(v, _mm_and_si128(_mm_srli_epi16(v, 1), bytes(0x55)));
    v = _mm_add_epi8(_mm_and_si128(v, bytes(0x33)), _mm_and_si128(_mm_srli_epi16(v, 2), bytes(0x33)));
    return _mm_and_si128(_mm_add_epi8(v, _mm_srli_epi16(v, 4)), bytes(0x0f));
}

std::uint32_t hamming(const std::uint64_t a[4], const std::uint64_t b[4]) noexcept {
    const __m128i* const p = reinterpret_cast<const __m128i*>(a);
    const __m128i* const q = reinterpret_cast<const __m128i*>(b);
    const __m128i low = bit_counts(_mm_xor_si128(_mm_loadu_si128(p), _mm_loadu_si128(q)));
    const __m128i high = bit_counts(_mm_xor_si128(_mm_loadu_si128(p + 1), _mm_loadu_si128(q + 1)));
    return static_cast<std::uint32_t>(total_of_two(_mm_sad_epu8(_mm_add_epi8(low, high), _mm_setzero_si128())));
}

#include "engine/frame/kernels_lanes.inc"

constexpr Kernels kSse2 = {
    "sse2",  plain_grey_from_rgb, plain_grey_from_bgr, scale_row, fast_row, local_maxima, blur_row, moments, tensors,
    hamming, hamming_many};

}  // namespace
}  // namespace stillmesh

#endif

const stillmesh::Kernels* stillmesh::sse2_kernels() noexcept {
#if defined(__SSE2__)
    return &kSse2;
#else
    return nullptr;
#endif
}
