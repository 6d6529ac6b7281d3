#include "engine/tracking/pose_confidence.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "tests/support/synthetic.hpp"

namespace stillmesh::pose_confidence_test {
namespace {

constexpr std::int64_t kFrame_ns = 33'333'333;
constexpr std::int64_t kSecond = 1'000'000'000;

Matrix6 information_of(double sigma_m, double sigma_rad) {
    Matrix6 out = Matrix6::Zero();
    for (int i = 0; i < 6; ++i) out(i, i) = i < 3 ? 1 / (sigma_m * sigma_m) : 1 / (sigma_rad * sigma_rad);
    return out;
}

// Symmetric and positive definite, its inverse well below a metre.
Matrix6 random_information(Random& random) {
    Matrix6 root;
    for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) root(i, j) = random.normal();
    }
    Matrix6 out = root * root.transpose();
    for (int i = 0; i < 6; ++i) out(i, i) += 1;
    return out * 1e5;
}

double largest(const Matrix6& m) {
    return m.cwiseAbs().maxCoeff();
}

SE3 motion_of(double metres, double radians) {
    SE3 out;
    out.rotation = so3_exp(Vector3(0, 0.6 * radians, 0.8 * radians));
    out.translation = Vector3(0.8 * metres, 0, -0.6 * metres);
    return out;
}

class Confidence : public testing::Test {
protected:
    Confidence() { start({}); }
    void start(const Parameters& parameters) {
        parameters_ = parameters;
        confidence_ = PoseConfidence{};
        confidence_.create(parameters_);
        confidence_.reset();
    }
    Parameters parameters_;
    PoseConfidence confidence_;
};

// Promise: without drift of the map the covariance is the inverse of what the frame measured, wherever the camera is.
TEST_F(Confidence, IsWhatTheFrameMeasured) {
    Random random(1);
    for (int round = 0; round < 20; ++round) {
        const Matrix6 information = random_information(random);
        ASSERT_TRUE(confidence_.measured(round * kFrame_ns, test::random_motion(random, 5, 2), information));
        EXPECT_LT(largest(information * confidence_.covariance() - Matrix6::Identity()), 1e-9);
    }
}

// Promise: information that is singular, or not that of a pose, measures nothing and changes nothing.
TEST_F(Confidence, SingularMeasuresNothing) {
    Random random(2);
    ASSERT_TRUE(confidence_.measured(0, SE3{}, random_information(random)));
    const Matrix6 before = confidence_.covariance();
    Matrix6 singular = information_of(0.01, 0.01);
    singular(2, 2) = 0;
    EXPECT_FALSE(confidence_.measured(kFrame_ns, SE3{}, singular));
    EXPECT_FALSE(confidence_.measured(kFrame_ns, SE3{}, Matrix6::Zero()));
    EXPECT_FALSE(confidence_.measured(kFrame_ns, SE3{}, information_of(0.01, 0.01) * -1.0));
    EXPECT_FALSE(confidence_.measured(kFrame_ns, SE3{}, information_of(std::nan(""), 0.01)));
    EXPECT_EQ(largest(confidence_.covariance() - before), 0);
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
}

// Promise: a keyframe that renews a share of the map leaves that share of the covariance it was measured with in the
// map, once; seen from another camera it is carried there by the adjoint. The sum stays symmetric and positive, and
// only grows.
TEST_F(Confidence, DriftGrowsWithWhatIsRenewed) {
    Random random(3);
    Matrix6 map = Matrix6::Zero();  // left increments
    for (int round = 0; round < 30; ++round) {
        const SE3 pose = test::random_motion(random, 3, 2);
        const Matrix6 information = random_information(random);
        Matrix6 measured;
        ASSERT_TRUE(invert_spd(information, measured));
        const double share = round % 3 == 0 ? random.uniform() : 0;
        if (share > 0) confidence_.set_renewed_share(share);
        ASSERT_TRUE(confidence_.measured(round * kFrame_ns, pose, information));
        const Matrix6 to_world = se3_adjoint(pose);
        map += to_world * measured * to_world.transpose() * share;
        const Matrix6 to_camera = se3_adjoint(pose.inverse());
        const Matrix6 expected = to_camera * map * to_camera.transpose() + measured;
        const Matrix6& covariance = confidence_.covariance();
        EXPECT_LT(largest(covariance - expected), 1e-9 * largest(expected)) << round;
        EXPECT_LT(largest(covariance - covariance.transpose()), 1e-12 * largest(covariance));
        Matrix6 inverse, grown = covariance - measured * (1 - 1e-9);
        EXPECT_TRUE(invert_spd(covariance, inverse));
        EXPECT_TRUE(invert_spd(grown, inverse)) << "never surer than this frame alone";
    }
}

