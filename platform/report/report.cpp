#include "platform/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include "platform/linux/text_output.hpp"
#include "platform/report/png_writer.hpp"

namespace stillmesh {
namespace {

constexpr const char* kHead = R"HTML(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Stillmesh report</title><style>
:root{--ground:#f6f7f9;--card:#fff;--ink:#18202b;--soft:#5d6877;--line:#dfe4ea;--truth:#8a94a3;--path:#1769e0;
--good:#17924a;--unsure:#d98e04;--bad:#d33a3a;--none:#9aa3af}
@media(prefers-color-scheme:dark){:root{--ground:#12161c;--card:#1b212a;--ink:#e8ecf1;--soft:#9aa5b4;--line:#303844;
--truth:#8a94a3;--path:#5b9dff;--good:#3fc077;--unsure:#f0b03a;--bad:#f06a6a;--none:#6d7683}}
*{box-sizing:border-box}body{margin:0;background:var(--ground);color:var(--ink);font:15px/1.5 system-ui,sans-serif}
main{max-width:1120px;margin:0 auto;padding:32px 20px 60px}h1{font-size:28px;margin:0}h2{font-size:19px;margin:0}
header p,.note{color:var(--soft);margin:4px 0 0}main>.note{margin-top:14px}code{font-size:13px;overflow-wrap:anywhere}
section{background:var(--card);border:1px solid var(--line);border-radius:10px;padding:20px 22px;margin-top:18px}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(195px,1fr));gap:14px;margin-top:20px}
.card{background:var(--card);border:1px solid var(--line);border-left:5px solid var(--none);border-radius:10px;padding:14px 16px}
.card.good{border-left-color:var(--good)}.card.fair{border-left-color:var(--unsure)}.card.bad{border-left-color:var(--bad)}
.card b{display:block;font-size:21px;line-height:1.4;white-space:nowrap}.card span{color:var(--soft);font-size:13px;display:block}
.problem{border-left:5px solid var(--bad)}svg{display:block;width:100%;height:auto;margin-top:12px}
svg text{fill:var(--soft);font:12px system-ui,sans-serif}.grid{stroke:var(--line);stroke-width:1}
.legend{display:flex;flex-wrap:wrap;gap:6px 18px;margin-top:10px;color:var(--soft);font-size:13px}
.legend i{display:inline-block;width:12px;height:12px;border-radius:3px;margin-right:6px;vertical-align:-1px}
.frames{display:grid;grid-template-columns:repeat(auto-fit,minmax(430px,1fr));gap:18px;margin-top:14px}
figure{margin:0}figure svg{margin:0;border-radius:8px;background:#000}figcaption{color:var(--soft);font-size:13px;margin-top:6px}
.hide-kept .kept,.hide-cut .cut,.hide-points .points{display:none}label{margin-right:16px;cursor:pointer}
table{border-collapse:collapse;width:100%;margin-top:12px;font-variant-numeric:tabular-nums}
td,th{text-align:right;padding:4px 8px;border-bottom:1px solid var(--line)}td:first-child,th:first-child{text-align:left}
th{color:var(--soft);font-weight:500;font-size:13px}.bar{height:9px;border-radius:4px;background:var(--path);min-width:1px}
.rail{background:var(--line);border-radius:4px;min-width:140px}@media(max-width:500px){.frames{grid-template-columns:1fr}}
</style></head><body><main>
)HTML";

constexpr const char* kTail = R"HTML(<script>
for(const box of document.querySelectorAll('input[data-layer]'))box.onchange=()=>
document.getElementById('frames').classList.toggle('hide-'+box.dataset.layer,!box.checked)
</script></main></body></html>
)HTML";

[[nodiscard]] std::string escaped(const std::string& text) {
    std::string result;
    for (const char c : text) {
        if (c == '<') {
            result += "&lt;";
        } else if (c == '>') {
            result += "&gt;";
        } else if (c == '&') {
            result += "&amp;";
        } else if (c == '"') {
            result += "&quot;";
        } else {
            result += c;
        }
    }
    return result;
}

[[nodiscard]] double mib(std::size_t bytes) {
    return static_cast<double>(bytes) / (1024.0 * 1024.0);
}

// A step of 1, 2 or 5 times a power of ten that cuts `range` into at most `count` parts.
[[nodiscard]] double nice_step(double range, int count) {
    const double raw = std::max(range, 1e-9) / count;
    const double power = std::pow(10.0, std::floor(std::log10(raw)));
    for (const double factor : {1.0, 2.0, 5.0}) {
        if (raw <= factor * power * 1.000001) return factor * power;
    }
    return 10.0 * power;
}

struct XY {
    double x = 0, y = 0;
};

// A chart over time: axes, grid, and a way from values to pixels.
struct TimeChart {
    double seconds;  // right end
    double top;      // highest value
    double width = 1060, height = 240, left = 56, right = 12, above = 12, below = 34;

