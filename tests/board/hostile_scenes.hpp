// Frames to count instructions on: those of the simulated camera, and hostile ones that make the engine work as hard as
// a picture can. Rendered once, on this machine, and read from a file by the program that is counted (engine_workload).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"

namespace stillmesh {

inline constexpr std::int64_t kFrame_ns = 33'333'333;

struct StoredFrame {
    std::vector<std::uint8_t> colour;  // grey
    std::vector<std::uint16_t> depth;  // 1/5000 m
};
struct StoredScene {
    CameraModel camera;
    std::vector<StoredFrame> frames;  // at 30 a second
};

struct HostileScene {
    const char* name;
    const char* world;  // that there is a map of already, which the camera is lost in; empty: none
    const char* sentence;
};
[[nodiscard]] const std::vector<HostileScene>& hostile_scenes();

// `name`: a hostile scene, or SCENE or SCENE:SEED of the simulated camera. False: there is no such scene.
[[nodiscard]] bool make_scene(const std::string& name, std::uint32_t frames, std::uint32_t width, std::uint32_t height,
                              StoredScene& out);
// A camera that goes past the walls of a world until its map is full: calls see(camera, frame, time_ns) until that says
// no. False: there is no such world.
using See = std::function<bool(const CameraModel&, const StoredFrame&, std::int64_t)>;
[[nodiscard]] bool visit_world(const std::string& world, std::uint32_t width, std::uint32_t height, const See& see);
[[nodiscard]] Frame frame_of(const StoredFrame& stored, const CameraModel& camera, std::int64_t time_ns);
[[nodiscard]] std::vector<std::byte> bytes_of(const std::string& file);
[[nodiscard]] bool write_scene(const StoredScene& scene, const std::string& file);
[[nodiscard]] bool read_scene(const std::string& file, StoredScene& out);

}  // namespace stillmesh
