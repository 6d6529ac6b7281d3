// What an accelerometer measured, read from a file in the TUM layout before a run:
//   accelerometer.txt  timestamp ax ay az   in the camera's axes: x right, y down, z forward (s, m/s^2)
// An accelerometer at rest measures what keeps it from falling: 9.8 upwards, (0, -9.8, 0) in a camera held level.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"
#include "platform/motion/gravity_finder.hpp"

namespace stillmesh {

// kUnavailable: no such file. kInvalid: a line that cannot be one, times that go back, or fewer than two lines;
// `message` names file and line, and what a line is.
[[nodiscard]] Status read_accelerometer(const std::string& file, std::vector<Acceleration>& readings,
                                        std::string& message);
[[nodiscard]] Status parse_accelerometer(std::string_view text, const std::string& file,
                                         std::vector<Acceleration>& readings, std::string& message);

}  // namespace stillmesh
