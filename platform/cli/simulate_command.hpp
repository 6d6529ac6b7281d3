// `stillmesh simulate`: a simulated scene as a recording in TUM layout, with ground truth and masks of moving bodies.
// The lists name only what has been written whole: whenever it stops (Ctrl-C, full disk), the folder is a valid,
// shorter recording. Some 45 ms a frame.
#pragma once

#include <cstdint>
#include <string>

#include "platform/cli/scene_name.hpp"

namespace stillmesh {

struct SimulateOptions {
    SceneName scene;                 // its name as it was given: a seed or day in it goes before the other
    std::string out;                 // folder to make; must not be there, or be empty
    std::uint32_t frames = 0;        // of the camera; 0: the scene's own length
    std::uint32_t width = 640;       // px
    std::uint32_t height = 0;        // px; 0: three quarters of the width
    std::uint32_t every = 1;         // of the camera's frames each so many-th is written: a camera that moves faster
    bool is_depth_separate = false;  // depth of a camera of its own, as a RealSense D435 has it, not registered
    bool has_motion = false;         // odometry.txt, gyro.txt and accelerometer.txt, with errors of the seed
    bool is_json = false;            // summary as JSON, no progress
    std::string dirt = {};  // strengths, as shake=1,rolling=.5 (hal/simulated/dirt.hpp); what the scene has if empty
};

// Writes rgb/, depth/, masks/, rgb.txt, depth.txt, masks.txt, groundtruth.txt and camera.yaml, and prints the share of
// moving pixels. Stops at stop_signal(). Returns the program's exit code: 0; 1 could not write; 2 unknown scene, or a
// folder that cannot be used; 128 + signal.
[[nodiscard]] int simulate_command(const SimulateOptions& options);

}  // namespace stillmesh
