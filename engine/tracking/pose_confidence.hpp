// How sure the pose given out is: what the frame measured, and what the map that it was measured against has drifted
// by. Points that a keyframe adds carry the error of its pose for good, so the local map drifts by as much as it is
// renewed. A pose is only called sure while the motion over the last second is (engine/pose/motion_doubt.hpp). Cost:
// some 6x6 products a frame.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"
#include "engine/outputs.hpp"
#include "engine/parameters.hpp"
#include "engine/pose/motion_doubt.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/unsure_stretch.hpp"

namespace stillmesh {

class PoseConfidence {
public:
    void create(const Parameters& configuration) noexcept { parameters_ = &configuration; }
    // Also for a new map, whose origin is where the camera is.
    void reset() noexcept;
    // A map that was loaded: drift counts from here.
    void begin_in_map() noexcept;
    // Of the local map, by a keyframe: counts with the next pose measured.
    void set_renewed_share(double share) noexcept { renewed_share_ = share; }

    // An unsure choice farther than expected from where the motion led: that motion was wrong, or this choice is.
    // (A sure one that far off is a jerk.)
    void doubt_jump(std::int64_t time_ns, const MotionPrior& expected, const SE3& world_from_camera) noexcept;

    // Beside the choice another motion was tenable. If the choice was wrong the path is off by what both are apart;
    // where that is more than pose.sure_sigma_m the last second is not sure.
    void doubt_contest(std::int64_t time_ns, const SE3& chosen, const SE3& rival) noexcept;

    // Each frame, before measured(): its pose, and how sure the frame itself is of it; kNone: there is none. Where a
    // sure pose shows that unsure ones before it strayed, the second behind them is not sure. Returns behind which
    // frame they lie (UnsureStretch::Verdict), or kNoTime.
    [[nodiscard]] std::int64_t follow_path(std::int64_t time_ns, const Vector3& position, PoseState state) noexcept;

    // A pose measured with this information (right increments): true, and covariance() is its; false when the
    // information is singular. motion_doubt() tells whether the last second's path can be trusted, or why not.
    [[nodiscard]] bool measured(std::int64_t time_ns, const SE3& world_from_camera,
                                const Matrix6& information) noexcept;
    [[nodiscard]] UnsureReason motion_doubt() const noexcept { return motion_doubt_; }
    // A pose that was predicted, `frames` frames after the last one that was measured; each adds these deviations.
    void predicted(std::uint32_t frames, double sigma_m, double sigma_rad) noexcept;

    [[nodiscard]] const Matrix6& covariance() const noexcept { return covariance_; }

private:
    static constexpr std::int64_t kNever = -2 * MotionDoubt::kWindow_ns;

    void doubt(std::int64_t time_ns, UnsureReason reason) noexcept {
        doubted_ns_ = time_ns;
        doubted_for_ = reason;
    }

    const Parameters* parameters_ = nullptr;  // outlives it
    MotionDoubt doubt_;
    Matrix6 map_covariance_ = Matrix6::Zero();  // of the local map against where odometry began; left increments
    Matrix6 covariance_ = Matrix6::Zero();      // of the pose given out
    double renewed_share_ = 0;
    std::int64_t jumped_ns_ = kNever;
    UnsureStretch unsure_;
    std::int64_t doubted_ns_ = kNever;  // the second behind it is not sure, whatever is measured
    UnsureReason doubted_for_ = UnsureReason::kNone;
    UnsureReason motion_doubt_ = UnsureReason::kNone;
};

}  // namespace stillmesh