    [[nodiscard]] double x(double s) const { return left + (width - left - right) * s / std::max(seconds, 1e-9); }
    [[nodiscard]] double y(double value) const {
        return height - below - (height - above - below) * std::clamp(value / std::max(top, 1e-12), 0.0, 1.0);
    }
    [[nodiscard]] std::string begin(const std::string& unit, const std::string& title) const {
        std::string svg =
            fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">", width, height, title);
        const double step = nice_step(top, 5);
        for (int i = 0; i * step <= top * 1.0001; ++i) {
            const double value = i * step;
            svg += fmt::format(
                "<line class=\"grid\" x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/>"
                "<text x=\"{3}\" y=\"{4:.1f}\" text-anchor=\"end\">{5:g}</text>",
                left, width - right, y(value), left - 7, y(value) + 4, value);
        }
        const double second = nice_step(seconds, 12);
        for (int i = 0; i * second <= seconds * 1.0001; ++i) {
            const double s = i * second;
            svg += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}{}</text>", x(s),
                               height - below + 18, s, s == 0 ? " s" : "");
        }
        return svg + fmt::format(
                         "<text x=\"14\" y=\"{0:.1f}\" transform=\"rotate(-90 14 {0:.1f})\" "
                         "text-anchor=\"middle\">{1}</text>",
                         (height - below + above) / 2, unit);
    }
};

[[nodiscard]] std::string polyline(const std::vector<XY>& points, const char* colour, double stroke = 1.8) {
    if (points.size() < 2) return {};
    std::string path;
    for (const XY& p : points) path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", p.x, p.y);
    return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"/>",
                       path, colour, stroke);
}

[[nodiscard]] std::string card(const char* grade, const std::string& value, const std::string& name,
                               const std::string& what) {
    return fmt::format("<div class=\"card {}\"><span>{}</span><b>{}</b><span>{}</span></div>", grade, name, value,
                       what);
}

[[nodiscard]] std::string legend(std::initializer_list<std::pair<const char*, const char*>> items) {
    std::string text = "<div class=\"legend\">";
    for (const auto& [colour, name] : items)
        text += fmt::format("<span><i style=\"background:{}\"></i>{}</span>", colour, name);
    return text + "</div>";
}

[[nodiscard]] const char* state_colour(PoseState state) {
    constexpr std::array<const char*, 4> kColours = {"var(--none)", "var(--bad)", "var(--unsure)", "var(--good)"};
    return kColours[static_cast<std::size_t>(state)];
}

// Small numbers keep what is in them.
[[nodiscard]] std::string short_number(double value) {
    return value < 1 ? fmt::format("{:.2f}", value) : fmt::format("{:.1f}", value);
}

