#include "engine/pose/rolling_shutter.hpp"

#include <algorithm>
#include <cmath>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {

void RollingShutter::create(double readout_s, std::uint32_t image_height,
                            const ShutterParameters& parameters) noexcept {
    parameters_ = parameters;
    prior_info_ = 1.0 / (parameters.sigma_s * parameters.sigma_s);
    given_s_ = readout_s;
    is_estimated_ = readout_s < 0;
    inverse_height_ = 1.0 / static_cast<double>(image_height);
    reset();
}

void RollingShutter::reset() noexcept {
    readout_s_ = is_estimated_ ? 0.0 : given_s_;
    estimate_s_ = readout_s_;
    info_ = 0;
    weighted_ = 0;
}

void RollingShutter::start_from(double readout_s) noexcept {
    if (!is_estimated_) return;
    constexpr double kSigma_s = 0.003;
    readout_s_ = estimate_s_ = readout_s;
    info_ = 1.0 / (kSigma_s * kSigma_s);
    weighted_ = info_ * readout_s;
}

void RollingShutter::begin_frame(const Vector3& off, double variance) noexcept {
    equations_ = RowEquations{};
    equations_.expect_turn(off, variance);
    cross_.setZero();
    h_readout_ = 0;
    g_readout_ = 0;
    used_ = 0;
}

void RollingShutter::add(const Correspondence& c, const Vector3& q, const Vector3& q_by_readout, double y_px,
                         const Vector6& speed, double chi2_max) noexcept {
    if (!c.has_depth || q.z() < kDepthMin_m) return;
    const Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
    if (r.chi2() > chi2_max) return;
    const double iz = 1.0 / q.z();
    // The residual is the map's minus the measured, and both move.
    const Vector3 d = by_readout(c.p_camera, y_px, speed);
    const double inverse = 1.0 / c.p_camera.z();
    const double by[3] = {
        (q_by_readout.x() - q.x() * iz * q_by_readout.z()) * iz - (d.x() - c.normalised.x() * d.z()) * inverse,
        (q_by_readout.y() - q.y() * iz * q_by_readout.z()) * iz - (d.y() - c.normalised.y() * d.z()) * inverse,
        q_by_readout.z() - d.z()};
    const double row = y_px * inverse_height_ - 0.5;
    RowEquations::visit_rows(q, row, r,
                             [&](const RowEquations::Vector9& jacobian, double residual, double info, int axis) {
                                 equations_.add(jacobian, residual, info);
                                 cross_ += jacobian * (by[axis] * info);
                                 h_readout_ += by[axis] * by[axis] * info;
                                 g_readout_ += by[axis] * residual * info;
                             });
    ++used_;
}

Vector6 RollingShutter::end_frame(bool counts) noexcept {
    RowEquations::Matrix9 l;
    if (!is_estimated_ || used_ < parameters_.matches_min || !equations_.factorise(l)) return Vector6::Zero();
    const RowEquations::Vector9 moves = RowEquations::solve(l, cross_);
    double info = h_readout_;
    double gradient = g_readout_;
    for (int i = 0; i < RowEquations::kUnknowns; ++i) {
        info -= cross_(i) * moves(i);
        gradient -= equations_.g(i) * moves(i);
    }
    if (!(info > 1.0)) return Vector6::Zero();  // and what is not a number
    const Vector6 solved = -moves.head<6>();
    const ShutterParameters& p = parameters_;
    const double found = std::clamp(readout_s_ - gradient / info, -p.readout_max_s, p.readout_max_s);
    if (!counts || info < p.info_share_min * prior_info_) return solved;
    info_ = info_ * p.fading + info;
    weighted_ = weighted_ * p.fading + info * found;
    estimate_s_ = weighted_ / (info_ + prior_info_);
    return solved;
}

bool RollingShutter::adopt() noexcept {
    const double wanted = std::abs(estimate_s_) < parameters_.negligible_s ? 0.0 : estimate_s_;
    if (std::abs(wanted - readout_s_) < parameters_.step_s) return false;
    readout_s_ = wanted;
    return true;
}

}  // namespace stillmesh
