#include "bench/accuracy/measures.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "engine/base/check.hpp"
#include "platform/evaluation/evaluation.hpp"
// After CHECK: Eigen's assertions are ours.
#include <Eigen/Dense>

namespace stillmesh::accuracy {
namespace {

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

struct Rigid {
    Matrix r = Matrix::Identity();
    Vector t = Vector::Zero();
    [[nodiscard]] Rigid inverse() const { return {r.transpose(), -(r.transpose() * t)}; }
    [[nodiscard]] Rigid operator*(const Rigid& other) const { return {r * other.r, r * other.t + t}; }
};

Rigid rigid(const TrajectoryPose& pose) {
    return {Eigen::Quaterniond(pose.q[3], pose.q[0], pose.q[1], pose.q[2]).normalized().toRotationMatrix(),
            {pose.t[0], pose.t[1], pose.t[2]}};
}

Vector rotation_vector(const Matrix& r) {
    Eigen::Quaterniond q(r);
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    const double sine = q.vec().norm();
    if (sine < 1e-12) return 2 * q.vec();
    return q.vec() * (2 * std::atan2(sine, q.w()) / sine);
}

// xi with exp(xi) = motion, xi = [translation, rotation]: the engine's convention (engine/geometry/se3.hpp).
Vector6 logarithm(const Rigid& motion) {
    const Vector phi = rotation_vector(motion.r);
    const double angle = phi.norm();
    const Vector cross = phi.cross(motion.t);
    const double c =
        angle < 1e-4 ? 1.0 / 12 : (1 - angle * std::sin(angle) / (2 * (1 - std::cos(angle)))) / (angle * angle);
    Vector6 xi;
    xi << motion.t - 0.5 * cross + c * phi.cross(cross), phi;
    return xi;
}

bool has_pose(const FrameRecord& frame) {
    return frame.state == PoseState::kTracked || frame.state == PoseState::kUnsure;
}

// The rotation and translation that carry the estimates onto the truth best, by all six coordinates.
Rigid fit_poses(std::span<const FrameRecord> frames) {
    Matrix sum = Matrix::Zero();
    for (const FrameRecord& frame : frames) {
        if (!has_pose(frame) || !frame.has_truth) continue;
        sum += rigid(frame.truth).r * rigid(frame.estimate).r.transpose();
    }
    const Eigen::JacobiSVD<Matrix> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix sign = Matrix::Identity();
    if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign(2, 2) = -1;
    Rigid out;
    out.r = svd.matrixU() * sign * svd.matrixV().transpose();
    double count = 0;
    for (const FrameRecord& frame : frames) {
        if (!has_pose(frame) || !frame.has_truth) continue;
        out.t += rigid(frame.truth).t - out.r * rigid(frame.estimate).t;
        ++count;
    }
    if (count > 0) out.t /= count;
    return out;
}

void measure_path(std::span<const FrameRecord> frames, Measures& out, std::optional<Rigid>& ate_alignment) {
    Trajectory truth;
    Trajectory estimate;
    for (const FrameRecord& frame : frames) {
        if (!frame.has_truth) continue;
        truth.push_back(frame.truth);
        if (has_pose(frame)) estimate.push_back(frame.estimate);
    }
    const auto result = evaluate(truth, estimate);
    if (!result) return;
    out.ate_m = result->ate_rmse_m;
    out.ate_max_m = result->ate_max_m;
    if (result->rpe_pairs > 0) {
        out.rpe_m = result->rpe_translation_rmse_m;
        out.rpe_deg = result->rpe_rotation_rmse_deg;
    }
    Rigid alignment;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            alignment.r(row, column) = result->truth_from_estimate_r[static_cast<std::size_t>(row * 3 + column)];
        }
        alignment.t[row] = result->truth_from_estimate_t[static_cast<std::size_t>(row)];
    }
    ate_alignment = alignment;
}

void measure_sureness(std::span<const FrameRecord> frames, Measures& out) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const FrameRecord& now = frames[i];
        if (now.state == PoseState::kNone || !now.has_truth) continue;
        const FrameRecord* before = nullptr;
        std::int64_t off_least_ns = kMotionTime_ns / 10 + 1;
        for (std::size_t j = i; j-- > 0;) {
            const std::int64_t off_ns = frames[j].time_ns - (now.time_ns - kMotionTime_ns);
            if (off_ns < -kMotionTime_ns / 10) break;
            if (has_pose(frames[j]) && frames[j].has_truth && std::abs(off_ns) < off_least_ns) {
                off_least_ns = std::abs(off_ns);
                before = &frames[j];
            }
        }
        if (before == nullptr) continue;
        const Rigid said = rigid(before->estimate).inverse() * rigid(now.estimate);
        const Rigid was = rigid(before->truth).inverse() * rigid(now.truth);
        const Rigid error = was.inverse() * said;
        const bool is_right = error.t.norm() <= kWrongTranslation_m &&
                              rotation_vector(error.r).norm() <= kWrongRotation_deg * 3.14159265358979323846 / 180;
        if (now.state == PoseState::kPredicted) {
            ++out.judged_predicted;
            out.wrong_predicted += !is_right;
            continue;
        }
        const bool is_tracked = now.state == PoseState::kTracked;
        out.judged_unsure += !is_tracked;
        out.wrong_unsure += !is_tracked && !is_right;
        if (is_tracked && !is_right && out.wrong_tracked == 0) out.wrong_first = i;
        out.judged_tracked += is_tracked;
        out.wrong_tracked += is_tracked && !is_right;
        out.right += is_right;
        out.right_tracked += is_right && is_tracked;
    }
}

