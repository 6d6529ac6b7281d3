// What a RealSense D4xx says about each image, in the buffers of a metadata node: when it was taken by the camera's own
// clock, how long it was exposed, whether the projector was on. Layout: Linux, userspace-api/media/v4l/metafmt-d4xx.rst
// (V4L2_META_FMT_D4XX) and metafmt-uvc.rst (V4L2_META_FMT_UVC); bits of the payload header: USB Video
// Class 1.5, 2.4.3.3; that the header's time counts microseconds, and that the middle of the exposure lies the optical
// time before it, are facts from the sources of librealsense (src/metadata-parser.h; no code of it is here). Any bytes
// are safe. There is no checksum: what is damaged and still fits is for ImageClock to doubt.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "engine/base/status.hpp"
#include "hal/v4l2/pixel_formats.hpp"

namespace stillmesh::v4l2 {

inline constexpr std::uint32_t kD4xxMetadata = fourcc("D4XX");  // header and the vendor's blocks
inline constexpr std::uint32_t kUvcMetadata = fourcc("UVCH");   // of a camera the kernel does not know: header alone

struct ImageFacts {
    std::optional<std::uint32_t> device_us;  // the middle of its exposure; wraps after 71 min
    std::optional<std::uint32_t> exposure_us;
    std::optional<bool> is_laser_on;  // while it was exposed
};

// kOk    kCorrupt: bytes that do not fit, or times that no image has; `facts` is untouched
[[nodiscard]] Status parse_metadata(std::span<const std::uint8_t> bytes, ImageFacts& facts) noexcept;

}  // namespace stillmesh::v4l2
