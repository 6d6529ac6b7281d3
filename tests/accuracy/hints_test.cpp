#include "bench/accuracy/hints.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stillmesh::accuracy::hints_test {
namespace {

// The camera goes forward by a centimetre a frame.
TrajectoryPose pose(int i) {
    return {i * std::int64_t{33'333'333}, {0, 0, 0.01 * i}, {0, 0, 0, 1}};
}

struct Told {
    bool is_any = false;
    MotionHint hint;
};
// What a kind says in this second of the way.
Told told(const char* name, double second) {
    HintMaker maker(hint_kind(name), 1);
    EXPECT_EQ(maker.hint(pose(0), 0), nullptr);
    const MotionHint* const hint = maker.hint(pose(1), second);
    return hint == nullptr ? Told{} : Told{true, *hint};
}

// Promise: each kind says what its name does: wheels the way, a gyroscope the turn alone, both both.
TEST(AccuracyHints, KindsSayWhatTheyAre) {
    EXPECT_FALSE(HintMaker(nullptr, 1).hint(pose(0), 0));
    EXPECT_EQ(hint_kind("walking"), nullptr);
    EXPECT_NEAR(told("wheels", 3).hint.last_from_camera.translation_m[2], 0.01, 0.0015);
    EXPECT_GT(told("wheels", 3).hint.sigma_m, 0);
    EXPECT_LT(told("gyro", 3).hint.sigma_m, 0);
    EXPECT_GT(told("gyro", 3).hint.sigma_rad, 0);
    EXPECT_EQ(told("both", 3).hint.sigma_rad, told("gyro", 3).hint.sigma_rad);
    EXPECT_EQ(told("both", 3).hint.sigma_m, told("wheels", 3).hint.sigma_m);
    EXPECT_EQ(told("wheels5", 3).hint.sigma_m, told("wheels", 3).hint.sigma_m);  // and errs by more
}

// Promise: wheels that slip stand, or run on, in the seconds of their kind, and are as sure as ever.
TEST(AccuracyHints, SlipsHaveTheirTime) {
    const auto way = [](const char* name, double second) {
        return told(name, second).hint.last_from_camera.translation_m[2];
    };
    for (const double second : {2.0, 3.9}) EXPECT_EQ(way("slip", second), 0);
    EXPECT_EQ(way("slip1", 0.5), 0);
    EXPECT_EQ(way("slip", 5.5), 0.01);
    for (const double second : {0.5, 4.5, 7.0}) EXPECT_EQ(way("slip", second), way("wheels", second));
    EXPECT_EQ(way("slip1", 1.5), way("wheels", 1.5));
    EXPECT_LT(told("slip", 3).hint.sigma_m, told("wheels", 3).hint.sigma_m);
}

}  // namespace
}  // namespace stillmesh::accuracy::hints_test
