// A depth camera of the USB Video Class through the kernel's own interface, V4L2, without any library: RealSense D4xx,
// and others whose depth comes as Z16 or Y16. One thread reads what the driver brings, pairs it by time and puts the
// newest pair into one fixed slot without copying a pixel; what was there is dropped and counted. A RealSense is asked
// for its calibration and its depth unit; its depth, of another size, field of view and place than colour, is brought
// into the colour camera's view here; the times of its images are those of its own clock, where its metadata can be
// read. Every wait is bounded: opening and closing run on a thread that is left behind if
// it takes too long. Memory: six images of each kind in the kernel, one of each here, taken in open(). Cost: 2.5 to
// 3.5 ms per frame, in poll(), for depth of 848x480 into colour of 640x480.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/live/live_camera.hpp"
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

class V4l2Camera final : public LiveCamera {
public:
    V4l2Camera(V4l2Options options, std::shared_ptr<V4l2Link> link);
    ~V4l2Camera() override;

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

    [[nodiscard]] std::string message() const override { return message_; }
    [[nodiscard]] std::string silence() const override;
    [[nodiscard]] std::string remark() override;
    [[nodiscard]] std::string device() const override { return device_; }
    [[nodiscard]] std::string calibration_source() const override { return calibration_source_; }
    [[nodiscard]] std::vector<std::string> notes() const override { return notes_; }
    // As the kernel writes it: "2-1".
    [[nodiscard]] std::optional<std::string> usb_place() const override;
    [[nodiscard]] LiveCounts counts() const noexcept override;

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
    std::string told_;  // the last remark
    v4l2::Identity identity_;
    V4l2Size depth_first_, colour_first_;  // of the first opening
    std::int64_t due_ns_ = 0;
    LiveCounts before_;                       // of the openings before this one, and of poll() in this one
    std::shared_ptr<v4l2::Session> session_;  // of this opening
    std::unique_ptr<v4l2::FrameConversion> conversion_;
};

}  // namespace stillmesh
