#include "platform/mavlink/mavlink_output.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

constexpr std::int64_t kBeat_ns = 1'000'000'000;
constexpr std::size_t kSix = 6;
// Of x, y, z and the rotations about them, from ROS's axes to MAVLink's.
constexpr std::array<double, kSix> kSign = {1, -1, -1, 1, -1, -1};

template <std::size_t kCount, typename Numbers>
[[nodiscard]] std::array<float, kCount> turned(const Numbers& numbers) {
    std::array<float, kCount> out{};
    for (std::size_t i = 0; i < kCount; ++i) out[i] = static_cast<float>(kSign[i] * numbers[i]);
    return out;
}

// The upper triangle of a covariance in ROS's axes, in MAVLink's.
[[nodiscard]] MavlinkCovariance triangle_of(const Covariance6& covariance) {
    MavlinkCovariance out{};
    std::size_t at = 0;
    for (std::size_t i = 0; i < kSix; ++i) {
        for (std::size_t j = i; j < kSix; ++j) {
            out[at++] = static_cast<float>(kSign[i] * kSign[j] * covariance[kSix * i + j]);
        }
    }
    return out;
}

// Positions into the parent's axes; rotations stay about the body's.
[[nodiscard]] Covariance6 positions_in_parent(const Covariance6& in_body, const RigidTransform& parent_from_body) {
    Covariance6 out = in_parent(in_body, parent_from_body);  // its positions are right
    const RotationMatrix r = matrix_of(parent_from_body.rotation_xyzw);
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 3; j < kSix; ++j) {
            double sum = 0;
            for (std::size_t k = 0; k < 3; ++k) sum += r[3 * i + k] * in_body[kSix * k + j];
            out[kSix * i + j] = out[kSix * j + i] = sum;
            out[kSix * (i + 3) + j] = in_body[kSix * (i + 3) + j];
        }
    }
    return out;
}

// Turned about z by yaw, then about the new y by pitch, then about the new x by roll.
[[nodiscard]] std::array<float, 3> roll_pitch_yaw(const std::array<float, 4>& rotation_wxyz) {
    const double w = rotation_wxyz[0], x = rotation_wxyz[1], y = rotation_wxyz[2], z = rotation_wxyz[3];
    return {static_cast<float>(std::atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))),
            static_cast<float>(std::asin(std::clamp(2 * (w * y - z * x), -1.0, 1.0))),
            static_cast<float>(std::atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))};
}

[[nodiscard]] bool are_equal(const RigidTransform& a, const RigidTransform& b) {
    return std::equal(std::begin(a.translation_m), std::end(a.translation_m), std::begin(b.translation_m)) &&
           std::equal(std::begin(a.rotation_xyzw), std::end(a.rotation_xyzw), std::begin(b.rotation_xyzw));
}

}  // namespace

bool MavlinkPoses::frame(const PoseReport& report) {
    const BodyStep& step = course_.follow(report);
    if (step.is_next) fill(report, step);
    return step.is_next;
}

void MavlinkPoses::fill(const PoseReport& report, const BodyStep& step) {
    const PoseEstimate& estimate = report.estimate;
    const bool is_jump =
        has_sent_ && (sent_map_ != report.map || !are_equal(sent_map_from_odom_, estimate.map_from_odom));
    has_sent_ = true;
    sent_map_ = report.map;
    sent_map_from_odom_ = estimate.map_from_odom;
    MavlinkOdometry& out = odometry_;
    if (is_jump) ++out.reset_counter;

    const RigidTransform base = frames_.of_base(compose(estimate.map_from_odom, estimate.odom_from_camera));
    const auto& [x, y, z, w] = base.rotation_xyzw;
    out.time_us = static_cast<std::uint64_t>(std::max<std::int64_t>(estimate.time_ns, 0) / 1000);
    out.position_m = turned<3>(base.translation_m);
    const std::array<float, 3> axis = turned<3>(std::array<double, 3>{x, y, z});
    out.rotation_wxyz = {static_cast<float>(w), axis[0], axis[1], axis[2]};
    out.velocity_m_s = turned<3>(step.velocity.linear_m_s);
    out.turn_rad_s = turned<3>(step.velocity.angular_rad_s);
    out.pose_covariance = triangle_of(positions_in_parent(step.covariance, base));
    out.velocity_covariance = triangle_of(step.velocity_covariance);
    out.quality_percent = report.state == PoseState::kTracked ? 100 : report.state == PoseState::kUnsure ? 30 : 10;

    vision_ = {out.time_us, out.position_m, roll_pitch_yaw(out.rotation_wxyz), out.pose_covariance, out.reset_counter};
}

bool MavlinkOutput::open(const MavlinkOptions& options, std::string& message) {
    if (options.destination.empty()) return true;
    if (!options.destination.starts_with("udp:")) {
        message = "--mavlink " + options.destination +
                  ": give udp:HOST:PORT; to a serial line leads mavlink-router (docs/mavlink.md).";
        return false;
    }
    output_ = open_line_output(options.destination, {.option = "--mavlink", .what = "messages"}, message);
    message_ = options.message;
    poses_ = MavlinkPoses(options.base_from_camera_link);
    messages_ = MavlinkMessages(options.system);
    return output_ != nullptr;
}

std::string MavlinkOutput::frame(const PoseReport& report) {
    if (output_ == nullptr) return {};
    std::string said;
    const std::int64_t time_ns = report.estimate.time_ns;
    if (!has_beaten_ || time_ns - beat_ns_ >= kBeat_ns || time_ns < beat_ns_) {
        has_beaten_ = true;
        beat_ns_ = time_ns;
        said = output_->write(messages_.heartbeat());
    }
    if (!poses_.frame(report)) return said;
    std::string more = output_->write(message_ == MavlinkMessage::kVision ? messages_.vision(poses_.vision())
                                                                          : messages_.odometry(poses_.odometry()));
    return said.empty() ? more : said;
}

}  // namespace stillmesh
