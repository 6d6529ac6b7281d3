// sensor_msgs/CompressedImage as frames need it: colour as PNG or JPEG (a build without TurboJPEG says so), depth as
// PNG of 16 bits (mm) or as compressedDepth (packed_depth.hpp; metres are kept in quarters of a millimetre). Limits:
// sides of 4096 px. Cost of 640x480: JPEG .6 ms, PNG 2 to 4. Any bytes are safe. Errors: a sentence without a name.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/frame/frame.hpp"
#include "hal/replay/image_header.hpp"

namespace stillmesh {

// Units of depth a metre: of whole numbers, and of what comes in metres.
inline constexpr double kMillimetres = 1000;
inline constexpr double kQuarters = 4000;  // of a millimetre

struct RosPackedView {
    std::string_view format;  // "rgb8; jpeg compressed bgr8", "16UC1; compressedDepth png"
    std::span<const std::uint8_t> bytes;
};

// Whether a topic of that name carries such messages, as image_transport names them.
[[nodiscard]] bool is_packed_topic(std::string_view name);

// False: `problem` says why; `pixels` has lost its content.
[[nodiscard]] bool packed_colour_of(const RosPackedView& image, std::vector<std::uint8_t>& pixels, ImageHeader& header,
                                    std::string& problem);
[[nodiscard]] bool packed_depth_of(const RosPackedView& image, std::vector<std::uint16_t>& pixels, ImageHeader& header,
                                   double& units_per_m, std::string& problem);

}  // namespace stillmesh
