// What stands before a picture on the bus: the payload header of USB Video Class 1.5 (2.4.3.3), and behind it, as a
// D4xx sends them, blocks that say how the picture was taken. Layout of the blocks: Linux,
// userspace-api/media/v4l/metafmt-d4xx.rst; their names: librealsense. The stereo module has capture timing, depth
// control and configuration; the colour camera has the first and the last (its own control block is left out, nobody
// here reads it). uvcvideo hands the whole header to whoever asks the metadata node for D4XX, its first 12 bytes else,
// and nothing of a header that has no clock. The header's time is that of the middle of the exposure and the optical
// time behind it, on the camera's clock.
#pragma once

#include <cstdint>

#include "tests/vm/d435_descriptors.hpp"

namespace vm {

enum class HeaderKind : std::uint8_t {
    kBare,   // parity, end of picture, time: 6 bytes
    kClock,  // and the clocks of camera and bus: 12 bytes
    kBlocks  // and the blocks
};

struct PictureFacts {
    bool is_stereo = true;
    bool is_second = false;  // of two: the parity by which the host knows pictures apart
    std::uint32_t number = 0;
    std::uint32_t middle_us = 0;  // of the exposure, by the camera's clock
    std::uint32_t exposure_us = 0;
    std::uint32_t now_us = 0;  // the camera's clock when the header is sent
    FrameSize size;
    std::uint32_t interval_us = 0;
    bool is_emitter_on = false;
    std::uint32_t laser_power = 0;
};

[[nodiscard]] std::uint32_t header_bytes(HeaderKind kind, bool is_stereo);
[[nodiscard]] Bytes payload_header(HeaderKind kind, const PictureFacts& facts);

}  // namespace vm
