// Floor, grid and cloud of a map as it is when the job begins, in slices between frames: the depth images and where
// they lie are listed once, each slice looks at one of them. One that is gone by then is left out. It reads an engine
// (or a map file) and changes nothing in it. Limits: depth_images_max images. Memory: open() takes it all, no heap
// after that. Cost: a slice is one depth image, some .2 ms (docs/grid.md).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/limits.hpp"
#include "platform/grid/depth_source.hpp"
#include "platform/grid/floor_finder.hpp"
#include "platform/grid/occupancy_grid.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {

// A level frame with the origin and the x of another, as they lie on the floor.
[[nodiscard]] RigidTransform aligned_level(const RigidTransform& level_from_map, const RigidTransform& frame_from_map);

class GridJob {
public:
    // False: no memory; `message` says so.
    [[nodiscard]] bool open(const Limits& limits, const GridOptions& options, std::string& message);

    // From the next begin() on: the level frame is turned and moved along the floor, until its origin lies under that
    // of this frame and its x is that one's, instead of the first camera's.
    void align_with(const RigidTransform& frame_from_map) { frame_from_map_ = frame_from_map; }
    void begin(const DepthSource& images);
    // False: it is done. `has_grid()` and `floor()` are valid then.
    bool step(const DepthSource& images);
    [[nodiscard]] bool is_working() const { return pass_ != Pass::kDone; }

    [[nodiscard]] const Floor& floor() const { return floor_; }
    [[nodiscard]] bool has_grid() const { return has_grid_; }
    [[nodiscard]] const OccupancyGrid& grid() const { return grid_; }
    // What it is made of, oldest first; a pose is that of when the job began.
    struct Look {
        std::uint64_t frame = 0;
        std::uint32_t index = 0;  // of the source's depth_image()
        RigidTransform map_from_camera;
    };
    [[nodiscard]] const std::vector<Look>& looks() const { return looks_; }
    [[nodiscard]] std::size_t memory_bytes() const { return block_.bytes().size(); }

private:
    enum class Pass : std::uint8_t { kFloor, kCover, kGrid, kDone };
    // Looked at for the floor: as many say where it is.
    static constexpr std::size_t kFloorLooks = 64;

    void end_pass();

    MemoryBlock block_;
    OccupancyGrid grid_;
    FloorFinder finder_;
    std::optional<RigidTransform> frame_from_map_;
    Floor floor_;
    std::vector<Look> looks_;
    std::uint32_t images_max_ = 0;
    std::size_t next_ = 0;
    Pass pass_ = Pass::kDone;
    bool has_grid_ = false;
};

}  // namespace stillmesh
