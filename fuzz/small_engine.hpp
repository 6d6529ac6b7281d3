// What the targets around an engine share: limits at which a frame costs a fraction of a millisecond even under
// sanitizers, a block of exactly the needed size that lives as long as the program, and a map as its file.
// Not Limits::tiny(): its pictures have four times the pixels, and a fuzzer's worth is how many inputs it tries.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <vector>

#include "engine/base/arena.hpp"
#include "engine/engine.hpp"
#include "fuzz/fuzz.hpp"

namespace stillmesh::fuzz {

// Pictures of 80x64 px have 48x32 in which corners may lie; full pools happen within eight frames.
inline constexpr Limits kSmallLimits = {80, 64, 2, 60, 4, 120, 12, 90, 230, 60, 3};

// One byte too many is seen.
class Block {
public:
    explicit Block(std::size_t bytes)
        : bytes_(bytes), block_(new (std::align_val_t(kArenaAlignment)) std::byte[bytes]) {}
    [[nodiscard]] std::span<std::byte> span() const { return {block_.get(), bytes_}; }
    // With `garbage` in each byte, whatever was there before: an input does the same every time.
    [[nodiscard]] std::span<std::byte> filled(int garbage) const {
        std::memset(block_.get(), garbage, bytes_);
        return span();
    }

private:
    struct Free {
        void operator()(std::byte* block) const { ::operator delete[](block, std::align_val_t(kArenaAlignment)); }
    };
    std::size_t bytes_;
    std::unique_ptr<std::byte[], Free> block_;
};

inline Configuration small_configuration() {
    Configuration configuration;
    configuration.features.count = kSmallLimits.features_max;
    configuration.features.levels = kSmallLimits.pyramid_levels_max;
    configuration.mapping.window_keyframes = kSmallLimits.keyframes_max;
    return configuration;
}

inline CameraModel small_camera() {
    CameraModel camera;
    camera.width = kSmallLimits.image_width_max;
    camera.height = kSmallLimits.image_height_max;
    camera.fx = camera.fy = 65;
    camera.cx = 0.5 * camera.width - 0.5;
    camera.cy = 0.5 * camera.height - 0.5;
    return camera;
}

// The engine's map as a file; empty: there is none.
inline std::vector<std::byte> map_of(Engine& engine) {
    static const Block block(map_copy_bytes(kSmallLimits));
    std::vector<std::byte> out;
    if (engine.begin_map_copy(block.span()) == Status::kNotFound) return out;
    while (engine.step_map_copy(100) == Progress::kWorking) {
    }
    MapFileWriter writer(block.span());
    static std::vector<std::byte> piece(4096);
    out.reserve(static_cast<std::size_t>(writer.info().size_bytes));
    while (const std::size_t size = writer.next(piece)) {
        out.insert(out.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(size));
    }
    return out;
}

}  // namespace stillmesh::fuzz
