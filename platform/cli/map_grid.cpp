#include "platform/cli/map_grid.hpp"

#include <optional>

#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/grid/grid_files.hpp"
#include "platform/grid/grid_job.hpp"
#include "platform/grid/octomap_file.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/poses/body_frames.hpp"

namespace stillmesh {

void add_grid_destinations(const GridOutputOptions& options, const std::string& octomap,
                           std::vector<Destination>& destinations) {
    if (!options.grid.empty()) {
        destinations.push_back({"--grid", options.grid + ".yaml", DestinationKind::kWhole});
        destinations.push_back({"--grid", options.grid + ".pgm", DestinationKind::kWhole});
    }
    if (!options.cloud.empty()) destinations.push_back({"--cloud", options.cloud, DestinationKind::kWhole});
    if (!octomap.empty()) destinations.push_back({"--octomap", octomap, DestinationKind::kWhole});
}

int write_grid_of(const SavedMap& map, const std::string& name, const GridOutputOptions& options,
                  const std::string& octomap) {
    if (map.depth.empty()) {
        return refuse(name +
                      ": holds no depth images to make a grid, a cloud or an OctoMap of; 'stillmesh run' keeps some "
                      "from its second "
                      "second on, where limits.depth_images_max is not 0.");
    }
    GridOptions grid;
    std::string message;
    if (!grid_options_of(options, grid, message)) return refuse(message);
    Limits limits;
    limits.depth_images_max = static_cast<std::uint32_t>(map.depth.size());
    GridJob job;
    bool is_done = job.open(limits, grid, message);
    if (!is_done) return refuse(message);
    if (options.base_from_camera_link) job.align_with(compose(*options.base_from_camera_link, kLinkFromOptical));
    job.begin(map);
    while (job.step(map)) {
    }
    const auto lacks = [&](const std::string& what) {
        complain(what + why_no_grid(job) + ".");
        is_done = false;
    };
    if (!options.grid.empty() && !job.has_grid()) {
        lacks("--grid " + options.grid + ": was not written: ");
    } else if (!options.grid.empty() && !write_grid(job, options.grid, message)) {
        complain(message);
        is_done = false;
    }
    if (!octomap.empty() && !write_octomap(map, job, octomap, message)) {
        complain(message);
        is_done = false;
    } else if (!octomap.empty() && !job.floor().is_known) {
        lacks("--octomap " + octomap + ": is not level: ");
    }
    if (options.cloud.empty()) return is_done ? kExitDone : kExitFailed;
    std::optional<RigidTransform> level_from_map;
    if (options.level == Level::kFloor && job.floor().is_known) level_from_map = job.floor().level_from_map;
    if (!write_whole_file(options.cloud, cloud_ply(map, job, level_from_map), message)) {
        complain(message);
        is_done = false;
    }
    if (options.level == Level::kFloor && !level_from_map) lacks("--cloud " + options.cloud + ": is not level: ");
    return is_done ? kExitDone : kExitFailed;
}

}  // namespace stillmesh
