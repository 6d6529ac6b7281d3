// How a camera moved by its wheels or its gyroscope, as samples in the order of their times, and the motion between two
// moments that follows from them. Between two samples the motion is even; samples farther apart than kGapMax_ns leave a
// hole. Memory: 64 bytes a pose, 32 a rate. No heap call but where samples are added.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/motion_hint.hpp"
#include "platform/motion/motion_errors.hpp"
#include "platform/motion/motion_steps.hpp"

namespace stillmesh {

struct TurningRate {
    std::int64_t time_ns = 0;
    Triple rad_s{};
};

// Who knows how the camera moved.
class MotionSource {
public:
    virtual ~MotionSource() = default;
    // The camera's motion from one moment to a later one; empty: nothing is known of it. Calls no heap.
    [[nodiscard]] virtual std::optional<MotionHint> between_times(std::int64_t from_ns, std::int64_t to_ns) const = 0;
    // Where it is known from, for the user.
    [[nodiscard]] virtual const std::string& sources() const = 0;
};

struct MotionSamples {
    static constexpr std::int64_t kGapMax_ns = 250'000'000;

    Trajectory odometry;                 // poses of the camera in any frame that stays
    std::vector<TurningRate> gyroscope;  // in the camera's frame
    MotionErrors errors;

    // Empty: neither covers it. Of two rotations the surer one counts.
    [[nodiscard]] std::optional<MotionHint> between_times(std::int64_t from_ns, std::int64_t to_ns) const;

private:
    [[nodiscard]] std::optional<TrajectoryPose> pose_at(std::int64_t time_ns) const;
    [[nodiscard]] std::optional<Quaternion> turn_between(std::int64_t from_ns, std::int64_t to_ns) const;
};

}  // namespace stillmesh
