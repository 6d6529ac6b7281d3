// Trajectories in the text format of the TUM tools: `timestamp tx ty tz qx qy qz qw`, camera to world, seconds and
// metres, '#' begins a comment.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"

namespace stillmesh {

struct TrajectoryPose {
    std::int64_t time_ns = 0;
    std::array<double, 3> t{};                    // world_from_camera, m
    std::array<double, 4> q{0.0, 0.0, 0.0, 1.0};  // x y z w; of length 1 once read
};

using Trajectory = std::vector<TrajectoryPose>;

// Sorted by time. kUnavailable: no such file.    kInvalid: a line that is no pose; `message` names file and line.
[[nodiscard]] Status read_trajectory(const std::string& file, Trajectory& trajectory, std::string& message,
                                     double frames_per_s = 0);
[[nodiscard]] Status parse_trajectory(std::string_view text, const std::string& file, Trajectory& trajectory,
                                      std::string& message, double frames_per_s = 0);

// "1305031229.528748000": exact, 9 decimals.
[[nodiscard]] std::string time_text(std::int64_t time_ns);
// One line with its line feed. Nine decimals: 1 nm, far below any error, and the same text for the same bits.
[[nodiscard]] std::string pose_line(const TrajectoryPose& pose);
// The same behind what `text` holds: a text that is used again takes no memory.
void append_time(std::int64_t time_ns, std::string& text);
void append_pose_line(const TrajectoryPose& pose, std::string& text);

}  // namespace stillmesh
