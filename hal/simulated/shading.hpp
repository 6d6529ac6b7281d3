// The grey of a face's pixels: shared by the renderers, and compiled into each of their loops. Single precision in
// source order.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "hal/simulated/renderer.hpp"

namespace stillmesh::simulated {

// Pixels x to end of a row, of one face.
struct Run {
    std::uint32_t x, end;
    float y;  // for the face's planes
};

// Adds the grey of the run to `out`; `depth` (inverse) and `out` are the row's. No face: what is seen of nothing.
inline void shade_run(const VisibleFace* seen, const Run& run, float level_offset, const float* depth, float* out) {
    constexpr float kNothing = 20.0F;  // grey where no face is
    // 4^offset by a parabola, exact at 0, 1/2 and 1.
    const float level_factor = 1.0F + level_offset * (1.0F + 2.0F * level_offset);
    std::uint32_t x = run.x;
    if (seen == nullptr) {
        for (; x < run.end; ++x) out[x] += kNothing;
        return;
    }
    const VisibleFace& face = *seen;
    const Texture& texture = *face.material.texture;
    const float footprint = face.footprint * level_factor;
    const float u0 = face.u.b * run.y + face.u.c;
    const float v0 = face.v.b * run.y + face.v.c;
    const float l0 = face.light.b * run.y + face.light.c;
    const auto level_max = static_cast<std::int32_t>(texture.level_count) - 1;
    for (; x < run.end; ++x) {
        const auto fx = static_cast<float>(x);
        const float z = 1.0F / depth[x];
        const float area = footprint * (z * z * z);
        // Half the exponent of the area is the whole part of the level.
        const std::int32_t exponent = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(area) >> 23U) - 127;
        const std::int32_t level = std::clamp(exponent >> 1, 0, level_max);
        const MipLevel& mip = texture.levels[level];
        const float scale = 256.0F * mip.scale;
        // Rounding can push a face's last pixel beyond the face, never far: the clamp keeps the cast defined.
        const float u = std::clamp((u0 + face.u.a * fx) * z * scale, -4.0e6F, 4.0e6F);
        const float v = std::clamp((v0 + face.v.a * fx) * z * scale, -4.0e6F, 4.0e6F);
        const std::int32_t iu = static_cast<std::int32_t>(u + 8388608.0F) - 8388608 - 128;
        const std::int32_t iv = static_cast<std::int32_t>(v + 8388608.0F) - 8388608 - 128;
        const std::int32_t x0 = (iu >> 8) & mip.width_mask;
        const std::int32_t x1 = (x0 + 1) & mip.width_mask;
        const std::int32_t y0 = ((iv >> 8) & mip.height_mask) * mip.width;
        const std::int32_t y1 = (((iv >> 8) + 1) & mip.height_mask) * mip.width;
        const std::int32_t wx = iu & 255;
        const std::int32_t wy = iv & 255;
        const std::uint8_t* const texels = mip.pixels;
        const std::int32_t upper = texels[y0 + x0] * (256 - wx) + texels[y0 + x1] * wx;
        const std::int32_t lower = texels[y1 + x0] * (256 - wx) + texels[y1 + x1] * wx;
        const std::int32_t grey = upper * (256 - wy) + lower * wy;
        const float light = (l0 + face.light.a * fx) * z;
        out[x] += static_cast<float>(grey) * (1.0F / 65536.0F) * light;
    }
}

// visit(id, x, end) for each run of one face in a row of ids.
template <typename Visit>
void visit_runs(const std::uint32_t* ids, std::uint32_t width, Visit&& visit) {
    for (std::uint32_t x = 0; x < width;) {
        std::uint32_t end = x + 1;
        while (end < width && ids[end] == ids[x]) ++end;
        visit(ids[x], x, end);
        x = end;
    }
}

}  // namespace stillmesh::simulated
