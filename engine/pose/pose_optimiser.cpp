#include "engine/pose/pose_optimiser.hpp"

#include <cmath>

#include "engine/geometry/cholesky.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

// Not good: not positive, or nothing but what rounding left of it.
bool is_pivot_good(double pivot, double diagonal) noexcept {
    constexpr double kRounding = 1e-11;
    return pivot > 1e-12 && pivot > kRounding * diagonal;
}

// The shape of the robust cost, in thresholds. Huber's up to kFar, where its root is 4; beyond, weights fall off with
// the third power of the residual, and what they integrate to tends to the most that one point costs, 4 * 4 - 1. A
// point behind the camera costs it.
constexpr double kFar = 16.0;
constexpr double kCostMax = 15.0;

struct System {
    Matrix6 h = Matrix6::Zero();
    Vector6 g = Vector6::Zero();
    double cost = 0;
    std::uint32_t inliers = 0;
    double inlier_chi2 = 0;

    // The residuals of a point at q with weight w; only the lower triangle of h. With x = q.x / q.z, y = q.y / q.z and
    // dq = -v + [q]x w for T * exp(v, w), the rows of the Jacobian are
    //   (-1/z, 0, x/z, xy, -(1+xx), y), (0, -1/z, y/z, 1+yy, -xy, -x) and, of the depth, (0, 0, -1, -q.y, q.x, 0).
    // Both image axes have the same information, so that of their 21 products two are zero, two are the same as others,
    // and the rest are short: three times less work than row by row, and this is where a frame's poses spend it.
    void add(const Vector3& q, const Residual& r, double w) noexcept {
        const double iz = 1.0 / q.z();
        const double x = q.x() * iz;
        const double y = q.y() * iz;
        const double xx = 1.0 + x * x;
        const double yy = 1.0 + y * y;
        const double xy = x * y;
        const double rr = x * x + y * y;
        const double info = w * r.info_x;
        const double info_iz = info * iz;
        const double info_iz2 = info_iz * iz;
        const double info_x = info * x;
        const double info_y = info * y;
        h(0, 0) += info_iz2;
        h(2, 0) -= info_iz2 * x;
        h(2, 1) -= info_iz2 * y;
        h(2, 2) += info_iz2 * rr;
        h(3, 0) -= info_iz * xy;
        h(3, 1) -= info_iz * yy;
        h(4, 0) += info_iz * xx;
        h(5, 0) -= info_iz * y;
        h(5, 1) += info_iz * x;
        h(3, 2) += info_iz * y * (1.0 + rr);
        h(4, 2) -= info_iz * x * (1.0 + rr);
        h(3, 3) += info * (xy * xy + yy * yy);
        h(4, 3) -= info * xy * (2.0 + rr);
        h(4, 4) += info * (xx * xx + xy * xy);
        h(5, 3) -= info_x;
        h(5, 4) -= info_y;
        h(5, 5) += info * rr;
        const double off_x = info * r.x;
        const double off_y = info * r.y;
        g(0) -= iz * off_x;
        g(1) -= iz * off_y;
        g(2) += iz * (x * off_x + y * off_y);
        g(3) += xy * off_x + yy * off_y;
        g(4) -= xx * off_x + xy * off_y;
        g(5) += y * off_x - x * off_y;
        if (!(r.info_z > 0)) return;
        const double info_z = w * r.info_z;
        const double off_z = info_z * r.z;
        h(2, 2) += info_z;
        h(3, 2) += info_z * q.y();
        h(4, 2) -= info_z * q.x();
        h(3, 3) += info_z * q.y() * q.y();
        h(4, 3) -= info_z * q.x() * q.y();
        h(4, 4) += info_z * q.x() * q.x();
        g(2) -= off_z;
        g(3) -= q.y() * off_z;
        g(4) += q.x() * off_z;
    }

    // What add() left out because it equals something else.
    void complete() noexcept {
        h(1, 1) = h(0, 0);
        h(4, 1) = -h(3, 0);
    }
};

