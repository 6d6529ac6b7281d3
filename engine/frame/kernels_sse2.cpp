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

// The best arcs so far of 16 centres: the greatest of the arcs' least pixels, the least of their greatest.
struct Arcs {
    __m128i bright;
    __m128i dark;
};

// Two more arcs of nine: those that add one of two pixels to the same eight.
inline __attribute__((always_inline)) void add_arcs(Arcs& best, __m128i least8, __m128i greatest8, __m128i before,
                                                    __m128i after) noexcept {
    best.bright = _mm_max_epu8(best.bright, _mm_min_epu8(least8, _mm_max_epu8(before, after)));
    best.dark = _mm_min_epu8(best.dark, _mm_max_epu8(greatest8, _mm_min_epu8(before, after)));
}

// All 16 centres at once. An arc's least brightness decides for bright corners, its greatest for dark ones: with W[j]
// the least of eight pixels from j, arcs j-1 and j give min(W[j], max(p[j-1], p[j+8])), and the best of all sixteen
// arcs, less the centre, is the strength (saturating: no corner is 0). Written out, because a compiler at -O2 keeps
// loops and with them the pixels in memory.
bool fast_row(const std::uint8_t* row, std::ptrdiff_t stride, std::uint32_t x_begin, std::uint32_t x_end,
              std::uint8_t threshold, std::uint8_t* strengths) noexcept {
    const __m128i t = bytes(threshold);
    const __m128i zero = _mm_setzero_si128();
    __m128i any = zero;
    for (std::uint32_t x = x_begin; x < x_end; x += 16) {
        const std::uint8_t* const row0 = row + x;
        const __m128i centre = load(row0);
        const std::uint8_t* const above3 = row0 - 3 * stride;
        const std::uint8_t* const above2 = row0 - 2 * stride;
        const std::uint8_t* const above1 = row0 - stride;
        const std::uint8_t* const below1 = row0 + stride;
        const std::uint8_t* const below2 = row0 + 2 * stride;
        const std::uint8_t* const below3 = row0 + 3 * stride;
        const __m128i high = _mm_adds_epu8(centre, t);
        const __m128i low = _mm_subs_epu8(centre, t);
        // An arc of nine holds one of every two opposite pixels: all such pairs must have a bright (or dark) one.
        const __m128i p0 = load(above3);
        const __m128i p8 = load(below3);
        const __m128i p4 = load(row0 + 3);
        const __m128i p12 = load(row0 - 3);
        __m128i bright = _mm_min_epu8(_mm_max_epu8(p0, p8), _mm_max_epu8(p4, p12));
        __m128i dark = _mm_max_epu8(_mm_min_epu8(p0, p8), _mm_min_epu8(p4, p12));
        __m128i hope = _mm_or_si128(_mm_subs_epu8(bright, high), _mm_subs_epu8(low, dark));
        if (_mm_movemask_epi8(_mm_cmpeq_epi8(hope, zero)) == 0xffff) {
            store(strengths + x, zero);
            continue;
        }
        const __m128i p2 = load(above2 + 2);
        const __m128i p10 = load(below2 - 2);
        const __m128i p6 = load(below2 + 2);
        const __m128i p14 = load(above2 - 2);
        bright = _mm_min_epu8(bright, _mm_min_epu8(_mm_max_epu8(p2, p10), _mm_max_epu8(p6, p14)));
        dark = _mm_max_epu8(dark, _mm_max_epu8(_mm_min_epu8(p2, p10), _mm_min_epu8(p6, p14)));
        hope = _mm_or_si128(_mm_subs_epu8(bright, high), _mm_subs_epu8(low, dark));
        if (_mm_movemask_epi8(_mm_cmpeq_epi8(hope, zero)) == 0xffff) {
            store(strengths + x, zero);
            continue;
        }
        const __m128i p1 = load(above3 + 1);
        const __m128i p3 = load(above1 + 3);
        const __m128i p5 = load(below1 + 3);
        const __m128i p7 = load(below3 + 1);
        const __m128i p9 = load(below3 - 1);
        const __m128i p11 = load(below1 - 3);
        const __m128i p13 = load(above1 - 3);
        const __m128i p15 = load(above3 - 1);
        // Of two, four, then eight pixels from an odd one.
        const __m128i least2_1 = _mm_min_epu8(p1, p2);
        const __m128i least2_3 = _mm_min_epu8(p3, p4);
        const __m128i least2_5 = _mm_min_epu8(p5, p6);
        const __m128i least2_7 = _mm_min_epu8(p7, p8);
        const __m128i least2_9 = _mm_min_epu8(p9, p10);
        const __m128i least2_11 = _mm_min_epu8(p11, p12);
        const __m128i least2_13 = _mm_min_epu8(p13, p14);
        const __m128i least2_15 = _mm_min_epu8(p15, p0);
        const __m128i least4_1 = _mm_min_epu8(least2_1, least2_3);
        const __m128i least4_3 = _mm_min_epu8(least2_3, least2_5);
        const __m128i least4_5 = _mm_min_epu8(least2_5, least2_7);
        const __m128i least4_7 = _mm_min_epu8(least2_7, least2_9);
        const __m128i least4_9 = _mm_min_epu8(least2_9, least2_11);
        const __m128i least4_11 = _mm_min_epu8(least2_11, least2_13);
        const __m128i least4_13 = _mm_min_epu8(least2_13, least2_15);
        const __m128i least4_15 = _mm_min_epu8(least2_15, least2_1);
        const __m128i greatest2_1 = _mm_max_epu8(p1, p2);
        const __m128i greatest2_3 = _mm_max_epu8(p3, p4);
        const __m128i greatest2_5 = _mm_max_epu8(p5, p6);
        const __m128i greatest2_7 = _mm_max_epu8(p7, p8);
        const __m128i greatest2_9 = _mm_max_epu8(p9, p10);
        const __m128i greatest2_11 = _mm_max_epu8(p11, p12);
        const __m128i greatest2_13 = _mm_max_epu8(p13, p14);
        const __m128i greatest2_15 = _mm_max_epu8(p15, p0);
        const __m128i greatest4_1 = _mm_max_epu8(greatest2_1, greatest2_3);
        const __m128i greatest4_3 = _mm_max_epu8(greatest2_3, greatest2_5);
        const __m128i greatest4_5 = _mm_max_epu8(greatest2_5, greatest2_7);
        const __m128i greatest4_7 = _mm_max_epu8(greatest2_7, greatest2_9);
        const __m128i greatest4_9 = _mm_max_epu8(greatest2_9, greatest2_11);
        const __m128i greatest4_11 = _mm_max_epu8(greatest2_11, greatest2_13);
        const __m128i greatest4_13 = _mm_max_epu8(greatest2_13, greatest2_15);
        const __m128i greatest4_15 = _mm_max_epu8(greatest2_15, greatest2_1);
        Arcs best{zero, _mm_cmpeq_epi8(zero, zero)};
        add_arcs(best, _mm_min_epu8(least4_1, least4_5), _mm_max_epu8(greatest4_1, greatest4_5), p0, p9);
        add_arcs(best, _mm_min_epu8(least4_3, least4_7), _mm_max_epu8(greatest4_3, greatest4_7), p2, p11);
        add_arcs(best, _mm_min_epu8(least4_5, least4_9), _mm_max_epu8(greatest4_5, greatest4_9), p4, p13);
        add_arcs(best, _mm_min_epu8(least4_7, least4_11), _mm_max_epu8(greatest4_7, greatest4_11), p6, p15);
        add_arcs(best, _mm_min_epu8(least4_9, least4_13), _mm_max_epu8(greatest4_9, greatest4_13), p8, p1);
        add_arcs(best, _mm_min_epu8(least4_11, least4_15), _mm_max_epu8(greatest4_11, greatest4_15), p10, p3);
        add_arcs(best, _mm_min_epu8(least4_13, least4_1), _mm_max_epu8(greatest4_13, greatest4_1), p12, p5);
        add_arcs(best, _mm_min_epu8(least4_15, least4_3), _mm_max_epu8(greatest4_15, greatest4_3), p14, p7);
        const __m128i strength = _mm_max_epu8(_mm_subs_epu8(best.bright, centre), _mm_subs_epu8(centre, best.dark));
        const __m128i too_weak = _mm_cmpeq_epi8(_mm_subs_epu8(strength, t), zero);
        __m128i result = _mm_andnot_si128(too_weak, strength);
        if (x_end - x < 16) result = _mm_and_si128(result, first_lanes(x_end - x));
        store(strengths + x, result);
        any = _mm_or_si128(any, result);
    }
    return _mm_movemask_epi8(_mm_cmpeq_epi8(any, zero)) != 0xffff;
}

