#include "engine/pose/rolling_shutter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/residual.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::rolling_shutter_test {
namespace {

constexpr double kChi2Max = 11.34;
constexpr std::uint32_t kHeight = 480;
constexpr double kFocal_px = 525;
constexpr double kCentre_px = 239.5;
constexpr double kPeriod_s = 1.0 / 30;
constexpr std::uint32_t kPoints = 250;

[[nodiscard]] std::uint64_t bits_of(double value) {
    return std::bit_cast<std::uint64_t>(value);
}

// Turning back and forth about two axes at up to 1 rad/s, and swaying; `amount` 0 stands still.
[[nodiscard]] SE3 world_from_camera_at(double time_s, double amount) {
    Vector6 xi;
    xi << 0.2 * std::sin(2.5 * time_s), 0.1 * std::sin(1.7 * time_s), 0.15 * std::cos(2.1 * time_s),
        0.15 * std::sin(4.1 * time_s), 0.3 * std::sin(2.9 * time_s + 1), 0.1 * std::sin(3.3 * time_s);
    return se3_exp(amount * xi);
}

struct Seen {
    Correspondence c;
    double y_px = 0;
};

constexpr test::Noise kNoise = {.pixel = 1e-3, .depth_m = 2e-3, .map_m = 0};

// What a camera on that path that reads its rows one by one sees: each point where the camera is when its row is due.
template <typename Path>
[[nodiscard]] std::vector<Seen> expose(const Path& world_from_camera, double middle_s, double readout_s,
                                       std::uint32_t count, const test::Noise& noise, Random& random) {
    std::vector<Seen> out;
    const SE3 middle = world_from_camera(middle_s);
    while (out.size() < count) {
        const Vector3 p_world = middle * test::random_point_in_view(random);
        Vector3 p;
        double y_px = 0;
        double row_s = 0;
        for (int i = 0; i < 12; ++i) {  // when says which row, the row says when
            p = world_from_camera(middle_s + row_s).inverse() * p_world;
            y_px = kCentre_px + kFocal_px * p.y() / p.z();
            row_s = (y_px / kHeight - 0.5) * readout_s;
        }
        if (y_px >= 0 && y_px < kHeight) out.push_back({test::measure(p, p_world, noise, random), y_px});
    }
    return out;
}

void learn(RollingShutter& shutter, const std::vector<Seen>& seen, const SE3& world_from_camera, const Vector6& speed,
           double chi2_max = kChi2Max) {
    shutter.begin_frame();
    for (const Seen& one : seen) {
        shutter.add(one.c, world_from_camera.inverse() * one.c.p_world, Vector3::Zero(), one.y_px, speed, chi2_max);
    }
    static_cast<void>(shutter.end_frame(true));
    static_cast<void>(shutter.adopt());
}

// A frame of a camera at the origin that turns slowly, its rows read one by one.
const Vector6 kTurning = (Vector6() << 0, 0, 0, 0.04, 0.09, 0.02).finished();
[[nodiscard]] std::vector<Seen> frame_of(std::uint32_t count, Random& random, double readout_s = 0.026) {
    return expose([](double time_s) { return se3_exp(kTurning * time_s); }, 0.0, readout_s, count, kNoise, random);
}
[[nodiscard]] std::vector<Seen> carried(const RollingShutter& shutter, std::vector<Seen> seen) {
    for (Seen& one : seen) {
        if (!one.c.has_depth) continue;
        one.c.p_camera = moved_a_little(kTurning * shutter.row_time_s(one.y_px), one.c.p_camera);
        one.c.normalised = Vector2(one.c.p_camera.x() / one.c.p_camera.z(), one.c.p_camera.y() / one.c.p_camera.z());
    }
    return seen;
}
void learn_turning(RollingShutter& shutter, const std::vector<Seen>& seen, const SE3& pose = SE3{}) {
    learn(shutter, carried(shutter, seen), pose, kTurning, 100.0);  // of noise alone no point is lost
}

// Tracking's frame around the estimator, with an exact map: the motion since the frame before carries the rows, the
// pose is fitted, both once more, and the estimator learns.
class Tracker {
public:
    Tracker(double true_readout_s, double given_s, std::uint64_t seed)
        : true_readout_s_(true_readout_s), random_(seed) {
        shutter.create(given_s, kHeight);
    }

