// Both streams of a device, in a mode that the engine can use: 640x480 at 30 images/s, else 320x240 (the other way
// round where it had that before), the same for both, else any two of these that exist; upright where the device can,
// depth registered to colour by the device where it can (read back), exposure as asked for. A file's streams are as
// they were recorded. What was found is told, not assumed.
#pragma once

#include <OpenNI.h>

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/status.hpp"
#include "hal/openni2/openni2_camera.hpp"

namespace stillmesh::openni2 {

[[nodiscard]] std::uint32_t bytes_per_pixel(openni::PixelFormat format) noexcept;
// "640x480@30"
[[nodiscard]] std::string mode_text(const openni::VideoMode& mode);

struct Streams {
    openni::VideoStream colour, depth;
    openni::VideoMode colour_mode, depth_mode;
    bool is_registered = false;
    bool is_colour_mirrored = false, is_depth_mirrored = false;
    double fov_x = 0, depth_fov_x = 0;        // radians; as the device says, which may be nonsense
    int colour_images = 0, depth_images = 0;  // of a file
    std::int64_t period_us = 33'333;          // for pairing: images are no further apart
    int width_first = 640;                    // px: the size of live images that is asked for first
    std::vector<std::string> notes;           // for the user

    // kOk: both run. kUnavailable: they do not start; kInvalid: no mode of theirs can be used. `message` says why, with
    // `description`, the device's.
    [[nodiscard]] Status start(openni::Device& device, bool is_file, const std::string& description,
                               const OpenNi2Options& options, std::string& message);

private:
    [[nodiscard]] Status start_modes(openni::Device& device, bool is_file, const openni::VideoMode& colour_wanted,
                                     const openni::VideoMode& depth_wanted, const OpenNi2Options& options,
                                     std::string& message);
    [[nodiscard]] Status start_file(openni::Device& device, const std::string& description,
                                    const OpenNi2Options& options, std::string& message);
    void register_depth(openni::Device& device, bool is_file, Registration wanted);
};

}  // namespace stillmesh::openni2