std::uint32_t local_maxima(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                           std::uint32_t x_begin, std::uint32_t x_end, std::uint16_t* out) noexcept {
    const __m128i zero = _mm_setzero_si128();
    std::uint32_t count = 0;
    for (std::uint32_t x = x_begin; x < x_end; x += 16) {
        const __m128i centre = load(row + x);
        if (_mm_movemask_epi8(_mm_cmpeq_epi8(centre, zero)) == 0xffff) continue;
        __m128i greatest = _mm_max_epu8(load(row + x - 1), load(row + x + 1));
        greatest = _mm_max_epu8(greatest, _mm_max_epu8(load(above + x - 1), load(above + x + 1)));
        greatest = _mm_max_epu8(greatest, _mm_max_epu8(load(below + x - 1), load(below + x + 1)));
        greatest = _mm_max_epu8(greatest, _mm_max_epu8(load(above + x), load(below + x)));
        const __m128i lower = _mm_cmpeq_epi8(_mm_subs_epu8(centre, greatest), zero);
        std::uint32_t lanes = ~static_cast<std::uint32_t>(_mm_movemask_epi8(lower)) & 0xffffu;
        if (x_end - x < 16) lanes &= (1u << (x_end - x)) - 1;
        for (; lanes != 0; lanes &= lanes - 1)
            out[count++] = static_cast<std::uint16_t>(x + static_cast<std::uint32_t>(__builtin_ctz(lanes)));
    }
    return count;
}

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

