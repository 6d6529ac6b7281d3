#include "engine/pose/row_turn.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tests/support/synthetic.hpp"

namespace stillmesh::row_turn_test {
namespace {

constexpr double kChi2Max = 11.34;
constexpr double kPixelsPerRay = 525.0 / 480;  // of the picture's height
constexpr test::Noise kNoise = {.pixel = 1e-3, .depth_m = 2e-3, .map_m = 5e-4};
const SE3 kPose = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());

void turn_rows(std::vector<Correspondence>& matches, const Vector3& by) {
    Vector6 sweep = Vector6::Zero();
    sweep.tail<3>() = by;
    for (Correspondence& c : matches) {
        const Vector3 p = moved_a_little(sweep * c.row, c.p_camera);
        c.normalised = Vector2(p.x() / p.z(), p.y() / p.z());
        c.p_camera = p;
    }
}

// What a camera at kPose in its middle row, that turns by `turn` from the first row to the last, sees of points that
// stand still.
std::vector<Correspondence> seen_turning(const Vector3& turn, std::uint32_t count, Random& random,
                                         const test::Noise& noise = kNoise) {
    std::vector<Correspondence> out;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vector3 p = test::random_point_in_view(random);
        const double row = p.y() / p.z() * kPixelsPerRay;
        const Vector3 moved =
            so3_exp(turn * row) * p;  // as the middle row's camera has it; its depth is another image's
        out.push_back(test::measure(p, kPose * Vector3(moved * (p.z() / moved.z())), noise, random));
        out.back().feature = out.back().point_slot = i;
        out.back().row = row;
    }
    return out;
}

struct Measured {
    bool is_valid = false;
    RowTurn found;
};

Measured measure(const std::vector<Correspondence>& matches, const Vector3& expected, double deviation,
                 const SE3& guess = kPose, const Vector3& carried = Vector3::Zero()) {
    Measured out;
    const RowTurnPrior prior{carried, expected, deviation * deviation};
    const Result<RowTurn> found = measure_row_turn(matches, test::all_of(matches), guess, prior, kChi2Max);
    out.is_valid = found.is_ok();
    if (out.is_valid) out.found = found.value();
    return out;
}

double square_mahalanobis(const RowTurn& found, const Vector3& truth) {
    const Vector3 error = found.turn - truth;
    return error.dot(found.covariance.inverse() * error);
}

// Largest difference in a coordinate, in deviations of `found`.
double deviations_between(const RowTurn& found, const Vector3& other) {
    double out = 0;
    for (int k = 0; k < 3; ++k) {
        out = std::max(out, std::abs(found.turn(k) - other(k)) / std::sqrt(found.covariance(k, k)));
    }
    return out;
}

// Promise: a camera that turned otherwise than expected is found to, and how well it is known is honest, be it the
// matches or the expectation that know more: over 200 frames the mean squared Mahalanobis distance from the truth is
// that of three numbers.
TEST(RowTurn, IsFoundAndHonest) {
    struct Case {
        double deviation;  // of the true turns, and as expected, rad
        std::uint32_t matches;
        double known_to;  // rad, the worst axis
    };
    const Case cases[] = {{0.01, 200, 0.0012}, {0.01, 40, 0.0030}, {0.001, 200, 0.0008}, {0.0002, 60, 0.0002}};
    for (const Case& c : cases) {
        Random random(1);
        double sum = 0;
        for (int trial = 0; trial < 200; ++trial) {
            const Vector3 expected = test::random_normal_vector(random, 0.01);
            const Vector3 turn = expected + test::random_normal_vector(random, c.deviation);
            const Measured m = measure(seen_turning(turn, c.matches, random), expected, c.deviation);
            ASSERT_TRUE(m.is_valid);
            ASSERT_LE(std::sqrt(m.found.covariance.diagonal().maxCoeff()), c.known_to);
            ASSERT_LT((m.found.covariance - m.found.covariance.transpose()).cwiseAbs().maxCoeff(), 1e-15);
            const double square = square_mahalanobis(m.found, turn);
            ASSERT_LT(square, 24) << "one in 40 000 is beyond";
            sum += square / 200;
        }
        EXPECT_NEAR(sum, 3.0, 0.6) << c.deviation << ' ' << c.matches;  // its deviation is .17
    }
}

