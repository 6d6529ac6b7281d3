// What every arm64 has, and most armhf boards: there it is compiled with -mfpu=neon, and so nothing here may be an
// inline function or a template that another translation unit could share (kernels.hpp). Integers only: NEON's float
// sums have another order, and on armv7 it flushes denormals.
#include "engine/frame/kernels.hpp"

#if defined(__ARM_NEON)

#include <arm_neon.h>

namespace stillmesh {
namespace {

// (low + 2^(shift - 1)) / 2^shift of sixteen sums that lie in two halves.
#define STILLMESH_ROUNDED_BYTES(low, high, shift) vcombine_u8(vrshrn_n_u16(low, shift), vrshrn_n_u16(high, shift))

bool is_any_set(uint8x16_t v) noexcept {
#if defined(__aarch64__)
    return vmaxvq_u8(v) != 0;
#else
    const uint64x1_t half = vreinterpret_u64_u8(vorr_u8(vget_low_u8(v), vget_high_u8(v)));
    return vget_lane_u64(half, 0) != 0;
#endif
}

uint8x16_t first_lanes(std::uint32_t count) noexcept {
    static const std::uint8_t kIndex[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return vcltq_u8(vld1q_u8(kIndex), vdupq_n_u8(static_cast<std::uint8_t>(count)));
}

// Sixteen pixels: the load takes the colours apart.
template <bool kIsRgb>
void grey_row(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept {
    const uint8x8_t weight_first = vdup_n_u8(kIsRgb ? 77 : 29);
    const uint8x8_t weight_second = vdup_n_u8(150);
    const uint8x8_t weight_third = vdup_n_u8(kIsRgb ? 29 : 77);
    std::uint32_t x = 0;
    for (; x + 16 <= width; x += 16) {
        const uint8x16x3_t colours = vld3q_u8(pixels + 3 * x);
        uint16x8_t low = vmull_u8(vget_low_u8(colours.val[0]), weight_first);
        uint16x8_t high = vmull_u8(vget_high_u8(colours.val[0]), weight_first);
        low = vmlal_u8(low, vget_low_u8(colours.val[1]), weight_second);
        high = vmlal_u8(high, vget_high_u8(colours.val[1]), weight_second);
        low = vmlal_u8(low, vget_low_u8(colours.val[2]), weight_third);
        high = vmlal_u8(high, vget_high_u8(colours.val[2]), weight_third);
        vst1q_u8(grey + x, STILLMESH_ROUNDED_BYTES(low, high, 8));
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
    const uint8x8_t weight_a = vdup_n_u8(static_cast<std::uint8_t>(128 - weight_below));
    const uint8x8_t weight_b = vdup_n_u8(weight_below);
    for (std::uint32_t x = 0; x < source_width; x += 16) {
        const uint8x16_t a = vld1q_u8(above + x);
        const uint8x16_t b = vld1q_u8(below + x);
        const uint16x8_t low = vmlal_u8(vmull_u8(vget_low_u8(a), weight_a), vget_low_u8(b), weight_b);
        const uint16x8_t high = vmlal_u8(vmull_u8(vget_high_u8(a), weight_a), vget_high_u8(b), weight_b);
        vst1q_u8(scratch + x, STILLMESH_ROUNDED_BYTES(low, high, 7));
    }
    for (std::uint32_t x = 0; x < width; x += kScaleBlock, ++blocks) {
        const uint8x16_t source = vld1q_u8(scratch + blocks->first);
        const uint8x16_t weights = vld1q_u8(blocks->weights);
#if defined(__aarch64__)
        const uint8x16_t pairs = vqtbl1q_u8(source, vld1q_u8(blocks->picks));
        const uint16x8_t low = vmull_u8(vget_low_u8(pairs), vget_low_u8(weights));
        const uint16x8_t sums = vpaddq_u16(low, vmull_u8(vget_high_u8(pairs), vget_high_u8(weights)));
#else
        const uint8x8x2_t table = {{vget_low_u8(source), vget_high_u8(source)}};
        const uint16x8_t low = vmull_u8(vtbl2_u8(table, vld1_u8(blocks->picks)), vget_low_u8(weights));
        const uint16x8_t high = vmull_u8(vtbl2_u8(table, vld1_u8(blocks->picks + 8)), vget_high_u8(weights));
        const uint16x8_t sums = vcombine_u16(vpadd_u16(vget_low_u16(low), vget_high_u16(low)),
                                             vpadd_u16(vget_low_u16(high), vget_high_u16(high)));
#endif
        vst1_u8(out + x, vrshrn_n_u16(sums, 7));
    }
}

using Lanes = uint8x16_t;
constexpr std::uint32_t kLanes = 16;

Lanes load(const std::uint8_t* p) noexcept {
    return vld1q_u8(p);
}
void store(std::uint8_t* p, Lanes v) noexcept {
    vst1q_u8(p, v);
}
Lanes bytes(std::uint8_t value) noexcept {
    return vdupq_n_u8(value);
}
Lanes least(Lanes a, Lanes b) noexcept {
    return vminq_u8(a, b);
}
Lanes greatest(Lanes a, Lanes b) noexcept {
    return vmaxq_u8(a, b);
}
Lanes plus(Lanes a, Lanes b) noexcept {
    return vqaddq_u8(a, b);
}
Lanes minus(Lanes a, Lanes b) noexcept {
    return vqsubq_u8(a, b);
}
bool is_any_above(Lanes a, Lanes b, Lanes c, Lanes d) noexcept {
    return is_any_set(vorrq_u8(vcgtq_u8(a, b), vcgtq_u8(c, d)));
}
Lanes where_above(Lanes a, Lanes b) noexcept {
    return vandq_u8(a, vcgtq_u8(a, b));
}

// Writes the places of the lanes of one half: one nibble a lane.
std::uint32_t write_places_of_half(std::uint32_t nibbles, std::uint32_t x, std::uint16_t* out) noexcept {
    std::uint32_t count = 0;
    for (nibbles &= 0x11111111u; nibbles != 0; nibbles &= nibbles - 1)
        out[count++] = static_cast<std::uint16_t>(x + static_cast<std::uint32_t>(__builtin_ctz(nibbles)) / 4);
    return count;
}
std::uint32_t write_places(Lanes v, std::uint32_t x, std::uint16_t* out) noexcept {
    // NEON has no movemask: four bits of each lane.
    const uint8x16_t set = vtstq_u8(v, v);
    const uint32x2_t nibbles = vreinterpret_u32_u8(vshrn_n_u16(vreinterpretq_u16_u8(set), 4));
    const std::uint32_t count = write_places_of_half(vget_lane_u32(nibbles, 0), x, out);
    return count + write_places_of_half(vget_lane_u32(nibbles, 1), x + 8, out + count);
}

// The seven taps of the blur on 8 pixels; t3 is the middle. The sum stays below 2^16.
inline __attribute__((always_inline)) uint16x8_t weigh(uint8x8_t t0, uint8x8_t t1, uint8x8_t t2, uint8x8_t t3,
                                                       uint8x8_t t4, uint8x8_t t5, uint8x8_t t6) noexcept {
    uint16x8_t sum = vmull_u8(t3, vdup_n_u8(56));
    sum = vmlaq_n_u16(sum, vaddl_u8(t2, t4), 49);
    sum = vmlaq_n_u16(sum, vaddl_u8(t1, t5), 33);
    return vmlaq_n_u16(sum, vaddl_u8(t0, t6), 18);
}

inline __attribute__((always_inline)) uint8x16_t seven_taps(uint8x16_t t0, uint8x16_t t1, uint8x16_t t2, uint8x16_t t3,
                                                            uint8x16_t t4, uint8x16_t t5, uint8x16_t t6) noexcept {
    const uint16x8_t low = weigh(vget_low_u8(t0), vget_low_u8(t1), vget_low_u8(t2), vget_low_u8(t3), vget_low_u8(t4),
                                 vget_low_u8(t5), vget_low_u8(t6));
    const uint16x8_t high = weigh(vget_high_u8(t0), vget_high_u8(t1), vget_high_u8(t2), vget_high_u8(t3),
                                  vget_high_u8(t4), vget_high_u8(t5), vget_high_u8(t6));
    return STILLMESH_ROUNDED_BYTES(low, high, 8);
}

// Bytes 0 to 15 are columns -15 to 0, bytes 16 to 31 are columns 1 to 16.
#include "engine/frame/kernels_disc.inc"
constexpr Disc<std::uint8_t> kDisc;

struct Across {
    uint16x8_t left_low, left_high, right_low, right_high;
};

inline __attribute__((always_inline)) void add_across(Across& sum, uint8x16_t left, uint8x16_t right, uint8x16_t w_left,
                                                      uint8x16_t w_right) noexcept {
    sum.left_low = vmlal_u8(sum.left_low, vget_low_u8(left), vget_low_u8(w_left));
    sum.left_high = vmlal_u8(sum.left_high, vget_high_u8(left), vget_high_u8(w_left));
    sum.right_low = vmlal_u8(sum.right_low, vget_low_u8(right), vget_low_u8(w_right));
    sum.right_high = vmlal_u8(sum.right_high, vget_high_u8(right), vget_high_u8(w_right));
}

std::int32_t total(int32x4_t v) noexcept {
#if defined(__aarch64__)
    return vaddvq_s32(v);
#else
    const int32x2_t pair = vadd_s32(vget_low_s32(v), vget_high_s32(v));
    return vget_lane_s32(vpadd_s32(pair, pair), 0);
#endif
}

// The left and the right half apart, since NEON multiplies bytes of one signedness. A row adds at most 15 * 255 to a
// lane: sixteen rows stay below 2^16. The sum of v * row_sum(v) is built by adding the running sum once per row, from
// the outside in: row v is then counted v times; a row adds at most 4 * 255 to a lane of it.
Moments moments(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    const std::uint8_t* const left = centre - kPatchRadius;
    const uint16x8_t none = vdupq_n_u16(0);
    Across across{none, none, none, none};
    uint32x4_t x_left = vdupq_n_u32(0);
    uint32x4_t x_right = x_left;
    uint16x8_t running_below = none;
    uint16x8_t running_above = none;
    uint32x4_t y_below = x_left;
    uint32x4_t y_above = x_left;
    for (std::int32_t v = kPatchRadius; v >= 1; --v) {
        const std::uint8_t* const below = left + v * stride;
        const std::uint8_t* const above = left - v * stride;
        const uint8x16_t below_left = vld1q_u8(below);
        const uint8x16_t below_right = vld1q_u8(below + 16);
        const uint8x16_t above_left = vld1q_u8(above);
        const uint8x16_t above_right = vld1q_u8(above + 16);
        const uint8x16_t w_left = vld1q_u8(kDisc.across[v]);
        const uint8x16_t w_right = vld1q_u8(kDisc.across[v] + 16);
        add_across(across, below_left, below_right, w_left, w_right);
        add_across(across, above_left, above_right, w_left, w_right);
        if (v == 8) {
            x_left = vpadalq_u16(vpadalq_u16(x_left, across.left_low), across.left_high);
            x_right = vpadalq_u16(vpadalq_u16(x_right, across.right_low), across.right_high);
            across = {none, none, none, none};
        }
        const uint8x16_t in_left = vld1q_u8(kDisc.inside[v]);
        const uint8x16_t in_right = vld1q_u8(kDisc.inside[v] + 16);
        running_below =
            vpadalq_u8(vpadalq_u8(running_below, vandq_u8(below_left, in_left)), vandq_u8(below_right, in_right));
        running_above =
            vpadalq_u8(vpadalq_u8(running_above, vandq_u8(above_left, in_left)), vandq_u8(above_right, in_right));
        y_below = vpadalq_u16(y_below, running_below);
        y_above = vpadalq_u16(y_above, running_above);
    }
    add_across(across, vld1q_u8(left), vld1q_u8(left + 16), vld1q_u8(kDisc.across[0]), vld1q_u8(kDisc.across[0] + 16));
    x_left = vpadalq_u16(vpadalq_u16(x_left, across.left_low), across.left_high);
    x_right = vpadalq_u16(vpadalq_u16(x_right, across.right_low), across.right_high);
    return {total(vreinterpretq_s32_u32(vsubq_u32(x_right, x_left))),
            total(vreinterpretq_s32_u32(vsubq_u32(y_below, y_above)))};
}

// Eight columns of three rows, widened: columns -4..3 and 4..11.
struct Row {
    int16x8_t near, far;
};

inline __attribute__((always_inline)) Row widened(const std::uint8_t* p) noexcept {
    const uint8x16_t bytes = vld1q_u8(p);
    return {vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(bytes))), vreinterpretq_s16_u16(vmovl_u8(vget_high_u8(bytes)))};
}

// Eight columns at once, of which the last is left out: vertical sums and differences of three rows, then across by
// shifting lanes. |gradient| <= 1020, seven rows of products < 2^23 in a lane, all lanes < 2^26.
inline __attribute__((always_inline)) Tensor tensor(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    static const std::int16_t kSeven[8] = {-1, -1, -1, -1, -1, -1, -1, 0};
    const int16x8_t seven = vld1q_s16(kSeven);
    const std::uint8_t* from = centre - 4 * stride - 4;
    Row above = widened(from);
    Row middle = widened(from + stride);
    from += 2 * stride;
    int32x4_t xx = vdupq_n_s32(0);
    int32x4_t xy = xx;
    int32x4_t yy = xx;
    for (std::int32_t v = 0; v < 7; ++v, from += stride) {
        const Row below = widened(from);
        const int16x8_t sum0 = vaddq_s16(vaddq_s16(above.near, below.near), vaddq_s16(middle.near, middle.near));
        const int16x8_t sum1 = vaddq_s16(vaddq_s16(above.far, below.far), vaddq_s16(middle.far, middle.far));
        const int16x8_t difference0 = vsubq_s16(below.near, above.near);
        const int16x8_t difference1 = vsubq_s16(below.far, above.far);
        const int16x8_t difference_here = vextq_s16(difference0, difference1, 1);
        const int16x8_t difference_right = vextq_s16(difference0, difference1, 2);
        const int16x8_t dx = vandq_s16(vsubq_s16(vextq_s16(sum0, sum1, 2), sum0), seven);
        const int16x8_t dy = vandq_s16(
            vaddq_s16(vaddq_s16(difference0, difference_right), vaddq_s16(difference_here, difference_here)), seven);
        xx = vmlal_s16(vmlal_s16(xx, vget_low_s16(dx), vget_low_s16(dx)), vget_high_s16(dx), vget_high_s16(dx));
        xy = vmlal_s16(vmlal_s16(xy, vget_low_s16(dx), vget_low_s16(dy)), vget_high_s16(dx), vget_high_s16(dy));
        yy = vmlal_s16(vmlal_s16(yy, vget_low_s16(dy), vget_low_s16(dy)), vget_high_s16(dy), vget_high_s16(dy));
        above = middle;
        middle = below;
    }
    return {total(xx), total(xy), total(yy)};
}

std::uint32_t hamming(const std::uint64_t a[4], const std::uint64_t b[4]) noexcept {
    const std::uint8_t* const p = reinterpret_cast<const std::uint8_t*>(a);
    const std::uint8_t* const q = reinterpret_cast<const std::uint8_t*>(b);
    const uint8x16_t bits =
        vaddq_u8(vcntq_u8(veorq_u8(vld1q_u8(p), vld1q_u8(q))), vcntq_u8(veorq_u8(vld1q_u8(p + 16), vld1q_u8(q + 16))));
#if defined(__aarch64__)
    return vaddlvq_u8(bits);
#else
    const uint64x2_t sums = vpaddlq_u32(vpaddlq_u16(vpaddlq_u8(bits)));
    return vgetq_lane_u32(vreinterpretq_u32_u64(sums), 0) + vgetq_lane_u32(vreinterpretq_u32_u64(sums), 2);
#endif
}

#include "engine/frame/kernels_lanes.inc"

constexpr Kernels kNeon = {"neon",   grey_row<true>, grey_row<false>, scale_row, fast_row,    local_maxima,
                           blur_row, moments,        tensors,         hamming,   hamming_many};

}  // namespace
}  // namespace stillmesh

#endif

const stillmesh::Kernels* stillmesh::neon_kernels() noexcept {
#if defined(__ARM_NEON)
    return &kNeon;
#else
    return nullptr;
#endif
}
