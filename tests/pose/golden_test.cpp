// One number over everything each estimate of a pose computes, as in tests/geometry/golden_test.cpp: the other tests of
// this room ask for the right pose, which is found by a wrong derivative, too, only later. Whoever changes a formula
// changes the number, and says so in the commit.
#include <gtest/gtest.h>

#include <vector>

#include "engine/base/hash.hpp"
#include "engine/pose/depth_turn.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/pose/rolling_shutter.hpp"
#include "engine/pose/row_turn.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::golden_test {
namespace {

constexpr double kChi2Max = 11.34;

template <typename Derived>
void add(const Eigen::MatrixBase<Derived>& matrix, StateHash& hash) {
    for (int i = 0; i < matrix.rows(); ++i)
        for (int k = 0; k < matrix.cols(); ++k) hash.add(matrix(i, k));
}
void add(const SE3& pose, StateHash& hash) {
    add(pose.rotation, hash);
    add(pose.translation, hash);
}

// Seen from `pose`, from 4 points to 400: outliers far and near, some behind the camera, some without depth, of all
// weights.
std::vector<Correspondence> scene_of(std::uint32_t i, const SE3& pose, Random& random) {
    auto scene = test::measure_scene(4 + i * i, pose, {.pixel = 1e-3, .depth_m = 2e-3, .map_m = 1e-3}, random);
    for (Correspondence& c : scene) {
        c.row = c.normalised.y();
        c.weight = static_cast<double>(random.below(11)) / 10.0;
        c.has_depth = random.below(4) != 0;
        const std::uint32_t kind = random.below(i % 2 == 0 ? 8 : 100);
        const Vector3 off = test::random_vector(random, 1.0);
        if (kind == 0) c.p_world += off;
        if (kind == 1) c.p_world += 0.02 * off;
        if (kind == 2) c.p_anchor += 0.02 * off;
        if (kind == 3) c.p_world = pose * Vector3(off.x(), off.y(), -1.0);
    }
    return scene;
}

// Promise: the poses that matches give are the same bits on every processor, compiler and optimisation level, and so
// are the draws that RANSAC needs.
TEST(Pose, GoldenBits) {
    Random random(1);
    StateHash hash;
    for (std::uint32_t i = 0; i < 20; ++i) {
        const SE3 pose = test::random_motion(random, 1.0, 0.5);
        const std::vector<Correspondence> scene = scene_of(i, pose, random);
        const std::vector<std::uint16_t> all = test::all_of(scene);
        const SE3 near = pose * test::random_motion(random, 0.05, 0.05);
        const SE3 guess = i % 5 == 4 ? pose * test::random_motion(random, 1.0, 1.0) : near;
        const MotionPrior prior{near, 0.02, 0.03};
        for (const MotionPrior* known : {static_cast<const MotionPrior*>(nullptr), &prior}) {
            const PoseFit fit = optimise_pose(scene, all, guess, kChi2Max, 1 + i, known);
            add(fit.world_from_camera, hash);
            add(fit.information, hash);
            hash.add(fit.inliers);
            hash.add(fit.mean_chi2);
            hash.add(static_cast<std::uint32_t>(fit.is_valid));
            Matrix6 covariance = Matrix6::Zero();
            hash.add(static_cast<std::uint32_t>(invert_spd(fit.information, covariance)));
            add(covariance, hash);
        }
        RansacOptions options;
        options.inlier_ratio_start = random.uniform();
        Random draws(i);
        const RansacResult found = ransac_pose(scene, all, i % 3 == 0 ? &near : nullptr, options, draws);
        if (found.is_valid) add(found.world_from_camera, hash);
        hash.add(found.inlier_share);
        hash.add(found.inliers);
        hash.add(found.iterations);
        hash.add(draws.next());

        const Vector3 carried = test::random_vector(random, 0.02);
        const Vector3 expected = test::random_vector(random, 0.02);
        const auto turn = measure_row_turn(scene, all, near, {carried, expected, 1e-4}, kChi2Max);
        hash.add(static_cast<std::uint32_t>(turn.status()));
        if (turn.is_ok()) {
            add(turn.value().turn, hash);
            add(turn.value().covariance, hash);
        }
    }
    EXPECT_EQ(hash.value(), 0x438f9079634a1481ULL) << std::hex << hash.value();
}

// Promise: so is what frames say of the readout and of trembling.
TEST(RollingShutter, GoldenBits) {
    Random random(2);
    StateHash hash;
    RollingShutter shutter;
    Trembling trembling(0.9);
    shutter.create(-1, 480);
    for (std::uint32_t i = 0; i < 60; ++i) {
        if (i == 30) shutter.start_from(0.01);
        if (i == 40) shutter.doubt();
        if (i == 50) shutter.reset();
        const SE3 pose = test::random_motion(random, 1.0, 0.5);
        Vector6 speed;
        for (int k = 0; k < 6; ++k) speed(k) = random.uniform(-2, 2);
        shutter.begin_frame();
        for (const Correspondence& c : scene_of(4 + i % 10, pose, random)) {
            const double y_px = random.uniform(0, 480);
            Correspondence seen = c;
            seen.p_camera += shutter.by_readout(c.p_camera, y_px, speed) * 0.02;
            if (seen.has_depth) seen.normalised = seen.p_camera.head<2>() / seen.p_camera.z();
            shutter.add(seen, pose.inverse() * c.p_world, test::random_vector(random, 0.1), y_px, speed, 100.0);
        }
        add(shutter.end_frame(i % 4 != 3), hash);
        const double turned = random.uniform(-1e3, 1e3);  // one draw a statement: arguments have no order of evaluation
        const double turning = random.uniform(-1e4, 1e5);
        if (i % 7 == 6) shutter.add_turn(turned, turning);
        hash.add(static_cast<std::uint32_t>(shutter.adopt()));
        hash.add(shutter.readout_s());
        const Vector3 off = test::random_vector(random, i % 20 < 10 ? 0.001 : 0.01);
        const double measured = random.uniform(1e-7, 1e-5);
        trembling.note(off, measured, i % 5 == 0 ? Vector3::Zero() : Vector3(speed.tail<3>()));
        hash.add(static_cast<std::uint32_t>(trembling.is_found()));
        hash.add(trembling.variance());
    }
    EXPECT_EQ(hash.value(), 0xbb8866141eaa7457ULL) << std::hex << hash.value();
}

// Walls that slope, with edges between them and holes; matches in all of the picture, some near its border.
struct Walls {
    static constexpr std::uint32_t kWidth = 80, kHeight = 60;
    explicit Walls(Random& random) : depth(kWidth * kHeight) {
        camera.width = kWidth, camera.height = kHeight;
        camera.fx = 70, camera.fy = 66, camera.cx = 40.5, camera.cy = 29.5;
        double across = 0, down = 0, near = 0;
        for (std::uint32_t at = 0; at < depth.size(); ++at) {
            if (at % (20 * kWidth) == 0) {
                across = random.uniform(-0.01, 0.01);
                down = random.uniform(-0.01, 0.01);
                near = random.uniform(1, 3);
            }
            depth[at] = static_cast<std::uint16_t>(4000 * (near + across * (at % kWidth) + down * (at / kWidth)));
            if (random.below(40) == 0) depth[at] = 0;
        }
        frame.depth = {depth.data(), kWidth, kHeight, kWidth};
        frame.depth_units_per_m = 4000;
    }
    std::vector<std::uint16_t> depth;
    CameraModel camera;
    DepthParameters range;
    Frame frame;
    std::vector<Keypoint> keypoints;
    [[nodiscard]] DepthPicture picture() const { return {&frame, &camera, &range, keypoints}; }
};

// Promise: so is the turn between a picture and its depth, of a few matches and of more than are looked at.
TEST(DepthTurn, GoldenBits) {
    Random random(3);
    StateHash hash;
    std::uint32_t found = 0;
    for (std::uint32_t i = 0; i < 40; ++i) {
        Walls walls(random);
        const SE3 pose = test::random_motion(random, 1.0, 0.5);
        const Vector3 looked_up = test::random_vector(random, 0.03);
        const Vector3 truth = test::random_vector(random, 0.03);
        std::vector<Correspondence> matches;
        for (std::uint32_t k = 0; k < 3 + 9 * i; ++k) {
            const double x = random.uniform(0, 79), y = random.uniform(0, 59);
            Keypoint keypoint;
            keypoint.x = static_cast<float>(x);
            keypoint.y = static_cast<float>(y);
            walls.keypoints.push_back(keypoint);
            const Vector2 ray((x - walls.camera.cx) / walls.camera.fx, (y - walls.camera.cy) / walls.camera.fy);
            const DepthSample seen = depth_behind(walls.picture(), {x, y}, ray, truth);
            const double z_m = seen.is_valid() ? seen.mean_m : 2.0;
            const Vector3 p(ray.x() * z_m, ray.y() * z_m, random.below(30) == 0 ? -z_m : z_m);
            matches.push_back(test::measure(p, pose * p, {1e-3, 2e-3, 1e-3}, random));
            Correspondence& c = matches.back();
            c.feature = k;
            c.normalised = ray;
            const DepthSample taken = depth_behind(walls.picture(), {x, y}, ray, looked_up);
            hash.add(taken.is_valid() ? taken.mean_m : -1.0);
            c.has_depth = taken.is_valid() && random.below(5) != 0;
            c.p_camera = back_project(ray, taken.mean_m);
            c.weight = static_cast<double>(random.below(11)) / 10.0;
            if (random.below(8) == 0) c.p_world += test::random_vector(random, 0.2);
        }
        const DepthTurnPrior prior{pose * test::random_motion(random, 0.01, 0.01), looked_up,
                                   test::random_vector(random, 0.03), 0.02, 0.1};
        const auto turn = measure_depth_turn(matches, test::all_of(matches), walls.picture(), prior, kChi2Max);
        hash.add(static_cast<std::uint32_t>(turn.status()));
        if (!turn.is_ok()) continue;
        ++found;
        add(turn.value(), hash);
    }
    EXPECT_GT(found, 30U);
    EXPECT_EQ(hash.value(), 0x98f66182748a774aULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
