// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
#define STILLMESH_TUNING_weights(KEY) \
    KEY(weights, std::uint32_t, suspicious, 9, 0.0, 200.0, "1/10", "the same inside a rejected group") \
    KEY(weights, double, proven_s, 0.7, 0.01, 100.0, "s", "a point is fully believed after standing still so long") \
    KEY(weights, double, unproven, 0.03, 0.0, 1.0, "", "weight of a new point beside a proven one's") \
    KEY(weights, std::uint32_t, suspect_steps, 3, 0.0, 200.0, "", "bad frames from the static threshold that take a weight") \
    KEY(weights, double, drift_m, 0.003, 0.0, 10.0, "m", "odometry since a point was first seen, at once") \
    KEY(weights, double, drift_m_s, 0.002, 0.0, 10.0, "m/s", "and with time") \
    KEY(weights, double, drift_max_m, 0.02, 0.0, 10.0, "m", "and at most") \
    KEY(weights, double, drift_share, 0.001, 0.0, 1.0, "", "and, for a point out of sight, by this share of the way (a radian counts as a metre)") \
    KEY(weights, double, variance_min, 0.1, 0.0, 1.0, "", "least variance of a point over one measurement's") \
    KEY(weights, double, near_m, 0.2, 0.0, 10.0, "m", "in depth, too, beside noise") \
    KEY(weights, double, near_sigmas, 3.0, 0.0, 100.0, "", "of depth noise between such neighbours")
struct WeightTuning { STILLMESH_TUNING_weights(STILLMESH_FIELD) };
struct WeightParameters : WeightKeys, WeightTuning {};

// How far real noise leaves the model's, followed from frame to frame.
#define STILLMESH_TUNING_noise(KEY) \
    KEY(noise, double, pixel_start, 0.1, 1e-3, 1000.0, "", "variance of pixels over the model's, to begin with") \
    KEY(noise, double, depth_start, 0.3, 1e-3, 1000.0, "", "variance of depth over the model's, to begin with") \
    KEY(noise, double, pixel_min, 0.06, 1e-3, 1.0, "", "least factor of the pixel variance") \
    KEY(noise, double, depth_min, 0.25, 1e-3, 1.0, "", "least factor of the depth variance") \
    KEY(noise, double, max, 20.0, 1.0, 1000.0, "", "largest factor of either variance") \
    KEY(noise, std::uint32_t, young_frames, 6, 0.0, 1000.0, "frames", "learnt from each group under its own motion for so long") \
    KEY(noise, double, explained_min, 0.6, 0.0, 1.0, "", "share of weighted; motions explain less: more noise is tried") \
    KEY(noise, std::uint32_t, tries, 2, 0.0, 10.0, "", "such tries; in the first frame twice as many") \
    KEY(noise, double, pixel_try_factor, 2.5, 1.0, 100.0, "", "more pixel noise from try to try") \
    KEY(noise, double, depth_try_factor, 2.0, 1.0, 100.0, "", "more depth noise from try to try, and most a factor rises by in one of the first frames") \
    KEY(noise, double, fall_young, 0.1, 0.01, 1.0, "", "most a factor falls by in one of the first frames") \
    KEY(noise, double, fall, 0.9, 0.01, 1.0, "", "most a factor falls by in a frame") \
    KEY(noise, double, rise, 1.25, 1.0, 100.0, "", "most a factor rises by in a frame") \
    KEY(noise, std::uint32_t, residuals_min, 30, 1.0, 4000.0, "", "fewer residuals tell nothing of noise")
struct NoiseParameters { STILLMESH_TUNING_noise(STILLMESH_FIELD) };

// Constant velocity. Hands and wheels accelerate by some m/s^2 and some tens of rad/s^2, and the last velocity is
// itself measured. Without one (still_), the camera may have been moving already when it was switched on.
#define STILLMESH_TUNING_prediction(KEY) \
    KEY(prediction, double, sigma_m, 0.004, 1e-5, 10.0, "m", "deviation of the expected motion") \
    KEY(prediction, double, sigma_m_s, 0.06, 0.0, 100.0, "m/s", "its growth with the time between frames") \
    KEY(prediction, double, sigma_rad, 0.01, 1e-5, 3.0, "rad", "deviation of the expected turn") \
    KEY(prediction, double, sigma_rad_s, 0.5, 0.0, 100.0, "rad/s", "its growth with the time between frames") \
    KEY(prediction, double, still_sigma_m, 0.01, 1e-5, 10.0, "m", "deviation without a known velocity") \
    KEY(prediction, double, still_sigma_m_s, 0.8, 0.0, 100.0, "m/s", "its growth with the time between frames") \
    KEY(prediction, double, still_sigma_rad_s, 1.2, 0.0, 100.0, "rad/s", "its growth with the time between frames") \
    KEY(prediction, double, retry_sigma_factor, 3.0, 1.0, 100.0, "", "less certain when the search had to be widened") \
    KEY(prediction, double, slip_share, 0.2, 0.0, 10.0, "", "of the lag between images that shows as depth error") \
    KEY(prediction, double, gap_max, 3.0, 0.1, 100.0, "", "a velocity is used for so many times its own interval") \
    KEY(prediction, double, fading, 0.8, 0.0, 0.99, "", "what is left of a velocity per lost frame, and of sliding after an unsure one") \
    KEY(prediction, double, jump_sigmas, 2.0, 0.0, 100.0, "", "an unsure pose farther off is doubted by the rest") \
    KEY(prediction, bool, doubts_gaps, true, 0.0, 1.0, "", "so is any pose after frames without one, by what is beyond that for each of them") \
    KEY(prediction, double, goes_on_s, 0.3, 0.0, 100.0, "s", "a motion goes on for so long; an unsure pose later than that follows from nothing")