[[nodiscard]] std::string cards(const RunRecord& run) {
    std::string html = "<div class=\"cards\">";
    if (run.evaluation) {
        const Evaluation& e = *run.evaluation;
        html += card(e.ate_rmse_m < 0.05   ? "good"
                     : e.ate_rmse_m < 0.15 ? "fair"
                                           : "bad",
                     fmt::format("{} cm", short_number(100 * e.ate_rmse_m)), "Error of the path, ATE",
                     "root mean square; below 5 cm is good, above 15 cm it was led astray");
        if (e.rpe_pairs > 0) {
            html += card(e.rpe_translation_rmse_m < 0.05  ? "good"
                         : e.rpe_translation_rmse_m < 0.1 ? "fair"
                                                          : "bad",
                         fmt::format("{} cm, {}&deg;", short_number(100 * e.rpe_translation_rmse_m),
                                     short_number(e.rpe_rotation_rmse_deg)),
                         "Error over a second", "RPE over 1 s; below 5 cm is good");
        }
    }
    html += card(
        run.coverage() >= 0.98  ? "good"
        : run.coverage() >= 0.9 ? "fair"
                                : "bad",
        fmt::format("{:.1f} %", 100 * run.coverage()), "Frames with a pose",
        fmt::format("{} frames, {:.1f} % sure; 98 % is good", run.frames_total, 100 * run.share(PoseState::kTracked)));
    html += card(run.frame_ms.p99() <= 33 ? "good" : "bad",
                 fmt::format("{:.1f} / {:.1f} ms", run.frame_ms.median(), run.frame_ms.p99()), "Time per frame",
                 "median / 99 %; a camera at 30 frames/s leaves 33 ms");
    html += card(run.peak_resident_bytes <= std::size_t{80} * 1024 * 1024 ? "good" : "fair",
                 fmt::format("{:.1f} MiB", mib(run.peak_resident_bytes)), "Memory",
                 fmt::format("of the program; the engine's one block is {:.1f} MiB of it", mib(run.block_bytes)));
    return html + "</div>";
}

// From above: the two axes of the world across its vertical, which is where the camera's "up" points on average.
[[nodiscard]] std::string path_section(const RunRecord& run) {
    std::vector<std::array<double, 3>> estimate;
    std::vector<std::array<double, 3>> truth;
    const bool is_aligned = run.evaluation.has_value();
    if (is_aligned) {
        for (const PosePair& pair : run.evaluation->pairs) {
            estimate.push_back(pair.aligned_t);
            truth.push_back(run.truth[pair.truth_index].t);
        }
    } else {
        for (const TrajectoryPose& pose : run.estimate) estimate.push_back(pose.t);
    }
    if (estimate.size() < 2)
        return "<section><h2>Path from above</h2><p class=\"note\">No pose was measured.</p></section>";
    std::array<double, 3> up{};
    const auto add_up = [&up](const TrajectoryPose& pose) {
        const auto [x, y, z, w] = pose.q;  // minus the rotation's second column
        up[0] -= 2 * (x * y - z * w);
        up[1] -= 1 - 2 * (x * x + z * z);
        up[2] -= 2 * (y * z + x * w);
    };
    if (is_aligned) {
        for (const PosePair& pair : run.evaluation->pairs) add_up(run.truth[pair.truth_index]);
    } else {
        for (const TrajectoryPose& pose : run.estimate) add_up(pose);
    }
    std::size_t vertical = 0;
    for (std::size_t i = 1; i < 3; ++i) {
        if (std::abs(up[i]) > std::abs(up[vertical])) vertical = i;
    }
    const std::size_t a = vertical == 0 ? 1 : 0;
    const std::size_t b = vertical == 2 ? 1 : 2;
    double low_a = 1e300, high_a = -1e300, low_b = 1e300, high_b = -1e300;
    for (const auto* points : {&estimate, &truth}) {
        for (const auto& p : *points) {
            low_a = std::min(low_a, p[a]);
            high_a = std::max(high_a, p[a]);
            low_b = std::min(low_b, p[b]);
            high_b = std::max(high_b, p[b]);
        }
    }
    const double width = 1060, height = 480, margin = 44;
    const double scale = std::min((width - 2 * margin) / std::max(high_a - low_a, 0.05),
                                  (height - 2 * margin) / std::max(high_b - low_b, 0.05));
    const auto place = [&](const std::array<double, 3>& p) {
        return XY{width / 2 + (p[a] - (low_a + high_a) / 2) * scale,
                  height / 2 - (p[b] - (low_b + high_b) / 2) * scale};
    };
    const std::size_t stride = 1 + estimate.size() / 4000;
    std::vector<XY> path;
    std::vector<XY> true_path;
    std::string errors;
    for (std::size_t i = 0; i < estimate.size(); i += stride) {
        path.push_back(place(estimate[i]));
        if (!is_aligned) continue;
        true_path.push_back(place(truth[i]));
        if (i % (stride * 4) == 0) {
            errors += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", path.back().x, path.back().y, true_path.back().x,
                                  true_path.back().y);
        }
    }
    std::string svg = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"path\">", width, height);
    const double ruler = nice_step(150 / scale, 1);
    svg += fmt::format(
        "<path d=\"M{0} {2}v6h{1:.1f}v-6\" fill=\"none\" stroke=\"var(--soft)\"/>"
        "<text x=\"{3:.1f}\" y=\"{4}\" text-anchor=\"middle\">{5:g} m</text>",
        margin, ruler * scale, height - 28, margin + ruler * scale / 2, height - 6, ruler);
    if (is_aligned) {
        svg += polyline(true_path, "var(--truth)", 3);
        svg += fmt::format("<path d=\"{}\" stroke=\"var(--bad)\" stroke-width=\"1\" opacity=\"0.6\"/>", errors);
    }
    svg += polyline(path, "var(--path)", 1.8);
    svg += fmt::format(
        "<circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"6\" fill=\"var(--good)\"/><circle cx=\"{2:.1f}\" "
        "cy=\"{3:.1f}\" r=\"6\" fill=\"var(--ink)\"/></svg>",
        path.front().x, path.front().y, path.back().x, path.back().y);
    return std::string("<section><h2>Path from above</h2><p class=\"note\">") +
           (is_aligned ? "Good: the blue path covers the grey truth, and no red ties show."
                       : "No ground truth in this recording: only the estimated path is shown.") +
           "</p>" + svg +
           (is_aligned ? legend({{"var(--path)", "estimated"},
                                 {"var(--truth)", "truth"},
                                 {"var(--bad)", "tie between a pose and its true place"},
                                 {"var(--good)", "start"},
                                 {"var(--ink)", "end"}})
                       : legend({{"var(--path)", "estimated"}, {"var(--good)", "start"}, {"var(--ink)", "end"}})) +
           "</section>";
}