    void frame(double amount = 1.0) {
        time_s_ += kPeriod_s;
        const auto path = [amount](double time_s) { return world_from_camera_at(time_s, amount); };
        const std::vector<Seen> seen = expose(path, time_s_, true_readout_s_, kPoints, kNoise, random_);
        std::vector<Seen> carried = seen;
        SE3 pose = has_previous_ ? previous_ * motion_ : path(time_s_);
        Vector6 speed = Vector6::Zero();
        for (int round = 0; round < 2; ++round) {
            if (has_previous_) speed = se3_log(previous_.inverse() * pose) / kPeriod_s;
            std::vector<Correspondence> c;
            for (std::size_t i = 0; i < seen.size(); ++i) {
                const double row_s = shutter.row_time_s(seen[i].y_px);
                const Vector3 p = moved_a_little(speed * row_s, seen[i].c.p_camera);
                carried[i].c.p_camera = p;
                carried[i].c.normalised = Vector2(p.x() / p.z(), p.y() / p.z());
                c.push_back(carried[i].c);
            }
            const auto chosen = test::all_of(c);
            const PoseFit fit = optimise_pose(c, chosen, pose, kChi2Max, 10, nullptr);
            ASSERT_TRUE(fit.is_valid);
            pose = fit.world_from_camera;
        }
        if (has_previous_) {
            motion_ = previous_.inverse() * pose;
            learn(shutter, carried, pose, speed);
        }
        previous_ = pose;
        has_previous_ = true;
    }

