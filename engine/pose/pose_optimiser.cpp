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

// One scalar residual r with its row of the Jacobian and weight.
void accumulate(const double row[6], double r, double weight, Matrix6& h, Vector6& g) noexcept {
    for (int i = 0; i < 6; ++i) {
        const double wi = weight * row[i];
        g(i) += wi * r;
        for (int j = 0; j <= i; ++j) h(i, j) += wi * row[j];
    }
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
};

System linearise(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                 const SE3& world_from_camera, double chi2_max, double vote_scale, const MotionPrior* prior) noexcept {
    System s;
    const SE3 camera_from_world = world_from_camera.inverse();
    for (const std::uint16_t index : chosen) {
        const Correspondence& c = correspondences[index];
        const Vector3 q = camera_from_world * c.p_world;
        const double vote = c.vote * vote_scale;
        if (q.z() < kDepthMin_m) {
            s.cost += vote * kCostMax * chi2_max;
            continue;
        }
        const Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
        const double chi2 = r.chi2();
        // Huber, then nothing at all far beyond the threshold: a gross outlier has no say. The cost is what these
        // weights integrate to, up to kCostMax chi2_max: were it Huber's, one outlier could veto every step.
        double robust = 1.0;
        if (chi2 <= chi2_max) {
            s.cost += vote * chi2;
            ++s.inliers;
            s.inlier_chi2 += chi2;
        } else {
            const double ratio = std::sqrt(chi2_max / chi2);
            robust = ratio;
            if (chi2 <= kFar * chi2_max) {
                s.cost += vote * chi2_max * (2.0 / ratio - 1.0);
            } else {
                s.cost += vote * chi2_max * (kCostMax - 2.0 * kFar * ratio);
                robust *= kFar * chi2_max / chi2;
            }
        }
        // d q / d xi for T * exp(xi): q' = exp(-xi) q, so dq = -v + [q]x w.
        const double iz = 1.0 / q.z();
        const double x = q.x() * iz;
        const double y = q.y() * iz;
        const double row_x[6] = {-iz, 0, x * iz, -(-x * y), -(1.0 + x * x), y};
        const double row_y[6] = {0, -iz, y * iz, 1.0 + y * y, -(x * y), -x};
        const double w = vote * robust;
        accumulate(row_x, r.x, w * r.info_x, s.h, s.g);
        accumulate(row_y, r.y, w * r.info_y, s.h, s.g);
        if (r.info_z > 0) {
            const double row_z[6] = {0, 0, -1.0, -q.y(), q.x(), 0};
            accumulate(row_z, r.z, w * r.info_z, s.h, s.g);
        }
    }
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
    // Votes are relative: the most trusted point has weight 1, so that the information keeps its unit.
    double vote_max = 0;
    for (const std::uint16_t index : chosen) {
        if (correspondences[index].vote > vote_max) vote_max = correspondences[index].vote;
    }
    if (!(vote_max > 0)) return fit;
    const double vote_scale = 1.0 / vote_max;
    double lambda = 1e-4;
    System system = linearise(correspondences, chosen, fit.world_from_camera, chi2_max, vote_scale, prior);
    for (std::uint32_t i = 0; i < iterations_max; ++i) {
        Matrix6 damped = system.h;
        for (int k = 0; k < 6; ++k) damped(k, k) += lambda * system.h(k, k) + 1e-9;
        if (!cholesky(damped, is_pivot_good)) return fit;
        Vector6 step = -system.g;
        solve_lower(damped, step);
        solve_lower_transposed(damped, step);
        SE3 candidate = fit.world_from_camera * se3_exp(step);
        renormalise(candidate.rotation);
        const System next = linearise(correspondences, chosen, candidate, chi2_max, vote_scale, prior);
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
