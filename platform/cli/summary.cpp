#include "platform/cli/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace stillmesh {
namespace {

using Json = nlohmann::ordered_json;

[[nodiscard]] double mib(std::size_t bytes) {
    return static_cast<double>(bytes) / (1024.0 * 1024.0);
}

[[nodiscard]] Json number(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

[[nodiscard]] Json json_of(const Evaluation& e) {
    return {{"pairs", e.pairs.size()},
            {"ate_rmse_m", number(e.ate_rmse_m)},
            {"ate_mean_m", number(e.ate_mean_m)},
            {"ate_median_m", number(e.ate_median_m)},
            {"ate_max_m", number(e.ate_max_m)},
            {"rpe_pairs", e.rpe_pairs},
            {"rpe_translation_rmse_m", number(e.rpe_translation_rmse_m)},
            {"rpe_rotation_rmse_deg", number(e.rpe_rotation_rmse_deg)},
            {"scale", number(e.scale)},
            {"coverage", number(e.coverage)}};
}

[[nodiscard]] Json json_of(const StreamRecord& streams) {
    Json stuck = Json::array();
    for (const StreamRecord::Episode& e : streams.stuck) {
        stuck.push_back({{"stream", e.stream}, {"second", e.second}, {"length_s", e.length_s}, {"frames", e.frames}});
    }
    return {{"times_stuck", streams.times_stuck},     {"colour_repeats", streams.colour_repeats},
            {"depth_repeats", streams.depth_repeats}, {"stuck", stuck},
            {"no_depth_s", streams.no_depth_s},       {"no_depth_longest_s", streams.no_depth_longest_s}};
}

[[nodiscard]] std::string streams_text(const StreamRecord& streams) {
    if (streams.colour_repeats + streams.depth_repeats == 0) return {};
    std::string text = fmt::format("streams       stuck {}; {} colour and {} depth images repeat, without a pose",
                                   streams.times_stuck == 1 ? "once" : fmt::format("{} times", streams.times_stuck),
                                   streams.colour_repeats, streams.depth_repeats);
    for (std::size_t i = 0; i < streams.stuck.size() && i < 3; ++i) {
        const StreamRecord::Episode& e = streams.stuck[i];
        text += fmt::format("; {} for {:.1f} s from second {:.1f} on", e.stream, e.length_s, e.second);
    }
    return text + "\n";
}

[[nodiscard]] std::string grid_line(const GridRecord& g) {
    std::string text = fmt::format("grid          {}", g.grid.empty() ? "none" : g.grid);
    if (!g.grid.empty()) text += fmt::format(": {}x{} cells{}", g.width, g.height, g.is_cut ? ", cut off" : "");
    if (!g.cloud.empty()) text += fmt::format("; cloud {}{}", g.cloud, g.is_level ? ", level" : "");
    text += g.has_floor ? fmt::format("; floor {:.0f} % of what was seen", 100 * g.floor_share) : "; floor unknown";
    return text + fmt::format("; of {} depth images in {:.0f} ms, {:.1f} MiB\n", g.looks, g.build_ms,
                              static_cast<double>(g.memory_bytes) / (1024.0 * 1024.0));
}

[[nodiscard]] std::string gravity_line(const GravityRecord& g) {
    if (!g.is_asked) return {};
    if (!g.is_known) return "gravity       unknown: " + g.why_not + "\n";
    return fmt::format("gravity       up is {:.4f} {:.4f} {:.4f} in the map, to {:.1f} degrees, of {:.0f} s\n", g.up[0],
                       g.up[1], g.up[2], g.doubt_degrees, g.seconds);
}

}  // namespace

std::string evaluation_text(const Evaluation& e) {
    std::string text =
        fmt::format("ATE           {:.4f} m RMSE (mean {:.4f}, median {:.4f}, max {:.4f}) over {} poses\n",
                    e.ate_rmse_m, e.ate_mean_m, e.ate_median_m, e.ate_max_m, e.pairs.size());
    if (e.rpe_pairs > 0) {
        text += fmt::format("RPE           {:.4f} m, {:.3f} degrees RMSE over 1 s, {} pairs\n",
                            e.rpe_translation_rmse_m, e.rpe_rotation_rmse_deg, e.rpe_pairs);
    } else {
        text += "RPE           shorter than a second: none\n";
    }
    // Noise of a centimetre in a way of some metres is less.
    if (std::fabs(std::log(e.scale)) > 0.05) {
        text += fmt::format("scale         {:.3f} times the path would fit the truth best: is the depth unit right?\n",
                            e.scale);
    }
    return text;
}

std::string evaluation_json(const Evaluation& e) {
    return json_of(e).dump(2) + "\n";
}

std::string summary_text(const RunRecord& record, const std::string& report) {
    std::string text = fmt::format(
        "frames        {} ({:.1f} % with a measured pose: {:.1f} % tracked, {:.1f} % unsure; {:.1f} % predicted, "
        "{:.1f} % none)\n",
        record.frames_total, 100 * record.coverage(), 100 * record.share(PoseState::kTracked),
        100 * record.share(PoseState::kUnsure), 100 * record.share(PoseState::kPredicted),
        100 * record.share(PoseState::kNone));
    if (const std::string reasons = record.unsure_reasons(); !reasons.empty())
        text += fmt::format("unsure        {}\n", reasons);
    text += record.evaluation
                ? evaluation_text(*record.evaluation)
                : std::string(record.truth.empty() ? "ATE, RPE      no ground truth here\n"
                                                   : "ATE, RPE      fewer than three poses have a partner\n");
    if (record.final_evaluation) {
        text += fmt::format("final         ATE {:.4f} m RMSE of the poses as they are known at the end\n",
                            record.final_evaluation->ate_rmse_m);
    }
    text += fmt::format("time          {:.2f} ms median, {:.2f} ms p99, {:.2f} ms max per frame; start-up {:.1f} ms\n",
                        record.frame_ms.median(), record.frame_ms.p99(), record.frame_ms.max(), record.start_up_ms);
    text += fmt::format("memory        {:.1f} MiB block, {:.1f} MiB of it used; process peak {:.1f} MiB\n",
                        mib(record.block_bytes), mib(record.arena_used_bytes), mib(record.peak_resident_bytes));
    text += fmt::format("map           {} keyframes made, {} forgotten; {} points forgotten; {} recoveries\n",
                        record.keyframes_made, record.keyframes_forgotten, record.points_forgotten, record.recoveries);
    if (record.has_vocabulary) {
        const LoopStatistics& l = record.loops;
        text += fmt::format(
            "loops         {} closed, {} confirmed, of {} places verified for {} keyframes; refused: {} few matches, "
            "{} "
            "no pose, {} few inliers, {} not spread, {} too far, {} beyond drift; largest correction {:.3f} m; {} "
            "relocalisations\n",
            l.closed, l.confirmed, l.candidates, l.queries, l.refused_matches, l.refused_pose, l.refused_inliers,
            l.refused_spread, l.refused_far, l.refused_unlikely, l.largest_correction_m, l.relocalisations);
    }
    text += fmt::format(
        "background    {:.0f} units per frame of {:.0f} granted; {:.2f} ms p99 per frame; largest slice {} units, "
        "{:.2f} "
        "ms; {} keyframes waiting at most, {} refused\n",
        record.units_per_frame(record.schedule.units_spent), record.units_per_frame(record.schedule.units_granted),
        record.background_ms.p99(), record.schedule.largest_slice_units, record.slice_ms.max(),
        record.keyframe_queue.high_water, record.keyframes_refused);
    if (record.frame_period_ms > 0) {
        text += fmt::format(
            "latency       {:.2f} ms median, {:.2f} ms p99, {:.2f} ms p99.9, {:.2f} ms max; {} frames above "
            "the {:.1f} ms between two frames\n",
            record.latency_ms.median(), record.latency_ms.p99(), record.latency_ms.at(0.999), record.latency_ms.max(),
            record.deadline_misses, record.frame_period_ms);
    }
    if (record.is_realtime) {
        text += fmt::format("real time     {} frames dropped because they were late", record.frames_dropped);
        text += record.source_late_s >= 0.001
                    ? fmt::format("; the camera itself was {:.2f} s late in all\n", record.source_late_s)
                    : "\n";
    }
    if (const CameraRecord& camera = record.camera; !camera.device.empty()) {
        text += fmt::format("camera        {}\n", camera.device);
        text += fmt::format(
            "              {} pairs, depth {:.1f} ms after colour ({:.1f} to {:.1f}); {} colour and {} depth images "
            "without "
            "a partner, {} lost before us; {:.2f} ms of CPU per frame",
            camera.pairs, camera.lag_mean_ms, camera.lag_min_ms, camera.lag_max_ms, camera.colour_alone,
            camera.depth_alone, camera.images_missing, camera.layer_cpu_ms);
        text += camera.exposure_mean_ms > 0 ? fmt::format("; exposed for {:.1f} ms\n", camera.exposure_mean_ms) : "\n";
    }
    if (const CameraRecord& camera = record.camera; camera.unplugs + camera.stalls + camera.frames_refused > 0) {
        text += fmt::format(
            "life          unplugged {} times, stalled {} times, back {} times; {:.1f} s without a camera ({:.1f} s at "
            "most); {} frames refused, {} clocks restarted\n",
            camera.unplugs, camera.stalls, camera.returns, camera.away_s, camera.away_longest_s, camera.frames_refused,
            camera.clock_restarts);
    }
    text += streams_text(record.streams);
    for (const RunRecord::NewMap& map : record.new_maps) text += fmt::format("new map       {}\n", map.sentence);
    if (!record.camera.faults.empty()) text += fmt::format("faults        {}\n", record.camera.faults);
    if (!record.recording.empty()) {
        text +=
            fmt::format("recording     {}, {} frames; {:.3f} ms median, {:.3f} ms p99 per frame\n", record.recording,
                        record.frames_recorded, record.record_ms.median(), record.record_ms.p99());
    }
    for (const MapRecord& map : record.maps) {
        text += fmt::format("map {:9} {}: {} keyframes, {} points, {:.1f} MB, hash {:016x}, {:.0f} ms", map.what,
                            map.file, map.keyframes, map.points, static_cast<double>(map.size_bytes) * 1e-6, map.hash,
                            1e3 * map.seconds);
        text += map.times > 1 ? fmt::format(", {} times\n", map.times) : "\n";
    }
    for (const GridRecord& g : record.grids) text += grid_line(g);
    text += gravity_line(record.gravity);
    if (const StoreRecord& s = record.store; !s.folder.empty()) {
        text += fmt::format(
            "map store     {}: {} regions, {:.1f} MB; {} written, {} brought back ({} of use), {} asked for; {} "
            "forgotten, "
            "{} damaged, {} lost because the disk was too slow\n",
            s.folder, s.regions, static_cast<double>(s.bytes) * 1e-6, s.written, s.engine.returned, s.engine.useful,
            s.engine.asked, s.forgotten, s.damaged + s.engine.damaged, s.engine.refused);
    }
    text += fmt::format("state hash    {:016x}\n", record.state_hash);
    for (const std::string& note : record.notes) text += fmt::format("note          {}\n", note);
    if (!report.empty()) text += fmt::format("report        {}\n", report);
    return text;
}

std::string summary_json(const RunRecord& record, const std::string& report, int exit_code) {
    Json json = {{"input", record.input},
                 {"calibration", record.calibration},
                 {"limits", record.limits},
                 {"features", record.features},
                 {"exit_code", exit_code},
                 {"frames", record.frames_total},
                 {"coverage", record.coverage()},
                 {"share_tracked", record.share(PoseState::kTracked)},
                 {"share_unsure", record.share(PoseState::kUnsure)},
                 {"share_predicted", record.share(PoseState::kPredicted)},
                 {"share_none", record.share(PoseState::kNone)},
                 {"ms_median", record.frame_ms.median()},
                 {"ms_p99", record.frame_ms.p99()},
                 {"ms_max", record.frame_ms.max()},
                 {"start_up_ms", record.start_up_ms},
                 {"wall_s", record.wall_seconds},
                 {"cpu_s", record.cpu_seconds},
                 {"block_bytes", record.block_bytes},
                 {"arena_used_bytes", record.arena_used_bytes},
                 {"peak_resident_bytes", record.peak_resident_bytes},
                 {"state_hash", fmt::format("{:016x}", record.state_hash)}};
    json["unsure_reasons"] = Json::object();
    for (std::size_t i = 0; i < kUnsureReasons; ++i) {
        const char* const name = i == 0 ? "camera_fault" : unsure_reason_name(static_cast<UnsureReason>(i));
        std::string key = name;
        std::replace(key.begin(), key.end(), ' ', '_');
        json["unsure_reasons"][key] = record.unsure_counts[i];
    }
    json["evaluation"] = record.evaluation ? json_of(*record.evaluation) : Json(nullptr);
    json["final_evaluation"] = record.final_evaluation ? json_of(*record.final_evaluation) : Json(nullptr);
    const LoopStatistics& l = record.loops;
    json["loops"] = record.has_vocabulary ? Json{{"queries", l.queries},
                                                 {"verified", l.candidates},
                                                 {"closed", l.closed},
                                                 {"confirmed", l.confirmed},
                                                 {"refused",
                                                  {{"matches", l.refused_matches},
                                                   {"pose", l.refused_pose},
                                                   {"inliers", l.refused_inliers},
                                                   {"spread", l.refused_spread},
                                                   {"far", l.refused_far},
                                                   {"unlikely", l.refused_unlikely},
                                                   {"gone", l.refused_gone}}},
                                                 {"dropped", l.dropped},
                                                 {"points_fused", l.points_fused},
                                                 {"observations_found", l.observations_found},
                                                 {"graph_iterations", l.graph_iterations},
                                                 {"adjustments", l.adjustments},
                                                 {"adjustments_dropped", l.adjustments_dropped},
                                                 {"adjustment_iterations", l.adjustment_iterations},
                                                 {"largest_correction_m", l.largest_correction_m},
                                                 {"relocalisations", l.relocalisations},
                                                 {"relocalisation_queries", l.relocalisation_queries},
                                                 {"relocalisation_candidates", l.relocalisation_candidates},
                                                 {"matched_by_words", l.matched_by_words}}
                                          : Json(nullptr);
    Json stages = Json::object();
    for (const StageRecord& stage : record.stages) {
        stages[stage.name] = {{"ms_median", stage.ms.median()}, {"ms_p99", stage.ms.p99()}, {"ms_max", stage.ms.max()}};
    }
    json["stages"] = stages;
    json["keyframes_made"] = record.keyframes_made;
    json["keyframes_forgotten"] = record.keyframes_forgotten;
    json["points_forgotten"] = record.points_forgotten;
    json["recoveries"] = record.recoveries;
    json["keyframes_refused"] = record.keyframes_refused;
    json["maps"] = Json::array();
    for (const MapRecord& map : record.maps) {
        json["maps"].push_back({{"what", map.what},
                                {"file", map.file},
                                {"size_bytes", map.size_bytes},
                                {"keyframes", map.keyframes},
                                {"points", map.points},
                                {"hash", fmt::format("{:016x}", map.hash)},
                                {"ms", 1e3 * map.seconds},
                                {"times", map.times}});
    }
    const GravityRecord& gravity = record.gravity;
    json["gravity"] = !gravity.is_asked ? Json(nullptr)
                                        : Json{{"known", gravity.is_known},
                                               {"up", gravity.up},
                                               {"doubt_degrees", gravity.doubt_degrees},
                                               {"seconds", gravity.seconds},
                                               {"why_not", gravity.why_not}};
    json["grids"] = Json::array();
    for (const GridRecord& g : record.grids) {
        json["grids"].push_back({{"grid", g.grid},
                                 {"cloud", g.cloud},
                                 {"floor", g.has_floor},
                                 {"floor_share", g.floor_share},
                                 {"level", g.is_level},
                                 {"cut", g.is_cut},
                                 {"width", g.width},
                                 {"height", g.height},
                                 {"looks", g.looks},
                                 {"memory_bytes", g.memory_bytes},
                                 {"ms", g.build_ms}});
    }
    const StoreRecord& s = record.store;
    json["map_store"] = s.folder.empty() ? Json(nullptr)
                                         : Json{{"folder", s.folder},
                                                {"regions", s.regions},
                                                {"bytes", s.bytes},
                                                {"written", s.written},
                                                {"forgotten", s.forgotten},
                                                {"damaged", s.damaged + s.engine.damaged},
                                                {"kept", s.engine.kept},
                                                {"known", s.engine.known},
                                                {"refused", s.engine.refused},
                                                {"asked", s.engine.asked},
                                                {"not_found", s.engine.not_found},
                                                {"late", s.engine.late},
                                                {"no_room", s.engine.no_room},
                                                {"returned", s.engine.returned},
                                                {"useful", s.engine.useful},
                                                {"points_returned", s.engine.points_made},
                                                {"corrections", s.engine.corrections}};
    json["keyframe_queue"] = {{"size", record.keyframe_queue.size},
                              {"high_water", record.keyframe_queue.high_water},
                              {"limit", record.keyframe_queue.capacity}};
    Json pools = Json::object();
    for (const PoolRecord& pool : record.pools) {
        pools[pool.name] = {{"high_water", pool.high_water}, {"limit", pool.limit}};
    }
    json["pools"] = pools;
    const ScheduleStatistics& schedule = record.schedule;
    json["background"] = {{"units_granted", schedule.units_granted},
                          {"units_spent", schedule.units_spent},
                          {"units_per_frame", record.units_per_frame(schedule.units_spent)},
                          {"steps", schedule.steps},
                          {"slices", schedule.slices},
                          {"largest_slice_units", schedule.largest_slice_units},
                          {"largest_overdraw_units", schedule.largest_overdraw_units},
                          {"slice_ms_max", record.slice_ms.max()},
                          {"slice_ms_p99", record.slice_ms.p99()},
                          {"ms_median", record.background_ms.median()},
                          {"ms_p99", record.background_ms.p99()},
                          {"ms_max", record.background_ms.max()}};
    json["latency"] = {{"ms_median", record.latency_ms.median()},   {"ms_p99", record.latency_ms.p99()},
                       {"ms_p999", record.latency_ms.at(0.999)},    {"ms_max", record.latency_ms.max()},
                       {"frame_period_ms", record.frame_period_ms}, {"deadline_misses", record.deadline_misses}};
    json["outputs"] = {{"ms_median", record.outputs_ms.median()},
                       {"ms_p99", record.outputs_ms.p99()},
                       {"ms_max", record.outputs_ms.max()}};
    json["is_realtime"] = record.is_realtime;
    json["frames_dropped"] = record.frames_dropped;
    json["source_late_s"] = record.source_late_s;
    const CameraRecord& camera = record.camera;
    json["camera"] = camera.device.empty() ? Json(nullptr)
                                           : Json({{"device", camera.device},
                                                   {"pairs", camera.pairs},
                                                   {"colour_alone", camera.colour_alone},
                                                   {"depth_alone", camera.depth_alone},
                                                   {"images_missing", camera.images_missing},
                                                   {"lag_mean_ms", camera.lag_mean_ms},
                                                   {"lag_min_ms", camera.lag_min_ms},
                                                   {"lag_max_ms", camera.lag_max_ms},
                                                   {"exposure_mean_ms", camera.exposure_mean_ms},
                                                   {"layer_cpu_ms", camera.layer_cpu_ms}});
    json["life"] = {{"unplugs", camera.unplugs},
                    {"stalls", camera.stalls},
                    {"returns", camera.returns},
                    {"away_s", camera.away_s},
                    {"away_longest_s", camera.away_longest_s},
                    {"frames_refused", camera.frames_refused},
                    {"clock_restarts", camera.clock_restarts},
                    {"events", camera.events}};
    json["streams"] = json_of(record.streams);
    json["new_maps"] = Json::array();
    for (const RunRecord::NewMap& map : record.new_maps) {
        json["new_maps"].push_back({{"second", map.second}, {"what", map.sentence}});
    }
    json["faults"] = camera.faults.empty() ? Json(nullptr) : Json(camera.faults);
    json["recording"] = record.recording.empty() ? Json(nullptr) : Json(record.recording);
    json["frames_recorded"] = record.frames_recorded;
    json["record_ms_median"] = record.record_ms.median();
    json["record_ms_p99"] = record.record_ms.p99();
    json["camera_check"] = record.camera_check;
    json["notes"] = record.notes;
    json["problems"] = record.problems;
    json["report"] = report.empty() ? Json(nullptr) : Json(report);
    // A folder's name may hold any bytes: replaced rather than thrown over.
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace stillmesh