// Promise: a map that is begun, or entered, has not drifted; what a keyframe renewed before counts no more.
TEST_F(Confidence, BeginsWithoutDrift) {
    const Matrix6 information = information_of(0.01, 0.02);
    Matrix6 measured;
    ASSERT_TRUE(invert_spd(information, measured));
    for (const bool is_entered : {true, false}) {
        confidence_.set_renewed_share(1);
        ASSERT_TRUE(confidence_.measured(0, SE3{}, information));
        EXPECT_GT(largest(confidence_.covariance() - measured), 0.9 * largest(measured));
        confidence_.set_renewed_share(1);
        is_entered ? confidence_.begin_in_map() : confidence_.reset();
        ASSERT_TRUE(confidence_.measured(kFrame_ns, SE3{}, information));
        EXPECT_LT(largest(confidence_.covariance() - measured), 1e-12);
    }
    confidence_.set_renewed_share(1);
    confidence_.reset();
    EXPECT_EQ(largest(confidence_.covariance()), 0);
    ASSERT_TRUE(confidence_.measured(2 * kFrame_ns, SE3{}, information));
    EXPECT_LT(largest(confidence_.covariance() - measured), 1e-12);
}

// Promise: the motion is sure up to sure_sigma_m metres and radians, all axes together, and not beyond.
TEST_F(Confidence, SureUpToTheThresholds) {
    Parameters parameters;
    for (const double sure : {0.01, 0.05}) {
        parameters.pose.sure_sigma_m = sure;
        const auto is_sure = [&](double share_m, double share_rad) {
            start(parameters);
            // Three axes make a deviation sqrt(3) times one axis'.
            EXPECT_TRUE(confidence_.measured(
                0, SE3{}, information_of(share_m * sure / std::sqrt(3.0), share_rad * sure / std::sqrt(3.0))));
            return confidence_.motion_doubt() == UnsureReason::kNone;
        };
        EXPECT_TRUE(is_sure(0.999, 0.999));
        EXPECT_FALSE(is_sure(1.001, 0.5));
        EXPECT_FALSE(is_sure(0.5, 1.001));
    }
}

// Promise: what keyframes renewed during the last second adds to the doubt, and is forgotten after it.
TEST_F(Confidence, DoubtLastsASecond) {
    Parameters parameters;
    parameters.pose.sure_sigma_m = 0.03;
    start(parameters);
    const double sigma_m = 0.02 / std::sqrt(3.0);  // twice its variance is within the threshold, thrice is not
    const auto measure = [&](std::int64_t time_ns, double share) {
        confidence_.set_renewed_share(share);
        EXPECT_TRUE(confidence_.measured(time_ns, SE3{}, information_of(sigma_m, 0.001)));
        return confidence_.motion_doubt() == UnsureReason::kNone;
    };
    EXPECT_TRUE(measure(kSecond, 0));
    EXPECT_TRUE(measure(kSecond + kFrame_ns, 1)) << "this frame's variance, and what it put into the map";
    EXPECT_FALSE(measure(kSecond + 2 * kFrame_ns, 1));
    EXPECT_FALSE(measure(kSecond + 3 * kFrame_ns, 0));
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kRenewed);
    EXPECT_FALSE(measure(2 * kSecond, 0));
    EXPECT_TRUE(measure(2 * kSecond + 4 * kFrame_ns, 0));
    EXPECT_TRUE(measure(2 * kSecond + 5 * kFrame_ns, 1));
    EXPECT_FALSE(measure(2 * kSecond + 6 * kFrame_ns, 1));
    confidence_.reset();
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
    EXPECT_TRUE(measure(2 * kSecond + 7 * kFrame_ns, 1)) << "and with all else";
}

// Promise: a jump is doubted by what is beyond jump_sigmas of what was expected, translation and rotation apart.
TEST_F(Confidence, JumpsAreDoubtedBeyondWhatWasExpected) {
    Parameters parameters;
    const SE3 expected = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
    const MotionPrior prior{expected, 0.01, 0.02};
    for (const double sigmas : {0.0, 2.0, 5.0}) {
        parameters.prediction.jump_sigmas = sigmas;
        parameters.pose.sure_sigma_m = 0.05;
        const auto is_sure = [&](double off_m, double off_rad) {
            start(parameters);
            confidence_.doubt_jump(kSecond, prior, expected * motion_of(off_m, off_rad));
            EXPECT_TRUE(confidence_.measured(kSecond, SE3{}, information_of(1e-5, 1e-5)));
            return confidence_.motion_doubt() == UnsureReason::kNone;
        };
        EXPECT_TRUE(is_sure(sigmas * 0.01 + 0.0499, sigmas * 0.02 + 0.0499)) << sigmas;
        EXPECT_FALSE(is_sure(sigmas * 0.01 + 0.0501, 0)) << sigmas;
        EXPECT_FALSE(is_sure(0, sigmas * 0.02 + 0.0501)) << sigmas;
        EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kJump);
        // After a second it is forgotten.
        EXPECT_TRUE(confidence_.measured(2 * kSecond + kFrame_ns, SE3{}, information_of(1e-5, 1e-5)));
        EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
    }
}

