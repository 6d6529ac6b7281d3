// A driver for OpenNI2 as Debian ships it, which serves frames of the simulated scenes, rendered beforehand, as one or
// two cameras that can be unplugged, stalled and spoilt from outside (control.hpp). It knows nothing of Stillmesh but
// the file formats. XnLib is not in the development package: the two macros that its header wants are made here.
#define XN_NEW(T, ...) new T(__VA_ARGS__)
#define XN_DELETE(p) delete (p)
#include <Driver/OniDriverAPI.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <thread>
#include <utility>

#include "tests/openni2/driver/control.hpp"

namespace stillmesh::test {
namespace {

using namespace oni::driver;

[[nodiscard]] std::int64_t clock_ns(clockid_t clock) {
    timespec now{};
    ::clock_gettime(clock, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// A file in memory; null: not there.
[[nodiscard]] void* map_file(const char* path, bool is_writable, std::size_t& bytes) {
    const int file = ::open(path, (is_writable ? O_RDWR : O_RDONLY) | O_CLOEXEC);
    if (file < 0) return nullptr;
    struct stat about {};
    void* memory = MAP_FAILED;
    if (::fstat(file, &about) == 0 && about.st_size > 0) {
        bytes = static_cast<std::size_t>(about.st_size);
        memory = ::mmap(nullptr, bytes, is_writable ? PROT_READ | PROT_WRITE : PROT_READ, MAP_SHARED | MAP_POPULATE,
                        file, 0);
    }
    ::close(file);
    return memory == MAP_FAILED ? nullptr : memory;
}

struct Shared {
    Control* control = nullptr;
    const FramesHead* frames = nullptr;
    std::size_t control_bytes = 0, frames_bytes = 0;

    Shared() {
        const char* const path = std::getenv("STILLMESH_TEST_CAMERA");
        if (path == nullptr) return;
        control = static_cast<Control*>(map_file(path, true, control_bytes));
        if (control == nullptr || control_bytes < sizeof(Control) || control->magic != kControlMagic) {
            control = nullptr;
            return;
        }
        frames = static_cast<const FramesHead*>(map_file(control->frames_file, false, frames_bytes));
        if (frames == nullptr || frames->magic != kFramesMagic ||
            frames_bytes < sizeof(FramesHead) + frames->count * frames->frame_bytes()) {
            std::fprintf(stderr, "test driver: no frames in '%s'\n", control->frames_file);
            control = nullptr;
        }
    }
    ~Shared() {
        if (control != nullptr) ::munmap(control, control_bytes);
        if (frames != nullptr) ::munmap(const_cast<FramesHead*>(frames), frames_bytes);
    }
    Shared(const Shared&) = delete;
    Shared& operator=(const Shared&) = delete;
    [[nodiscard]] const std::uint8_t* frame(std::uint32_t index) const {
        return reinterpret_cast<const std::uint8_t*>(frames + 1) + index * frames->frame_bytes() +
               sizeof(FramesHead::Pose);
    }
};

void fill_info(std::uint32_t camera, std::uint32_t address, OniDeviceInfo& info) {
    info = {};
    std::snprintf(info.uri, sizeof(info.uri), "%s", uri_of(camera, address).text);
    std::snprintf(info.vendor, sizeof(info.vendor), "Stillmesh");
    std::snprintf(info.name, sizeof(info.name), "Test camera");
    info.usbVendorId = 0x1d27;
    info.usbProductId = 0x0601;
}

template <typename T>
OniStatus put(void* data, int* size, const T& value) {
    if (*size < static_cast<int>(sizeof(value))) return ONI_STATUS_BAD_PARAMETER;
    std::memcpy(data, &value, sizeof(value));
    *size = static_cast<int>(sizeof(value));
    return ONI_STATUS_OK;
}

constexpr std::size_t kModesMax = 3;

// How many modes a sensor has, and which.
int modes_of(const CameraControl& control, OniSensorType type, std::array<OniVideoMode, kModesMax>& modes) {
    const std::uint32_t bits = control.modes;
    const bool is_colour = type == ONI_SENSOR_COLOR;
    const OniPixelFormat format =
        is_colour ? ((bits & 4U) != 0 ? ONI_PIXEL_FORMAT_YUYV : ONI_PIXEL_FORMAT_RGB888)
                  : ((bits & 16U) != 0 ? ONI_PIXEL_FORMAT_DEPTH_100_UM : ONI_PIXEL_FORMAT_DEPTH_1_MM);
    const std::uint32_t said = is_colour ? control.colour_fps : control.depth_fps;
    const int fps = said == 0 ? 30 : static_cast<int>(said);
    std::size_t count = 0;
    if (is_colour && (bits & 8U) != 0) modes[count++] = {format, 1280, 1024, fps};
    if ((bits & 1U) != 0) modes[count++] = {format, 640, 480, fps};
    if ((bits & 2U) != 0) modes[count++] = {format, 320, 240, fps};
    return static_cast<int>(count);
}

class TestStream final : public StreamBase {
public:
    TestStream(Shared& shared, std::uint32_t camera, OniSensorType type)
        : shared_(shared), control_(shared.control->cameras[camera]), type_(type) {
        std::array<OniVideoMode, kModesMax> modes;
        if (modes_of(control_, type, modes) > 0) mode_ = modes[0];
    }

    OniStatus start() override {
        is_running_ = true;
        return ONI_STATUS_OK;
    }
    void stop() override { is_running_ = false; }
    OniStatus getProperty(int id, void* data, int* size) override {
        if (is_unknown(id)) return ONI_STATUS_NOT_SUPPORTED;
        switch (id) {
            case ONI_STREAM_PROPERTY_VIDEO_MODE: return put(data, size, mode_);
            case ONI_STREAM_PROPERTY_HORIZONTAL_FOV: return put(data, size, fov(shared_.frames->width));
            case ONI_STREAM_PROPERTY_VERTICAL_FOV: return put(data, size, fov(shared_.frames->height));
            case ONI_STREAM_PROPERTY_MIRRORING: return put(data, size, is_mirroring_);
            case ONI_STREAM_PROPERTY_MAX_VALUE: return put(data, size, depth_max());
            case ONI_STREAM_PROPERTY_MIN_VALUE: return put(data, size, int{0});
            case ONI_STREAM_PROPERTY_STRIDE: return put(data, size, mode_.resolutionX * bytes());
            case ONI_STREAM_PROPERTY_CROPPING: {  // a recording without it plays no image
                OniCropping cropping{};
                cropping.width = mode_.resolutionX;
                cropping.height = mode_.resolutionY;
                return put(data, size, cropping);
            }
            case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
            case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE: return put(data, size, is_auto_);
            default: return ONI_STATUS_NOT_SUPPORTED;
        }
    }
    OniStatus setProperty(int id, const void* data, int size) override {
        if (id == ONI_STREAM_PROPERTY_VIDEO_MODE && size == static_cast<int>(sizeof(OniVideoMode))) {
            OniVideoMode mode{};
            std::memcpy(&mode, data, sizeof(mode));
            std::array<OniVideoMode, kModesMax> modes;
            const auto count = static_cast<std::size_t>(modes_of(control_, type_, modes));
            const bool is_there = std::any_of(modes.begin(), modes.begin() + count, [&mode](const OniVideoMode& known) {
                return std::memcmp(&known, &mode, sizeof(mode)) == 0;
            });
            if (!is_there) return ONI_STATUS_NOT_SUPPORTED;
            mode_ = mode;
        } else if (size == static_cast<int>(sizeof(OniBool)) &&
                   (id == ONI_STREAM_PROPERTY_MIRRORING || id == ONI_STREAM_PROPERTY_AUTO_EXPOSURE ||
                    id == ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE)) {
            OniBool value = FALSE;
            std::memcpy(&value, data, sizeof(value));
            if (id == ONI_STREAM_PROPERTY_MIRRORING) {
                if (value == FALSE && control_.can_unmirror == 0) return ONI_STATUS_NOT_SUPPORTED;
                is_mirroring_ = value;
                control_.is_mirroring = value != FALSE;
            } else {
                is_auto_ = value;
                control_.auto_exposure = value != FALSE;
            }
        } else {
            return ONI_STATUS_NOT_SUPPORTED;
        }
        raisePropertyChanged(id, data, size);
        return ONI_STATUS_OK;
    }
    OniBool isPropertySupported(int id) override {
        if (is_unknown(id)) return FALSE;
        switch (id) {
            case ONI_STREAM_PROPERTY_VIDEO_MODE:
            case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
            case ONI_STREAM_PROPERTY_VERTICAL_FOV:
            case ONI_STREAM_PROPERTY_MIRRORING:
            case ONI_STREAM_PROPERTY_STRIDE:
            case ONI_STREAM_PROPERTY_CROPPING: return TRUE;
            case ONI_STREAM_PROPERTY_MAX_VALUE:
            case ONI_STREAM_PROPERTY_MIN_VALUE: return type_ == ONI_SENSOR_DEPTH ? TRUE : FALSE;
            case ONI_STREAM_PROPERTY_AUTO_EXPOSURE:
            case ONI_STREAM_PROPERTY_AUTO_WHITE_BALANCE: return type_ == ONI_SENSOR_COLOR ? TRUE : FALSE;
            default: return FALSE;
        }
    }
    void notifyAllProperties() override {  // what a recording will know
        raisePropertyChanged(ONI_STREAM_PROPERTY_VIDEO_MODE, &mode_, sizeof(mode_));
        if (!is_unknown(ONI_STREAM_PROPERTY_HORIZONTAL_FOV)) {
            const float x = fov(shared_.frames->width);
            const float y = fov(shared_.frames->height);
            raisePropertyChanged(ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &x, sizeof(x));
            raisePropertyChanged(ONI_STREAM_PROPERTY_VERTICAL_FOV, &y, sizeof(y));
        }
        raisePropertyChanged(ONI_STREAM_PROPERTY_MIRRORING, &is_mirroring_, sizeof(is_mirroring_));
        if (type_ == ONI_SENSOR_DEPTH) {
            const int max = depth_max();
            const int min = 0;
            raisePropertyChanged(ONI_STREAM_PROPERTY_MAX_VALUE, &max, sizeof(max));
            raisePropertyChanged(ONI_STREAM_PROPERTY_MIN_VALUE, &min, sizeof(min));
        }
    }

    void emit(std::uint32_t number, std::uint32_t index, std::int64_t stamp_us, bool is_registered) {
        if (!is_running_) return;
        OniFrame* const frame = getServices().acquireFrame();
        if (frame == nullptr) return;
        const bool is_wrong = control_.emits_wrong_size != 0;
        const int width = is_wrong ? 160 : mode_.resolutionX;
        const int height = is_wrong ? 120 : mode_.resolutionY;
        // There and back in two thirds of a second.
        const int phase = std::abs(static_cast<int>(number % 20) - 10);
        const auto gain = static_cast<std::uint32_t>(100 + static_cast<int>(control_.exposure_swing) * (phase - 5) / 5);
        fill(frame->data, gain, index, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height),
             is_registered);
        frame->dataSize = width * height * bytes();
        frame->sensorType = type_;
        frame->frameIndex = static_cast<int>(number);
        frame->width = width;
        frame->height = height;
        frame->videoMode = mode_;
        frame->videoMode.resolutionX = width;
        frame->videoMode.resolutionY = height;
        frame->croppingEnabled = FALSE;
        frame->cropOriginX = frame->cropOriginY = 0;
        frame->stride = width * bytes();
        frame->timestamp = static_cast<std::uint64_t>(stamp_us);
        raiseNewFrame(frame);
        getServices().releaseFrame(frame);
        ++(type_ == ONI_SENSOR_COLOR ? control_.images_colour : control_.images_depth);
    }

private:
    [[nodiscard]] bool is_unknown(int property) const {
        return (property == ONI_STREAM_PROPERTY_CROPPING && control_.has_no_cropping != 0) ||
               ((property == ONI_STREAM_PROPERTY_HORIZONTAL_FOV || property == ONI_STREAM_PROPERTY_VERTICAL_FOV) &&
                control_.has_no_fov != 0);
    }
    [[nodiscard]] int bytes() const { return mode_.pixelFormat == ONI_PIXEL_FORMAT_RGB888 ? 3 : 2; }
    [[nodiscard]] int depth_max() const {
        return mode_.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM ? static_cast<int>(kDepthMax) : 10000;
    }
    [[nodiscard]] float fov(std::uint32_t pixels) const {
        return static_cast<float>(2.0 * std::atan(0.5 * pixels / shared_.frames->fx));
    }
    // Every step-th pixel of the rendered frame; grey is the mean of the pixels between, so that the principal point
    // stays in the middle.
    void fill(void* data, std::uint32_t gain_percent, std::uint32_t index, std::uint32_t width, std::uint32_t height,
              bool is_registered) const {
        const FramesHead& head = *shared_.frames;
        const std::uint8_t* const grey = shared_.frame(index);
        const std::size_t pixels = std::size_t{head.width} * head.height;
        const bool is_raw = !is_registered && head.has_raw_depth != 0;
        const auto* const depth = reinterpret_cast<const std::uint16_t*>(grey + pixels) + (is_raw ? pixels : 0);
        const std::uint32_t step = std::max(head.width / width, 1U);
        const bool is_fine_depth = mode_.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM;
        const bool is_finer = width > head.width;
        for (std::uint32_t y = 0; y < height; ++y) {
            const std::uint32_t row = is_finer ? y * head.height / height : y * step;
            for (std::uint32_t x = 0; x < width; ++x) {
                const std::uint32_t to = y * width + (is_mirroring_ != FALSE ? width - 1 - x : x);
                const std::uint32_t column = is_finer ? x * head.width / width : x * step;
                const std::size_t from = std::size_t{row} * head.width + column;
                if (type_ == ONI_SENSOR_DEPTH) {
                    static_cast<std::uint16_t*>(data)[to] =
                        is_fine_depth ? (depth[from] * 10U <= kDepthMax ? static_cast<std::uint16_t>(depth[from] * 10U)
                                                                        : std::uint16_t{0})
                                      : depth[from];
                    continue;
                }
                const std::uint32_t mean = step == 1 ? grey[from]
                                                     : (std::uint32_t{grey[from]} + grey[from + 1] +
                                                        grey[from + head.width] + grey[from + head.width + 1] + 2) /
                                                           4;
                const auto value = static_cast<std::uint8_t>(std::min(mean * gain_percent / 100, 255U));
                auto* const out = static_cast<std::uint8_t*>(data);
                if (bytes() == 3) {
                    out[3 * to] = out[3 * to + 1] = out[3 * to + 2] = value;
                } else {
                    out[2 * to] = value;
                    out[2 * to + 1] = 128;
                }
            }
        }
    }

    Shared& shared_;
    CameraControl& control_;
    OniSensorType type_;
    OniVideoMode mode_{};
    OniBool is_mirroring_ = TRUE, is_auto_ = TRUE;  // as drivers of this kind begin
    std::atomic<bool> is_running_{false};
};

class TestDevice final : public DeviceBase {
public:
    TestDevice(Shared& shared, std::uint32_t camera)
        : shared_(shared), camera_(camera), control_(shared.control->cameras[camera]) {
        for (const OniSensorType type : {ONI_SENSOR_DEPTH, ONI_SENSOR_COLOR}) {
            if ((control_.modes & (type == ONI_SENSOR_COLOR ? 32U : 64U)) != 0) continue;
            const auto i = static_cast<std::size_t>(sensor_count_++);
            sensors_[i].sensorType = type;
            sensors_[i].numSupportedVideoModes = modes_of(control_, type, modes_[i]);
            sensors_[i].pSupportedVideoModes = modes_[i].data();
        }
        ++control_.opens;
        thread_ = std::thread([this] { serve(); });
    }
    ~TestDevice() override {
        std::this_thread::sleep_for(std::chrono::milliseconds(control_.hang_ms));
        is_ending_ = true;
        thread_.join();
        ++control_.closes;
    }

    OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
        *sensors = sensors_.data();
        *count = sensor_count_;
        return ONI_STATUS_OK;
    }
    StreamBase* createStream(OniSensorType type) override {
        if (type != ONI_SENSOR_DEPTH && type != ONI_SENSOR_COLOR) return nullptr;
        const std::lock_guard lock(mutex_);
        TestStream*& stream = streams_[type == ONI_SENSOR_DEPTH ? 0 : 1];
        return stream = new TestStream(shared_, camera_, type);
    }
    void destroyStream(StreamBase* stream) override {
        {
            const std::lock_guard lock(mutex_);
            for (TestStream*& mine : streams_) {
                if (mine == stream) mine = nullptr;
            }
        }
        delete stream;
    }
    OniStatus getProperty(int id, void* data, int* size) override {
        switch (id) {
            case ONI_DEVICE_PROPERTY_DRIVER_VERSION: return put(data, size, OniVersion{1, 0, 0, 0});
            case ONI_DEVICE_PROPERTY_SERIAL_NUMBER:
                if (control_.has_no_serial != 0) return ONI_STATUS_NOT_SUPPORTED;
                *size =
                    std::snprintf(static_cast<char*>(data), static_cast<std::size_t>(*size), "%s", serial_of(camera_)) +
                    1;
                return ONI_STATUS_OK;
            case ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION:
                return put(data, size,
                           is_registering_ ? ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR : ONI_IMAGE_REGISTRATION_OFF);
            default: return ONI_STATUS_NOT_SUPPORTED;
        }
    }
    OniStatus setProperty(int id, const void* data, int size) override {
        if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION ||
            size != static_cast<int>(sizeof(OniImageRegistrationMode))) {
            return ONI_STATUS_NOT_SUPPORTED;
        }
        OniImageRegistrationMode mode = ONI_IMAGE_REGISTRATION_OFF;
        std::memcpy(&mode, data, sizeof(mode));
        is_registering_ = mode == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR && control_.can_register != 0;
        control_.is_registering = is_registering_;
        return ONI_STATUS_OK;
    }
    OniBool isPropertySupported(int id) override {
        return id == ONI_DEVICE_PROPERTY_DRIVER_VERSION || id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER ||
                       id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION
                   ? TRUE
                   : FALSE;
    }
    OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override {
        return mode == ONI_IMAGE_REGISTRATION_OFF || control_.can_register != 0 ? TRUE : FALSE;
    }

private:
    void serve() {
        using Clock = std::chrono::steady_clock;
        // A camera's clock is steady: images are stamped when they were due. What this thread comes too late for, by
        // a period and more, is lost, as over USB.
        auto next = Clock::now() + std::chrono::milliseconds(20);
        const std::int64_t cpu_before_ns = control_.driver_cpu_ns;
        for (std::uint32_t count = 0; !is_ending_; ++count) {
            const std::chrono::microseconds period(control_.period_us);
            while (next + period < Clock::now()) {
                next += period;
                if (control_.is_stalled == 0 && control_.is_plugged != 0 && control_.is_frozen == 0) {
                    ++control_.next_frame;
                }
            }
            std::this_thread::sleep_until(next);
            const auto due = std::exchange(next, next + period);
            if (control_.is_stalled != 0 || control_.is_plugged == 0) continue;
            const std::uint32_t number = control_.is_frozen != 0 ? control_.next_frame.load() : control_.next_frame++;
            const std::uint32_t index = frame_of(number, shared_.frames->count);
            const std::int64_t due_us =
                std::chrono::duration_cast<std::chrono::microseconds>(due.time_since_epoch()).count();
            const std::int64_t stamp_us = due_us + control_.stamp_offset_us + (count % 2) * control_.jitter_us.load();
            const auto does_drop = [number](std::uint32_t every) { return every > 0 && number % every == every - 1; };
            const bool has_colour = !does_drop(control_.drop_colour_every);
            const std::uint32_t log = control_.log_count;
            if (log < kLogMax) {
                control_.log[log] = {stamp_us, index, has_colour ? 1U : 0U};
                control_.log_count = log + 1;
            }
            const std::lock_guard lock(mutex_);
            if (streams_[1] != nullptr && has_colour) streams_[1]->emit(number, index, stamp_us, is_registering_);
            if (streams_[0] != nullptr && !does_drop(control_.drop_depth_every)) {
                const std::int32_t lag_us = control_.depth_lag_us;
                if (lag_us > 0) std::this_thread::sleep_for(std::chrono::microseconds(lag_us));
                streams_[0]->emit(number, index, stamp_us + lag_us, is_registering_);
            }
            control_.driver_cpu_ns = cpu_before_ns + clock_ns(CLOCK_THREAD_CPUTIME_ID);
        }
    }

