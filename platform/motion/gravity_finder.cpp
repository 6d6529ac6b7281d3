#include "platform/motion/gravity_finder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

constexpr double kGravityWithin_m_s2 = 0.5;
constexpr std::int64_t kGapMax_ns = 250'000'000;  // between frames with readings
constexpr double kPart_s = 1.0;

double dot(const Triple& a, const Triple& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Triple cross(const Triple& a, const Triple& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
void add_to(Triple& sum, const Triple& v, double factor) {
    for (std::size_t i = 0; i < 3; ++i) sum[i] += factor * v[i];
}
Triple times(const Triple& v, double factor) {
    return {v[0] * factor, v[1] * factor, v[2] * factor};
}

}  // namespace

void copy_between(const std::vector<Acceleration>& readings, std::int64_t after_ns, std::int64_t to_ns,
                  std::vector<Acceleration>& out) {
    const auto first_after = [&](std::int64_t time_ns) {
        return std::upper_bound(readings.begin(), readings.end(), time_ns,
                                [](std::int64_t time, const Acceleration& reading) { return time < reading.time_ns; });
    };
    out.assign(first_after(after_ns), first_after(std::max(after_ns, to_ns)));
}

void AccelerationList::between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const {
    copy_between(readings, after_ns, to_ns, out);
}

std::optional<Triple> GravityFinder::mean_between(const TrajectoryPose& from, const TrajectoryPose& to) {
    source_->between(from.time_ns, to.time_ns, readings_);
    Triple sum{};
    for (const Acceleration& reading : readings_) {
        const double share =
            static_cast<double>(reading.time_ns - from.time_ns) / static_cast<double>(to.time_ns - from.time_ns);
        add_to(sum, rotated(between(from, to, share).q, reading.m_s2), 1);
    }
    if (readings_.empty()) return std::nullopt;
    return times(sum, 1.0 / static_cast<double>(readings_.size()));
}

void GravityFinder::add(const TrajectoryPose& pose, const Quaternion& map_from_odom) {
    if (source_ == nullptr) return;
    const std::int64_t since_ns = last_ ? pose.time_ns - last_->time_ns : 0;
    if (since_ns <= 0 || since_ns > kGapMax_ns) {
        has_part_ = false;
        last_ = pose;
        return;
    }
    const std::optional<Triple> measured = mean_between(*last_, pose);
    if (!measured) return;  // lost, or rarer than frames: the next ones are of the time since the last
    const TrajectoryPose last = *last_;
    last_ = pose;
    const double seconds = static_cast<double>(since_ns) * 1e-9;
    for (std::size_t i = 0; i < 3; ++i) speed_[i] = (pose.t[i] - last.t[i]) / seconds;
    if (!has_part_) {
        has_part_ = true;
        speed_begin_ = speed_;
        sum_ = {};
        part_s_ = 0;
        return;
    }
    add_to(sum_, *measured, seconds);
    part_s_ += seconds;
    if (part_s_ >= kPart_s) end_part(map_from_odom);
}

void GravityFinder::end_part(const Quaternion& map_from_odom) {
    Triple part = sum_;
    add_to(part, speed_, -1);
    add_to(part, speed_begin_, 1);
    part = rotated(map_from_odom, times(part, 1 / part_s_));
    ++parts_;
    add_to(total_, part, 1);
    squares_ += dot(part, part);
    seconds_ += part_s_;
    speed_begin_ = speed_;
    sum_ = {};
    part_s_ = 0;
}

Gravity GravityFinder::gravity() const {
    Gravity out;
    out.seconds = seconds_;
    if (parts_ < kPartsMin) {
        out.why_not = fmt::format(
            "{:.0f} s have both poses and readings, and {} are needed; are its times those of the camera's clock?",
            seconds_, kPartsMin);
        return out;
    }
    const double n = parts_;
    const Triple mean = times(total_, 1 / n);
    const double length = length_of(mean);
    const double spread2 = std::max(0.0, squares_ - n * dot(mean, mean)) / (n - 1);
    const double apart_rad = std::sqrt(spread2 / n) / length;
    const double off_m_s2 = std::abs(length - kGravity_m_s2);
    if (off_m_s2 < 0.5 * kGravity_m_s2 && apart_rad > kDoubtMax_rad) {
        out.why_not = fmt::format(
            "its readings do not agree on where up is, by {:.1f} degrees; are they in the camera's axes (x right, y "
            "down, z forward)?",
            apart_rad * 57.295779513082323);
        return out;
    }
    if (!(off_m_s2 <= kGravityWithin_m_s2)) {  // nor where it is no number
        out.why_not = fmt::format("its readings are {:.2f} in the mean, not 9.8; are they in m/s^2?", length);
        return out;
    }
    out.up = times(mean, 1 / length);
    out.doubt_rad = std::sqrt(spread2 / n + kBias_m_s2 * kBias_m_s2) / length;
    out.is_known = true;
    return out;
}

RigidTransform level_from_up(const Triple& up) {
    Triple right = cross({0, 0, 1}, up);
    if (length_of(right) < 0.1) right = cross({0, -1, 0}, up);
    right = times(right, 1 / length_of(right));
    const Triple ahead = cross(up, right);
    RigidTransform out;
    write_quaternion({ahead[0], ahead[1], ahead[2], -right[0], -right[1], -right[2], up[0], up[1], up[2]},
                     out.rotation_xyzw);
    return out;
}

}  // namespace stillmesh
