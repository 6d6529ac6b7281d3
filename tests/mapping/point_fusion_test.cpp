#include "engine/mapping/point_fusion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "tests/support/map_fault.hpp"
#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::point_fusion_test {
namespace {

// The n-th descriptor with so many bits the other way.
Descriptor off_by(std::uint64_t n, std::uint32_t bits) {
    Descriptor out = test::descriptor_of(n);
    for (std::uint32_t i = 0; i < bits; ++i) out.words[i / 64] ^= std::uint64_t{1} << (i % 64);
    return out;
}

// A keyframe that points are projected into.
class Fusion : public testing::Test {
protected:
    Fusion() { start(test::small_parameters()); }
    void start(const Parameters& parameters, std::uint32_t keyframes_max = 8) {
        Limits limits = Limits::tiny();
        limits.keyframes_max = keyframes_max;
        world_ = std::make_unique<test::SmallWorld>(parameters, limits);
        ArenaPlan plan;
        PointFusion::plan(plan, limits);
        memory_ = std::make_unique<test::Memory>(plan.used_bytes());
        Arena arena(memory_->span());
        fusion_.create(arena, **world_);
        (*world_)->noise = {1, 1};
        pose_ = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
        target_ = world_->add_keyframe(pose_, 5);
        others_.clear();
    }
    // A feature of the target at a pixel; z_m 0: without depth.
    std::uint32_t see(double x, double y, double z_m, const Descriptor& descriptor, Handle<MapPoint> point = {},
                      std::uint8_t level = 0) {
        Observation seen;
        seen.point = point;
        seen.x = static_cast<float>(x);
        seen.y = static_cast<float>(y);
        seen.z_m = static_cast<float>(z_m);
        seen.var_z = z_m > 0 ? 1e-4F : -1.0F;
        seen.level = level;
        map().add_observation(target_, seen, descriptor);
        return (*world_)[target_].observations - 1;
    }
    // A point of another keyframe where the target sees the pixel.
    Handle<MapPoint> add_point(double x, double y, double z_m, const Descriptor& descriptor,
                               std::uint32_t observers = 1) {
        const Handle<MapPoint> out = world_->add_point(pose_ * test::point_at_pixel(x, y, z_m), descriptor);
        (*world_)[out].distance_m = static_cast<float>(z_m);
        for (std::uint32_t i = 0; i < observers; ++i) {
            while (others_.size() <= i) others_.push_back(world_->add_keyframe(pose_, 10 + others_.size()));
            Observation seen;
            seen.point = out;
            map().add_observation(others_[i], seen, descriptor);
        }
        return out;
    }
    std::uint32_t fuse(Handle<MapPoint> point) {
        static_cast<void>(fusion_.set_target(target_));
        const std::uint32_t units = fusion_.fuse(point);
        EXPECT_LE(units, PointFusion::units_max((*world_)->limits));
        EXPECT_STREQ(test::find_fault(map()), nullptr);
        return units;
    }
    [[nodiscard]] Map& map() { return world_->map(); }
    [[nodiscard]] Handle<MapPoint> shown(std::uint32_t feature) { return map().observations(target_)[feature].point; }

    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::Memory> memory_;
    PointFusion fusion_;
    SE3 pose_;
    Handle<Keyframe> target_;
    std::vector<Handle<Keyframe>> others_;
};

// Promise: a point that the keyframe missed is observed by the feature that shows it; asked again nothing happens.
TEST_F(Fusion, MissedPointsAreObserved) {
    const Handle<MapPoint> point = add_point(60, 50, 2, test::descriptor_of(1));
    see(61, 50, 2, test::descriptor_of(2));
    const std::uint32_t feature = see(61, 51, 2, off_by(1, 10));
    EXPECT_GT(fuse(point), 0U);
    EXPECT_EQ(shown(feature), point);
    EXPECT_EQ((*world_)[point].observers, 2);
    EXPECT_EQ((*world_)->statistics.mapping.observations_found, 1U);
    EXPECT_EQ(fuse(point), 0U);
    EXPECT_EQ((*world_)->statistics.mapping.observations_found, 1U);
    fusion_.forget_target();
    EXPECT_FALSE(fusion_.has_target(target_));
}

// Promise: two points at the same place become one: the one with more observers, of equals the one made earlier, of
// those made together the one that is asked for. It has the observations of both.
TEST_F(Fusion, DuplicatesBecomeTheOlder) {
    struct Case {
        std::uint32_t observers;  // of the one asked for; the other has 2
        std::int64_t age_ns;      // by which the one asked for is older
        bool keeps_asked;
    };
    for (const Case& c :
         {Case{3, -5, true}, Case{1, 5, false}, Case{2, 5, true}, Case{2, -5, false}, Case{2, 0, true}}) {
        start(test::small_parameters());
        const Handle<MapPoint> asked = add_point(60, 50, 2, test::descriptor_of(1), c.observers);
        const Handle<MapPoint> other = add_point(60, 50, 2.01, test::descriptor_of(1), 1);
        (*world_)[asked].created_ns = 100 - c.age_ns;
        (*world_)[other].created_ns = 100;
        (*world_)[asked].seen = 30;
        (*world_)[other].seen = 12;
        const std::uint32_t feature = see(60, 50, 2, test::descriptor_of(1), other);
        ASSERT_EQ((*world_)[other].observers, 2);
        fuse(asked);
        const Handle<MapPoint> kept = c.keeps_asked ? asked : other, gone = c.keeps_asked ? other : asked;
        EXPECT_NE(map().points().find(kept), nullptr);
        EXPECT_EQ(map().points().find(gone), nullptr);
        EXPECT_EQ(shown(feature), kept);
        EXPECT_EQ((*world_)[kept].seen, 42);
        EXPECT_EQ((*world_)[kept].observers, std::max(c.observers, 1U) + 1U);
        EXPECT_EQ(map().statistics().points_fused, 1U);
        EXPECT_EQ((*world_)->statistics.mapping.observations_found, 0U);
    }
}

// Promise: what moves, is gone, behind the camera, nearer than depth.z_min_m or outside the picture is left as it is,
// and so is a rival that moves.
TEST_F(Fusion, OnlyStillPointsInView) {
    const auto is_found = [&](const Vector3& p_camera) {
        const Handle<MapPoint> point = world_->add_point(pose_ * p_camera, test::descriptor_of(1));
        (*world_)[point].distance_m = static_cast<float>(std::abs(p_camera.z()));
        const std::uint64_t before = (*world_)->statistics.mapping.observations_found;
        fuse(point);
        return (*world_)->statistics.mapping.observations_found > before;
    };
    for (const double z_min_m : {0.3, 0.5}) {
        Parameters parameters = test::small_parameters();
        parameters.depth.z_min_m = z_min_m;
        start(parameters);
        see(80, 60, 0, test::descriptor_of(1));
        for (const double x : {0.2, 158.5}) see(x, 60, 0, test::descriptor_of(1));
        for (const double y : {0.2, 118.5}) see(80, y, 0, test::descriptor_of(1));
        EXPECT_FALSE(is_found(test::point_at_pixel(80, 60, z_min_m - 0.01)));
        EXPECT_TRUE(is_found(test::point_at_pixel(80, 60, z_min_m + 0.01)));
        EXPECT_FALSE(is_found(-test::point_at_pixel(80, 60, 2)));
        EXPECT_FALSE(is_found(test::point_at_pixel(-0.1, 60, 2)));
        EXPECT_TRUE(is_found(test::point_at_pixel(0.1, 60, 2)));
        EXPECT_FALSE(is_found(test::point_at_pixel(160.1, 60, 2)));
        EXPECT_TRUE(is_found(test::point_at_pixel(159.9, 60, 2)));
        EXPECT_FALSE(is_found(test::point_at_pixel(80, -0.1, 2)));
        EXPECT_TRUE(is_found(test::point_at_pixel(80, 0.1, 2)));
        EXPECT_FALSE(is_found(test::point_at_pixel(80, 120.1, 2)));
        EXPECT_TRUE(is_found(test::point_at_pixel(80, 119.9, 2)));
    }
    start(test::small_parameters());
    const Handle<MapPoint> asked = add_point(60, 50, 2, test::descriptor_of(1), 2);
    const Handle<MapPoint> rival = add_point(60, 50, 2, test::descriptor_of(1));
    const std::uint32_t feature = see(60, 50, 2, test::descriptor_of(1), rival);
    (*world_)[asked].is_suspect = true;
    EXPECT_EQ(fuse(asked), 0U);
    (*world_)[asked].is_suspect = false;
    (*world_)[rival].is_suspect = true;
    fuse(asked);
    EXPECT_EQ(shown(feature), rival);
    EXPECT_EQ(map().statistics().points_fused, 0U);
    (*world_)[rival].is_suspect = false;
    map().release_point(asked);
    EXPECT_EQ(fuse(asked), 0U);
    EXPECT_EQ(shown(feature), rival);
}

// Promise: a feature is looked for within matching.radius_posed_px of its level's pixels, alike up to hamming_wide_max,
// at a scale off the expected one by at most kScaleSlack, and at the depth that noise allows: each exactly.
TEST_F(Fusion, AlikeWithinTheLimits) {
    struct Feature {
        double off_px = 0;
        std::uint32_t bits = 0;
        std::uint8_t level = 0;
        double scale = 1;  // that the point is expected at
        double z_m = 0;
        double noise = 1;
    };
    const auto is_found = [&](const Parameters& parameters, const Feature& f) {
        start(parameters);
        const Handle<MapPoint> point = add_point(60, 50, 2, test::descriptor_of(1));
        (*world_)[point].distance_m = static_cast<float>(2 * f.scale);
        (*world_)->noise.depth = f.noise;
        see(60 + 0.6 * f.off_px, 50 - 0.8 * f.off_px, f.z_m, off_by(1, f.bits), {}, f.level);
        fuse(point);
        return (*world_)->statistics.mapping.observations_found == 1;
    };
    for (const bool is_other : {false, true}) {
        Parameters p = test::small_parameters();
        if (is_other) {
            p.matching.radius_posed_px = 7;
            p.matching.hamming_wide_max = 20;
            p.region.edge_chi2_max = 4;
        }
        const MatchingParameters& m = p.matching;
        const double level_scale = p.features.scale_factor;
        EXPECT_TRUE(is_found(p, {.off_px = m.radius_posed_px - 0.01}));
        EXPECT_FALSE(is_found(p, {.off_px = m.radius_posed_px + 0.01}));
        EXPECT_TRUE(is_found(p, {.off_px = m.radius_posed_px * level_scale - 0.01, .level = 1, .scale = level_scale}));
        EXPECT_FALSE(is_found(p, {.off_px = m.radius_posed_px * level_scale + 0.01, .level = 1, .scale = level_scale}));
        EXPECT_TRUE(is_found(p, {.bits = m.hamming_wide_max}));
        EXPECT_FALSE(is_found(p, {.bits = m.hamming_wide_max + 1}));
        EXPECT_TRUE(is_found(p, {.scale = kScaleSlack - 0.01}));
        EXPECT_FALSE(is_found(p, {.scale = kScaleSlack + 0.01}));
        EXPECT_TRUE(is_found(p, {.level = 1, .scale = level_scale / (kScaleSlack - 0.01)}));
        EXPECT_FALSE(is_found(p, {.level = 1, .scale = level_scale / (kScaleSlack + 0.01)}));
        for (const double noise : {1.0, 9.0}) {
            const double end_m = std::sqrt(p.region.edge_chi2_max * noise * (1e-4 + 1e-4));
            EXPECT_TRUE(is_found(p, {.z_m = 2 + end_m - 1e-4, .noise = noise}));
            EXPECT_FALSE(is_found(p, {.z_m = 2 + end_m + 1e-4, .noise = noise}));
            EXPECT_FALSE(is_found(p, {.z_m = 2 - end_m - 1e-4, .noise = noise}));
        }
        EXPECT_TRUE(is_found(p, {.z_m = 0})) << "what has no depth may be anywhere along its ray";
    }
}

// Promise: of several features the one most alike is taken, whether it shows a point or not.
TEST_F(Fusion, TheMostAlikeCounts) {
    for (const std::uint32_t best : {0U, 1U, 2U}) {
        start(test::small_parameters());
        const Handle<MapPoint> point = add_point(60, 50, 2, test::descriptor_of(1));
        for (std::uint32_t i = 0; i < 3; ++i) see(59 + i, 50, 2, off_by(1, i == best ? 5 : 20 + i));
        fuse(point);
        for (std::uint32_t i = 0; i < 3; ++i) EXPECT_EQ(shown(i) == point, i == best);
    }
}

// Promise: two points are the same up to region.point_chi2_max, along the ray by the depth's noise and across it by
// their variances; exactly.
TEST_F(Fusion, TheSamePlaceAsFarAsKnown) {
    for (const double chi2_max : {5.0, 11.34}) {
        for (const double noise : {1.0, 3.0}) {
            Parameters parameters = test::small_parameters();
            parameters.region.point_chi2_max = chi2_max;
            parameters.region.edge_chi2_max = 1000;
            const auto are_same = [&](const Vector3& off) {
                start(parameters);
                (*world_)->noise.depth = noise;
                const Handle<MapPoint> asked = add_point(60, 50, 2, test::descriptor_of(1));
                const Handle<MapPoint> rival = world_->add_point(
                    pose_ * (test::point_at_pixel(60, 50, 2) * (1 + off.z() / 2) + Vector3(off.x(), off.y(), 0)));
                (*world_)[rival].var_z = 3e-4;
                (*world_)[rival].var_lateral = 2e-4;
                see(60, 50, 0, test::descriptor_of(1), rival);
                fuse(asked);
                return map().statistics().points_fused == 1;
            };
            const double along_m = std::sqrt(chi2_max * (noise * 4e-4 + 1e-6)), across_m = std::sqrt(chi2_max * 3e-4);
            EXPECT_TRUE(are_same(Vector3(0, 0, 0.999 * along_m)));
            EXPECT_FALSE(are_same(Vector3(0, 0, 1.001 * along_m)));
            EXPECT_FALSE(are_same(Vector3(0, 0, -1.001 * along_m)));
            EXPECT_TRUE(are_same(Vector3(0.6, -0.8, 0) * (0.999 * across_m)));
            EXPECT_FALSE(are_same(Vector3(0.6, -0.8, 0) * (1.001 * across_m)));
            EXPECT_TRUE(are_same(Vector3(0.6 * 0.7 * across_m, -0.8 * 0.7 * across_m, 0.7 * along_m)));
            EXPECT_FALSE(are_same(Vector3(0.6 * 0.75 * across_m, -0.8 * 0.75 * across_m, 0.75 * along_m)));
        }
    }
}

// Promise: a point that more than 16 keyframes observe does not go: its fusion would be a long piece.
TEST_F(Fusion, MuchObservedPointsStay) {
    for (const std::uint32_t observers : {16U, 17U}) {
        start(test::small_parameters(), 24);
        const Handle<MapPoint> asked = add_point(60, 50, 2, test::descriptor_of(1), 18);
        const Handle<MapPoint> rival = add_point(60, 50, 2, test::descriptor_of(1), observers - 1);
        see(60, 50, 2, test::descriptor_of(1), rival);
        ASSERT_EQ((*world_)[rival].observers, observers);
        fuse(asked);
        EXPECT_EQ(map().points().find(rival) == nullptr, observers == 16);
    }
}

// Promise: points can be fused into one keyframe after another, each pointed at once; one that has left the map costs a
// unit and nothing else.
TEST_F(Fusion, IntoOneKeyframeAfterAnother) {
    const Handle<MapPoint> first = add_point(60, 50, 2, test::descriptor_of(1));
    const Handle<MapPoint> second = add_point(90, 50, 2, test::descriptor_of(2));
    for (int i = 0; i < 40; ++i) see(5 + i, 110, 0, test::descriptor_of(100));
    const std::uint32_t of_first = see(60, 50, 2, test::descriptor_of(1)),
                        of_second = see(90, 50, 2, test::descriptor_of(2));
    EXPECT_FALSE(fusion_.has_target(target_));
    const std::uint32_t with_pointing = fusion_.fuse_into(first, target_);
    EXPECT_TRUE(fusion_.has_target(target_));
    const std::uint32_t without = fusion_.fuse_into(second, target_);
    EXPECT_EQ(with_pointing, without + 42 / 8) << "a unit for eight features";
    EXPECT_EQ(shown(of_first), first);
    EXPECT_EQ(shown(of_second), second);
    const Handle<Keyframe> other = others_[0];
    EXPECT_GT(fusion_.fuse_into(first, other), 0U);
    EXPECT_TRUE(fusion_.has_target(other));
    EXPECT_FALSE(fusion_.has_target(target_));
    const Handle<Keyframe> another = world_->add_keyframe(pose_, 50);
    Observation seen;
    seen.x = 90;
    seen.y = 50;
    map().add_observation(another, seen, test::descriptor_of(2));
    EXPECT_LT(fusion_.fuse_into(second, another), with_pointing) << "one feature, not those of the targets before";
    EXPECT_EQ(map().observations(another)[0].point, second);
    fusion_.forget_target();
    EXPECT_FALSE(fusion_.has_target(another));
    map().release_keyframe(target_);
    EXPECT_EQ(fusion_.fuse_into(first, target_), 1U);
}

}  // namespace
}  // namespace stillmesh::point_fusion_test
