// The pose given out in two transforms: odom_from_camera goes on without a jump, and map_from_odom takes what loops and
// relocalisations add; and how far odometry can be off by now, beside what it was before. Cost: nothing.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"
#include "engine/outputs.hpp"
#include "engine/parameters.hpp"
#include "engine/tracking/motion_model.hpp"

namespace stillmesh {

class Odometry {
public:
    void reset() noexcept { *this = Odometry{}; }

    // The map under the camera jumped by `correction` (on the left of world coordinates).
    void jump(const SE3& correction) noexcept;
    // The camera did not move from where odometry lost it, as far as odometry knows: the map takes the jump from
    // `world_from_camera` to `found`.
    void jump_to(const SE3& found, const SE3& world_from_camera) noexcept;
    void split(const SE3& world_from_camera, PoseEstimate& pose) const noexcept;

    // Of the frame that `motion` has just moved to, judged as `state`: a share of the way, more when unsure, and as far
    // as a camera gets until `time_ns` while nothing is measured.
    void gather_drift(PoseState state, const MotionModel& motion, std::int64_t time_ns,
                      const Parameters& parameters) noexcept;
    [[nodiscard]] double drift_m() const noexcept { return drift_m_; }
    // Found again in the map: no farther off than the keyframe there, however long the camera was lost.
    void set_drift(double drift_m) noexcept { drift_m_ = drift_m; }
    // How far the camera has come while it was measured; a radian of turning counts as a metre.
    [[nodiscard]] double travelled() const noexcept { return travelled_; }

private:
    SE3 map_from_odom_;
    bool has_jumped_ = false;
    double drift_m_ = 0;
    double travelled_ = 0;
};

}  // namespace stillmesh
