// What is published, read by Fast DDS under the names that ROS 2 gives topics and types. No ROS is here.
#include "platform/ros2/ros_publisher.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <string>

#include "tests/persist/map_rig.hpp"
#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/body_oracle.hpp"
#include "tests/support/heap_calls.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::publisher_test {
namespace {

using test::BodyOracle;
using test::within;
namespace fast = test::fast;

constexpr std::int64_t kPeriod_ns = 33'333'333;
constexpr std::int64_t kBegin_ns = 1'700'000'000'123'456'789;
constexpr std::int64_t kPatience_ms = 30'000;

// A camera that moves, with another state every few frames.
[[nodiscard]] PoseReport report_of(std::uint64_t frame) {
    BodyOracle oracle(100 + frame);
    PoseReport report;
    report.frame = frame;
    report.estimate.time_ns = kBegin_ns + static_cast<std::int64_t>(frame) * kPeriod_ns;
    constexpr PoseState kStates[] = {PoseState::kTracked,   PoseState::kTracked,   PoseState::kUnsure,
                                     PoseState::kPredicted, PoseState::kPredicted, PoseState::kNone};
    report.state = report.estimate.state = kStates[frame % 6];
    report.reason = report.state == PoseState::kUnsure ? "rival motion" : "none";
    const double way = 0.01 * static_cast<double>(frame);
    const double turn = 0.02 * static_cast<double>(frame);
    report.estimate.odom_from_camera = {{0, std::sin(turn / 2), 0, std::cos(turn / 2)}, {way, -0.3 * way, 2 * way}};
    report.estimate.map_from_odom = {{0.5, 0.5, 0.5, 0.5}, {1, 2, 3 + way}};
    oracle.random_covariance(report.estimate.covariance);
    report.statistics.features = 1000;
    report.statistics.matches = 400;
    report.statistics.static_matches = 300;
    report.statistics.dynamic_matches = static_cast<std::uint32_t>(frame);
    return report;
}

[[nodiscard]] RigidTransform pose_of(const fast::Pose& pose) {
    return {{pose.q[0], pose.q[1], pose.q[2], pose.q[3]}, {pose.p[0], pose.p[1], pose.p[2]}};
}

// What ROS is to be told of report_of(frame), by the oracle: of the pose, twist and covariances.
class Expected {
public:
    explicit Expected(const RigidTransform& mount) : oracle_(1) { oracle_.set_mount(mount); }

    void odometry(const fast::Odometry& got, std::uint64_t frame) const {
        const PoseReport report = report_of(frame);
        const RigidTransform& pose = report.estimate.odom_from_camera;
        EXPECT_LT(BodyOracle::distance(pose_of(got.pose), oracle_.of_base(pose)), 1e-12);
        EXPECT_LT(BodyOracle::difference(got.pose_covariance, in_parent(frame, pose)), 1e-4);
        const double seconds = static_cast<double>(kPeriod_ns) * 1e-9;
        if (frame % 6 == 0) {  // nothing before it
            for (const double number : got.twist) EXPECT_EQ(number, 0);
            for (std::size_t i = 0; i < 36; ++i) EXPECT_EQ(got.twist_covariance[i], i % 7 == 0 ? 1e6 : 0) << i;
            return;
        }
        Velocity velocity;
        std::copy_n(got.twist.begin(), 3, velocity.linear_m_s);
        std::copy_n(got.twist.begin() + 3, 3, velocity.angular_rad_s);
        const RigidTransform before = report_of(frame - 1).estimate.odom_from_camera;
        // A chord of 0.02 rad differs from its arc by that share.
        EXPECT_LT(oracle_.velocity_error(velocity, before, pose, seconds), 0.05);
        const Matrix6 sum = (in_child(frame) + in_child(frame - 1)) / (seconds * seconds);
        EXPECT_LT(BodyOracle::difference(got.twist_covariance, sum), 1e-4 * sum.cwiseAbs().maxCoeff());
    }
    [[nodiscard]] Matrix6 in_parent(std::uint64_t frame, const RigidTransform& pose) const {
        return oracle_.in_parent(measured(frame).estimate.covariance, pose) + doubt(frame);
    }
    [[nodiscard]] RigidTransform of_base(const RigidTransform& pose) const { return oracle_.of_base(pose); }

private:
    // The frame whose covariance is given out with this one.
    [[nodiscard]] static PoseReport measured(std::uint64_t frame) {
        return report_of(frame - frame % 6 + std::min<std::uint64_t>(frame % 6, 2));
    }
    [[nodiscard]] static Matrix6 doubt(std::uint64_t frame) {
        const std::uint64_t phase = frame % 6;
        const double predicted_s =
            phase < 3 ? 0 : static_cast<double>(phase - 2) * static_cast<double>(kPeriod_ns) * 1e-9;
        const double size = phase < 2 ? 0 : 0.1 + 0.5 * predicted_s;
        return size * size * Matrix6::Identity();
    }
    [[nodiscard]] Matrix6 in_child(std::uint64_t frame) const {
        const PoseReport report = measured(frame);
        return oracle_.in_child(report.estimate.covariance, report.estimate.odom_from_camera) + doubt(frame);
    }

