#include "hal/simulated/hand.hpp"

#include "engine/base/random.hpp"

namespace stillmesh::simulated {
namespace {

constexpr double kShakeM = 0.0018, kShakeRad = radians(0.5);  // the three waves of an axis together
constexpr double kAsideRad = radians(60), kAsideRad_s = radians(100), kAsideEveryS = 5.0;
constexpr double kAsideFirstS = 2.0;  // of each period
constexpr double kAsideHoldS = 0.2;
// A smooth step is steepest in its middle, 1.5 times its mean.
constexpr double kAsideTurnS = 1.5 * kAsideRad / kAsideRad_s;

}  // namespace

Hand::Hand(const Dirt& dirt, std::uint64_t seed) : shake_(dirt.shake), aside_(dirt.aside) {
    Random random(seed ^ 0x6861'6e64'0000'0001ULL);
    for (int axis = 0; axis < kAxes; ++axis) {
        for (int i = 0; i < kWaves; ++i) {
            phase_[axis][i] = random.uniform(0, 2 * kPi);
            frequency_hz_[axis][i] = random.uniform(8, 12);
        }
    }
    first_side_ = random.uniform() < 0.5 ? -1 : 1;
}

double Hand::aside_rad(double time_s) const noexcept {
    if (!(aside_ > 0) || time_s < 0) return 0;
    const auto period = static_cast<double>(floor_clamped(time_s / kAsideEveryS, 0, 1'000'000));
    const double t = time_s - period * kAsideEveryS - kAsideFirstS;
    const double there = smooth_step(t / kAsideTurnS);
    const double back = smooth_step((t - kAsideTurnS - kAsideHoldS) / kAsideTurnS);
    const double side = floor_clamped(period, 0, 1'000'000) % 2 == 0 ? first_side_ : -first_side_;
    return aside_ * kAsideRad * side * (there - back);
}

Rigid Hand::carry(const Rigid& world_from_camera, double time_s) const noexcept {
    Rigid pose = world_from_camera;
    if (aside_ > 0) pose.rotation = rotation_z(aside_rad(time_s)) * pose.rotation;
    if (shake_ > 0) {
        double value[kAxes];
        for (int axis = 0; axis < kAxes; ++axis) {
            double sum = 0;
            for (int i = 0; i < kWaves; ++i) {
                sum += sine(2 * kPi * frequency_hz_[axis][i] * time_s + phase_[axis][i]);
            }
            value[axis] = shake_ * sum / kWaves;
        }
        pose.translation = pose * (Vec3{value[0], value[1], value[2]} * kShakeM);
        pose.rotation = pose.rotation * (rotation_y(kShakeRad * value[3]) *
                                         (rotation_x(kShakeRad * value[4]) * rotation_z(kShakeRad * value[5])));
    }
    return pose;
}

}  // namespace stillmesh::simulated
