#include "platform/view/view_message.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <span>

#include "platform/report/picture_writer.hpp"
#include "platform/view/shown_links.hpp"

namespace stillmesh {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers go out as they lie in memory");

template <typename T>
void append_bytes(std::string_view key, std::span<const T> values, std::string& text) {
    fmt::format_to(std::back_inserter(text), ",\"{}\":\"", key);
    text += base64({reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()});
    text += '"';
}

void append_pose(const RigidTransform& pose, std::string& text) {
    text += '[';
    bool is_first = true;
    const auto put = [&](double value) {
        fmt::format_to(std::back_inserter(text), "{}{:.6g}", is_first ? "" : ",", std::isfinite(value) ? value : 0.0);
        is_first = false;
    };
    for (const double value : pose.translation_m) put(value);
    for (const double value : pose.rotation_xyzw) put(value);
    text += ']';
}

void append_picture(const ViewSnapshot& s, std::string& text) {
    fmt::format_to(std::back_inserter(text), ",\"image\":[{},{}],\"picture\":", s.image_width, s.image_height);
    Frame picture;
    picture.colour = {s.grey.data(), s.picture_width, s.picture_height, s.picture_width};
    const std::vector<std::uint8_t> png = s.grey.empty() ? std::vector<std::uint8_t>() : encode_grey_png(picture);
    text += png.empty() ? "null" : "\"" + base64(png) + "\"";
}

void append_pool(std::string_view name, const PoolStatistics& pool, std::string& text) {
    fmt::format_to(std::back_inserter(text), "{{\"name\":\"{}\",\"now\":{},\"most\":{},\"limit\":{}}}", name, pool.size,
                   pool.high_water, pool.capacity);
}

void append_keyframes(std::span<const KeyframePose> keyframes, std::string& text) {
    text += ",\"keyframes\":[";
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
        fmt::format_to(std::back_inserter(text), "{}[{},", i > 0 ? "," : "", keyframes[i].id);
        append_pose(keyframes[i].map_from_camera, text);
        text += ']';
    }
    text += ']';
}

}  // namespace

void compose_view_frame(const ViewSnapshot& s, std::string& text) {
    text.clear();
    const bool has_pose = s.state != PoseState::kNone;
    fmt::format_to(std::back_inserter(text), "{{\"schema\":{},\"frame\":{},\"time\":{:.3f},\"map\":{},\"state\":\"{}\"",
                   kViewSchema, s.frame, static_cast<double>(s.time_ns) * 1e-9, s.map, pose_state_name(s.state));
    fmt::format_to(std::back_inserter(text),
                   ",\"reason\":\"{}\",\"pose\":", s.state == PoseState::kTracked ? "" : s.reason);
    if (has_pose)
        append_pose(s.map_from_camera, text);
    else
        text += "null";
    const FrameStatistics& statistics = s.statistics;
    fmt::format_to(std::back_inserter(text), ",\"found\":{},\"matched\":{},\"static\":{},\"moving\":{},\"groups\":{}",
                   statistics.features, statistics.matches, statistics.static_matches, statistics.dynamic_matches,
                   statistics.groups);
    fmt::format_to(std::back_inserter(text), ",\"chosen_percent\":{:.0f},\"rival_percent\":{:.0f}",
                   100 * statistics.chosen_share, 100 * statistics.rival_share);
    append_picture(s, text);
    append_bytes("kept", std::span<const ShownEdge>(s.kept), text);
    append_bytes("cut", std::span<const ShownEdge>(s.cut), text);
    append_bytes("features", std::span<const ShownFeature>(s.features), text);
    append_keyframes(s.keyframes, text);
    const ShownLinks links(s.keyframes, s.links);
    append_bytes("covisible", std::span<const ShownLinks::Pair>(links.covisible), text);
    append_bytes("loops", std::span<const ShownLinks::Pair>(links.loops), text);
    fmt::format_to(std::back_inserter(text), ",\"ms\":{:.2f},\"budget_ms\":{:.2f},\"stages\":[", s.frame_ms,
                   s.budget_ms);
    for (std::uint32_t i = 0; i < kStages; ++i) {
        fmt::format_to(std::back_inserter(text), "{}[\"{}\",{:.3f}]", i > 0 ? "," : "",
                       stage_name(static_cast<Stage>(i)), s.stage_ms[i]);
    }
    text += "],\"pools\":[";
    append_pool("keyframes", s.keyframe_pool, text);
    text += ',';
    append_pool("map points", s.point_pool, text);
    text += ',';
    append_pool("mapping queue", s.queue_pool, text);
    text += "]}";
}

