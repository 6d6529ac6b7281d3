// Frames that tests keep: rendered once by hal/simulated, or drawn by hand, together with the truth.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"
#include "hal/simulated/simulated_camera.hpp"

namespace stillmesh::test {

inline constexpr std::int64_t kFrameGap_ns = 33'333'333;

struct KeptFrame {
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
    std::int64_t time_ns = 0;
    PixelFormat format = PixelFormat::kGrey8;
    double depth_units_per_m = 5000;
    std::uint32_t width = 0, height = 0;
    SimulatedPose truth;
    std::vector<std::uint8_t> moving;  // of a rendered scene: 255 where a body moves

    [[nodiscard]] Frame frame() const {
        Frame out;
        out.time_ns = out.depth_time_ns = time_ns;
        out.format = format;
        out.colour = {colour.data(), width, height, std::size_t{width} * channels_of(format)};
        out.depth = {depth.data(), width, height, width};
        out.depth_units_per_m = depth_units_per_m;
        return out;
    }
};

struct Sequence {
    CameraModel camera;
    std::vector<KeptFrame> frames;
};

// Renders a scene. Throws when there is none of this name.
inline Sequence rendered(const std::string& scene, std::uint32_t frames, std::uint32_t width, std::uint32_t height,
                         std::uint64_t seed = 1, std::uint64_t day = 0) {
    SimulationOptions options;
    options.scene = scene;
    options.seed = seed;
    options.day = day;
    options.frames = frames;
    options.width = width;
    options.height = height;
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) throw std::runtime_error(camera.message());
    Sequence out;
    out.camera = camera.info().model;
    Frame frame;
    while (camera.poll(frame) == Status::kOk) {
        KeptFrame kept;
        kept.width = width;
        kept.height = height;
        kept.time_ns = frame.time_ns;
        kept.format = frame.format;
        kept.depth_units_per_m = frame.depth_units_per_m;
        kept.truth = camera.true_pose();
        const ImageView<std::uint8_t> moving = camera.dynamic_mask();
        for (std::uint32_t y = 0; y < height; ++y)
            kept.moving.insert(kept.moving.end(), moving.row(y), moving.row(y) + width);
        for (std::uint32_t y = 0; y < height; ++y) {
            kept.colour.insert(kept.colour.end(), frame.colour.row(y),
                               frame.colour.row(y) + std::size_t{width} * channels_of(frame.format));
            kept.depth.insert(kept.depth.end(), frame.depth.row(y), frame.depth.row(y) + width);
        }
        out.frames.push_back(std::move(kept));
    }
    return out;
}

// A camera that slides along x before a patterned wall, and a patterned board that slides across the view.
struct DrawnScene {
    std::uint32_t width = 320, height = 240;
    double focal_px = 250;
    double wall_m = 2.5, board_m = 1.25;
    std::int32_t wall_px_per_frame = 1;  // to the left in the image: the camera goes right
    std::int32_t board_px_per_frame = 3;
    bool has_board = true;
    std::int32_t board_left = 60, board_width = 100;

    [[nodiscard]] CameraModel camera() const {
        CameraModel out;
        out.width = width;
        out.height = height;
        out.fx = out.fy = focal_px;
        out.cx = 0.5 * width - 0.5;
        out.cy = 0.5 * height - 0.5;
        return out;
    }
    // Where the camera is in frame i, m along x from frame 0.
    [[nodiscard]] double travelled_m(std::uint32_t i) const {
        return static_cast<double>(i) * wall_px_per_frame * wall_m / focal_px;
    }
    [[nodiscard]] KeptFrame draw(std::uint32_t i) const {
        KeptFrame out;
        out.width = width;
        out.height = height;
        out.time_ns = std::int64_t{i} * kFrameGap_ns;
        out.colour.resize(std::size_t{width} * height);
        out.depth.resize(out.colour.size());
        const auto n = static_cast<std::int32_t>(i);
        const std::int32_t left = board_left + n * board_px_per_frame;
        for (std::int32_t v = 0; v < static_cast<std::int32_t>(height); ++v) {
            for (std::int32_t u = 0; u < static_cast<std::int32_t>(width); ++u) {
                const bool is_board = has_board && u >= left && u < left + board_width && v >= 40;
                const std::int32_t s = is_board ? u - left + 50'000 : u + n * wall_px_per_frame + 10'000;
                std::uint32_t cell =
                    static_cast<std::uint32_t>(s / 9) * 2654435761U ^ static_cast<std::uint32_t>(v / 9) * 2246822519U;
                cell ^= cell >> 15U;
                const std::size_t at = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
                out.colour[at] = static_cast<std::uint8_t>(cell * 97U);
                out.depth[at] = static_cast<std::uint16_t>((is_board ? board_m : wall_m) * out.depth_units_per_m);
            }
        }
        return out;
    }
};

}  // namespace stillmesh::test
