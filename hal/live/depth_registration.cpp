#include "hal/live/depth_registration.hpp"

#include <algorithm>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

// The pixel whose centre is the first at or behind an edge, within [0, size]. Positions are far below 2^31 after the
// clamp, so the conversion is exact.
[[nodiscard]] std::int32_t first_centre(float edge, float size) noexcept {
    const float clamped = edge < 0.0F ? 0.0F : (edge > size ? size : edge);
    const auto whole = static_cast<std::int32_t>(clamped);
    return whole + (static_cast<float>(whole) < clamped ? 1 : 0);
}

}  // namespace

DepthRegistration::DepthRegistration(const CameraModel& depth, const CameraModel& colour, double baseline_m,
                                     double depth_units_per_m)
    : depth_(depth),
      colour_(colour),
      shift_px_units_(static_cast<float>(colour.fx * baseline_m * depth_units_per_m)),
      left_(depth.width + std::size_t{1}),
      top_(depth.height + std::size_t{1}) {
    for (std::uint32_t x = 0; x <= depth.width; ++x) {
        left_[x] = static_cast<float>((x - 0.5 - depth.cx) / depth.fx * colour.fx + colour.cx);
    }
    for (std::uint32_t y = 0; y <= depth.height; ++y) {
        top_[y] = static_cast<float>((y - 0.5 - depth.cy) / depth.fy * colour.fy + colour.cy);
    }
}

void DepthRegistration::reproject(const DepthView& source, std::uint16_t* target) const noexcept {
    STILLMESH_CHECK(source.width == depth_.width && source.height == depth_.height);
    std::fill_n(target, std::size_t{colour_.width} * colour_.height, std::uint16_t{0});
    const auto width = static_cast<float>(colour_.width);
    const auto height = static_cast<float>(colour_.height);
    for (std::uint32_t y = 0; y < source.height; ++y) {
        const std::int32_t y_begin = first_centre(top_[y], height);
        const std::int32_t y_end = first_centre(top_[y + 1], height);
        const std::uint16_t* const row = source.row(y);
        float shift = row[0] > 0 ? shift_px_units_ / static_cast<float>(row[0]) : 0.0F;
        for (std::uint32_t x = 0; x < source.width; ++x) {
            const std::uint16_t z = row[x];
            const std::uint16_t z_next = x + 1 < source.width ? row[x + 1] : std::uint16_t{0};
            const float shift_here = shift;
            shift = z_next > 0 ? shift_px_units_ / static_cast<float>(z_next) : 0.0F;
            if (z == 0) continue;
            const std::int32_t x_begin = first_centre(left_[x] - shift_here, width);
            // A slanted surface has no gaps between its pixels: each reaches to where the next one begins.
            const bool is_one_surface = z_next > 0 && (z_next > z ? z_next - z : z - z_next) < z / 32 + 1;
            const std::int32_t x_end =
                first_centre(left_[x + 1] - (is_one_surface && shift < shift_here ? shift : shift_here), width);
            for (std::int32_t v = y_begin; v < y_end; ++v) {
                std::uint16_t* const out = target + static_cast<std::size_t>(v) * colour_.width;
                for (std::int32_t u = x_begin; u < x_end; ++u) {
                    if (out[u] == 0 || z < out[u]) out[u] = z;
                }
            }
        }
    }
}

}  // namespace stillmesh
