// A grid as Nav2's map server reads it (NAME.yaml and NAME.pgm: nav2_map_server, mode trinary) and depth images as a
// cloud (binary PLY). Each file is replaced as a whole or not at all.
#pragma once

#include <optional>
#include <string>

#include "platform/grid/grid_job.hpp"

namespace stillmesh {

// The picture: free 254, occupied 0, unknown 205, the highest row first.
[[nodiscard]] std::string grid_pgm(const OccupancyGrid& grid);
// `picture`: its file's name, in the same folder.
[[nodiscard]] std::string grid_yaml(const OccupancyGrid& grid, const Floor& floor, const std::string& picture);
// A cloud, a look at a time: all that keyframes see, but what a grid knows to have gone. Memory: 12 bytes a cell of
// each look, taken when it begins.
class CloudPoints {
public:
    // Of a job that is done. `level_from_map`: z up; else as the map lies.
    void begin(const GridJob& job, const std::optional<RigidTransform>& level_from_map);
    // The next look. False: there is none.
    bool add(const DepthSource& images, const GridJob& job);
    // The file.
    [[nodiscard]] std::string ply() const;

private:
    std::optional<RigidTransform> level_from_map_;
    std::string points_;
    std::size_t next_ = 0;
};
// All of it at once.
[[nodiscard]] std::string cloud_ply(const DepthSource& images, const GridJob& job,
                                    const std::optional<RigidTransform>& level_from_map);

// NAME.pgm, then NAME.yaml. False: `message`.
[[nodiscard]] bool write_grid(const GridJob& job, const std::string& name, std::string& message);
// The part of a sentence that says why a job that is done has none.
[[nodiscard]] std::string why_no_grid(const GridJob& job);

}  // namespace stillmesh
