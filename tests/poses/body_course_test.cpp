// A body from frame to frame.
#include "platform/poses/body_course.hpp"

#include <gtest/gtest.h>

namespace stillmesh::body_course_test {
namespace {

constexpr double kVariance = 1e-6;

// Forward by 2 cm each tenth of a second: the camera's z.
PoseReport report_at(int tenth, PoseState state) {
    PoseReport report;
    report.state = state;
    report.estimate.time_ns = std::int64_t{tenth} * 100'000'000;
    report.estimate.odom_from_camera.translation_m[2] = 0.02 * tenth;
    for (std::size_t i = 0; i < 6; ++i) report.estimate.covariance[7 * i] = kVariance;
    return report;
}

// Promise: between two frames with a pose the velocity is that of the body, as uncertain as both poses are; before the
// second, behind a frame without a pose and in another map there is none.
TEST(BodyCourse, GoesFromPoseToPose) {
    BodyCourse course{BodyFrames()};
    EXPECT_FALSE(course.follow(report_at(1, PoseState::kTracked)).is_next);
    const BodyStep step = course.follow(report_at(2, PoseState::kTracked));
    ASSERT_TRUE(step.is_next);
    EXPECT_NEAR(step.velocity.linear_m_s[0], 0.2, 1e-9);
    EXPECT_NEAR(step.velocity.linear_m_s[2], 0, 1e-9);
    EXPECT_NEAR(step.covariance[0], kVariance, 1e-12);
    EXPECT_NEAR(step.velocity_covariance[0], 2 * kVariance / 0.01, 1e-9);
    EXPECT_FALSE(course.follow(report_at(3, PoseState::kNone)).is_next);
    EXPECT_FALSE(course.follow(report_at(4, PoseState::kTracked)).is_next);
    PoseReport elsewhere = report_at(5, PoseState::kTracked);
    elsewhere.map = 2;
    EXPECT_FALSE(course.follow(elsewhere).is_next);
    EXPECT_FALSE(course.follow(elsewhere).is_next) << "no time has passed";
}

// Promise: what is only predicted is as uncertain as the last pose that was measured, and more with each frame.
TEST(BodyCourse, DoubtGrowsFromTheLastMeasurement) {
    BodyCourse course{BodyFrames()};
    static_cast<void>(course.follow(report_at(1, PoseState::kTracked)));
    PoseReport predicted = report_at(2, PoseState::kPredicted);
    predicted.estimate.covariance[0] = 1e3;
    EXPECT_NEAR(course.follow(predicted).covariance[0], kVariance + 0.15 * 0.15, 1e-12);
    EXPECT_NEAR(course.follow(report_at(3, PoseState::kPredicted)).covariance[0], kVariance + 0.2 * 0.2, 1e-12);
    EXPECT_NEAR(course.follow(report_at(4, PoseState::kUnsure)).covariance[0], kVariance + 0.1 * 0.1, 1e-12);
    EXPECT_NEAR(course.follow(report_at(5, PoseState::kTracked)).covariance[0], kVariance, 1e-12);
}

}  // namespace
}  // namespace stillmesh::body_course_test
