#include "platform/cli/camera_watch.hpp"

#include "hal/calibration/calibration.hpp"

namespace stillmesh {

void CameraWatch::frame(const DepthCamera& camera, const Frame& frame, const TrackingSession& session) {
    const FeatureSet* const features = is_on_ ? session.features() : nullptr;
    if (features == nullptr) return;
    if (!check_) check_.emplace(camera.info(), static_cast<std::uint32_t>(features->keypoints.capacity()));
    check_->frame(frame, *features);
}

std::string CameraWatch::news() {
    return check_ ? check_->news() : std::string();
}

void CameraWatch::account(RunRecord& record) const {
    if (!check_) return;
    record.camera_check = check_->report();
    if (const std::optional<CameraInfo> right = check_->corrected()) {
        record.corrected_calibration = calibration_toml(*right);
    }
    const std::vector<std::string> faults = check_->faults();
    record.problems.insert(record.problems.end(), faults.begin(), faults.end());
}

}  // namespace stillmesh
