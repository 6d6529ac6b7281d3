// A camera whose images come over ROS 2, from whatever driver publishes them: colour, depth as the colour camera sees
// it (aligned), and CameraInfo for the lens; ros2_images.hpp has the formats, packed_images.hpp those of topics that
// end in /compressed or /compressedDepth. A thread takes messages from Cyclone DDS, copies each image once, pairs them
// by their stamps, and the newest pair goes into one fixed slot; what was in it is dropped and counted. Subscribed at
// best effort, as sensor data is: any driver's QoS fits. Frames keep ROS's stamps, so that what is published of them is
// of the same time. Limits: sides of 4096 px. Memory: five images of each kind, and Cyclone's own. Cost: below 1 ms of
// the thread that reads for a frame of 640x480 beside Cyclone's own work, nothing of whoever polls. Every wait is
// bounded.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_pairer.hpp"
#include "hal/live/frame_times.hpp"

namespace stillmesh {

class RosContext;

struct Ros2Options {
    // As the realsense driver of ROS names them.
    std::string colour = "/camera/color/image_raw";
    std::string depth = "/camera/aligned_depth_to_color/image_raw";
    std::string info = "/camera/color/camera_info";
    std::string calibration;           // file or name, instead of CameraInfo; empty: CameraInfo
    std::uint32_t open_max_ms = 3000;  // until the first frame
    // Called first of all on the thread that reads: for its priority.
    std::function<void()> thread_begins{};
};

struct Ros2Counts {
    PairingCounts pairing;
    std::uint64_t images_colour = 0, images_depth = 0;
    std::uint64_t images_refused = 0;  // of another size or encoding than at first
    std::uint64_t dropped = 0;         // pairs overtaken in the slot
    std::int64_t reader_cpu_ns = 0;    // of the thread that reads
    std::int64_t poll_cpu_ns = 0;      // of poll(), on the caller's thread
};

class Ros2Camera final : public DepthCamera, public FrameTimes {
public:
    explicit Ros2Camera(Ros2Options options = {});
    ~Ros2Camera();
    Ros2Camera(const Ros2Camera&) = delete;
    Ros2Camera& operator=(const Ros2Camera&) = delete;

    // kOk; kUnavailable: nobody publishes, or no frame came in time; kInvalid: frames that cannot be used, or a wrong
    // ROS_DOMAIN_ID: message() says what to do.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return info_; }
    // kOk, kTimedOut; kUnavailable: nobody publishes any more.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    [[nodiscard]] std::int64_t due_ns() const noexcept override { return due_ns_; }
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;
    [[nodiscard]] std::uint64_t dropped() noexcept override { return counts().dropped; }

    [[nodiscard]] const std::string& message() const noexcept { return message_; }
    // What is known of a silence: which stream it is.
    [[nodiscard]] std::string silence() const;
    // Over all openings.
    [[nodiscard]] Ros2Counts counts() const noexcept;

private:
    struct Session;  // everything that belongs to one opening

    [[nodiscard]] Status refuse(Status status, std::string why);
    [[nodiscard]] Status begin();

    Ros2Options options_;
    CameraInfo info_;
    std::string message_;
    std::int64_t due_ns_ = 0;
    std::int64_t poll_cpu_ns_ = 0;
    Ros2Counts before_;                    // of the openings before this one
    std::shared_ptr<RosContext> context_;  // kept from opening to opening: it knows who is there
    std::unique_ptr<Session> session_;
};

// "COLOUR,DEPTH,INFO": names of topics. False: it is not.
[[nodiscard]] bool parse_ros2_topics(const std::string& text, Ros2Options& options);

}  // namespace stillmesh
