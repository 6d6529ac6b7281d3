#include <bit>

#include "engine/frame/kernels.hpp"

namespace stillmesh {
namespace {

template <std::uint32_t kRed, std::uint32_t kBlue>
void grey_row(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept {
    for (std::uint32_t x = 0; x < width; ++x, pixels += 3) {
        const std::uint32_t sum = 77u * pixels[kRed] + 150u * pixels[1] + 29u * pixels[kBlue] + 128u;
        grey[x] = static_cast<std::uint8_t>(sum >> 8);
    }
}

void scale_row(const std::uint8_t* above, const std::uint8_t* below, std::uint32_t source_width,
               std::uint8_t weight_below, const ScaleBlock* blocks, std::uint32_t width, std::uint8_t* scratch,
               std::uint8_t* out) noexcept {
    const std::uint32_t weight_above = 128u - weight_below;
    for (std::uint32_t x = 0; x < source_width; ++x)
        scratch[x] = static_cast<std::uint8_t>((weight_above * above[x] + weight_below * below[x] + 64u) >> 7);
    for (std::uint32_t x = 0; x < width; ++x) {
        const ScaleBlock& block = blocks[x / kScaleBlock];
        const std::uint32_t i = 2 * (x % kScaleBlock);
        const std::uint8_t* const from = scratch + block.first;
        const std::uint32_t sum = static_cast<std::uint32_t>(block.weights[i]) * from[block.picks[i]] +
                                  static_cast<std::uint32_t>(block.weights[i + 1]) * from[block.picks[i + 1]];
        out[x] = static_cast<std::uint8_t>((sum + 64u) >> 7);
    }
}

// Bresenham's circle of radius 3, clockwise from the top.
constexpr std::int32_t kCircle[16][2] = {{0, -3}, {1, -3}, {2, -2}, {3, -1}, {3, 0},  {3, 1},   {2, 2},   {1, 3},
                                         {0, 3},  {-1, 3}, {-2, 2}, {-3, 1}, {-3, 0}, {-3, -1}, {-2, -2}, {-1, -3}};

constexpr std::int32_t minimum(std::int32_t a, std::int32_t b) noexcept {
    return a < b ? a : b;
}
constexpr std::int32_t maximum(std::int32_t a, std::int32_t b) noexcept {
    return a > b ? a : b;
}

// The definition: nine neighbours on the circle all brighter, or all darker, than the centre by more than t. The
// largest t + 1 that holds is the best arc's least difference.
std::uint8_t fast_strength(const std::uint8_t* centre, const std::ptrdiff_t offsets[16]) noexcept {
    std::int32_t difference[16];
    for (std::uint32_t i = 0; i < 16; ++i) difference[i] = static_cast<std::int32_t>(centre[offsets[i]]) - *centre;
    std::int32_t best = 0;
    for (std::uint32_t start = 0; start < 16; ++start) {
        std::int32_t least = difference[start];
        std::int32_t greatest = difference[start];
        for (std::uint32_t i = 1; i < 9; ++i) {
            least = minimum(least, difference[(start + i) % 16]);
            greatest = maximum(greatest, difference[(start + i) % 16]);
        }
        best = maximum(best, maximum(least, -greatest));
    }
    return static_cast<std::uint8_t>(best);
}

bool fast_row(const std::uint8_t* row, std::ptrdiff_t stride, std::uint32_t x_begin, std::uint32_t x_end,
              std::uint8_t threshold, std::uint8_t* strengths) noexcept {
    std::ptrdiff_t offsets[16];
    for (std::uint32_t i = 0; i < 16; ++i) offsets[i] = kCircle[i][1] * stride + kCircle[i][0];
    bool any = false;
    for (std::uint32_t x = x_begin; x < x_end; ++x) {
        strengths[x] = 0;
        const std::uint8_t* const centre = row + x;
        // An arc of nine holds one of every two opposite pixels.
        const std::int32_t high = *centre + threshold;
        const std::int32_t low = *centre - threshold;
        bool brighter = true;
        bool darker = true;
        for (std::uint32_t i = 0; i < 8 && (brighter || darker); ++i) {
            const std::int32_t a = centre[offsets[i]];
            const std::int32_t b = centre[offsets[i + 8]];
            brighter = brighter && (a > high || b > high);
            darker = darker && (a < low || b < low);
        }
        if (!brighter && !darker) continue;
        const std::uint8_t strength = fast_strength(centre, offsets);
        if (strength <= threshold) continue;
        strengths[x] = strength;
        any = true;
    }
    return any;
}

std::uint32_t local_maxima(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                           std::uint32_t x_begin, std::uint32_t x_end, std::uint16_t* out) noexcept {
    std::uint32_t count = 0;
    for (std::uint32_t x = x_begin; x < x_end; ++x) {
        const std::uint8_t strength = row[x];
        if (strength > row[x - 1] && strength > row[x + 1] && strength > above[x - 1] && strength > above[x] &&
            strength > above[x + 1] && strength > below[x - 1] && strength > below[x] && strength > below[x + 1])
            out[count++] = static_cast<std::uint16_t>(x);
    }
    return count;
}

// Sums to 256, so that the sum of weighted bytes and the rounding stays below 2^16.
constexpr std::uint32_t kBlur[4] = {56, 49, 33, 18};

void blur_row(const std::uint8_t* const rows[7], std::uint32_t width, std::uint8_t* scratch,
              std::uint8_t* out) noexcept {
    const auto at = [](std::uint8_t a, std::uint8_t b) noexcept { return static_cast<std::uint32_t>(a) + b; };
    for (std::uint32_t x = 0; x < width; ++x) {
        const std::uint32_t sum = kBlur[0] * rows[3][x] + kBlur[1] * at(rows[2][x], rows[4][x]) +
                                  kBlur[2] * at(rows[1][x], rows[5][x]) + kBlur[3] * at(rows[0][x], rows[6][x]);
        scratch[x] = static_cast<std::uint8_t>((sum + 128u) >> 8);
    }
    for (std::uint32_t i = 1; i <= kBlurRadius; ++i) {
        scratch[-static_cast<std::ptrdiff_t>(i)] = scratch[i];
        scratch[width - 1 + i] = scratch[width - 1 - i];
    }
    for (std::uint32_t x = 0; x < width; ++x) {
        const std::uint8_t* const c = scratch + x;
        const std::uint32_t sum =
            kBlur[0] * c[0] + kBlur[1] * at(c[-1], c[1]) + kBlur[2] * at(c[-2], c[2]) + kBlur[3] * at(c[-3], c[3]);
        out[x] = static_cast<std::uint8_t>((sum + 128u) >> 8);
    }
}

// The disc's half width in each row: the largest u with u^2 + v^2 <= (R + 1/2)^2, that is < R^2 + R + 1.
struct Disc {
    std::int32_t half_width[kPatchRadius + 1] = {};
    constexpr Disc() noexcept {
        for (std::int32_t v = 0; v <= kPatchRadius; ++v) {
            std::int32_t u = 0;
            while (u < kPatchRadius && (u + 1) * (u + 1) + v * v <= kPatchRadius * kPatchRadius + kPatchRadius) ++u;
            half_width[v] = u;
        }
    }
};
constexpr Disc kDisc;

Moments moments(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    Moments result{0, 0};
    for (std::int32_t v = -kPatchRadius; v <= kPatchRadius; ++v) {
        const std::uint8_t* const row = centre + v * stride;
        const std::int32_t half = kDisc.half_width[v < 0 ? -v : v];
        std::int32_t sum = 0;
        for (std::int32_t u = -half; u <= half; ++u) {
            result.x += u * row[u];
            sum += row[u];
        }
        result.y += v * sum;
    }
    return result;
}

Tensor tensor(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept {
    Tensor result{0, 0, 0};
    for (std::ptrdiff_t v = -3; v <= 3; ++v) {
        for (std::ptrdiff_t u = -3; u <= 3; ++u) {
            const std::uint8_t* const p = centre + v * stride + u;
            const std::int32_t right = p[1 - stride] + 2 * p[1] + p[1 + stride];
            const std::int32_t left = p[-1 - stride] + 2 * p[-1] + p[-1 + stride];
            const std::int32_t below = p[stride - 1] + 2 * p[stride] + p[stride + 1];
            const std::int32_t above = p[-stride - 1] + 2 * p[-stride] + p[-stride + 1];
            const std::int32_t dx = right - left;
            const std::int32_t dy = below - above;
            result.xx += dx * dx;
            result.xy += dx * dy;
            result.yy += dy * dy;
        }
    }
    return result;
}

std::uint32_t hamming(const std::uint64_t a[4], const std::uint64_t b[4]) noexcept {
    std::int32_t count = 0;
    for (std::uint32_t i = 0; i < 4; ++i) count += std::popcount(a[i] ^ b[i]);
    return static_cast<std::uint32_t>(count);
}

#include "engine/frame/kernels_many.inc"

constexpr Kernels kPlain = {
    "plain", plain_grey_from_rgb, plain_grey_from_bgr, scale_row, fast_row, local_maxima, blur_row, moments, tensors,
    hamming, hamming_many};

}  // namespace

void plain_grey_from_rgb(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept {
    grey_row<0, 2>(pixels, width, grey);
}

void plain_grey_from_bgr(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept {
    grey_row<2, 0>(pixels, width, grey);
}

const Kernels& plain_kernels() noexcept {
    return kPlain;
}

}  // namespace stillmesh
