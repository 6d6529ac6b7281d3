#include "platform/cli/live_camera.hpp"

#include "platform/cli/complaint.hpp"
#include "platform/linux/process.hpp"
#ifdef STILLMESH_HAS_OPENNI2
#include "hal/openni2/openni2_camera.hpp"
#endif
#ifdef STILLMESH_HAS_USB
#include "hal/usb/camera_check.hpp"
#include "hal/usb/libusb_link.hpp"
#endif

namespace stillmesh {
namespace {

#ifdef STILLMESH_HAS_OPENNI2
class OpenNi2LiveCamera final : public LiveCamera {
public:
    explicit OpenNi2LiveCamera(OpenNi2Options options) : camera_(std::move(options)) {}

    DepthCamera& camera() override { return camera_; }
    FrameTimes& times() override { return camera_; }
    std::string message() const override { return camera_.message(); }
    bool is_file() const override { return camera_.is_file(); }
    std::string device() const override { return camera_.device(); }
    std::string calibration_source() const override { return camera_.calibration_source(); }
    std::vector<std::string> notes() const override { return camera_.notes(); }
    std::uint64_t frames_expected() const override { return camera_.frames_expected(); }
    void account(CameraRecord& record) const override {
        const OpenNi2Counts counts = camera_.counts();
        record.pairs = counts.pairing.pairs;
        record.colour_alone = counts.pairing.colour_alone;
        record.depth_alone = counts.pairing.depth_alone;
        record.images_missing = counts.images_missing;
        record.lag_mean_ms = counts.pairing.lag_mean_ms();
        record.lag_min_ms = static_cast<double>(counts.pairing.lag_min_us) * 1e-3;
        record.lag_max_ms = static_cast<double>(counts.pairing.lag_max_us) * 1e-3;
        if (counts.pairing.pairs > 0) {
            record.layer_cpu_ms = static_cast<double>(counts.reader_cpu_ns + counts.poll_cpu_ns) * 1e-6 /
                                  static_cast<double>(counts.pairing.pairs);
        }
    }

#ifdef STILLMESH_HAS_USB
    bool reset() override {
        if (camera_.uri().empty()) return false;
        LibusbLink link;
        std::string message;
        return reset_camera(link, camera_.uri(), message) == UsbStatus::kOk;
    }
#endif

private:
    OpenNi2Camera camera_;
};
#endif

}  // namespace

std::unique_ptr<LiveCamera> make_live_camera(const LiveCameraOptions& options, std::string& message) {
    constexpr const char* kOpenNi2 = "openni2";
    const std::size_t colon = options.camera.find(':');
    const std::string driver = options.camera.substr(0, colon);
    const std::string device = colon == std::string::npos ? std::string() : options.camera.substr(colon + 1);
    if ((driver != kOpenNi2 && options.camera != "auto") || (colon != std::string::npos && device.empty())) {
        message =
            "--camera " + options.camera + ": give auto, openni2, openni2:URI, openni2:SERIAL or openni2:FILE.oni.";
        return nullptr;
    }
#ifdef STILLMESH_HAS_OPENNI2
    OpenNi2Options openni2;
    openni2.device = device;
    openni2.calibration = options.calibration;
    openni2.width_max = options.width_max;
    openni2.height_max = options.height_max;
    openni2.exposure = options.exposure == "fixed" ? Exposure::kFixed : Exposure::kAuto;
    openni2.registration = options.registration == "here"   ? Registration::kHere
                           : options.registration == "none" ? Registration::kNone
                                                            : Registration::kAuto;
    openni2.record = options.record;
    return std::make_unique<OpenNi2LiveCamera>(std::move(openni2));
#else
    message =
        "--camera needs OpenNI2, which is not in this build: install libopenni2-dev, configure with "
        "-DSTILLMESH_WITH_OPENNI2=ON and build again.";
    return nullptr;
#endif
}

Status open_live_camera(DepthCamera& camera, const std::function<std::string()>& camera_message, bool does_wait,
                        std::string& message) {
    ServiceNotifier service;
    for (bool has_told = false;; has_told = true) {
        const Status status = camera.open();
        if (status == Status::kOk) return status;
        message = camera_message();
        if (message.empty()) message = std::string("the camera is ") + status_name(status) + ".";
        if (status != Status::kUnavailable || !does_wait || stop_signal() != 0) return status;
        if (!has_told) {
            complain(message + " Waiting for one; Ctrl-C ends it.", LogLevel::kWarning);
            service.ready();  // a service that waits for its camera has started
        }
        service.alive(monotonic_ns());
        const std::int64_t until_ns = monotonic_ns() + 300'000'000;
        sleep_until_ns(until_ns);
        if (stop_signal() != 0) return status;
    }
}

}  // namespace stillmesh
