// The floor, by what keyframes saw: the lowest large surface that lies level under the camera. No accelerometer is
// asked: up is where most normals point of the surfaces that a camera held roughly upright looks down on (floor, tables
// and seats agree in that), the floor is the lowest of these surfaces with nothing below, and a plane is fitted to it.
// What cannot be told is not: where too little of a floor was seen (a share of 3 % of what was looked at, or less than
// .3 m across), or much lies below it, there is none. A lone table that fills every picture would be taken for one.
// Limits: a camera held upright within 50 degrees, floor .1 to 3 m below it. Memory: 9 KiB, no heap. Cost: five passes
// over the depth images, of every second cell in both directions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/geometry/rigid_transform.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

struct Floor {
    bool is_known = false;
    // z up, floor at 0; the origin is on the floor under that of the map, x where the first camera looked.
    RigidTransform level_from_map;
    double share = 0;  // of what was looked at, that is floor
    double rms_m = 0;  // of that from the plane
};

class FloorFinder {
public:
    // Forgets everything and begins the first pass.
    void begin() noexcept { *this = FloorFinder{}; }
    // One keyframe of this pass: the same ones in each.
    void add(const DepthImage& depth, const RigidTransform& map_from_camera) noexcept;
    // Ends a pass; true: it was the last, and floor() says what was found.
    bool end_pass() noexcept;
    [[nodiscard]] const Floor& floor() const noexcept { return floor_; }

private:
    using Vector = std::array<double, 3>;
    enum class Pass : std::uint8_t { kDirections, kHeights, kFirstFit, kSecondFit, kThirdFit, kDone };
    static constexpr int kSide = 40;      // bins of x and of z of a normal
    static constexpr int kHeights = 250;  // bins of 4 cm
    struct Direction {
        float x = 0, y = 0, z = 0;
        std::uint32_t count = 0;
    };
    // Sums for a plane of heights over the two level directions.
    struct Moments {
        double w = 0, x = 0, y = 0, z = 0, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0, zz = 0;
    };

    [[nodiscard]] bool is_asked(const Vector& at, double camera_height) noexcept;
    void take(const Vector& at, const Vector& normal, double weight) noexcept;
    void take_direction(const Vector& normal) noexcept;
    void take_fit(const Vector& at, double w) noexcept;
    [[nodiscard]] bool find_up() noexcept;
    [[nodiscard]] bool find_height() noexcept;
    [[nodiscard]] bool fit() noexcept;
    void judge() noexcept;
    void set_up(const Vector& up) noexcept;

    Pass pass_ = Pass::kDirections;
    std::array<Direction, static_cast<std::size_t>(kSide* kSide)> directions_{};
    std::array<std::uint32_t, kHeights> flat_{};
    Vector up_{0, -1, 0}, right_{1, 0, 0}, ahead_{0, 0, 1};  // in the map
    double height_m_ = 0;                                    // of the floor along up_
    std::uint64_t total_ = 0, inliers_ = 0, below_ = 0;      // of this pass
    Moments moments_;
    Floor floor_;
};

}  // namespace stillmesh