// Promise: how well the turn is known follows from what matches are off by, where that is less than their variances
// say: variances nine times too large change neither what is found nor how well by more than a fifth. Where the
// expectation alone knows it, it is known as well as expected, not better; nor is what matches that are exact say known
// for certain.
TEST(RowTurn, VariancesThatAreTooLargeHideNothing) {
    Random random(4);
    for (int trial = 0; trial < 20; ++trial) {
        const Vector3 turn = test::random_normal_vector(random, 0.005);
        const auto matches = seen_turning(turn, 200, random);
        auto doubted = matches;
        for (Correspondence& c : doubted) {
            for (double* const variance : {&c.var_z, &c.var_pixel, &c.map_var_z, &c.map_var_lateral}) *variance *= 9;
        }
        const Measured right = measure(matches, Vector3::Zero(), 0.01);
        const Measured large = measure(doubted, Vector3::Zero(), 0.01);
        ASSERT_TRUE(right.is_valid && large.is_valid);
        for (int k = 0; k < 3; ++k) {
            const double sigma = std::sqrt(right.found.covariance(k, k));
            EXPECT_NEAR(std::sqrt(large.found.covariance(k, k)), sigma, 0.2 * sigma);
            EXPECT_NEAR(large.found.turn(k), right.found.turn(k), sigma);
        }
        const Measured expected = measure(doubted, turn, 1e-5);
        ASSERT_TRUE(expected.is_valid);
        EXPECT_LT(expected.found.covariance.diagonal().maxCoeff(), 1.001e-10);
        EXPECT_GT(expected.found.covariance.diagonal().minCoeff(), 0.99e-10);
    }
    const test::Noise none = {.pixel = 0, .depth_m = 0, .map_m = 0};
    auto exact = seen_turning(Vector3::Zero(), 200, random, none);
    for (Correspondence& c : exact) c.var_pixel = c.var_z = 1e-6;
    const Measured m = measure(exact, Vector3::Zero(), 0.01);
    ASSERT_TRUE(m.is_valid);
    EXPECT_GT(m.found.covariance.diagonal().minCoeff(), 1e-10);
}

