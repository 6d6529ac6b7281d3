// A camera that moves and reads its rows one by one, and the shutter that tracking has of it.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "engine/tracking/tracked_shutter.hpp"
#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::test {

inline constexpr double kReadout_s = 0.02;
inline constexpr double kPeriod_s = 1.0 / 30;
inline constexpr double kChi2Max = 11.34;

// 72 features, 12 rows of 6, as far away as they like, seen by a camera that moves and reads its rows one by one; the
// map knows all of their points.
class ShutterRig : public ::testing::Test {
protected:
    ShutterRig() { start(small_parameters()); }
    void start(const Parameters& parameters) {
        frame_.reset();
        world_ = std::make_unique<SmallWorld>(parameters);
        frame_ = std::make_unique<SmallFrame>(**world_);
        shutter_ = TrackedShutter{};
        shutter_.create(parameters, 120);
        shutter_.reset();
        points_.clear();
        correspondences_.clear();
        pose_ = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
        speed_ << 0.5, -0.4, 0.3, 0.4, 0.6, -0.5;
    }
    // What the frame shows when its rows take readout_s, the pose being the middle row's.
    void see(double readout_s, std::uint32_t rows = 12) {
        for (std::uint32_t n = 0; n < 6 * rows; ++n) {
            const std::uint32_t x = 15 + 25 * (n % 6), y = 5 + 10 * (n / 6);
            const double z_m = 1.2 + 0.4 * (n % 5);
            frame_->add(x, y, z_m, descriptor_of(n));
            points_.push_back(world_->add_point(pose_ * in_middle_row(x, y, z_m, readout_s)));
        }
        frame_->measure();
        for (std::uint32_t n = 0; n < 6 * rows; ++n) {
            const MapPoint& point = (*world_)[points_[n]];
            Correspondence c;
            c.feature = n;
            c.point_slot = points_[n].slot();
            c.normalised = frame_->measured[n].normalised;
            c.p_camera = frame_->measured[n].point();
            c.var_pixel = 1e-6;
            c.var_z = c.map_var_z = c.map_var_lateral = 1e-6;
            c.has_depth = true;
            c.p_world = vector_of(point.world);
            correspondences_.push_back(c);
        }
    }
    [[nodiscard]] Vector3 in_middle_row(double x, double y, double z_m, double readout_s) const {
        return moved_a_little(speed_ * ((y / 120 - 0.5) * readout_s), point_at_pixel(x, y, z_m));
    }
    void learn(bool counts = true) {
        shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
        shutter_.learn(frame_->measured, world_->map(), correspondences_, all_of(correspondences_), pose_, 1e6, counts);
    }

    // A frame whose camera turned by `off` beside what its motion makes expect, from its first row to its last; the map
    // is as good as the matches say. Returns what of that the rows are carried with.
    Vector3 turned(const Vector3& off, Random& random, bool counts = true, double true_readout_s = kReadout_s) {
        shutter_.begin_frame();
        shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
        Vector6 sweep = speed_ * true_readout_s;
        sweep.tail<3>() += off;
        for (Correspondence& c : correspondences_) {
            const MeasuredFeature& m = frame_->measured[c.feature];
            c.row = frame_->measured.row_of(c.feature);
            c.p_world = pose_ * moved_a_little(sweep * c.row, back_project(m.seen, m.seen_z_m)) +
                        random_normal_vector(random, 1e-3);
        }
        carry();
        EXPECT_EQ(measure_turn(), shutter_.is_trembling());
        const Vector3 out = shutter_.sweep().tail<3>() - speed_.tail<3>() * shutter_.readout_s();
        carry();
        shutter_.learn(frame_->measured, world_->map(), correspondences_, all_of(correspondences_), pose_, 1e6, counts);
        return out;
    }
    void carry() {
        frame_->measured.carry_to_middle_row(shutter_.sweep());
        for (Correspondence& c : correspondences_) {
            c.normalised = frame_->measured[c.feature].normalised;
            c.p_camera = frame_->measured[c.feature].point();
        }
    }
    [[nodiscard]] bool measure_turn(std::size_t matches = 72) {
        std::vector<std::uint16_t> chosen = all_of(correspondences_);
        chosen.resize(matches);
        return shutter_.measure_turn(correspondences_, chosen, pose_, kChi2Max);
    }
    // The readout is given, so that only the turn is learnt.
    void start_given(double readout_s = kReadout_s) {
        Parameters parameters = small_parameters();
        parameters.camera.readout_s = readout_s;
        start(parameters);
        see(kReadout_s);
    }

    std::unique_ptr<SmallWorld> world_;
    std::unique_ptr<SmallFrame> frame_;
    TrackedShutter shutter_;
    std::vector<Handle<MapPoint>> points_;
    std::vector<Correspondence> correspondences_;
    SE3 pose_;
    Vector6 speed_ = Vector6::Zero();
};

}  // namespace stillmesh::test
