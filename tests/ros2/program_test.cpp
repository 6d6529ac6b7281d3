// `stillmesh run --publish ros2` as a program: what it costs and what nobody can do to it.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "platform/poses/velocity.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/program.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::program_test {
namespace {

using test::Program;
using test::within;
namespace fast = test::fast;

constexpr const char* kRun = "run --simulate walking_xyz:1 --limits pocket --json ";

void a_stuck_reader_changes_nothing(int frames, int patience_ms) {
    const test::TemporaryFolder scratch;
    const std::string run = kRun + ("--frames " + std::to_string(frames) + " ");
    const auto outputs = [&scratch](const std::string& name) {
        return "--state-hashes " + scratch.path(name + ".hashes") + " --trajectory " + scratch.path(name + ".txt");
    };
    Program alone(STILLMESH_PROGRAM, "", run + outputs("alone"), scratch);

    fast::Node node;
    const fast::Qos stuck{.is_stuck = true};
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", stuck);
    fast::Node::Reader<fast::Tf> tf(node, "/tf", stuck);
    fast::Node::Reader<fast::Path> path(node, "/stillmesh/path", stuck);
    fast::Node::Reader<fast::PointCloud> points(node, "/stillmesh/points", stuck);
    fast::Node::Reader<fast::DiagnosticArray> diagnostics(node, "/diagnostics", stuck);
    Program published(STILLMESH_PROGRAM, "", run + "--realtime --publish ros2 " + outputs("live"), scratch);
    EXPECT_TRUE(within(60'000, [&] { return odometry.is_matched() && tf.is_matched() && points.is_matched(); }));
    EXPECT_GE(published.wait(patience_ms), 0);

    // Frames that are late are dropped with --realtime: another run decides the same of all frames.
    Program again(STILLMESH_PROGRAM, "", run + "--publish ros2 " + outputs("again"), scratch);
    EXPECT_TRUE(within(60'000, [&] { return odometry.is_matched(); }));
    EXPECT_EQ(again.wait(patience_ms), 0) << again.err();
    EXPECT_EQ(alone.wait(patience_ms), 0) << alone.err();
    const std::string hashes = test::text_of(scratch.path("alone.hashes"));
    EXPECT_GT(hashes.size(), static_cast<std::size_t>(frames) * 20);
    EXPECT_EQ(test::text_of(scratch.path("again.hashes")), hashes);
    EXPECT_EQ(test::text_of(scratch.path("again.txt")), test::text_of(scratch.path("alone.txt")));
    EXPECT_EQ(again.err().find("samples were lost"), std::string::npos) << again.err();
    EXPECT_EQ(published.err().find("samples were lost"), std::string::npos) << published.err();
}

// Promise: a run that asks for nothing of ROS 2 has neither Cyclone DDS nor our module for it in its memory; one that
// publishes has both, and none has what serves the page.
TEST(RosProgram, LoadsWhatItIsAskedFor) {
    for (const bool is_asked : {false, true}) {
        const test::TemporaryFolder scratch;
        Program run(STILLMESH_PROGRAM, "",
                    std::string(kRun) + "--frames 3000 --realtime --trajectory " + scratch.path("path") +
                        (is_asked ? " --publish ros2" : ""),
                    scratch);
        // Its first pose comes after everything has been opened.
        ASSERT_TRUE(within(60'000, [&] { return test::text_of(scratch.path("path")).size() > 200; })) << run.err();
        const std::string mapped = test::text_of("/proc/" + std::to_string(run.pid()) + "/maps");
        EXPECT_NE(mapped.find("libc.so"), std::string::npos);
        for (const char* const library : {"libddsc", "libstillmesh_ros2"}) {
            EXPECT_EQ(mapped.find(library) != std::string::npos, is_asked) << library;
        }
        for (const char* const library : {"libcpp-httplib", "libstillmesh_view"}) {
            EXPECT_EQ(mapped.find(library), std::string::npos) << library;
        }
    }
}

// Promise: the module is opened from two places that are seen from the program's own, and not from where
// LD_LIBRARY_PATH says.
TEST(RosProgram, LoadsFromItsOwnPlacesAlone) {
    const test::TemporaryFolder scratch;
    const std::string folder = scratch.path("usr/bin"), elsewhere = scratch.path("elsewhere");
    for (const std::string& one : {folder, elsewhere}) std::filesystem::create_directories(one);
    const std::string name = std::filesystem::path(STILLMESH_MODULE).filename();
    std::filesystem::copy_file(STILLMESH_PROGRAM, folder + "/stillmesh");
    std::filesystem::copy_file(STILLMESH_MODULE, elsewhere + "/" + name);
    const auto says = [&] {
        Program run(folder + "/stillmesh", elsewhere, std::string(kRun) + "--frames 3 --publish ros2", scratch);
        const int code = run.wait(60'000);
        return std::to_string(code) + run.err();
    };
    const std::string refused = says(), begin = "neither " + folder + "/" + name + " nor ";
    ASSERT_NE(refused.find("--publish ros2 needs Cyclone DDS"), std::string::npos) << refused;
    ASSERT_NE(refused.find(begin), std::string::npos) << refused;
    const std::size_t at = refused.find(begin) + begin.size();
    const std::string installed = refused.substr(at, refused.find(" is there", at) - at);
    ASSERT_TRUE(installed.starts_with(scratch.path())) << refused;
    for (const std::string& place : {installed, folder + "/" + name}) {
        std::filesystem::create_directories(std::filesystem::path(place).parent_path());
        std::filesystem::copy_file(STILLMESH_MODULE, place);
        EXPECT_EQ(says().front(), '0') << place << ": " << says();
        std::filesystem::remove(place);
    }
}

// Promise: a reliable reader that never takes what it was promised changes nothing: not a pose, not a bit of the state
// hash, and the run ends as without it.
TEST(RosProgram, AStuckReaderChangesNothing) {
    a_stuck_reader_changes_nothing(90, 120'000);
}
// Promise: nor does it in a minute of frames, when every queue is full.
TEST(RosProgram, AStuckReaderForAMinute) {
    a_stuck_reader_changes_nothing(1800, 600'000);
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

[[nodiscard]] fast::Header header_of(std::int64_t time_ns) {
    return {static_cast<std::int32_t>(time_ns / 1'000'000'000), static_cast<std::uint32_t>(time_ns % 1'000'000'000),
            "camera_color_optical_frame"};
}

// Of the robot that says itself where its camera is: 20 cm ahead of base_link and 10 cm to its left, turned left by 90
// degrees, at the end of two transforms.
const RigidTransform kBaseFromMast{{0, 0, 0.70710678118654757, 0.70710678118654757}, {0.2, 0, 0}};
const RigidTransform kMastFromOptical{{-0.5, 0.5, -0.5, 0.5}, {0.1, 0, 0}};

[[nodiscard]] fast::Tf description_of_the_robot() {
    const auto transform = [](const char* parent, const char* child, const RigidTransform& pose) {
        fast::TransformStamped one;
        one.header.frame_id = parent;
        one.child_frame_id = child;
        std::copy(std::begin(pose.translation_m), std::end(pose.translation_m), one.transform.p.begin());
        std::copy(std::begin(pose.rotation_xyzw), std::end(pose.rotation_xyzw), one.transform.q.begin());
        return one;
    };
    return {{transform("base_link", "mast", kBaseFromMast),
             transform("mast", "camera_color_optical_frame", kMastFromOptical)}};
}

// What an accelerometer in the camera measures between three frames of a simulated camera, whose world has z up.
[[nodiscard]] std::array<double, 3> acceleration_at(const test::Sequence& sequence, std::size_t i) {
    const auto& before = sequence.frames[i - 1].truth;
    const auto& here = sequence.frames[i].truth;
    const auto& after = sequence.frames[i + 1].truth;
    const double seconds = static_cast<double>(here.time_ns - before.time_ns) * 1e-9;
    std::array<double, 3> in_world{0, 0, 9.81};
    for (std::size_t k = 0; k < 3; ++k) in_world[k] += (before.t[k] - 2 * here.t[k] + after.t[k]) / (seconds * seconds);
    return rotated(inverse_of(RigidTransform{{here.q[0], here.q[1], here.q[2], here.q[3]}, {}}), in_world);
}
void expect_up(const std::string& summary, const SimulatedPose& first) {
    const std::size_t line = summary.find("gravity       up is ");
    ASSERT_NE(line, std::string::npos) << summary;
    std::array<double, 3> up{};
    ASSERT_EQ(std::sscanf(summary.c_str() + line, "gravity up is %lf %lf %lf in", &up[0], &up[1], &up[2]), 3);
    const auto truth =
        rotated(inverse_of(RigidTransform{{first.q[0], first.q[1], first.q[2], first.q[3]}, {}}), {0, 0, 1});
    EXPECT_GT(up[0] * truth[0] + up[1] * truth[1] + up[2] * truth[2], 0.9994) << summary;  // two degrees
}

// Images of a simulated camera, and its wheels if it has some, from Fast DDS; what the program says of them. `is_told`:
// the robot says where its camera is; `has_accelerometer`: in the camera, a reading a frame.
void whole_way(bool has_wheels, bool is_told = false, bool has_accelerometer = false) {
    const test::Sequence sequence = test::rendered("static_xyz", has_accelerometer ? 200 : 150, 320, 240);
    const test::TemporaryFolder scratch;
    fast::Node node;
    fast::Node::Writer<fast::Image> colour(node, "/camera/color/image_raw", {.depth = 2});
    fast::Node::Writer<fast::Image> depth(node, "/camera/aligned_depth_to_color/image_raw", {.depth = 2});
    fast::Node::Writer<fast::CameraInfo> info(node, "/camera/color/camera_info", {.depth = 2});
    fast::Node::Writer<fast::Odometry> wheels(node, "/odom_in", {.depth = 100});
    fast::Node::Writer<fast::Imu> imu(node, "/camera/accel/sample", {.is_reliable = false, .depth = 100});
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", {.depth = 1000});
    fast::Node::Writer<fast::Tf> description(node, "/tf_static", {.is_latched = true, .depth = 1});
    fast::Node::Reader<fast::Tf> statics(node, "/tf_static", {.is_latched = true, .depth = 10});
    if (is_told) {
        EXPECT_TRUE(description.write(description_of_the_robot()));
    }
    Program run(STILLMESH_PROGRAM, "",
                std::string("run --camera ros2 --wait --limits pocket --publish ros2") +
                    (has_accelerometer ? " --frames 150 --level gravity --accelerometer ros2:/camera/accel/sample"
                                       : " --frames 60") +
                    (has_wheels ? " --odometry ros2" : "") + (is_told ? " --base-from-camera tf_static" : ""),
                scratch);
    fast::CameraInfo lens;
    lens.height = 240;
    lens.width = 320;
    const CameraModel& model = sequence.camera;
    lens.distortion_model = "plumb_bob";
    lens.d = {model.k1, model.k2, model.p1, model.p2, model.k3};
    lens.k = {model.fx, 0, model.cx, 0, model.fy, model.cy, 0, 0, 1};
    ASSERT_TRUE(within(60'000, [&] { return colour.is_matched() && depth.is_matched() && info.is_matched(); }));
    for (std::size_t i = 0; i < sequence.frames.size() && run.wait(1) == -1; ++i) {
        const test::KeptFrame& frame = sequence.frames[i];
        const fast::Header header = header_of(frame.time_ns);
        lens.header = header;
        fast::Image image{header, 240, 320, frame.format == PixelFormat::kGrey8 ? "mono8" : "rgb8", 0, 0, frame.colour};
        image.step = 320 * channels_of(frame.format);
        fast::Image metres{header, 240, 320, "32FC1", 0, 320 * 4, {}};
        metres.data.resize(frame.depth.size() * 4);
        for (std::size_t k = 0; k < frame.depth.size(); ++k) {
            const auto z = static_cast<float>(frame.depth[k] / frame.depth_units_per_m);
            std::memcpy(metres.data.data() + 4 * k, &z, 4);
        }
        fast::Odometry turned;  // base_link looks where the camera looks
        turned.header = header;
        const SimulatedPose& truth = frame.truth;
        turned.pose = {{truth.t[2], -truth.t[0], -truth.t[1]}, {truth.q[2], -truth.q[0], -truth.q[1], truth.q[3]}};
        EXPECT_TRUE(wheels.write(turned));
        if (has_accelerometer && i > 0 && i + 1 < sequence.frames.size()) {
            fast::Imu reading;
            reading.header = header;
            reading.linear_acceleration = acceleration_at(sequence, i);
            EXPECT_TRUE(imu.write(reading));
        }
        EXPECT_TRUE(colour.write(image) && depth.write(metres) && info.write(lens));
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    EXPECT_GE(run.wait(60'000), 0);
    const std::size_t said = run.out().find("ROS 2's /odom_in: a motion for ");
    EXPECT_EQ(said != std::string::npos, has_wheels) << run.out();
    if (has_wheels) {
        EXPECT_GT(std::atoi(run.out().c_str() + said + 31), 30) << run.out();
    }
    static_cast<void>(within(2'000, [] { return false; }));  // what is on the way
    const std::vector<fast::Odometry> heard = odometry.take();
    EXPECT_EQ(run.out().find("gravity ") != std::string::npos, has_accelerometer);
    if (has_accelerometer) expect_up(run.out(), sequence.frames.front().truth);
    ASSERT_GT(heard.size(), 20U) << run.err();
    const auto truth_at = [&](std::int64_t time_ns) -> const SimulatedPose* {
        for (const test::KeptFrame& frame : sequence.frames) {
            if (frame.time_ns == time_ns) return &frame.truth;
        }
        return nullptr;
    };
    // What is heard first need not be the first frame: motions from there on are compared.
    const auto pose_of = [](const fast::Pose& pose) {
        return RigidTransform{{pose.q[0], pose.q[1], pose.q[2], pose.q[3]}, {pose.p[0], pose.p[1], pose.p[2]}};
    };
    for (const fast::Tf& told : statics.take()) {  // the robot's own is the only one
        EXPECT_EQ(told.transforms.at(0).child_frame_id == "mast", is_told);
    }
    // To camera_link's axes (x ahead), whatever lies between it and base_link.
    const RigidTransform link_from_optical{{-0.5, 0.5, -0.5, 0.5}, {0, 0, 0}};
    const RigidTransform base_from_link =
        is_told ? compose(compose(kBaseFromMast, kMastFromOptical), inverse_of(link_from_optical)) : RigidTransform{};
    const auto link_of = [&](const fast::Pose& pose) { return compose(pose_of(pose), base_from_link); };
    const RigidTransform begin = inverse_of(link_of(heard.front().pose));
    const SimulatedPose* const first = truth_at(heard.front().header.time_ns());
    ASSERT_NE(first, nullptr);
    for (const fast::Odometry& got : heard) {
        const SimulatedPose* const truth = truth_at(got.header.time_ns());
        ASSERT_NE(truth, nullptr) << got.header.time_ns();
        const auto& [x, y, z] = compose(begin, link_of(got.pose)).translation_m;
        EXPECT_LT(test::metres_off({{0, 0, 0, 1}, {-y, -z, x}}, *first, *truth), 0.02);
    }
}

// Promise: a robot whose driver and listener are both others' (Fast DDS): its images are tracked, and its odometry has
// their stamps and is where the camera truly was.
TEST(RosProgram, FromImagesToOdometry) {
    whole_way(false);
}
// Promise: and so it is with wheels, of which most frames are told.
TEST(RosProgram, FromImagesAndWheelsToOdometry) {
    whole_way(true);
}
// Promise: and so it is with an accelerometer, by which up is known to two degrees in the map.
TEST(RosProgram, FromImagesAndAnAccelerometerToUp) {
    whole_way(false, false, true);
}
// Promise: and so it is where the robot itself says, by /tf_static, where its camera is: /odom is that of its base, and
// no other transform is told for the camera. Of another camera than a robot's it is refused at once.
TEST(RosProgram, TheRobotSaysWhereItsCameraIs) {
    whole_way(false, true);
}
TEST(RosProgram, TheRobotHasToSayWhereItsCameraIs) {
    const test::TemporaryFolder scratch;
    Program other(STILLMESH_PROGRAM, "", std::string(kRun) + "--publish ros2 --base-from-camera tf_static", scratch);
    EXPECT_EQ(other.wait(60'000), 2);
    EXPECT_NE(other.err().find("--camera ros2"), std::string::npos) << other.err();
}

// Promise: a run with a grid and ROS 2 shows it while it goes on: floor and obstacles, level in ROS's map, in its axes.
TEST(RosProgram, ShowsItsGrid) {
    const test::TemporaryFolder scratch;
    fast::Node node;
    fast::Node::Reader<fast::OccupancyGrid> reader(node, "/map", {.is_latched = true, .depth = 1});
    Program run(
        STILLMESH_PROGRAM, "",
        "run --simulate static_halfsphere:1 --frames 900 --realtime --publish ros2 --grid " + scratch.path("office"),
        scratch);
    std::vector<fast::OccupancyGrid> heard;
    const auto has_obstacles = [&heard] {  // where frames are late the first ones show the floor alone
        return !heard.empty() && std::count(heard.back().data.begin(), heard.back().data.end(), 100) > 20;
    };
    EXPECT_TRUE(within(120'000, [&] {
        for (fast::OccupancyGrid& grid : reader.take()) heard.push_back(grid);
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return has_obstacles() || run.wait(1) >= 0;
    }));
    ASSERT_FALSE(heard.empty()) << run.err();
    const fast::OccupancyGrid& grid = heard.back();
    EXPECT_EQ(grid.header.frame_id, "map");
    ASSERT_EQ(grid.data.size(), std::size_t{grid.width} * grid.height);
    EXPECT_GT(std::count(grid.data.begin(), grid.data.end(), 0), 200);
    EXPECT_TRUE(has_obstacles());
    // Its x lies along that of the map, but for the camera's tilt, which nobody told.
    const RigidTransform origin{{grid.origin.q[0], grid.origin.q[1], grid.origin.q[2], grid.origin.q[3]}, {}};
    const std::array<double, 3> up = rotated(inverse_of(origin), {1, 0, 0});
    EXPECT_NEAR(up[1], 0, 1e-6);
    EXPECT_GT(up[0], 0.5);
    EXPECT_LT(grid.origin.p[2], 0);  // the floor, below the camera
}

// Promise: a run does what was asked between two frames and says so: the map is on the disk while it goes on, stays as
// it is or is added to, and another begins.
TEST(RosProgram, DoesWhatItIsAsked) {
    const test::TemporaryFolder scratch;
    const std::string map = scratch.path("room.map");
    fast::Node node;
    fast::Node::Writer<fast::Empty> save(node, "/stillmesh/save_map", {});
    fast::Node::Writer<fast::Empty> reset(node, "/stillmesh/reset", {});
    fast::Node::Writer<fast::Bool> localise(node, "/stillmesh/localize_only", {});
    Program run(STILLMESH_PROGRAM, "",
                "run --simulate static_xyz:1 --frames 3000 --limits pocket --realtime --publish ros2 --map-out " + map,
                scratch);
    ASSERT_TRUE(within(60'000, [&] { return save.is_matched() && reset.is_matched() && localise.is_matched(); }))
        << run.err();
    const auto says = [&](const std::string& sentence, auto&& ask) {
        return within(60'000, [&] {
            ask();
            std::this_thread::sleep_for(std::chrono::milliseconds(300));
            return run.err().find(sentence) != std::string::npos || run.wait(1) >= 0;
        });
    };
    EXPECT_FALSE(std::filesystem::exists(map));
    EXPECT_TRUE(within(60'000, [&] {
        EXPECT_TRUE(save.write({}));
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        return std::filesystem::exists(map);
    })) << run.err();
    EXPECT_NE(run.err().find("as ROS 2 asked: the map is saved to " + map), std::string::npos) << run.err();
    EXPECT_TRUE(says("from here on the map stays as it is", [&] { EXPECT_TRUE(localise.write({true})); }));
    EXPECT_TRUE(says("from here on the map is added to", [&] { EXPECT_TRUE(localise.write({false})); }));
    EXPECT_TRUE(says("wished by ROS 2: a new map begins here", [&] { EXPECT_TRUE(reset.write({})); }));
    EXPECT_TRUE(within(60'000, [&] {
        EXPECT_TRUE(save.write({}));
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        return std::filesystem::exists(map + ".1") || run.wait(1) >= 0;
    })) << run.err();
    EXPECT_TRUE(std::filesystem::exists(map + ".1")) << run.err();
    EXPECT_EQ(run.wait(1), -1) << "it goes on all the while: " << run.err();
    run.signal(SIGTERM);
    EXPECT_GE(run.wait(60'000), 0);
}

}  // namespace
}  // namespace stillmesh::program_test

int main(int argc, char** argv) {
    stillmesh::test::enter_own_ros_domain();
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
