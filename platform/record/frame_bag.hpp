// Frames as a bag of ROS 2: an MCAP file (mcap.dev/spec) with sensor_msgs Image of colour and of registered depth and
// the colour camera's CameraInfo, in CDR; not compressed, with an index at its end. One chunk a frame, written whole or
// not at all: a file whose writer was killed has every frame before, and reads without its index. Depth of 1000 units
// per metre is 16UC1, others become metres (32FC1), as REP 118 has it: 1/5000 m survives that, finer units are rounded
// by its reader. What a CameraInfo does not know (the readout of a rolling shutter) and masks are left out. Memory: one
// frame twice, 24 bytes a frame for the index. Cost: two copies and a checksum: 2 ms per 640x480 frame of
// 16UC1, 3 ms of 32FC1 (the fastest tenth, beside a load of 11).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh {

class FrameBag {
public:
    // All three: false: `message` says why. A file that is there already is refused.
    [[nodiscard]] bool open(const std::string& file, const CameraInfo& camera, std::string& message);
    // Its format is kGrey8, or anything else for pixels in the order of RGB; without padding between its rows.
    [[nodiscard]] bool write(const Frame& frame, std::string& message);
    // Writes the index and closes the file.
    [[nodiscard]] bool close(std::string& message);

private:
    struct Chunk {
        std::uint64_t at = 0, bytes = 0;  // in the file, with its head
        std::int64_t time_ns = 0;
    };

    LineFile file_;
    CameraInfo camera_;
    std::string out_, records_;  // of the chunk
    std::uint64_t size_ = 0;     // of the file
    std::vector<Chunk> chunks_;
};

}  // namespace stillmesh