void compose_view_news(const ViewNews& news, std::string& text) {
    text.clear();
    if (!news.is_new_map && news.places.empty() && news.clouds.empty() && news.events.empty()) return;
    fmt::format_to(std::back_inserter(text), "{{\"new_map\":{},\"path_begin\":{}", news.is_new_map, news.places_begin);
    append_bytes("path", std::span<const ViewPlace>(news.places), text);
    text += ",\"clouds\":[";
    for (std::size_t i = 0; i < news.clouds.size(); ++i) {
        const ViewCloud& cloud = news.clouds[i];
        fmt::format_to(std::back_inserter(text), "{}{{\"keyframe\":{}", i > 0 ? "," : "", cloud.keyframe);
        append_bytes("points", std::span<const ViewCloud::Point>(cloud.points.data(), cloud.count), text);
        text += '}';
    }
    text += "],\"events\":";
    text += nlohmann::json(news.events).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    text += '}';
}

void compose_view_control(const ViewCommands& commands, const ViewDownloads& downloads, bool may_steer,
                          std::string& text) {
    const ViewControls controls = commands.controls();
    const ViewStanding standing = commands.standing();
    text = fmt::format(
        "{{\"may_steer\":{},\"can_pause\":{},\"can_save\":{},\"can_reset\":{},\"can_save_map\":{},\"can_localise\":{},"
        "\"paused\":{},\"saving\":{},\"speed\":{},\"localising\":{},\"take\":[",
        may_steer, controls.can_pause, controls.can_save, controls.can_reset, controls.can_save_map,
        controls.can_localise, standing.is_paused, standing.is_saving, standing.speed, standing.is_localising);
    const char* between = "";
    for (std::size_t i = 0; i < kViewDownloads.size(); ++i) {
        if (downloads.file(i).empty()) continue;
        fmt::format_to(std::back_inserter(text), "{}\"{}\"", between, kViewDownloads[i].path);
        between = ",";
    }
    text += "]}";
}

void compose_view_poses(const std::vector<ViewPose>& poses, bool is_csv, std::string& text) {
    text = is_csv ? "time_s,state,x_m,y_m,z_m,qx,qy,qz,qw\n"
                  : "# timestamp tx ty tz qx qy qz qw (camera to world, s, m)\n";
    for (const ViewPose& pose : poses) {
        const float marked = pose.place.state;
        const auto state = static_cast<PoseState>(marked >= kViewPlaceGap ? marked - kViewPlaceGap : marked);
        const std::int64_t second = pose.time_ns / 1'000'000'000, rest = pose.time_ns % 1'000'000'000;
        if (!is_csv && state < PoseState::kUnsure) continue;
        const char gap = is_csv ? ',' : ' ';
        fmt::format_to(std::back_inserter(text), "{}.{:09}", second, rest);
        if (is_csv) fmt::format_to(std::back_inserter(text), ",{}", pose_state_name(state));
        for (const float value :
             {pose.place.x, pose.place.y, pose.place.z, pose.q[0], pose.q[1], pose.q[2], pose.q[3]}) {
            fmt::format_to(std::back_inserter(text), "{}{:.7g}", gap, value);
        }
        text += '\n';
    }
}

}  // namespace stillmesh
