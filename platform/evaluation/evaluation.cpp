#include "platform/evaluation/evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <queue>
#include <tuple>

#include "engine/base/check.hpp"
// After CHECK: Eigen's assertions are ours.
#include <Eigen/Dense>

namespace stillmesh {
namespace {

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;

// Isometry3d's products call nothing that allocates; two members are all we need.
struct Rigid {
    Matrix r;
    Vector t;
    [[nodiscard]] Rigid inverse() const { return {r.transpose(), -(r.transpose() * t)}; }
    [[nodiscard]] Rigid operator*(const Rigid& other) const { return {r * other.r, r * other.t + t}; }
};

[[nodiscard]] Vector position(const TrajectoryPose& pose) {
    return {pose.t[0], pose.t[1], pose.t[2]};
}

[[nodiscard]] Rigid rigid(const TrajectoryPose& pose) {
    return {Eigen::Quaterniond(pose.q[3], pose.q[0], pose.q[1], pose.q[2]).toRotationMatrix(), position(pose)};
}

// Poses of one trajectory with one time, in the list of all times of both.
struct Run {
    std::int64_t time_ns = 0;
    bool is_truth = false;
    std::size_t next_pose = 0, end_pose = 0;  // those not paired yet
    std::size_t before = 0, after = 0;        // runs that are not used up; kNoRun: none
};
constexpr std::size_t kNoRun = ~std::size_t{0};

[[nodiscard]] std::vector<Run> runs_of(const Trajectory& truth, const Trajectory& estimate) {
    std::vector<Run> runs;
    const auto take_run = [&runs](const Trajectory& from, std::size_t& at, bool is_truth) {
        const std::size_t begin = at;
        while (at < from.size() && from[at].time_ns == from[begin].time_ns) ++at;
        runs.push_back({from[begin].time_ns, is_truth, begin, at, kNoRun, kNoRun});
    };
    for (std::size_t t = 0, e = 0; t < truth.size() || e < estimate.size();) {
        const bool is_truth = e == estimate.size() || (t < truth.size() && truth[t].time_ns <= estimate[e].time_ns);
        if (is_truth) {
            take_run(truth, t, true);
        } else {
            take_run(estimate, e, false);
        }
    }
    for (std::size_t i = 0; i < runs.size(); ++i) {
        if (i > 0) runs[i].before = i - 1;
        if (i + 1 < runs.size()) runs[i].after = i + 1;
    }
    return runs;
}

// The nearest in time first, as the TUM tools do; of equal gaps the first pose of the truth, then of the estimate. Two
// poses that are nearest to each other have no unpaired one between them, so that only neighbours in time are looked
// at: as much memory as poses, however many share one time.
[[nodiscard]] std::vector<PosePair> associate_poses(const Trajectory& truth, const Trajectory& estimate,
                                                    std::int64_t gap_max_ns) {
    std::vector<Run> runs = runs_of(truth, estimate);
    struct Candidate {
        std::int64_t gap_ns;
        std::size_t truth, estimate;  // poses
        std::size_t truth_run, estimate_run;
        [[nodiscard]] bool operator<(const Candidate& other) const {  // the last goes first
            return std::tie(other.gap_ns, other.truth, other.estimate) < std::tie(gap_ns, truth, estimate);
        }
    };
    std::priority_queue<Candidate> candidates;
    const auto propose = [&](std::size_t a, std::size_t b) {
        if (a == kNoRun || b == kNoRun || runs[a].is_truth == runs[b].is_truth) return;
        if (runs[a].next_pose == runs[a].end_pose || runs[b].next_pose == runs[b].end_pose) return;
        const std::size_t t = runs[a].is_truth ? a : b, e = runs[a].is_truth ? b : a;
        const std::int64_t gap_ns = runs[t].time_ns - runs[e].time_ns;
        if (gap_ns < -gap_max_ns || gap_ns >= gap_max_ns) return;
        candidates.push({std::abs(gap_ns), runs[t].next_pose, runs[e].next_pose, t, e});
    };
    for (std::size_t i = 0; i + 1 < runs.size(); ++i) propose(i, i + 1);
    const auto leave = [&runs](std::size_t i) {
        if (runs[i].before != kNoRun) runs[runs[i].before].after = runs[i].after;
        if (runs[i].after != kNoRun) runs[runs[i].after].before = runs[i].before;
    };
    std::vector<PosePair> pairs;
    while (!candidates.empty()) {
        const Candidate best = candidates.top();
        candidates.pop();
        Run& t = runs[best.truth_run];
        Run& e = runs[best.estimate_run];
        if (t.next_pose != best.truth || e.next_pose != best.estimate) continue;  // one of them has gone on
        pairs.push_back({best.truth, best.estimate, 0.0, {}});
        ++t.next_pose;
        ++e.next_pose;
        for (const std::size_t i : {best.truth_run, best.estimate_run}) {
            if (runs[i].next_pose == runs[i].end_pose) leave(i);
        }
        for (const std::size_t i : {best.truth_run, best.estimate_run}) {
            const bool is_left = runs[i].next_pose < runs[i].end_pose;
            propose(runs[i].before, is_left ? i : runs[i].after);
            if (is_left) propose(i, runs[i].after);
        }
    }
    std::sort(pairs.begin(), pairs.end(),
              [](const PosePair& a, const PosePair& b) { return a.estimate_index < b.estimate_index; });
    return pairs;
}

// truth = R estimate + t, least squares (Umeyama 1991 without scale); `scale`: what it would be with one. A path that
// stands still has none: 1.
[[nodiscard]] Rigid align(const Trajectory& truth, const Trajectory& estimate, const std::vector<PosePair>& pairs,
                          double& scale) {
    Vector truth_mean = Vector::Zero();
    Vector estimate_mean = Vector::Zero();
    for (const PosePair& pair : pairs) {
        truth_mean += position(truth[pair.truth_index]);
        estimate_mean += position(estimate[pair.estimate_index]);
    }
    const auto count = static_cast<double>(pairs.size());
    truth_mean /= count;
    estimate_mean /= count;
    Matrix covariance = Matrix::Zero();
    double variance = 0;
    for (const PosePair& pair : pairs) {
        const Vector off = position(estimate[pair.estimate_index]) - estimate_mean;
        covariance += (position(truth[pair.truth_index]) - truth_mean) * off.transpose();
        variance += off.squaredNorm();
    }
    covariance /= count;
    variance /= count;
    const Eigen::JacobiSVD<Matrix> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix sign = Matrix::Identity();
    if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign(2, 2) = -1;
    const double along = svd.singularValues().dot(sign.diagonal());
    scale = variance > 1e-12 && along > 0 ? along / variance : 1.0;
    const Matrix r = svd.matrixU() * sign * svd.matrixV().transpose();
    return {r, truth_mean - r * estimate_mean};
}

[[nodiscard]] double rmse(const std::vector<double>& values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    double sum = 0;
    for (const double value : values) sum += value * value;
    return std::sqrt(sum / static_cast<double>(values.size()));
}

[[nodiscard]] double angle_deg(const Matrix& r) {
    return std::acos(std::clamp((r.trace() - 1) / 2, -1.0, 1.0)) * 180.0 / 3.14159265358979323846;
}

[[nodiscard]] double coverage_of(const Trajectory& truth, const Trajectory& estimate, std::int64_t hole_ns) {
    const std::int64_t begin = truth.front().time_ns;
    const std::int64_t end = truth.back().time_ns;
    if (end <= begin) return 0.0;
    std::int64_t covered_ns = 0;
    std::int64_t last_ns = begin;  // a start within hole_ns of the truth's is no hole
    for (const TrajectoryPose& pose : estimate) {
        if (pose.time_ns < begin || pose.time_ns > end) continue;
        if (pose.time_ns - last_ns <= hole_ns) covered_ns += pose.time_ns - last_ns;
        last_ns = pose.time_ns;
    }
    if (end - last_ns <= hole_ns && last_ns != begin) covered_ns += end - last_ns;
    return static_cast<double>(covered_ns) / static_cast<double>(end - begin);
}

}  // namespace

std::optional<Evaluation> evaluate(const Trajectory& truth, const Trajectory& estimate,
                                   const EvaluationOptions& options) {
    Evaluation result;
    result.pairs = associate_poses(truth, estimate, options.gap_max_ns);
    std::vector<PosePair>& pairs = result.pairs;
    if (pairs.size() < 3) return std::nullopt;

    const Rigid truth_from_estimate = align(truth, estimate, pairs, result.scale);
    std::vector<double> errors;
    errors.reserve(pairs.size());
    for (PosePair& pair : pairs) {
        const Vector aligned = truth_from_estimate.r * position(estimate[pair.estimate_index]) + truth_from_estimate.t;
        pair.error_m = (aligned - position(truth[pair.truth_index])).norm();
        pair.aligned_t = {aligned[0], aligned[1], aligned[2]};
        errors.push_back(pair.error_m);
        result.ate_mean_m += pair.error_m / static_cast<double>(pairs.size());
    }
    result.ate_rmse_m = rmse(errors);
    std::sort(errors.begin(), errors.end());
    const std::size_t middle = errors.size() / 2;
    result.ate_median_m = errors.size() % 2 == 1 ? errors[middle] : (errors[middle - 1] + errors[middle]) / 2;
    result.ate_max_m = errors.back();

    std::vector<double> translations;
    std::vector<double> rotations;
    const auto time_of = [&](std::size_t i) { return estimate[pairs[i].estimate_index].time_ns; };
    std::size_t after = 0;  // the first pair at or after t_i + delta
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        const std::int64_t target = time_of(i) + options.delta_ns;
        while (after < pairs.size() && time_of(after) < target) ++after;
        std::size_t j = pairs.size();
        if (after > i + 1) j = after - 1;
        if (after < pairs.size() && after > i &&
            (j == pairs.size() || std::abs(time_of(after) - target) < std::abs(time_of(j) - target))) {
            j = after;
        }
        if (j == pairs.size() || std::abs(time_of(j) - target) > options.delta_ns / 10) continue;
        const Rigid q = rigid(truth[pairs[i].truth_index]).inverse() * rigid(truth[pairs[j].truth_index]);
        const Rigid p = rigid(estimate[pairs[i].estimate_index]).inverse() * rigid(estimate[pairs[j].estimate_index]);
        const Rigid error = q.inverse() * p;
        translations.push_back(error.t.norm());
        rotations.push_back(angle_deg(error.r));
    }
    result.rpe_pairs = translations.size();
    result.rpe_translation_rmse_m = rmse(translations);
    result.rpe_rotation_rmse_deg = rmse(rotations);
    result.coverage = coverage_of(truth, estimate, options.hole_ns);
    for (int i = 0; i < 9; ++i) {
        result.truth_from_estimate_r[static_cast<std::size_t>(i)] = truth_from_estimate.r(i / 3, i % 3);
    }
    for (int i = 0; i < 3; ++i) {
        result.truth_from_estimate_t[static_cast<std::size_t>(i)] = truth_from_estimate.t[i];
    }
    return result;
}

}  // namespace stillmesh