[[nodiscard]] double seconds_of(const RunRecord& run, std::int64_t time_ns) {
    return static_cast<double>(time_ns - run.frames.front().time_ns) * 1e-9;
}

// Runs of equal state as one strip.
[[nodiscard]] std::string state_strip(const RunRecord& run, const TimeChart& chart, double y) {
    std::string svg;
    for (std::size_t i = 0; i < run.frames.size();) {
        std::size_t end = i + 1;
        while (end < run.frames.size() && run.frames[end].state == run.frames[i].state) ++end;
        const double from = chart.x(seconds_of(run, run.frames[i].time_ns));
        const double to = chart.x(seconds_of(run, run.frames[std::min(end, run.frames.size() - 1)].time_ns));
        svg += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"7\" fill=\"{}\"/>", from, y,
                           std::max(to - from, 1.0), state_colour(run.frames[i].state));
        i = end;
    }
    return svg;
}

[[nodiscard]] std::string error_section(const RunRecord& run) {
    TimeChart chart{seconds_of(run, run.frames.back().time_ns), 1};
    std::vector<XY> points;
    if (run.evaluation) {
        chart.top = std::max(0.5, 115 * run.evaluation->ate_max_m);
        const std::size_t stride = 1 + run.evaluation->pairs.size() / 3000;
        for (std::size_t i = 0; i < run.evaluation->pairs.size(); i += stride) {
            const PosePair& pair = run.evaluation->pairs[i];
            points.push_back(
                {chart.x(seconds_of(run, run.estimate[pair.estimate_index].time_ns)), chart.y(100 * pair.error_m)});
        }
    } else {
        chart.height = 64;
    }
    std::string svg;
    if (run.evaluation) {
        svg = chart.begin("error, cm", "error over time") + polyline(points, "var(--path)");
    } else {
        svg = fmt::format("<svg viewBox=\"0 0 {} {}\">", chart.width, chart.height);
    }
    svg += state_strip(run, chart, chart.height - chart.below + 24) + "</svg>";
    return std::string("<section><h2>") +
           (run.evaluation
                ? "Error over time</h2><p class=\"note\">Good: flat and low. The strip below says how sure the engine "
                  "was; where the error is high, it should not be green."
                : "How sure it was</h2><p class=\"note\">Good: green throughout.") +
           (run.unsure_reasons().empty() ? "" : " Unsure frames: " + run.unsure_reasons() + ".") + "</p>" + svg +
           legend({{"var(--good)", "tracked"},
                   {"var(--unsure)", "unsure"},
                   {"var(--bad)", "predicted, not measured"},
                   {"var(--none)", "no pose"}}) +
           "</section>";
}

