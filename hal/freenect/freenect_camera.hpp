// The first Kinect (for Xbox 360, for Windows) through libfreenect. A thread makes all of libfreenect's calls; its
// callbacks pair the images by time, and the newest pair goes into one fixed slot without copying a pixel: libfreenect
// writes into our buffers, which change hands. What was in the slot is dropped and counted. Depth comes in millimetres
// in the colour camera's view: from libfreenect where it offers that, else it is computed here from the raw values.
// Every wait is bounded: libfreenect itself waits for ever for a device that does not answer, so a thread that does not
// come back is left behind. Limits: 640x480, 30 frames/s. Memory: four images of each kind, taken in open(), and one
// more of depth where it is computed here. Cost: nothing per frame; some 2.5 ms where depth is computed here.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/live/depth_registration.hpp"
#include "hal/live/live_camera.hpp"

namespace stillmesh {

struct FreenectOptions {
    std::string calibration = "kinect";  // file or built-in name
    std::uint32_t device = 0;            // which of several, from 0
    double baseline_m = 0.025;         // colour camera to the right of the depth camera, where depth is registered here
    double depth_fx = 585.6;           // px, of the depth camera (Burrus' calibration, nicolas.burrus.name)
    std::uint32_t open_max_ms = 6000;  // opening or closing longer than this has failed
    std::uint32_t gone_ms = 500;       // silence after which we look whether it is still plugged in
    // Called first of all on the thread that reads: for its priority.
    std::function<void()> thread_begins{};
};

class FreenectCamera final : public LiveCamera {
public:
    static constexpr std::uint32_t kWidth = 640;   // px
    static constexpr std::uint32_t kHeight = 480;  // px

    explicit FreenectCamera(FreenectOptions options = {});
    ~FreenectCamera() override;

    // kOk; kUnavailable: no Kinect (now), or it does not answer; kInvalid: the calibration: message() says why.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return info_; }
    // kOk, kTimedOut; kUnavailable: unplugged, or libfreenect gave up.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    [[nodiscard]] std::int64_t due_ns() const noexcept override { return due_ns_; }
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;

    [[nodiscard]] std::string message() const override { return message_; }
    [[nodiscard]] std::string silence() const override;
    [[nodiscard]] std::string device() const override;
    [[nodiscard]] std::string calibration_source() const override { return options_.calibration; }
    [[nodiscard]] std::optional<std::string> usb_place() const override { return std::string(); }
    // reader_cpu_ns: with what libfreenect does on it.
    [[nodiscard]] LiveCounts counts() const noexcept override;
    // Whether libfreenect gives registered millimetres; else they are computed here.
    [[nodiscard]] bool is_registered_by_driver() const noexcept;

private:
    struct Session;  // everything that belongs to one opening

    [[nodiscard]] Status refuse(Status status, std::string why);

    FreenectOptions options_;
    CameraInfo info_;
    std::string message_;
    std::int64_t due_ns_ = 0;
    LiveCounts before_;  // of the openings before this one, and of poll() in this one
    std::shared_ptr<Session> session_;
    std::vector<std::uint16_t> millimetres_of_raw_, millimetres_, registered_;  // where depth is computed here
    std::unique_ptr<DepthRegistration> registration_;
};

// Depth in mm of the Kinect's raw 11-bit value; 0: none, or outside 0.4 to 10 m.
[[nodiscard]] std::uint16_t kinect_millimetres(std::uint16_t raw) noexcept;

}  // namespace stillmesh
