// Small depth images of at most 80x60 cells: what was seen, for whoever asks where there is floor and where something
// stands. Each hangs on a keyframe and moves with it, so that what is made from them is made anew when the map was
// corrected. There is one of the frame that the keyframe was made of, and while there is room others of later frames
// nearby, which say what has changed there. Which pixels are left out: engine/tracking/still_depth.hpp. Poses,
// decisions and the state hash do not depend on them. Limit: depth_images_max. Full: those of keyframes that are gone
// are used again first; then a keyframe takes the oldest of the later ones, a later one the oldest of its keyframe.
// Memory: 9.5 KiB each, and 38 KiB for the rays of all. Cost: one pass over their owners.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/limits.hpp"
#include "engine/map/map.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kDepthColumnsMax = 80, kDepthRowsMax = 60;
inline constexpr std::uint32_t kDepthCellsMax = kDepthColumnsMax * kDepthRowsMax;

class DepthImages {
public:
    // What an image is of.
    struct Owner {
        Handle<Keyframe> keyframe;  // null: free
        SE3 keyframe_from_camera;
        std::uint64_t frame = 0;
        bool is_later = false;  // than the keyframe, which has another
    };

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        if (limits.depth_images_max == 0) return;
        arena.array<Owner>(limits.depth_images_max);
        arena.array<std::uint16_t>(std::size_t{limits.depth_images_max} * kDepthCellsMax);
        arena.array<float>(std::size_t{2} * kDepthCellsMax);
    }
    void create(Arena& arena, const Limits& limits, const CameraModel& camera) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return !owners_.empty(); }
    // Cells of an image: a cell is a square of cell_px() pixels of the picture, all of them within it.
    [[nodiscard]] std::uint32_t columns() const noexcept { return columns_; }
    [[nodiscard]] std::uint32_t rows() const noexcept { return rows_; }
    [[nodiscard]] std::uint32_t cell_px() const noexcept { return cell_px_; }
    // A new image, to be written row by row, as DepthImage has it. Only while is_on().
    [[nodiscard]] std::span<std::uint16_t> add(const Owner& owner, const Pool<Keyframe>& keyframes) noexcept;
    // Without cells: none has this index, or its keyframe is gone.
    [[nodiscard]] DepthImage at(std::uint32_t index, const Pool<Keyframe>& keyframes) const noexcept;

private:
    [[nodiscard]] std::size_t cells() const noexcept { return std::size_t{columns_} * rows_; }
    [[nodiscard]] std::size_t place_for(const Owner& owner, const Pool<Keyframe>& keyframes) const noexcept;

    std::span<Owner> owners_;
    std::span<std::uint16_t> depth_mm_;  // kDepthCellsMax per image
    std::span<float> rays_;              // x/z and y/z of the middle of each cell
    std::uint32_t columns_ = 0, rows_ = 0, cell_px_ = 1;
};

}  // namespace stillmesh
