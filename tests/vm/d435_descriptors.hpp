// How an Intel RealSense D435 describes itself on the bus, as far as the kernel's uvcvideo looks: two functions of USB
// Video Class 1.5 (a stereo module with depth and infrared, its extension unit with Intel's controls; a colour module),
// streams on bulk endpoints. Numbers as a D435 has them: interfaces 0 to 2 and 3 to 4, extension unit 3, protocol 0.
// Sources: USB Device Class Definition for Video Devices 1.5; librealsense (GUID of the extension unit, its controls).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "tests/vm/usbip.hpp"

namespace vm {

struct FrameSize {
    std::uint32_t width = 0, height = 0;  // px
};

// One per video streaming interface; every format is one frame of two sizes, at 30 or 15 frames a second.
struct VideoStream {
    const char* name;
    std::uint8_t interface, endpoint, terminal;
    std::array<std::uint8_t, 16> format;  // GUID
    std::uint8_t bits_per_pixel;
    std::array<FrameSize, 2> sizes;
};

// Class requests (4.1).
inline constexpr std::uint8_t kSetCurrent = 0x01, kGetCurrent = 0x81, kGetMinimum = 0x82, kGetMaximum = 0x83,
                              kGetResolution = 0x84, kGetLength = 0x85, kGetInfo = 0x86, kGetDefault = 0x87;

inline constexpr std::uint8_t kStereoControl = 0, kColourControl = 3;   // video control interfaces
inline constexpr std::uint8_t kMonitorUnit = 3;                         // the extension unit, of the first
inline constexpr std::uint32_t kFastest = 333'333, kSlowest = 666'666;  // frame intervals, 100 ns

[[nodiscard]] std::span<const VideoStream> video_streams();

inline constexpr char kSerial[] = "735413060999";  // of the board, which USB says
inline constexpr char kLabel[] = "733512070321";   // of the camera

[[nodiscard]] StandardAnswers d435_descriptors(UsbSpeed speed);

}  // namespace vm
