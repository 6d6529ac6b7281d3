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

void RollingShutter::begin_frame() noexcept {
    h_.setZero();
    g_.setZero();
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
    const double x = q.x() * iz;
    const double y = q.y() * iz;
    // The residual is the map's minus the measured, and both move.
    const Vector3 d = by_readout(c.p_camera, y_px, speed);
    const double inverse = 1.0 / c.p_camera.z();
    const double by_x = (q_by_readout.x() - x * q_by_readout.z()) * iz - (d.x() - c.normalised.x() * d.z()) * inverse;
    const double by_y = (q_by_readout.y() - y * q_by_readout.z()) * iz - (d.y() - c.normalised.y() * d.z()) * inverse;
    const double row_x[6] = {-iz, 0, x * iz, x * y, -(1.0 + x * x), y};
    const double row_y[6] = {0, -iz, y * iz, 1.0 + y * y, -(x * y), -x};
    const double row_z[6] = {0, 0, -1.0, -q.y(), q.x(), 0};
    const auto take = [&](const double(&jacobian)[6], double by_readout, double residual, double info) {
        for (int i = 0; i < 6; ++i) {
            for (int j = 0; j < 6; ++j) h_(i, j) += jacobian[i] * jacobian[j] * info;
            g_(i) += jacobian[i] * residual * info;
            cross_(i) += jacobian[i] * by_readout * info;
        }
        h_readout_ += by_readout * by_readout * info;
        g_readout_ += by_readout * residual * info;
    };
    take(row_x, by_x, r.x, r.info_x);
    take(row_y, by_y, r.y, r.info_y);
    take(row_z, q_by_readout.z() - d.z(), r.z, r.info_z);
    ++used_;
}

Vector6 RollingShutter::end_frame(bool counts) noexcept {
    Vector6 solved = Vector6::Zero();
    Matrix6 inverse;
    if (!is_estimated_ || used_ < parameters_.matches_min || !invert_spd(h_, inverse)) return solved;
    solved.noalias() = inverse * cross_;
    double info = h_readout_;
    double gradient = g_readout_;
    for (int i = 0; i < 6; ++i) {
        info -= cross_(i) * solved(i);
        gradient -= g_(i) * solved(i);
    }
    if (!(info > 1.0)) return Vector6::Zero();  // and what is not a number
    solved *= -1.0;
    const ShutterParameters& p = parameters_;
    const double found = std::clamp(readout_s_ - gradient / info, -p.readout_max_s, p.readout_max_s);
    info *= p.trust;
    if (!counts || info < p.info_share_min * prior_info_) return solved;
    info_ = info_ * p.fading + info;
    weighted_ = weighted_ * p.fading + info * found;
    estimate_s_ = weighted_ / (info_ + prior_info_);
    return solved;
}

void RollingShutter::doubt() noexcept {
    const double share = info_ > prior_info_ ? prior_info_ / info_ : 1.0;
    info_ *= share;
    weighted_ *= share;
}

void RollingShutter::add_turn(double turned, double turning) noexcept {
    if (!is_estimated_) return;
    info_ = std::max(info_ * parameters_.fading + turning, 0.0);
    weighted_ = weighted_ * parameters_.fading + turned;
    estimate_s_ = std::clamp(weighted_ / (info_ + prior_info_), -parameters_.readout_max_s, parameters_.readout_max_s);
}

bool RollingShutter::adopt() noexcept {
    if (!is_estimated_) return false;
    const double wanted = std::abs(estimate_s_) < parameters_.negligible_s ? 0.0 : estimate_s_;
    if (std::abs(wanted - readout_s_) < parameters_.step_s) return false;
    readout_s_ = wanted;
    return true;
}

}  // namespace stillmesh
