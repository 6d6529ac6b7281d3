// What is known before a frame is looked at.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"

namespace stillmesh {

// A motion that something beside the camera hints at has its part in what is expected.
struct HintWeight {
    bool is_any = false;
    bool is_whole = false;  // of translation and rotation
    bool is_young = false;  // no point has a past: what contradicts it is asked beside the choice
    // A deviation from what is expected counts so many times in the choice.
    double sharpness_m = 1, sharpness_rad = 1;
};

struct RegionContext {
    SE3 world_from_camera_predicted;
    double prediction_sigma_m = 0.05;
    double prediction_sigma_rad = 0.05;
    double rotation_speed_rad_s = 0;
    double colour_depth_lag_s = 0;
    double inlier_ratio = 0.5;  // of the last frame
    double travelled = 0;       // the odometer's
    std::uint32_t image_width_px = 640;
    bool has_prediction = false;
    bool has_past = true;  // points have had time to prove that they stand still
    HintWeight hint;
    // Where the motion that contradicted the chosen one in the frames before leads (engine/tracking/rival_motion.hpp).
    SE3 world_from_camera_rival;
    std::uint32_t rival_frames = 0;  // that it has gone on for; 0: there was none
};

}  // namespace stillmesh
