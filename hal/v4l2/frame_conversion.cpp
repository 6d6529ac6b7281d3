#include "hal/v4l2/frame_conversion.hpp"

#include <algorithm>

#include "hal/v4l2/pixel_formats.hpp"

namespace stillmesh::v4l2 {

bool CameraPair::is_same_view() const noexcept {
    const double* const t = colour_from_depth.translation_m;
    const double* const q = colour_from_depth.rotation_xyzw;
    return depth == colour && t[0] == 0 && t[1] == 0 && t[2] == 0 && q[0] == 0 && q[1] == 0 && q[2] == 0;
}

FrameConversion::FrameConversion(const CameraPair& cameras, const V4l2Format& colour)
    : cameras_(cameras), format_(colour) {
    const std::size_t pixels = std::size_t{colour.width} * colour.height;
    colour_.resize(pixels * channels_of(engine_format(colour.fourcc)));
    depth_.resize(pixels);
    if (!cameras.is_same_view()) {
        registration_.emplace(cameras.depth, cameras.colour, cameras.colour_from_depth, cameras.depth_units_per_m);
    }
}

Status FrameConversion::convert(std::span<const std::uint8_t> colour, std::span<const std::uint8_t> depth,
                                std::uint32_t depth_bytes_per_line, Frame& frame, std::string& message) {
    STILLMESH_TRY(convert_colour(format_, colour, colour_, message));
    const CameraModel& model = cameras_.colour;
    // Buffers are aligned to pages, and lines of depth to two bytes (image_stream.cpp).
    const DepthView source{reinterpret_cast<const std::uint16_t*>(depth.data()), cameras_.depth.width,
                           cameras_.depth.height, depth_bytes_per_line / 2};
    if (registration_) {
        registration_->reproject(source, depth_.data());
    } else {
        for (std::uint32_t y = 0; y < model.height; ++y) {
            std::copy_n(source.row(y), model.width, depth_.data() + std::size_t{y} * model.width);
        }
    }
    frame.format = engine_format(format_.fourcc);
    frame.colour = {colour_.data(), model.width, model.height, std::size_t{model.width} * channels_of(frame.format)};
    frame.depth = {depth_.data(), model.width, model.height, model.width};
    frame.depth_units_per_m = cameras_.depth_units_per_m;
    return Status::kOk;
}

}  // namespace stillmesh::v4l2
