#include "platform/poses/pose_line.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

namespace stillmesh::pose_line_test {
namespace {

using Json = nlohmann::json;

[[nodiscard]] RigidTransform any_pose(std::mt19937& random) {
    std::normal_distribution<double> normal;
    RigidTransform pose;
    double norm = 0;
    for (double& q : pose.rotation_xyzw) {
        q = normal(random);
        norm += q * q;
    }
    for (double& q : pose.rotation_xyzw) q /= std::sqrt(norm);
    for (double& t : pose.translation_m) t = 3 * normal(random);
    return pose;
}

// A point through a pose, by the rotation's matrix.
[[nodiscard]] std::array<double, 3> through(const std::vector<double>& q, const std::vector<double>& t,
                                            const std::array<double, 3>& p) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    return {(1 - 2 * (y * y + z * z)) * p[0] + 2 * (x * y - z * w) * p[1] + 2 * (x * z + y * w) * p[2] + t[0],
            2 * (x * y + z * w) * p[0] + (1 - 2 * (x * x + z * z)) * p[1] + 2 * (y * z - x * w) * p[2] + t[1],
            2 * (x * z - y * w) * p[0] + 2 * (y * z + x * w) * p[1] + (1 - 2 * (x * x + y * y)) * p[2] + t[2]};
}
[[nodiscard]] std::array<double, 3> through(const Json& pose, const std::array<double, 3>& p) {
    return through(pose["q"].get<std::vector<double>>(), pose["p"].get<std::vector<double>>(), p);
}

// Promise: every number that the engine gave is in the line to the bit, and map_from_camera is the product of the two
// others.
TEST(PoseLine, SaysAllToTheBit) {
    std::mt19937 random(1);
    PoseLines lines;
    std::string line;
    for (int i = 0; i < 200; ++i) {
        PoseReport report;
        report.frame = 7 + static_cast<std::uint64_t>(i);
        report.state = PoseState::kUnsure;
        report.reason = "rival motion";
        report.map = 2;
        report.keyframe = 3;
        report.estimate.time_ns = 1'305'031'102'175'304'001 + std::int64_t{i} * 33'333'333;
        report.estimate.odom_from_camera = any_pose(random);
        report.estimate.map_from_odom = any_pose(random);
        for (double& c : report.estimate.covariance) c = std::normal_distribution<double>(0, 1e-5)(random);
        report.statistics.features = 1000;
        report.statistics.matches = 400;
        report.statistics.static_matches = 300;
        report.statistics.dynamic_matches = 50;
        report.statistics.is_keyframe = i % 2 == 0;
        lines.pose(report, line);
        ASSERT_EQ(line.back(), '\n');
        ASSERT_LT(line.size(), 4096U);  // goes into a pipe whole or not at all
        const Json json = Json::parse(line);
        EXPECT_EQ(json["schema"], 1);
        EXPECT_EQ(json["type"], "pose");
        EXPECT_EQ(json["time_ns"].get<std::int64_t>(), report.estimate.time_ns);
        EXPECT_NE(line.find("\"time\":1305031"), std::string::npos) << line;
        EXPECT_EQ(json["frame"], report.frame);
        EXPECT_EQ(json["state"], "unsure");
        EXPECT_EQ(json["reason"], "rival motion");
        EXPECT_EQ(json["map"], 2);
        EXPECT_EQ(json["keyframe"], 3);
        EXPECT_EQ(json["is_keyframe"], i % 2 == 0);
        EXPECT_EQ(json["features"], 1000);
        EXPECT_EQ(json["matches"], 400);
        EXPECT_EQ(json["inliers"], 300);
        EXPECT_EQ(json["moving"], 50);
        for (std::size_t k = 0; k < 36; ++k) {
            EXPECT_EQ(json["covariance"][k].get<double>(), report.estimate.covariance[k]);
        }
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_EQ(json["odom_from_camera"]["q"][k].get<double>(),
                      report.estimate.odom_from_camera.rotation_xyzw[k]);
            EXPECT_EQ(json["map_from_odom"]["q"][k].get<double>(), report.estimate.map_from_odom.rotation_xyzw[k]);
        }
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_EQ(json["odom_from_camera"]["p"][k].get<double>(),
                      report.estimate.odom_from_camera.translation_m[k]);
        }
        const std::array<double, 3> point{0.3, -1.2, 2.5};
        const auto one = through(json["map_from_camera"], point);
        const auto two = through(json["map_from_odom"], through(json["odom_from_camera"], point));
        for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(one[k], two[k], 1e-12);
    }
}