    RollingShutter shutter;

private:
    double true_readout_s_;
    Random random_;
    double time_s_ = 0;
    bool has_previous_ = false;
    SE3 previous_;
    SE3 motion_;
};

// Promise: a point is carried with exp(speed * time), up to what is left out: the third power of the angle, and half
// the angle of the way moved.
TEST(RollingShutter, CarriesByTheMotion) {
    Random random(1);
    for (int i = 0; i < 2000; ++i) {
        const Vector3 p = test::random_point_in_view(random);
        Vector6 speed;
        speed.head<3>() = test::random_vector(random, 1.0);
        speed.tail<3>() = test::random_vector(random, 4.0);
        const double time_s = random.uniform(-0.02, 0.02);
        const double angle = speed.tail<3>().norm() * std::abs(time_s);
        const double travelled = speed.head<3>().norm() * std::abs(time_s);
        const Vector3 carried = moved_a_little(speed * time_s, p);
        const double error_m = (carried - se3_exp(speed * time_s) * p).norm();
        EXPECT_LE(error_m, angle * angle * angle / 6 * p.norm() + 0.5 * angle * travelled + 1e-14);
    }
}

// Promise: no motion, or no time, changes no bit of a point.
TEST(RollingShutter, WithoutMotionNothingChanges) {
    Random random(2);
    for (int i = 0; i < 500; ++i) {
        const Vector3 p = test::random_point_in_view(random);
        Vector6 speed;
        for (int k = 0; k < 6; ++k) speed(k) = random.uniform(-3, 3);
        const Vector3 at_rest = moved_a_little(Vector6::Zero() * random.uniform(-0.02, 0.02), p);
        const Vector3 at_once = moved_a_little(speed * 0.0, p);
        for (int k = 0; k < 3; ++k) {
            EXPECT_EQ(bits_of(at_rest(k)), bits_of(p(k)));
            EXPECT_EQ(bits_of(at_once(k)), bits_of(p(k)));
        }
    }
}

// Promise: rows are timed from the middle one, the first and the last half a readout away, in either direction.
TEST(RollingShutter, RowsAreTimedFromTheMiddle) {
    for (const double readout_s : {0.026, 0.0}) {
        RollingShutter shutter;
        shutter.create(readout_s, kHeight);
        EXPECT_NEAR(shutter.row_time_s(0), -readout_s / 2, 1e-15);
        EXPECT_NEAR(shutter.row_time_s(kHeight / 2.0), 0, 1e-15);
        EXPECT_NEAR(shutter.row_time_s(kHeight), readout_s / 2, 1e-15);
    }
}

// Promise: a camera that moves tells its readout within two seconds, to 10 %, read downwards or upwards.
TEST(RollingShutter, FindsTheReadout) {
    for (const double readout_s : {0.026, -0.020}) {
        for (const std::uint64_t seed : {3U, 4U, 5U}) {
            Tracker tracker(readout_s, -1, seed);
            for (int i = 0; i < 60; ++i) tracker.frame();
            EXPECT_NEAR(tracker.shutter.readout_s(), readout_s, 0.1 * std::abs(readout_s)) << "seed " << seed;
            EXPECT_TRUE(tracker.shutter.is_estimated());
        }
    }
}

// Promise: what a frame tells is what no pose explains: a pose that is off by some millimetres and milliradians leads
// to the same readout, also when all points lie in the upper half, where a turn and a readout look alike.
TEST(RollingShutter, APoseThatIsOffTellsTheSame) {
    Random random(13);
    RollingShutter right;
    RollingShutter off;
    right.create(-1, kHeight);
    off.create(-1, kHeight);
    Vector6 error;
    error << 0.002, -0.002, 0.001, 0.001, 0.002, -0.002;
    for (int i = 0; i < 20; ++i) {
        std::vector<Seen> seen = frame_of(4 * kPoints, random, 0.008);
        std::erase_if(seen, [](const Seen& one) { return one.y_px > kHeight / 2.0; });
        learn_turning(right, seen);
        learn_turning(off, seen, se3_exp(error));
    }
    EXPECT_NEAR(right.readout_s(), 0.008, 0.002);
    EXPECT_NEAR(off.readout_s(), right.readout_s(), 0.1 * right.readout_s());
}

// Promise: a global shutter is never taken for a rolling one, however the camera moves.
TEST(RollingShutter, AGlobalShutterStaysGlobal) {
    for (const std::uint64_t seed : {6U, 7U}) {
        Tracker tracker(0.0, -1, seed);
        for (int i = 0; i < 300; ++i) {
            tracker.frame();
            ASSERT_EQ(tracker.shutter.readout_s(), 0.0) << "frame " << i << ", seed " << seed;
        }
    }
}

// Promise: a camera that stands still learns nothing: its noise is no readout, and frames without any motion leave the
// estimate as it is.
TEST(RollingShutter, StandingStillTeachesNothing) {
    Tracker still(0.026, -1, 8);
    for (int i = 0; i < 300; ++i) {
        still.frame(0.0);
        ASSERT_EQ(still.shutter.readout_s(), 0.0) << i;
    }
    Tracker moved(0.026, -1, 8);
    for (int i = 0; i < 30; ++i) moved.frame();
    const double before_s = moved.shutter.readout_s();
    ASSERT_NEAR(before_s, 0.026, 0.004);
    Random random(9);
    for (int i = 0; i < 100; ++i) {
        learn(moved.shutter, frame_of(kPoints, random), SE3{}, Vector6::Zero());
        ASSERT_EQ(bits_of(moved.shutter.readout_s()), bits_of(before_s));
    }
}

// Promise: a readout that is given is kept, whatever is seen, 0 too.
TEST(RollingShutter, AGivenReadoutIsKept) {
    for (const double given_s : {0.0, 0.01, 0.1}) {
        Tracker tracker(0.026, given_s, 10);
        for (int i = 0; i < 40; ++i) {
            tracker.frame();
            tracker.shutter.add_turn(-1e6, 1e8);  // a gyroscope's word is no exception
            tracker.shutter.start_from(0.02);
            static_cast<void>(tracker.shutter.adopt());
            ASSERT_EQ(bits_of(tracker.shutter.readout_s()), bits_of(given_s));
        }
        tracker.shutter.reset();
        EXPECT_EQ(tracker.shutter.readout_s(), given_s);
        EXPECT_FALSE(tracker.shutter.is_estimated());
    }
}

// Promise: a map whose points moved as the picture does tells nothing of the readout: only what the two do not share
// is learnt, so that a map made with a wrong readout does not speak for it.
TEST(RollingShutter, AMapThatMovesAlongTellsNothing) {
    Random random(14);
    RollingShutter alike;
    RollingShutter half;
    alike.create(-1, kHeight);
    half.create(-1, kHeight);
    for (int i = 0; i < 20; ++i) {
        const std::vector<Seen> seen = frame_of(kPoints, random);
        // Each point was made by a frame that saw it in the same row, turning as fast or half as fast.
        for (const double share : {1.0, 0.5}) {
            RollingShutter& shutter = share == 1.0 ? alike : half;
            shutter.begin_frame();
            for (const Seen& one : carried(shutter, seen)) {
                const Vector3 moves = shutter.by_readout(one.c.p_camera, one.y_px, kTurning) * share;
                const Vector3 q = one.c.p_world - moves * (0.026 - shutter.readout_s());
                shutter.add(one.c, q, moves, one.y_px, kTurning, 1000.0);
            }
            static_cast<void>(shutter.end_frame(true));
            static_cast<void>(shutter.adopt());
        }
    }
    EXPECT_EQ(alike.readout_s(), 0.0);
    EXPECT_NEAR(half.readout_s(), 0.026, 0.006);
}

// Promise: end_frame() says how the pose moves with the readout: fitting the frame anew with another readout finds it
// there.
TEST(RollingShutter, SaysHowThePoseMoves) {
    Random random(15);
    const std::vector<Seen> seen = frame_of(4 * kPoints, random, 0.0);
    const auto fit_with = [&](double readout_s) {
        RollingShutter shutter;
        shutter.create(readout_s, kHeight);
        std::vector<Correspondence> c;
        for (const Seen& one : carried(shutter, seen)) {
            c.push_back(one.c);
        }
        return optimise_pose(c, test::all_of(c), SE3{}, 1e6, 20, nullptr).world_from_camera;
    };
    RollingShutter shutter;
    shutter.create(-1, kHeight);
    shutter.begin_frame();
    for (const Seen& one : seen) shutter.add(one.c, one.c.p_world, Vector3::Zero(), one.y_px, kTurning, 1e6);
    const Vector6 moves = shutter.end_frame(false);
    EXPECT_FALSE(shutter.adopt());
    const double change_s = 0.01;
    const Vector6 found = se3_log(fit_with(0.0).inverse() * fit_with(change_s)) / change_s;
    EXPECT_GT(moves.norm(), 0.005);
    EXPECT_LE((found - moves).norm(), 0.05 * moves.norm());
}

// Promise: what a frame is worth is as documented: its finding F with information I counts `trust` I against the
// prior's 1 / sigma_s^2, what came before it fades by `fading` a frame, and no finding is scaled (with nothing to weigh
// it down the first frame's readout is believed whole).
TEST(RollingShutter, WeighsFramesAsDocumented) {
    Random random(16);
    const std::vector<Seen> first = frame_of(4 * kPoints, random, 0.012);
    const std::vector<Seen> second = frame_of(4 * kPoints, random, 0.030);
    // Both against a shutter that is thought global, so that the two findings are the same whatever is believed.
    const auto after = [&](const ShutterParameters& parameters, std::uint32_t firsts, std::uint32_t seconds) {
        RollingShutter shutter;
        shutter.create(-1, kHeight, parameters);
        for (std::uint32_t i = 0; i < firsts + seconds; ++i) {
            shutter.begin_frame();
            for (const Seen& one : i < firsts ? first : second) {
                shutter.add(one.c, one.c.p_world, Vector3::Zero(), one.y_px, kTurning, 1000.0);
            }
            static_cast<void>(shutter.end_frame(true));
        }
        EXPECT_TRUE(shutter.adopt());
        return shutter.readout_s();
    };
    ShutterParameters sure;
    sure.negligible_s = sure.step_s = sure.info_share_min = 0;
    sure.sigma_s = 1.0;  // hardly a prior
    const double found_first = after(sure, 1, 0);
    const double found_second = after(sure, 0, 1);
    EXPECT_NEAR(found_first, 0.012, 0.002);
    EXPECT_NEAR(found_second, 0.030, 0.002);
    // F / estimate - 1 = 1 / (sigma^2 trust I): inverse in trust and in the square of sigma.
    ShutterParameters doubting = sure;
    doubting.sigma_s = 0.001;
    const double doubt = found_first / after(doubting, 1, 0) - 1.0;
    ASSERT_GT(doubt, 0.01);
    doubting.trust *= 2;
    EXPECT_NEAR(found_first / after(doubting, 1, 0) - 1.0, doubt / 2, 1e-3 * doubt);
    doubting.trust /= 2;
    doubting.sigma_s /= 2;
    EXPECT_NEAR(found_first / after(doubting, 1, 0) - 1.0, doubt * 4, 4e-3 * doubt);
    // n frames of the first kind, then m of the second: geometric sums of the fading.
    const auto sum = [](double fading, int from, int count) {
        double out = 0;
        for (int i = from; i < from + count; ++i) out += std::pow(fading, i);
        return out;
    };
    const double first_info = 1.0 / (found_first / after(doubting, 1, 0) - 1.0);
    const double second_info = 1.0 / (found_second / after(doubting, 0, 1) - 1.0);
    for (const double fading : {ShutterParameters{}.fading, 0.8, 1.0}) {
        sure.fading = fading;
        const double old_weight = first_info * sum(fading, 4, 6);
        const double new_weight = second_info * sum(fading, 0, 4);
        const double wanted = (old_weight * found_first + new_weight * found_second) / (old_weight + new_weight);
        EXPECT_NEAR(after(sure, 6, 4), wanted, 2e-5) << fading;
    }
    // The defaults are those of the documentation: a frame counts a tenth, and a second of frames keeps three quarters.
    EXPECT_EQ(ShutterParameters{}.trust, 0.1);
    EXPECT_NEAR(std::pow(ShutterParameters{}.fading, 30), 0.74, 0.005);
}

// Promise: a readout that is given stays, however short it is. (One below negligible_s was none from the second frame
// on, but not in a map that was loaded.)
TEST(RollingShutter, WhatIsGivenStays) {
    for (const double given_s : {0.0, 0.0003, 0.0029, 0.0031, 0.02}) {
        RollingShutter shutter;
        shutter.create(given_s, 480);
        EXPECT_FALSE(shutter.adopt()) << given_s;
        EXPECT_EQ(shutter.readout_s(), given_s);
    }
}

// Promise: changes below step_s are not adopted, but add up until they are; a readout below negligible_s is none.
TEST(RollingShutter, SmallChangesWait) {
    Random random(17);
    const std::vector<Seen> seen = frame_of(4 * kPoints, random, 0.012);
    ShutterParameters parameters;
    parameters.sigma_s = 1.0;
    RollingShutter shutter;
    const auto believed = [&] {
        shutter.create(-1, kHeight, parameters);
        learn_turning(shutter, seen);
        return shutter.readout_s();
    };
    const double readout_s = believed();
    EXPECT_NEAR(readout_s, 0.012, 0.002);
    parameters.step_s = 1.01 * readout_s;
    EXPECT_EQ(believed(), 0.0);
    parameters.step_s = 0.99 * readout_s;
    EXPECT_EQ(believed(), readout_s);
    parameters.negligible_s = 1.01 * readout_s;
    EXPECT_EQ(believed(), 0.0);
    parameters.negligible_s = 0;
    parameters.readout_max_s = 0.5 * readout_s;
    parameters.step_s = 0;
    EXPECT_NEAR(believed(), 0.5 * readout_s, 1e-6);
}

// Promise: after reset() nothing is left of what was learnt: the same frames give the same bits as the first time.
TEST(RollingShutter, ResetStartsAnew) {
    Random random(11);
    std::vector<std::vector<Seen>> frames;
    for (int i = 0; i < 20; ++i) frames.push_back(frame_of(kPoints, random));
    const auto learnt = [&](RollingShutter& shutter) {
        std::vector<std::uint64_t> out;
        for (const auto& frame : frames) {
            learn_turning(shutter, frame);
            out.push_back(bits_of(shutter.readout_s()));
        }
        return out;
    };
    RollingShutter shutter;
    shutter.create(-1, kHeight);
    const auto first = learnt(shutter);
    EXPECT_GT(std::abs(shutter.readout_s()), 0.005);
    shutter.reset();
    EXPECT_EQ(shutter.readout_s(), 0.0);
    EXPECT_TRUE(shutter.is_estimated());
    EXPECT_EQ(learnt(shutter), first);
}

// Promise: points behind the camera, without depth or far from where the map says, frames of too few points, and
// frames with a number that is none change nothing, to the bit, now or later.
TEST(RollingShutter, GarbageChangesNothing) {
    Random random(12);
    RollingShutter clean;
    RollingShutter fed;
    clean.create(-1, kHeight);
    fed.create(-1, kHeight);
    for (int i = 0; i < 20; ++i) {
        const std::vector<Seen> good = frame_of(kPoints, random);
        learn_turning(clean, good);
        std::vector<Seen> mixed;  // good ones in the same order, bad ones between
        for (const Seen& one : good) {
            mixed.push_back(one);
            Seen bad = one;
            switch (random.below(4)) {
                case 0: bad.c.p_world = Vector3(0.1, 0.1, -one.c.p_world.z()); break;
                case 1: bad.c.p_world.z() = random.uniform(-0.05, 0.049); break;
                case 2:
                    bad.c.has_depth = false;
                    bad.c.p_camera = Vector3::Zero();
                    break;
                default: bad.c.p_world.x() += 0.5; break;
            }
            mixed.push_back(bad);
        }
        learn_turning(fed, mixed);
        ASSERT_EQ(bits_of(fed.readout_s()), bits_of(clean.readout_s())) << i;

        learn_turning(fed, frame_of(29, random));
        learn_turning(fed, {});
        std::vector<Seen> poisoned = frame_of(kPoints, random);
        poisoned[7].c.p_camera.x() = poisoned[7].c.normalised.x() = std::numeric_limits<double>::quiet_NaN();
        learn_turning(fed, poisoned);
        ASSERT_EQ(bits_of(fed.readout_s()), bits_of(clean.readout_s())) << i;
    }
    EXPECT_GT(std::abs(clean.readout_s()), 0.005);
    // The thirtieth is what was missing.
    RollingShutter enough;
    enough.create(-1, kHeight);
    for (int i = 0; i < 20; ++i) learn_turning(enough, frame_of(30, random));
    EXPECT_NE(enough.readout_s(), 0.0);
}

}  // namespace
}  // namespace stillmesh::rolling_shutter_test
