// What is written as an OctoMap, read back by OctoMap.
#include <gtest/gtest.h>

#include <vector>

#include "platform/grid/octomap_file.hpp"
#include "tests/grid/synthetic_room.hpp"
#include "tests/support/temporary_folder.hpp"
#ifdef STILLMESH_HAS_OCTOMAP
#include <octomap/OcTree.h>
#endif

namespace stillmesh::octomap_test {
namespace {

// Looks of a synthetic room, a second apart.
struct Looks {
    test::SeenRoom room;
    struct Look {
        std::vector<std::uint16_t> depth_mm;
        RigidTransform map_from_camera;
    };
    std::vector<Look> looks;

    void add(const RigidTransform& room_from_camera, const RigidTransform& map_from_room) {
        looks.push_back({room.look(room_from_camera), compose(map_from_room, room_from_camera)});
    }
    [[nodiscard]] DepthImage depth_image(std::uint32_t index) const {
        if (index >= looks.size()) return {};
        DepthImage image = room.image(looks[index].depth_mm, std::uint64_t{30} * index);
        image.map_from_camera = looks[index].map_from_camera;
        return image;
    }
};

#ifdef STILLMESH_HAS_OCTOMAP
// Promise: in the grid's level frame, a box is occupied where its front was seen, the floor is, the space before it is
// free, what is behind it is unknown, and a box that was moved away has left.
TEST(Octomap, ShowsWhatIsThere) {
    Looks looks;
    const RigidTransform camera = test::camera_at({0, 0, 1}, 0, 0.5);
    const RigidTransform map_from_room = inverse_of(camera);
    const test::RoomBox stays = {2, 2.5, -0.4, 0.4, 0, 0.8}, goes = {1.2, 1.4, 0.5, 0.7, 0, 0.5};
    looks.room.boxes = {stays, goes};
    for (int i = 0; i < 3; ++i) looks.add(camera, map_from_room);
    looks.room.boxes = {stays};
    for (int i = 0; i < 6; ++i) looks.add(camera, map_from_room);
    Limits limits;
    limits.depth_images_max = 16;
    GridJob job;
    std::string message;
    ASSERT_TRUE(job.open(limits, GridOptions{}, message)) << message;
    job.begin(looks);
    while (job.step(looks)) {
    }
    ASSERT_TRUE(job.floor().is_known);
    const test::TemporaryFolder folder;
    ASSERT_TRUE(write_octomap(looks, job, folder.path("room.bt"), message)) << message;
    octomap::OcTree tree(0.1);
    ASSERT_TRUE(tree.readBinary(folder.path("room.bt")));
    EXPECT_NEAR(tree.getResolution(), 0.05, 1e-9);
    const auto cube = [&](double x, double y, double z) {
        const octomap::OcTreeNode* const node = tree.search(x, y, z);
        return node == nullptr ? '?' : tree.isNodeOccupied(node) ? '#' : '.';
    };
    EXPECT_EQ(cube(2.01, 0.02, 0.42), '#');
    EXPECT_EQ(cube(1.52, 0.02, 0.42), '.');
    EXPECT_EQ(cube(2.28, 0.02, 0.42), '?');
    EXPECT_EQ(cube(1.22, 0.62, 0.32), '.') << "it was moved away";
    int floor = 0;
    for (double x = 1.0; x < 1.8; x += 0.05) floor += cube(x, -0.3, -0.01) == '#' || cube(x, -0.3, 0.01) == '#' ? 1 : 0;
    EXPECT_GE(floor, 12);
}

// Promise: of nothing no file is made.
TEST(Octomap, OfNothingIsNothing) {
    Looks looks;
    GridJob job;
    std::string message;
    ASSERT_TRUE(job.open(Limits{}, GridOptions{}, message)) << message;
    job.begin(looks);
    while (job.step(looks)) {
    }
    const test::TemporaryFolder folder;
    EXPECT_FALSE(write_octomap(looks, job, folder.path("none.bt"), message));
    EXPECT_NE(message.find("nothing was seen"), std::string::npos) << message;
}
#else
// Promise: without OctoMap it says so.
TEST(Octomap, IsNotInThisBuild) {
    std::string message;
    EXPECT_FALSE(write_octomap(Looks{}, GridJob{}, "a.bt", message));
    EXPECT_NE(message.find("liboctomap-dev"), std::string::npos) << message;
}
#endif

}  // namespace
}  // namespace stillmesh::octomap_test
