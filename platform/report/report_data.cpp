#include "platform/report/report_data.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "platform/report/picture_writer.hpp"
#include "platform/view/shown_links.hpp"

namespace stillmesh {
namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little, "numbers go out as they lie in memory");

constexpr std::size_t kTruthPlacesMax = 4096;

// A folder's name may hold any bytes; a '<' only ever stands in a string.
[[nodiscard]] std::string text_of(const Json& json) {
    const std::string plain = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    std::string text;
    text.reserve(plain.size());
    for (const char c : plain) {
        if (c == '<') {
            text += "\\u003c";
        } else {
            text += c;
        }
    }
    return text;
}

template <typename T>
[[nodiscard]] std::string bytes_of(const std::vector<T>& values) {
    return base64({reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(T)});
}

template <typename T, typename Get>
[[nodiscard]] std::string column(const std::vector<FilmFrame>& frames, Get get) {
    std::vector<T> values;
    values.reserve(frames.size());
    for (const FilmFrame& frame : frames) values.push_back(static_cast<T>(get(frame)));
    return bytes_of(values);
}

// Metres off the truth; NaN where none is known.
[[nodiscard]] Json errors_of(const RunRecord& run, const std::vector<FilmFrame>& frames) {
    if (!run.evaluation) return nullptr;
    std::vector<float> errors(frames.size(), std::numeric_limits<float>::quiet_NaN());
    for (const PosePair& pair : run.evaluation->pairs) {
        const std::int64_t time_ns = run.estimate[pair.estimate_index].time_ns;
        const auto at = std::lower_bound(frames.begin(), frames.end(), time_ns,
                                         [](const FilmFrame& f, std::int64_t t) { return f.time_ns < t; });
        if (at == frames.end() || at->time_ns != time_ns) continue;
        errors[static_cast<std::size_t>(at - frames.begin())] = static_cast<float>(pair.error_m);
    }
    return bytes_of(errors);
}

// The true path, brought into the map that the run made.
[[nodiscard]] Json truth_of(const RunRecord& run) {
    if (!run.evaluation) return nullptr;
    const auto& r = run.evaluation->truth_from_estimate_r;
    const auto& t = run.evaluation->truth_from_estimate_t;
    std::vector<float> places;
    const std::size_t stride = 1 + run.truth.size() / kTruthPlacesMax;
    for (std::size_t i = 0; i < run.truth.size(); i += stride) {
        for (std::size_t k = 0; k < 3; ++k) {
            double sum = 0;
            for (std::size_t m = 0; m < 3; ++m) sum += r[3 * m + k] * (run.truth[i].t[m] - t[m]);
            places.push_back(static_cast<float>(sum));
        }
    }
    return bytes_of(places);
}

// What runs are compared by: name, unit, value (null: unknown), and whether less of it is better (null: neither).
[[nodiscard]] Json numbers_of(const RunRecord& run) {
    Json numbers = Json::array();
    const auto add = [&numbers](const char* name, const char* unit, Json value, Json is_less_better) {
        numbers.push_back({name, unit, std::move(value), std::move(is_less_better)});
    };
    const auto& e = run.evaluation;
    const bool has_rpe = e && e->rpe_pairs > 0;
    const auto mib = [](std::size_t bytes) { return static_cast<double>(bytes) / (1024.0 * 1024.0); };
    add("error of the path, ATE RMSE", "cm", e ? Json(100 * e->ate_rmse_m) : Json(), true);
    add("its largest", "cm", e ? Json(100 * e->ate_max_m) : Json(), true);
    add("error over a second, RPE", "cm", has_rpe ? Json(100 * e->rpe_translation_rmse_m) : Json(), true);
    add("the same, turning", "degrees", has_rpe ? Json(e->rpe_rotation_rmse_deg) : Json(), true);
    add("frames", "", run.frames_total, nullptr);
    add("with a measured pose", "%", 100 * run.coverage(), false);
    add("tracked", "%", 100 * run.share(PoseState::kTracked), false);
    add("time of a frame, median", "ms", run.frame_ms.median(), true);
    add("the same, 99 %", "ms", run.frame_ms.p99(), true);
    add("the same, most", "ms", run.frame_ms.max(), true);
    add("late frames dropped", "", run.is_realtime ? Json(run.frames_dropped) : Json(), true);
    add("memory of the engine", "MiB", mib(run.block_bytes), true);
    add("memory of the process, most", "MiB", mib(run.peak_resident_bytes), true);
    add("keyframes made", "", run.keyframes_made, nullptr);
    add("loops closed", "", run.has_vocabulary ? Json(run.loops.closed) : Json(), nullptr);
    add("relocalisations", "", run.has_vocabulary ? Json(run.loops.relocalisations) : Json(), nullptr);
    return numbers;
}

