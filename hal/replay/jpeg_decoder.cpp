#include "hal/replay/jpeg_decoder.hpp"

#include <turbojpeg.h>

#include <memory>
#include <string_view>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

struct Destroy {
    void operator()(void* decoder) const noexcept { static_cast<void>(tjDestroy(decoder)); }
};

constexpr int kJpegSideMax = 16384;

Status broken(const std::string& name, tjhandle decoder, std::string& message) {
    message = name + ": cannot be read as JPEG (" + tjGetErrorStr2(decoder) +
              "); copy the recording again or remove this image from its list.";
    return Status::kCorrupt;
}

}  // namespace

Status decode_jpeg(std::span<const std::uint8_t> bytes, const std::string& name, ImageHeader& header,
                   std::span<std::uint8_t> pixels, std::string& message) {
    thread_local const std::unique_ptr<void, Destroy> owned(tjInitDecompress());
    tjhandle decoder = owned.get();
    if (decoder == nullptr) {
        message = name + ": no memory left to decode it.";
        return Status::kUnavailable;
    }
    int width = 0, height = 0, subsampling = 0, space = 0;
    const auto size = static_cast<unsigned long>(bytes.size());
    const int read = tjDecompressHeader3(decoder, bytes.data(), size, &width, &height, &subsampling, &space);
    if (read != 0 || width < 1 || height < 1) {
        return broken(name, decoder, message);
    }
    if (space == TJCS_CMYK || space == TJCS_YCCK || width > kJpegSideMax || height > kJpegSideMax) {
        message = name + ": a JPEG of " + std::to_string(width) + "x" + std::to_string(height) +
                  " pixels or with four colours is not read; convert it to RGB.";
        return Status::kInvalid;
    }
    const bool is_grey = space == TJCS_GRAY;
    header = {static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height),
              is_grey ? ImageKind::kGrey8 : ImageKind::kRgb8};
    if (pixels.empty()) return Status::kOk;
    STILLMESH_CHECK(pixels.size() == std::size_t{header.width} * header.height * bytes_per_pixel(header.kind));
    // Limited scans: a progressive JPEG of some kilobytes could keep the decoder busy for minutes.
    const int done = tjDecompress2(decoder, bytes.data(), size, pixels.data(), width, 0, height,
                                   is_grey ? TJPF_GRAY : TJPF_RGB, TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS);
    // Cameras leave bytes between parts that mean nothing; every other warning is a part of the image that is not
    // there.
    const bool is_harmless =
        done != 0 && tjGetErrorCode(decoder) == TJERR_WARNING &&
        std::string_view(tjGetErrorStr2(decoder)).find("extraneous bytes") != std::string_view::npos;
    return done == 0 || is_harmless ? Status::kOk : broken(name, decoder, message);
}

}  // namespace stillmesh