void blur_row(const std::uint8_t* const rows[7], std::uint32_t width, std::uint8_t* scratch,
              std::uint8_t* out) noexcept {
    for (std::uint32_t x = 0; x < width; x += 16) {
        store(scratch + x, seven_taps(load(rows[0] + x), load(rows[1] + x), load(rows[2] + x), load(rows[3] + x),
                                      load(rows[4] + x), load(rows[5] + x), load(rows[6] + x)));
    }
    for (std::uint32_t i = 1; i <= kBlurRadius; ++i) {
        scratch[-static_cast<std::ptrdiff_t>(i)] = scratch[i];
        scratch[width - 1 + i] = scratch[width - 1 - i];
    }
    for (std::uint32_t x = 0; x < width; x += 16) {
        const std::uint8_t* const c = scratch + x;
        store(out + x,
              seven_taps(load(c - 3), load(c - 2), load(c - 1), load(c), load(c + 1), load(c + 2), load(c + 3)));
    }
}

// Weights of the 31 columns of a row of the disc (0 outside of it), and which of them are inside, for |v| = 0..15.
struct Disc {
    alignas(16) std::int16_t across[kPatchRadius + 1][32] = {};
    alignas(16) std::uint8_t inside[kPatchRadius + 1][32] = {};
    constexpr Disc() noexcept {
        for (std::int32_t v = 0; v <= kPatchRadius; ++v) {
            for (std::int32_t u = -kPatchRadius; u <= kPatchRadius; ++u) {
                if (u * u + v * v > kPatchRadius * kPatchRadius + kPatchRadius) continue;
                across[v][u + kPatchRadius] = static_cast<std::int16_t>(u);
                inside[v][u + kPatchRadius] = 255;
            }
        }
    }
};
constexpr Disc kDisc;

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
    x = _mm_add_epi32(x, _mm_shuffle_epi32(x, 0x4e));
    x = _mm_add_epi32(x, _mm_shuffle_epi32(x, 0xb1));
    y = _mm_add_epi64(y, _mm_shuffle_epi32(y, 0x4e));
    return {_mm_cvtsi128_si32(x), _mm_cvtsi128_si32(y)};
}

// Bits of the bytes by halves, then the bytes summed.
__m128i bit_counts(__m128i v) noexcept {
    v = _mm_sub_epi8(v, _mm_and_si128(_mm_srli_epi16(v, 1), bytes(0x55)));
    v = _mm_add_epi8(_mm_and_si128(v, bytes(0x33)), _mm_and_si128(_mm_srli_epi16(v, 2), bytes(0x33)));
    return _mm_and_si128(_mm_add_epi8(v, _mm_srli_epi16(v, 4)), bytes(0x0f));
}

