#include "engine/tracking/keyframe_average.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::keyframe_average_test {
namespace {

// A keyframe that shows points, each as it was measured at first.
class Looks : public testing::Test {
protected:
    Looks() { start(test::small_parameters()); }
    void start(const Parameters& parameters) {
        average_.reset();
        world_ = std::make_unique<test::SmallWorld>(parameters);
        average_ = std::make_unique<test::InWorld<KeyframeAverage>>(**world_);
        pose_ = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
        keyframe_ = world_->add_keyframe(pose_, 10);
        points_.clear();
    }
    // A feature of the keyframe that shows a point at `p` in its camera; its number.
    std::size_t add(const Vector3& p, bool has_depth = true) {
        points_.push_back(world_->add_point(pose_ * p));
        Observation seen;
        seen.point = points_.back();
        seen.normalised_x = static_cast<float>(p.x() / p.z());
        seen.normalised_y = static_cast<float>(p.y() / p.z());
        seen.z_m = static_cast<float>(p.z());
        seen.var_z = has_depth ? 1e-4F : -1.0F;
        world_->map().add_observation(keyframe_, seen);
        return points_.size() - 1;
    }
    void begin() { (*average_)->begin(world_->map(), keyframe_); }
    // A frame at `pose` sees the i-th point at `p` in its own camera.
    void add(std::size_t i, const Vector3& p, const SE3& pose, bool has_depth = true) {
        std::vector<Correspondence> seen(2);  // the first is not chosen
        for (Correspondence& c : seen) {
            c.point_slot = points_[i].slot();
            c.has_depth = has_depth;
            c.p_camera = p;
        }
        seen[0].p_camera *= 1.5;
        const std::uint16_t chosen[] = {1};
        (*average_)->add(seen, chosen, pose, world_->map());
    }
    [[nodiscard]] const Observation& seen(std::size_t i) { return world_->map().observations(keyframe_)[i]; }
    [[nodiscard]] Vector3 measured(std::size_t i) {  // x/z, y/z and z
        return {static_cast<double>(seen(i).normalised_x), static_cast<double>(seen(i).normalised_y),
                static_cast<double>(seen(i).z_m)};
    }

    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::InWorld<KeyframeAverage>> average_;
    SE3 pose_;
    Handle<Keyframe> keyframe_;
    std::vector<Handle<MapPoint>> points_;
};

Vector3 as_measured(const Vector3& p) {
    return {p.x() / p.z(), p.y() / p.z(), p.z()};
}

// Promise: up to map.averaged_max looks the keyframe's measurement is their plain mean, its own included, in both
// coordinates and in depth; beyond, each counts one part in averaged_max + 1.
TEST_F(Looks, APlainMean) {
    for (const std::uint32_t averaged_max : {1U, 4U, 10U}) {
        Parameters parameters = test::small_parameters();
        parameters.map.averaged_max = averaged_max;
        start(parameters);
        Random random(1);
        const Vector3 truth(0.3, -0.2, 2.0);
        const Vector3 first = truth + test::random_vector(random, 0.02);
        const std::size_t i = add(first);
        begin();
        Vector3 sum = as_measured(first), expected = sum;
        for (std::uint32_t n = 2; n <= averaged_max + 5; ++n) {
            const Vector3 p = truth + test::random_vector(random, 0.02);
            add(i, p, pose_);
            if (n <= averaged_max) {
                sum += as_measured(p);
                expected = sum / n;
                EXPECT_EQ(seen(i).averaged, n);
            } else {
                expected += (as_measured(p) - expected) / (averaged_max + 1.0);
                EXPECT_EQ(seen(i).averaged, averaged_max);
            }
            EXPECT_LT((measured(i) - expected).cwiseAbs().maxCoeff(), 2e-6) << n << " of " << averaged_max;
        }
    }
}

// Promise: a frame elsewhere that sees the same place says the same: its measurement is carried over by both poses.
TEST_F(Looks, LooksFromBesideAreCarriedOver) {
    Random random(2);
    std::vector<Vector3> places;
    for (int n = 0; n < 20; ++n) places.push_back(test::random_point_in_view(random, 1.5, 4));
    for (const Vector3& p : places) add(p);
    begin();
    for (int frame = 0; frame < 10; ++frame) {
        const SE3 beside = pose_ * test::random_motion(random, 0.04, 0.3);
        for (std::size_t i = 0; i < places.size(); ++i) add(i, beside.inverse() * (pose_ * places[i]), beside);
    }
    for (std::size_t i = 0; i < places.size(); ++i) {
        EXPECT_EQ(seen(i).averaged, 10);
        EXPECT_LT((measured(i) - as_measured(places[i])).cwiseAbs().maxCoeff(), 1e-6);
    }
}

// Promise: only looks from within map.averaged_reach times the point's depth count, whatever the turn.
TEST_F(Looks, FromNearByOnly) {
    for (const double reach : {0.05, 0.2}) {
        Parameters parameters = test::small_parameters();
        parameters.map.averaged_reach = reach;
        start(parameters);
        const std::size_t near = add(Vector3(0, 0, 1)), far = add(Vector3(0, 0, 3));
        begin();
        const auto looked = [&](double away_m) {
            const int before_near = seen(near).averaged, before_far = seen(far).averaged;
            SE3 away = se3_exp((Vector6() << 0, 0, 0, 0, 0.5, 0).finished());
            away.translation = Vector3(0.6 * away_m, 0.8 * away_m, 0);
            add(near, Vector3(0, 0, 1), pose_ * away);
            add(far, Vector3(0, 0, 3), pose_ * away);
            return std::pair{seen(near).averaged > before_near, seen(far).averaged > before_far};
        };
        EXPECT_EQ(looked(0.999 * reach), (std::pair{true, true}));
        EXPECT_EQ(looked(1.001 * reach), (std::pair{false, true}));
        EXPECT_EQ(looked(2.999 * reach), (std::pair{false, true}));
        EXPECT_EQ(looked(3.001 * reach), (std::pair{false, false}));
    }
}

// Promise: what has no depth, in the frame or in the keyframe, what the keyframe did not see, and what shows another
// point by now, is left as it is.
TEST_F(Looks, OnlyWhatTheKeyframeMeasured) {
    const Vector3 p(0.1, 0.1, 2), off(0.12, 0.1, 2.1);
    const std::size_t seen_well = add(p), blind = add(p, false), fused = add(p);
    begin();
    const std::uint32_t changes = (*world_)[keyframe_].observations_changed;
    points_.push_back(world_->add_point(pose_ * p));  // made after the keyframe
    const std::size_t stranger = points_.size() - 1;
    add(stranger, off, pose_);
    add(seen_well, off, pose_, false);
    add(blind, off, pose_);
    EXPECT_EQ((*world_)[keyframe_].observations_changed, changes);
    world_->map().unlink(keyframe_, static_cast<std::uint32_t>(fused));
    const Vector3 before = measured(fused);
    add(fused, off, pose_);
    EXPECT_EQ((measured(fused) - before).squaredNorm(), 0);
    add(seen_well, off, pose_);
    EXPECT_EQ(seen(seen_well).averaged, 2);
    EXPECT_EQ(seen(blind).averaged, 1);
}

// Promise: from begin() on it is the new keyframe whose measurements are averaged; none once it has left the map, or
// after a reset.
TEST_F(Looks, OfOneKeyframe) {
    const Vector3 p(0.1, 0.1, 2);
    const std::size_t i = add(p);
    begin();
    const Handle<Keyframe> older = keyframe_;
    keyframe_ = world_->add_keyframe(pose_, 20);
    Observation shows;
    shows.var_z = 1e-4F;
    shows.z_m = 2;
    world_->map().add_observation(keyframe_, shows);  // shows no point
    shows.point = points_[i];
    world_->map().add_observation(keyframe_, shows);
    add(i, p, pose_);
    EXPECT_EQ(world_->map().observations(older)[0].averaged, 2);
    begin();
    add(i, p, pose_);
    EXPECT_EQ(world_->map().observations(older)[0].averaged, 2);
    EXPECT_EQ(seen(0).averaged, 1);
    EXPECT_EQ(seen(1).averaged, 2);
    (*average_)->reset();
    add(i, p, pose_);
    EXPECT_EQ(seen(1).averaged, 2);
    begin();
    world_->map().release_keyframe(keyframe_);
    keyframe_ = older;
    add(i, p, pose_);
    EXPECT_EQ(seen(0).averaged, 2);
}

}  // namespace
}  // namespace stillmesh::keyframe_average_test