[[nodiscard]] std::string share_section(const RunRecord& run) {
    const TimeChart chart{seconds_of(run, run.frames.back().time_ns), 100};
    const std::size_t stride = 1 + run.frames.size() / 1500;
    std::string still;
    std::string moving;
    std::vector<XY> line;
    for (std::size_t i = 0; i < run.frames.size(); i += stride) {
        const FrameRecord& frame = run.frames[i];
        const double all = frame.static_features + frame.dynamic_features;
        line.push_back(
            {chart.x(seconds_of(run, frame.time_ns)), chart.y(all > 0 ? 100 * frame.static_features / all : 0)});
    }
    std::string path;
    for (const XY& p : line) path += fmt::format("L{:.1f} {:.1f}", p.x, p.y);
    const auto area = [&](double base) {
        return fmt::format("M{:.1f} {:.1f}{}L{:.1f} {:.1f}Z", line.front().x, base, path, line.back().x, base);
    };
    std::string svg = chart.begin("features, %", "static and moving features");
    svg += fmt::format(
        "<path d=\"{}\" fill=\"var(--good)\" opacity=\"0.55\"/><path d=\"{}\" fill=\"var(--bad)\" "
        "opacity=\"0.55\"/></svg>",
        area(chart.y(0)), area(chart.y(100)));
    return "<section><h2>Static and moving features</h2><p class=\"note\">How many features stand still with the "
           "room, beside those that move against it: on a body of its own, or seen to move before. In an empty room "
           "nearly all "
           "should be green; when people fill the "
           "picture, red grows, and the path should not care.</p>" +
           svg + legend({{"var(--good)", "static: used for the pose"}, {"var(--bad)", "moving: left out"}}) +
           "</section>";
}

[[nodiscard]] std::string time_section(const RunRecord& run) {
    TimeChart chart{seconds_of(run, run.frames.back().time_ns), std::max(1.0, std::min(run.frame_ms.max(), 40.0))};
    chart.height = 180;
    std::vector<XY> points;
    const std::size_t stride = 1 + run.frames.size() / 3000;
    for (std::size_t i = 0; i < run.frames.size(); i += stride) {
        points.push_back(
            {chart.x(seconds_of(run, run.frames[i].time_ns)), chart.y(static_cast<double>(run.frames[i].ms))});
    }
    std::string html =
        "<section><h2>Time</h2><p class=\"note\">From a frame going in to its pose coming out, one thread. Good: "
        "even, and far below the 33 ms between two frames.</p>" +
        chart.begin("ms per frame", "time per frame") + polyline(points, "var(--path)", 1.4) + "</svg>";
    double longest = 1e-9;
    for (const StageRecord& stage : run.stages) longest = std::max(longest, stage.ms.p99());
    if (run.stages.empty()) return html + "</section>";
    html += "<table><tr><th>stage</th><th></th><th>median ms</th><th>99 % ms</th><th>max ms</th></tr>";
    const auto row = [&](const std::string& name, const Percentiles& ms, bool has_bar) {
        return fmt::format(
            "<tr><td>{}</td><td>{}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td></tr>", escaped(name),
            has_bar ? fmt::format("<div class=\"rail\"><div class=\"bar\" style=\"width:{:.1f}%\"></div></div>",
                                  100 * ms.median() / longest)
                    : "",
            ms.median(), ms.p99(), ms.max());
    };
    for (const StageRecord& stage : run.stages) html += row(stage.name, stage.ms, true);
    return html + row("whole frame", run.frame_ms, false) + "</table></section>";
}

[[nodiscard]] std::string memory_section(const RunRecord& run) {
    std::string html = fmt::format(
        "<section><h2>Memory</h2><p class=\"note\">The engine was given one block of {:.1f} MiB and laid out {:.1f} "
        "MiB of it; "
        "it never asks for more. The program's peak was {:.1f} MiB. The bars show how full each pool ever was; a full "
        "pool is normal: it forgets the oldest.</p><table><tr><th>pool</th><th></th><th>most in "
        "use</th><th>limit</th></tr>",
        mib(run.block_bytes), mib(run.arena_used_bytes), mib(run.peak_resident_bytes));
    for (const PoolRecord& pool : run.pools) {
        const double share =
            pool.limit == 0 ? 0 : static_cast<double>(pool.high_water) / static_cast<double>(pool.limit);
        html += fmt::format(
            "<tr><td>{}</td><td><div class=\"rail\"><div class=\"bar\" style=\"width:{:.1f}%\"></div></div>"
            "</td><td>{}</td><td>{}</td></tr>",
            escaped(pool.name), 100 * std::min(share, 1.0), pool.high_water, pool.limit);
    }
    return html + "</table></section>";
}

