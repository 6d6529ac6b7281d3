#include "engine/geometry/view_distance.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/geometry/turn_distance.hpp"

namespace stillmesh::view_distance_test {
namespace {

SE3 at(const Vector3& place, const Vector3& turn_rad) {
    SE3 out;
    out.rotation = so3_exp(turn_rad);
    out.translation = place;
    return out;
}

// Promise: without a turn the distance is that between the cameras; a turn of the axis by an angle a adds
// 2 sqrt(1 - cos a) m as the other side of a right angle; a turn about the axis adds nothing; both ways are as far, and
// where the world's origin is does not matter.
TEST(ViewDistance, TurnsCountBesideMetres) {
    const SE3 here = at({1, 2, 3}, {0.3, -0.2, 0.1});
    for (const double turn_rad : {0.0, 0.1, 1.0, 3.0}) {
        for (const double away_m : {0.0, 0.5, 2.0}) {
            const double want = away_m * away_m + kTurn_m2 * (1 - std::cos(turn_rad));
            SE3 there = here * at({0, 0, away_m}, Vector3(turn_rad, 0, 0));
            EXPECT_NEAR(view_distance_m2(here, there), want, 1e-12);
            EXPECT_NEAR(view_distance_m2(there, here), want, 1e-12);
            there = there * at(Vector3::Zero(), {0, 0, 1.2});
            EXPECT_NEAR(view_distance_m2(here, there), want, 1e-12) << "turned about its axis";
            const SE3 moved = at({-4, 5, 6}, {1, 1, 1});
            EXPECT_NEAR(view_distance_m2(moved * here, moved * there), want, 1e-12);
        }
    }
}

// Promise: ten degrees are as far as a quarter of a metre, sixty as 1.4 m.
TEST(ViewDistance, WhatATurnCounts) {
    const SE3 here;
    EXPECT_NEAR(std::sqrt(view_distance_m2(here, at(Vector3::Zero(), {0, 0.1745, 0}))), 0.25, 0.005);
    EXPECT_NEAR(std::sqrt(view_distance_m2(here, at(Vector3::Zero(), {0, 1.0472, 0}))), 1.41, 0.01);
}

}  // namespace
}  // namespace stillmesh::view_distance_test