    BodyOracle oracle_;
};

[[nodiscard]] std::uint64_t frame_of(const fast::Header& header) {
    return static_cast<std::uint64_t>((header.time_ns() - kBegin_ns) / kPeriod_ns);
}

// Everything a robot with Fast DDS hears, as it asks for it: nav2 reliably, a viewer of points at best effort.
struct Listeners {
    explicit Listeners(fast::Node& node, const std::string& own)
        : odometry(node, own + "/odom", {}),
          tf(node, "/tf", {.depth = 100}),
          static_tf(node, "/tf_static", {.is_latched = true, .depth = 100}),
          pose(node, own + "/stillmesh/pose", {.is_reliable = false, .depth = 5}),
          path(node, own + "/stillmesh/path", {.depth = 1}),
          points(node, own + "/stillmesh/points", {.is_reliable = false, .depth = 5}),
          diagnostics(node, "/diagnostics", {}) {}
    [[nodiscard]] bool are_matched() const {
        return odometry.is_matched() && tf.is_matched() && static_tf.is_matched() && pose.is_matched() &&
               path.is_matched() && points.is_matched() && diagnostics.is_matched();
    }

    fast::Node::Reader<fast::Odometry> odometry;
    fast::Node::Reader<fast::Tf> tf, static_tf;
    fast::Node::Reader<fast::PoseWithCovarianceStamped> pose;
    fast::Node::Reader<fast::Path> path;
    fast::Node::Reader<fast::PointCloud> points;
    fast::Node::Reader<fast::DiagnosticArray> diagnostics;
};

struct Heard {
    std::map<std::uint64_t, fast::Odometry> odometry;
    std::map<std::uint64_t, fast::Tf> tf;
    std::map<std::uint64_t, fast::PoseWithCovarianceStamped> poses;
    std::vector<fast::Tf> static_tf;
    std::vector<fast::Path> paths;
    std::vector<fast::DiagnosticArray> diagnostics;

