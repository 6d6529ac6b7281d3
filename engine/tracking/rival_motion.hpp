// The motion that contradicts the chosen one most, carried on from frame to frame as the camera's own is. Where a body
// was taken for the room the prediction goes with the body, and the room's motion, the longer it is rejected, lies the
// farther off what is expected: by that alone it would soon be no rival any more. Beside its own past it stays one for
// as long as it goes on. Bounded: one such motion. Cost: that of one prediction a frame.
#pragma once

#include <cstdint>

#include "engine/static_region/choice.hpp"
#include "engine/tracking/motion_model.hpp"

namespace stillmesh {

class RivalMotion {
public:
    void reset() noexcept { *this = RivalMotion{}; }

    [[nodiscard]] bool is_carried() const noexcept { return frames_ > 0; }
    // In which it contradicted the choice.
    [[nodiscard]] std::uint32_t frames() const noexcept { return frames_; }
    [[nodiscard]] SE3 predict(std::int64_t time_ns, const PredictionParameters& parameters) const noexcept;

    // What a frame showed: it goes on, another one parts from the camera's motion before this frame, or it is not seen;
    // after kPatience frames of that it is forgotten.
    void learn(const Contest& contest, const MotionModel& camera, std::int64_t time_ns,
               const PredictionParameters& parameters) noexcept;
    // The frame is over.
    void end_frame(std::int64_t time_ns) noexcept { motion_.end_frame(time_ns); }
    // The world under the camera moved by `correction`.
    void follow(const SE3& correction) noexcept { motion_.follow(correction); }

private:
    static constexpr std::uint32_t kPatience = 5;

    MotionModel motion_;
    std::uint32_t frames_ = 0;
    std::uint32_t unseen_ = 0;
};

}  // namespace stillmesh
