// A depth camera through OpenNI2, live or from an .oni file. Live: one thread reads what OpenNI2 brings, pairs it by
// time and puts the newest pair into one fixed slot without copying a pixel; what was there is dropped and
// counted. A file: every pair in order, as fast as it is asked for. Colour and depth are upright (not mirrored), of one
// size, depth in the colour camera's view: by the device where it can, else here. Every wait is bounded, also for
// drivers that hang: opening and closing run on a thread that is left behind if it takes too long. Memory: OpenNI2
// keeps its own frames on the heap; ours are at most one colour and two depth images, taken in open(). Cost: next to
// nothing per frame when the device does all; some 1.5 ms where depth is registered here.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/live/live_camera.hpp"

namespace stillmesh {

namespace openni2 {
class ImageConversion;
struct Session;
}  // namespace openni2

enum class Exposure : std::uint8_t {
    kAuto,   // the device's own automatics, exposure and white balance
    kFixed,  // as they stand when the camera is opened
};

enum class Registration : std::uint8_t {
    kAuto,  // the device, else here; a file is taken as registered, since files do not say
    kHere,  // here, with the baseline of the PrimeSense kind
    kNone,  // depth is in the colour camera's view already
};

struct OpenNi2Options {
    std::string device{};            // "auto" or empty: the first; a URI, a serial number, or a FILE.oni
    std::string calibration{};       // file or name; empty: from the field of view
    std::uint32_t width_max = 640;   // px; larger modes are not asked for
    std::uint32_t height_max = 480;  // px
    Exposure exposure = Exposure::kAuto;
    Registration registration = Registration::kAuto;
    double baseline_m = 0.025;         // for kHere: colour camera to the right of the depth camera
    std::string record{};              // .oni file that everything goes into; empty: none
    std::uint32_t open_max_ms = 6000;  // opening or closing longer than this has failed
    // Called first of all on the thread that opens and reads: for its priority, which the driver's threads inherit.
    std::function<void()> thread_begins{};
};

class OpenNi2Camera final : public LiveCamera {
public:
    explicit OpenNi2Camera(OpenNi2Options options);
    ~OpenNi2Camera() override;

    // kOk; kUnavailable: no such device (now), or it does not answer; kInvalid: it cannot be used: message() says why.
    // Opened again, it is the camera of before or none, also where it has another address on the bus now; in the size
    // of its first opening, if it still offers that.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return info_; }
    // As the port says. kEnd: the file has ended.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    [[nodiscard]] std::int64_t due_ns() const noexcept override { return due_ns_; }
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;

    [[nodiscard]] std::string message() const override { return message_; }
    [[nodiscard]] std::string silence() const override;
    // The device is a recording: named *.oni, or the name of a file that was there when this was made.
    [[nodiscard]] bool is_file() const override { return is_file_; }
    [[nodiscard]] std::string device() const override { return device_; }
    [[nodiscard]] std::string calibration_source() const override { return calibration_source_; }
    [[nodiscard]] std::vector<std::string> notes() const override { return notes_; }
    [[nodiscard]] std::uint64_t frames_expected() const override { return frames_expected_; }
    // OpenNI2's URI of it.
    [[nodiscard]] std::optional<std::string> usb_place() const override;
    [[nodiscard]] LiveCounts counts() const noexcept override;

private:
    [[nodiscard]] Status refuse(Status status, std::string why);
    [[nodiscard]] Status calibrate(double fov_x);
    // Of a file that has just been opened: why it gives no pair; empty: the first is there.
    [[nodiscard]] std::string why_nothing_comes();

    OpenNi2Options options_;
    bool is_file_;
    CameraInfo info_;
    CameraInfo given_;  // the calibration, as it was read
    bool has_calibration_ = false;
    std::string message_, device_, uri_, serial_, calibration_source_;
    std::vector<std::string> notes_;
    int first_width_ = 0;  // px, of the first opening
    std::uint64_t frames_expected_ = 0;
    std::int64_t due_ns_ = 0;
    LiveCounts before_;                          // of the openings before this one, and of poll() in this one
    std::shared_ptr<openni2::Session> session_;  // of this opening
    std::shared_ptr<void> runtime_;  // keeps OpenNI2 running between two openings: it hears what is plugged in
    std::unique_ptr<openni2::ImageConversion> conversion_;  // of this opening
};

}  // namespace stillmesh