struct PredictionTuning { STILLMESH_TUNING_prediction(STILLMESH_FIELD) };
struct PredictionParameters : PredictionKeys, PredictionTuning {};

// Hints of the motion (motion_hints.hpp).
#define STILLMESH_TUNING_hint(KEY) \
    KEY(hint, bool, is_used, true, 0.0, 1.0, "", "hints that come with frames count") \
    KEY(hint, double, floor_m, 0.006, 1e-6, 1.0, "m", "what poses themselves are off, beside a hint") \
    KEY(hint, double, floor_rad, 0.002, 1e-6, 1.0, "rad", "what poses themselves are off, beside a hint") \
    KEY(hint, double, clock_s, 0.01, 0.0, 1.0, "s", "how far the clocks of hint and camera may be apart, which shows with the speed") \
    KEY(hint, double, young_s, 1.0, 0.0, 100.0, "s", "from the start; until then hints count from there, and say what is sure") \
    KEY(hint, double, young_sharpness, 2.0, 0.1, 100.0, "", "a deviation from the hint counts so many times until then") \
    KEY(hint, double, turn_sharpness, 4.0, 0.1, 100.0, "", "the same where hints say nothing of the translation: few bodies turn much") \
    KEY(hint, double, contradiction_sigmas, 5.0, 0.0, 1000.0, "", "off the hint, a pose contradicts it") \
    KEY(hint, double, agreement_sigmas, 3.0, 0.0, 1000.0, "", "off the hint, in the beginning a pose is clear however little of the picture agrees") \
    KEY(hint, double, chain_s, 1.0, 0.0, 100.0, "s", "hints since the last sure pose count for so long") \
    KEY(hint, double, surprise, 4.0, 0.0, 1000.0, "", "times the variance claimed; more is believed less") \
    KEY(hint, double, forgetting, 0.9, 0.0, 1.0, "", "what is left of that from frame to frame")
struct HintParameters { STILLMESH_TUNING_hint(STILLMESH_FIELD) };

// Masks that come with frames (frame_mask.hpp).
#define STILLMESH_TUNING_mask(KEY) \
    KEY(mask, bool, is_used, true, 0.0, 1.0, "", "masks that come with frames count") \
    KEY(mask, double, weight, 0.1, 0.0, 1.0, "", "of a point that a mask covers, times its own") \
    KEY(mask, double, share_max, 0.5, 0.0, 1.0, "", "of the area in view, and of what is known to stand still; a mask that covers more is wrong")
struct MaskParameters { STILLMESH_TUNING_mask(STILLMESH_FIELD) };

// Fewer features where bodies move (attention.hpp).
#define STILLMESH_TUNING_attention(KEY) \
    KEY(attention, bool, is_used, true, 0.0, 1.0, "", "fewer features where bodies move") \
    KEY(attention, std::uint32_t, moving_per_still, 4, 0.0, 1000.0, "", "matches of a cell in which bodies move")
struct AttentionParameters { STILLMESH_TUNING_attention(STILLMESH_FIELD) };

// Points whose place is seen to be empty.
#define STILLMESH_TUNING_emptiness(KEY) \
    KEY(emptiness, std::uint32_t, places_per_frame, 400, 0.0, 10000.0, "", "places looked at for emptiness") \
    KEY(emptiness, std::uint32_t, reach_px, 3, 1.0, 10.0, "px", "around a place, all must be empty") \
    KEY(emptiness, double, sigmas, 5.0, 0.0, 100.0, "", "of depth noise beyond a place that is empty") \
    KEY(emptiness, double, margin_m, 0.06, 0.0, 10.0, "m", "beyond it beside noise") \
    KEY(emptiness, std::uint32_t, views, 5, 1.0, 255.0, "", "frames that see a place empty before its point goes") \
    KEY(emptiness, double, ray_px, 20.0, 0.0, 200.0, "px", "around a new feature, points that keyframes saw behind it say that it came; 0: not asked")
struct EmptinessParameters { STILLMESH_TUNING_emptiness(STILLMESH_FIELD) };

#define STILLMESH_TUNING_keyframes(KEY) \
    KEY(keyframes, std::uint32_t, tracked_urgent_permille, 120, 0.0, 1000.0, "", "static points, of features.count; below: the gap is ignored") \
    KEY(keyframes, std::uint32_t, new_per_tracked, 2, 1.0, 10000.0, "", "new points that count as one tracked")
struct KeyframeTuning { STILLMESH_TUNING_keyframes(STILLMESH_FIELD) };
struct KeyframeParameters : KeyframeKeys, KeyframeTuning {};

// clang-format on

}  // namespace stillmesh