[[nodiscard]] Json columns_of(const RunRecord& run, const RunFilm& film) {
    const std::vector<FilmFrame>& f = film.frames();
    Json columns = {{"time", column<std::int64_t>(f, [](const FilmFrame& x) { return x.time_ns; })},
                    {"frame", column<std::uint32_t>(f, [](const FilmFrame& x) { return x.number; })},
                    {"state", column<std::uint8_t>(f, [](const FilmFrame& x) { return x.state; })},
                    {"reason", column<std::uint8_t>(f, [](const FilmFrame& x) { return x.reason; })},
                    {"chosen", column<std::uint8_t>(f, [](const FilmFrame& x) { return x.chosen_percent; })},
                    {"rival", column<std::uint8_t>(f, [](const FilmFrame& x) { return x.rival_percent; })},
                    {"map", column<std::uint16_t>(f, [](const FilmFrame& x) { return x.map; })},
                    {"features", column<std::uint16_t>(f, [](const FilmFrame& x) { return x.features; })},
                    {"still", column<std::uint16_t>(f, [](const FilmFrame& x) { return x.static_features; })},
                    {"moving", column<std::uint16_t>(f, [](const FilmFrame& x) { return x.moving_features; })},
                    {"ms", column<float>(f, [](const FilmFrame& x) { return x.ms; })}};
    std::vector<float> poses;
    poses.reserve(7 * f.size());
    for (const FilmFrame& frame : f) poses.insert(poses.end(), frame.pose.begin(), frame.pose.end());
    columns["pose"] = bytes_of(poses);
    for (std::size_t i = 0; i < kStages; ++i) {
        columns["stages"].push_back(column<float>(f, [i](const FilmFrame& x) { return x.stage_ms[i]; }));
    }
    columns["error"] = errors_of(run, f);
    return columns;
}

void append_pose(const RigidTransform& pose, std::string& text) {
    char before = '[';
    const auto put = [&](double value) {
        fmt::format_to(std::back_inserter(text), "{}{:.6g}", before, std::isfinite(value) ? value : 0.0);
        before = ',';
    };
    for (const double value : pose.translation_m) put(value);
    for (const double value : pose.rotation_xyzw) put(value);
    text += ']';
}

void append_picture(const FilmPicture& picture, std::string& text) {
    fmt::format_to(std::back_inserter(text),
                   "{{\"frame\":{},\"image\":[{},{}],\"type\":\"{}\",\"picture\":\"{}\",\"at\":\"{}\",\"kinds\":\"{}\","
                   "\"kept\":\"{}\",\"cut\":\"{}\"}}",
                   picture.frame, picture.image_width, picture.image_height, picture.is_jpeg ? "jpeg" : "png",
                   base64(picture.picture), bytes_of(picture.features), bytes_of(picture.kinds), bytes_of(picture.kept),
                   bytes_of(picture.cut));
}

}  // namespace

std::string run_data(const RunRecord& run, const RunFilm& film) {
    Json json = {{"schema", kReportSchema},        {"input", run.input},
                 {"calibration", run.calibration}, {"limits", run.limits},
                 {"command", run.command},         {"state_hash", fmt::format("{:016x}", run.state_hash)},
                 {"stride", film.frame_stride()},  {"period_ms", run.frame_period_ms}};
    json["numbers"] = numbers_of(run);
    for (std::uint32_t i = 0; i < kStages; ++i) json["stages"].push_back(stage_name(static_cast<Stage>(i)));
    for (std::uint8_t i = 0; i < kFilmReasons; ++i) json["reasons"].push_back(film_reason_name(i));
    json["events"] = Json::array();
    const std::int64_t begin_ns = film.frames().empty() ? 0 : film.frames().front().time_ns;
    for (const FilmEvent& event : film.events()) {
        const double second = static_cast<double>(event.time_ns - begin_ns) * 1e-9;
        json["events"].push_back({std::max(second, 0.0), event.sentence});
    }
    if (film.events_left_out() > 0) {
        const double end = static_cast<double>(film.frames().back().time_ns - begin_ns) * 1e-9;
        json["events"].push_back({end, fmt::format("{} more sentences were not kept.", film.events_left_out())});
    }
    json["columns"] = columns_of(run, film);
    json["truth"] = truth_of(run);
    return text_of(json);
}

std::string film_data(const RunFilm& film) {
    std::string text = fmt::format("{{\"map\":{},\"pictures\":[", film.frames().empty() ? 1 : film.frames().back().map);
    for (std::size_t i = 0; i < film.pictures().size(); ++i) {
        if (i > 0) text += ',';
        append_picture(film.pictures()[i], text);
    }
    text += "],\"keyframes\":[";
    for (std::size_t i = 0; i < film.keyframes().size(); ++i) {
        fmt::format_to(std::back_inserter(text), "{}[{},", i > 0 ? "," : "", film.keyframes()[i].id);
        append_pose(film.keyframes()[i].map_from_camera, text);
        text += ']';
    }
    const ShownLinks links(film.keyframes(), film.links());
    text += fmt::format("],\"covisible\":\"{}\",\"loops\":\"{}\",\"clouds\":[", bytes_of(links.covisible),
                        bytes_of(links.loops));
    for (std::size_t i = 0; i < film.clouds().size(); ++i) {
        const ViewCloud& cloud = film.clouds()[i];
        const std::span<const ViewCloud::Point> points(cloud.points.data(), cloud.count);
        fmt::format_to(std::back_inserter(text), "{}{{\"keyframe\":{},\"points\":\"{}\"}}", i > 0 ? "," : "",
                       cloud.keyframe,
                       base64({reinterpret_cast<const std::uint8_t*>(points.data()), points.size_bytes()}));
    }
    return text + "]}";
}

}  // namespace stillmesh
