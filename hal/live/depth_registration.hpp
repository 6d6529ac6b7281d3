// Depth as the colour camera would see it, where the device cannot do that itself. Every depth pixel is carried into
// the colour image by the pose between the two cameras and covers as many pixels there as it is large, without gaps on
// slanted surfaces; where several fall together the nearest wins, so that nothing behind a person shines through; what
// the depth camera cannot see behind an edge stays without depth. Any two sizes, fields of view and lenses; the cameras
// are taken to look nearly the same way (pixels stay upright: right up to some degrees about the axis). A lens of the
// colour camera is looked up in a grid (off by less than 0.1 px). Also scales depth to another size (no pose).
// Memory: some 30 bytes per column of depth, 8 per pixel if its lens distorts, taken in the constructor; the target
// belongs to the caller. Cost: 0.9 ms per 640x480 image with AVX2, 1.5 ms without; 2.2 and 2.7 ms
// with a lens.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/frame/image_view.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

// A row of depth in the colour image.
struct RegisteredRow {
    std::vector<float> u, v, size;                       // px, px, how much larger than at depth's own distance
    std::vector<std::int32_t> left, right, top, bottom;  // the pixels that each covers, ends behind them
    std::vector<std::uint16_t> z;                        // of the colour camera; 0: nothing to draw
};

class DepthRegistration {
public:
    // `colour_from_depth` takes points of the depth camera's frame (m) into the colour camera's.
    DepthRegistration(const CameraModel& depth, const CameraModel& colour, const RigidTransform& colour_from_depth,
                      double depth_units_per_m);
    // Cameras that look the same way, the colour camera `baseline_m` to the right, as in all of the PrimeSense kind.
    DepthRegistration(const CameraModel& depth, const CameraModel& colour, double baseline_m, double depth_units_per_m);

    // The cameras stand to each other like that from here on.
    void set_pose(const RigidTransform& colour_from_depth) noexcept;
    // `source` has the depth camera's size, `target` the colour camera's; its rows are written completely.
    void reproject(const DepthView& source, std::uint16_t* target) noexcept;

private:
    // What the colour camera's lens does: from undistorted normalised coordinates to pixels, bilinear in a grid.
    struct Warp {
        float x0 = 0, y0 = 0, per_cell = 0;  // cells per unit of x/z
        std::uint32_t columns = 0, rows = 0;
        std::vector<float> u, v;
    };

    void make_rays();
    void make_warp();
    void place_row(const DepthView& source, std::uint32_t y, RegisteredRow& row) noexcept;
    void bend_row(RegisteredRow& row) const noexcept;
    void draw_row(const RegisteredRow& row, std::uint16_t* target) const noexcept;

    CameraModel depth_, colour_;
    double units_per_m_;
    float rotation_[9];     // row by row
    float translation_[3];  // depth units
    // The rays of depth's pixels, x/z and y/z: of columns and rows, or of every pixel where its lens distorts.
    std::vector<float> ray_x_, ray_y_, ray_y_of_row_;
    bool is_depth_bent_ = false;
    Warp warp_;
    RegisteredRow rows_[2];  // a row and the one below
};

}  // namespace stillmesh
