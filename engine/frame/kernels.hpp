// The integer kernels of the engine as a table of functions: plain C++, SSE2, AVX2 and NEON give the same bits, and
// `platform` chooses the fastest that the processor has. Only builtin types cross this table and this header has no
// inline function: a translation unit compiled for a newer processor must not emit code that others share (the linker
// keeps one copy, and it might be the one an older processor cannot run).
//
// Every kernel may read, but never use, up to kKernelSlackBytes beyond the end of an input row, and write that many
// beyond the end of an output row; the buffers of the engine are that much longer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/api.hpp"

namespace stillmesh {

inline constexpr std::size_t kKernelSlackBytes = 64;

// The radius of the disc over which a corner's orientation is measured, and of the one its descriptor samples.
inline constexpr std::int32_t kPatchRadius = 15;
// The blur before the descriptor reads 3 pixels to each side.
inline constexpr std::uint32_t kBlurRadius = 3;
// Outputs that one ScaleBlock describes.
inline constexpr std::uint32_t kScaleBlock = 8;

// How eight neighbouring pixels of a smaller level come from one row of the larger one: pixel i is
// (weights[2i] * row[first + picks[2i]] + weights[2i+1] * row[first + picks[2i+1]] + 64) / 128.
struct ScaleBlock {
    std::uint8_t picks[2 * kScaleBlock];
    std::uint8_t weights[2 * kScaleBlock];  // 1..127, a pair sums to 128
    std::uint16_t first;
};

// First moments of the intensities around a corner: the sums of u * I(u, v) and v * I(u, v).
struct Moments {
    std::int32_t x;
    std::int32_t y;
};

// Gradient products summed over the 7x7 pixels around a corner (Sobel's gradients; each sum is below 2^26).
struct Tensor {
    std::int32_t xx;
    std::int32_t xy;
    std::int32_t yy;
};

struct Kernels {
    const char* name;

    // Grey of interleaved 3-byte pixels, BT.601 in integers: (77 R + 150 G + 29 B + 128) / 256.
    void (*grey_from_rgb)(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept;
    void (*grey_from_bgr)(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept;

    // One row of a smaller pyramid level: first the two source rows are blended into `scratch` (source_width bytes and
    // slack), with weight_below / 128 for the lower one (1..127), then `blocks` (width rounded up to eights) pick.
    void (*scale_row)(const std::uint8_t* above, const std::uint8_t* below, std::uint32_t source_width,
                      std::uint8_t weight_below, const ScaleBlock* blocks, std::uint32_t width, std::uint8_t* scratch,
                      std::uint8_t* out) noexcept;

    // Strength of the FAST-9/16 corner at each x of [x_begin, x_end): the smallest threshold at which it is no corner,
    // where that exceeds `threshold`, else 0. (cv::FAST's response is one less.) `row` and `strengths` point to x = 0;
    // the three rows above and below and three columns aside exist. Returns whether any is not 0.
    bool (*fast_row)(const std::uint8_t* row, std::ptrdiff_t stride, std::uint32_t x_begin, std::uint32_t x_end,
                     std::uint8_t threshold, std::uint8_t* strengths) noexcept;

    // Writes, ascending, the x of [x_begin, x_end) whose strength exceeds all eight neighbours'; returns their count.
    // `out` has room for x_end - x_begin and slack.
    std::uint32_t (*local_maxima)(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                                  std::uint32_t x_begin, std::uint32_t x_end, std::uint16_t* out) noexcept;

    // One row of the blur before the descriptor: 7x7, weights (18 33 49 56 49 33 18) / 256 each way (sigma 2), first
    // down, then across with the borders mirrored, rounded to bytes after each. rows[3] is the centre. `scratch` has
    // kKernelSlackBytes before its width bytes and as many after; width >= 4.
    void (*blur_row)(const std::uint8_t* const rows[7], std::uint32_t width, std::uint8_t* scratch,
                     std::uint8_t* out) noexcept;

    // Moments over the disc of kPatchRadius; the square of that radius (and one column more) exists.
    Moments (*moments)(const std::uint8_t* centre, std::ptrdiff_t stride) noexcept;

    // Of `count` pixels, each given as y * 2^16 + x. A square of radius 4 (and 7 columns more) exists around each.
    void (*tensors)(const std::uint8_t* image, std::ptrdiff_t stride, const std::uint32_t* places, std::uint32_t count,
                    Tensor* tensors) noexcept;

    // Number of different bits of two descriptors.
    std::uint32_t (*hamming)(const std::uint64_t a[4], const std::uint64_t b[4]) noexcept;
    // The same from one to many that lie one after the other, 4 words each.
    void (*hamming_many)(const std::uint64_t a[4], const std::uint64_t* many, std::uint32_t count,
                         std::uint16_t* distances) noexcept;
};

[[nodiscard]] STILLMESH_API const Kernels& plain_kernels() noexcept;
// Those of the plain kernels that the others take over where they have nothing faster.
void plain_grey_from_rgb(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept;
void plain_grey_from_bgr(const std::uint8_t* pixels, std::uint32_t width, std::uint8_t* grey) noexcept;
// nullptr where the engine was not built for such a processor. Whether this one can run them is for the caller to ask.
[[nodiscard]] STILLMESH_API const Kernels* sse2_kernels() noexcept;
[[nodiscard]] STILLMESH_API const Kernels* avx2_kernels() noexcept;
[[nodiscard]] STILLMESH_API const Kernels* neon_kernels() noexcept;

}  // namespace stillmesh
