// What --replay names: a folder in the TUM layout or a bag of ROS, one camera for both.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/bag/bag_camera.hpp"
#include "hal/replay/replay_camera.hpp"

namespace stillmesh {

class RecordingSource {
public:
    // `topics` is of a bag: COLOUR,DEPTH,INFO; empty: found.
    RecordingSource(const ReplayOptions& options, const std::string& topics);

    // What was asked for and is of the other kind of recording, as a sentence; empty: nothing.
    [[nodiscard]] const std::string& problem() const { return problem_; }
    [[nodiscard]] DepthCamera& camera();
    [[nodiscard]] const std::string& message() const;
    [[nodiscard]] const std::string& calibration_source() const;
    [[nodiscard]] std::uint64_t frames() const;  // 0: unknown
    // What is not as every recording has it is said, so that a wrong guess does not go unseen: once it is open, and at
    // the end.
    [[nodiscard]] std::vector<std::string> notes() const;
    [[nodiscard]] std::vector<std::string> closing_notes() const;

private:
    std::int64_t pair_gap_ns_;
    std::string problem_;
    std::optional<ReplayCamera> folder_;
    std::optional<BagCamera> bag_;
};

}  // namespace stillmesh