// Promise: the velocity carries one pose to the next: the way, and a turn at that rate for the time between the frames.
TEST(PoseLine, VelocityCarriesOnePoseToTheNext) {
    std::mt19937 random(2);
    std::string line;
    for (int i = 0; i < 100; ++i) {
        PoseLines lines;
        PoseReport report;
        report.state = PoseState::kTracked;
        report.estimate.time_ns = 1'000'000'000;
        const RigidTransform first = any_pose(random);
        report.estimate.odom_from_camera = first;
        lines.pose(report, line);
        EXPECT_TRUE(Json::parse(line)["velocity"].is_null());
        EXPECT_TRUE(Json::parse(line)["reason"].is_null());
        // The second pose is made from a rate in the camera's frame.
        const double seconds = 0.04;
        std::array<double, 3> rate{}, way{};
        for (double& r : rate) r = std::normal_distribution<double>(0, 2)(random);
        for (double& w : way) w = std::normal_distribution<double>(0, 0.5)(random);
        const double speed = std::sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]);
        const double half = speed * seconds / 2;
        const double s = std::sin(half) / speed;
        const double d[4] = {rate[0] * s, rate[1] * s, rate[2] * s, std::cos(half)};
        const auto [x, y, z, w] = first.rotation_xyzw;
        RigidTransform& second = report.estimate.odom_from_camera;
        second.rotation_xyzw[0] = w * d[0] + x * d[3] + y * d[2] - z * d[1];
        second.rotation_xyzw[1] = w * d[1] - x * d[2] + y * d[3] + z * d[0];
        second.rotation_xyzw[2] = w * d[2] + x * d[1] - y * d[0] + z * d[3];
        second.rotation_xyzw[3] = w * d[3] - x * d[0] - y * d[1] - z * d[2];
        if (i % 2 == 0) {
            for (double& q : second.rotation_xyzw) q = -q;  // the same rotation
        }
        // The way in the frame of the second camera.
        const std::vector<double> q(second.rotation_xyzw, second.rotation_xyzw + 4);
        const auto moved = through(q, {0, 0, 0}, {way[0] * seconds, way[1] * seconds, way[2] * seconds});
        for (std::size_t k = 0; k < 3; ++k) second.translation_m[k] = first.translation_m[k] + moved[k];
        report.estimate.time_ns += 40'000'000;
        lines.pose(report, line);
        const Json velocity = Json::parse(line)["velocity"];
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_NEAR(velocity["angular"][k].get<double>(), rate[k], 1e-9);
            EXPECT_NEAR(velocity["linear"][k].get<double>(), way[k], 1e-9);
        }
    }
}

// Promise: what there is not is null: no pose without a state, no covariance of what was not measured, no velocity
// behind a gap, no number that is not finite; and a sentence with anything in it stays one line of JSON.
TEST(PoseLine, WhatThereIsNotIsNull) {
    PoseLines lines;
    std::string line;
    PoseReport report;
    report.estimate.time_ns = 1;
    report.state = PoseState::kNone;
    lines.pose(report, line);
    Json json = Json::parse(line);
    EXPECT_TRUE(json["map_from_camera"].is_null());
    EXPECT_TRUE(json["odom_from_camera"].is_null());
    EXPECT_TRUE(json["covariance"].is_null());
    EXPECT_TRUE(json["keyframe"].is_null());
    report.state = PoseState::kPredicted;
    report.estimate.time_ns = 2;
    lines.pose(report, line);
    json = Json::parse(line);
    EXPECT_TRUE(json["map_from_camera"].is_object());
    EXPECT_TRUE(json["covariance"].is_null());
    EXPECT_TRUE(json["velocity"].is_null());
    report.state = PoseState::kUnsure;
    report.estimate.covariance[7] = std::numeric_limits<double>::infinity();
    lines.pose(report, line);
    EXPECT_TRUE(Json::parse(line)["covariance"][7].is_null());
    lines.event(3, "a \"quoted\"\nline \x01 and \xff bytes", line);
    EXPECT_EQ(line.find('\n'), line.size() - 1);
    EXPECT_EQ(Json::parse(line)["type"], "event");
    EXPECT_EQ(Json::parse(line)["sentence"].get<std::string>().find("a \"quoted\"\nline"), 0U);
}

}  // namespace
}  // namespace stillmesh::pose_line_test
