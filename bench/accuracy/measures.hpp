// From what the engine said, frame by frame, and the truth, to the figures a run is judged by. Pure functions of the
// frames: tests/accuracy holds them against paths whose answer is known. ATE and RPE are platform/evaluation's.
//
// Wrong and right. A frame's motion over the last second is its pose seen from the pose given out nearest to one second
// earlier (within a tenth of a second, tracked or unsure: what a reader of the trajectory file can see). It is wrong
// when it differs from the true motion by more than 5 cm or 3 degrees. A predicted pose is judged as well, by itself.
// Frames without such an earlier pose (the first second, the second after a loss) are not judged.
//
// NEES. The covariance is of xi in odom_from_camera * exp(xi), so xi = log(estimate^-1 * truth) once the truth is
// expressed in odom, and NEES = xi^T covariance^-1 xi has mean 6 when the covariance is honest. What remains is where
// odom lies in the world of the truth:
//   first  odom is the camera of the first pose, as the engine defines it: nothing is fitted, drift counts in full.
//          This is what the interface promises, and what the gate holds to account.
//   fit    the rotation and translation that fit all poses best: what is left is the spread round the path.
//   ate    Umeyama on positions alone, as for ATE. Where the camera hardly moves (static, rpy) positions do not fix the
//          rotation, and this figure grows for no fault of the engine.
// The first pose, true by definition, is left out; so are covariances that cannot be inverted, which are counted.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/engine.hpp"
#include "platform/evaluation/trajectory.hpp"

namespace stillmesh::accuracy {

inline constexpr double kWrongTranslation_m = 0.05;
inline constexpr double kWrongRotation_deg = 3.0;
inline constexpr std::int64_t kMotionTime_ns = 1'000'000'000;

// What is known of one frame.
struct FrameRecord {
    std::int64_t time_ns = 0;
    PoseState state = PoseState::kNone;  // none also for a refused frame
    TrajectoryPose estimate;             // odom_from_camera
    std::array<double, 36> covariance{};
    bool has_truth = false;
    TrajectoryPose truth;  // at the frame's own time
    bool has_mask = false;
    // Of the frame's matches, by the mask: on moving pixels and not; of those the ones accepted as static.
    std::uint32_t moving = 0, moving_accepted = 0, still = 0, still_accepted = 0;
    float engine_ms = 0;
};

// Sums, so that runs can be added up; shares are made when they are printed.
struct Measures {
    std::uint64_t frames = 0;
    std::uint64_t tracked = 0, unsure = 0, predicted = 0, none = 0;
    std::uint64_t hole_longest = 0;  // frames without a pose (predicted or none) in a row
    bool ends_with_pose = false;
    double ate_m = -1;  // RMSE of the poses given out; -1: fewer than three
    double ate_max_m = -1;
    double rpe_m = -1;  // RMSE over one second; -1: no pair
    double rpe_deg = -1;

    std::uint64_t judged_tracked = 0, wrong_tracked = 0;
    std::uint64_t judged_unsure = 0, wrong_unsure = 0;
    std::uint64_t judged_predicted = 0, wrong_predicted = 0;
    std::uint64_t right = 0, right_tracked = 0;
    std::uint64_t wrong_first = 0;  // index of the first wrong tracked frame, when there is one

    std::uint64_t nees_frames = 0, covariance_bad = 0;
    double nees_first_sum = 0, nees_fit_sum = 0, nees_ate_sum = 0;
    // Of the fit: how large the errors are and how large they were said to be; sums of squares.
    double fit_m2_sum = 0, fit_rad2_sum = 0, said_m2_sum = 0, said_rad2_sum = 0;
    // The translation's and the rotation's own NEES (ideal 3 each).
    double nees_first_translation_sum = 0, nees_first_rotation_sum = 0;
    double nees_fit_translation_sum = 0, nees_fit_rotation_sum = 0;

    std::uint64_t masked_frames = 0, wrong_choices = 0;  // more than half of the weights lie on moving pixels
    std::uint64_t moving = 0, moving_accepted = 0, still = 0, still_accepted = 0;

    std::uint64_t keyframes = 0;
    double median_ms = 0, p99_ms = 0;

    [[nodiscard]] double coverage() const { return share(tracked + unsure, frames); }
    [[nodiscard]] bool is_lost() const { return !ends_with_pose || hole_longest > 30 || ate_m < 0; }
    // 0 of 0 is `empty`.
    [[nodiscard]] static double share(std::uint64_t part, std::uint64_t whole, double empty = 0) {
        return whole == 0 ? empty : static_cast<double>(part) / static_cast<double>(whole);
    }
};

[[nodiscard]] Measures measure(std::span<const FrameRecord> frames);

// The true pose at this moment, between the two poses round it (at most gap_max_ns apart). False: none.
[[nodiscard]] bool truth_at(const Trajectory& truth, std::int64_t time_ns, std::int64_t gap_max_ns,
                            TrajectoryPose& pose);

}  // namespace stillmesh::accuracy