System linearise(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                 const SE3& world_from_camera, double chi2_max, double weight_scale,
                 const MotionPrior* prior) noexcept {
    System s;
    const SE3 camera_from_world = world_from_camera.inverse();
    for (const std::uint16_t index : chosen) {
        const Correspondence& c = correspondences[index];
        const Vector3 q = camera_from_world * c.p_world;
        const double weight = c.weight * weight_scale;
        if (q.z() < kDepthMin_m) {
            s.cost += weight * kCostMax * chi2_max;
            continue;
        }
        const Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
        const double chi2 = r.chi2();
        // Huber, then nothing at all far beyond the threshold: a gross outlier has no say. The cost is what these
        // weights integrate to, up to kCostMax chi2_max: were it Huber's, one outlier could veto every step.
        double robust = 1.0;
        if (chi2 <= chi2_max) {
            s.cost += weight * chi2;
            ++s.inliers;
            s.inlier_chi2 += chi2;
        } else {
            const double ratio = std::sqrt(chi2_max / chi2);
            robust = ratio;
            if (chi2 <= kFar * chi2_max) {
                s.cost += weight * chi2_max * (2.0 / ratio - 1.0);
            } else {
                s.cost += weight * chi2_max * (kCostMax - 2.0 * kFar * ratio);
                robust *= kFar * chi2_max / chi2;
            }
        }
        s.add(q, r, weight * robust);
    }
    s.complete();
    if (prior != nullptr) {
        // Six more residuals; the right Jacobian of the logarithm is close to one where they matter.
        const Vector6 off = se3_log(prior->world_from_camera.inverse() * world_from_camera);
        for (int i = 0; i < 6; ++i) {
            const double sigma = i < 3 ? prior->sigma_m : prior->sigma_rad;
            const double info = 1.0 / (sigma * sigma);
            s.h(i, i) += info;
            s.g(i) += info * off(i);
            s.cost += info * off(i) * off(i);
        }
    }
    for (int i = 0; i < 6; ++i) {
        for (int j = i + 1; j < 6; ++j) s.h(i, j) = s.h(j, i);
    }
    return s;
}

}  // namespace

bool invert_spd(const Matrix6& matrix, Matrix6& inverse) noexcept {
    Matrix6 l = matrix;
    if (!cholesky(l, is_pivot_good)) return false;
    for (int i = 0; i < 6; ++i) {
        Vector6 column = Vector6::Zero();
        column(i) = 1.0;
        solve_lower(l, column);
        solve_lower_transposed(l, column);
        inverse.col(i) = column;
    }
    return true;
}

PoseFit optimise_pose(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                      const SE3& world_from_camera_guess, double chi2_max, std::uint32_t iterations_max,
                      const MotionPrior* prior) noexcept {
    PoseFit fit;
    fit.world_from_camera = world_from_camera_guess;
    if (chosen.size() < 3) return fit;
    // Weights are relative: the most trusted point has weight 1, so that the information keeps its unit.
    double weight_max = 0;
    for (const std::uint16_t index : chosen) {
        if (correspondences[index].weight > weight_max) weight_max = correspondences[index].weight;
    }
    if (!(weight_max > 0)) return fit;
    const double weight_scale = 1.0 / weight_max;
    double lambda = 1e-4;
    System system = linearise(correspondences, chosen, fit.world_from_camera, chi2_max, weight_scale, prior);
    for (std::uint32_t i = 0; i < iterations_max; ++i) {
        Matrix6 damped = system.h;
        for (int k = 0; k < 6; ++k) damped(k, k) += lambda * system.h(k, k) + 1e-9;
        if (!cholesky(damped, is_pivot_good)) return fit;
        Vector6 step = -system.g;
        solve_lower(damped, step);
        solve_lower_transposed(damped, step);
        SE3 candidate = fit.world_from_camera * se3_exp(step);
        renormalise(candidate.rotation);
        const System next = linearise(correspondences, chosen, candidate, chi2_max, weight_scale, prior);
        if (next.cost <= system.cost) {
            const double gain = system.cost - next.cost;
            const double before = system.cost;
            fit.world_from_camera = candidate;
            system = next;
            lambda *= 0.1;
            if (gain <= 1e-4 * before) break;
        } else {
            lambda *= 10.0;
            if (lambda > 1e3) break;
        }
    }
    fit.information = system.h;
    fit.inliers = system.inliers;
    fit.mean_chi2 = system.inliers > 0 ? system.inlier_chi2 / system.inliers : 0.0;
    Matrix6 l = fit.information;
    fit.is_valid = system.inliers >= 3 && cholesky(l, is_pivot_good);
    return fit;
}

}  // namespace stillmesh
