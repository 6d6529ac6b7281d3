// A build without libjpeg-turbo.
#include "hal/replay/jpeg_decoder.hpp"

namespace stillmesh {

Status decode_jpeg(std::span<const std::uint8_t> /*bytes*/, const std::string& name, ImageHeader& /*header*/,
                   std::span<std::uint8_t> /*pixels*/, std::string& message) {
    const std::size_t slash = name.rfind('/');
    message = name +
              ": is JPEG, which this build does not read; configure it with -DSTILLMESH_WITH_JPEG=ON (Debian: "
              "libturbojpeg0-dev), or convert: mogrify -format png '" +
              (slash == std::string::npos ? "." : name.substr(0, slash)) + "'/* and name the .png files in the list.";
    return Status::kInvalid;
}

}  // namespace stillmesh
