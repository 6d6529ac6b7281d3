// `stillmesh run --publish ros2` as a program: what it costs and what nobody can do to it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <string>

#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/program.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh {
namespace {

using test::Program;
using test::within;
namespace fast = test::fast;

constexpr const char* kRun = "run --simulate walking_xyz:1 --frames 90 --limits pocket --json ";

// Promise: a reliable reader that never takes what it was promised changes nothing: not a pose, not a bit of the state
// hash, and the run ends as without it.
TEST(RosProgram, AStuckReaderChangesNothing) {
    const test::TemporaryFolder scratch;
    const auto outputs = [&scratch](const std::string& name) {
        return "--state-hashes " + scratch.path(name + ".hashes") + " --trajectory " + scratch.path(name + ".txt");
    };
    Program alone(STILLMESH_PROGRAM, "", kRun + outputs("alone"), scratch);

    fast::Node node;
    const fast::Qos stuck{.is_stuck = true};
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", stuck);
    fast::Node::Reader<fast::Tf> tf(node, "/tf", stuck);
    fast::Node::Reader<fast::Path> path(node, "/stillmesh/path", stuck);
    fast::Node::Reader<fast::PointCloud> points(node, "/stillmesh/points", stuck);
    fast::Node::Reader<fast::DiagnosticArray> diagnostics(node, "/diagnostics", stuck);
    Program published(STILLMESH_PROGRAM, "", kRun + std::string("--realtime --publish ros2 ") + outputs("live"),
                      scratch);
    EXPECT_TRUE(within(60'000, [&] { return odometry.is_matched() && tf.is_matched() && points.is_matched(); }));
    EXPECT_GE(published.wait(120'000), 0);

    // Frames that are late are dropped with --realtime: another run decides the same of all frames.
    Program again(STILLMESH_PROGRAM, "", kRun + std::string("--publish ros2 ") + outputs("again"), scratch);
    EXPECT_TRUE(within(60'000, [&] { return odometry.is_matched(); }));
    EXPECT_EQ(again.wait(120'000), 0) << again.err();
    EXPECT_EQ(alone.wait(120'000), 0) << alone.err();
    const std::string hashes = test::text_of(scratch.path("alone.hashes"));
    EXPECT_GT(hashes.size(), 90U * 20);
    EXPECT_EQ(test::text_of(scratch.path("again.hashes")), hashes);
    EXPECT_EQ(test::text_of(scratch.path("again.txt")), test::text_of(scratch.path("alone.txt")));
    EXPECT_EQ(again.err().find("samples were lost"), std::string::npos) << again.err();
    EXPECT_EQ(published.err().find("samples were lost"), std::string::npos) << published.err();
}

// Promise: poses on /odom are those of --trajectory, seen from the first: same times, same places, in ROS's axes; and
// the run's map comes as points.
TEST(RosProgram, OdometryIsTheTrajectory) {
    const test::TemporaryFolder scratch;
    fast::Node node;
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", {.depth = 1000});
    fast::Node::Reader<fast::PointCloud> points(node, "/stillmesh/points", {});
    Program run(STILLMESH_PROGRAM, "",
                "run --simulate static_xyz:1 --frames 120 --limits pocket --realtime --publish ros2 --trajectory " +
                    scratch.path("path.txt"),
                scratch);
    std::map<std::int64_t, fast::Odometry> heard;
    std::size_t clouds = 0, cloud_points = 0;
    int code = -1;
    EXPECT_TRUE(within(120'000, [&] {
        for (auto& m : odometry.take()) heard[m.header.time_ns()] = m;
        for (auto& m : points.take()) ++clouds, cloud_points = m.width;
        code = run.wait(1);
        return code >= 0;
    }));
    EXPECT_EQ(run.err().find("samples were lost"), std::string::npos) << run.err();
    std::istringstream lines(test::text_of(scratch.path("path.txt")));
    std::size_t compared = 0;
    for (std::string line; std::getline(lines, line);) {
        if (line.empty() || line[0] == '#') continue;
        std::istringstream words(line);
        std::string time;
        double x = 0, y = 0, z = 0;
        words >> time >> x >> y >> z;
        time.erase(time.find('.'), 1);
        const auto found = heard.find(std::stoll(time));
        if (found == heard.end()) continue;
        ++compared;
        EXPECT_NEAR(found->second.pose.p[0], z, 1e-5);  // a trajectory file has rounded numbers
        EXPECT_NEAR(found->second.pose.p[1], -x, 1e-5);
        EXPECT_NEAR(found->second.pose.p[2], -y, 1e-5);
    }
    EXPECT_GT(compared, 20U) << run.err();
    EXPECT_GT(clouds, 0U);
    EXPECT_GT(cloud_points, 100U);
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    stillmesh::test::enter_own_ros_domain();
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
