// Each frame's pose as it is known at the end: relative to its reference keyframe, composed with that keyframe's last
// pose. A keyframe that leaves the map is re-expressed by one that stays (its parent in the spanning tree, else the
// nearest), as the two lay when both were last seen. Memory: 80 bytes a frame, and what the keyframes take.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "platform/evaluation/trajectory.hpp"

namespace stillmesh {

// A keyframe as the map has it now; `pose.time_ns` is of no interest.
struct KeyframeNow {
    static constexpr std::uint64_t kNone = ~std::uint64_t{0};
    std::uint64_t id = kNone;
    std::uint64_t parent_id = kNone;
    TrajectoryPose pose;
};

class FinalTrajectory {
public:
    // All keyframes of the map, after each frame, before background work changes them, and once more at the end.
    void update(std::span<const KeyframeNow> keyframes);
    // A frame's pose as it was given out, after update() with the keyframes of that moment. `reference` kNone or
    // unknown: the pose stays as it is.
    void add(const TrajectoryPose& map_from_camera, std::uint64_t reference);
    // The frames added behind this time, but for the last, strayed (FrameStatistics::strayed_since_ns): at the end they
    // lie on the line between their neighbours. How the camera turned stays as it was given out: by the line it would
    // be no better (docs/lab/tracking.md).
    void straighten(std::int64_t since_ns);
    [[nodiscard]] Trajectory finish() const;

private:
    struct Kept {
        TrajectoryPose pose;  // last seen
        std::uint64_t parent_id = KeyframeNow::kNone;
        std::uint64_t instead_id = KeyframeNow::kNone;  // gone: who stands for it
        TrajectoryPose instead_from_this;
        std::uint64_t seen = 0;  // update() that it was in
    };
    struct FrameKept {
        TrajectoryPose pose;  // in the reference, or in the map without one
        std::uint64_t reference = KeyframeNow::kNone;
        bool has_strayed = false;
    };
    void straighten(Trajectory& path) const;

    std::unordered_map<std::uint64_t, Kept> keyframes_;
    std::vector<std::uint64_t> alive_;
    std::vector<FrameKept> frames_;
    std::uint64_t updates_ = 0;
};

// a_from_b * b_from_c, and the inverse. Times are those of the right-hand side, and of the argument.
[[nodiscard]] TrajectoryPose compose(const TrajectoryPose& a_from_b, const TrajectoryPose& b_from_c);
[[nodiscard]] TrajectoryPose inverse_of(const TrajectoryPose& pose);

}  // namespace stillmesh
