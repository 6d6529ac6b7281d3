// Depth as the colour camera would see it, where the device cannot do that itself. Every depth pixel is carried into
// the colour image and covers as many pixels there as it is large, without gaps on slanted surfaces; where several fall
// together the nearest wins, so that nothing behind a person shines through; what the depth camera cannot see behind an
// edge stays without depth. The two cameras look the same way (the same rotation), as in all of the PrimeSense kind;
// the colour camera stands `baseline_m` to the right of the depth camera. Lens distortion is left out: theirs is below
// a pixel in the registered image. Also scales depth to another size (baseline 0). Memory: two tables of one row, taken
// in the constructor; the target belongs to the caller. Cost: some 1.5 ms per 640x480 image.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/frame/image_view.hpp"
#include "engine/geometry/camera_model.hpp"

namespace stillmesh {

class DepthRegistration {
public:
    DepthRegistration(const CameraModel& depth, const CameraModel& colour, double baseline_m, double depth_units_per_m);

    // `source` has the depth camera's size, `target` the colour camera's; its rows are written completely.
    void reproject(const DepthView& source, std::uint16_t* target) const noexcept;

private:
    CameraModel depth_, colour_;
    float shift_px_units_;           // fx * baseline in px * depth units: divided by depth, the shift in px
    std::vector<float> left_, top_;  // where the left and upper edges of columns and rows fall at infinity
};

}  // namespace stillmesh
