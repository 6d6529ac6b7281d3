#include "platform/poses/pose_line.hpp"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>

#include "platform/evaluation/trajectory.hpp"
#include "platform/poses/velocity.hpp"

namespace stillmesh {
namespace {

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

void append_velocity(const Velocity& velocity, std::string& text) {
    text += ",\"velocity\":{\"linear\":";
    append_numbers(velocity.linear_m_s, text);
    text += ",\"angular\":";
    append_numbers(velocity.angular_rad_s, text);
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
        append_transform("map_from_camera", compose(estimate.map_from_odom, estimate.odom_from_camera), line);
        append_transform("odom_from_camera", estimate.odom_from_camera, line);
        append_transform("map_from_odom", estimate.map_from_odom, line);
    } else {
        line += ",\"map_from_camera\":null,\"odom_from_camera\":null";
        append_transform("map_from_odom", estimate.map_from_odom, line);
    }
    if (has_pose && has_last_ && estimate.time_ns > last_time_ns_) {
        append_velocity(velocity_between(last_odom_from_camera_, estimate.odom_from_camera,
                                         static_cast<double>(estimate.time_ns - last_time_ns_) * 1e-9),
                        line);
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