// Eight columns at once, of which the last is left out: vertical sums and differences of three rows, then across by
// shifting lanes. |gradient| <= 1020, a pair of products < 2^22, seven rows < 2^25.
inline __attribute__((always_inline)) Tensor tensor(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    const __m128i zero = _mm_setzero_si128();
    const __m128i seven = _mm_setr_epi16(-1, -1, -1, -1, -1, -1, -1, 0);
    const std::uint8_t* from = centre - 4 * stride - 4;
    const auto bytes16 = [](const std::uint8_t* p) noexcept {
        return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
    };
    __m128i above = bytes16(from);
    __m128i middle = bytes16(from + stride);
    from += 2 * stride;
    __m128i above0 = _mm_unpacklo_epi8(above, zero);
    __m128i above1 = _mm_unpackhi_epi8(above, zero);
    __m128i middle0 = _mm_unpacklo_epi8(middle, zero);
    __m128i middle1 = _mm_unpackhi_epi8(middle, zero);
    __m128i xx = zero;
    __m128i xy = zero;
    __m128i yy = zero;
    for (std::int32_t v = 0; v < 7; ++v, from += stride) {
        const __m128i below = bytes16(from);
        const __m128i below0 = _mm_unpacklo_epi8(below, zero);
        const __m128i below1 = _mm_unpackhi_epi8(below, zero);
        // Columns -4..3 and 4..11 of the smoothed and of the differenced rows.
        const __m128i sum0 = _mm_add_epi16(_mm_add_epi16(above0, below0), _mm_add_epi16(middle0, middle0));
        const __m128i sum1 = _mm_add_epi16(_mm_add_epi16(above1, below1), _mm_add_epi16(middle1, middle1));
        const __m128i difference0 = _mm_sub_epi16(below0, above0);
        const __m128i difference1 = _mm_sub_epi16(below1, above1);
        const __m128i sum_right = _mm_or_si128(_mm_srli_si128(sum0, 4), _mm_slli_si128(sum1, 12));
        const __m128i difference_here = _mm_or_si128(_mm_srli_si128(difference0, 2), _mm_slli_si128(difference1, 14));
        const __m128i difference_right = _mm_or_si128(_mm_srli_si128(difference0, 4), _mm_slli_si128(difference1, 12));
        const __m128i dx = _mm_and_si128(_mm_sub_epi16(sum_right, sum0), seven);
        const __m128i dy = _mm_and_si128(_mm_add_epi16(_mm_add_epi16(difference0, difference_right),
                                                       _mm_add_epi16(difference_here, difference_here)),
                                         seven);
        xx = _mm_add_epi32(xx, _mm_madd_epi16(dx, dx));
        xy = _mm_add_epi32(xy, _mm_madd_epi16(dx, dy));
        yy = _mm_add_epi32(yy, _mm_madd_epi16(dy, dy));
        above0 = middle0;
        above1 = middle1;
        middle0 = below0;
        middle1 = below1;
    }
    const auto total = [](__m128i sum) noexcept {
        sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4e));
        return _mm_cvtsi128_si32(_mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xb1)));
    };
    return {total(xx), total(xy), total(yy)};
}

void tensors(const std::uint8_t* image, std::ptrdiff_t stride, const std::uint32_t* places, std::uint32_t count,
             Tensor* tensors) noexcept {
    for (std::uint32_t i = 0; i < count; ++i)
        tensors[i] =
            tensor(image + static_cast<std::ptrdiff_t>(places[i] >> 16) * stride + (places[i] & 0xffff), stride);
}

std::uint32_t hamming(const std::uint64_t a[4], const std::uint64_t b[4]) noexcept {
    const __m128i* const p = reinterpret_cast<const __m128i*>(a);
    const __m128i* const q = reinterpret_cast<const __m128i*>(b);
    const __m128i low = bit_counts(_mm_xor_si128(_mm_loadu_si128(p), _mm_loadu_si128(q)));
    const __m128i high = bit_counts(_mm_xor_si128(_mm_loadu_si128(p + 1), _mm_loadu_si128(q + 1)));
    __m128i sum = _mm_sad_epu8(_mm_add_epi8(low, high), _mm_setzero_si128());
    sum = _mm_add_epi64(sum, _mm_shuffle_epi32(sum, 0x4e));
    return static_cast<std::uint32_t>(_mm_cvtsi128_si32(sum));
}

void hamming_many(const std::uint64_t a[4], const std::uint64_t* many, std::uint32_t count,
                  std::uint16_t* distances) noexcept {
    for (std::uint32_t i = 0; i < count; ++i) distances[i] = static_cast<std::uint16_t>(hamming(a, many + 4 * i));
}

constexpr Kernels kSse2 = {
    "sse2",  plain_grey_from_rgb, plain_grey_from_bgr, scale_row, fast_row, local_maxima, blur_row, moments, tensors,
    hamming, hamming_many};

}  // namespace

const Kernels* sse2_kernels() noexcept {
    return &kSse2;
}

}  // namespace stillmesh

#else

namespace stillmesh {
const Kernels* sse2_kernels() noexcept {
    return nullptr;
}
}  // namespace stillmesh

#endif
