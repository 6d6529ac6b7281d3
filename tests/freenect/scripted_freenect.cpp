#include "tests/freenect/scripted_freenect.hpp"

#include <libfreenect.h>

#include <algorithm>
#include <chrono>
#include <thread>

namespace {

using stillmesh::test::scripted_kinect;

constexpr int kPixels = 640 * 480;
freenect_depth_cb depth_callback = nullptr;
freenect_video_cb video_callback = nullptr;
void* depth_buffer = nullptr;
void* video_buffer = nullptr;
void* user = nullptr;
char context_memory = 0;
char device_memory = 0;
freenect_context* const kContext = reinterpret_cast<freenect_context*>(&context_memory);
freenect_device* const kDevice = reinterpret_cast<freenect_device*>(&device_memory);

void while_hanging() {
    if (!scripted_kinect.hangs) return;
    ++scripted_kinect.hanging;
    while (scripted_kinect.hangs) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    --scripted_kinect.hanging;
}

freenect_frame_mode mode_of(freenect_resolution resolution, int format, int bytes) {
    freenect_frame_mode mode{};
    mode.resolution = resolution;
    mode.dummy = format;
    mode.bytes = bytes;
    mode.width = 640;
    mode.height = 480;
    mode.framerate = 30;
    mode.is_valid = 1;
    return mode;
}

}  // namespace

namespace stillmesh::test {
ScriptedKinect scripted_kinect;
}  // namespace stillmesh::test

extern "C" {
int freenect_init(freenect_context** context, freenect_usb_context*) {
    *context = kContext;
    ++scripted_kinect.contexts;
    return 0;
}
int freenect_shutdown(freenect_context*) {
    --scripted_kinect.contexts;
    return 0;
}
void freenect_set_log_level(freenect_context*, freenect_loglevel) {}
void freenect_select_subdevices(freenect_context*, freenect_device_flags parts) {
    scripted_kinect.subdevices = static_cast<std::uint32_t>(parts);
}
int freenect_num_devices(freenect_context*) {
    return scripted_kinect.devices;
}
int freenect_open_device(freenect_context*, freenect_device** device, int) {
    while_hanging();
    if (scripted_kinect.refuses_open) return -1;
    *device = kDevice;
    ++scripted_kinect.open_devices;
    return 0;
}
int freenect_close_device(freenect_device*) {
    --scripted_kinect.open_devices;
    return 0;
}
void freenect_set_user(freenect_device*, void* pointer) {
    user = pointer;
}
void* freenect_get_user(freenect_device*) {
    return user;
}
void freenect_set_depth_callback(freenect_device*, freenect_depth_cb callback) {
    depth_callback = callback;
}
void freenect_set_video_callback(freenect_device*, freenect_video_cb callback) {
    video_callback = callback;
}
int freenect_set_depth_buffer(freenect_device*, void* buffer) {
    depth_buffer = buffer;
    return 0;
}
int freenect_set_video_buffer(freenect_device*, void* buffer) {
    video_buffer = buffer;
    return 0;
}
int freenect_get_video_mode_count() {
    return 2;
}
freenect_frame_mode freenect_get_video_mode(int i) {
    return i == 0 ? mode_of(FREENECT_RESOLUTION_HIGH, FREENECT_VIDEO_RGB, 4 * kPixels * 3)
                  : mode_of(FREENECT_RESOLUTION_MEDIUM, FREENECT_VIDEO_RGB, kPixels * 3);
}
int freenect_get_depth_mode_count() {
    return 2;
}
freenect_frame_mode freenect_get_depth_mode(int i) {
    return mode_of(FREENECT_RESOLUTION_MEDIUM,
                   i == 1 && scripted_kinect.is_registered ? FREENECT_DEPTH_REGISTERED : FREENECT_DEPTH_11BIT,
                   kPixels * 2);
}
int freenect_set_video_mode(freenect_device*, freenect_frame_mode) {
    return 0;
}
int freenect_set_depth_mode(freenect_device*, const freenect_frame_mode) {
    return 0;
}
int freenect_start_depth(freenect_device*) {
    return 0;
}
int freenect_start_video(freenect_device*) {
    return 0;
}
int freenect_stop_depth(freenect_device*) {
    return 0;
}
int freenect_stop_video(freenect_device*) {
    return 0;
}
// One pair per call, every pixel of both the pair's number; depth 5 ms after colour.
int freenect_process_events_timeout(freenect_context*, timeval* wait) {
    while_hanging();
    if (scripted_kinect.is_silent) {
        ++scripted_kinect.silences;
        std::this_thread::sleep_for(std::chrono::microseconds(std::min<long>(wait->tv_usec, 5000)));
        return 0;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(33));
    const std::uint32_t number = ++scripted_kinect.pairs;
    const std::uint32_t stamp = scripted_kinect.stamp.fetch_add(2'000'000);
    std::fill_n(static_cast<std::uint8_t*>(video_buffer), kPixels * 3, static_cast<std::uint8_t>(number));
    video_callback(kDevice, video_buffer, stamp);
    std::fill_n(static_cast<std::uint16_t*>(depth_buffer), kPixels, static_cast<std::uint16_t>(1000 + number % 256));
    depth_callback(kDevice, depth_buffer, stamp + 300'000);
    return 0;
}
}
