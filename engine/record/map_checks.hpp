// What numbers of a map on disk can be: shared by map files and by regions of a store. Inner.
#pragma once

#include <cstdint>

#include "engine/map/map.hpp"

namespace stillmesh::map_checks {

inline constexpr std::int64_t kTimeMax_ns = (std::int64_t{1} << 62U) - 1;
inline constexpr std::uint64_t kFramesMax = std::uint64_t{1}
                                            << 38U;  // 290 years at 30 Hz; keys of ages have one bit more
inline constexpr double kFar_m = 1e6;
inline constexpr double kFast_s = 1e3;  // m/s, rad/s
inline constexpr double kReadoutMax_s = 1.0;
inline constexpr float kRayMax = 1e4F;  // on the plane z = 1

// Where times, frames and levels of a map end.
struct MapBounds {
    std::int64_t time_ns = kTimeMax_ns;  // the last
    std::uint64_t frames = kFramesMax;   // marks of use: at most (what a store gave back has the next frame's)
    std::uint32_t pyramid_levels = 0;    // below
};

// NaN is in no range.
template <typename T>
constexpr bool is_in(T value, T low, T high) noexcept {
    return value >= low && value <= high;
}

inline bool is_pose(const SE3& pose) noexcept {
    for (int i = 0; i < 3; ++i) {
        if (!is_in(pose.translation(i), -kFar_m, kFar_m)) return false;
    }
    return is_rotation(pose.rotation);
}

inline bool is_slow(const Vector6& v) noexcept {
    for (int i = 0; i < 6; ++i) {
        if (!is_in(v(i), -kFast_s, kFast_s)) return false;
    }
    return true;
}

inline bool is_point(const MapPoint& p, const MapBounds& bounds) noexcept {
    for (const double w : p.world) {
        if (!is_in(w, -kFar_m, kFar_m)) return false;
    }
    for (const double a : p.anchor) {
        if (!is_in(a, -kFar_m, kFar_m)) return false;
    }
    for (int i = 0; i < 3; ++i) {
        constexpr auto kMax = static_cast<float>(kFast_s);
        if (!is_in(p.world_by_readout[i], -kMax, kMax) || !is_in(p.anchor_by_readout[i], -kMax, kMax)) return false;
    }
    for (const double v : {p.var_z, p.var_lateral, p.anchor_var_z, p.anchor_var_lateral}) {
        if (!is_in(v, 0.0, kFar_m)) return false;
    }
    return is_in(p.created_ns, std::int64_t{0}, bounds.time_ns) &&
           is_in(p.anchor_ns, std::int64_t{0}, bounds.time_ns) && p.last_seen_frame <= bounds.frames &&
           is_in(p.distance_m, 0.0F, static_cast<float>(kFar_m)) && is_in(p.angle_rad, -3.15F, 3.15F) &&
           p.level < bounds.pyramid_levels;
}

inline bool is_feature(const Observation& o, const MapBounds& bounds, std::uint32_t width,
                       std::uint32_t height) noexcept {
    return is_in(o.x, 0.0F, static_cast<float>(width)) && is_in(o.y, 0.0F, static_cast<float>(height)) &&
           is_in(o.normalised_x, -kRayMax, kRayMax) && is_in(o.normalised_y, -kRayMax, kRayMax) &&
           is_in(o.z_m, -1e4F, 1e4F) && is_in(o.var_z, -1.0F, static_cast<float>(kFar_m)) &&
           is_in(o.angle_rad, -3.15F, 3.15F) && o.level < bounds.pyramid_levels && o.averaged != 0;
}

}  // namespace stillmesh::map_checks
