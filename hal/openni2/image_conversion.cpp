#include "hal/openni2/image_conversion.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh::openni2 {

ImageConversion::ImageConversion(const Streams& streams, const CameraInfo& camera, double baseline_m)
    : model_(camera.model),
      format_(streams.colour_mode.getPixelFormat()),
      is_colour_mirrored_(streams.is_colour_mirrored) {
    const auto depth_width = static_cast<std::uint32_t>(streams.depth_mode.getResolutionX());
    const auto depth_height = static_cast<std::uint32_t>(streams.depth_mode.getResolutionY());
    const std::size_t pixels = std::size_t{model_.width} * model_.height;
    if (!streams.is_registered || depth_width != model_.width || depth_height != model_.height) {
        CameraModel depth = model_;
        const double scale = static_cast<double>(depth_width) / model_.width;
        depth.width = depth_width;
        depth.height = depth_height;
        const bool has_fov =
            std::isfinite(streams.depth_fov_x) && streams.depth_fov_x > 0.3 && streams.depth_fov_x < 2.5;
        if (streams.is_registered || !has_fov) {
            depth.fx *= scale;
            depth.fy *= scale;
            depth.cx = (depth.cx + 0.5) * scale - 0.5;
            depth.cy = (depth.cy + 0.5) * scale - 0.5;
        } else {
            depth.fx = depth.fy = depth_width / (2.0 * std::tan(0.5 * streams.depth_fov_x));
            depth.cx = (depth_width - 1) / 2.0;
            depth.cy = (depth_height - 1) / 2.0;
        }
        registration_.emplace(depth, model_, streams.is_registered ? 0.0 : baseline_m, camera.depth_units_per_m);
        depth_.resize(pixels);
    }
    if (streams.is_depth_mirrored) {
        depth_upright_.resize(std::size_t{depth_width} * depth_height);
    }
    const bool is_yuv = bytes_per_pixel(format_) == 2;
    if (streams.is_colour_mirrored || is_yuv) {
        colour_.resize(pixels * (is_yuv ? 1U : bytes_per_pixel(format_)));
    }
}

void ImageConversion::convert(Frame& frame) noexcept {
    const std::uint32_t bytes = bytes_per_pixel(format_);
    frame.format = format_ == openni::PIXEL_FORMAT_RGB888 ? PixelFormat::kRgb8 : PixelFormat::kGrey8;
    if (!colour_.empty()) {
        const std::uint32_t channels = channels_of(frame.format);
        const std::uint32_t offset = format_ == openni::PIXEL_FORMAT_YUV422 ? 1 : 0;  // u y1 v y2, or y1 u y2 v
        for (std::uint32_t y = 0; y < model_.height; ++y) {
            const std::uint8_t* const row = frame.colour.row(y) + offset;
            std::uint8_t* const out = colour_.data() + std::size_t{y} * model_.width * channels;
            for (std::uint32_t x = 0; x < model_.width; ++x) {
                const std::uint32_t from = is_colour_mirrored_ ? model_.width - 1 - x : x;
                for (std::uint32_t c = 0; c < channels; ++c) out[x * channels + c] = row[from * bytes + c];
            }
        }
        frame.colour = {colour_.data(), model_.width, model_.height, std::size_t{model_.width} * channels};
    }
    if (!depth_upright_.empty()) {
        for (std::uint32_t y = 0; y < frame.depth.height; ++y) {
            std::reverse_copy(frame.depth.row(y), frame.depth.row(y) + frame.depth.width,
                              depth_upright_.data() + std::size_t{y} * frame.depth.width);
        }
        frame.depth = {depth_upright_.data(), frame.depth.width, frame.depth.height, frame.depth.width};
    }
    if (registration_) {
        registration_->reproject(frame.depth, depth_.data());
        frame.depth = {depth_.data(), model_.width, model_.height, model_.width};
    }
}

}  // namespace stillmesh::openni2