// Promise: what hardly varies stays as expected, whatever the rows show.
TEST(RowTurn, WhatDoesNotVaryStaysAsExpected) {
    Random random(2);
    const Vector3 expected(0.01, -0.02, 0.005);
    const auto matches = seen_turning(expected + Vector3(0.01, 0.01, -0.01), 200, random);
    const Measured m = measure(matches, expected, 1e-6);
    ASSERT_TRUE(m.is_valid);
    EXPECT_LT((m.found.turn - expected).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LT(m.found.covariance.diagonal().maxCoeff(), 1.001e-12);
}

// Promise: matches that are wrong altogether, three in ten, each pull no more than the largest residual believed:
// errors become two to three times as large as is said, not more. Those without any weight do not move it at all.
TEST(RowTurn, GrossOutliersHardlyMoveIt) {
    Random random(3);
    double sum = 0;
    for (int trial = 0; trial < 50; ++trial) {
        const Vector3 turn = test::random_normal_vector(random, 0.01);
        auto matches = seen_turning(turn, 200, random);
        std::vector<Correspondence> doubted = matches;
        for (std::size_t i = 0; i < matches.size(); i += 10) {
            for (std::size_t k = i; k < i + 3; ++k) matches[k].p_world += test::random_vector(random, 0.5);
        }
        for (std::size_t i = 0; i < doubted.size(); i += 2) doubted[i].weight = 0;
        const Measured clean = measure(doubted, Vector3::Zero(), 0.01);
        for (std::size_t i = 0; i < doubted.size(); i += 2) doubted[i].p_world += test::random_vector(random, 0.5);
        const Measured wrong = measure(matches, Vector3::Zero(), 0.01);
        const Measured weightless = measure(doubted, Vector3::Zero(), 0.01);
        ASSERT_TRUE(clean.is_valid && wrong.is_valid && weightless.is_valid);
        sum += square_mahalanobis(wrong.found, turn) / 3 / 50;
        EXPECT_LT((wrong.found.turn - turn).norm(), 0.006) << trial;
        EXPECT_EQ((weightless.found.turn - clean.found.turn).norm(), 0);
    }
    EXPECT_LT(sum, 9.0);
}

// Promise: the pose only has to be near: a degree and a centimetre off it gives the same turn, to a tenth of its
// deviation. What the rows were carried with beforehand, by up to two degrees, changes it by less than two deviations:
// depth is carried too, which is left out.
TEST(RowTurn, NeitherTheGuessNorWhatWasCarriedMatters) {
    Random random(4);
    for (int trial = 0; trial < 50; ++trial) {
        const Vector3 expected = test::random_normal_vector(random, 0.01);
        const Vector3 turn = expected + test::random_normal_vector(random, 0.005);
        const auto matches = seen_turning(turn, 200, random);
        const Measured m = measure(matches, expected, 0.005);
        ASSERT_TRUE(m.is_valid);
        Vector6 error;
        error.head<3>() = test::random_normal_vector(random, 1.0).normalized() * 0.01;
        error.tail<3>() = test::random_normal_vector(random, 1.0).normalized() * (3.14159 / 180);
        const Measured off = measure(matches, expected, 0.005, kPose * se3_exp(error));
        ASSERT_TRUE(off.is_valid);
        EXPECT_LT(deviations_between(m.found, off.found.turn), 0.1);
        for (const Vector3& carried : {expected, turn, Vector3(-0.01, 0.01, 0.02)}) {
            auto turned = matches;
            turn_rows(turned, carried);
            const Measured again = measure(turned, expected, 0.005, kPose, carried);
            ASSERT_TRUE(again.is_valid);
            EXPECT_LT(deviations_between(m.found, again.found.turn), 2.0);
        }
    }
}

// Promise: of more than 256 matches every n-th is asked, over the whole of them: the cost is bound, and what they say
// is no worse known than by half as many.
TEST(RowTurn, ManyMatchesCostNoMore) {
    Random random(5);
    const Vector3 turn(0.01, -0.005, 0.008);
    auto matches = seen_turning(turn, 2560, random);
    const Measured all = measure(matches, Vector3::Zero(), 0.01);
    for (std::size_t i = 0; i < matches.size(); ++i) {
        if (i % 10 != 0) matches[i].p_world = Vector3::Zero();
    }
    const Measured tenth = measure(matches, Vector3::Zero(), 0.01);
    ASSERT_TRUE(all.is_valid && tenth.is_valid);
    EXPECT_EQ((all.found.turn - tenth.found.turn).norm(), 0);
    EXPECT_LT(deviations_between(all.found, turn), 4.0);
    matches.resize(257);  // 129 are asked
    for (std::size_t i = 0; i < matches.size(); i += 2) matches[i] = seen_turning(turn, 1, random)[0];
    const Measured half = measure(matches, Vector3::Zero(), 0.01);
    ASSERT_TRUE(half.is_valid);
    EXPECT_LT(std::sqrt(half.found.covariance.diagonal().maxCoeff()), 0.001);
}

// Promise: numbers that are none, points behind the camera and too few matches: nothing is said, or a number.
TEST(RowTurn, GarbageGivesNothingOrANumber) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    constexpr double kInf = std::numeric_limits<double>::infinity();
    Random random(6);
    const auto good = seen_turning(Vector3(0.01, 0, 0), 60, random);
    const auto expect_harmless = [](const Measured& m, const char* what) {
        EXPECT_TRUE(m.found.turn.allFinite() && m.found.covariance.allFinite()) << what;
    };
    for (const double bad : {kNan, kInf, -kInf, 1e300}) {
        for (int field = 0; field < 7; ++field) {
            auto matches = good;
            Correspondence& c = matches[7];
            switch (field) {
                case 0: c.p_world.x() = bad; break;
                case 1: c.p_world.z() = bad; break;
                case 2: c.normalised.y() = bad; break;
                case 3: c.row = bad; break;
                case 4: c.weight = bad; break;
                case 5: c.p_camera.z() = bad; break;
                default: c.var_pixel = bad; break;
            }
            expect_harmless(measure(matches, Vector3::Zero(), 0.01), std::to_string(field).c_str());
        }
        expect_harmless(measure(good, Vector3(bad, 0, 0), 0.01), "expected");
        expect_harmless(measure(good, Vector3::Zero(), bad), "variance");
        SE3 guess = kPose;
        guess.translation.x() = bad;
        expect_harmless(measure(good, Vector3::Zero(), 0.01, guess), "guess");
    }
    expect_harmless(measure(good, Vector3::Zero(), 0), "no variance");
    auto behind = good;
    for (Correspondence& c : behind) c.p_world = kPose * Vector3(0.1, 0.1, -1);
    EXPECT_FALSE(measure(behind, Vector3::Zero(), 0.01).is_valid);
    EXPECT_FALSE(measure({}, Vector3::Zero(), 0.01).is_valid);
    for (std::size_t count = 1; count < 8; ++count) {
        const std::vector<Correspondence> few(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(count));
        const Measured m = measure(few, Vector3::Zero(), 0.01);
        expect_harmless(m, "few");
        EXPECT_TRUE(m.is_valid || count < 3) << count << " fix a pose";
        EXPECT_TRUE(!m.is_valid || count > 1) << count << " does not";
    }
}

