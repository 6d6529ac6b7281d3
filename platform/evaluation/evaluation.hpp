// How far a trajectory is from the truth, as the tools of the TUM RGB-D benchmark define it (Sturm et al. 2012):
// ATE after a rigid alignment without scale, RPE over one second, and coverage. Cost: n log n.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "platform/evaluation/trajectory.hpp"

namespace stillmesh {

struct EvaluationOptions {
    std::int64_t gap_max_ns = 20'000'000;   // between a pose and its true pose
    std::int64_t delta_ns = 1'000'000'000;  // RPE: motion over this time
    std::int64_t hole_ns = 100'000'000;     // coverage: a longer silence between two poses is not covered
};

// One matched pose.
struct PosePair {
    std::size_t truth_index = 0;
    std::size_t estimate_index = 0;
    double error_m = 0;                 // after alignment
    std::array<double, 3> aligned_t{};  // the estimate's position in the truth's world
};

struct Evaluation {
    std::vector<PosePair> pairs;  // in time order; at least 3
    double ate_rmse_m = 0, ate_mean_m = 0, ate_median_m = 0, ate_max_m = 0;
    std::size_t rpe_pairs = 0;
    double rpe_translation_rmse_m = 0;  // over delta_ns; NaN without pairs
    double rpe_rotation_rmse_deg = 0;
    // Share of the truth's time in which the trajectory has poses without a hole.
    double coverage = 0;
    double scale = 1;  // the path times this would fit the truth best; the errors above are without it
    std::array<double, 9> truth_from_estimate_r{};  // row-major
    std::array<double, 3> truth_from_estimate_t{};
};

// Empty with fewer than three pairs. Both must be sorted by time.
//
// Pairs: all with |t_truth - t_estimate| < gap_max, greedily by smallest difference, each pose once (associate.py).
// ATE: Horn/Umeyama without scale; RMSE of the translation over all pairs.
// RPE: for each pair i the pair j nearest in time to t_i + delta (within a tenth of delta); the translation and angle
// of (Q_i^-1 Q_j)^-1 (P_i^-1 P_j), RMSE over all i.
[[nodiscard]] std::optional<Evaluation> evaluate(const Trajectory& truth, const Trajectory& estimate,
                                                 const EvaluationOptions& options = {});

}  // namespace stillmesh
