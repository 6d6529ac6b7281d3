// Instead of a camera: a patterned wall 2 m away that passes by.
#pragma once

#include <vector>

#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"

class Wall {
public:
    static constexpr stillmesh::CameraModel kCamera{
        .width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};

    // Frame number i, the wall having passed by so many pixels; its pixels are there until the next one.
    stillmesh::Frame frame(std::uint32_t i, std::uint32_t passed_px) {
        for (std::uint32_t at = 0; at < grey_.size(); ++at) {
            const std::uint32_t column = (at % 640 + passed_px) / 8, row = at / 640 / 8;
            const std::uint32_t cell = column * 2654435761U ^ row * 2246822519U;
            grey_[at] = static_cast<std::uint8_t>((cell ^ cell >> 15U) * 97U);
        }
        stillmesh::Frame out;
        out.time_ns = std::int64_t{i} * 33'333'333;
        out.colour = {grey_.data(), 640, 480, 640};
        out.depth = {depth_.data(), 640, 480, 640};
        out.depth_units_per_m = 1000;
        return out;
    }

private:
    std::vector<std::uint8_t> grey_ = std::vector<std::uint8_t>(640 * 480);
    std::vector<std::uint16_t> depth_ = std::vector<std::uint16_t>(640 * 480, 2000);
};
