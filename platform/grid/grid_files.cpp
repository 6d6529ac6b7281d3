#include "platform/grid/grid_files.hpp"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstring>
#include <filesystem>

#include "platform/linux/text_output.hpp"

namespace stillmesh {
namespace {

constexpr char kFree = static_cast<char>(254), kOccupied = 0, kUnknown = static_cast<char>(205);

constexpr std::size_t kPointBytes = 3 * sizeof(float);
static_assert(std::endian::native == std::endian::little, "a cloud is written as it lies in memory");

}  // namespace

std::string grid_pgm(const OccupancyGrid& grid) {
    std::string text = fmt::format("P5\n{} {}\n255\n", grid.width(), grid.height());
    for (std::uint32_t row = grid.height(); row-- > 0;) {
        for (std::uint32_t column = 0; column < grid.width(); ++column) {
            const GridCell cell = grid.at(column, row);
            text += cell == GridCell::kFree ? kFree : cell == GridCell::kOccupied ? kOccupied : kUnknown;
        }
    }
    return text;
}

std::string grid_yaml(const OccupancyGrid& grid, const Floor& floor, const std::string& picture) {
    const RigidTransform& level = floor.level_from_map;
    return fmt::format(
        "image: \"{}\"\nmode: trinary\nresolution: {:g}\norigin: [{:.4f}, {:.4f}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
        "# From a pose of the trajectory to a pose in this grid: {:.6f} {:.6f} {:.6f} {:.9f} {:.9f} {:.9f} {:.9f}\n"
        "# (tx ty tz qx qy qz qw, multiplied from the left; z up, floor at 0)\n",
        picture, grid.options().resolution_m, grid.origin_x(), grid.origin_y(), level.translation_m[0],
        level.translation_m[1], level.translation_m[2], level.rotation_xyzw[0], level.rotation_xyzw[1],
        level.rotation_xyzw[2], level.rotation_xyzw[3]);
}

void CloudPoints::begin(const GridJob& job, const std::optional<RigidTransform>& level_from_map) {
    constexpr std::size_t kCellsMax = 80 * 60;
    level_from_map_ = level_from_map;
    points_.clear();
    points_.reserve(job.looks().size() * kCellsMax * kPointBytes);
    next_ = 0;
}

bool CloudPoints::add(const DepthSource& images, const GridJob& job) {
    if (next_ >= job.looks().size()) return false;
    const GridJob::Look& look = job.looks()[next_++];
    const DepthImage depth = images.depth_image(look.index);
    if (depth.columns == 0 || depth.frame != look.frame) return true;  // it is gone
    const RigidTransform level = compose(job.floor().level_from_map, look.map_from_camera);
    const RigidTransform out_from_camera = compose(level_from_map_.value_or(RigidTransform{}), look.map_from_camera);
    for (std::size_t i = 0; i < depth.depth_mm.size(); ++i) {
        if (!depth.is_still(i)) continue;
        const double z = depth.depth_mm[i] * 1e-3;
        const std::array<double, 3> p = {static_cast<double>(depth.rays[2 * i]) * z,
                                         static_cast<double>(depth.rays[2 * i + 1]) * z, z};
        const std::array<double, 3> on_floor = transformed(level, p);
        if (job.has_grid() && !job.grid().stands(on_floor[0], on_floor[1], on_floor[2])) continue;
        const std::array<double, 3> at = transformed(out_from_camera, p);
        const float xyz[3] = {static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
        char bytes[kPointBytes];
        std::memcpy(bytes, xyz, kPointBytes);
        points_.append(bytes, kPointBytes);
    }
    return true;
}

std::string CloudPoints::ply() const {
    return fmt::format(
               "ply\nformat binary_little_endian 1.0\ncomment {}\nelement vertex {}\nproperty float x\nproperty float "
               "y\nproperty float z\nend_header\n",
               level_from_map_ ? "m; z up, floor at 0 where it is known"
                               : "m; the first camera: x right, y down, z forward",
               points_.size() / kPointBytes) +
           points_;
}

std::string cloud_ply(const DepthSource& images, const GridJob& job,
                      const std::optional<RigidTransform>& level_from_map) {
    CloudPoints points;
    points.begin(job, level_from_map);
    while (points.add(images, job)) {
    }
    return points.ply();
}

std::string why_no_grid(const GridJob& job) {
    if (job.looks().empty()) {
        return "nothing was kept of what was seen; that begins a second after the start, with frames of a sure pose";
    }
    if (!job.floor().is_known) {
        return "no floor was seen for certain; let the camera look down at some of it, held upright";
    }
    return "nothing was seen within reach of it";
}

bool write_grid(const GridJob& job, const std::string& name, std::string& message) {
    const std::string picture = std::filesystem::path(name).filename().string() + ".pgm";
    return write_whole_file(name + ".pgm", grid_pgm(job.grid()), message) &&
           write_whole_file(name + ".yaml", grid_yaml(job.grid(), job.floor(), picture), message);
}

}  // namespace stillmesh
