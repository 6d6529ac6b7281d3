#include "platform/poses/body_course.hpp"

namespace stillmesh {

const BodyStep& BodyCourse::follow(const PoseReport& report) {
    const PoseEstimate& estimate = report.estimate;
    const Covariance6 before = step_.covariance;
    step_ = BodyStep{};
    if (report.state != PoseState::kNone) {
        if (report.state >= PoseState::kUnsure) {
            measured_ = frames_.of_base(estimate.covariance);
            measured_ns_ = estimate.time_ns;
        }
        const double unmeasured_s = static_cast<double>(estimate.time_ns - measured_ns_) * 1e-9;
        step_.covariance = with_doubt(measured_, report.state, unmeasured_s);
        const double seconds = static_cast<double>(estimate.time_ns - last_.estimate.time_ns) * 1e-9;
        step_.is_next = has_last_ && last_.map == report.map && seconds > 0;
        if (step_.is_next) {
            step_.velocity =
                frames_.of_base(velocity_between(last_.estimate.odom_from_camera, estimate.odom_from_camera, seconds));
            for (std::size_t i = 0; i < before.size(); ++i) {
                step_.velocity_covariance[i] = (step_.covariance[i] + before[i]) / (seconds * seconds);
            }
        }
    }
    has_last_ = report.state != PoseState::kNone;
    last_ = report;
    return step_;
}

}  // namespace stillmesh
