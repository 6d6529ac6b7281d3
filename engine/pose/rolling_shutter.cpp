#include "engine/pose/rolling_shutter.hpp"

#include <algorithm>
#include <cmath>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

// Residuals of one frame share errors that no model has (the map's, the motion's within the frame): a frame counts less
// than its matches say. Old frames fade within a second, since the map they were held against was made with the readout
// believed then, and agrees with it: what a frame finds is a part of what is missing, and so is taken twice.
constexpr double kTrust = 0.1;
constexpr double kFade = 0.95;
constexpr double kGain = 2.0;
constexpr std::uint32_t kUsedMin = 30;
// A tenth of what such cameras take: not worth being moved by, and within what a global shutter is estimated at.
constexpr double kNegligible_s = 0.003;
constexpr double kPriorInfo = 1.0 / (RollingShutter::kReadoutSigma_s * RollingShutter::kReadoutSigma_s);
// Frames that know next to nothing (the camera stands still) do not make what is known fade.
constexpr double kInfoMin = 0.01 * kPriorInfo;

}  // namespace

void RollingShutter::create(double readout_s, std::uint32_t image_height) noexcept {
    given_s_ = readout_s;
    is_estimated_ = readout_s < 0;
    inverse_height_ = 1.0 / static_cast<double>(image_height);
    reset();
}

void RollingShutter::reset() noexcept {
    readout_s_ = is_estimated_ ? 0.0 : given_s_;
    info_ = 0;
    weighted_ = 0;
}

Vector3 RollingShutter::at_middle_row(const Vector3& p, double row_time_s, const Vector6& speed) noexcept {
    return moved_a_little(speed * row_time_s, p);
}

void RollingShutter::begin_frame() noexcept {
    h_.setZero();
    g_.setZero();
    cross_.setZero();
    h_readout_ = 0;
    g_readout_ = 0;
    used_ = 0;
}

void RollingShutter::add(const Correspondence& c, const Vector3& q, double y_px, const Vector6& speed,
                         double chi2_max) noexcept {
    if (!c.has_depth || q.z() < kDepthMin_m) return;
    const Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
    if (r.chi2() > chi2_max) return;
    const double iz = 1.0 / q.z();
    const double x = q.x() * iz;
    const double y = q.y() * iz;
    const double row = y_px * inverse_height_ - 0.5;
    // Of the measured point by the readout time; the residual is the map's minus the measured.
    const Vector3 w(speed(3), speed(4), speed(5));
    Vector3 d = w.cross(c.p_camera);
    d += Vector3(speed(0), speed(1), speed(2));
    d *= row;
    const double inverse = 1.0 / c.p_camera.z();
    const double by_x = -(d.x() - c.normalised.x() * d.z()) * inverse;
    const double by_y = -(d.y() - c.normalised.y() * d.z()) * inverse;
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
    take(row_z, -d.z(), r.z, r.info_z);
    ++used_;
}

void RollingShutter::end_frame() noexcept {
    if (!is_estimated_ || used_ < kUsedMin) return;
    Matrix6 inverse;
    if (!invert_spd(h_, inverse)) return;
    Vector6 solved;
    solved.noalias() = inverse * cross_;
    double info = h_readout_;
    double gradient = g_readout_;
    for (int i = 0; i < 6; ++i) {
        info -= cross_(i) * solved(i);
        gradient -= g_(i) * solved(i);
    }
    if (!(info > 1.0)) return;
    const double found = std::clamp(readout_s_ - kGain * gradient / info, -kReadoutMax_s, kReadoutMax_s);
    info *= kTrust;
    if (info < kInfoMin) return;
    info_ = info_ * kFade + info;
    weighted_ = weighted_ * kFade + info * found;
    const double estimate = std::clamp(weighted_ / (info_ + kPriorInfo), -kReadoutMax_s, kReadoutMax_s);
    readout_s_ = std::abs(estimate) < kNegligible_s ? 0.0 : estimate;
}

}  // namespace stillmesh
