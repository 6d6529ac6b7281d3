#include "engine/tracking/late_depth.hpp"

#include "engine/base/time.hpp"

namespace stillmesh {
namespace {

constexpr double kNegligible_rad = 0.001;  // half a pixel
constexpr double kLagTurnMax_rad = 0.1;    // 230 degrees per second, 25 ms late
constexpr std::size_t kMatchesMin = 30;

}  // namespace

double depth_lag_s(const Frame& frame) noexcept {
    constexpr std::int64_t kLagMax_ns = 100'000'000;
    if (frame.depth_time_ns <= 0) return 0;
    const std::int64_t lag_ns = frame.depth_time_ns - frame.time_ns;
    return lag_ns > kLagMax_ns || lag_ns < -kLagMax_ns ? 0 : seconds_between(frame.time_ns, frame.depth_time_ns);
}

bool LateDepth::expect(MeasuredFrame& frame, const Vector6& speed, const Parameters& parameters) noexcept {
    const Vector3 before = turn_;
    const Vector3 turning = speed.tail<3>();
    const double lag_s = depth_lag_s(frame.frame());
    turn_ = expected_ = turning * lag_s;
    sigma_rad_ = turning.norm() * parameters.region.colour_depth_lag_s;
    trust_ = parameters.pose.depth_trust;
    is_asked_ = lag_s != 0 && trust_ > 0 && sigma_rad_ > kNegligible_rad && expected_.norm() <= kLagTurnMax_rad &&
                !parameters.region.is_paper();
    if (!is_asked_) turn_.setZero();
    if (turn_ == before) return false;
    frame.look_up_depth(turn_);
    return true;
}

bool LateDepth::measure(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                        const SE3& world_from_camera, double chi2_max, MeasuredFrame& frame) noexcept {
    if (!is_asked_ || chosen.size() < kMatchesMin) return false;
    const DepthTurnPrior prior{world_from_camera, turn_, expected_, sigma_rad_, trust_};
    const Result<Vector3> measured =
        measure_depth_turn(correspondences, chosen, frame.depth_picture(), prior, chi2_max);
    if (!measured.is_ok() || !(measured.value().norm() <= kLagTurnMax_rad)) return false;
    turn_ = measured.value();
    frame.look_up_depth(turn_);
    return true;
}

}  // namespace stillmesh
