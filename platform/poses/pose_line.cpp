#include "platform/poses/pose_line.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>

#include "platform/evaluation/trajectory.hpp"

namespace stillmesh {
namespace {

struct Quaternion {
    double x, y, z, w;
};
[[nodiscard]] Quaternion operator*(const Quaternion& a, const Quaternion& b) {
    return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
[[nodiscard]] Quaternion conjugate(const Quaternion& q) {
    return {-q.x, -q.y, -q.z, q.w};
}
[[nodiscard]] Quaternion rotation_of(const RigidTransform& pose) {
    const auto [x, y, z, w] = pose.rotation_xyzw;
    return {x, y, z, w};
}
[[nodiscard]] Quaternion rotated(const Quaternion& q, double x, double y, double z) {
    return q * Quaternion{x, y, z, 0} * conjugate(q);
}

[[nodiscard]] RigidTransform product(const RigidTransform& a, const RigidTransform& b) {
    const Quaternion q = rotation_of(a) * rotation_of(b);
    const Quaternion t = rotated(rotation_of(a), b.translation_m[0], b.translation_m[1], b.translation_m[2]);
    return {{q.x, q.y, q.z, q.w}, {t.x + a.translation_m[0], t.y + a.translation_m[1], t.z + a.translation_m[2]}};
}

void append_numbers(std::span<const double> numbers, std::string& text) {
    text += '[';
    for (std::size_t i = 0; i < numbers.size(); ++i) {
        // JSON has no inf; what is not known that well is null.
        if (std::isfinite(numbers[i]))
            fmt::format_to(std::back_inserter(text), "{}{}", i > 0 ? "," : "", numbers[i]);
        else
            text += i > 0 ? ",null" : "null";
    }
    text += ']';
}

void append_transform(std::string_view key, const RigidTransform& pose, std::string& text) {
    fmt::format_to(std::back_inserter(text), ",\"{}\":{{\"p\":", key);
    append_numbers(pose.translation_m, text);
    text += ",\"q\":";
    append_numbers(pose.rotation_xyzw, text);
    text += '}';
}

// In the camera's frame at the end of the step.
void append_velocity(const RigidTransform& from, const RigidTransform& to, double seconds, std::string& text) {
    const Quaternion back = conjugate(rotation_of(to));
    const Quaternion way =
        rotated(back, to.translation_m[0] - from.translation_m[0], to.translation_m[1] - from.translation_m[1],
                to.translation_m[2] - from.translation_m[2]);
    Quaternion turn = conjugate(rotation_of(from)) * rotation_of(to);
    if (turn.w < 0) turn = {-turn.x, -turn.y, -turn.z, -turn.w};
    const double sine = std::sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z);
    const double angle_by_sine = sine > 1e-9 ? 2 * std::atan2(sine, turn.w) / sine : 2;
    text += ",\"velocity\":{\"linear\":";
    append_numbers(std::initializer_list<double>{way.x / seconds, way.y / seconds, way.z / seconds}, text);
    text += ",\"angular\":";
    const double factor = angle_by_sine / seconds;
    append_numbers(std::initializer_list<double>{turn.x * factor, turn.y * factor, turn.z * factor}, text);
    text += '}';
}

void begin(const char* type, std::int64_t time_ns, std::string& line) {
    line.clear();
    fmt::format_to(std::back_inserter(line), "{{\"schema\":{},\"type\":\"{}\",\"time\":", kPoseSchema, type);
    append_time(time_ns, line);
    fmt::format_to(std::back_inserter(line), ",\"time_ns\":{}", time_ns);
}

}  // namespace

void PoseLines::pose(const PoseReport& report, std::string& line) {
    const PoseEstimate& estimate = report.estimate;
    const FrameStatistics& statistics = report.statistics;
    begin("pose", estimate.time_ns, line);
    fmt::format_to(std::back_inserter(line), ",\"frame\":{},\"state\":\"{}\",\"reason\":", report.frame,
                   pose_state_name(report.state));
    if (report.state == PoseState::kTracked)
        line += "null";
    else
        fmt::format_to(std::back_inserter(line), "\"{}\"", report.reason);
    fmt::format_to(std::back_inserter(line), ",\"map\":{}", report.map);
    const bool has_pose = report.state != PoseState::kNone;
    const bool is_measured = report.state >= PoseState::kUnsure;
    if (has_pose) {
        append_transform("map_from_camera", product(estimate.map_from_odom, estimate.odom_from_camera), line);
        append_transform("odom_from_camera", estimate.odom_from_camera, line);
        append_transform("map_from_odom", estimate.map_from_odom, line);
    } else {
        line += ",\"map_from_camera\":null,\"odom_from_camera\":null";
        append_transform("map_from_odom", estimate.map_from_odom, line);
    }
    if (has_pose && has_last_ && estimate.time_ns > last_time_ns_) {
        append_velocity(last_odom_from_camera_, estimate.odom_from_camera,
                        static_cast<double>(estimate.time_ns - last_time_ns_) * 1e-9, line);
    } else {
        line += ",\"velocity\":null";
    }
    line += ",\"covariance\":";
    if (is_measured)
        append_numbers(estimate.covariance, line);
    else
        line += "null";
    fmt::format_to(std::back_inserter(line), ",\"features\":{},\"matches\":{},\"inliers\":{},\"moving\":{}",
                   statistics.features, statistics.matches, statistics.static_matches, statistics.dynamic_matches);
    fmt::format_to(std::back_inserter(line), ",\"is_keyframe\":{},\"keyframe\":", statistics.is_keyframe);
    if (report.keyframe == kNoKeyframe)
        line += "null}\n";
    else
        fmt::format_to(std::back_inserter(line), "{}}}\n", report.keyframe);
    has_last_ = has_pose;
    last_time_ns_ = estimate.time_ns;
    last_odom_from_camera_ = estimate.odom_from_camera;
}

void PoseLines::event(std::int64_t time_ns, std::string_view sentence, std::string& line) {
    begin("event", time_ns, line);
    line += ",\"sentence\":";
    line += nlohmann::json(sentence).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    line += "}\n";
}

}  // namespace stillmesh