void measure_covariance(std::span<const FrameRecord> frames, const std::optional<Rigid>& ate_alignment, Measures& out) {
    const FrameRecord* first = nullptr;
    Rigid truth_from_odom_first;
    const Rigid truth_from_odom_fit = fit_poses(frames);
    for (const FrameRecord& frame : frames) {
        if (!has_pose(frame) || !frame.has_truth) continue;
        const Rigid estimate = rigid(frame.estimate);
        const Rigid truth = rigid(frame.truth);
        if (first == nullptr) {
            first = &frame;
            truth_from_odom_first = truth * estimate.inverse();
            continue;
        }
        const Matrix6 covariance = Eigen::Map<const Matrix6>(frame.covariance.data());
        const Eigen::LDLT<Matrix6> solver(covariance);
        if (solver.info() != Eigen::Success || !(solver.vectorD().minCoeff() > 0)) {
            ++out.covariance_bad;
            continue;
        }
        const auto error = [&](const Rigid& truth_from_odom) -> Vector6 {
            return logarithm(estimate.inverse() * truth_from_odom.inverse() * truth);
        };
        const auto nees = [&](const Vector6& xi) -> double {
            const Vector6 scaled = solver.solve(xi);
            return xi.dot(scaled);
        };
        const Vector6 xi_first = error(truth_from_odom_first);
        const Vector6 xi_fit = error(truth_from_odom_fit);
        ++out.nees_frames;
        out.nees_first_sum += nees(xi_first);
        out.nees_fit_sum += nees(xi_fit);
        out.nees_ate_sum += ate_alignment ? nees(error(*ate_alignment)) : 0;
        out.fit_m2_sum += xi_fit.head<3>().squaredNorm();
        out.fit_rad2_sum += xi_fit.tail<3>().squaredNorm();
        out.said_m2_sum += covariance.topLeftCorner<3, 3>().trace();
        out.said_rad2_sum += covariance.bottomRightCorner<3, 3>().trace();
        const Matrix translation = covariance.topLeftCorner<3, 3>();
        const Matrix rotation = covariance.bottomRightCorner<3, 3>();
        const auto part = [](const Matrix& of, const Vector& xi) -> double {
            const Vector scaled = of.ldlt().solve(xi);
            return xi.dot(scaled);
        };
        out.nees_first_translation_sum += part(translation, xi_first.head<3>());
        out.nees_first_rotation_sum += part(rotation, xi_first.tail<3>());
        out.nees_fit_translation_sum += part(translation, xi_fit.head<3>());
        out.nees_fit_rotation_sum += part(rotation, xi_fit.tail<3>());
    }
}

}  // namespace

Measures measure(std::span<const FrameRecord> frames) {
    Measures out;
    out.frames = frames.size();
    std::uint64_t hole = 0;
    std::vector<float> times;
    for (const FrameRecord& frame : frames) {
        out.tracked += frame.state == PoseState::kTracked;
        out.unsure += frame.state == PoseState::kUnsure;
        out.predicted += frame.state == PoseState::kPredicted;
        out.none += frame.state == PoseState::kNone;
        hole = has_pose(frame) ? 0 : hole + 1;
        out.hole_longest = std::max(out.hole_longest, hole);
        out.ends_with_pose = has_pose(frame);
        times.push_back(frame.engine_ms);
        if (!frame.has_mask) continue;
        ++out.masked_frames;
        out.moving += frame.moving;
        out.moving_accepted += frame.moving_accepted;
        out.still += frame.still;
        out.still_accepted += frame.still_accepted;
        out.wrong_choices += frame.moving_accepted > frame.still_accepted;
    }
    if (!times.empty()) {
        std::sort(times.begin(), times.end());
        out.median_ms = times[times.size() / 2];
        out.p99_ms = times[std::min(times.size() - 1, times.size() * 99 / 100)];
    }
    std::optional<Rigid> ate_alignment;
    measure_path(frames, out, ate_alignment);
    measure_sureness(frames, out);
    measure_covariance(frames, ate_alignment, out);
    return out;
}

bool truth_at(const Trajectory& truth, std::int64_t time_ns, std::int64_t gap_max_ns, TrajectoryPose& pose) {
    const auto after = std::lower_bound(truth.begin(), truth.end(), time_ns,
                                        [](const TrajectoryPose& p, std::int64_t t) { return p.time_ns < t; });
    if (after == truth.end()) return false;
    if (after->time_ns == time_ns) {
        pose = *after;
        return true;
    }
    if (after == truth.begin()) return false;
    const TrajectoryPose& a = *(after - 1);
    const TrajectoryPose& b = *after;
    if (b.time_ns - a.time_ns > gap_max_ns) return false;
    const double s = static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
    pose.time_ns = time_ns;
    double dot = 0;
    for (std::size_t i = 0; i < 4; ++i) dot += a.q[i] * b.q[i];
    double length2 = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        pose.q[i] = (1 - s) * a.q[i] + s * (dot < 0 ? -b.q[i] : b.q[i]);
        length2 += pose.q[i] * pose.q[i];
    }
    for (double& q : pose.q) q /= std::sqrt(length2);
    for (std::size_t i = 0; i < 3; ++i) pose.t[i] = (1 - s) * a.t[i] + s * b.t[i];
    return true;
}

}  // namespace stillmesh::accuracy
