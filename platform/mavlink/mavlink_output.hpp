// `--mavlink udp:HOST:PORT`: poses for an autopilot, PX4 or ArduPilot, as MAVLink's ODOMETRY or
// VISION_POSITION_ESTIMATE, and a HEARTBEAT a second while frames come (docs/mavlink.md).
//
// Frames: MAVLink's body looks along x, y is right, z down (FRD): ROS's (body_frames.hpp) turned by half a turn about
// x. The local frame is where the body was at the first frame of the map. Of a covariance the positions are in the
// local frame's axes, the rotations about the body's, as roll, pitch and yaw are while it is level. What is sent is the
// pose in the map; where it jumps (a loop was closed, the camera was found again, another map) the reset counter grows.
//
//   tracked    quality 100
//   unsure     30, and the doubt of with_doubt() in the covariance
//   predicted  10, the same
//   none       no message, nor of the frame behind it, whose velocity is not known
//
// One thread, no clock: seconds are the frames'. No heap after open(); a frame costs 2 us and a system call, which
// never waits: what the network does not take is lost, counted, and said once.
#pragma once

#include <memory>
#include <string>

#include "platform/mavlink/mavlink_messages.hpp"
#include "platform/poses/body_course.hpp"
#include "platform/poses/line_outputs.hpp"
#include "platform/poses/pose_line.hpp"

namespace stillmesh {

enum class MavlinkMessage : std::uint8_t { kOdometry, kVision };

struct MavlinkOptions {
    std::string destination;  // "udp:HOST:PORT"; empty: none
    MavlinkMessage message = MavlinkMessage::kOdometry;
    std::uint8_t system = 1;  // the vehicle's number
    RigidTransform base_from_camera_link{};
};

// What is sent of each frame, as numbers.
class MavlinkPoses {
public:
    explicit MavlinkPoses(const RigidTransform& base_from_camera_link)
        : frames_(base_from_camera_link), course_(frames_) {}
    // False: nothing is sent of this frame.
    [[nodiscard]] bool frame(const PoseReport& report);
    [[nodiscard]] const MavlinkOdometry& odometry() const { return odometry_; }
    [[nodiscard]] const MavlinkVision& vision() const { return vision_; }

private:
    void fill(const PoseReport& report, const BodyStep& step);

    BodyFrames frames_;
    BodyCourse course_;
    bool has_sent_ = false;
    RigidTransform sent_map_from_odom_;
    std::size_t sent_map_ = 0;
    MavlinkOdometry odometry_;
    MavlinkVision vision_;
};

class MavlinkOutput {
public:
    // False: `message` says why. Nothing to do without a destination.
    [[nodiscard]] bool open(const MavlinkOptions& options, std::string& message);
    // Returns what to say when the first message was lost; else empty.
    [[nodiscard]] std::string frame(const PoseReport& report);
    // What was lost over all; empty: nothing.
    [[nodiscard]] std::string problem() const { return output_ != nullptr ? output_->problem() : std::string(); }

private:
    std::unique_ptr<LineOutput> output_;
    MavlinkMessage message_ = MavlinkMessage::kOdometry;
    MavlinkPoses poses_{RigidTransform{}};
    MavlinkMessages messages_{1};
    bool has_beaten_ = false;
    std::int64_t beat_ns_ = 0;  // of the last heartbeat
};

}  // namespace stillmesh
