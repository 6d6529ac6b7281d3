// What hints of the camera's motion (engine/motion_hint.hpp) say of a frame, and how far they are believed. Hints are
// chained from an anchor, the last pose that was sure; in the first second it is the start, since until then points
// have no past and a sure pose may follow a body. Later each sure frame says how far off they were: where that is more
// than they claim, they are believed less by as much, at once, and again little by little. Cost: some products of
// poses.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"
#include "engine/motion_hint.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/region_context.hpp"

namespace stillmesh {

// Numbers that can be used: finite, a unit quaternion, deviations below 1000.
[[nodiscard]] bool is_valid(const MotionHint& hint) noexcept;

class MotionHints {
public:
    void reset() noexcept { *this = MotionHints{}; }
    // The camera is here; what hints say from now on counts from here.
    void begin(const SE3& world_from_camera, std::int64_t time_ns) noexcept;
    // The world under the camera moved by `correction` (on the left of world coordinates).
    void follow(const SE3& correction) noexcept;

    // Of a frame at `time_ns`; nullptr: it has none, and the chain is broken. The hint is_valid().
    void take(const MotionHint* hint, std::int64_t time_ns, const HintParameters& parameters) noexcept;
    // Weighs into what the camera's own motion lets expect. `is_young`: no point has a past; what the motion of the
    // last frames says is as doubtful as their poses are, and hints alone decide where they say anything.
    void weigh_in(RegionContext& expected, bool is_young, const Parameters& parameters) const noexcept;
    // How far a pose is off what hints say, in their deviations; 0 where they say nothing.
    [[nodiscard]] double sigmas_off(const SE3& world_from_camera, const HintParameters& parameters) const noexcept;
    // A pose that is sure and does not depend on hints.
    void learn(const SE3& world_from_camera, const HintParameters& parameters) noexcept;

    [[nodiscard]] bool is_any() const noexcept { return has_translation_ || has_rotation_; }
    // Factors on the variances that hints claim.
    [[nodiscard]] double scale_translation() const noexcept { return scale_m_; }
    [[nodiscard]] double scale_rotation() const noexcept { return scale_rad_; }

private:
    struct Hinted {
        SE3 world_from_camera;
        double sigma_m = 0, sigma_rad = 0;
    };
    [[nodiscard]] Hinted hinted(const SE3& otherwise, const HintParameters& parameters) const noexcept;

    SE3 world_from_anchor_;
    SE3 anchor_from_camera_;
    double sigma_m_ = 0, sigma_rad_ = 0;  // of the chain, as claimed
    double scale_m_ = 1, scale_rad_ = 1;
    double clock_m_ = 0, clock_rad_ = 0;  // that clocks apart would show at the speed of the last step
    std::int64_t anchor_time_ns_ = 0;
    std::int64_t time_ns_ = 0;      // of the frame at hand
    std::uint32_t frames_ = 0;      // of the chain
    bool has_translation_ = false;  // all along the chain
    bool has_rotation_ = false;
};

}  // namespace stillmesh
