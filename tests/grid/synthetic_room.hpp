// Depth images of a room made of a floor and upright boxes, by rays; no engine and no renderer.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/geometry/rigid_transform.hpp"
#include "engine/outputs.hpp"

namespace stillmesh::test {

struct RoomBox {
    double x0, x1, y0, y1, z0, z1;
};

// x right, y down, z forward of a camera at `at`, that looks along `yaw_rad` (0: along x of the room, to the left of it
// positive), `down_rad` below the horizon, turned about its axis by `roll_rad`.
inline RigidTransform camera_at(const std::array<double, 3>& at, double yaw_rad, double down_rad, double roll_rad = 0) {
    const double c = std::cos(yaw_rad), s = std::sin(yaw_rad), cd = std::cos(down_rad), sd = std::sin(down_rad);
    const std::array<double, 3> ahead = {cd * c, cd * s, -sd}, right = {s, -c, 0}, down = {-sd * c, -sd * s, -cd};
    const double cr = std::cos(roll_rad), sr = std::sin(roll_rad);
    RotationMatrix r{};
    for (std::size_t i = 0; i < 3; ++i) {
        r[3 * i] = cr * right[i] + sr * down[i];
        r[3 * i + 1] = cr * down[i] - sr * right[i];
        r[3 * i + 2] = ahead[i];
    }
    RigidTransform out;
    write_quaternion(r, out.rotation_xyzw);
    std::copy(at.begin(), at.end(), out.translation_m);
    return out;
}

// What a camera of 57 by 44 degrees sees. `noise`: standard deviation, m at 1 m, growing with the square.
class SeenRoom {
public:
    static constexpr std::uint32_t kColumns = 80, kRows = 60;
    SeenRoom() {
        for (std::uint32_t row = 0; row < kRows; ++row) {
            for (std::uint32_t column = 0; column < kColumns; ++column) {
                rays_.push_back((static_cast<float>(column) - 39.5F) / 73.0F);
                rays_.push_back((static_cast<float>(row) - 29.5F) / 73.0F);
            }
        }
    }
    std::vector<RoomBox> boxes;
    bool has_floor = true;
    double noise = 0;

    [[nodiscard]] std::vector<std::uint16_t> look(const RigidTransform& room_from_camera) {
        std::vector<std::uint16_t> depth_mm;
        for (std::size_t i = 0; i < rays_.size(); i += 2) {
            const std::array<double, 3> ray =
                rotated(room_from_camera, {static_cast<double>(rays_[i]), static_cast<double>(rays_[i + 1]), 1});
            double z = distance(room_from_camera.translation_m, ray);
            z += noise * z * z * (random_.uniform() + random_.uniform() + random_.uniform() - 1.5) * 2;
            depth_mm.push_back(z > 0.1 && z < 8 ? static_cast<std::uint16_t>(std::lround(1000 * z)) : std::uint16_t{0});
        }
        return depth_mm;
    }
    [[nodiscard]] DepthImage image(const std::vector<std::uint16_t>& depth_mm, std::uint64_t frame = 0) const {
        return {kColumns, kRows, depth_mm, rays_, frame, {}};
    }

private:
    [[nodiscard]] double distance(const double (&eye)[3], const std::array<double, 3>& ray) const {
        double nearest = 1e9;
        if (has_floor && ray[2] < 0) nearest = -eye[2] / ray[2];
        for (const RoomBox& box : boxes) {
            const double low[3] = {box.x0, box.y0, box.z0}, high[3] = {box.x1, box.y1, box.z1};
            double in = 0, out = 1e9;
            for (std::size_t k = 0; k < 3; ++k) {
                const double a = (low[k] - eye[k]) / ray[k], b = (high[k] - eye[k]) / ray[k];
                in = std::max(in, std::min(a, b));
                out = std::min(out, std::max(a, b));
            }
            if (in < out && in > 0) nearest = std::min(nearest, in);
        }
        return nearest;
    }
    std::vector<float> rays_;
    Random random_{7};
};

}  // namespace stillmesh::test
