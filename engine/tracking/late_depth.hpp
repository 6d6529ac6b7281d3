// Depth that was not taken with its picture (engine/pose/depth_turn.hpp), in the hands of tracking: where the motion
// and the stamps say that the camera looked then, and where what is known of the map says so. Nothing is asked where
// stamps say that both images are of one time, or nothing, and while the camera turns by less than half a pixel within
// region.colour_depth_lag_s. Cost: twice a frame that of measuring, three times a look into the depth image for each
// feature.
#pragma once

#include <cstdint>
#include <span>

#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/pose/depth_turn.hpp"
#include "engine/tracking/measured_frame.hpp"

namespace stillmesh {

// How much later than its picture a frame's depth was taken; 0: not known. A camera that does not know says the same
// time twice; one whose times are farther apart than images of one frame can be has two clocks. The frame was
// validated: its own time is not negative.
[[nodiscard]] double depth_lag_s(const Frame& frame) noexcept;

class LateDepth {
public:
    // A new frame, whose depth was looked up in its features' own pixels.
    void begin_frame() noexcept { *this = LateDepth{}; }
    // The frame's camera moves so, per second, in its own frame. True: depth was looked up anew, where stamps say.
    [[nodiscard]] bool expect(MeasuredFrame& frame, const Vector6& speed, const Parameters& parameters) noexcept;
    [[nodiscard]] bool is_asked() const noexcept { return is_asked_; }
    // By matches that are taken for still, near `world_from_camera`. True: depth was looked up anew.
    [[nodiscard]] bool measure(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                               const SE3& world_from_camera, double chi2_max, MeasuredFrame& frame) noexcept;
    // From the frame's picture to its depth, rad, in the camera.
    [[nodiscard]] const Vector3& turn() const noexcept { return turn_; }

private:
    Vector3 turn_ = Vector3::Zero();
    Vector3 expected_ = Vector3::Zero();
    double sigma_rad_ = 0;
    double trust_ = 0;
    bool is_asked_ = false;
};

}  // namespace stillmesh
