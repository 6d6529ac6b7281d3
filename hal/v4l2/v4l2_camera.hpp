// A depth camera of the USB Video Class through the kernel's own interface, V4L2, without any library: RealSense D4xx,
// and others whose depth comes as Z16 or Y16. One thread reads what the driver brings, pairs it by time and puts the
// newest pair into one fixed slot without copying a pixel; what was there is dropped and counted. A RealSense is asked
// for its calibration and its depth unit; its depth, of another size, field of view and place than colour, is brought
// into the colour camera's view here. Every wait is bounded: opening and closing run on a thread that is left behind if
// it takes too long. Memory: six images of each kind in the kernel, one of each here, taken in open(). Cost: 2.5 to
// 3.5 ms per frame, in poll(), for depth of 848x480 into colour of 640x480.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_pairer.hpp"
#include "hal/live/frame_times.hpp"
#include "hal/v4l2/camera_choice.hpp"

namespace stillmesh {

namespace v4l2 {
class FrameConversion;
struct Session;
}  // namespace v4l2

struct V4l2Options {
    std::string device{};              // empty: the first; a serial number; DEPTH_NODE,COLOUR_NODE; ir; SERIAL,ir
    std::string calibration{};         // of the colour camera, file or name; empty: what the camera says
    std::uint32_t width_max = 640;     // px, of colour; larger modes are not asked for
    std::uint32_t height_max = 480;    // px
    bool is_exposure_fixed = false;    // exposure and white balance stay as they stand
    bool is_registered = false;        // depth is in the colour camera's view already
    std::uint32_t open_max_ms = 8000;  // opening or closing longer than this has failed
    bool has_thread = true;            // else poll() and wait() read: for tests that go by a clock of their own
    // Called first of all on the thread that reads: for its priority.
    std::function<void()> thread_begins{};
};

struct V4l2Counts {
    PairingCounts pairing;
    std::uint64_t images_colour = 0, images_depth = 0;
    std::uint64_t images_missing = 0;  // numbers of images that never came: lost before us
    std::uint64_t images_broken = 0;   // damaged, or of a wrong length
    std::uint64_t dropped = 0;         // pairs overtaken in the slot
    std::int64_t reader_cpu_ns = 0;    // of the thread that reads
    std::int64_t poll_cpu_ns = 0;      // of poll(), on the caller's thread
};

class V4l2Camera final : public DepthCamera, public FrameTimes {
public:
    V4l2Camera(V4l2Options options, std::shared_ptr<V4l2Link> link);
    ~V4l2Camera();
    V4l2Camera(const V4l2Camera&) = delete;
    V4l2Camera& operator=(const V4l2Camera&) = delete;

    // kOk; kUnavailable: no such camera (now), no permission, busy, or it does not answer; kInvalid: it cannot be used:
    // message() says why. Opened again, it is the camera of before or none, in the sizes of before if it still offers
    // them.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return info_; }
    // kOk, kTimedOut, kCorrupt; kUnavailable: unplugged, or its driver gave up.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    [[nodiscard]] std::int64_t due_ns() const noexcept override { return due_ns_; }
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;
    [[nodiscard]] std::uint64_t dropped() noexcept override { return counts().dropped; }

    [[nodiscard]] const std::string& message() const noexcept { return message_; }
    // What was found when it was opened: device, modes, registration.
    [[nodiscard]] const std::string& device() const noexcept { return device_; }
    // Where it is plugged in, as the kernel writes it ("2-1"); empty: no USB device, or never open.
    [[nodiscard]] const std::string& usb_port() const noexcept { return identity_.usb_port; }
    [[nodiscard]] const std::string& calibration_source() const noexcept { return calibration_source_; }
    [[nodiscard]] const std::vector<std::string>& notes() const noexcept { return notes_; }
    // What is known of a silence: which of the two streams it is, or images that cannot be used. Empty: nothing.
    [[nodiscard]] std::string silence() const;
    // Over all openings.
    [[nodiscard]] V4l2Counts counts() const noexcept;

private:
    [[nodiscard]] Status refuse(Status status, std::string why);
    [[nodiscard]] Status start_session();
    void adopt();

    V4l2Options options_;
    std::shared_ptr<V4l2Link> link_;
    CameraInfo info_;
    CameraInfo given_;  // the calibration, as it was read
    bool has_calibration_ = false;
    std::string message_, device_, calibration_source_;
    std::vector<std::string> notes_;
    v4l2::Identity identity_;
    V4l2Size depth_first_, colour_first_;  // of the first opening
    std::int64_t due_ns_ = 0;
    std::int64_t poll_cpu_ns_ = 0;
    V4l2Counts before_;                       // of the openings before this one
    std::shared_ptr<v4l2::Session> session_;  // of this opening
    std::unique_ptr<v4l2::FrameConversion> conversion_;
};

}  // namespace stillmesh
