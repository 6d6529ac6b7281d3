#include "engine/tracking/keyframe_inserter.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/tracking/free_space.hpp"
#include "engine/tracking/gather_correspondences.hpp"
#include "tests/support/map_fault.hpp"
#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::keyframe_inserter_test {
namespace {

constexpr std::int64_t kNow_ns = 100'000'000'000;
constexpr std::uint64_t kNumber = 200;

// What a feature of the frame shows.
enum class Shows : std::uint8_t { kNew, kNewWithoutDepth, kStill, kMoving, kSuspect, kMovingSuspect };

class Inserter : public testing::Test {
protected:
    Inserter() { start(test::small_parameters()); }
    void start(const Parameters& parameters, const Limits& limits = Limits::tiny()) {
        still_.reset();
        correspondences_.reset();
        judge_.reset();
        inserter_.reset();
        frame_.reset();
        world_ = std::make_unique<test::SmallWorld>(parameters, limits);
        frame_ = std::make_unique<test::SmallFrame>(**world_);
        judge_ = std::make_unique<test::InWorld<PointJudge>>(**world_);
        correspondences_ =
            std::make_unique<test::InMemory<FixedVector<Correspondence>>>(std::size_t{limits.features_max});
        still_ = std::make_unique<test::InMemory<FixedVector<std::uint16_t>>>(std::size_t{limits.features_max});
        shutter_ = TrackedShutter{};
        shutter_.create(parameters, 120);
        shutter_.reset();
        inserter_ = std::make_unique<test::InWorld<KeyframeInserter>>(**world_);
        (*inserter_)->reset();
        pose_ = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
        points_.clear();
    }
    // A feature at a pixel, z_m away. Its index; points_ has its point, if it shows one.
    std::size_t add(std::uint32_t x, std::uint32_t y, Shows shows, double z_m = 2) {
        const std::size_t n = points_.size();
        frame_->add(x, y, shows == Shows::kNewWithoutDepth ? 0 : z_m, test::descriptor_of(n));
        points_.push_back({});
        if (shows == Shows::kNew || shows == Shows::kNewWithoutDepth) return n;
        points_[n] = world_->add_point(pose_ * test::point_at_pixel(x, y, z_m), test::descriptor_of(n));
        MapPoint& point = (*world_)[points_[n]];
        point.distance_m = static_cast<float>(z_m);
        point.anchor_ns = point.created_ns = kNow_ns - 10'000'000'000;
        point.is_suspect = shows == Shows::kSuspect || shows == Shows::kMovingSuspect;
        if (shows == Shows::kMoving || shows == Shows::kMovingSuspect) point.anchor[0] += 0.5;
        return n;
    }
    // The n-th of places that are far from each other.
    std::size_t add(Shows shows, double z_m = 2) {
        const auto n = static_cast<std::uint32_t>(points_.size());
        return add(10 + 12 * (n % 12), 10 + 12 * (n / 12), shows, z_m);
    }
    // Which feature shows which point, and what moves.
    void match() {
        World& world = **world_;
        frame_->measure();
        frame_->matcher.by_projection(world.map, nullptr, pose_, 3);
        RegionContext context;
        gather_correspondences(frame_->matcher, frame_->measured, world.map, {}, context, kNow_ns, world.parameters,
                               **correspondences_);
        const PointJudge::Witness witness{{frame_->measured, shutter_, pose_, kNumber, kNow_ns, 0}, false, true};
        (*judge_)->judge((*correspondences_)->span(), witness, world.map, **still_);
        world.local_map.build(world.map, pose_);
    }
    [[nodiscard]] std::uint32_t static_count() { return static_cast<std::uint32_t>((*still_)->size()); }
    double insert(std::uint64_t number = kNumber) {
        return (*inserter_)
            ->insert({{frame_->measured, shutter_, pose_, number, kNow_ns, 8.5},
                      frame_->matcher,
                      **judge_,
                      static_count(),
                      1.25},
                     **world_);
    }
    [[nodiscard]] Map& map() { return world_->map(); }
    [[nodiscard]] Handle<Keyframe> newest() { return map().recent_keyframe(0); }
    // The point that the newest keyframe's feature shows; nullptr: none.
    [[nodiscard]] const MapPoint* shown(std::size_t feature) {
        return map().points().find(map().observations(newest())[feature].point);
    }

    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::SmallFrame> frame_;
    std::unique_ptr<test::InWorld<PointJudge>> judge_;
    std::unique_ptr<test::InMemory<FixedVector<Correspondence>>> correspondences_;
    std::unique_ptr<test::InMemory<FixedVector<std::uint16_t>>> still_;
    TrackedShutter shutter_;
    std::unique_ptr<test::InWorld<KeyframeInserter>> inserter_;
    SE3 pose_;
    std::vector<Handle<MapPoint>> points_;  // by feature
};

// Promise: a keyframe is wanted when there is enough new to see, less is tracked than tracked_share_max of what was
// after the last one, and gap_min frames have passed: each at its threshold, exactly.
TEST_F(Inserter, WantedAtTheThresholds) {
    for (const bool is_other : {false, true}) {
        Parameters p = test::small_parameters();
        p.keyframes.tracked_urgent_permille = 0;
        p.keyframes.tracked_share_max = is_other ? 0.5 : 0.75;
        p.keyframes.new_points_min = is_other ? 7 : 40;
        p.keyframes.gap_min = is_other ? 3 : 8;
        start(p);
        (*inserter_)->begin_after(10);
        (*inserter_)->set_tracked(200);
        const std::uint64_t due = 10 + p.keyframes.gap_min;
        const std::uint32_t enough = is_other ? 100 : 150, possible = p.keyframes.new_points_min;
        EXPECT_TRUE((*inserter_)->wants(due, enough - 1, possible));
        EXPECT_TRUE((*inserter_)->wants(due + 1000, 0, possible + 1000));
        EXPECT_FALSE((*inserter_)->wants(due - 1, enough - 1, possible)) << "too soon";
        EXPECT_FALSE((*inserter_)->wants(due, enough, possible)) << "enough is tracked";
        EXPECT_FALSE((*inserter_)->wants(due, enough - 1, possible - 1)) << "nothing new to see";
    }
}

// Promise: where less than half of tracked_share_max of the last keyframe is tracked, or less than
// tracked_urgent_permille of the features, a quarter of gap_min suffices; likewise while nothing is known of what was
// tracked.
TEST_F(Inserter, UrgentlyWantedSooner) {
    for (const bool is_other : {false, true}) {
        Parameters p = test::small_parameters();
        p.keyframes.tracked_share_max = is_other ? 0.5 : 1.0;
        p.keyframes.tracked_urgent_permille = is_other ? 200 : 120;
        p.keyframes.gap_min = is_other ? 16 : 8;
        p.features.count = is_other ? 50 : 100;
        start(p);
        const std::uint64_t due = 10 + p.keyframes.gap_min / 4;
        const std::uint32_t share = is_other ? 50 : 100, count = is_other ? 10 : 12;
        const std::uint32_t possible = p.keyframes.new_points_min;
        (*inserter_)->begin_after(10);
        EXPECT_TRUE((*inserter_)->wants(due, 1000, possible)) << "nothing is known";
        EXPECT_FALSE((*inserter_)->wants(due - 1, 1000, possible));
        (*inserter_)->set_tracked(200);
        EXPECT_TRUE((*inserter_)->wants(due, share - 1, possible));
        EXPECT_FALSE((*inserter_)->wants(due - 1, share - 1, possible));
        EXPECT_FALSE((*inserter_)->wants(due, share, possible)) << "waits for gap_min";
        EXPECT_TRUE((*inserter_)->wants(10 + p.keyframes.gap_min, share, possible));
        EXPECT_FALSE((*inserter_)->wants(due, share - 1, possible - 1)) << "urgent or not";
        (*inserter_)->set_tracked(count + 1);  // of which nearly all is tracked, and yet it is little
        EXPECT_TRUE((*inserter_)->wants(due, count - 1, possible));
        EXPECT_FALSE((*inserter_)->wants(due, count, possible));
    }
}

// Promise: what a keyframe would add are the features with depth that show no point of the map.
TEST_F(Inserter, NewPointsHaveDepthAndNoPoint) {
    for (int i = 0; i < 3; ++i) add(Shows::kNew);
    for (int i = 0; i < 4; ++i) add(Shows::kNewWithoutDepth);
    for (int i = 0; i < 5; ++i) add(Shows::kStill);
    add(Shows::kMoving);
    add(Shows::kSuspect);
    match();
    EXPECT_EQ(static_count(), 5U);
    EXPECT_EQ(KeyframeInserter::new_points_possible(frame_->measured, frame_->matcher), 3U);
}

// Promise: a keyframe carries the frame's pose, times, shutter, drift and way, and hangs on the keyframe that shares
// most with it; the map holds together.
TEST_F(Inserter, KeyframesCarryTheFrame) {
    Parameters parameters = test::small_parameters();
    parameters.camera.readout_s = 0.02;
    start(parameters);
    Vector6 motion;
    motion << 0.02, 0.01, -0.01, 0.01, 0.02, 0;
    shutter_.set_motion(se3_exp(motion), 0.04);
    const Handle<Keyframe> parent = world_->add_keyframe(pose_, 90);
    static_cast<void>(world_->add_keyframe(pose_, 100));  // newer, and shares nothing
    for (int i = 0; i < 6; ++i) {
        Observation seen;
        seen.point = points_[add(Shows::kStill)];
        map().add_observation(parent, seen);
    }
    add(Shows::kNew);
    match();
    insert();
    const Keyframe& keyframe = (*world_)[newest()];
    EXPECT_EQ((keyframe.world_from_camera.translation - pose_.translation).squaredNorm(), 0);
    EXPECT_EQ((keyframe.world_from_camera.rotation - pose_.rotation).cwiseAbs().maxCoeff(), 0);
    EXPECT_EQ(keyframe.frame, kNumber);
    EXPECT_EQ(keyframe.last_useful_frame, kNumber);
    EXPECT_EQ(keyframe.time_ns, kNow_ns);
    EXPECT_EQ(keyframe.drift_m, 1.25F);
    EXPECT_EQ(keyframe.travelled, 8.5F);
    EXPECT_EQ(keyframe.readout_s, 0.02);
    EXPECT_LT((keyframe.speed - motion / 0.04).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_EQ((keyframe.pose_by_readout - shutter_.pose_by_readout()).cwiseAbs().maxCoeff(), 0);
    EXPECT_EQ(keyframe.parent, parent);
    EXPECT_EQ(map().shared(newest().slot(), parent.slot()), 6U);
    EXPECT_STREQ(test::find_fault(map()), nullptr);
}

// Promise: every feature becomes an observation, in its order; it shows its point where that stands still, or is
// followed without a weight, but not where it has just moved.
TEST_F(Inserter, WhatDoesNotFitIsNoObservation) {
    const std::size_t still = add(Shows::kStill), moving = add(Shows::kMoving), suspect = add(Shows::kSuspect);
    const std::size_t blind = add(Shows::kNewWithoutDepth);
    match();
    insert();
    const auto observations = map().observations(newest());
    ASSERT_EQ(observations.size(), 4U);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(observations[i].x, frame_->measured.keypoint(i).x);
        EXPECT_EQ(observations[i].var_z, static_cast<float>(frame_->measured[i].var_z));
        EXPECT_EQ(map().descriptors(newest())[i], test::descriptor_of(i));
    }
    EXPECT_EQ(observations[still].point, points_[still]);
    EXPECT_EQ(observations[suspect].point, points_[suspect]);
    EXPECT_EQ(shown(moving), nullptr);
    EXPECT_EQ(shown(blind), nullptr);
    EXPECT_EQ(map().points().size(), 3U);
    EXPECT_STREQ(test::find_fault(map()), nullptr);
}

// Promise: a new point lies where the frame sees it, as uncertain as it was measured, with weights.eligible, and
// tracking looks for it from the next frame on.
TEST_F(Inserter, NewPointsAreWhatTheFrameSaw) {
    for (const std::uint32_t start_weight : {10U, 12U}) {
        Parameters parameters = test::small_parameters();
        parameters.weights.eligible = start_weight;
        parameters.camera.readout_s = 0.02;
        start(parameters);
        Vector6 motion;
        motion << 0.02, 0.01, -0.01, 0.01, 0.02, 0;
        shutter_.set_motion(se3_exp(motion), 0.04);
        const std::size_t i = add(30, 100, Shows::kNew, 2.5);
        frame_->extractor.keypoints[i].angle_rad = 0.4F;
        frame_->extractor.keypoints[i].level = 2;
        match();
        insert();
        const MapPoint* const point = shown(i);
        ASSERT_NE(point, nullptr);
        const MeasuredFeature& m = frame_->measured[i];
        const Vector3 place = pose_ * m.point();
        EXPECT_LT((vector_of(point->world) - place).squaredNorm(), 1e-24);
        EXPECT_LT((vector_of(point->anchor) - place).squaredNorm(), 1e-24);
        const Vector3 by_readout = shutter_.by_readout(pose_, m.point(), 100);
        EXPECT_GT(by_readout.squaredNorm(), 1e-3);
        EXPECT_LT((vector_of(point->world_by_readout) - by_readout).squaredNorm(), 1e-12);
        EXPECT_LT((vector_of(point->anchor_by_readout) - by_readout).squaredNorm(), 1e-12);
        for (const double var : {point->var_z, point->anchor_var_z}) EXPECT_EQ(var, m.var_z);
        for (const double var : {point->var_lateral, point->anchor_var_lateral}) {
            EXPECT_NEAR(var, m.var_pixel * 2.5 * 2.5, 1e-15);
        }
        EXPECT_EQ(point->descriptor, test::descriptor_of(i));
        EXPECT_EQ(point->angle_rad, 0.4F);
        EXPECT_EQ(point->level, 2);
        EXPECT_EQ(point->distance_m, 2.5F);
        EXPECT_EQ(point->created_ns, kNow_ns);
        EXPECT_EQ(point->anchor_ns, kNow_ns);
        EXPECT_EQ(point->last_seen_frame, kNumber);
        EXPECT_EQ(point->agreed_travelled, 8.5F);
        EXPECT_EQ(point->weight_tenths, start_weight);
        EXPECT_FALSE(point->is_suspect);
        EXPECT_EQ(point->seen, 1);
        EXPECT_EQ(point->observers, 1);
        const auto local = world_->map().points().handle_of(map().observations(newest())[i].point.slot()).slot();
        const auto listed = (*world_)->local_map.points();
        EXPECT_EQ(std::count(listed.begin(), listed.end(), local), 1);
        EXPECT_STREQ(test::find_fault(map()), nullptr);
    }
}

// Promise: the share that is renewed is what was added over what was tracked and added; the next keyframe is compared
// with what was tracked and one for every new_per_tracked that were added.
TEST_F(Inserter, SharesAndWhatIsComparedWith) {
    for (const std::uint32_t new_per_tracked : {1U, 2U, 5U}) {
        Parameters p = test::small_parameters();
        p.keyframes.new_per_tracked = new_per_tracked;
        p.keyframes.tracked_share_max = 1;
        p.keyframes.tracked_urgent_permille = 0;
        p.keyframes.gap_min = 1;
        p.keyframes.new_points_min = 1;
        start(p);
        for (int i = 0; i < 20; ++i) add(Shows::kStill);
        for (int i = 0; i < 30; ++i) add(Shows::kNew);
        add(Shows::kNewWithoutDepth);
        match();
        EXPECT_NEAR(insert(), 30.0 / 50.0, 1e-12);
        const std::uint32_t compared = 20 + 30 / new_per_tracked;
        EXPECT_TRUE((*inserter_)->wants(kNumber + 1, compared - 1, 1));
        EXPECT_FALSE((*inserter_)->wants(kNumber + 1, compared, 1));
        EXPECT_FALSE((*inserter_)->wants(kNumber, 0, 1)) << "the gap begins anew";
    }
    start(test::small_parameters());
    frame_->measure();
    (*judge_)->clear(0);
    EXPECT_EQ(insert(), 0) << "of an empty frame";
    start(test::small_parameters());
    add(Shows::kNew);
    match();
    EXPECT_EQ(insert(), 1) << "all that there is";
}

// Promise: what a frame sees is kept with the keyframe that it becomes, or beside the nearest one, from a second after
// the first that could have been kept and then once a second, from where it was seen, and what moves is marked; a
// keyframe's own is kept whenever it is made, and a world without depth images or keyframes keeps none.
TEST_F(Inserter, KeepsWhatItSeesOnceASecond) {
    for (const bool is_mapping : {true, false}) {
        Limits limits = Limits::tiny();
        limits.depth_images_max = 4;
        Parameters parameters = test::small_parameters();
        parameters.mapping.is_enabled = is_mapping;
        start(parameters, limits);
        World& world = **world_;
        const std::size_t still = add(Shows::kStill), moving = add(Shows::kMoving);
        for (int i = 0; i < 10; ++i) add(Shows::kStill);
        match();
        for (Correspondence& c : (*correspondences_)->span()) c.is_moving = c.feature == moving;
        const auto source = [&](int after_ms, std::uint64_t number) {
            const std::int64_t time_ns = kNow_ns + std::int64_t{1'000'000} * after_ms;
            return KeyframeInserter::Source{{frame_->measured, shutter_, pose_, number, time_ns, 8.5},
                                            frame_->matcher,
                                            **judge_,
                                            static_count(),
                                            1.25,
                                            (*correspondences_)->span()};
        };
        const auto kept = [&] {
            std::uint32_t count = 0;
            for (const DepthImages::Owner& owner : world.depth_images.owners())
                count += owner.keyframe.is_null() ? 0U : 1U;
            return count;
        };
        (*inserter_)->look(source(0, kNumber - 1), world);
        (*inserter_)->insert(source(0, kNumber), world);
        const Handle<Keyframe> first = newest();
        const SE3 first_pose = pose_;
        (*inserter_)->look(source(999, kNumber + 1), world);
        ASSERT_EQ(kept(), 0U);
        (*inserter_)->look(source(1000, kNumber + 2), world);
        ASSERT_EQ(kept(), 1U);
        pose_ = pose_ * se3_exp((Vector6() << 0.01, 0.02, -0.01, 0.01, 0, 0.02).finished());
        (*inserter_)->look(source(1999, kNumber + 3), world);
        ASSERT_EQ(kept(), 1U);
        (*inserter_)->look(source(2000, kNumber + 4), world);
        ASSERT_EQ(kept(), 2U);
        (*inserter_)->insert(source(2001, kNumber + 5), world);
        ASSERT_EQ(kept(), 3U);
        (*inserter_)->look(source(3000, kNumber + 6), world);
        ASSERT_EQ(kept(), 3U) << "a second after the keyframe's own";
        const auto owners = world.depth_images.owners();
        const std::uint64_t frames[] = {kNumber + 2, kNumber + 4, kNumber + 5};
        for (std::uint32_t i = 0; i < 3; ++i) {
            EXPECT_EQ(owners[i].frame, frames[i]);
            EXPECT_EQ(owners[i].is_later, i < 2) << i;
            EXPECT_TRUE(owners[i].keyframe == (i < 2 ? first : newest()));
            const SE3 expected = i == 1 ? first_pose.inverse() * pose_ : SE3{};
            EXPECT_LT(se3_log(expected.inverse() * owners[i].keyframe_from_camera).norm(), 1e-9) << i;
            const DepthImage image = world.depth_images.at(i, map().keyframes());
            const auto cell_of = [&](std::size_t feature) {
                const Keypoint& at = frame_->measured.keypoint(feature);
                return static_cast<std::size_t>(at.y / 2) * image.columns + static_cast<std::size_t>(at.x / 2);
            };
            EXPECT_TRUE(image.is_moving(cell_of(moving)));
            EXPECT_FALSE(image.is_moving(cell_of(still)));
            EXPECT_EQ(image.depth_mm[cell_of(still)], 2000);
        }
    }
    start(test::small_parameters());
    add(Shows::kStill);
    match();
    insert();
    (*inserter_)
        ->look({{frame_->measured, shutter_, pose_, kNumber + 1, 2 * kNow_ns, 8.5}, frame_->matcher, **judge_},
               **world_);
    EXPECT_TRUE((*world_)->depth_images.owners().empty());
}

// Promise: a new feature with more moving than still ones near it, at its depth, begins without a weight and renews
// nothing; neighbours without depth or at another depth say nothing, and neither do those that have no weight and are
// where they were first seen; a tie is no suspicion.
TEST_F(Inserter, NewAmongMovingIsSuspicious) {
    struct Case {
        std::uint32_t moving, still, behind, blind, suspects;
        bool is_suspicious;
    };
    const Case cases[] = {{0, 0, 0, 0, 0, false}, {1, 0, 0, 0, 0, true},  {1, 1, 0, 0, 0, false},
                          {2, 1, 0, 0, 0, true},  {0, 0, 3, 0, 0, false}, {1, 1, 3, 0, 0, false},
                          {0, 0, 0, 3, 0, false}, {0, 1, 0, 0, 0, false}, {0, 0, 0, 0, 4, false},
                          {1, 1, 0, 0, 4, false}, {1, 0, 0, 0, 4, true}};
    for (const Case& c : cases) {
        for (const bool is_region_enabled : {true, false}) {
            Parameters parameters = test::small_parameters();
            parameters.weights.suspicious = 7;
            parameters.region.is_enabled = is_region_enabled;
            start(parameters);
            const std::size_t i = add(80, 60, Shows::kNew);
            std::uint32_t n = 0;
            const auto beside = [&](Shows shows, double z_m) {
                const std::size_t added = add(70 + 6 * (n % 4), 66 + 6 * (n / 4), shows, z_m);
                ++n;
                return added;
            };
            for (std::uint32_t k = 0; k < c.moving; ++k)
                beside(k % 2 == 0 ? Shows::kMoving : Shows::kMovingSuspect, 2.1);
            for (std::uint32_t k = 0; k < c.still; ++k) beside(Shows::kStill, 1.9);
            for (std::uint32_t k = 0; k < c.suspects; ++k) beside(Shows::kSuspect, 2.1);
            for (std::uint32_t k = 0; k < c.behind; ++k) beside(Shows::kMoving, 3.5);
            for (std::uint32_t k = 0; k < c.blind; ++k) {
                const std::size_t blind = beside(Shows::kMoving, 2.1);
                const Keypoint& keypoint = frame_->extractor.keypoints[blind];
                frame_->paint(static_cast<std::uint32_t>(keypoint.x), static_cast<std::uint32_t>(keypoint.y), 0);
                (*world_)[points_[blind]].anchor[0] += 2;
            }
            match();
            const double share = insert();
            ASSERT_NE(shown(i), nullptr);
            if (!is_region_enabled) {  // nothing is ever suspicious
                EXPECT_EQ(shown(i)->weight_tenths, 10);
                continue;
            }
            EXPECT_EQ(shown(i)->weight_tenths, c.is_suspicious ? 7 : 10)
                << c.moving << ' ' << c.still << ' ' << c.suspects;
            EXPECT_EQ(shown(i)->is_suspect, c.is_suspicious);
            EXPECT_NEAR(share, c.is_suspicious ? 0 : 1.0 / (1.0 + c.still), 1e-12);
        }
    }
}

// Promise: "near" is matching.radius_wide_px in the picture, up to a cell of the grid, and in depth near_m beside
// near_sigmas deviations, exactly; weights.suspicious at the static threshold or above is no suspicion.
TEST_F(Inserter, NearIsConfigured) {
    const auto is_suspicious = [&](Parameters parameters, std::uint32_t px, double dz_m) {
        start(parameters);
        const std::size_t i = add(20, 60, Shows::kNew);
        add(20 + px, 60, Shows::kMoving, 2 + dz_m);
        match();
        insert();
        EXPECT_EQ(shown(i)->weight_tenths == parameters.weights.suspicious,
                  shown(i)->is_suspect || parameters.weights.suspicious >= parameters.weights.eligible);
        return shown(i)->is_suspect;
    };
    for (const double near_px : {20.0, 70.0}) {
        Parameters p = test::small_parameters();
        p.matching.radius_wide_px = near_px;
        EXPECT_TRUE(is_suspicious(p, static_cast<std::uint32_t>(near_px), 0));
        EXPECT_FALSE(is_suspicious(p, static_cast<std::uint32_t>(near_px) + FeatureGrid::kCellSide_px, 0));
        p.weights.suspicious = p.weights.eligible;
        EXPECT_FALSE(is_suspicious(p, 8, 0));
    }
    for (const double near_m : {0.1, 0.4}) {
        Parameters p = test::small_parameters();
        p.weights.near_m = near_m;
        p.weights.near_sigmas = 0;
        EXPECT_TRUE(is_suspicious(p, 8, near_m - 0.001));
        EXPECT_FALSE(is_suspicious(p, 8, near_m + 0.001));
        EXPECT_FALSE(is_suspicious(p, 8, -near_m - 0.001));
    }
    for (const double sigmas : {3.0, 9.0}) {
        Parameters p = test::small_parameters();
        p.weights.near_m = 0;
        p.weights.near_sigmas = sigmas;
        const auto noise_m = [&](double dz_m) {
            return sigmas * p.depth.sigma_z_per_m2 * std::hypot(4.0, (2 + dz_m) * (2 + dz_m));
        };
        double end_m = 0;
        for (int round = 0; round < 50; ++round) end_m = noise_m(end_m);  // where the two are that far apart
        EXPECT_TRUE(is_suspicious(p, 8, end_m - 0.001)) << end_m;
        EXPECT_FALSE(is_suspicious(p, 8, end_m + 0.001)) << end_m;
    }
}

// Promise: in a full pool so many points go as the keyframe adds, no more, and none that this frame sees; the local
// map's go last. Where no room can be made the frame's features stay without points.
TEST_F(Inserter, MakesRoomForPoints) {
    for (const bool is_mapping : {true, false}) {
        Parameters parameters = test::small_parameters();
        parameters.mapping.is_enabled = is_mapping;
        Limits limits = Limits::tiny();
        limits.map_points_max = 100;
        start(parameters, limits);
        std::vector<std::size_t> still;
        for (int i = 0; i < 20; ++i) still.push_back(add(Shows::kStill));
        for (int i = 0; i < 30; ++i) add(Shows::kNew);
        std::vector<Handle<MapPoint>> behind;  // the camera: not in the local map
        while (!map().points().is_full()) {
            behind.push_back(world_->add_point(pose_ * Vector3(0, 0, -2)));
            (*world_)[behind.back()].last_seen_frame = kNumber - 10;
        }
        match();
        insert();
        EXPECT_TRUE(map().points().is_full());
        EXPECT_EQ(map().statistics().points_evicted, 30U);
        for (const std::size_t i : still) EXPECT_EQ(shown(i), map().points().find(points_[i]));
        std::size_t left = 0;
        for (const Handle<MapPoint> point : behind) left += map().points().find(point) != nullptr ? 1U : 0U;
        EXPECT_EQ(left, behind.size() - 30);
        EXPECT_STREQ(test::find_fault(map()), nullptr);

        start(parameters, limits);
        for (int i = 0; i < 30; ++i) add(Shows::kNew);
        while (!map().points().is_full()) {
            const Handle<MapPoint> seen = world_->add_point(pose_ * Vector3(0, 0, -2));
            (*world_)[seen].last_seen_frame = kNumber;
        }
        match();
        insert();
        EXPECT_EQ(map().statistics().points_evicted, 0U);
        EXPECT_EQ(map().observations(newest()).size(), 30U);
        for (std::size_t i = 0; i < 30; ++i) EXPECT_EQ(shown(i), nullptr);
    }
}

// Promise: points of the local map are spared as long as others can go, where the map is refined.
TEST_F(Inserter, SparesTheLocalMap) {
    Limits limits = Limits::tiny();
    limits.map_points_max = 60;
    start(test::small_parameters(), limits);
    for (int i = 0; i < 20; ++i) add(Shows::kNew);
    std::vector<Handle<MapPoint>> before, behind;
    while (!map().points().is_full()) {
        // In view though not seen, and seen longer ago than those behind the camera.
        auto& to = before.size() < 30 ? before : behind;
        to.push_back(world_->add_point(pose_ * Vector3(0, 0, &to == &before ? 3.0 : -2.0)));
        (*world_)[to.back()].last_seen_frame = &to == &before ? 50 : 150;
    }
    ASSERT_EQ(behind.size(), 30U);
    match();
    insert();
    for (const Handle<MapPoint> point : before) EXPECT_NE(map().points().find(point), nullptr);
    EXPECT_EQ(map().statistics().points_evicted, 20U);
}

// Promise: a full pool of keyframes loses one for the new one: the oldest where nothing refines the map; otherwise one
// outside the local map while there is one, and one of the local map when all are.
TEST_F(Inserter, MakesRoomForAKeyframe) {
    for (const bool is_mapping : {false, true}) {
        for (const bool is_all_local : {false, true}) {
            Parameters parameters = test::small_parameters();
            parameters.mapping.is_enabled = is_mapping;
            start(parameters);
            for (int i = 0; i < 4; ++i) add(Shows::kNew);
            std::vector<Handle<Keyframe>> keyframes;
            for (std::uint32_t i = 0; i < 8; ++i) {
                SE3 pose = pose_;  // far away, or here
                if (!is_all_local && i >= 2) pose.translation += Vector3(100 + 10 * i, 0, 0);
                keyframes.push_back(world_->add_keyframe(pose, 10 + i));
            }
            match();
            const std::vector<std::uint8_t> local((*world_)->local_map.keyframes().begin(),
                                                  (*world_)->local_map.keyframes().end());
            insert();
            EXPECT_TRUE(map().keyframes().is_full());
            EXPECT_EQ(map().statistics().keyframes_evicted, 1U);
            EXPECT_EQ((*world_)[newest()].frame, kNumber);
            std::vector<std::size_t> gone;
            for (std::size_t i = 0; i < 8; ++i) {
                if (map().keyframes().find(keyframes[i]) == nullptr) gone.push_back(i);
            }
            ASSERT_EQ(gone.size(), 1U);
            if (!is_mapping) {
                EXPECT_EQ(gone[0], 0U);
            } else if (!is_all_local) {
                EXPECT_EQ(local[keyframes[0].slot()], 1);
                EXPECT_EQ(local[keyframes[gone[0]].slot()], 0);
            }
            EXPECT_STREQ(test::find_fault(map()), nullptr);
        }
    }
}

// Promise: where nothing refines the map a keyframe also clears out weak points that were not seen for long; mapping
// does that itself.
TEST_F(Inserter, CullsWhereNothingElseDoes) {
    for (const bool is_mapping : {false, true}) {
        Parameters parameters = test::small_parameters();
        parameters.mapping.is_enabled = is_mapping;
        start(parameters);
        add(Shows::kNew);
        const Handle<MapPoint> weak = world_->add_point(pose_ * Vector3(0, 0, 3)),
                               strong = world_->add_point(pose_ * Vector3(0, 0, 3));
        (*world_)[weak].seen = 1;
        match();
        insert();
        EXPECT_EQ(map().points().find(weak) == nullptr, !is_mapping);
        EXPECT_NE(map().points().find(strong), nullptr);
    }
}

// Promise: keyframes wait for mapping in their order, and what the queue has no room for is counted as refused; without
// mapping none waits.
TEST_F(Inserter, KeyframesWaitForMapping) {
    for (const bool is_mapping : {true, false}) {
        Parameters parameters = test::small_parameters();
        parameters.mapping.is_enabled = is_mapping;
        start(parameters);
        add(Shows::kNew);
        match();
        const auto& queue = (*world_)->keyframe_queue;
        std::vector<Handle<Keyframe>> made;
        for (std::uint32_t i = 0; i < World::kKeyframeQueueMax + 2; ++i) {
            insert(kNumber + i);
            made.push_back(newest());
        }
        ASSERT_EQ(queue.size(), is_mapping ? World::kKeyframeQueueMax : 0U);
        for (std::size_t i = 0; i < queue.size(); ++i) EXPECT_EQ(queue[i], made[i]);
        const EngineStatistics& statistics = (*world_)->statistics;
        EXPECT_EQ(statistics.keyframes_made, World::kKeyframeQueueMax + 2);
        EXPECT_EQ(statistics.keyframes_refused, is_mapping ? 2U : 0U);
        EXPECT_EQ(statistics.keyframe_queue.high_water, is_mapping ? World::kKeyframeQueueMax : 0U);
        (*inserter_)->reset();
        EXPECT_TRUE((*inserter_)->wants(2, 1000, parameters.keyframes.new_points_min)) << "nothing is known of before";
        EXPECT_FALSE((*inserter_)->wants(1, 1000, parameters.keyframes.new_points_min));
    }
}

// Promise: a new feature where a keyframe saw through, to a point behind it that is known to stand still, is
// suspicious. It is not where points were seen at its own depth, or before it; where what was behind may move, or is
// not known for long, was not seen for a long way, or had no depth; where the keyframe stood elsewhere, so that only
// now something is hidden; and when nobody asks.
TEST_F(Inserter, WhatCameIntoTheRoomIsSuspicious) {
    struct Story {
        const char* name;
        double seen_z_m;
        bool is_came;
        bool is_suspect = false, is_young = false, has_depth = true;
        double aside_m = 0, ray_px = 20, agreed_travelled = 8;
        int new_beside = 0;
    };
    const Story stories[] = {{"behind", 3, true},
                             {"there", 1.5, false},
                             {"before", 1, false},
                             {"moves", 3, false, true},
                             {"young", 3, false, false, true},
                             {"no depth", 3, false, false, false, false},
                             {"hidden only now", 3, false, false, false, true, 0.8},
                             {"not seen for long", 3, false, false, false, true, 0, 20, 3.4},
                             {"seen a while ago", 3, true, false, false, true, 0, 20, 3.6},
                             {"a quarter", 3, true, false, false, true, 0, 20, 8, 3},
                             {"a sixth", 3, false, false, false, true, 0, 20, 8, 5},
                             {"not asked", 3, false, false, false, true, 0, 0}};
    for (const Story& story : stories) {
        Parameters parameters = test::small_parameters();
        parameters.emptiness.ray_px = story.ray_px;
        start(parameters);
        for (int i = 0; i < 6; ++i) add(10 + 12 * static_cast<std::uint32_t>(i), 10, Shows::kStill, 3);
        const std::size_t feature = add(100, 80, Shows::kNew, 1.5);
        for (int i = 0; i < story.new_beside; ++i) add(10 + 12 * static_cast<std::uint32_t>(i), 40, Shows::kNew);
        match();
        SE3 then = pose_;
        then.translation = pose_ * Vector3(story.aside_m, 0, 0);
        const Handle<Keyframe> keyframe = world_->add_keyframe(then, 90);
        const Vector3 p = pose_ * test::point_at_pixel(100, 80, story.seen_z_m);
        Observation seen;
        seen.point = world_->add_point(p, test::descriptor_of(50));
        const Vector3 q = then.inverse() * p;
        seen.x = static_cast<float>(q.x() / q.z() * test::small_camera().fx + test::small_camera().cx);
        seen.y = static_cast<float>(q.y() / q.z() * test::small_camera().fy + test::small_camera().cy);
        seen.z_m = static_cast<float>(q.z());
        seen.var_z = story.has_depth ? 1e-4F : -1.0F;
        MapPoint& point = (*world_)[seen.point];
        point.created_ns = kNow_ns - (story.is_young ? 100'000'000 : 10'000'000'000);
        point.is_suspect = story.is_suspect;
        point.agreed_travelled = static_cast<float>(story.agreed_travelled);
        map().add_observation(keyframe, seen);
        (*world_)->local_map.build((*world_)->map, pose_);
        ASSERT_EQ((*world_)->local_map.keyframes()[keyframe.slot()], 1) << story.name;
        insert();
        ASSERT_NE(shown(feature), nullptr) << story.name;
        EXPECT_EQ(shown(feature)->is_suspect, story.is_came) << story.name;
    }
}

// Promise: what is new beside features that came, at their depth, belongs to the same body though nothing known stands
// behind it; at another depth, or beside more that stands still, it does not.
TEST_F(Inserter, WhatIsBesideWhatCameIsSuspicious) {
    struct Story {
        const char* name;
        double beside_z_m;
        int still;
        bool is_suspect;
    };
    for (const Story& story : {Story{"the same body", 1.55, 0, true}, Story{"as many stand still", 1.55, 2, false},
                               Story{"behind it", 2.6, 0, false}}) {
        start(test::small_parameters());
        for (int i = 0; i < 6; ++i) add(10 + 12 * static_cast<std::uint32_t>(i), 10, Shows::kStill, 3);
        const std::size_t came = add(100, 80, Shows::kNew, 1.5), came_too = add(104, 80, Shows::kNew, 1.5);
        const std::size_t beside = add(130, 80, Shows::kNew, story.beside_z_m);
        for (int i = 0; i < story.still; ++i)
            add(126 + 8 * static_cast<std::uint32_t>(i), 90, Shows::kStill, story.beside_z_m);
        match();
        const Handle<Keyframe> keyframe = world_->add_keyframe(pose_, 90);
        Observation seen;
        seen.point = world_->add_point(pose_ * test::point_at_pixel(102, 80, 3), test::descriptor_of(50));
        (*world_)[seen.point].created_ns = kNow_ns - 10'000'000'000;
        (*world_)[seen.point].agreed_travelled = 8;
        seen.x = 102;
        seen.y = 80;
        seen.z_m = 3;
        seen.var_z = 1e-4F;
        map().add_observation(keyframe, seen);
        (*world_)->local_map.build((*world_)->map, pose_);
        insert();
        for (const std::size_t i : {came, came_too}) {
            ASSERT_NE(shown(i), nullptr);
            EXPECT_TRUE(shown(i)->is_suspect) << story.name;
        }
        ASSERT_NE(shown(beside), nullptr);
        EXPECT_EQ(shown(beside)->is_suspect, story.is_suspect) << story.name;
    }
}

}  // namespace
}  // namespace stillmesh::keyframe_inserter_test
