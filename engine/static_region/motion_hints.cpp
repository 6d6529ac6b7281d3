#include "engine/static_region/motion_hints.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"

namespace stillmesh {
namespace {

// Where two that are independent meet, from the first one: its share of the way, and the deviation there.
struct Meeting {
    double share = 0;
    double sigma = 0;
};
Meeting meet(double sigma, double sigma_other) noexcept {
    const double a = sigma * sigma;
    const double b = sigma_other * sigma_other;
    return {a / (a + b), std::sqrt(a * b / (a + b))};
}

// The factor on the variance claimed at which an error is no surprise.
void follow_scale(double error2, double sigma, double floor, const HintParameters& p, double& scale) noexcept {
    constexpr double kLeast = 1e-12;  // of a variance; a hint that claims to be exact
    constexpr double kScaleMax = 1e9;
    const double found = std::max(error2 / 3.0 - floor * floor, 0.0) / std::max(sigma * sigma, kLeast);
    scale = std::max(scale * p.forgetting, 1.0);
    if (found > p.surprise) scale = std::min(std::max(scale, found), kScaleMax);
}

}  // namespace

bool is_valid(const MotionHint& hint) noexcept {
    return is_pose(hint.last_from_camera) && hint.sigma_m < kPoseMost && hint.sigma_rad < kPoseMost;  // false for NaN
}

void MotionHints::begin(const SE3& world_from_camera, std::int64_t time_ns) noexcept {
    world_from_anchor_ = world_from_camera;
    anchor_from_camera_ = SE3{};
    sigma_m_ = sigma_rad_ = 0;
    anchor_time_ns_ = time_ns_ = time_ns;
    frames_ = 0;
    clock_m_ = clock_rad_ = 0;
    has_translation_ = has_rotation_ = false;
}

void MotionHints::follow(const SE3& correction) noexcept {
    world_from_anchor_ = correction * world_from_anchor_;
    renormalise(world_from_anchor_.rotation);
}

void MotionHints::take(const MotionHint* hint, std::int64_t time_ns, const HintParameters& parameters) noexcept {
    const bool is_first = frames_++ == 0;
    const double duration_s = seconds_between(time_ns_, time_ns);
    time_ns_ = time_ns;
    if (hint == nullptr || seconds_between(anchor_time_ns_, time_ns) > parameters.chain_s) {
        has_translation_ = has_rotation_ = false;
        return;
    }
    // A translation needs the rotation up to it.
    has_translation_ = hint->sigma_m >= 0 && (is_first || (has_translation_ && has_rotation_));
    has_rotation_ = hint->sigma_rad >= 0 && (is_first || has_rotation_);
    SE3 step = pose_of(hint->last_from_camera);
    if (!has_translation_) step.translation.setZero();
    if (!has_rotation_) step.rotation.setIdentity();
    const double frames_apart = parameters.clock_s / std::max(duration_s, parameters.clock_s);
    clock_m_ = frames_apart * std::sqrt(step.translation.squaredNorm());
    clock_rad_ = frames_apart * rotation_angle(step.rotation);
    anchor_from_camera_ = anchor_from_camera_ * step;
    renormalise(anchor_from_camera_.rotation);
    sigma_m_ += std::max(hint->sigma_m, 0.0);
    sigma_rad_ += std::max(hint->sigma_rad, 0.0);
}

// Where hints see the camera, and as far as they say nothing the other pose.
MotionHints::Hinted MotionHints::hinted(const SE3& otherwise, const HintParameters& p) const noexcept {
    Hinted out{world_from_anchor_ * anchor_from_camera_, 0, 0};
    if (!has_translation_) out.world_from_camera.translation = otherwise.translation;
    if (!has_rotation_) out.world_from_camera.rotation = otherwise.rotation;
    out.sigma_m = std::sqrt(scale_m_ * sigma_m_ * sigma_m_ + p.floor_m * p.floor_m + clock_m_ * clock_m_);
    out.sigma_rad =
        std::sqrt(scale_rad_ * sigma_rad_ * sigma_rad_ + p.floor_rad * p.floor_rad + clock_rad_ * clock_rad_);
    return out;
}

void MotionHints::weigh_in(RegionContext& expected, bool is_young, const Parameters& parameters) const noexcept {
    if (!is_any()) return;
    const HintParameters& p = parameters.hint;
    const Hinted seen = hinted(expected.world_from_camera_predicted, p);
    // From poses that are not sure no motion follows that could be held against the hints.
    const bool is_alone = is_young || frames_ > 1;
    const Meeting m = meet(expected.prediction_sigma_m, seen.sigma_m);
    const Meeting r = meet(expected.prediction_sigma_rad, seen.sigma_rad);
    SE3& pose = expected.world_from_camera_predicted;
    const SE3 off = pose.inverse() * seen.world_from_camera;
    if (has_translation_) {
        pose.translation = pose * Vector3(off.translation * (is_alone ? 1.0 : m.share));
        expected.prediction_sigma_m = is_alone ? seen.sigma_m : m.sigma;
    } else if (is_young) {
        // A camera that turned otherwise than the last poses say was elsewhere as well.
        const PredictionParameters& still = parameters.prediction;
        expected.prediction_sigma_m =
            still.still_sigma_m + still.still_sigma_m_s * seconds_between(anchor_time_ns_, time_ns_);
    }
    if (has_rotation_) {
        pose.rotation = pose.rotation * so3_exp(so3_log(off.rotation) * (is_alone ? 1.0 : r.share));
        renormalise(pose.rotation);
        expected.prediction_sigma_rad = is_alone ? seen.sigma_rad : r.sigma;
    }
    expected.hint.is_any = true;
    expected.hint.is_young = is_young;
    expected.hint.is_whole = has_translation_ && has_rotation_;
    if (is_young && has_translation_) expected.hint.sharpness_m = p.young_sharpness;
    if (is_young && has_rotation_)
        expected.hint.sharpness_rad = has_translation_ ? p.young_sharpness : p.turn_sharpness;
}

double MotionHints::sigmas_off(const SE3& world_from_camera, const HintParameters& parameters) const noexcept {
    if (!is_any()) return 0;
    const Hinted seen = hinted(world_from_camera, parameters);
    const SE3 off = seen.world_from_camera.inverse() * world_from_camera;
    return std::max(std::sqrt(off.translation.squaredNorm()) / seen.sigma_m,
                    rotation_angle(off.rotation) / seen.sigma_rad);
}

void MotionHints::learn(const SE3& world_from_camera, const HintParameters& parameters) noexcept {
    const SE3 off = (world_from_anchor_ * anchor_from_camera_).inverse() * world_from_camera;
    const double angle = rotation_angle(off.rotation);
    if (has_translation_)
        follow_scale(off.translation.squaredNorm(), sigma_m_, parameters.floor_m, parameters, scale_m_);
    if (has_rotation_) follow_scale(angle * angle, sigma_rad_, parameters.floor_rad, parameters, scale_rad_);
}

}  // namespace stillmesh
