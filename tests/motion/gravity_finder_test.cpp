#include "platform/motion/gravity_finder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "platform/motion/accelerometer_file.hpp"
#include "platform/motion/simulated_accelerometer.hpp"

namespace stillmesh::gravity_finder_test {
namespace {

constexpr double kDegrees = 57.295779513082323;

// A camera in a hand: it goes to and fro by decimetres, turns, and trembles; the world's z axis is up.
TrajectoryPose hand_at(double t) {
    TrajectoryPose out;
    out.time_ns = static_cast<std::int64_t>(t * 1e9);
    out.t = {0.3 * std::sin(1.1 * t) + 0.001 * std::sin(15 * t), 0.25 * std::sin(0.8 * t + 1), 0.2 * std::sin(1.7 * t)};
    const Quaternion looks_ahead = product(quaternion_of({0, 0, 0.4 * std::sin(0.7 * t)}), quaternion_of({-1.7, 0, 0}));
    out.q = product(looks_ahead, quaternion_of({0.1 * std::sin(t), 0, 0.15 * std::sin(1.3 * t)}));
    return out;
}

struct Walk {
    std::vector<TrajectoryPose> in_map;  // as the camera is at 30 Hz, in the map of its first pose
    std::vector<Acceleration> readings;
    Triple up{};  // in the map
};

Walk walk(std::uint64_t seed, double seconds) {
    Walk out;
    SimulatedAccelerometer accelerometer(seed);
    const TrajectoryPose first = hand_at(0);
    out.up = rotated(conjugate(first.q), {0, 0, 1});
    for (int i = 0; i < static_cast<int>(seconds * 30); ++i) {
        const TrajectoryPose pose = hand_at(i / 30.0);
        if (accelerometer.step(pose)) out.readings.push_back(accelerometer.reading());
        out.in_map.push_back(moved_by({}, step_between(first, pose), pose.time_ns));
    }
    return out;
}

double degrees_between(const Triple& a, const Triple& b) {
    const double c = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return std::acos(std::clamp(c, -1.0, 1.0)) * kDegrees;
}

Gravity found(const Walk& w, const Quaternion& map_from_odom = {0, 0, 0, 1}) {
    GravityFinder finder;
    AccelerationList list;
    list.readings = w.readings;
    finder.begin(&list);
    for (const TrajectoryPose& pose : w.in_map) finder.add(pose, map_from_odom);
    return finder.gravity();
}

// Promise: up is found to a degree while a hand moves the camera, within twice the doubt that is told, whatever the
// bias; and turned with the map.
TEST(GravityFinder, UpInAHand) {
    const Quaternion turned = quaternion_of({0.3, -0.2, 0.5});
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        const Walk w = walk(seed, 8);
        const Gravity gravity = found(w);
        ASSERT_TRUE(gravity.is_known) << gravity.why_not;
        EXPECT_LT(degrees_between(gravity.up, w.up), 1.0) << seed;
        EXPECT_LT(degrees_between(gravity.up, w.up), 2 * gravity.doubt_rad * kDegrees) << seed;
        EXPECT_LT(gravity.doubt_rad * kDegrees, 2.0);
        EXPECT_GT(gravity.seconds, 7.0);
        EXPECT_LT(degrees_between(found(w, turned).up, rotated(turned, gravity.up)), 1e-4);
    }
}

// Promise: readings that are lost or rarer than frames cost little: of half of them, any, up is known alike, of most of
// the same time.
TEST(GravityFinder, UpWhereReadingsAreLost) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        Walk w = walk(seed, 8);
        std::uint64_t state = seed;
        std::erase_if(w.readings, [&](const Acceleration&) {
            state = state * 6364136223846793005U + 1442695040888963407U;
            return (state >> 33U) % 2 != 0;
        });
        const Gravity gravity = found(w);
        ASSERT_TRUE(gravity.is_known) << gravity.why_not;
        EXPECT_LT(degrees_between(gravity.up, w.up), 2 * gravity.doubt_rad * kDegrees) << seed;
        EXPECT_LT(degrees_between(gravity.up, w.up), 2.0) << seed;
        EXPECT_GT(gravity.seconds, 4.0) << seed;
    }
}

