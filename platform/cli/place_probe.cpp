#include "platform/cli/place_probe.hpp"

#include <algorithm>

#include "platform/linux/cpu_kernels.hpp"

namespace stillmesh {

void PlaceProbe::forget() {
    engine_ = nullptr;
    block_.release();
    frames_ = tracked_ = 0;
    answer_.reset();
}

bool PlaceProbe::begin(const CameraModel& camera, const Configuration& configuration) {
    Limits limits = Limits::pocket();
    limits.image_width_max = camera.width;
    limits.image_height_max = camera.height;
    limits.store_features_max = 0;
    Configuration small = configuration;
    small.features.count = std::min(small.features.count, limits.features_max);
    small.features.levels = std::min(small.features.levels, limits.pyramid_levels_max);
    small.mapping.window_keyframes = std::min(small.mapping.window_keyframes, limits.keyframes_max);
    if (validate(limits).key != nullptr || validate(small, limits).key != nullptr) return false;
    if (!block_.allocate(bytes_needed(limits))) return false;
    const Result<Engine*> engine = Engine::create(block_.bytes(), limits, small, camera, cpu_kernels());
    if (!engine.is_ok()) return false;
    engine_ = engine.value();
    return true;
}

std::optional<bool> PlaceProbe::frame(const CameraModel& camera, const Configuration& configuration,
                                      const Frame& frame) {
    if (answer_) return answer_;
    if (engine_ == nullptr && !begin(camera, configuration)) {
        forget();
        answer_ = false;  // no memory, or limits that it does not fit: nothing more is known than before
        return answer_;
    }
    if (engine_->submit(frame) != Status::kOk) return std::nullopt;
    static_cast<void>(engine_->step(configuration.schedule.units_per_frame));
    // The first is where it begins, and no measurement.
    if (frames_++ > 0 && engine_->pose().state == PoseState::kTracked) ++tracked_;
    if (frames_ <= kFrames) return std::nullopt;
    const bool is_tracked = tracked_ >= kTrackedMin;
    forget();
    answer_ = is_tracked;
    return answer_;
}

}  // namespace stillmesh
