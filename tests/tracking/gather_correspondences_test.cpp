#include "engine/tracking/gather_correspondences.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::gather_correspondences_test {
namespace {

constexpr std::int64_t kNow_ns = 100'000'000'000;
constexpr std::int64_t kSecond = 1'000'000'000;

class Gather : public testing::Test {
protected:
    Gather() { start(test::small_parameters()); }
    void start(const Parameters& parameters) {
        out_.reset();
        frame_.reset();
        world_ = std::make_unique<test::SmallWorld>(parameters);
        frame_ = std::make_unique<test::SmallFrame>(**world_);
        out_ = std::make_unique<test::InMemory<FixedVector<Correspondence>>>(std::size_t{100});
        points_.clear();
    }
    // A feature z_m away (0: without depth) that will be matched, and its point, 2 m away if the feature has no depth.
    MapPoint& add(double z_m = 2, std::uint8_t level = 0) {
        const auto n = static_cast<std::uint32_t>(points_.size());
        const std::uint32_t x = 10 + 14 * (n % 10), y = 10 + 14 * (n / 10);
        frame_->add(x, y, z_m, test::descriptor_of(n), level);
        const double there_m = z_m > 0 ? z_m : 2;
        points_.push_back(world_->add_point(pose_ * test::point_at_pixel(x, y, there_m), test::descriptor_of(n)));
        MapPoint& point = (*world_)[points_[n]];
        point.distance_m = static_cast<float>(there_m);
        point.level = level;
        point.created_ns = point.anchor_ns = kNow_ns - 10 * kSecond;
        return point;
    }
    const std::vector<Correspondence>& gather() {
        frame_->measure();
        frame_->matcher.by_projection(world_->map(), nullptr, pose_, 3);
        gather_correspondences(frame_->matcher, frame_->measured, world_->map(), noise_, context_, kNow_ns,
                               (*world_)->parameters, **out_);
        gathered_.assign((*out_)->begin(), (*out_)->end());
        return gathered_;
    }
    [[nodiscard]] Correspondence gather_one() {
        EXPECT_EQ(gather().size(), 1U);
        return gathered_.at(0);
    }

    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::SmallFrame> frame_;
    std::unique_ptr<test::InMemory<FixedVector<Correspondence>>> out_;
    std::vector<Correspondence> gathered_;
    std::vector<Handle<MapPoint>> points_;
    SE3 pose_ = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
    NoiseFactors noise_;
    RegionContext context_;
};

// Promise: every match becomes one correspondence, in the order of the features, with what was measured, where the map
// has the point, and where it was first seen; what matches nothing is left out, and so is what was gathered before.
TEST_F(Gather, OneForEachMatch) {
    for (int round = 0; round < 2; ++round) {
        start(test::small_parameters());
        for (const double z_m : {1.0, 2.0, 0.0, 3.0}) {
            MapPoint& point = add(z_m);
            point.anchor[0] += 0.01;
            frame_->add(static_cast<std::uint32_t>(10 + 14 * points_.size()), 100, 2, test::descriptor_of(500));
        }
        const auto& all = gather();
        ASSERT_EQ(all.size(), 4U);
        for (std::size_t i = 0; i < 4; ++i) {
            const Correspondence& c = all[i];
            const MeasuredFeature& m = frame_->measured[2 * i];
            const MapPoint& point = (*world_)[points_[i]];
            EXPECT_EQ(c.feature, 2 * i);
            EXPECT_EQ(c.point_slot, points_[i].slot());
            EXPECT_EQ(c.has_depth, i != 2);
            EXPECT_EQ((c.normalised - m.normalised).squaredNorm(), 0);
            EXPECT_EQ((c.p_camera - (c.has_depth ? m.point() : Vector3(0, 0, 0))).squaredNorm(), 0);
            EXPECT_EQ((c.p_world - vector_of(point.world)).squaredNorm(), 0);
            EXPECT_EQ((c.p_anchor - vector_of(point.anchor)).squaredNorm(), 0);
            EXPECT_EQ(c.distance_bits, frame_->matcher.claim(2 * i).distance_bits);
        }
    }
}

// Promise: each says in tenths of a second, not rounded up, how long its point has had a vote; from the future: not
// yet, and longer than can be told: as long as can. What lost its vote has stood for no time, and so has all while the
// static region is switched off.
TEST_F(Gather, HowLongItStood) {
    const struct {
        std::int64_t ns;
        std::uint16_t tenths;
    } ages[] = {{0, 0},        {kSecond / 10 - 1, 0},   {kSecond / 10, 1},         {kSecond * 7 / 2, 35},
                {-kSecond, 0}, {kSecond * 6553, 65530}, {kSecond * 100'000, 65535}};
    for (const auto& age : ages) add().created_ns = kNow_ns - age.ns;
    const auto& all = gather();
    ASSERT_EQ(all.size(), std::size(ages));
    for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(all[i].stood_tenths, ages[i].tenths) << ages[i].ns;
    (*world_)[points_[3]].is_suspect = true;
    EXPECT_EQ(gather().at(3).stood_tenths, 0);
    EXPECT_EQ(gather().at(2).stood_tenths, 1);
    (*world_)->parameters.region.is_enabled = false;
    for (const Correspondence& c : gather()) EXPECT_EQ(c.stood_tenths, 0);
}

// Promise: measured and map variances are the model's times the noise of the frame, across the ray by that of pixels,
// along it by that of depth; what a turn shifts the depth image against the picture by is added to the measured depth.
TEST_F(Gather, VariancesFollowTheNoise) {
    for (const NoiseFactors noise : {NoiseFactors{1, 1}, NoiseFactors{0.1, 4}}) {
        for (const double turn_rad_s : {0.0, 2.0}) {
            for (const double slip_share : {0.2, 1.0}) {
                Parameters parameters = test::small_parameters();
                parameters.prediction.slip_share = slip_share;
                start(parameters);
                noise_ = noise;
                context_.rotation_speed_rad_s = turn_rad_s;
                context_.colour_depth_lag_s = 0.02;
                MapPoint& point = add(2.5, 1);
                point.var_z = 3e-4;
                point.var_lateral = 5e-5;
                const Correspondence c = gather_one();
                const double sigma_z = parameters.depth.sigma_z_per_m2 * 2.5 * 2.5;
                const double slip_m = slip_share * turn_rad_s * 0.02 * 2.5;
                EXPECT_NEAR(c.var_z, noise.depth * sigma_z * sigma_z + slip_m * slip_m, 1e-12);
                EXPECT_NEAR(c.var_pixel, noise.pixel * std::pow(parameters.features.scale_factor, 2) / (130.0 * 128.0),
                            1e-12);
                EXPECT_NEAR(c.map_var_z, noise.depth * 3e-4, 1e-15);
                EXPECT_NEAR(c.map_var_lateral, noise.pixel * 5e-5, 1e-15);
            }
        }
    }
}

// Promise: a point that was out of sight while the camera went some way may be off by drift_share of it, at most
// drift_max_m, and never by less than nothing.
TEST_F(Gather, OutOfSightDrifts) {
    for (const double share : {0.001, 0.05}) {
        for (const double max_m : {0.02, 0.3}) {
            for (const double travelled : {-3.0, 0.0, 4.0, 100.0}) {
                Parameters parameters = test::small_parameters();
                parameters.weights.drift_share = share;
                parameters.weights.drift_max_m = max_m;
                start(parameters);
                context_.travelled = 7 + travelled;
                add().agreed_travelled = 7;
                const double drift_m = std::max(0.0, std::min(share * travelled, max_m));
                EXPECT_NEAR(gather_one().drift_var, drift_m * drift_m, 1e-12);
            }
        }
    }
}

// Promise: an anchor is less certain with its age, by drift_m and drift_m_s, at most drift_max_m, beside its own
// variance.
TEST_F(Gather, AnchorsDriftWithTheirAge) {
    for (const double drift_m : {0.001, 0.004}) {
        for (const double drift_m_s : {0.0, 0.003}) {
            for (const double max_m : {0.005, 0.02}) {
                for (const std::int64_t age_s : {0, 1, 4, 1000}) {
                    Parameters parameters = test::small_parameters();
                    parameters.weights.drift_m = drift_m;
                    parameters.weights.drift_m_s = drift_m_s;
                    parameters.weights.drift_max_m = max_m;
                    start(parameters);
                    noise_ = {0.5, 2};
                    MapPoint& point = add();
                    point.anchor_ns = kNow_ns - age_s * kSecond;
                    point.anchor_var_z = 3e-4;
                    point.anchor_var_lateral = 5e-5;
                    const Correspondence c = gather_one();
                    const double drift = std::min(drift_m + drift_m_s * static_cast<double>(age_s), max_m);
                    EXPECT_NEAR(c.anchor_var_z, 2 * 3e-4 + drift * drift, 1e-12);
                    EXPECT_NEAR(c.anchor_var_lateral, 0.5 * 5e-5 + drift * drift, 1e-12);
                }
            }
        }
    }
}

// Promise: a correspondence's weight is its point's over the largest, from `unproven` of that when it is new to all of
// it after proven_s, with the square of its age between; it never falls with age.
TEST_F(Gather, VotesGrowWithThePast) {
    for (const double proven_s : {0.5, 2.0}) {
        for (const double unproven : {0.03, 0.5}) {
            for (const std::uint32_t max : {20U, 40U}) {
                double before = 0;
                for (const double age : {0.0, 0.25, 0.5, 1.0, 3.0}) {  // of proven_s
                    Parameters parameters = test::small_parameters();
                    parameters.weights.proven_s = proven_s;
                    parameters.weights.unproven = unproven;
                    parameters.weights.max = max;
                    start(parameters);
                    MapPoint& point = add();
                    point.created_ns = kNow_ns - static_cast<std::int64_t>(age * proven_s * 1e9);
                    point.weight_tenths = 15;
                    const Correspondence c = gather_one();
                    const double past = std::min(age * age, 1.0);
                    EXPECT_NEAR(c.weight, (unproven + (1 - unproven) * past) * 15 / max, 1e-12);
                    EXPECT_GE(c.weight, before);
                    EXPECT_FALSE(c.is_dynamic);
                    before = c.weight;
                }
                EXPECT_NEAR(before, 15.0 / max, 1e-12);
            }
        }
    }
}

// Promise: a point that was seen to move has no weight, whatever its weight.
TEST_F(Gather, SuspectsDoNotVote) {
    add().is_suspect = true;
    const Correspondence c = gather_one();
    EXPECT_TRUE(c.is_dynamic);
    EXPECT_EQ(c.weight, 0);
}

// Promise: with the region disabled every match counts alike, whatever the map knows of its past: no suspects, no
// drift, and the anchor is the place.
TEST_F(Gather, WithoutARegionAllVoteAlike) {
    Parameters parameters = test::small_parameters();
    parameters.region.is_enabled = false;
    start(parameters);
    noise_ = {0.5, 2};
    context_.travelled = 100;
    add().is_suspect = true;
    add().weight_tenths = 1;
    MapPoint& point = add();
    point.created_ns = kNow_ns;
    point.anchor[1] += 1;
    point.var_z = 3e-4;
    ASSERT_EQ(gather().size(), 3U);
    for (const Correspondence& c : gathered_) {
        EXPECT_EQ(c.weight, 1);
        EXPECT_FALSE(c.is_dynamic);
        EXPECT_EQ(c.drift_var, 0);
        EXPECT_EQ((c.p_anchor - c.p_world).squaredNorm(), 0);
        EXPECT_EQ(c.anchor_var_z, c.map_var_z);
        EXPECT_EQ(c.anchor_var_lateral, c.map_var_lateral);
    }
}

}  // namespace
}  // namespace stillmesh::gather_correspondences_test