// Promise: where another motion was tenable, farther off than what is sure, the last second is doubted, and no longer.
TEST_F(Confidence, AContestIsDoubtedForASecond) {
    Parameters parameters;
    const SE3 chosen = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
    parameters.pose.sure_sigma_m = 0.03;
    const auto doubt_of = [&](double apart_m, double apart_rad) {
        start(parameters);
        confidence_.doubt_contest(kSecond, chosen, chosen * motion_of(apart_m, apart_rad));
        EXPECT_TRUE(confidence_.measured(kSecond, chosen, information_of(1e-5, 1e-5)));
        return confidence_.motion_doubt();
    };
    EXPECT_EQ(doubt_of(0.0299, 0.0299), UnsureReason::kNone);
    EXPECT_EQ(doubt_of(0.0301, 0), UnsureReason::kRival);
    EXPECT_EQ(doubt_of(0, 0.0301), UnsureReason::kRival);
    EXPECT_TRUE(confidence_.measured(2 * kSecond - kFrame_ns, chosen, information_of(1e-5, 1e-5)));
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kRival);
    EXPECT_TRUE(confidence_.measured(2 * kSecond + kFrame_ns, chosen, information_of(1e-5, 1e-5)));
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
    // Many of them that are near are no more than one.
    for (int i = 0; i < 20; ++i)
        confidence_.doubt_contest(3 * kSecond + i, chosen, chosen * se3_exp(Vector6::Constant(0.01)));
    EXPECT_TRUE(confidence_.measured(3 * kSecond + 20, chosen, information_of(1e-5, 1e-5)));
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
    EXPECT_EQ(doubt_of(0.0301, 0), UnsureReason::kRival);
    confidence_.reset();
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
}

// Promise: unsure poses that left the line between two sure ones make the second behind them unsure; those
// that kept to the line do not.
TEST_F(Confidence, AStrayedStretchIsDoubtedForASecond) {
    const Matrix6 precise = information_of(1e-5, 1e-5);
    // Three frames in between, the second `off_m` aside; the doubt of the sure one behind them.
    std::int64_t since_ns = kNoTime;
    const auto doubt_of = [&](double off_m, PoseState third, const Parameters& parameters) {
        start(parameters);
        const auto follow = [&](int frame, double aside_m, PoseState state) {
            since_ns = confidence_.follow_path(kSecond + frame * kFrame_ns, Vector3(0.01 * frame, aside_m, 0), state);
            EXPECT_TRUE(confidence_.measured(kSecond + frame * kFrame_ns, SE3{}, precise));
        };
        follow(0, 0, PoseState::kTracked);
        follow(1, 0, PoseState::kUnsure);
        follow(2, off_m, PoseState::kPredicted);
        follow(3, 0, third);
        EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
        follow(4, 0, PoseState::kTracked);
        return confidence_.motion_doubt();
    };
    EXPECT_EQ(doubt_of(0.0299, PoseState::kUnsure, {}), UnsureReason::kNone);
    EXPECT_EQ(doubt_of(0.0301, PoseState::kNone, {}), UnsureReason::kJump);
    EXPECT_EQ(since_ns, kNoTime);  // who knows where the camera was without a pose
    EXPECT_EQ(doubt_of(0.0301, PoseState::kUnsure, {}), UnsureReason::kJump);
    EXPECT_EQ(since_ns, kSecond);
    const std::int64_t end_ns = kSecond + 4 * kFrame_ns;
    EXPECT_TRUE(confidence_.measured(end_ns + kSecond, SE3{}, precise));
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kJump);
    EXPECT_TRUE(confidence_.measured(end_ns + kSecond + 1, SE3{}, precise));
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
    Parameters off;
    off.pose.stray_m = 1000;
    EXPECT_EQ(doubt_of(0.0301, PoseState::kUnsure, off), UnsureReason::kNone);
    EXPECT_EQ(doubt_of(0.0301, PoseState::kUnsure, {}), UnsureReason::kJump);
    confidence_.reset();
    EXPECT_EQ(confidence_.motion_doubt(), UnsureReason::kNone);
}

// Promise: a pose that was not measured is less sure by its deviations, for as many frames as passed, at least one, and
// never surer again without a measurement.
TEST_F(Confidence, PredictionAddsItsDeviations) {
    ASSERT_TRUE(confidence_.measured(0, SE3{}, information_of(0.01, 0.02)));
    Matrix6 expected = confidence_.covariance();
    for (const std::uint32_t frames : {0U, 1U, 2U, 5U}) {
        confidence_.predicted(frames, 0.03, 0.04);
        for (int i = 0; i < 6; ++i) expected(i, i) += (frames == 0 ? 1 : frames) * (i < 3 ? 0.0009 : 0.0016);
        EXPECT_LT(largest(confidence_.covariance() - expected), 1e-12) << frames;
    }
}

}  // namespace
}  // namespace stillmesh::pose_confidence_test
