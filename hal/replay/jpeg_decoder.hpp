// JPEG in memory, through libjpeg-turbo's TurboJPEG interface: one place knows the library. Built without it, it says
// so.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/status.hpp"
#include "hal/replay/image_header.hpp"

namespace stillmesh {

// Fills `header` and, unless `pixels` is empty, the whole image into it: 8-bit grey or RGB, width x height without
// padding; `pixels` is exactly as large (CHECK). kCorrupt: broken or cut off.    kInvalid: no JPEG in this build, or
// CMYK. `message` is a sentence. Any bytes are safe. The same bits on every processor: the exact transform is asked
// for.
[[nodiscard]] Status decode_jpeg(std::span<const std::uint8_t> bytes, const std::string& name, ImageHeader& header,
                                 std::span<std::uint8_t> pixels, std::string& message);

}  // namespace stillmesh