// Frames that are off by what `of(frame)` says, beside a motion of this speed.
template <typename Off>
[[nodiscard]] bool trembles(int frames, const Vector3& speed, Off&& of, double measured = 1e-4) {
    Trembling trembling(0.99);
    for (int frame = 0; frame < frames; ++frame) trembling.note(of(frame), measured * measured, speed);
    return trembling.is_found();
}

// Promise: what changes from frame to frame, by more than a fifth of a degree, is a trembling, of a hand at 8 to 12 Hz
// too, from the fifth frame on; what is smaller, what stays, and what may be the readout's, since it is along the
// motion, is none; and a trembling over something that stays is found where it is the larger by far.
TEST(Trembling, IsWhatChangesFromFrameToFrame) {
    const Vector3 speed(0.3, -0.5, 0.2);
    const Vector3 staying(0.006, -0.004, 0.005);
    const auto hand = [](double hz) {
        return [hz](int frame) {
            const double phase = 2 * 3.141592653589793 * hz * frame / 30;
            return Vector3(0.006 * std::cos(phase), 0.006 * std::sin(phase), 0.004 * std::cos(phase + 1));
        };
    };
    for (const double hz : {8.0, 10.0, 12.0}) EXPECT_TRUE(trembles(100, speed, hand(hz))) << hz;
    Random random(1);
    const auto noise = [&](double deviation) {
        return [&random, deviation](int) { return test::random_normal_vector(random, deviation); };
    };
    EXPECT_TRUE(trembles(100, speed, noise(0.004)));
    EXPECT_TRUE(trembles(5, speed, hand(10)));
    EXPECT_FALSE(trembles(4, speed, hand(10)));
    EXPECT_FALSE(trembles(100, speed, noise(0.0015)));
    EXPECT_FALSE(trembles(100, speed, [&](int) { return staying; }));
    EXPECT_FALSE(trembles(100, speed, [&](int frame) -> Vector3 { return speed * (frame % 2 == 0 ? 0.02 : -0.02); }));
    EXPECT_TRUE(trembles(100, speed, [&](int frame) -> Vector3 { return staying / 4 + hand(10)(frame); }));
    EXPECT_FALSE(trembles(100, speed, [&](int frame) -> Vector3 { return staying + hand(10)(frame) / 2; }));
    EXPECT_FALSE(trembles(0, speed, noise(1)));
    // Nor is what measuring says by itself, in small pictures.
    EXPECT_FALSE(trembles(100, speed, noise(0.004), 0.004));
    EXPECT_TRUE(trembles(100, speed, noise(0.008), 0.004));
}

// Promise: what is forgotten fades: a hand that comes to rest trembles no longer after some seconds, and its variance
// is that of what the frames were off aside of the motion.
TEST(Trembling, Fades) {
    Random random(2);
    const Vector3 speed(0, 0, 0.5);
    Trembling trembling(0.99);
    double sum = 0;
    for (int frame = 0; frame < 1000; ++frame) {
        const Vector3 off = test::random_normal_vector(random, 0.005);
        trembling.note(off, 1e-8, speed);
        sum += (off.x() * off.x() + off.y() * off.y()) / 2 / 1000;
    }
    ASSERT_TRUE(trembling.is_found());
    EXPECT_NEAR(trembling.variance(), sum, 0.4 * sum);
    int frames = 0;
    for (; trembling.is_found(); ++frames) trembling.note(Vector3::Zero(), 1e-8, speed);
    EXPECT_GT(frames, 30);
    EXPECT_LT(frames, 300);
}

}  // namespace
}  // namespace stillmesh::row_turn_test
