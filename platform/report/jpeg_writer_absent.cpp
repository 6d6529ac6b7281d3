// A build without TurboJPEG: pictures are PNG.
#include "platform/report/jpeg_writer.hpp"

namespace stillmesh {

bool encode_grey_jpeg(std::span<const std::uint8_t> grey, std::uint32_t width, std::uint32_t height,
                      std::vector<std::uint8_t>& bytes) {
    static_cast<void>(grey);
    static_cast<void>(width);
    static_cast<void>(height);
    bytes.clear();
    return false;
}

}  // namespace stillmesh
