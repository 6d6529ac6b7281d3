#include "platform/grid/octomap_file.hpp"

#include <octomap/OcTree.h>
#include <octomap/Pointcloud.h>

#include <array>
#include <sstream>

#include "platform/linux/text_output.hpp"

namespace stillmesh {
namespace {

// No cube is surer, so that what was moved has left after four looks through it (of OctoMap's .97: nine).
constexpr double kSureMax = 0.8;

[[nodiscard]] octomap::point3d point_of(const std::array<double, 3>& p) {
    return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

}  // namespace

bool write_octomap(const DepthSource& images, const GridJob& job, const std::string& file, std::string& message) {
    const GridOptions& options = job.grid().options();
    octomap::OcTree tree(options.resolution_m);
    tree.setClampingThresMax(kSureMax);
    for (const GridJob::Look& look : job.looks()) {
        const DepthImage image = images.depth_image(look.index);
        const RigidTransform from_camera =
            job.floor().is_known ? compose(job.floor().level_from_map, look.map_from_camera) : look.map_from_camera;
        octomap::Pointcloud cloud;
        for (std::size_t i = 0; i < image.depth_mm.size(); ++i) {
            if (!image.is_still(i)) continue;
            const double z = image.depth_mm[i] * 1e-3;
            const double x = static_cast<double>(image.rays[2 * i]) * z;
            const double y = static_cast<double>(image.rays[2 * i + 1]) * z;
            cloud.push_back(point_of(transformed(from_camera, {x, y, z})));
        }
        // A cube that one image sees both ways is occupied in it.
        tree.insertPointCloud(cloud, point_of(transformed(from_camera, {0, 0, 0})), options.range_m, true, true);
    }
    tree.updateInnerOccupancy();
    if (tree.size() == 0) {
        message = "--octomap " + file + ": was not written: nothing was seen.";
        return false;
    }
    tree.toMaxLikelihood();
    tree.prune();
    // As tree.writeBinary() would, which tells standard error about it.
    std::ostringstream text;
    text << "# Octomap OcTree binary file\nid " << tree.getTreeType() << "\nsize " << tree.size() << "\nres "
         << tree.getResolution() << "\ndata\n";
    tree.writeBinaryNode(text, tree.getRoot());
    return write_whole_file(file, text.str(), message);
}

}  // namespace stillmesh
