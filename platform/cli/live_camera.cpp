#include "platform/cli/live_camera.hpp"

#include <algorithm>
#include <charconv>
#include <iterator>

#include "platform/cli/complaint.hpp"
#include "platform/cli/first_camera.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/service.hpp"
#include "platform/ros2/ros2_module.hpp"
#ifdef STILLMESH_HAS_FREENECT
#include "hal/freenect/freenect_camera.hpp"
#endif
#ifdef STILLMESH_HAS_OPENNI2
#include "hal/openni2/openni2_camera.hpp"
#endif
#ifdef STILLMESH_HAS_USB
#include "hal/usb/camera_check.hpp"
#include "hal/usb/libusb_link.hpp"
#endif
#ifdef STILLMESH_HAS_V4L2
#include "hal/v4l2/kernel_link.hpp"
#include "hal/v4l2/v4l2_camera.hpp"
#endif

namespace stillmesh {
namespace {

// Different reasons why a camera that is waited for does not open, that are told.
constexpr std::size_t kReasonsMax = 16;

#ifdef STILLMESH_HAS_FREENECT
[[nodiscard]] std::unique_ptr<LiveCamera> make_freenect(const LiveCameraOptions& options, const std::string& device,
                                                        std::string& message) {
    FreenectOptions freenect;
    const char* const end = device.data() + device.size();
    if (!device.empty()) {
        const auto [stop, error] = std::from_chars(device.data(), end, freenect.device);
        if (error != std::errc() || stop != end) {
            message = "--camera " + options.camera + ": Kinects are counted, from freenect:0 on.";
            return nullptr;
        }
    }
    if (!options.record.empty()) {
        message = "--out " + options.record + ": only OpenNI2 writes .oni files; give a folder for a Kinect.";
        return nullptr;
    }
    if (options.exposure != "auto" || options.registration != "auto") {
        message = std::string(options.exposure != "auto" ? "--exposure" : "--registration") +
                  ": cannot be chosen for a Kinect; leave it out.";
        return nullptr;
    }
    if (!options.calibration.empty()) freenect.calibration = options.calibration;
    if (options.is_realtime) freenect.thread_begins = become_realtime_reader;
    return std::make_unique<FreenectCamera>(std::move(freenect));
}
#endif

[[nodiscard]] std::unique_ptr<LiveCamera> make_ros2(const LiveCameraOptions& options, const std::string& device,
                                                    std::string& message) {
    Ros2Options ros2;
    if (!device.empty() && !parse_ros2_topics(device, ros2)) {
        message = "--camera " + options.camera +
                  ": give three topics, ros2:COLOUR,DEPTH,INFO, with names as ROS 2 allows them, or ros2 alone.";
        return nullptr;
    }
    if (!options.record.empty()) {
        message = "--out " + options.record + ": only OpenNI2 writes .oni files; give a folder for images of ROS 2.";
        return nullptr;
    }
    if (options.exposure != "auto" || options.registration != "auto") {
        message = std::string(options.exposure != "auto" ? "--exposure" : "--registration") +
                  ": is chosen where the camera's driver runs; leave it out.";
        return nullptr;
    }
    ros2.calibration = options.calibration;
    if (options.is_realtime) ros2.thread_begins = become_realtime_reader;
    std::string need;
    const Ros2Module* const module = ros2_module(need);
    if (module != nullptr) return module->camera(std::move(ros2));
    message = "--camera ros2 " + need;
    return nullptr;
}

#ifdef STILLMESH_HAS_V4L2
[[nodiscard]] std::unique_ptr<LiveCamera> make_v4l2(const LiveCameraOptions& options, const std::string& device,
                                                    std::string& message) {
    if (!options.record.empty()) {
        message = "--out " + options.record + ": only OpenNI2 writes .oni files; give a folder for this camera.";
        return nullptr;
    }
    V4l2Options v4l2;
    v4l2.device = device;
    v4l2.calibration = options.calibration;
    v4l2.width_max = options.width_max;
    v4l2.height_max = options.height_max;
    v4l2.is_exposure_fixed = options.exposure == "fixed";
    v4l2.is_registered = options.registration == "none";
    if (options.is_realtime) v4l2.thread_begins = become_realtime_reader;
    return std::make_unique<V4l2Camera>(std::move(v4l2), std::make_shared<KernelV4l2Link>());
}
#endif

#ifdef STILLMESH_HAS_OPENNI2
[[nodiscard]] std::unique_ptr<LiveCamera> make_openni2(const LiveCameraOptions& options, const std::string& device) {
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
    if (options.is_realtime) openni2.thread_begins = become_realtime_reader;
    return std::make_unique<OpenNi2Camera>(std::move(openni2));
}
#endif

// What to install and how to build, where a driver is not in this build.
[[nodiscard]] std::string why_missing(const std::string& driver) {
    struct Need {
        const char* driver;
        const char* library;
        const char* package;
        const char* option;
    };
    constexpr Need kNeeds[] = {{"freenect", "libfreenect", "libfreenect-dev", "FREENECT"},
                               {"v4l2", "the kernel's headers", "linux-libc-dev", "V4L2"},
                               {"openni2", "OpenNI2", "libopenni2-dev", "OPENNI2"}};
    const Need* need = std::find_if(std::begin(kNeeds), std::end(kNeeds) - 1,
                                    [&driver](const Need& one) { return driver == one.driver; });
    return "--camera " + driver + " needs " + need->library +
           ", which is not in this build. Install it and build again: sudo apt-get install " + need->package +
           " && cmake --preset release -DSTILLMESH_WITH_" + need->option + "=ON && cmake --build build/release";
}

}  // namespace

std::unique_ptr<LiveCamera> make_live_camera(const LiveCameraOptions& options, std::string& message) {
    const std::size_t colon = options.camera.find(':');
    const std::string driver = options.camera.substr(0, colon);
    const std::string device = colon == std::string::npos ? std::string() : options.camera.substr(colon + 1);
    const bool is_auto = options.camera == "auto";
    const bool is_driver = driver == "openni2" || driver == "freenect" || driver == "v4l2" || driver == "ros2";
    if ((!is_driver && !is_auto) || (colon != std::string::npos && device.empty())) {
        message =
            "--camera " + options.camera +
            ": give auto, openni2, openni2:URI, openni2:SERIAL, openni2:FILE.oni, freenect, v4l2, v4l2:SERIAL, "
            "v4l2:ir, v4l2:alternate, v4l2:SERIAL,ir, v4l2:DEPTH_NODE,COLOUR_NODE, ros2 or ros2:COLOUR,DEPTH,INFO.";
        return nullptr;
    }
    message = why_missing(driver);
    std::vector<FirstLiveCamera::Candidate> candidates;
    [[maybe_unused]] const auto add = [&candidates](const char* name, std::unique_ptr<LiveCamera> camera) {
        if (camera != nullptr) candidates.push_back({name, std::move(camera)});
    };
#ifdef STILLMESH_HAS_V4L2
    if (is_auto || driver == "v4l2") add("V4L2", make_v4l2(options, device, message));
#endif
#ifdef STILLMESH_HAS_OPENNI2
    if (is_auto || driver == "openni2") add("OpenNI2", make_openni2(options, device));
#endif
#ifdef STILLMESH_HAS_FREENECT
    if (is_auto || driver == "freenect") add("libfreenect", make_freenect(options, device, message));
#endif
    if (driver == "ros2") add("ROS 2", make_ros2(options, device, message));
    if (candidates.empty()) return nullptr;
    if (candidates.size() == 1) return std::move(candidates.front().camera);
    return std::make_unique<FirstLiveCamera>(std::move(candidates));
}

bool reset_live_camera([[maybe_unused]] const LiveCamera& camera) {
#ifdef STILLMESH_HAS_USB
    if (const std::optional<std::string> place = camera.usb_place()) {
        LibusbLink link;
        std::string message;
        return reset_camera(link, *place, message) == UsbStatus::kOk;
    }
#endif
    return false;
}

void account_live_camera(const LiveCounts& counts, CameraRecord& record) {
    const PairingCounts& pairing = counts.pairing;
    record.pairs = pairing.pairs;
    record.colour_alone = pairing.colour_alone;
    record.depth_alone = pairing.depth_alone;
    record.images_missing = counts.images_missing + counts.images_unusable;
    record.lag_mean_ms = pairing.lag_mean_ms();
    record.lag_min_ms = static_cast<double>(pairing.lag_min_us) * 1e-3;
    record.lag_max_ms = static_cast<double>(pairing.lag_max_us) * 1e-3;
    if (counts.images_exposed > 0) {
        record.exposure_mean_ms =
            static_cast<double>(counts.exposure_sum_us) * 1e-3 / static_cast<double>(counts.images_exposed);
    }
    if (pairing.pairs > 0) {
        record.layer_cpu_ms =
            static_cast<double>(counts.reader_cpu_ns + counts.poll_cpu_ns) * 1e-6 / static_cast<double>(pairing.pairs);
    }
}

Status open_live_camera(DepthCamera& camera, const std::function<std::string()>& camera_message, bool does_wait,
                        std::string& message) {
    ServiceNotifier service;
    std::vector<std::string> told;
    for (;;) {
        const Status status = camera.open();
        if (status == Status::kOk) return status;
        message = camera_message();
        if (message.empty()) message = std::string("the camera is ") + status_name(status) + ".";
        if (status != Status::kUnavailable || !does_wait || stop_signal() != 0) return status;
        // Plugged in, it may still not be opened: each reason is told, once, since two of them may take turns for days.
        if (told.size() < kReasonsMax && std::find(told.begin(), told.end(), message) == told.end()) {
            complain(message + " Waiting for one; Ctrl-C ends it.", LogLevel::kWarning);
            if (told.empty()) service.ready();  // a service that waits for its camera has started
            told.push_back(message);
        }
        service.alive(monotonic_ns());
        const std::int64_t until_ns = monotonic_ns() + 300'000'000;
        sleep_until_ns(until_ns);
        if (stop_signal() != 0) return status;
    }
}

}  // namespace stillmesh
