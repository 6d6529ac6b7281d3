#include "platform/cli/map_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "platform/cli/complaint.hpp"
#include "platform/cli/destinations.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/map_grid.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/record/map_content.hpp"

namespace stillmesh {
namespace {

using Json = nlohmann::ordered_json;

// What a person asks first of a map.
struct Facts {
    std::size_t moving = 0;
    double way_m = 0;                     // along the keyframes, as they were made
    std::array<double, 3> low{}, high{};  // of the points that stand still
    double observers = 0;                 // of a point, mean
};

[[nodiscard]] Facts facts_of(const SavedMap& map) {
    Facts facts;
    bool is_first = true;
    for (const SavedPoint& point : map.points) {
        facts.observers += point.observers;
        if (point.is_moving) {
            ++facts.moving;
            continue;
        }
        const std::array<double, 3> at = {point.x, point.y, point.z};
        for (std::size_t i = 0; i < 3; ++i) {
            facts.low[i] = is_first ? at[i] : std::min(facts.low[i], at[i]);
            facts.high[i] = is_first ? at[i] : std::max(facts.high[i], at[i]);
        }
        is_first = false;
    }
    if (!map.points.empty()) facts.observers /= static_cast<double>(map.points.size());
    std::vector<const SavedKeyframe*> in_order;
    for (const SavedKeyframe& keyframe : map.keyframes) in_order.push_back(&keyframe);
    std::sort(in_order.begin(), in_order.end(),
              [](const SavedKeyframe* a, const SavedKeyframe* b) { return a->frame < b->frame; });
    for (std::size_t i = 1; i < in_order.size(); ++i) {
        const auto& a = in_order[i - 1]->pose.t;
        const auto& b = in_order[i]->pose.t;
        facts.way_m += std::hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
    }
    return facts;
}

[[nodiscard]] Json info_json(const std::string& file, const SavedMap& map) {
    const Facts facts = facts_of(map);
    const MapFileInfo& info = map.info;
    return {{"file", file},
            {"bytes", info.size_bytes},
            {"version", info.version()},
            {"hash", fmt::format("{:016x}", info.hash)},
            {"keyframes", info.keyframes},
            {"points", info.points},
            {"points_moving", facts.moving},
            {"features", info.features},
            {"depth_images", info.depth_images},
            {"observers_mean", facts.observers},
            {"frames", info.frames},
            {"seconds", static_cast<double>(info.time_ns) * 1e-9},
            {"way_m", facts.way_m},
            {"low_m", facts.low},
            {"high_m", facts.high},
            {"extractor", info.extractor == 0   ? "native"
                          : info.extractor == 1 ? "opencv"
                                                : "another"},
            {"pyramid_levels", info.pyramid_levels},
            {"scale_factor", info.scale_factor},
            {"readout_s", map.readout_s},
            {"camera",
             {{"width", map.camera.width},
              {"height", map.camera.height},
              {"fx", map.camera.fx},
              {"fy", map.camera.fy},
              {"cx", map.camera.cx},
              {"cy", map.camera.cy},
              {"k1", map.camera.k1},
              {"k2", map.camera.k2},
              {"p1", map.camera.p1},
              {"p2", map.camera.p2},
              {"k3", map.camera.k3}}}};
}

// Text is made in one go and written whole: a point takes some 40 bytes.
using EachPoint = std::function<void(const SavedPoint&)>;
void for_each_point(const SavedMap& map, bool has_moving, const EachPoint& with) {
    for (const SavedPoint& point : map.points) {
        if (has_moving || !point.is_moving) with(point);
    }
}
[[nodiscard]] std::size_t count_points(const SavedMap& map, bool has_moving) {
    std::size_t count = 0;
    for_each_point(map, has_moving, [&count](const SavedPoint&) { ++count; });
    return count;
}

void append_points(const SavedMap& map, bool has_moving, std::string& text) {
    for_each_point(map, has_moving, [&text](const SavedPoint& p) {
        fmt::format_to(std::back_inserter(text), "{:.6f} {:.6f} {:.6f} {:.1f} {}\n", p.x, p.y, p.z, p.static_weight,
                       p.observers);
    });
}

// Stanford's polygon file and the Point Cloud Library's, both as text.
[[nodiscard]] std::string ply_text(const SavedMap& map, bool has_moving) {
    std::string text = fmt::format(
        "ply\nformat ascii 1.0\ncomment points of a stillmesh map, m, x right, y down, z forward of the first camera\n"
        "element vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty float static_weight\n"
        "property int observers\nend_header\n",
        count_points(map, has_moving));
    append_points(map, has_moving, text);
    return text;
}
[[nodiscard]] std::string pcd_text(const SavedMap& map, bool has_moving) {
    const std::size_t count = count_points(map, has_moving);
    std::string text = fmt::format(
        "# .PCD v0.7 - points of a stillmesh map, m, x right, y down, z forward of the first camera\nVERSION 0.7\n"
        "FIELDS x y z static_weight observers\nSIZE 4 4 4 4 4\nTYPE F F F F U\nCOUNT 1 1 1 1 1\nWIDTH {}\nHEIGHT 1\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
        count, count);
    append_points(map, has_moving, text);
    return text;
}
[[nodiscard]] std::string tum_text(const SavedMap& map) {
    std::vector<TrajectoryPose> poses;
    for (const SavedKeyframe& keyframe : map.keyframes) poses.push_back(keyframe.pose);
    std::sort(poses.begin(), poses.end(),
              [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.time_ns < b.time_ns; });
    std::string text = "# keyframes of a stillmesh map: timestamp tx ty tz qx qy qz qw (camera to world, s, m)\n";
    for (const TrajectoryPose& pose : poses) append_pose_line(pose, text);
    return text;
}
[[nodiscard]] std::string json_text(const std::string& file, const SavedMap& map, bool has_moving) {
    Json json = info_json(file, map);
    Json keyframes = Json::array(), points = Json::array(), links = Json::array();
    for (const SavedKeyframe& k : map.keyframes) {
        keyframes.push_back({{"frame", k.frame},
                             {"time_ns", k.pose.time_ns},
                             {"parent", k.parent == 0 ? Json(nullptr) : Json(map.keyframes[k.parent - 1].frame)},
                             {"p", k.pose.t},
                             {"q", k.pose.q},
                             {"features", k.features},
                             {"points", k.points}});
    }
    for_each_point(map, has_moving, [&points](const SavedPoint& p) {
        points.push_back({{"p", {p.x, p.y, p.z}},
                          {"variance_along_m2", p.along_m2},
                          {"variance_across_m2", p.across_m2},
                          {"static_weight", p.static_weight},
                          {"observers", p.observers},
                          {"seen", p.seen},
                          {"is_moving", p.is_moving}});
    });
    for (const KeyframeLink& link : covisible_keyframes(map)) {
        links.push_back({{"older", link.older_id}, {"newer", link.newer_id}, {"shared_points", link.shared_points}});
    }
    json["keyframe_list"] = std::move(keyframes);
    json["covisible_list"] = std::move(links);
    json["point_list"] = std::move(points);
    return json.dump(1) + "\n";
}

}  // namespace

int map_info_command(const std::string& file, bool is_json) {
    SavedMap map;
    std::string message;
    if (read_map_content(file, map, message) != Status::kOk) return refuse(message);
    if (is_json) return answer(info_json(file, map).dump(2) + "\n");
    const Facts facts = facts_of(map);
    const MapFileInfo& info = map.info;
    return answer(
        fmt::format("map           {}, {:.1f} MiB, version {}\n"
                    "content       {} keyframes, {} points ({} of them moving), {} features; a point is in {:.1f} "
                    "keyframes; {} depth "
                    "images\n"
                    "seen          {} frames over {:.0f} s, {:.1f} m of way from keyframe to keyframe\n"
                    "extent        {:.2f} m right, {:.2f} m down, {:.2f} m ahead, of points that stand still\n"
                    "camera        {}x{}, focal lengths {:.1f} and {:.1f} px, readout {:.1f} ms\n"
                    "features      {}, {} levels {:g} apart\n"
                    "hash          {:016x}\n",
                    printable(file), static_cast<double>(info.size_bytes) / 1048576.0, info.version(), info.keyframes,
                    info.points, facts.moving, info.features, facts.observers, info.depth_images, info.frames,
                    static_cast<double>(info.time_ns) * 1e-9, facts.way_m, facts.high[0] - facts.low[0],
                    facts.high[1] - facts.low[1], facts.high[2] - facts.low[2], map.camera.width, map.camera.height,
                    map.camera.fx, map.camera.fy, 1e3 * map.readout_s,
                    info.extractor == 0   ? "the engine's own"
                    : info.extractor == 1 ? "cv::ORB"
                                          : "of another extractor",
                    info.pyramid_levels, info.scale_factor, info.hash));
}

int map_export_command(const MapExport& options) {
    struct Output {
        const char* option;
        const std::string& path;
        std::function<std::string(const SavedMap&)> text;
    };
    const bool has_moving = options.has_moving;
    const Output outputs[] = {
        {"--ply", options.ply, [=](const SavedMap& map) { return ply_text(map, has_moving); }},
        {"--pcd", options.pcd, [=](const SavedMap& map) { return pcd_text(map, has_moving); }},
        {"--tum", options.tum, [](const SavedMap& map) { return tum_text(map); }},
        {"--json", options.json, [&](const SavedMap& map) { return json_text(options.file, map, has_moving); }}};
    std::vector<Destination> destinations;
    for (const Output& output : outputs) {
        if (!output.path.empty()) destinations.push_back({output.option, output.path, DestinationKind::kWhole});
    }
    add_grid_destinations(options.grid, options.octomap, destinations);
    if (destinations.empty()) {
        return refuse(
            "map export: name what to write: --ply, --pcd, --tum, --json, --cloud or --octomap FILE, or --grid NAME.");
    }
    if (options.grid.base_from_camera_link && !options.grid.is_any() && options.octomap.empty())
        return refuse("--base-from-camera: says where a grid lies; give --grid, --cloud or --octomap as well.");
    const Origin origins[] = {{"the map", options.file}};
    if (const std::string problem = check_destinations(destinations, origins); !problem.empty()) {
        return refuse(problem);
    }
    SavedMap map;
    std::string message;
    if (read_map_content(options.file, map, message) != Status::kOk) return refuse(message);
    int code = kExitDone;
    if (options.grid.is_any() || !options.octomap.empty())
        code = write_grid_of(map, options.file, options.grid, options.octomap);
    if (code == kExitUsage) return code;
    for (const Output& output : outputs) {
        if (output.path.empty()) continue;
        if (!write_whole_file(output.path, output.text(map), message)) {
            complain(message);
            return kExitFailed;
        }
    }
    return code;
}

}  // namespace stillmesh