[[nodiscard]] std::string background_section(const RunRecord& run) {
    std::string html =
        "<section><h2>Background work</h2><p class=\"note\">Mapping works in slices between the frames, on the same "
        "thread. Good: slices far below 2 ms, no keyframe refused, no deadline missed.</p><table>";
    const auto row = [&html](const char* name, const std::string& value) {
        html += fmt::format("<tr><td>{}</td><td>{}</td></tr>", name, value);
    };
    const ScheduleStatistics& s = run.schedule;
    row("work units per frame, spent of granted",
        fmt::format("{:.0f} of {:.0f}", run.units_per_frame(s.units_spent), run.units_per_frame(s.units_granted)));
    row("slices, the largest",
        fmt::format("{}, {} units, {:.2f} ms", s.slices, s.largest_slice_units, run.slice_ms.max()));
    row("ms behind a frame, median / 99 % / max", fmt::format("{:.2f} / {:.2f} / {:.2f}", run.background_ms.median(),
                                                              run.background_ms.p99(), run.background_ms.max()));
    row("keyframes made, forgotten, refused",
        fmt::format("{}, {}, {}", run.keyframes_made, run.keyframes_forgotten, run.keyframes_refused));
    if (run.has_vocabulary) {
        const LoopStatistics& l = run.loops;
        row("loops closed, confirmed, places verified", fmt::format("{}, {}, {}", l.closed, l.confirmed, l.candidates));
        row("places refused: matches, pose, inliers, spread, far, beyond drift",
            fmt::format("{}, {}, {}, {}, {}, {}", l.refused_matches, l.refused_pose, l.refused_inliers,
                        l.refused_spread, l.refused_far, l.refused_unlikely));
        row("largest correction", fmt::format("{:.3f} m", l.largest_correction_m));
        row("relocalisations", fmt::format("{}", l.relocalisations));
    }
    row("keyframes waiting at most",
        fmt::format("{} of {}", run.keyframe_queue.high_water, run.keyframe_queue.capacity));
    row("points forgotten", fmt::format("{}", run.points_forgotten));
    row("latency, median / 99 % / 99.9 % / max",
        fmt::format("{:.2f} / {:.2f} / {:.2f} / {:.2f} ms", run.latency_ms.median(), run.latency_ms.p99(),
                    run.latency_ms.at(0.999), run.latency_ms.max()));
    if (run.frame_period_ms > 0) {
        row("deadlines missed", fmt::format("{} of {} frames took longer than {:.1f} ms", run.deadline_misses,
                                            run.frames_total, run.frame_period_ms));
    }
    if (run.is_realtime) row("frames dropped because they were late", fmt::format("{}", run.frames_dropped));
    if (!run.recording.empty()) {
        row("recording", fmt::format("{}, {} frames", escaped(run.recording), run.frames_recorded));
    }
    return html + "</table></section>";
}