    Shared& shared_;
    std::uint32_t camera_;
    CameraControl& control_;
    std::array<OniSensorInfo, 2> sensors_{};
    std::array<std::array<OniVideoMode, kModesMax>, 2> modes_{};
    int sensor_count_ = 0;
    std::mutex mutex_;  // of the streams
    std::array<TestStream*, 2> streams_{};
    std::atomic<bool> is_ending_{false}, is_registering_{false};
    std::thread thread_;
};

class TestDriver final : public DriverBase {
public:
    explicit TestDriver(OniDriverServices* services) : DriverBase(services) {}

    OniStatus initialize(DeviceConnectedCallback connected, DeviceDisconnectedCallback disconnected,
                         DeviceStateChangedCallback changed, void* cookie) override {
        const OniStatus status = DriverBase::initialize(connected, disconnected, changed, cookie);
        if (shared_.control == nullptr) return status;
        look();
        thread_ = std::thread([this] {
            while (!is_ending_) {
                std::this_thread::sleep_for(std::chrono::milliseconds(5));
                look();
            }
        });
        return status;
    }
    void shutdown() override {
        is_ending_ = true;
        if (thread_.joinable()) thread_.join();
    }
    DeviceBase* deviceOpen(const char* uri, const char*) override {
        for (std::uint32_t i = 0; shared_.control != nullptr && i < kCamerasMax; ++i) {
            const CameraControl& camera = shared_.control->cameras[i];
            if (std::strcmp(uri, uri_of(i, camera.address).text) != 0 || camera.is_plugged == 0) continue;
            std::this_thread::sleep_for(std::chrono::milliseconds(camera.open_hang_ms));
            if (camera.does_open_fail != 0) {
                getServices().errorLoggerAppend("test driver: permission denied");
                return nullptr;
            }
            return new TestDevice(shared_, i);
        }
        return nullptr;
    }
    void deviceClose(DeviceBase* device) override { delete device; }

private:
    void look() {
        for (std::uint32_t i = 0; i < kCamerasMax; ++i) {
            const bool is_plugged = shared_.control->cameras[i].is_plugged != 0;
            if (is_plugged == is_plugged_[i]) continue;
            is_plugged_[i] = is_plugged;
            OniDeviceInfo info;
            fill_info(i, shared_.control->cameras[i].address, info);
            if (is_plugged) {
                deviceConnected(&info);
            } else {
                deviceDisconnected(&info);
                deviceDisconnected(&info);  // as the real driver does it
            }
        }
    }

    Shared shared_;
    std::array<bool, kCamerasMax> is_plugged_{};
    std::atomic<bool> is_ending_{false};
    std::thread thread_;
};

}  // namespace
}  // namespace stillmesh::test

using stillmesh::test::TestDriver;
ONI_EXPORT_DRIVER(TestDriver)
