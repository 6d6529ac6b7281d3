#include "platform/motion/motion_samples.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

double share_of(std::int64_t time_ns, std::int64_t from_ns, std::int64_t to_ns) {
    return to_ns == from_ns ? 0.0 : static_cast<double>(time_ns - from_ns) / static_cast<double>(to_ns - from_ns);
}

template <typename Item>
auto first_from(const std::vector<Item>& items, std::int64_t time_ns) {
    return std::lower_bound(items.begin(), items.end(), time_ns,
                            [](const Item& item, std::int64_t time) { return item.time_ns < time; });
}

}  // namespace

std::optional<TrajectoryPose> MotionSamples::pose_at(std::int64_t time_ns) const {
    const auto next = first_from(odometry, time_ns);
    if (next == odometry.end()) return std::nullopt;
    if (next->time_ns == time_ns) return *next;
    if (next == odometry.begin() || next->time_ns - (next - 1)->time_ns > kGapMax_ns) return std::nullopt;
    const TrajectoryPose& last = *(next - 1);
    return between(last, *next, share_of(time_ns, last.time_ns, next->time_ns));
}

// The rate between two lines goes evenly from one to the other.
std::optional<Quaternion> MotionSamples::turn_between(std::int64_t from_ns, std::int64_t to_ns) const {
    if (gyroscope.empty() || from_ns < gyroscope.front().time_ns || to_ns > gyroscope.back().time_ns) {
        return std::nullopt;
    }
    Quaternion out{0, 0, 0, 1};
    auto next = first_from(gyroscope, from_ns);
    if (next == gyroscope.begin()) ++next;
    for (std::int64_t at_ns = from_ns; at_ns < to_ns; ++next) {
        const TurningRate& a = *(next - 1);
        const TurningRate& b = *next;
        if (b.time_ns - a.time_ns > kGapMax_ns) return std::nullopt;
        const std::int64_t until_ns = std::min(b.time_ns, to_ns);
        const double middle = share_of(at_ns + (until_ns - at_ns) / 2, a.time_ns, b.time_ns);
        const double seconds = static_cast<double>(until_ns - at_ns) * 1e-9;
        Triple turn{};
        for (std::size_t i = 0; i < 3; ++i) turn[i] = seconds * (a.rad_s[i] + middle * (b.rad_s[i] - a.rad_s[i]));
        out = product(out, quaternion_of(turn));
        at_ns = until_ns;
    }
    return out;
}

std::optional<MotionHint> MotionSamples::between_times(std::int64_t from_ns, std::int64_t to_ns) const {
    constexpr double kMost_m = 100;  // no camera leaps so far from frame to frame
    constexpr double kMost_rad = 3;  // nothing is known of a turn then
    MotionHint out;
    const auto from = pose_at(from_ns);
    const auto to = pose_at(to_ns);
    if (from && to) {
        const RigidTransform step = step_between(*from, *to);
        const double* const q = step.rotation_xyzw;
        const double way_m = length_of({step.translation_m[0], step.translation_m[1], step.translation_m[2]});
        if (way_m < kMost_m) {  // also not where it is no number
            out.last_from_camera = step;
            out.sigma_m = errors.way_share * way_m + errors.step_m;
            out.sigma_rad =
                errors.turn_share * length_of(rotation_vector_of({q[0], q[1], q[2], q[3]})) + errors.step_rad;
        }
    }
    if (const auto turn = turn_between(from_ns, to_ns)) {
        const double sigma_rad =
            (errors.gyro_rad_s + errors.gyro_noise_rad_s) * static_cast<double>(to_ns - from_ns) * 1e-9;
        if (sigma_rad < kMost_rad && (out.sigma_rad < 0 || sigma_rad < out.sigma_rad)) {
            std::copy(turn->begin(), turn->end(), out.last_from_camera.rotation_xyzw);
            out.sigma_rad = sigma_rad;
        }
    }
    if (out.sigma_m < 0 && out.sigma_rad < 0) return std::nullopt;
    return out;
}

}  // namespace stillmesh