    void take(Listeners& from) {
        for (auto& m : from.odometry.take()) odometry[frame_of(m.header)] = m;
        for (auto& m : from.tf.take()) {
            if (m.transforms.size() == 2) tf[frame_of(m.transforms[0].header)] = m;
        }
        for (auto& m : from.pose.take()) poses[frame_of(m.header)] = m;
        for (auto& m : from.static_tf.take()) static_tf.push_back(m);
        for (auto& m : from.path.take()) paths.push_back(m);
        for (auto& m : from.diagnostics.take()) diagnostics.push_back(m);
    }
};

// Promise: every field of every message reaches a reader that is Fast DDS's as it was published, under ROS 2's names:
// poses, twists and covariances are those of the oracle, frames without a pose are missing on /odom and /tf, and what
// is latched reaches who comes later.
TEST(RosPublisher, FastDdsReadsEveryField) {
    const RigidTransform mount = BodyOracle(7).random_pose();
    const Expected expected(mount);
    RosPublisher publisher;
    std::string message;
    RosOptions options;
    options.name_space = "robot" + std::to_string(::getpid());
    options.frame_prefix = "r1/";
    options.base_from_camera_link = mount;
    ASSERT_TRUE(publisher.open(options, message)) << message;
    EXPECT_TRUE(publisher.event("the camera was unplugged.").empty());
    EXPECT_TRUE(publisher.frame(report_of(0)).empty());

    fast::Node node;  // later than /tf_static was sent
    Listeners listeners(node, "/" + options.name_space);
    Heard heard;
    std::uint64_t frame = 1;
    const auto is_all_heard = [&] {
        // A frame for whoever does not see them yet, at a camera's pace.
        EXPECT_TRUE(publisher.frame(report_of(frame++)).empty());
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        heard.take(listeners);
        return heard.odometry.size() >= 60 && heard.tf.size() >= 60 && heard.poses.size() >= 30 &&
               !heard.static_tf.empty() && heard.paths.size() >= 2 && heard.diagnostics.size() >= 3;
    };
    ASSERT_TRUE(within(kPatience_ms, is_all_heard))
        << heard.odometry.size() << " odometry, " << heard.tf.size() << " tf, " << heard.poses.size() << " poses, "
        << heard.static_tf.size() << " static, " << heard.paths.size() << " paths, " << heard.diagnostics.size()
        << " diagnostics";
    EXPECT_EQ(publisher.close(), "");

    for (const auto& [number, got] : heard.odometry) {
        const PoseReport report = report_of(number);
        EXPECT_NE(number % 6, 5U) << "a frame without a pose";
        EXPECT_EQ(got.header.time_ns(), report.estimate.time_ns);
        EXPECT_EQ(got.header.frame_id, "r1/odom");
        EXPECT_EQ(got.child_frame_id, "r1/base_link");
        expected.odometry(got, number);
    }
    for (const auto& [number, got] : heard.tf) {
        const PoseReport report = report_of(number);
        EXPECT_NE(number % 6, 5U) << "a frame without a pose";
        EXPECT_EQ(got.transforms[0].header.time_ns(), report.estimate.time_ns);
        EXPECT_EQ(got.transforms[1].header.time_ns(), report.estimate.time_ns);
        EXPECT_EQ(got.transforms[0].header.frame_id, "r1/map");
        EXPECT_EQ(got.transforms[0].child_frame_id, "r1/odom");
        EXPECT_EQ(got.transforms[1].header.frame_id, "r1/odom");
        EXPECT_EQ(got.transforms[1].child_frame_id, "r1/base_link");
        EXPECT_LT(
            BodyOracle::distance(pose_of(got.transforms[0].transform), expected.of_base(report.estimate.map_from_odom)),
            1e-12);
        EXPECT_LT(BodyOracle::distance(pose_of(got.transforms[1].transform),
                                       expected.of_base(report.estimate.odom_from_camera)),
                  1e-12);
    }
    const auto map_from_camera = [](std::uint64_t number) {
        const PoseReport report = report_of(number);
        return compose(report.estimate.map_from_odom, report.estimate.odom_from_camera);
    };
    for (const auto& [number, got] : heard.poses) {
        EXPECT_NE(number % 6, 5U) << "a frame without a pose";
        EXPECT_EQ(got.header.time_ns(), report_of(number).estimate.time_ns);
        EXPECT_EQ(got.header.frame_id, "r1/map");
        EXPECT_LT(BodyOracle::distance(pose_of(got.pose), expected.of_base(map_from_camera(number))), 1e-12);
        EXPECT_LT(BodyOracle::difference(got.covariance, expected.in_parent(number, map_from_camera(number))), 1e-4);
    }

    const fast::Tf& fixed = heard.static_tf.front();
    ASSERT_EQ(fixed.transforms.size(), 2U);
    EXPECT_EQ(fixed.transforms[0].header.frame_id, "r1/base_link");
    EXPECT_EQ(fixed.transforms[0].child_frame_id, "r1/camera_link");
    EXPECT_LT(BodyOracle::distance(pose_of(fixed.transforms[0].transform), mount), 1e-12);
    EXPECT_EQ(fixed.transforms[1].header.frame_id, "r1/camera_link");
    EXPECT_EQ(fixed.transforms[1].child_frame_id, "r1/camera_color_optical_frame");
    EXPECT_EQ(fixed.transforms[1].transform.q, (std::array<double, 4>{-0.5, 0.5, -0.5, 0.5}));
    EXPECT_EQ(fixed.transforms[1].transform.p, (std::array<double, 3>{}));

    const fast::Path& path = heard.paths.back();
    EXPECT_EQ(path.header.frame_id, "r1/map");
    ASSERT_GE(path.poses.size(), 10U);
    std::int64_t last_ns = 0;
    for (const fast::PoseStamped& got : path.poses) {
        EXPECT_EQ(got.header.frame_id, "r1/map");
        EXPECT_GE(got.header.time_ns() - last_ns, 100'000'000 - kPeriod_ns);
        last_ns = got.header.time_ns();
        EXPECT_LT(BodyOracle::distance(pose_of(got.pose), expected.of_base(map_from_camera(frame_of(got.header)))),
                  1e-12);
    }

    for (const fast::DiagnosticArray& got : heard.diagnostics) {
        ASSERT_EQ(got.status.size(), 1U);
        const fast::DiagnosticStatus& status = got.status[0];
        std::map<std::string, std::string> values(status.values.begin(), status.values.end());
        const PoseReport report = report_of(std::stoull(values["frame"]));
        EXPECT_EQ(got.header.frame_id, "");
        EXPECT_GE(got.header.time_ns(), report.estimate.time_ns);
        EXPECT_EQ(status.name, "stillmesh: tracking");
        EXPECT_EQ(status.hardware_id, "stillmesh");
        EXPECT_EQ(values.size(), 10U);
        EXPECT_EQ(values["state"], pose_state_name(report.state));
        EXPECT_EQ(values["reason"], report.reason);
        EXPECT_EQ(values["map"], "1");
        EXPECT_EQ(values["features"], "1000");
        EXPECT_EQ(values["matches"], "400");
        EXPECT_EQ(values["inliers"], "300");
        EXPECT_EQ(values["moving"], values["frame"]);
        EXPECT_EQ(values["samples lost"], "0");
        EXPECT_EQ(values["last event"], "the camera was unplugged.");
        if (status.level == 3) continue;  // this test was stopped for a second
        const int level = report.state == PoseState::kTracked ? 0 : report.state == PoseState::kNone ? 2 : 1;
        EXPECT_EQ(status.level, level);
        const std::string why = report.state == PoseState::kUnsure ? ": rival motion" : "";
        EXPECT_EQ(status.message, pose_state_name(report.state) + why);
    }
}

// Promise: the map's points come as a cloud in ROS's map frame, all that stand still, when somebody subscribes; nothing
// is copied as long as nobody does.
TEST(RosPublisher, PointsOfTheMap) {
    const test::Sequence sequence = test::rendered("static_xyz", 3, 160, 120, 10);
    test::EngineRig engine(Limits::tiny(), sequence.camera);
    RosPublisher publisher;
    std::string message;
    RosOptions options;
    options.base_from_camera_link = BodyOracle(9).random_pose();
    ASSERT_TRUE(publisher.open(options, message)) << message;
    ASSERT_TRUE(publisher.points()->open(Limits::tiny(), message)) << message;
    test::run(*engine, sequence, 0, 10);
    std::uint64_t frame = 0;
    const auto give_frame = [&] {
        EXPECT_TRUE(publisher.frame(report_of(frame++)).empty());
        publisher.points()->work(*engine, true, 1000);
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    };
    bool was_copied = false;
    for (int i = 0; i < 150; ++i) {
        give_frame();
        was_copied = was_copied || publisher.points()->is_copying();
    }
    EXPECT_FALSE(was_copied);

    fast::Node node;
    fast::Node::Reader<fast::PointCloud> reader(node, "/stillmesh/points", {.is_reliable = false, .depth = 5});
    std::vector<fast::PointCloud> clouds;
    ASSERT_TRUE(within(kPatience_ms, [&] {
        give_frame();
        for (auto& cloud : reader.take()) clouds.push_back(cloud);
        return clouds.size() >= 2;
    }));
    BodyOracle oracle(1);
    oracle.set_mount(options.base_from_camera_link);
    std::vector<std::array<float, 3>> expected;
    const Pool<MapPoint>& points = test::map_of(*engine).points();
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (points.is_taken(slot) && is_static(&points.at(slot), 5)) {
            expected.push_back(oracle.point(points.at(slot).world));
        }
    }
    ASSERT_GT(expected.size(), 50U);
    for (const fast::PointCloud& cloud : clouds) {
        EXPECT_EQ(cloud.header.frame_id, "map");
        EXPECT_GE(frame_of(cloud.header), 0U);
        EXPECT_LT(frame_of(cloud.header), frame);
        EXPECT_EQ(cloud.height, 1U);
        ASSERT_EQ(cloud.width, expected.size());
        EXPECT_FALSE(cloud.is_bigendian);
        EXPECT_TRUE(cloud.is_dense);
        EXPECT_EQ(cloud.point_step, 12U);
        EXPECT_EQ(cloud.row_step, 12 * cloud.width);
        ASSERT_EQ(cloud.data.size(), cloud.row_step);
        ASSERT_EQ(cloud.fields.size(), 3U);
        for (std::uint32_t i = 0; i < 3; ++i) {
            EXPECT_EQ(cloud.fields[i].name, std::string(1, static_cast<char>('x' + i)));
            EXPECT_EQ(cloud.fields[i].offset, 4 * i);
            EXPECT_EQ(cloud.fields[i].datatype, 7U);  // FLOAT32
            EXPECT_EQ(cloud.fields[i].count, 1U);
        }
        for (std::size_t i = 0; i < expected.size(); ++i) {  // a map file has points in the order of their slots
            std::array<float, 3> got{};
            std::memcpy(got.data(), cloud.data.data() + 12 * i, 12);
            for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(got[k], expected[i][k], 1e-5F * (1 + std::abs(got[k])));
        }
    }
    EXPECT_EQ(publisher.close(), "");
}

