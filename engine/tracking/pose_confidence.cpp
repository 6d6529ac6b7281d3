#include "engine/tracking/pose_confidence.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {

void PoseConfidence::reset() noexcept {
    doubt_.reset();
    map_covariance_ = Matrix6::Zero();
    covariance_ = Matrix6::Zero();
    renewed_share_ = 0;
    jumped_ns_ = kNever;
    unsure_.reset();
    doubt(kNever, UnsureReason::kNone);
    motion_doubt_ = UnsureReason::kNone;
}

void PoseConfidence::begin_in_map() noexcept {
    map_covariance_ = Matrix6::Zero();
    renewed_share_ = 0;
}

void PoseConfidence::doubt_jump(std::int64_t time_ns, const MotionPrior& expected,
                                const SE3& world_from_camera) noexcept {
    const SE3 off = expected.world_from_camera.inverse() * world_from_camera;
    const double sigmas = parameters_->prediction.jump_sigmas;
    const double beyond_m = std::max(std::sqrt(off.translation.squaredNorm()) - sigmas * expected.sigma_m, 0.0);
    const double beyond_rad = std::max(rotation_angle(off.rotation) - sigmas * expected.sigma_rad, 0.0);
    doubt_.add(time_ns, {beyond_m * beyond_m, beyond_rad * beyond_rad});
    if (beyond_m > 0 || beyond_rad > 0) jumped_ns_ = time_ns;
}

void PoseConfidence::doubt_contest(std::int64_t time_ns, const SE3& chosen, const SE3& rival) noexcept {
    const SE3 off = chosen.inverse() * rival;
    const double sure = parameters_->pose.sure_sigma_m;
    if (off.translation.squaredNorm() > sure * sure || rotation_angle(off.rotation) > sure)
        doubt(time_ns, UnsureReason::kRival);
}

std::int64_t PoseConfidence::follow_path(std::int64_t time_ns, const Vector3& position, PoseState state) noexcept {
    if (state == PoseState::kTracked) {
        const UnsureStretch::Verdict unsure = unsure_.end(time_ns, position, parameters_->pose.stray_m);
        if (unsure.has_strayed) doubt(time_ns, UnsureReason::kJump);
        return unsure.since_ns;
    }
    if (state == PoseState::kNone) {
        unsure_.add_without_pose();
    } else {
        unsure_.add(time_ns, position);
    }
    return kNoTime;
}

bool PoseConfidence::measured(std::int64_t time_ns, const SE3& world_from_camera, const Matrix6& information) noexcept {
    Matrix6 measured = Matrix6::Zero();
    if (!invert_spd(information, measured)) return false;
    const Matrix6 to_world = se3_adjoint(world_from_camera);
    Matrix6 half;
    half.noalias() = to_world * measured;
    Matrix6 added;
    added.noalias() = half * to_world.transpose();
    map_covariance_ += added * renewed_share_;
    const MotionDoubt::Variance now{measured(0, 0) + measured(1, 1) + measured(2, 2),
                                    measured(3, 3) + measured(4, 4) + measured(5, 5)};
    doubt_.add(time_ns, {now.translation_m2 * renewed_share_, now.rotation_rad2 * renewed_share_});
    renewed_share_ = 0;
    MotionDoubt::Variance motion = doubt_.over_window(time_ns);
    motion.translation_m2 += now.translation_m2;
    motion.rotation_rad2 += now.rotation_rad2;
    const double sure2 = parameters_->pose.sure_sigma_m * parameters_->pose.sure_sigma_m;
    const bool is_sure = motion.translation_m2 <= sure2 && motion.rotation_rad2 <= sure2;
    motion_doubt_ = time_ns - doubted_ns_ <= MotionDoubt::kWindow_ns  ? doubted_for_
                    : is_sure                                         ? UnsureReason::kNone
                    : time_ns - jumped_ns_ <= MotionDoubt::kWindow_ns ? UnsureReason::kJump
                                                                      : UnsureReason::kRenewed;
    const Matrix6 to_camera = se3_adjoint(world_from_camera.inverse());
    half.noalias() = to_camera * map_covariance_;
    covariance_.noalias() = half * to_camera.transpose();
    covariance_ += measured;
    return true;
}

void PoseConfidence::predicted(std::uint32_t frames, double sigma_m, double sigma_rad) noexcept {
    for (int i = 0; i < 6; ++i) {
        const double sigma = i < 3 ? sigma_m : sigma_rad;
        covariance_(i, i) += sigma * sigma * std::max(frames, 1U);
    }
}

}  // namespace stillmesh
