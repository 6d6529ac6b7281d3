// Compiled for processors with AVX2 and POPCNT: nothing here may be an inline function or a template that another
// translation unit could share (kernels.hpp), so not even <bit> or <algorithm>.
#include "engine/frame/kernels.hpp"

#if defined(__AVX2__) && defined(__POPCNT__)

#include <immintrin.h>

namespace stillmesh {
namespace {

__m256i load(const std::uint8_t* p) noexcept {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
}
void store(std::uint8_t* p, __m256i v) noexcept {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), v);
}
__m128i load16(const std::uint8_t* p) noexcept {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
}
void store16(std::uint8_t* p, __m128i v) noexcept {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(p), v);
}
__m256i bytes(std::uint32_t value) noexcept {
    return _mm256_set1_epi8(static_cast<char>(value));
}
__m256i shorts(std::int32_t value) noexcept {
    return _mm256_set1_epi16(static_cast<short>(value));
}
// Two bytes, the first one lower, over and over: the signed factors of _mm256_maddubs_epi16.
__m256i byte_pairs(std::uint32_t first, std::uint32_t second) noexcept {
    return _mm256_set1_epi16(static_cast<short>(first | second << 8));
}

// Which byte of three loads of sixteen goes to each lane, so that one colour of sixteen pixels lies together; -128:
// none.
struct Picks {
    alignas(16) std::int8_t of_colour[3][3][16] = {};
    constexpr Picks() noexcept {
        for (std::int32_t i = 0; i < 3 * 3 * 16; ++i) {
            const std::int32_t at = 3 * (i % 16) + i / 48 - 16 * (i / 16 % 3);
            of_colour[i / 48][i / 16 % 3][i % 16] = static_cast<std::int8_t>(at >= 0 && at < 16 ? at : -128);
        }
    }
};
constexpr Picks kPicks;

// One colour of 48 bytes, times its weight, in 16-bit numbers.
__m256i weighted(const __m128i (&loads)[3], std::uint32_t colour, std::int32_t weight) noexcept {
    const auto part = [&](std::uint32_t i) noexcept {
        return _mm_shuffle_epi8(loads[i],
                                _mm_load_si128(reinterpret_cast<const __m128i*>(kPicks.of_colour[colour][i])));
    };
    return _mm256_mullo_epi16(_mm256_cvtepu8_epi16(_mm_or_si128(_mm_or_si128(part(0), part(1)), part(2))),
                              shorts(weight));
}

template <bool kIsRgb>
void grey_row(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept {
    std::uint32_t x = 0;
    for (; x + 16 <= width; x += 16) {
        const __m128i loads[3] = {load16(pixels + 3 * x), load16(pixels + 3 * x + 16), load16(pixels + 3 * x + 32)};
        __m256i sum = _mm256_add_epi16(weighted(loads, 0, kIsRgb ? 77 : 29), weighted(loads, 1, 150));
        sum = _mm256_add_epi16(sum, weighted(loads, 2, kIsRgb ? 29 : 77));
        sum = _mm256_srli_epi16(_mm256_add_epi16(sum, shorts(128)), 8);
        store16(grey + x, _mm_packus_epi16(_mm256_castsi256_si128(sum), _mm256_extracti128_si256(sum, 1)));
    }
    if constexpr (kIsRgb) {
        plain_grey_from_rgb(pixels + 3 * x, width - x, grey + x);
    } else {
        plain_grey_from_bgr(pixels + 3 * x, width - x, grey + x);
    }
}

void scale_row(const std::uint8_t* above, const std::uint8_t* below, std::uint32_t source_width,
               std::uint8_t weight_below, const ScaleBlock* blocks, std::uint32_t width, std::uint8_t* scratch,
               std::uint8_t* out) noexcept {
    const __m256i weights = byte_pairs(128u - weight_below, weight_below);
    const __m256i half = shorts(64);
    for (std::uint32_t x = 0; x < source_width; x += 32) {
        const __m256i a = load(above + x);
        const __m256i b = load(below + x);
        const __m256i low = _mm256_maddubs_epi16(_mm256_unpacklo_epi8(a, b), weights);
        const __m256i high = _mm256_maddubs_epi16(_mm256_unpackhi_epi8(a, b), weights);
        store(scratch + x, _mm256_packus_epi16(_mm256_srli_epi16(_mm256_add_epi16(low, half), 7),
                                               _mm256_srli_epi16(_mm256_add_epi16(high, half), 7)));
    }
    for (std::uint32_t x = 0; x < width; x += kScaleBlock, ++blocks) {
        const __m128i source = load16(scratch + blocks->first);
        const __m128i pairs = _mm_shuffle_epi8(source, load16(blocks->picks));
        const __m128i sum = _mm_add_epi16(_mm_maddubs_epi16(pairs, load16(blocks->weights)), _mm_set1_epi16(64));
        const __m128i pixels = _mm_packus_epi16(_mm_srli_epi16(sum, 7), _mm_setzero_si128());
        _mm_storel_epi64(reinterpret_cast<__m128i*>(out + x), pixels);
    }
}

__m256i first_lanes(std::uint32_t count) noexcept {
    const __m256i index = _mm256_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21,
                                           22, 23, 24, 25, 26, 27, 28, 29, 30, 31);
    return _mm256_cmpgt_epi8(bytes(count), index);
}

using Lanes = __m256i;
constexpr std::uint32_t kLanes = 32;

