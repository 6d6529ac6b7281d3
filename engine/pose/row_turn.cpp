#include "engine/pose/row_turn.hpp"

#include <algorithm>
#include <cmath>

#include "engine/geometry/cholesky.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

// Pose and turn: the turn moves what a row saw as a rotation of the pose would, times the row.
constexpr int kUnknowns = 9;
using Matrix9 = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Vector9 = Eigen::Matrix<double, kUnknowns, 1>;

constexpr int kPasses = 4;
constexpr std::size_t kMatchesMax = 256;  // more say nothing new: .0002 rad

struct System {
    Matrix9 h = Matrix9::Zero();
    Vector9 g = Vector9::Zero();

    // One residual and how it moves with the pose.
    void add(const double (&by_pose)[6], double row, double residual, double info) noexcept {
        double by[kUnknowns];
        for (int i = 0; i < 6; ++i) by[i] = by_pose[i];
        for (int i = 0; i < 3; ++i) by[6 + i] = row * by_pose[3 + i];
        for (int i = 0; i < kUnknowns; ++i) {
            const double weighted = by[i] * info;
            for (int j = 0; j <= i; ++j) h(i, j) += weighted * by[j];
            g(i) += weighted * residual;
        }
    }
};

// With the turn off by `off` from what rows were carried with.
void add_match(const Correspondence& c, const SE3& camera_from_world, const Vector3& off, double chi2_max,
               System& system) noexcept {
    const Vector3 q = camera_from_world * c.p_world;
    if (q.z() < kDepthMin_m) return;
    Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
    const double x = q.x() / q.z();
    const double y = q.y() / q.z();
    const double row_x[6] = {-1.0 / q.z(), 0, x / q.z(), x * y, -(1.0 + x * x), y};
    const double row_y[6] = {0, -1.0 / q.z(), y / q.z(), 1.0 + y * y, -(x * y), -x};
    const double row_z[6] = {0, 0, -1.0, -q.y(), q.x(), 0};
    for (int i = 0; i < 3; ++i) {
        r.x += c.row * off(i) * row_x[3 + i];
        r.y += c.row * off(i) * row_y[3 + i];
    }
    const double chi2 = r.chi2();
    const double weight = c.weight * (chi2 <= chi2_max ? 1.0 : std::sqrt(chi2_max / chi2));
    system.add(row_x, c.row, r.x, weight * r.info_x);
    system.add(row_y, c.row, r.y, weight * r.info_y);
    if (r.info_z > 0) system.add(row_z, 0, r.z, weight * r.info_z);
}

}  // namespace

bool measure_row_turn(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                      const SE3& world_from_camera_guess, const Vector3& carried, const Vector3& expected,
                      double variance, double chi2_max, RowTurn& out) noexcept {
    const std::size_t step = (chosen.size() + kMatchesMax - 1) / kMatchesMax;
    SE3 pose = world_from_camera_guess;
    Vector3 off = Vector3::Zero();
    Matrix9 l;
    for (int pass = 0; pass < kPasses; ++pass) {
        System system;
        const SE3 camera_from_world = pose.inverse();
        for (std::size_t i = 0; i < chosen.size(); i += step)
            add_match(correspondences[chosen[i]], camera_from_world, off, chi2_max, system);
        for (int i = 0; i < 3; ++i) {
            system.h(6 + i, 6 + i) += 1.0 / variance;
            system.g(6 + i) += (carried(i) + off(i) - expected(i)) / variance;
        }
        l = system.h;
        const auto is_good = [](double pivot, double diagonal) { return pivot > 1e-11 * diagonal && pivot > 1e-12; };
        if (!cholesky(l, is_good)) return false;
        Vector9 change = -system.g;
        solve_lower(l, change);
        solve_lower_transposed(l, change);
        pose = pose * se3_exp(change.head<6>());
        renormalise(pose.rotation);
        off += change.tail<3>();
    }
    out.turn = carried + off;
    for (int k = 0; k < 3; ++k) {  // of the inverse, what belongs to the turn
        Vector9 column = Vector9::Zero();
        column(6 + k) = 1.0;
        solve_lower(l, column);
        solve_lower_transposed(l, column);
        out.covariance.col(k) = column.tail<3>();
    }
    return true;
}

}  // namespace stillmesh
