#include "engine/tracking/rival_motion.hpp"

namespace stillmesh {

SE3 RivalMotion::predict(std::int64_t time_ns, const PredictionParameters& parameters) const noexcept {
    return motion_.predict(time_ns, parameters, 0, true).world_from_camera;
}

void RivalMotion::learn(const Contest& contest, const MotionModel& camera, std::int64_t time_ns,
                        const PredictionParameters& parameters) noexcept {
    const bool is_seen = contest.hypothesis != Hypotheses::kNone;
    if (is_seen) {
        if (!is_carried() || !contest.is_carried_on) {
            motion_ = camera;
            frames_ = 0;
        }
        ++frames_;
        motion_.move_to(contest.world_from_camera);
        motion_.set_has_velocity(true);
        unseen_ = 0;
    } else if (is_carried()) {
        motion_.move_to(predict(time_ns, parameters));
        if (++unseen_ > kPatience) reset();
    }
}

}  // namespace stillmesh
