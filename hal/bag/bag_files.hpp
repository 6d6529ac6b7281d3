// Which files a bag consists of, and whether something is one: a file of ROS 1 (.bag), SQLite (.db3) or MCAP (.mcap),
// told by its first bytes, or the folder that `ros2 bag record` makes: metadata.yaml with the names of its parts, or,
// where the recording was killed before that was written, the parts alone. Needs no library of the formats: a build
// without bags knows what it refuses. Any bytes are safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/status.hpp"

namespace stillmesh {

enum class BagFormat : std::uint8_t { kNone, kRos1, kDb3, kMcap, kZstd };

// kNone: no such file, or none of these.
[[nodiscard]] BagFormat bag_format_of(const std::string& file);

// False also for a folder in the TUM layout, whatever else lies in it.
[[nodiscard]] bool is_bag(const std::string& path);

// In the order of their recording. kUnavailable: nothing there.    kInvalid: metadata.yaml; `message` is a sentence.
[[nodiscard]] Status files_of_bag(const std::string& path, std::vector<std::string>& files, std::string& message);

}  // namespace stillmesh
