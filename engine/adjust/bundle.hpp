// What local and global bundle adjustment are given, keep and give back alike: keyframes, points and observations. How
// they solve it is each one's own.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/adjustment_job.hpp"
#include "engine/adjust/point_factor.hpp"
#include "engine/adjust/twin_pose.hpp"
#include "engine/base/numbers.hpp"
#include "engine/base/status.hpp"

namespace stillmesh {

struct AdjustmentObservation {
    std::uint32_t keyframe = 0;  // as add_keyframe() returned it
    std::uint32_t point = 0;     // as add_point() returned it
    double x = 0, y = 0;         // undistorted, normalised (x/z, y/z)
    double var_pixel = 0;        // of x and of y, > 0
    double z_m = 0;              // depth in the camera frame
    double var_z = 0;            // m^2; 0: no depth was measured
};

// The least of the diagonal that damping scales: an unknown that nothing constrains stays where it is.
inline constexpr double kBundleDiagonalMin = 1e-6;
// A keyframe with fewer observations holds still: six unknowns, two residuals each.
inline constexpr std::uint32_t kKeyframeObservationsMin = 3;
// Per observation, in squared sigmas: a problem fitted this well is solved exactly.
inline constexpr double kBundleCostExact = 1e-20;

struct BundleKeyframe : TwinPose {
    std::uint32_t used = 0;  // observations that have a say
    bool is_fixed = false;
};

struct BundlePoint {
    double world[2][3] = {};  // current and candidate
    double factor[6] = {};    // Cholesky factor of the damped Hessian, by rows, its diagonal inverted
    double gradient[3] = {};
    double damping[3] = {};
    std::uint32_t begin = 0, end = 0;  // of its observations
    std::uint32_t given = 0;           // as many as there is room for
    bool is_used = false;              // it has enough of them
    bool can_move = false;             // in this iteration

    void place(const Vector3& at) noexcept {
        for (int k = 0; k < 3; ++k) world[0][k] = world[1][k] = at(k);
    }
    // The candidate is where the point is.
    void stay(std::uint32_t current) noexcept {
        for (int k = 0; k < 3; ++k) world[1 - current][k] = world[current][k];
    }
    // From the sums over its observations: the lower triangle `hessian`, and g, to the damped factor.
    void factorise(double hessian[6], const double g[3], const Descent& descent) noexcept {
        for (int k = 0; k < 3; ++k) {
            double& diagonal = hessian[kPointDiagonal[k]];
            damping[k] = descent.damping_of(diagonal, kBundleDiagonalMin);
            diagonal += damping[k];
            gradient[k] = g[k];
        }
        can_move = factor_point(hessian, factor);
    }
};

[[nodiscard]] inline bool is_finite(const Vector3& v) noexcept {
    return is_finite(v.x()) && is_finite(v.y()) && is_finite(v.z());
}

// `Job`: AdjustmentJob or MatrixFreeJob; its options have chi2_max_pixel and chi2_max_depth, thresholds of Huber's cost
// without and with depth.
template <typename Job, typename Keyframe, typename Point>
class BundleJob : public Job {
public:
    // kFull. kInvalid: not finite.
    [[nodiscard]] Result<std::uint32_t> add_point(const Vector3& world) noexcept {
        STILLMESH_CHECK(this->state_ == Job::State::kCollecting);
        if (point_count_ == points_.size()) return Status::kFull;
        if (!is_finite(world)) return Status::kInvalid;
        points_[point_count_] = Point{};
        points_[point_count_].place(world);
        return point_count_++;
    }
    [[nodiscard]] std::uint32_t keyframes() const noexcept { return keyframe_count_; }
    [[nodiscard]] std::uint32_t points() const noexcept { return point_count_; }

    // Results: only when is_done() (CHECK).
    [[nodiscard]] const SE3& pose(std::uint32_t keyframe) const noexcept {  // world_from_camera
        STILLMESH_CHECK(this->is_done() && keyframe < keyframe_count_);
        return keyframes_[keyframe].pose[this->current_];
    }
    [[nodiscard]] Vector3 point(std::uint32_t point) const noexcept {
        STILLMESH_CHECK(this->is_done() && point < point_count_);
        const double* const world = points_[point].world[this->current_];
        return {world[0], world[1], world[2]};
    }
    // Had a say in the end: its position is worth writing back. Others have too few good observations.
    [[nodiscard]] bool is_point_used(std::uint32_t point) const noexcept {
        STILLMESH_CHECK(this->is_done() && point < point_count_);
        return points_[point].is_used;
    }

protected:
    void forget() noexcept {
        this->state_ = Job::State::kCollecting;
        keyframe_count_ = fixed_count_ = point_count_ = observation_count_ = 0;
    }
    // There is room. kInvalid: not finite, or not a rotation.
    [[nodiscard]] Result<std::uint32_t> take_keyframe(const SE3& world_from_camera, bool is_fixed) noexcept {
        STILLMESH_CHECK(this->state_ == Job::State::kCollecting);
        if (!is_finite(world_from_camera.translation) || !is_rotation(world_from_camera.rotation)) {
            return Status::kInvalid;
        }
        Keyframe& keyframe = keyframes_[keyframe_count_];
        keyframe.used = 0;
        keyframe.is_fixed = is_fixed;
        keyframe.begin(world_from_camera);
        if (is_fixed) ++fixed_count_;
        return keyframe_count_++;
    }
    // If no keyframe is fixed the first one is: somebody must say where the world is.
    void fix_one() noexcept {
        if (fixed_count_ == 0 && keyframe_count_ > 0) keyframes_[0].is_fixed = true;
    }
    [[nodiscard]] double threshold_of(const Sighting& seen) const noexcept {
        return seen.info_z > 0 ? this->options_.chi2_max_depth : this->options_.chi2_max_pixel;
    }

    std::span<Keyframe> keyframes_;
    std::span<Point> points_;
    std::uint32_t keyframe_count_ = 0, fixed_count_ = 0;
    std::uint32_t point_count_ = 0;
    std::uint32_t observation_count_ = 0;
};

}  // namespace stillmesh