[[nodiscard]] std::string frame_figure(const RunRecord& run, const MeshSnapshot& snapshot) {
    constexpr std::array<const char*, 8> kGroups = {"#ffb000", "#ff5fd2", "#b388ff", "#ff8a5c",
                                                    "#ffe45c", "#d2691e", "#c8ff6b", "#ff9db0"};
    std::string kept;
    std::string cut;
    std::size_t kept_count = 0;
    for (const MeshSnapshot::Edge& edge : snapshot.edges) {
        (edge.is_kept ? kept : cut) += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", edge.x0, edge.y0, edge.x1, edge.y1);
        kept_count += edge.is_kept ? 1U : 0U;
    }
    // One path of dots per colour; a dot is a line of no length with round ends.
    std::array<std::string, kGroups.size()> groups;
    std::string chosen;
    std::string alone;
    for (const MeshSnapshot::Point& point : snapshot.points) {
        std::string& path = point.is_static   ? chosen
                            : point.group < 0 ? alone
                                              : groups[static_cast<std::size_t>(point.group) % kGroups.size()];
        path += fmt::format("M{:.1f} {:.1f}h0", point.x, point.y);
    }
    std::string svg = fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\"><image width=\"{0}\" height=\"{1}\" "
        "href=\"data:image/png;base64,{2}\"/>",
        snapshot.width, snapshot.height, base64(snapshot.grey_png));
    svg += fmt::format("<path class=\"kept\" d=\"{}\" stroke=\"#28d765\" stroke-width=\"1\" opacity=\"0.8\"/>", kept);
    svg += fmt::format("<path class=\"cut\" d=\"{}\" stroke=\"#ff3b3b\" stroke-width=\"1.2\" opacity=\"0.85\"/>", cut);
    svg += "<g class=\"points\" stroke-linecap=\"round\" stroke-width=\"5\">";
    const auto dots = [&svg](const std::string& path, const char* colour) {
        if (!path.empty()) svg += fmt::format("<path d=\"{}\" stroke=\"{}\"/>", path, colour);
    };
    dots(alone, "#aab2bd");
    for (std::size_t i = 0; i < groups.size(); ++i) dots(groups[i], kGroups[i]);
    dots(chosen, "#2f8bff");
    return fmt::format(
        "<figure>{}</g></svg><figcaption>frame {}, {:.1f} s, {}: {} of {} edges kept, {:.0f} % "
        "moving</figcaption></figure>",
        svg, snapshot.frame, seconds_of(run, snapshot.time_ns), pose_state_name(snapshot.state), kept_count,
        snapshot.edges.size(), 100 * snapshot.dynamic_share);
}

[[nodiscard]] std::string frames_section(const RunRecord& run) {
    if (run.snapshots.empty()) return {};
    std::string html =
        "<section id=\"frames\"><h2>What it saw</h2><p class=\"note\">The mesh over the matched features. An edge is "
        "kept "
        "while its two ends keep their distance, and cut when they do not. Who walks keeps the distances within his "
        "own "
        "body, and slowly changes those to the room, so green edges lie on people too; a group ends at steps in depth "
        "as "
        "well. Good: blue points, the group taken for the room, lie on the room alone, and people have other "
        "colours.</p><p><label><input type=\"checkbox\" "
        "data-layer=\"kept\" checked> kept edges</label><label><input type=\"checkbox\" data-layer=\"cut\" checked> "
        "cut "
        "edges</label><label><input type=\"checkbox\" data-layer=\"points\" checked> features</label></p>" +
        legend({{"#28d765", "kept edge"},
                {"#ff3b3b", "cut edge"},
                {"#2f8bff", "static group"},
                {"linear-gradient(90deg,#ffb000,#ff5fd2,#b388ff)", "other groups"},
                {"#aab2bd", "in no group"}}) +
        "<div class=\"frames\">";
    for (const MeshSnapshot& snapshot : run.snapshots) html += frame_figure(run, snapshot);
    return html + "</div></section>";
}

}  // namespace

std::string report_html(const RunRecord& run) {
    std::string html = kHead;
    html += fmt::format(
        "<header><h1>Where the camera went</h1><p>{}, {} frames, calibration {}, limits {}, features {}, "
        "state hash {:016x}</p><p><code>{}</code></p></header>",
        escaped(run.input), run.frames_total, escaped(run.calibration), escaped(run.limits), escaped(run.features),
        run.state_hash, escaped(run.command));
    for (const std::string& problem : run.problems) {
        html += "<section class=\"problem\">" + escaped(problem) + "</section>";
    }
    for (const std::string& note : run.notes) html += "<p class=\"note\">Note: " + escaped(note) + "</p>";
    if (run.frames.empty()) return html + "<section>No frame was tracked.</section>" + kTail;
    html += cards(run) + path_section(run) + frames_section(run) + error_section(run) + share_section(run) +
            time_section(run) + background_section(run) + memory_section(run);
    return html + kTail;
}

bool write_report(const RunRecord& record, const std::string& file, std::string& message) {
    return write_whole_file(file, report_html(record), message);
}

}  // namespace stillmesh
