// What a test and the test driver share: a block of memory in a file, mapped by both, whichever process they live in;
// and a file of frames rendered beforehand. The environment names them: STILLMESH_TEST_CAMERA is the block's file.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>

namespace stillmesh::test {

inline constexpr std::uint32_t kControlMagic = 0x434d4f4eU;
inline constexpr std::uint32_t kCamerasMax = 2;
inline constexpr std::uint32_t kDepthMax = 32767;  // what OpenNI2's compression of depth can hold
inline constexpr std::uint32_t kLogMax = 16384;

struct EmittedFrame {
    std::int64_t stamp_us;
    std::uint32_t index;  // in the file of frames
    std::uint32_t has_colour;
};

// One camera: what it shall do, and what it did.
struct CameraControl {
    std::atomic<std::uint32_t> is_plugged;
    std::atomic<std::uint32_t> is_stalled;         // streams are silent
    std::atomic<std::uint32_t> drop_colour_every;  // n: each n-th image does not come; 0: all do
    std::atomic<std::uint32_t> drop_depth_every;
    std::atomic<std::uint32_t> does_open_fail;
    std::atomic<std::uint32_t> address;        // on its bus, part of its URI; to be changed while it is unplugged
    std::atomic<std::uint32_t> has_no_serial;  // it does not say which one it is
    // Bit 0: 640x480, bit 1: 320x240, bit 2: YUYV instead of RGB, bit 3: colour of 1280x1024, bit 4: depth in 0.1 mm,
    // bit 5: no colour sensor, bit 6: no depth sensor.
    std::atomic<std::uint32_t> modes;
    std::atomic<std::uint32_t> colour_fps, depth_fps;  // that the modes say; 0: 30
    std::atomic<std::uint32_t> can_register;
    std::atomic<std::uint32_t> can_unmirror;
    std::atomic<std::uint32_t> has_no_fov, has_no_cropping;  // properties that it does not know
    std::atomic<std::uint32_t> emits_wrong_size;             // images of 160x120 whatever the mode
    std::atomic<std::uint32_t> is_frozen;                    // the same image again and again
    std::atomic<std::uint32_t> open_hang_ms;                 // opening takes so long
    std::atomic<std::uint32_t> hang_ms;                      // closing takes so long
    std::atomic<std::int32_t> depth_lag_us;                  // depth after colour
    std::atomic<std::uint32_t> period_us;       // of the camera's own clock, which is steady whoever is late
    std::atomic<std::int64_t> stamp_offset_us;  // of stamps to the host's monotonic clock
    std::atomic<std::uint32_t> jitter_us;       // colour stamps, in turn
    std::atomic<std::uint32_t> exposure_swing;  // percent: the exposure hunts, darker and brighter by so much

    std::atomic<std::uint32_t> next_frame;  // goes on while it is plugged and not stalled
    std::atomic<std::uint32_t> opens, closes;
    std::atomic<std::uint32_t> is_registering;
    std::atomic<std::uint32_t> is_mirroring;
    std::atomic<std::uint32_t> auto_exposure;
    std::atomic<std::uint32_t> images_colour, images_depth;
    std::atomic<std::int64_t> driver_cpu_ns;
    std::atomic<std::uint32_t> log_count;
    EmittedFrame log[kLogMax];
};

struct Control {
    std::uint32_t magic;
    char frames_file[512];
    CameraControl cameras[kCamerasMax];
};
static_assert(std::atomic<std::uint32_t>::is_always_lock_free && std::atomic<std::int64_t>::is_always_lock_free);

// Head of a file of frames; behind it, frame by frame: grey (1 byte), depth registered to colour, depth as the depth
// camera sees it (2 bytes each, mm; the latter only if has_raw_depth).
struct FramesHead {
    std::uint32_t magic;
    std::uint32_t width, height, count;
    double fx;
    std::uint32_t has_raw_depth;
    std::uint32_t seed;
    struct Pose {
        double t[3], q[4];
    };

    [[nodiscard]] std::size_t frame_bytes() const {
        return sizeof(Pose) + std::size_t{width} * height * (has_raw_depth != 0 ? 5 : 3);
    }
};
inline constexpr std::uint32_t kFramesMagic = 0x534d5246U;

// Frames are played forwards, then backwards, and so on: the camera's motion never jumps.
[[nodiscard]] inline std::uint32_t frame_of(std::uint32_t number, std::uint32_t count) {
    const std::uint32_t turn = count > 1 ? 2 * (count - 1) : 1;
    const std::uint32_t at = number % turn;
    return at < count ? at : turn - at;
}

// With an address as OpenNI2's drivers write it: ids, bus, address. Both cameras are of one kind.
struct Uri {
    char text[64];
};
[[nodiscard]] inline Uri uri_of(std::uint32_t camera, std::uint32_t address = 0) {
    Uri uri{};
    static_cast<void>(address == 0 ? std::snprintf(uri.text, sizeof(uri.text), "stillmesh://%u", camera)
                                   : std::snprintf(uri.text, sizeof(uri.text), "1d27/0601@%u/%u", camera + 1, address));
    return uri;
}
[[nodiscard]] inline const char* serial_of(std::uint32_t camera) {
    return camera == 0 ? "TEST0001" : "TEST0002";
}

}  // namespace stillmesh::test
