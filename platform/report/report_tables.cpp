#include "platform/report/report_tables.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace stillmesh {
namespace {

[[nodiscard]] double mib(std::size_t bytes) {
    return static_cast<double>(bytes) / (1024.0 * 1024.0);
}

[[nodiscard]] std::string bar(double share) {
    return fmt::format("<span class=\"rail\"><span style=\"width:{:.1f}%\"></span></span>", 100 * std::min(share, 1.0));
}

[[nodiscard]] std::string card(const char* grade, const std::string& value, const std::string& name,
                               const std::string& what) {
    return fmt::format("<div class=\"card\"><span>{}</span><b>{}</b><em class=\"{}\">{}</em> <span>{}</span></div>",
                       name, value, grade, grade, what);
}

// Small numbers keep what is in them.
[[nodiscard]] std::string short_number(double value) {
    return value < 1 ? fmt::format("{:.2f}", value) : fmt::format("{:.1f}", value);
}

// Between two frames of the camera; where that is not known, of one with 30 a second.
[[nodiscard]] double period_ms(const RunRecord& run) {
    return run.frame_period_ms > 0 ? run.frame_period_ms : 1000.0 / 30;
}

[[nodiscard]] std::string time_section(const RunRecord& run) {
    double longest = 1e-9;
    for (const StageRecord& stage : run.stages) longest = std::max(longest, stage.ms.p99());
    std::string html = fmt::format(
        "<section class=\"wide\"><h2>Time</h2><p class=\"note\">From a frame going in to its pose coming out, one "
        "thread. Good: even, and far below the {:.0f} ms between two frames.</p><div class=\"scroll\"><table "
        "class=\"numbers\"><tr><th scope=\"col\">stage</th><td></td><th scope=\"col\">median ms</th><th "
        "scope=\"col\">99 % ms</th><th scope=\"col\">max ms</th></tr>",
        period_ms(run));
    const auto row = [&](const std::string& name, const Percentiles& ms, bool has_bar) {
        return fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td><td>{:.2f}</td><td>{:.2f}</td><td>{:.2f}</td></tr>",
                           escaped(name), has_bar ? bar(ms.median() / longest) : "", ms.median(), ms.p99(), ms.max());
    };
    for (const StageRecord& stage : run.stages) html += row(stage.name, stage.ms, true);
    return html + row("whole frame", run.frame_ms, false) + "</table></div></section>";
}

[[nodiscard]] std::string memory_section(const RunRecord& run) {
    std::string html = fmt::format(
        "<section class=\"wide\"><h2>Memory</h2><p class=\"note\">The engine was given one block of {:.1f} MiB and "
        "laid out {:.1f} "
        "MiB of it; it never asks for more. The program's peak was {:.1f} MiB. The bars show how full each pool ever "
        "was; a full "
        "pool is normal: it forgets what is least useful.</p><div class=\"scroll\"><table class=\"numbers\"><tr><th "
        "scope=\"col\">pool</th><td></td>"
        "<th scope=\"col\">most in use</th><th scope=\"col\">limit</th></tr>",
        mib(run.block_bytes), mib(run.arena_used_bytes), mib(run.peak_resident_bytes));
    for (const PoolRecord& pool : run.pools) {
        const double share =
            pool.limit == 0 ? 0 : static_cast<double>(pool.high_water) / static_cast<double>(pool.limit);
        html += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td></tr>", escaped(pool.name),
                            bar(share), pool.high_water, pool.limit);
    }
    return html + "</table></div></section>";
}

[[nodiscard]] std::string background_section(const RunRecord& run) {
    std::string html =
        "<section class=\"full\"><h2>Background work</h2><p class=\"note\">Mapping works in slices between the frames, "
        "on the same "
        "thread. Good: slices far below 2 ms, no keyframe refused, no deadline missed.</p><table class=\"numbers\">";
    const auto row = [&html](const char* name, const std::string& value) {
        html += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>", name, value);
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

}  // namespace

std::string escaped(const std::string& text) {
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

std::string report_cards(const RunRecord& run) {
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
    html += card(run.frame_ms.p99() <= period_ms(run) ? "good" : "bad",
                 fmt::format("{:.1f} / {:.1f} ms", run.frame_ms.median(), run.frame_ms.p99()), "Time per frame",
                 fmt::format("median / 99 %; the next frame comes after {:.0f} ms", period_ms(run)));
    html += card(run.peak_resident_bytes <= std::size_t{80} * 1024 * 1024 ? "good" : "fair",
                 fmt::format("{:.1f} MiB", mib(run.peak_resident_bytes)), "Memory",
                 fmt::format("of the program; the engine's one block is {:.1f} MiB of it", mib(run.block_bytes)));
    return html + "</div>";
}

std::string report_tables(const RunRecord& run) {
    return time_section(run) + memory_section(run) + background_section(run);
}

}  // namespace stillmesh
