// /map, read by Fast DDS, and a grid's way there.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <thread>

#include "platform/ros2/ros_publisher.hpp"
#include "tests/ros2/fast_dds.hpp"
#include "tests/support/body_oracle.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::grid_test {
namespace {

using test::BodyOracle;
using test::within;
namespace fast = test::fast;

constexpr std::int64_t kPatience_ms = 30'000;
constexpr std::int64_t kTime_ns = 1'700'000'000'123'456'789;

void put(GridShelf& shelf, std::uint32_t width, std::uint32_t height, const RigidTransform& map_from_grid) {
    ShownGrid& draft = shelf.draft();
    draft.width = width;
    draft.height = height;
    draft.resolution_m = 0.05;
    draft.map_from_grid = map_from_grid;
    draft.cells.clear();
    constexpr std::int8_t kCells[] = {ShownGrid::kUnknown, ShownGrid::kFree, ShownGrid::kOccupied};
    for (std::uint32_t i = 0; i < width * height; ++i) draft.cells.push_back(kCells[(i + i / 7) % 3]);
    shelf.hand_over();
}

// Promise: every field of a grid reaches a reader of Fast DDS that comes later, under ROS 2's name, where it lies in
// ROS's map; one that says the same is not sent again, one that moved or has other cells is. Without a grid there is no
// /map of ours beside another program's.
TEST(RosGrid, FastDdsReadsEveryField) {
    RosOptions options;
    options.name_space = "grid" + std::to_string(::getpid());
    options.base_from_camera_link = BodyOracle(11).random_pose();
    options.frame_prefix = "r1/";
    std::string message;
    RosPublisher without;
    ASSERT_TRUE(without.open(options, message)) << message;
    EXPECT_EQ(without.grid(), nullptr);
    EXPECT_EQ(without.close(), "");
    options.has_grid = true;
    RosPublisher publisher;
    ASSERT_TRUE(publisher.open(options, message)) << message;
    ASSERT_NE(publisher.grid(), nullptr);
    GridShelf& shelf = *publisher.grid();
    shelf.open(100);
    PoseReport report;
    report.state = report.estimate.state = PoseState::kTracked;
    report.estimate.time_ns = kTime_ns;
    EXPECT_TRUE(publisher.frame(report).empty());
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    const RigidTransform where = BodyOracle(12).random_pose();
    put(shelf, 7, 5, where);
    std::this_thread::sleep_for(std::chrono::milliseconds(200));

    fast::Node node;  // later than it was sent
    fast::Node::Reader<fast::OccupancyGrid> reader(node, "/" + options.name_space + "/map",
                                                   {.is_latched = true, .depth = 1});
    std::vector<fast::OccupancyGrid> heard;
    const auto hears = [&](std::size_t count) {
        return within(kPatience_ms, [&] {
            for (fast::OccupancyGrid& grid : reader.take()) heard.push_back(grid);
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
            return heard.size() >= count;
        });
    };
    ASSERT_TRUE(hears(1));
    const fast::OccupancyGrid got = heard[0];
    EXPECT_EQ(got.header.frame_id, "r1/map");
    EXPECT_EQ(got.header.time_ns(), kTime_ns);
    EXPECT_EQ(got.load_sec, got.header.sec);
    EXPECT_EQ(got.load_nanosec, got.header.nanosec);
    EXPECT_EQ(got.resolution, 0.05F);
    EXPECT_EQ(got.width, 7U);
    EXPECT_EQ(got.height, 5U);
    BodyOracle oracle(1);
    oracle.set_mount(options.base_from_camera_link);
    const std::array<float, 3> corner = oracle.point(where.translation_m);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(got.origin.p[i], static_cast<double>(corner[i]), 1e-5);
    const std::array<double, 3> ahead_in_map = transformed(where, {1, 0, 0});
    const double ahead[3] = {ahead_in_map[0], ahead_in_map[1], ahead_in_map[2]};
    const std::array<float, 3> one_on = oracle.point(ahead);
    const RigidTransform origin{{got.origin.q[0], got.origin.q[1], got.origin.q[2], got.origin.q[3]},
                                {got.origin.p[0], got.origin.p[1], got.origin.p[2]}};
    const std::array<double, 3> said = transformed(origin, {1, 0, 0});
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(said[i], static_cast<double>(one_on[i]), 1e-5);
    ASSERT_EQ(got.data.size(), 35U);
    for (std::uint32_t i = 0; i < 35; ++i)
        EXPECT_EQ(got.data[i], ((i + i / 7) % 3 == 0) ? -1 : (i + i / 7) % 3 == 1 ? 0 : 100);

    put(shelf, 7, 5, where);  // nothing new: not sent; what follows it is
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    RigidTransform moved = where;
    moved.translation_m[1] += 0.02;
    put(shelf, 7, 5, moved);
    ASSERT_TRUE(hears(2));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    put(shelf, 8, 5, moved);
    ASSERT_TRUE(hears(3));
    EXPECT_EQ(heard.size(), 3U);
    EXPECT_EQ(heard[1].width, 7U);
    EXPECT_EQ(heard[2].width, 8U);
    EXPECT_EQ(publisher.close(), "");
}

}  // namespace
}  // namespace stillmesh::grid_test
