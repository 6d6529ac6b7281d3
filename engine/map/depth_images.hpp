// Small depth images of at most 80x60 cells: what was seen, for whoever asks where there is floor and where something
// stands. Each hangs on a keyframe and moves with it, so that what is made from them is made anew when the map was
// corrected. There is one of the frame that the keyframe was made of, and while there is room others of later frames
// nearby, which say what has changed there. Which pixels are left out: engine/tracking/still_depth.hpp. Poses,
// decisions and the state hash do not depend on them. Limit: depth_images_max. Full: those of keyframes that are gone
// are used again first; then a keyframe takes the oldest of the later ones, a later one the oldest of its keyframe.
// Where two maps become one, of the two views that are nearest to each other the one goes that has a third nearest to
// it, so that what either map alone has seen stays. Memory: 9.5 KiB each, and 38 KiB for the rays of all. Cost: one
// pass over their owners; for each that goes of two maps a distance for each pair of them.
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

// Cells of an image: a cell is a square of cell_px pixels of the picture, all of them within it.
struct DepthLayout {
    std::uint32_t columns = 0, rows = 0, cell_px = 1;
};
[[nodiscard]] DepthLayout depth_layout(const CameraModel& camera) noexcept;

class DepthImages {
public:
    // What an image is of.
    struct Owner {
        Handle<Keyframe> keyframe;  // null: free
        SE3 keyframe_from_camera;
        std::uint64_t frame = 0;
        bool is_later = false;  // than the keyframe, which has or had another
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
    [[nodiscard]] std::uint32_t columns() const noexcept { return layout_.columns; }
    [[nodiscard]] std::uint32_t rows() const noexcept { return layout_.rows; }
    [[nodiscard]] std::uint32_t cell_px() const noexcept { return layout_.cell_px; }
    // A new image, to be written row by row, as DepthImage has it. Only while is_on().
    [[nodiscard]] std::span<std::uint16_t> add(const Owner& owner, const Pool<Keyframe>& keyframes) noexcept;
    // As add(), of a map that is joined to this one. Empty: all places are needed more than this one.
    [[nodiscard]] std::span<std::uint16_t> join(const Owner& owner, const Pool<Keyframe>& keyframes) noexcept;
    // Leaves at most so many, those that join() would.
    void thin(std::size_t most, const Pool<Keyframe>& keyframes) noexcept;
    // Without cells: none has this index, or its keyframe is gone.
    [[nodiscard]] DepthImage at(std::uint32_t index, const Pool<Keyframe>& keyframes) const noexcept;

    // --- for a map that is saved or loaded (engine/record)
    // What lies at each index; of a keyframe that is gone: nothing.
    [[nodiscard]] std::span<const Owner> owners() const noexcept { return owners_; }
    [[nodiscard]] std::span<const std::uint16_t> depth_mm(std::uint32_t index) const noexcept {
        return depth_mm_.subspan(std::size_t{index} * kDepthCellsMax, cells());
    }
    [[nodiscard]] std::span<const float> rays() const noexcept { return rays_.first(2 * cells()); }
    // The image at this index, to be written, whatever was there.
    [[nodiscard]] std::span<std::uint16_t> put(std::uint32_t index, const Owner& owner) noexcept;

private:
    [[nodiscard]] std::size_t cells() const noexcept { return std::size_t{layout_.columns} * layout_.rows; }
    [[nodiscard]] std::size_t place_for(const Owner& owner, const Pool<Keyframe>& keyframes) const noexcept;
    // Of all that hang on keyframes, and of `newcomer` (may be null), whose place is owners_.size().
    [[nodiscard]] std::size_t least_needed(const Owner* newcomer, const Pool<Keyframe>& keyframes) const noexcept;

    std::span<Owner> owners_;
    std::span<std::uint16_t> depth_mm_;  // kDepthCellsMax per image
    std::span<float> rays_;              // x/z and y/z of the middle of each cell
    DepthLayout layout_;
};

}  // namespace stillmesh
