// In a build without liboctomap.
#include "platform/grid/octomap_file.hpp"

namespace stillmesh {

bool write_octomap(const DepthSource& images, const GridJob& job, const std::string& file, std::string& message) {
    static_cast<void>(images);
    static_cast<void>(job);
    message = "--octomap " + file +
              ": needs OctoMap, which is not in this build. Install it and build again: sudo apt-get install "
              "liboctomap-dev && cmake --preset release -DSTILLMESH_WITH_OCTOMAP=ON && cmake --build build/release";
    return false;
}

}  // namespace stillmesh
