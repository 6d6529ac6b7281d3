// `--publish ros2`: poses with their trust, the camera's path, the map's points and the state of tracking as topics of
// ROS 2 (docs/ros2.md has each), without ROS. The engine's thread copies a frame's numbers into a ring of fixed size
// and never waits; a thread of its own makes messages of them and sends them, and once a second path and diagnostics;
// another one reads the points from a copy of the map, which takes some 20 ms, and sends the grid. A reader that is
// slow, stuck or dead costs nobody anything but what it does not take. Where the ring is full a frame is not sent; it
// is counted, and said once. Limits: 64 frames in the ring, 1024 poses of the path (then every second one goes), points
// as in the map. Memory: 150 KiB, 36 bytes a point, a copy of the map once somebody has subscribed to its points, and
// Cyclone's own. Cost: docs/ros2.md. Made by ros2_module.hpp: what the program calls is virtual.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "engine/geometry/rigid_transform.hpp"
#include "platform/poses/pose_line.hpp"
#include "platform/ros2/map_points.hpp"
#include "platform/ros2/shown_grid.hpp"

namespace stillmesh {

struct RosOptions {
    bool is_on = false;
    std::string name_space;    // of what is this robot's alone, /odom and /stillmesh/...; empty: none
    std::string frame_prefix;  // of map, odom, base_link and the camera's frames
    bool has_tf = true;        // else neither /tf nor /tf_static: another program says where base_link is
    bool has_grid = false;     // /map: there is a grid to drive in
    RigidTransform base_from_camera_link;
    bool is_base_from_tf = false;  // another program says where the camera is: asked for, and no /tf_static of ours
};

class RosPublisher {
public:
    RosPublisher();
    virtual ~RosPublisher();
    RosPublisher(const RosPublisher&) = delete;
    RosPublisher& operator=(const RosPublisher&) = delete;

    // False: `message` says why.
    [[nodiscard]] virtual bool open(const RosOptions& options, std::string& message);
    // --- the engine's thread ---
    // Where the map's points are to be copied to; nullptr: nobody publishes.
    [[nodiscard]] virtual MapPoints* points() noexcept;
    // Where a grid is to be put; nullptr: nobody publishes, or not a grid.
    [[nodiscard]] virtual GridShelf* grid() noexcept;
    // A frame, with a pose or without. Here as in event(): what to say when the first was lost; else empty.
    [[nodiscard]] virtual std::string frame(const PoseReport& report);
    // What happened to the camera or the map: in the diagnostics, the last one, its first 200 letters.
    [[nodiscard]] virtual std::string event(const std::string& sentence);
    // Sends what is left. Empty: nothing was lost; else a sentence.
    [[nodiscard]] virtual std::string close();

private:
    class Sender;
    std::unique_ptr<Sender> sender_;
};

}  // namespace stillmesh