Lanes least(Lanes a, Lanes b) noexcept {
    return _mm256_min_epu8(a, b);
}
Lanes greatest(Lanes a, Lanes b) noexcept {
    return _mm256_max_epu8(a, b);
}
Lanes plus(Lanes a, Lanes b) noexcept {
    return _mm256_adds_epu8(a, b);
}
Lanes minus(Lanes a, Lanes b) noexcept {
    return _mm256_subs_epu8(a, b);
}
std::uint32_t set_lanes(Lanes v) noexcept {
    return ~static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(v, _mm256_setzero_si256())));
}
Lanes where_above(Lanes a, Lanes b) noexcept {
    return _mm256_andnot_si256(_mm256_cmpeq_epi8(minus(a, b), _mm256_setzero_si256()), a);
}

#include "engine/frame/kernels_x86.inc"

// The seven taps of the blur on 32 pixels; t3 is the middle. Products and sums stay below 2^16, as unsigned numbers.
inline __attribute__((always_inline)) __m256i seven_taps(__m256i t0, __m256i t1, __m256i t2, __m256i t3, __m256i t4,
                                                         __m256i t5, __m256i t6) noexcept {
    const __m256i w0 = byte_pairs(56, 0);
    const __m256i w1 = byte_pairs(49, 49);
    const __m256i w2 = byte_pairs(33, 33);
    const __m256i w3 = byte_pairs(18, 18);
    const __m256i half = shorts(128);
    __m256i low = _mm256_add_epi16(_mm256_maddubs_epi16(_mm256_unpacklo_epi8(t3, t3), w0),
                                   _mm256_maddubs_epi16(_mm256_unpacklo_epi8(t2, t4), w1));
    __m256i high = _mm256_add_epi16(_mm256_maddubs_epi16(_mm256_unpackhi_epi8(t3, t3), w0),
                                    _mm256_maddubs_epi16(_mm256_unpackhi_epi8(t2, t4), w1));
    low = _mm256_add_epi16(low, _mm256_maddubs_epi16(_mm256_unpacklo_epi8(t1, t5), w2));
    high = _mm256_add_epi16(high, _mm256_maddubs_epi16(_mm256_unpackhi_epi8(t1, t5), w2));
    low = _mm256_add_epi16(low, _mm256_maddubs_epi16(_mm256_unpacklo_epi8(t0, t6), w3));
    high = _mm256_add_epi16(high, _mm256_maddubs_epi16(_mm256_unpackhi_epi8(t0, t6), w3));
    return _mm256_packus_epi16(_mm256_srli_epi16(_mm256_add_epi16(low, half), 8),
                               _mm256_srli_epi16(_mm256_add_epi16(high, half), 8));
}

#include "engine/frame/kernels_disc.inc"
constexpr Disc<std::int8_t> kDisc;

// Rows +v and -v together. The sum of v * row_sum(v) is built by adding the running sum once per row, from the outside
// in: row v is then counted v times. Lanes: a row adds at most 15 * 255 * 2 = 7650 to one, two pairs of rows stay below
// 2^15.
Moments moments(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    const __m256i ones = shorts(1);
    const std::uint8_t* const left = centre - kPatchRadius;
    __m256i across =
        _mm256_maddubs_epi16(load(left), _mm256_load_si256(reinterpret_cast<const __m256i*>(kDisc.across[0])));
    __m256i x = _mm256_madd_epi16(across, ones);
    __m256i running = _mm256_setzero_si256();
    __m256i y = running;
    const __m256i zero = running;
    across = zero;
    for (std::int32_t v = kPatchRadius; v >= 1; --v) {
        const __m256i weights = _mm256_load_si256(reinterpret_cast<const __m256i*>(kDisc.across[v]));
        const __m256i inside = _mm256_load_si256(reinterpret_cast<const __m256i*>(kDisc.inside[v]));
        const __m256i below = load(left + v * stride);
        const __m256i above = load(left - v * stride);
        across = _mm256_add_epi16(
            across, _mm256_add_epi16(_mm256_maddubs_epi16(below, weights), _mm256_maddubs_epi16(above, weights)));
        if (v % 2 == 1) {
            x = _mm256_add_epi32(x, _mm256_madd_epi16(across, ones));
            across = zero;
        }
        running = _mm256_add_epi64(running, _mm256_sad_epu8(_mm256_and_si256(below, inside), zero));
        running = _mm256_sub_epi64(running, _mm256_sad_epu8(_mm256_and_si256(above, inside), zero));
        y = _mm256_add_epi64(y, running);
    }
    return {total(_mm_add_epi32(_mm256_castsi256_si128(x), _mm256_extracti128_si256(x, 1))),
            total_of_two(_mm_add_epi64(_mm256_castsi256_si128(y), _mm256_extracti128_si256(y, 1)))};
}

std::uint32_t hamming(const std::uint64_t a[4], const std::uint64_t b[4]) noexcept {
    return static_cast<std::uint32_t>(__builtin_popcountll(a[0] ^ b[0]) + __builtin_popcountll(a[1] ^ b[1]) +
                                      __builtin_popcountll(a[2] ^ b[2]) + __builtin_popcountll(a[3] ^ b[3]));
}

#include "engine/frame/kernels_lanes.inc"

constexpr Kernels kAvx2 = {"avx2",   grey_row<true>, grey_row<false>, scale_row, fast_row,    local_maxima,
                           blur_row, moments,        tensors,         hamming,   hamming_many};

}  // namespace
}  // namespace stillmesh

#endif

const stillmesh::Kernels* stillmesh::avx2_kernels() noexcept {
#if defined(__AVX2__) && defined(__POPCNT__)
    return &kAvx2;
#else
    return nullptr;
#endif
}
