// What a scene's name and seed stand for: how the camera moves, who else does, where the furniture is.
#pragma once

#include <cstdint>
#include <span>

#include "hal/simulated/dirt.hpp"
#include "hal/simulated/vector3.hpp"

namespace stillmesh::simulated {

enum class CameraMotion : std::uint8_t { kStatic, kXyz, kRpy, kHalfsphere, kLoop, kCorridor };
enum class Cast : std::uint8_t {
    kNobody,
    kSitting,
    kWalking,
    kCrowd,  // two people at arm's length
    kTrolley,
    kTrolleyFirst,
    kTrolleyReturns,
    kRearranged,
    kLift
};

[[nodiscard]] constexpr bool has_trolley(Cast cast) noexcept {
    return cast == Cast::kTrolley || cast == Cast::kTrolleyFirst || cast == Cast::kTrolleyReturns;
}

struct Scene {
    const char* name;
    CameraMotion motion;
    Cast cast;
    std::uint32_t frames;  // default length
    Dirt dirt = all_dirt(0);
};

[[nodiscard]] std::span<const Scene> scenes() noexcept;

// Where the hand carries the camera: a smooth function of time, for any time.
class CameraPath {
public:
    CameraPath(CameraMotion motion, double side, std::uint64_t seed);

    // world_from_camera `time_s` after the start.
    [[nodiscard]] Rigid at(double time_s) const noexcept;
    // The same without the fast part: where the camera is on its way, looking level.
    [[nodiscard]] Rigid base_at(double time_s) const noexcept;

private:
    [[nodiscard]] double wave(int i, double frequency_hz, double time_s) const noexcept;

    CameraMotion motion_;
    double side_;  // -1 mirrors the office
    double phase_[16] = {};
    double pace_[16] = {};  // factors on the frequencies
};

// The desk in the middle: what the camera looks at.
struct DeskPlace {
    double x = 0, y = 0, half_x = 0, half_y = 0;  // m
};
[[nodiscard]] DeskPlace desk_place(const Scene& scene, double side) noexcept;

// The corridor runs along x, in sections that look alike; |y| <= 1.2. The camera goes from its begin, never back.
inline constexpr double kCorridorHalfY = 1.2, kCorridorSection = 4.0, kCorridorPace_m_s = 0.5, kCorridorWay_m = 24.0;

// The lift's doors: when they begin to close, are shut, open again, and stand open. In between it goes to another
// floor.
inline constexpr double kLiftCloses_s = 3.0, kLiftShut_s = 5.2, kLiftOpens_s = 8.5, kLiftOpen_s = 10.7;

// The room: |x| <= 3, |y| <= 2.5, 0 <= z <= 2.6.
inline constexpr double kRoomHalfX = 3.0, kRoomHalfY = 2.5, kRoomHeight = 2.6;

}  // namespace stillmesh::simulated
