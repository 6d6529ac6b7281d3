// A pose with its trust as a line of JSON, for programs that act on it (docs/poses.md has every key). Each line can be
// read alone. Composing takes no memory once the text has grown; some 5 us.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "engine/outputs.hpp"

namespace stillmesh {

inline constexpr int kPoseSchema = 1;  // grows when a key changes its meaning or goes; new keys may come any time

struct PoseReport {
    std::uint64_t frame = 0;             // 0 for the first of the run
    PoseState state = PoseState::kNone;  // as given out, after the camera check
    const char* reason = "none";         // why it is not `tracked`
    PoseEstimate estimate;
    FrameStatistics statistics;
    std::uint64_t keyframe = kNoKeyframe;  // that the pose hangs on
    std::size_t map = 1;                   // of the run
};

class PoseLines {
public:
    // `line` is replaced.
    void pose(const PoseReport& report, std::string& line);
    // What happened to the camera or the map, at the time of the last frame.
    void event(std::int64_t time_ns, std::string_view sentence, std::string& line);

private:
    std::int64_t last_time_ns_ = 0;
    RigidTransform last_odom_from_camera_;
    bool has_last_ = false;
};

}  // namespace stillmesh
