// A camera whose images come over ROS 2, from whatever driver publishes them: colour, depth, and CameraInfo for the
// lens; depth as the colour camera sees it (aligned), or of a camera of its own, if CameraInfo beside its topic and
// /tf_static say which and where, or a calibration of two cameras does: then it is registered here, in poll().
// ros2_images.hpp has the formats, packed_images.hpp those of topics that end in /compressed or /compressedDepth. A
// thread takes messages from Cyclone DDS, copies each image once, pairs them by their stamps, and the newest pair goes
// into one fixed slot; what was in it is dropped and counted. Subscribed at best effort, as sensor data is: any
// driver's QoS fits. Frames keep ROS's stamps, so that what is published of them is of the same time. Limits: sides of
// 4096 px. Memory: five images of each kind, and Cyclone's own. Cost: below 1 ms of the thread that reads for a frame
// of 640x480 beside Cyclone's own work, nothing of whoever polls but for the registration (depth_registration.hpp).
// Every wait is bounded.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "hal/live/depth_registration.hpp"
#include "hal/live/live_camera.hpp"
#include "hal/replay/one_view.hpp"

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

class Ros2Camera final : public LiveCamera {
public:
    explicit Ros2Camera(Ros2Options options = {});
    ~Ros2Camera() override;

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

    [[nodiscard]] std::string message() const override { return message_; }
    [[nodiscard]] std::string silence() const override;
    [[nodiscard]] std::string device() const override;
    [[nodiscard]] std::string calibration_source() const override;
    [[nodiscard]] std::vector<std::string> notes() const override { return notes_; }
    [[nodiscard]] LiveCounts counts() const noexcept override;

private:
    struct Session;  // everything that belongs to one opening

    [[nodiscard]] Status refuse(Status status, std::string why);
    [[nodiscard]] Status begin();
    [[nodiscard]] Status place_depth(std::unique_lock<std::mutex>& lock, std::chrono::steady_clock::time_point until);
    [[nodiscard]] Status register_here(const SeparateDepth& depth, const std::string& source);

    Ros2Options options_;
    CameraInfo info_;
    std::string message_;
    std::int64_t due_ns_ = 0;
    LiveCounts before_;                    // of the openings before this one, and of poll() in this one
    std::shared_ptr<RosContext> context_;  // kept from opening to opening: it knows who is there
    std::unique_ptr<Session> session_;
    std::optional<DepthRegistration> registration_;  // none: depth is as the colour camera sees it
    ImageSize depth_size_;
    std::vector<std::uint16_t> registered_;
    std::vector<std::string> notes_;
};

// "COLOUR,DEPTH,INFO": names of topics. False: it is not.
[[nodiscard]] bool parse_ros2_topics(const std::string& text, Ros2Options& options);

}  // namespace stillmesh
