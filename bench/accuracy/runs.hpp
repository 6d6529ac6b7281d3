// One scene or recording through one or more engines side by side: every frame is rendered or decoded once and given to
// an engine per variant of the configuration.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "bench/accuracy/hints.hpp"
#include "bench/accuracy/masks.hpp"
#include "bench/accuracy/measures.hpp"
#include "engine/tuned_engine.hpp"
#include "hal/simulated/dirt.hpp"

namespace stillmesh::accuracy {

struct Input {
    std::string scene;  // a simulated scene, or a TUM folder
    std::uint64_t seed = 1;
    bool is_recording = false;
    std::uint32_t frames = 0;  // 0: all
    Dirt dirt = {};            // of a simulated scene; what is not said, the scene says
    std::string dirt_name = {};
};

struct Variant {
    std::string name;  // "on" and "off": the region; others by the caller
    Parameters configuration;
    bool has_readout = false;         // camera.readout_s was set: what the camera knows of itself is not asked for
    const HintKind* hints = nullptr;  // that its engine is given
    const MaskKind* masks = nullptr;  // likewise
    std::span<const std::byte> vocabulary =
        {};  // outlives the run; without one no loop is closed, no place known again
};

struct Result {
    std::string scene;  // a recording's folder name
    std::uint64_t seed = 0;
    bool is_recording = false;
    std::string variant;
    Measures measures;
    std::string dirt = {};  // the input's dirt_name; empty: the scene's own
};

struct RunOptions {
    std::string trajectories;  // folder for what each engine gave out, in TUM format; empty: not written
    std::string cache;         // folder of rendered frames; empty: none
};

// Calls on_frames(n) as frames pass. False: `message` says why.
[[nodiscard]] bool run(const Input& input, const std::vector<Variant>& variants, const RunOptions& options,
                       const std::function<void(std::uint32_t)>& on_frames, std::vector<Result>& results,
                       std::string& message);

// What stands between commas, without what is empty.
[[nodiscard]] std::vector<std::string> split(const std::string& text);
// "1-3,7": 1 2 3 7. False: not such a list, or an empty one.
[[nodiscard]] bool parse_seeds(const std::string& text, std::vector<std::uint64_t>& seeds);

// "key=value" into the configuration. False: `message` names key and range.
[[nodiscard]] bool set_parameter(Parameters& configuration, const std::string& assignment, std::string& message);

}  // namespace stillmesh::accuracy
