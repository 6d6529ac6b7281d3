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

// Sixteen pixels: red, green and blue are picked out of 48 bytes by shuffles, and weighted as 16-bit numbers.
template <bool kIsRgb>
void grey_row(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept {
    constexpr char kNone = -128;
    const __m128i first0 =
        _mm_setr_epi8(0, 3, 6, 9, 12, 15, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone);
    const __m128i first1 =
        _mm_setr_epi8(kNone, kNone, kNone, kNone, kNone, kNone, 2, 5, 8, 11, 14, kNone, kNone, kNone, kNone, kNone);
    const __m128i first2 =
        _mm_setr_epi8(kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 1, 4, 7, 10, 13);
    const __m128i second0 =
        _mm_setr_epi8(1, 4, 7, 10, 13, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone);
    const __m128i second1 =
        _mm_setr_epi8(kNone, kNone, kNone, kNone, kNone, 0, 3, 6, 9, 12, 15, kNone, kNone, kNone, kNone, kNone);
    const __m128i second2 =
        _mm_setr_epi8(kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 2, 5, 8, 11, 14);
    const __m128i third0 =
        _mm_setr_epi8(2, 5, 8, 11, 14, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone);
    const __m128i third1 =
        _mm_setr_epi8(kNone, kNone, kNone, kNone, kNone, 1, 4, 7, 10, 13, kNone, kNone, kNone, kNone, kNone, kNone);
    const __m128i third2 =
        _mm_setr_epi8(kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone, 0, 3, 6, 9, 12, 15);
    const __m256i weight_first = shorts(kIsRgb ? 77 : 29);
    const __m256i weight_third = shorts(kIsRgb ? 29 : 77);
    std::uint32_t x = 0;
    for (; x + 16 <= width; x += 16) {
        const __m128i a = load16(pixels + 3 * x);
        const __m128i b = load16(pixels + 3 * x + 16);
        const __m128i c = load16(pixels + 3 * x + 32);
        const __m128i first = _mm_or_si128(_mm_or_si128(_mm_shuffle_epi8(a, first0), _mm_shuffle_epi8(b, first1)),
                                           _mm_shuffle_epi8(c, first2));
        const __m128i second = _mm_or_si128(_mm_or_si128(_mm_shuffle_epi8(a, second0), _mm_shuffle_epi8(b, second1)),
                                            _mm_shuffle_epi8(c, second2));
        const __m128i third = _mm_or_si128(_mm_or_si128(_mm_shuffle_epi8(a, third0), _mm_shuffle_epi8(b, third1)),
                                           _mm_shuffle_epi8(c, third2));
        __m256i sum = _mm256_mullo_epi16(_mm256_cvtepu8_epi16(first), weight_first);
        sum = _mm256_add_epi16(sum, _mm256_mullo_epi16(_mm256_cvtepu8_epi16(second), shorts(150)));
        sum = _mm256_add_epi16(sum, _mm256_mullo_epi16(_mm256_cvtepu8_epi16(third), weight_third));
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

// The best arcs so far of 32 centres: the greatest of the arcs' least pixels, the least of their greatest.
struct Arcs {
    __m256i bright;
    __m256i dark;
};

// Two more arcs of nine: those that add one of two pixels to the same eight.
inline __attribute__((always_inline)) void add_arcs(Arcs& best, __m256i least8, __m256i greatest8, __m256i before,
                                                    __m256i after) noexcept {
    best.bright = _mm256_max_epu8(best.bright, _mm256_min_epu8(least8, _mm256_max_epu8(before, after)));
    best.dark = _mm256_min_epu8(best.dark, _mm256_max_epu8(greatest8, _mm256_min_epu8(before, after)));
}

// All 32 centres at once. An arc's least brightness decides for bright corners, its greatest for dark ones: with W[j]
// the least of eight pixels from j, arcs j-1 and j give min(W[j], max(p[j-1], p[j+8])), and the best of all sixteen
// arcs, less the centre, is the strength (saturating: no corner is 0). Written out, because a compiler at -O2 keeps
// loops and with them the pixels in memory.
bool fast_row(const std::uint8_t* row, std::ptrdiff_t stride, std::uint32_t x_begin, std::uint32_t x_end,
              std::uint8_t threshold, std::uint8_t* strengths) noexcept {
    const __m256i t = bytes(threshold);
    const __m256i zero = _mm256_setzero_si256();
    __m256i any = zero;
    for (std::uint32_t x = x_begin; x < x_end; x += 32) {
        const std::uint8_t* const row0 = row + x;
        const __m256i centre = load(row0);
        const std::uint8_t* const above3 = row0 - 3 * stride;
        const std::uint8_t* const above2 = row0 - 2 * stride;
        const std::uint8_t* const above1 = row0 - stride;
        const std::uint8_t* const below1 = row0 + stride;
        const std::uint8_t* const below2 = row0 + 2 * stride;
        const std::uint8_t* const below3 = row0 + 3 * stride;
        const __m256i high = _mm256_adds_epu8(centre, t);
        const __m256i low = _mm256_subs_epu8(centre, t);
        // An arc of nine holds one of every two opposite pixels: all such pairs must have a bright (or dark) one.
        const __m256i p0 = load(above3);
        const __m256i p8 = load(below3);
        const __m256i p4 = load(row0 + 3);
        const __m256i p12 = load(row0 - 3);
        __m256i bright = _mm256_min_epu8(_mm256_max_epu8(p0, p8), _mm256_max_epu8(p4, p12));
        __m256i dark = _mm256_max_epu8(_mm256_min_epu8(p0, p8), _mm256_min_epu8(p4, p12));
        __m256i hope = _mm256_or_si256(_mm256_subs_epu8(bright, high), _mm256_subs_epu8(low, dark));
        if (_mm256_movemask_epi8(_mm256_cmpeq_epi8(hope, zero)) == -1) {
            store(strengths + x, zero);
            continue;
        }
        const __m256i p2 = load(above2 + 2);
        const __m256i p10 = load(below2 - 2);
        const __m256i p6 = load(below2 + 2);
        const __m256i p14 = load(above2 - 2);
        bright = _mm256_min_epu8(bright, _mm256_min_epu8(_mm256_max_epu8(p2, p10), _mm256_max_epu8(p6, p14)));
        dark = _mm256_max_epu8(dark, _mm256_max_epu8(_mm256_min_epu8(p2, p10), _mm256_min_epu8(p6, p14)));
        hope = _mm256_or_si256(_mm256_subs_epu8(bright, high), _mm256_subs_epu8(low, dark));
        if (_mm256_movemask_epi8(_mm256_cmpeq_epi8(hope, zero)) == -1) {
            store(strengths + x, zero);
            continue;
        }
        const __m256i p1 = load(above3 + 1);
        const __m256i p3 = load(above1 + 3);
        const __m256i p5 = load(below1 + 3);
        const __m256i p7 = load(below3 + 1);
        const __m256i p9 = load(below3 - 1);
        const __m256i p11 = load(below1 - 3);
        const __m256i p13 = load(above1 - 3);
        const __m256i p15 = load(above3 - 1);
        // Of two, four, then eight pixels from an odd one.
        const __m256i least2_1 = _mm256_min_epu8(p1, p2);
        const __m256i least2_3 = _mm256_min_epu8(p3, p4);
        const __m256i least2_5 = _mm256_min_epu8(p5, p6);
        const __m256i least2_7 = _mm256_min_epu8(p7, p8);
        const __m256i least2_9 = _mm256_min_epu8(p9, p10);
        const __m256i least2_11 = _mm256_min_epu8(p11, p12);
        const __m256i least2_13 = _mm256_min_epu8(p13, p14);
        const __m256i least2_15 = _mm256_min_epu8(p15, p0);
        const __m256i least4_1 = _mm256_min_epu8(least2_1, least2_3);
        const __m256i least4_3 = _mm256_min_epu8(least2_3, least2_5);
        const __m256i least4_5 = _mm256_min_epu8(least2_5, least2_7);
        const __m256i least4_7 = _mm256_min_epu8(least2_7, least2_9);
        const __m256i least4_9 = _mm256_min_epu8(least2_9, least2_11);
        const __m256i least4_11 = _mm256_min_epu8(least2_11, least2_13);
        const __m256i least4_13 = _mm256_min_epu8(least2_13, least2_15);
        const __m256i least4_15 = _mm256_min_epu8(least2_15, least2_1);
        const __m256i greatest2_1 = _mm256_max_epu8(p1, p2);
        const __m256i greatest2_3 = _mm256_max_epu8(p3, p4);
        const __m256i greatest2_5 = _mm256_max_epu8(p5, p6);
        const __m256i greatest2_7 = _mm256_max_epu8(p7, p8);
        const __m256i greatest2_9 = _mm256_max_epu8(p9, p10);
        const __m256i greatest2_11 = _mm256_max_epu8(p11, p12);
        const __m256i greatest2_13 = _mm256_max_epu8(p13, p14);
        const __m256i greatest2_15 = _mm256_max_epu8(p15, p0);
        const __m256i greatest4_1 = _mm256_max_epu8(greatest2_1, greatest2_3);
        const __m256i greatest4_3 = _mm256_max_epu8(greatest2_3, greatest2_5);
        const __m256i greatest4_5 = _mm256_max_epu8(greatest2_5, greatest2_7);
        const __m256i greatest4_7 = _mm256_max_epu8(greatest2_7, greatest2_9);
        const __m256i greatest4_9 = _mm256_max_epu8(greatest2_9, greatest2_11);
        const __m256i greatest4_11 = _mm256_max_epu8(greatest2_11, greatest2_13);
        const __m256i greatest4_13 = _mm256_max_epu8(greatest2_13, greatest2_15);
        const __m256i greatest4_15 = _mm256_max_epu8(greatest2_15, greatest2_1);
        Arcs best{zero, _mm256_cmpeq_epi8(zero, zero)};
        add_arcs(best, _mm256_min_epu8(least4_1, least4_5), _mm256_max_epu8(greatest4_1, greatest4_5), p0, p9);
        add_arcs(best, _mm256_min_epu8(least4_3, least4_7), _mm256_max_epu8(greatest4_3, greatest4_7), p2, p11);
        add_arcs(best, _mm256_min_epu8(least4_5, least4_9), _mm256_max_epu8(greatest4_5, greatest4_9), p4, p13);
        add_arcs(best, _mm256_min_epu8(least4_7, least4_11), _mm256_max_epu8(greatest4_7, greatest4_11), p6, p15);
        add_arcs(best, _mm256_min_epu8(least4_9, least4_13), _mm256_max_epu8(greatest4_9, greatest4_13), p8, p1);
        add_arcs(best, _mm256_min_epu8(least4_11, least4_15), _mm256_max_epu8(greatest4_11, greatest4_15), p10, p3);
        add_arcs(best, _mm256_min_epu8(least4_13, least4_1), _mm256_max_epu8(greatest4_13, greatest4_1), p12, p5);
        add_arcs(best, _mm256_min_epu8(least4_15, least4_3), _mm256_max_epu8(greatest4_15, greatest4_3), p14, p7);
        const __m256i strength =
            _mm256_max_epu8(_mm256_subs_epu8(best.bright, centre), _mm256_subs_epu8(centre, best.dark));
        const __m256i too_weak = _mm256_cmpeq_epi8(_mm256_subs_epu8(strength, t), zero);
        __m256i result = _mm256_andnot_si256(too_weak, strength);
        if (x_end - x < 32) result = _mm256_and_si256(result, first_lanes(x_end - x));
        store(strengths + x, result);
        any = _mm256_or_si256(any, result);
    }
    return _mm256_movemask_epi8(_mm256_cmpeq_epi8(any, zero)) != -1;
}

std::uint32_t local_maxima(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                           std::uint32_t x_begin, std::uint32_t x_end, std::uint16_t* out) noexcept {
    const __m256i zero = _mm256_setzero_si256();
    std::uint32_t count = 0;
    for (std::uint32_t x = x_begin; x < x_end; x += 32) {
        const __m256i centre = load(row + x);
        if (_mm256_movemask_epi8(_mm256_cmpeq_epi8(centre, zero)) == -1) continue;
        __m256i greatest = _mm256_max_epu8(load(row + x - 1), load(row + x + 1));
        greatest = _mm256_max_epu8(greatest, _mm256_max_epu8(load(above + x - 1), load(above + x + 1)));
        greatest = _mm256_max_epu8(greatest, _mm256_max_epu8(load(below + x - 1), load(below + x + 1)));
        greatest = _mm256_max_epu8(greatest, _mm256_max_epu8(load(above + x), load(below + x)));
        const __m256i lower = _mm256_cmpeq_epi8(_mm256_subs_epu8(centre, greatest), zero);
        std::uint32_t lanes = ~static_cast<std::uint32_t>(_mm256_movemask_epi8(lower));
        if (x_end - x < 32) lanes &= (1u << (x_end - x)) - 1;
        for (; lanes != 0; lanes &= lanes - 1)
            out[count++] = static_cast<std::uint16_t>(x + static_cast<std::uint32_t>(__builtin_ctz(lanes)));
    }
    return count;
}

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

void blur_row(const std::uint8_t* const rows[7], std::uint32_t width, std::uint8_t* scratch,
              std::uint8_t* out) noexcept {
    for (std::uint32_t x = 0; x < width; x += 32) {
        store(scratch + x, seven_taps(load(rows[0] + x), load(rows[1] + x), load(rows[2] + x), load(rows[3] + x),
                                      load(rows[4] + x), load(rows[5] + x), load(rows[6] + x)));
    }
    for (std::uint32_t i = 1; i <= kBlurRadius; ++i) {
        scratch[-static_cast<std::ptrdiff_t>(i)] = scratch[i];
        scratch[width - 1 + i] = scratch[width - 1 - i];
    }
    for (std::uint32_t x = 0; x < width; x += 32) {
        const std::uint8_t* const c = scratch + x;
        store(out + x,
              seven_taps(load(c - 3), load(c - 2), load(c - 1), load(c), load(c + 1), load(c + 2), load(c + 3)));
    }
}

// Weights of the 31 columns of a row of the disc (0 outside of it), and which of them are inside, for |v| = 0..15.
struct Disc {
    alignas(32) std::int8_t across[kPatchRadius + 1][32] = {};
    alignas(32) std::uint8_t inside[kPatchRadius + 1][32] = {};
    constexpr Disc() noexcept {
        for (std::int32_t v = 0; v <= kPatchRadius; ++v) {
            for (std::int32_t u = -kPatchRadius; u <= kPatchRadius; ++u) {
                if (u * u + v * v > kPatchRadius * kPatchRadius + kPatchRadius) continue;
                across[v][u + kPatchRadius] = static_cast<std::int8_t>(u);
                inside[v][u + kPatchRadius] = 255;
            }
        }
    }
};
constexpr Disc kDisc;

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
    __m128i x4 = _mm_add_epi32(_mm256_castsi256_si128(x), _mm256_extracti128_si256(x, 1));
    x4 = _mm_add_epi32(x4, _mm_shuffle_epi32(x4, 0x4e));
    x4 = _mm_add_epi32(x4, _mm_shuffle_epi32(x4, 0xb1));
    __m128i y2 = _mm_add_epi64(_mm256_castsi256_si128(y), _mm256_extracti128_si256(y, 1));
    y2 = _mm_add_epi64(y2, _mm_shuffle_epi32(y2, 0x4e));
    return {_mm_cvtsi128_si32(x4), _mm_cvtsi128_si32(y2)};
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
    return static_cast<std::uint32_t>(__builtin_popcountll(a[0] ^ b[0]) + __builtin_popcountll(a[1] ^ b[1]) +
                                      __builtin_popcountll(a[2] ^ b[2]) + __builtin_popcountll(a[3] ^ b[3]));
}

void hamming_many(const std::uint64_t a[4], const std::uint64_t* many, std::uint32_t count,
                  std::uint16_t* distances) noexcept {
    for (std::uint32_t i = 0; i < count; ++i) distances[i] = static_cast<std::uint16_t>(hamming(a, many + 4 * i));
}

constexpr Kernels kAvx2 = {"avx2",   grey_row<true>, grey_row<false>, scale_row, fast_row,    local_maxima,
                           blur_row, moments,        tensors,         hamming,   hamming_many};

}  // namespace

const Kernels* avx2_kernels() noexcept {
    return &kAvx2;
}

}  // namespace stillmesh

#else

namespace stillmesh {
const Kernels* avx2_kernels() noexcept {
    return nullptr;
}
}  // namespace stillmesh

#endif
