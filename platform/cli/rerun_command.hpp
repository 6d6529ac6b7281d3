// `stillmesh rerun`: a recorded run once more, from its recording and its frames: the same frames in, the same grants
// of background work, and after each the same decisions and the same state hash; or the first frame that differs, by
// name.
#pragma once

#include <optional>
#include <string>

#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

struct RerunOptions {
    std::string recording;
    std::string folder;     // or a bag
    std::string topics;     // of a bag, if the run had them
    std::string map_in;     // empty: none
    std::string map_store;  // empty: none
    bool is_localising = false;
    std::string mask;                     // that the run had; empty: none
    std::optional<RigidTransform> start;  // that the run began at
    bool is_half = false;                 // the run halved its images
    std::string vocabulary = "default";   // that the recording was made with, if it was made with one
    bool is_json = false;
};

// Returns the program's exit code: kExitDone: all repeated; kExitFailed: one differs; kExitUsage: bad input.
[[nodiscard]] int rerun_command(const RerunOptions& options);

}  // namespace stillmesh
