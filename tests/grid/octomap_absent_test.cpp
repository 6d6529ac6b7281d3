#include <gtest/gtest.h>

#include "platform/grid/octomap_file.hpp"

namespace stillmesh::octomap_absent_test {
namespace {

struct Nothing {
    [[nodiscard]] DepthImage depth_image(std::uint32_t) const { return {}; }
};

// Promise: a build without OctoMap says what to install, and writes nothing.
TEST(OctomapAbsent, SaysWhatToInstall) {
    const GridJob job;
    std::string message;
    EXPECT_FALSE(write_octomap(Nothing{}, job, "a.bt", message));
    EXPECT_NE(message.find("apt-get install liboctomap-dev"), std::string::npos) << message;
}

}  // namespace
}  // namespace stillmesh::octomap_absent_test
