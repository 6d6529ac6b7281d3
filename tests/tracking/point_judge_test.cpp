#include "engine/tracking/point_judge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::point_judge_test {
namespace {

constexpr std::int64_t kNow_ns = 100'000'000'000;
constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::uint64_t kNumber = 77;

// A frame that sees points of the map, each a little off, and what it says of them.
class Judge : public testing::Test {
protected:
    explicit Judge(const Parameters& parameters = test::small_parameters()) { start(parameters); }
    void start(const Parameters& parameters) {
        judge_.reset();
        frame_.reset();
        still_.reset();
        world_ = std::make_unique<test::SmallWorld>(parameters);
        frame_ = std::make_unique<test::SmallFrame>(**world_);
        judge_ = std::make_unique<test::InWorld<PointJudge>>(**world_);
        still_ =
            std::make_unique<test::InMemory<FixedVector<std::uint16_t>>>(std::size_t{(*world_)->limits.features_max});
        shutter_ = TrackedShutter{};
        shutter_.create(parameters, 120);
        shutter_.reset();
        correspondences_.clear();
        points_.clear();
        pose_ = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
        is_sure_ = true;
        is_frozen_ = false;
        time_ns_ = kNow_ns;
    }
    // A feature z_m away, whose point lies `off_m` farther along the axis and is known as well as the frame measures.
    std::size_t add(double z_m = 2, double off_m = 0) {
        const auto n = static_cast<std::uint32_t>(correspondences_.size());
        frame_->add(10 + 12 * (n % 12), 10 + 12 * (n / 12), z_m, test::descriptor_of(n));
        frame_->measure();
        const MeasuredFeature m = seen(n);
        const Vector3 p(m.normalised.x() * (z_m + off_m), m.normalised.y() * (z_m + off_m), z_m + off_m);
        points_.push_back(world_->add_point(pose_ * p));
        MapPoint& point = this->point(n);
        point.var_z = point.anchor_var_z = m.var_z;
        point.var_lateral = point.anchor_var_lateral = m.var_pixel * z_m * z_m;
        point.created_ns = point.anchor_ns = kNow_ns - 10 * kSecond;
        Correspondence c;
        c.feature = n;
        c.point_slot = points_.back().slot();
        c.normalised = m.normalised;
        c.has_depth = m.has_depth();
        c.p_camera = m.point();
        c.var_z = m.var_z;
        c.var_pixel = m.var_pixel;
        c.p_world = vector_of(point.world);
        c.map_var_z = point.var_z;
        c.map_var_lateral = point.var_lateral;
        c.p_anchor = vector_of(point.anchor);
        c.anchor_var_z = point.anchor_var_z;
        c.anchor_var_lateral = point.anchor_var_lateral;
        correspondences_.push_back(c);
        return n;
    }
    // How far off along the axis makes so large a squared residual.
    [[nodiscard]] double off_of_chi2(double chi2, double z_m = 2) {
        const double sigma = (*world_)->parameters.depth.sigma_z_per_m2 * z_m * z_m;
        return std::sqrt(chi2 * 2) * sigma;
    }
    std::size_t judge() {  // how many others there are
        (*judge_)->judge(correspondences_, witness(), world_->map(), **still_);
        return correspondences_.size() - (*still_)->size();
    }
    [[nodiscard]] PointJudge::Witness witness() {
        return {{frame_->measured, shutter_, pose_, kNumber, time_ns_, 12.5}, is_sure_, is_frozen_};
    }
    [[nodiscard]] Verdict verdict(std::size_t i) { return (*judge_)->verdict(i); }
    [[nodiscard]] const MeasuredFeature& seen(std::size_t i) { return frame_->measured[i]; }
    [[nodiscard]] MapPoint& point(std::size_t i) { return (*world_)[points_[i]]; }
    [[nodiscard]] std::vector<std::uint16_t> still() { return {(*still_)->begin(), (*still_)->end()}; }

    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::SmallFrame> frame_;
    std::unique_ptr<test::InWorld<PointJudge>> judge_;
    std::unique_ptr<test::InMemory<FixedVector<std::uint16_t>>> still_;
    TrackedShutter shutter_;
    std::vector<Correspondence> correspondences_;
    std::vector<Handle<MapPoint>> points_;
    SE3 pose_;
    bool is_sure_ = true, is_frozen_ = false;
    std::int64_t time_ns_ = kNow_ns;
};

// Promise: a point stands still up to region.point_chi2_max at its place and wide_factor times that at its
// anchor, exactly; every other matched one moves; what is not matched has no verdict.
TEST_F(Judge, StillUpToTheThresholds) {
    for (const double chi2_max : {4.0, 11.34}) {
        for (const double factor : {1.5, 2.0}) {
            Parameters parameters = test::small_parameters();
            parameters.region.point_chi2_max = chi2_max;
            parameters.region.wide_factor = factor;
            start(parameters);
            struct Case {
                double place, anchor;  // shares of chi2_max
                bool is_still;
            };
            const Case cases[] = {{0, 0, true},
                                  {0.999, 0, true},
                                  {1.001, 0, false},
                                  {0, 0.999 * factor, true},
                                  {0, 1.001 * factor, false},
                                  {0.999, 0.999 * factor, true}};
            std::vector<std::uint16_t> expected;
            for (const Case& c : cases) {
                const std::size_t i = add();
                const Vector3 ray = pose_.rotation * seen(i).point() / 2.0;
                correspondences_[i].p_world += ray * off_of_chi2(c.place * chi2_max);
                correspondences_[i].p_anchor += ray * off_of_chi2(c.anchor * chi2_max);
                if (c.is_still) expected.push_back(static_cast<std::uint16_t>(i));
            }
            frame_->add(150, 110, 2, test::descriptor_of(99));  // matches nothing
            frame_->measure();
            EXPECT_EQ(judge(), std::size(cases) - expected.size());
            EXPECT_EQ(still(), expected);
            for (std::size_t i = 0; i < std::size(cases); ++i) {
                EXPECT_EQ(verdict(i), cases[i].is_still ? Verdict::kStill : Verdict::kMoving) << i;
            }
            EXPECT_EQ(verdict(std::size(cases)), Verdict::kNone);
            (*judge_)->clear(std::size(cases));
            for (std::size_t i = 0; i < std::size(cases); ++i) EXPECT_EQ(verdict(i), Verdict::kNone);
        }
    }
}

// Promise: what only odometry's drift explains stands still and keeps its weight, but is neither refined nor taken for
// seen where it is.
TEST_F(Judge, WhatDriftExplainsIsNotMoved) {
    const std::size_t drifted = add(2, 0.05), near = add();
    correspondences_[drifted].p_anchor = pose_ * seen(drifted).point();
    correspondences_[drifted].drift_var = 0.05 * 0.05;
    const Vector3 before = vector_of(point(drifted).world);
    point(drifted).agreed_travelled = point(near).agreed_travelled = 3;
    EXPECT_EQ(judge(), 0U);
    EXPECT_EQ(still(), (std::vector<std::uint16_t>{0, 1}));
    EXPECT_EQ(verdict(drifted), Verdict::kStill);
    EXPECT_EQ((vector_of(point(drifted).world) - before).squaredNorm(), 0);
    EXPECT_EQ(point(drifted).agreed_travelled, 3);
    EXPECT_EQ(point(near).agreed_travelled, 12.5F);
}

// Promise: a still point's weight rises by a tenth and is clamped at max, a moving one's falls by a tenth and is
// clamped at 0 (Algorithm 2), in sure frames, with depth, in a map that learns, with the region enabled: otherwise it
// stays.
TEST_F(Judge, WeightsMoveByTheta) {
    struct Condition {
        bool is_sure, is_frozen, has_depth, is_region_enabled;
    };
    for (const std::uint32_t max : {20U, 40U}) {
        for (const Condition condition : {Condition{true, false, true, true}, Condition{false, false, true, true},
                                          Condition{true, true, true, true}, Condition{true, false, false, true},
                                          Condition{true, false, true, false}}) {
            Parameters parameters = test::small_parameters();
            parameters.weights.max = max;
            parameters.weights.suspect_steps = 0;
            parameters.weights.eligible = 0;
            parameters.region.is_enabled = condition.is_region_enabled;
            start(parameters);
            const bool moves =
                condition.is_sure && !condition.is_frozen && condition.has_depth && condition.is_region_enabled;
            is_sure_ = condition.is_sure;
            is_frozen_ = condition.is_frozen;
            const std::size_t still = add(), moving = add(2, 0.5);
            correspondences_[still].has_depth = correspondences_[moving].has_depth = condition.has_depth;
            if (!condition.has_depth) correspondences_[moving].normalised.x() += 0.5;
            for (std::uint32_t i = 1; i <= 50; ++i) {
                judge();
                const std::uint32_t rises = moves ? i : 0, falls = rises;
                EXPECT_EQ(point(still).weight_tenths, std::min(15 + rises, max));
                EXPECT_EQ(point(moving).weight_tenths, falls < 15 ? 15 - falls : 0);
                ASSERT_EQ(verdict(moving), Verdict::kMoving);
                correspondences_[still].p_world = correspondences_[still].p_anchor;
            }
        }
    }
}

// Promise: a point loses its weight when its weight has fallen suspect_steps steps below the static threshold, no
// sooner.
TEST_F(Judge, OneBadFrameIsNotMotion) {
    for (const std::uint32_t suspect_steps : {0U, 1U, 3U, 6U}) {
        for (const std::uint32_t eligible : {8U, 10U}) {
            Parameters parameters = test::small_parameters();
            parameters.weights.suspect_steps = suspect_steps;
            parameters.weights.eligible = eligible;
            start(parameters);
            const std::size_t i = add(2, 0.5);
            point(i).weight_tenths = static_cast<std::uint8_t>(eligible);
            std::uint32_t frames = 0;
            while (!point(i).is_suspect && frames < 20) {
                judge();
                ++frames;
            }
            EXPECT_EQ(frames, std::max(suspect_steps, 1U));
        }
    }
}

// Promise: what has no weight is seen to move beyond region.wide_factor squared times point_chi2_max off its anchor,
// exactly; nearer than that it is not clear.
TEST_F(Judge, SuspectsMoveBeyondTheThreshold) {
    for (const double factor : {1.5, 2.0}) {
        Parameters parameters = test::small_parameters();
        parameters.region.wide_factor = factor;
        start(parameters);
        for (const double share : {0.0, 0.999, 1.001}) {
            const std::size_t i = add();
            const Vector3 ray = pose_.rotation * seen(i).point() / 2.0;
            const double far_chi2 = factor * factor * parameters.region.point_chi2_max;
            correspondences_[i].p_anchor += ray * off_of_chi2(share * far_chi2);
            correspondences_[i].is_dynamic = true;
        }
        EXPECT_EQ(judge(), 3U);
        EXPECT_EQ(verdict(0), Verdict::kUnclear);
        EXPECT_EQ(verdict(1), Verdict::kUnclear);
        EXPECT_EQ(verdict(2), Verdict::kMoving);
    }
}

// Promise: a point without a weight earns it back when it has stood at its anchor for more than proven_s and its weight
// has come up to the threshold; it then counts as new. Off its anchor it loses weight; too soon, neither.
TEST_F(Judge, StandingStillEarnsTheVoteBack) {
    for (const double proven_s : {0.7, 2.0}) {
        Parameters parameters = test::small_parameters();
        parameters.weights.proven_s = proven_s;
        start(parameters);
        const std::size_t soon = add(), late = add(), weak = add(), off = add(2, 0.5), off_soon = add(2, 0.5);
        const std::size_t a_little_off = add(2, off_of_chi2(1.5 * parameters.region.point_chi2_max));
        const std::int64_t needed_ns = static_cast<std::int64_t>(proven_s * 1e9);
        for (const std::size_t i : {soon, late, weak, off, off_soon, a_little_off}) {
            correspondences_[i].is_dynamic = true;
            point(i).is_suspect = true;
            point(i).weight_tenths = 9;
            point(i).anchor_ns = kNow_ns - needed_ns - 1;
        }
        point(soon).anchor_ns = point(off_soon).anchor_ns = kNow_ns - needed_ns;
        point(weak).weight_tenths = 8;
        EXPECT_EQ(judge(), 6U) << "it counts from the next frame on";
        EXPECT_TRUE(still().empty());
        for (const std::size_t i : {soon, late, weak, a_little_off}) EXPECT_EQ(verdict(i), Verdict::kUnclear);
        for (const std::size_t i : {off, off_soon}) EXPECT_EQ(verdict(i), Verdict::kMoving);
        EXPECT_EQ(point(soon).weight_tenths, 9);
        EXPECT_TRUE(point(soon).is_suspect);
        EXPECT_EQ(point(late).weight_tenths, 10);
        EXPECT_FALSE(point(late).is_suspect);
        EXPECT_EQ(point(late).created_ns, kNow_ns);
        EXPECT_EQ(point(weak).weight_tenths, 9);
        EXPECT_TRUE(point(weak).is_suspect);
        EXPECT_EQ(point(weak).created_ns, kNow_ns - 10 * kSecond);
        EXPECT_EQ(point(off).weight_tenths, 8);
        EXPECT_EQ(point(off_soon).weight_tenths, 8);
        EXPECT_EQ(point(a_little_off).weight_tenths, 8) << "the anchor is sharper here than for those with a weight";
        EXPECT_TRUE(point(off).is_suspect);
    }
}

// Promise: a still point is refined by a Kalman filter in the camera's frame: its depth by the variances along the ray,
// its direction by those across it; the variance is at least variance_min of one measurement's, so that the
// map keeps learning.
TEST_F(Judge, StillPointsAreFiltered) {
    for (const double variance_min : {0.1, 0.8}) {
        Parameters parameters = test::small_parameters();
        parameters.weights.variance_min = variance_min;
        parameters.camera.readout_s = 0.02;
        start(parameters);
        Vector6 motion;
        motion << 0.02, 0.01, -0.01, 0.01, 0.02, 0;
        shutter_.set_motion(se3_exp(motion), 1.0 / 30);
        const std::size_t i = add(2.5, 0.004);
        MapPoint& point = this->point(i);
        Correspondence& c = correspondences_[i];
        c.p_world += pose_.rotation * Vector3(0.003, -0.002, 0);
        const Vector3 readout_before(0.1, 0.2, -0.3);
        store(readout_before, point.world_by_readout);
        point.var_z = 3 * seen(i).var_z;
        point.var_lateral = 0.5 * seen(i).var_pixel * 2.5 * 2.5;
        c.map_var_z = point.var_z;  // whatever the noise of the frame is, the map's variances are the model's
        const double gain_z = 0.75, gain_lateral = 1.0 / 3;
        const Vector3 q = pose_.inverse() * c.p_world;
        const Vector2 direction_before(q.x() / q.z(), q.y() / q.z());
        ASSERT_EQ(judge(), 0U);
        const Vector3 after = pose_.inverse() * vector_of(point.world);
        EXPECT_NEAR(after.z(), q.z() + gain_z * (2.5 - q.z()), 1e-12);
        for (int k = 0; k < 2; ++k) {
            const double before = direction_before(k), measured = seen(i).normalised(k);
            EXPECT_NEAR(after(k) / after.z(), before + gain_lateral * (measured - before), 1e-12);
        }
        EXPECT_NEAR(point.var_z / seen(i).var_z, std::max(3 * (1 - gain_z), variance_min), 1e-9);
        EXPECT_NEAR(point.var_lateral / (seen(i).var_pixel * 2.5 * 2.5),
                    std::max(0.5 * (1 - gain_lateral), variance_min), 1e-9);
        // How the point moves with the readout, in the camera, with the same gains.
        const Matrix3 to_camera = pose_.rotation.transpose();
        const Vector3 told = to_camera * shutter_.by_readout(pose_, c.p_camera, frame_->measured.keypoint(i).y);
        const Vector3 was = to_camera * readout_before, is = to_camera * vector_of(point.world_by_readout);
        for (int k = 0; k < 3; ++k) {
            EXPECT_NEAR(is(k), was(k) + (k < 2 ? gain_lateral : gain_z) * (told(k) - was(k)), 1e-6);
        }
        EXPECT_GT(std::sqrt((told - was).squaredNorm()), 0.05);
    }
}

// Promise: many looks of one place lead the point there, from whatever side, and a frozen map stays as it is.
TEST_F(Judge, ManyLooksConverge) {
    const std::size_t i = add(2, 0.01);
    const Vector3 truth = pose_ * seen(i).point();
    is_frozen_ = true;
    judge();
    EXPECT_EQ((vector_of(point(i).world) - correspondences_[i].p_world).squaredNorm(), 0);
    is_frozen_ = false;
    double before_m = 1;
    for (int frame = 0; frame < 300; ++frame) {
        judge();
        const double off_m = std::sqrt((vector_of(point(i).world) - truth).squaredNorm());
        EXPECT_LE(off_m, before_m);
        before_m = off_m;
        correspondences_[i].p_world = vector_of(point(i).world);
    }
    EXPECT_LT(before_m, 1e-5);
}

// Promise: a point without a weight is where the frame sees it, and looks as it does there; its anchor stays until it
// is half as old again as proven_s, or until the point has just lost its weight. Not without depth, nor in a frozen
// map.
TEST_F(Judge, PointsWithoutAVoteAreFollowed) {
    Parameters parameters = test::small_parameters();
    parameters.camera.readout_s = 0.02;
    for (const double proven_s : {0.5, 2.0}) {
        parameters.weights.proven_s = proven_s;
        start(parameters);
        Vector6 motion;
        motion << 0.02, 0.01, -0.01, 0.01, 0.02, 0;
        shutter_.set_motion(se3_exp(motion), 1.0 / 30);
        const std::size_t young = add(2, 0.5), old = add(2, 0.5), fallen = add(2, 0.5), blind = add(2, 0.5);
        frame_->extractor.keypoints[young].angle_rad = 0.4F;
        frame_->extractor.keypoints[young].level = 2;
        frame_->measure();
        const std::int64_t age_ns = static_cast<std::int64_t>(1.5 * proven_s * 1e9);
        for (const std::size_t i : {young, old, fallen, blind}) {
            correspondences_[i].is_dynamic = i != fallen;
            point(i).is_suspect = i != fallen;
            point(i).weight_tenths = 8;
            point(i).anchor_ns = kNow_ns - age_ns;
        }
        point(old).anchor_ns = kNow_ns - age_ns - 1;
        point(fallen).anchor_ns = kNow_ns - 1;
        correspondences_[blind].has_depth = false;
        correspondences_[blind].normalised.x() += 0.5;
        const Vector3 blind_before = vector_of(point(blind).world);
        is_frozen_ = true;
        judge();
        for (const std::size_t i : {young, old, fallen}) {
            EXPECT_GT((vector_of(point(i).world) - pose_ * seen(i).point()).squaredNorm(), 0.2) << "a frozen map";
        }
        is_frozen_ = false;
        judge();
        EXPECT_EQ((vector_of(point(blind).world) - blind_before).squaredNorm(), 0);
        for (const std::size_t i : {young, old, fallen}) {
            const MapPoint& p = point(i);
            const Vector3 here = pose_ * seen(i).point();
            const Vector3 by_readout = shutter_.by_readout(pose_, seen(i).point(), frame_->measured.keypoint(i).y);
            EXPECT_TRUE(p.is_suspect);
            EXPECT_EQ((vector_of(p.world) - here).squaredNorm(), 0);
            EXPECT_LT((vector_of(p.world_by_readout) - by_readout).squaredNorm(), 1e-12);
            EXPECT_GT(by_readout.squaredNorm(), 1e-4);
            EXPECT_EQ(p.var_z, seen(i).var_z);
            EXPECT_EQ(p.var_lateral, seen(i).var_pixel * 4);
            EXPECT_EQ(p.descriptor, test::descriptor_of(i));
            EXPECT_EQ(p.agreed_travelled, 12.5F);
            EXPECT_EQ(p.distance_m, 2);
            EXPECT_EQ(p.level, i == young ? 2 : 0);
            EXPECT_EQ(p.angle_rad, i == young ? 0.4F : 0);
            const bool is_anchored_anew = i != young;
            EXPECT_EQ(p.anchor_ns == kNow_ns, is_anchored_anew);
            EXPECT_EQ((vector_of(p.anchor) - here).squaredNorm() == 0, is_anchored_anew);
            EXPECT_EQ(p.anchor_var_z == p.var_z && p.anchor_var_lateral == p.var_lateral &&
                          (vector_of(p.anchor_by_readout) - vector_of(p.world_by_readout)).squaredNorm() == 0,
                      is_anchored_anew);
        }
    }
}

// Promise: a match is a sight of the point, still or moving, and sights are counted to 65535 unless the map is frozen.
TEST_F(Judge, SightsAreCounted) {
    const std::size_t still = add(), moving = add(2, 0.5), full = add();
    point(full).seen = 0xffff;
    is_sure_ = false;
    judge();
    for (const std::size_t i : {still, moving, full}) EXPECT_EQ(point(i).last_seen_frame, kNumber);
    EXPECT_EQ(point(still).seen, 21);
    EXPECT_EQ(point(moving).seen, 21);
    EXPECT_EQ(point(full).seen, 0xffff);
    is_frozen_ = true;
    point(still).last_seen_frame = 0;
    judge();
    EXPECT_EQ(point(still).seen, 21);
    EXPECT_EQ(point(still).last_seen_frame, kNumber);
}

}  // namespace
}  // namespace stillmesh::point_judge_test
