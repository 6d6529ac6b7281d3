#include "hal/simulated/shading.hpp"

#include <algorithm>
#include <bit>

#include "hal/for_each_processor.hpp"

namespace stillmesh::simulated {
namespace {

constexpr float kNothing = 20.0F;  // grey where no face is
constexpr std::uint32_t kBlock = 64;

// Where the pixels of a block lie on the texture.
struct Block {
    std::int32_t level[kBlock];
    std::int32_t u[kBlock], v[kBlock];  // of texels of the level, in 256ths
    float light[kBlock];
};

// A face's planes along one row.
struct Line {
    float u, v, light;     // at x = 0
    float du, dv, dlight;  // per pixel
    float footprint = 0;
    std::int32_t level_max = 0;
};

// In loops that gain from vectors; what follows looks texels up, one by one.
inline void place(const Line& line, std::uint32_t x, std::uint32_t count, const float* __restrict depth,
                  Block& __restrict block) {
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto fx = static_cast<float>(static_cast<std::int32_t>(x + i));
        const float z = 1.0F / depth[i];
        const float area = line.footprint * (z * z * z);
        // Half the exponent of the area is the whole part of the level.
        const std::int32_t exponent = (std::bit_cast<std::int32_t>(area) >> 23) - 127;
        const std::int32_t level = std::clamp(exponent >> 1, 0, line.level_max);
        // 256 texels' parts, halved from level to level: a power of two.
        const auto scale = std::bit_cast<float>((127 + 8 - level) << 23);
        // Rounding can push a face's last pixel beyond the face, never far: the clamp keeps the cast defined.
        const float u = std::clamp((line.u + line.du * fx) * z * scale, -4.0e6F, 4.0e6F);
        const float v = std::clamp((line.v + line.dv * fx) * z * scale, -4.0e6F, 4.0e6F);
        block.level[i] = level;
        block.u[i] = static_cast<std::int32_t>(u + 8388608.0F) - 8388608 - 128;
        block.v[i] = static_cast<std::int32_t>(v + 8388608.0F) - 8388608 - 128;
        block.light[i] = (line.light + line.dlight * fx) * z;
    }
}

// Bilinear, in 65536ths.
inline std::int32_t grey_at(const MipLevel& mip, std::int32_t u, std::int32_t v) {
    const std::int32_t x0 = (u >> 8) & mip.width_mask;
    const std::int32_t x1 = (x0 + 1) & mip.width_mask;
    const std::uint8_t* const above = mip.pixels + ((v >> 8) & mip.height_mask) * mip.width;
    const std::uint8_t* const below = mip.pixels + (((v >> 8) + 1) & mip.height_mask) * mip.width;
    const std::int32_t wx = u & 255;
    const std::int32_t wy = v & 255;
    const std::int32_t upper = above[x0] * (256 - wx) + above[x1] * wx;
    const std::int32_t lower = below[x0] * (256 - wx) + below[x1] * wx;
    return upper * (256 - wy) + lower * wy;
}

}  // namespace

STILLMESH_FOR_EACH_PROCESSOR void shade_run(const VisibleFace* seen, const Run& run, float level_offset,
                                            const float* depth, float* out) {
    if (seen == nullptr) {
        for (std::uint32_t x = run.x; x < run.end; ++x) out[x] += kNothing;
        return;
    }
    const VisibleFace& face = *seen;
    const Texture& texture = *face.material.texture;
    // 4^offset by a parabola, exact at 0, 1/2 and 1.
    const float level_factor = 1.0F + level_offset * (1.0F + 2.0F * level_offset);
    const Line line{face.u.b * run.y + face.u.c,
                    face.v.b * run.y + face.v.c,
                    face.light.b * run.y + face.light.c,
                    face.u.a,
                    face.v.a,
                    face.light.a,
                    face.footprint * level_factor,
                    static_cast<std::int32_t>(texture.level_count) - 1};
    Block block;
    for (std::uint32_t x = run.x; x < run.end; x += kBlock) {
        const std::uint32_t count = std::min(kBlock, run.end - x);
        place(line, x, count, depth + x, block);
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::int32_t grey = grey_at(texture.levels[block.level[i]], block.u[i], block.v[i]);
            out[x + i] += static_cast<float>(grey) * (1.0F / 65536.0F) * block.light[i];
        }
    }
}

}  // namespace stillmesh::simulated
