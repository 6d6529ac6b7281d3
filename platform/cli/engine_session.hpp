// The engine as a TrackingSession: its block of memory, its configuration, the clock around its stages.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "platform/cli/frame_diagnosis.hpp"
#include "platform/cli/grid_outputs.hpp"
#include "platform/cli/session.hpp"
#include "platform/motion/gravity_finder.hpp"
#include "platform/motion/motion_samples.hpp"

namespace stillmesh {

struct SessionOptions {
    std::string limits = "room";           // room, pocket
    std::string scene = "indoor";          // indoor, outdoor
    std::string method = "ours";           // ours, paper
    std::string features = "native";       // native, opencv
    std::string configuration;             // TOML file; empty: defaults
    std::vector<std::string> assignments;  // "key=value", applied after the file
    std::string record;                    // recording to write; empty: none
    std::string map_in;                    // map to begin in; empty: none
    bool is_map_own = false;               // map_in need not be there, and is kept aside if it cannot be read
    std::string map_out;                   // map to write at the end; empty: none
    std::string map_store;                 // folder for places that memory has no room for; empty: none
    double map_every_s = 0;                // and as often while running; 0: not
    GridOutputOptions grid;                // to drive in, and cloud
    std::optional<RigidTransform> start;   // where the first frame is in the map that is made
    bool is_localising = false;            // the map that was read stays as it is
    std::string vocabulary = "default";    // or a file; "none": no place is ever recognised
    const MotionSource* motion = nullptr;  // how the camera moved, by others; nullptr: not known. Outlives the session
    const AccelerationSource* accelerations = nullptr;  // of --level gravity; nullptr: none. Outlives it too
    bool can_wait = true;  // for a full recording ring, between frames: the camera is no live one
};

struct SessionSizes {
    std::uint32_t width_max = 640;
    std::uint32_t height_max = 480;
    DepthRange depth;
};

// The limits and the configuration that the options give a camera. kInvalid, kUnavailable: `message` says why; kOk: it
// is empty, or a note for the user.
[[nodiscard]] Status session_configuration(const SessionOptions& options, const CameraInfo& camera, Limits& limits,
                                           Configuration& configuration, std::string& message);
// The largest image that the limits allow, and the depth that is used. kInvalid, kUnavailable: the options are bad,
// `message` says how.
[[nodiscard]] Status session_sizes(const SessionOptions& options, SessionSizes& sizes, std::string& message);
// kOk: `message` is empty, or a note for the user. kInvalid, kUnavailable: it says why; `session` is untouched.
[[nodiscard]] Status create_engine_session(const SessionOptions& options, const CameraInfo& camera,
                                           std::unique_ptr<TrackingSession>& session, std::string& message);
// The configuration that the options give, as TOML.
[[nodiscard]] Status print_configuration(const SessionOptions& options, std::string& toml, std::string& message);

}  // namespace stillmesh
