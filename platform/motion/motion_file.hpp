// How a camera moved by its wheels or its gyroscope, read from files in the TUM layout before a run:
//   odometry.txt  timestamp tx ty tz qx qy qz qw   poses of the camera in any frame that stays (s, m)
//   gyro.txt      timestamp wx wy wz               turning rate in the camera's frame (s, rad/s)
// '#' begins a comment. Between two lines the motion is even; lines farther apart than kGapMax_ns leave a hole.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"
#include "engine/motion_hint.hpp"
#include "platform/motion/motion_errors.hpp"
#include "platform/motion/motion_steps.hpp"

namespace stillmesh {

struct TurningRate {
    std::int64_t time_ns = 0;
    Triple rad_s{};
};

class MotionFile {
public:
    static constexpr std::int64_t kGapMax_ns = 250'000'000;

    // kUnavailable: no such file. kInvalid: a line that cannot be one, times that go back, or fewer than two lines;
    // `message` names file and line, and what a line is.
    [[nodiscard]] Status read_odometry(const std::string& file, std::string& message);
    [[nodiscard]] Status read_gyroscope(const std::string& file, std::string& message);
    [[nodiscard]] Status parse_odometry(std::string_view text, const std::string& file, std::string& message);
    [[nodiscard]] Status parse_gyroscope(std::string_view text, const std::string& file, std::string& message);
    // The files read, for the user.
    [[nodiscard]] const std::string& sources() const { return sources_; }
    void set_errors(const MotionErrors& errors) { errors_ = errors; }

    // The camera's motion from one moment to a later one; empty: neither file covers it. Of two rotations the surer one
    // counts. Calls no heap.
    [[nodiscard]] std::optional<MotionHint> between_times(std::int64_t from_ns, std::int64_t to_ns) const;

private:
    [[nodiscard]] Status take_odometry(const std::string& file, std::string& message);
    [[nodiscard]] std::optional<TrajectoryPose> pose_at(std::int64_t time_ns) const;
    [[nodiscard]] std::optional<Quaternion> turn_between(std::int64_t from_ns, std::int64_t to_ns) const;

    Trajectory odometry_;
    std::vector<TurningRate> gyroscope_;
    MotionErrors errors_;
    std::string sources_;
};

// One line with its line feed.
[[nodiscard]] std::string rate_line(std::int64_t time_ns, const Triple& rad_s);

}  // namespace stillmesh