// Promise: what cannot be told is unknown, with the reason: too short, no readings in time, other axes, other units, a
// camera without poses.
TEST(GravityFinder, UnknownWithAReason) {
    const auto why = [](const Walk& w) {
        const Gravity gravity = found(w);
        EXPECT_FALSE(gravity.is_known);
        return gravity.why_not;
    };
    EXPECT_NE(why(walk(1, 2.5)).find("are needed"), std::string::npos);
    Walk w = walk(1, 8);
    for (Acceleration& reading : w.readings) reading.time_ns += 3600'000'000'000;
    EXPECT_NE(why(w).find("clock"), std::string::npos);
    w = walk(1, 8);
    for (Acceleration& reading : w.readings) std::swap(reading.m_s2[0], reading.m_s2[1]);
    EXPECT_NE(why(w).find("axes"), std::string::npos) << why(w);
    w = walk(1, 8);
    for (Acceleration& reading : w.readings) {
        for (double& value : reading.m_s2) value /= 9.81;
    }
    EXPECT_NE(why(w).find("m/s^2"), std::string::npos);
    w = walk(1, 8);
    GravityFinder finder;
    AccelerationList list;
    list.readings = w.readings;
    finder.begin(&list);
    for (const TrajectoryPose& pose : w.in_map) {
        finder.add(pose, {0, 0, 0, 1});
        finder.add_nothing();
    }
    EXPECT_FALSE(finder.gravity().is_known);
}

// Promise: of what is known beforehand those after one moment and not after another are given, in order; between a
// moment and an earlier one there is nothing.
TEST(GravityFinder, ReadingsBetween) {
    AccelerationList list;
    for (const std::int64_t time_ns : {10, 20, 20, 30, 50}) list.readings.push_back({time_ns, {}});
    std::vector<Acceleration> out(7);
    const auto times = [&](std::int64_t after_ns, std::int64_t to_ns) {
        list.between(after_ns, to_ns, out);
        std::vector<std::int64_t> all;
        for (const Acceleration& reading : out) all.push_back(reading.time_ns);
        return all;
    };
    using Times = std::vector<std::int64_t>;
    EXPECT_EQ(times(10, 30), (Times{20, 20, 30}));
    EXPECT_EQ(times(0, 10), Times{10});
    EXPECT_EQ(times(30, 49), Times{});
    EXPECT_EQ(times(30, 1000), Times{50});
    EXPECT_EQ(times(50, 10), Times{});
    list.readings.clear();
    EXPECT_EQ(times(0, 100), Times{});
}

// Promise: the level frame has z where up is, x where the camera looks, level, and stays right-handed, whichever way
// the camera looks.
TEST(GravityFinder, LevelFrame) {
    for (const Triple& axis : {Triple{0, -1, 0}, Triple{0.2, -0.9, -0.4}, Triple{0, 0, -1}, Triple{0.6, 0.7, 0.1}}) {
        const Triple up = {axis[0] / length_of(axis), axis[1] / length_of(axis), axis[2] / length_of(axis)};
        const RigidTransform level = level_from_up(up);
        const double* const r = level.rotation_xyzw;
        const Quaternion q = {r[0], r[1], r[2], r[3]};
        const Triple z = rotated(q, up);
        EXPECT_NEAR(z[0], 0, 1e-12);
        EXPECT_NEAR(z[1], 0, 1e-12);
        EXPECT_NEAR(z[2], 1, 1e-12);
        const Triple ahead = rotated(q, Triple{0, 0, 1});
        EXPECT_NEAR(ahead[1], 0, 1e-12);
        EXPECT_GE(ahead[0], -1e-12);
    }
}

// Promise: a file says what it is, and which line is none.
TEST(AccelerometerFile, ReadsAndRefuses) {
    std::vector<Acceleration> readings;
    std::string message;
    ASSERT_EQ(parse_accelerometer("# c\n1.5 0.1 -9.8 +0.2\n1.6 0 -9.7 0\n", "a.txt", readings, message), Status::kOk);
    ASSERT_EQ(readings.size(), 2U);
    EXPECT_EQ(readings[0].time_ns, 1'500'000'000);
    EXPECT_EQ(readings[0].m_s2, (Triple{0.1, -9.8, 0.2}));
    for (const char* const text :
         {"1 0 0\n2 0 0 0\n", "1 0 0 x\n2 0 0 0\n", "2 0 0 0\n1 0 0 0\n", "1 0 0 0\n", "1 0 0 5000\n2 0 0 0\n"}) {
        EXPECT_EQ(parse_accelerometer(text, "a.txt", readings, message), Status::kInvalid);
        EXPECT_NE(message.find("a.txt"), std::string::npos);
        EXPECT_NE(message.find("ax ay az"), std::string::npos) << message;
    }
}

}  // namespace
}  // namespace stillmesh::gravity_finder_test