// Promise: with all topics subscribed the engine's thread takes nothing from the heap for a frame. What a frame costs
// it is printed, with the map's points being copied.
TEST(RosPublisher, TheEnginesThreadCopiesAlone) {
    ASSERT_TRUE(test::heap_calls_are_counted());
    const test::Sequence sequence = test::rendered("static_xyz", 3, 160, 120, 10);
    test::EngineRig engine(Limits::tiny(), sequence.camera);
    test::run(*engine, sequence, 0, 10);
    RosPublisher publisher;
    std::string message;
    ASSERT_TRUE(publisher.open({}, message)) << message;
    ASSERT_TRUE(publisher.points()->open(Limits::tiny(), message)) << message;
    fast::Node node;
    Listeners listeners(node, "");
    ASSERT_TRUE(within(kPatience_ms, [&] { return listeners.are_matched(); }));
    std::vector<double> times_us;
    times_us.reserve(150);
    std::uint64_t heap_calls = 0;
    for (std::uint64_t frame = 0; frame < 150; ++frame) {
        const PoseReport report = report_of(frame);
        const std::uint64_t calls_before = test::heap_calls();
        const std::int64_t begin_ns = test::now_ns();
        const std::string said = publisher.frame(report);
        publisher.points()->work(*engine, true, 1000);
        times_us.push_back(static_cast<double>(test::now_ns() - begin_ns) * 1e-3);
        heap_calls += test::heap_calls() - calls_before;
        EXPECT_EQ(said, "");
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_EQ(heap_calls, 0U);
    std::sort(times_us.begin(), times_us.end());
    std::printf("engine's thread, us a frame: median %.1f, p99 %.1f\n", times_us[75], times_us[148]);
    EXPECT_EQ(publisher.close(), "");
}

// Promise: when no frame comes any more, the diagnostics say so: whoever reads only them hears that the pose is old.
TEST(RosPublisher, SilenceIsSaid) {
    RosPublisher publisher;
    std::string message;
    ASSERT_TRUE(publisher.open({}, message)) << message;
    fast::Node node;
    fast::Node::Reader<fast::DiagnosticArray> reader(node, "/diagnostics", {});
    EXPECT_TRUE(publisher.frame(report_of(0)).empty());
    bool is_stale = false;
    EXPECT_TRUE(within(kPatience_ms, [&] {
        for (const fast::DiagnosticArray& got : reader.take()) {
            is_stale = is_stale || (got.status.at(0).level == 3 && got.status[0].message.starts_with("no frame for "));
        }
        return is_stale;
    }));
}

// Promise: --no-tf sends neither transforms nor fixed ones, and all the rest.
TEST(RosPublisher, WithoutTf) {
    RosPublisher publisher;
    std::string message;
    RosOptions options;
    options.has_tf = false;
    ASSERT_TRUE(publisher.open(options, message)) << message;
    fast::Node node;
    fast::Node::Reader<fast::Odometry> odometry(node, "/odom", {});
    fast::Node::Reader<fast::Tf> tf(node, "/tf", {}), static_tf(node, "/tf_static", {.is_latched = true});
    std::uint64_t frame = 0;
    std::size_t heard = 0;
    ASSERT_TRUE(within(kPatience_ms, [&] {
        EXPECT_TRUE(publisher.frame(report_of(frame++)).empty());
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        heard += odometry.take().size();
        return heard > 30;
    }));
    EXPECT_FALSE(tf.is_matched());
    EXPECT_FALSE(static_tf.is_matched());
    EXPECT_TRUE(tf.take().empty());
}

}  // namespace
}  // namespace stillmesh::publisher_test

int main(int argc, char** argv) {
    stillmesh::test::enter_own_ros_domain();
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
