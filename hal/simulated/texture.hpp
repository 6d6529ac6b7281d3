// Grey textures with mipmaps, painted from a seed: what things in the simulated office look like. Sizes are powers of
// two, so that coordinates wrap by a mask. Cost: some 2 ms each to paint, 4/3 bytes per pixel.
#pragma once

#include <cstdint>
#include <vector>

namespace stillmesh::simulated {

inline constexpr std::uint32_t kMipLevelsMax = 10;

struct MipLevel {
    const std::uint8_t* pixels = nullptr;
    std::int32_t width = 0;       // a power of two
    std::int32_t width_mask = 0;  // width - 1
    std::int32_t height_mask = 0;
    float scale = 1.0F;  // texels of this level per texel of level 0
};

struct Texture {
    std::vector<std::uint8_t> pixels;  // all levels, the largest first
    MipLevel levels[kMipLevelsMax];
    std::uint32_t level_count = 0;
    float width = 0, height = 0;  // texels of level 0
};

enum class Pattern : std::uint8_t {
    kPlainWall,  // paint: a faint roller pattern and next to nothing for corners
    kCarpet,
    kCeiling,  // panels with joints
    kWood,
    kPoster,    // shapes, a picture and lines of print
    kPinboard,  // notes of all sizes
    kBooks,     // one row of book spines
    kKeyboard,
    kScreen,  // windows with lines of text
    kPaper,   // a printed page
    kMetal,   // cabinet fronts with handles
    kDoor,
    kCloth,  // one of several weaves: checks, stripes, dots, prints
    kTrousers,
    kSkin,
    kFace,    // wrapped round a head: hair, eyes, mouth
    kParcel,  // cardboard with labels and tape
    kDark,    // plastic, rubber
};

[[nodiscard]] Texture paint(Pattern pattern, std::uint64_t seed);

}  // namespace stillmesh::simulated
