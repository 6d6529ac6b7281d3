#include "bench/accuracy/tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bench/accuracy/gate.hpp"

namespace stillmesh::accuracy {
namespace {

// The results of one scene and variant.
struct Bundle {
    std::string scene, variant;
    std::vector<const Result*> runs;
};

std::vector<Bundle> bundles_of(const std::vector<Result>& results) {
    std::vector<Bundle> out;
    for (const Result& result : results) {
        auto at = std::find_if(out.begin(), out.end(), [&](const Bundle& bundle) {
            return bundle.scene == result.scene && bundle.variant == result.variant;
        });
        if (at == out.end()) at = out.insert(out.end(), {result.scene, result.variant, {}});
        at->runs.push_back(&result);
    }
    return out;
}

std::string metres(double value) {
    return value < 0 || std::isnan(value) ? "-" : fmt::format("{:.4f}", value);
}

std::string percent(std::uint64_t part, std::uint64_t whole, int digits = 1) {
    return whole == 0 ? "-"
                      : fmt::format("{:.{}f}", 100 * static_cast<double>(part) / static_cast<double>(whole), digits);
}

std::string mean(double sum, std::uint64_t count) {
    return count == 0 ? "-" : fmt::format("{:.1f}", sum / static_cast<double>(count));
}

template <typename Get>
std::uint64_t sum(const Bundle& bundle, Get get) {
    std::uint64_t out = 0;
    for (const Result* run : bundle.runs) out += get(run->measures);
    return out;
}
template <typename Get>
double sum_of(const Bundle& bundle, Get get) {
    double out = 0;
    for (const Result* run : bundle.runs) out += get(run->measures);
    return out;
}

}  // namespace

std::string run_table(const std::vector<Result>& results) {
    std::string out = fmt::format(
        "{:<20} {:>4} {:<8} {:>6} {:>6} {:>7} {:>7} {:>7} {:>6} {:>6} {:>6} {:>5} {:>5} {:>6} {:>6} {:>6} {:>6} {:>6} "
        "{:>6} "
        "{:>6} {:>4} {:>5} {:>5}\n",
        "scene", "seed", "region", "frames", "cover%", "ATE m", "max m", "RPE m", "deg", "track%", "unsure", "pred",
        "none", "wrong%", "first", "right%", "NEES", "mov.a%", "recal%", "wrongc", "kf", "ms", "p99");
    for (const Result& result : results) {
        const Measures& m = result.measures;
        out += fmt::format(
            "{:<20} {:>4} {:<8} {:>6} {:>6} {:>7} {:>7} {:>7} {:>6} {:>6} {:>6} {:>5} {:>5} {:>6} {:>6} {:>6} {:>6} "
            "{:>6} "
            "{:>6} {:>6} {:>4} {:>5.1f} {:>5.1f}{}\n",
            result.scene, result.seed, result.variant, m.frames, percent(m.tracked + m.unsure, m.frames),
            metres(m.ate_m), metres(m.ate_max_m), metres(m.rpe_m),
            m.rpe_deg < 0 ? "-" : fmt::format("{:.2f}", m.rpe_deg), percent(m.tracked, m.frames),
            percent(m.unsure, m.frames), percent(m.predicted, m.frames), percent(m.none, m.frames),
            percent(m.wrong_tracked, m.judged_tracked, 2),
            m.wrong_tracked == 0 ? "-" : fmt::format("{}", m.wrong_first), percent(m.right_tracked, m.right),
            mean(m.nees_first_sum, m.nees_frames), percent(m.moving_accepted, m.moving),
            percent(m.still_accepted, m.still), m.masked_frames == 0 ? "-" : fmt::format("{}", m.wrong_choices),
            m.keyframes, m.median_ms, m.p99_ms, m.is_lost() ? "  LOST" : "");
    }
    return out +
           "wrong%: of the tracked frames, motion over the last second off by more than 5 cm or 3 degrees; first: the "
           "first such frame.\nright%: of the right frames, tracked. NEES: first pose aligned (ideal 6). mov.a%: "
           "moving "
           "matches accepted as static. recal%: still matches\naccepted. wrongc: frames with most votes on moving "
           "pixels.\n";
}

std::string scene_table(const std::vector<Result>& results) {
    std::string out =
        fmt::format("{:<20} {:<8} {:>5} {:>8} {:>8} {:>6} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>6}\n", "scene",
                    "region", "seeds", "ATE mean", "worst", "bar", "cover%", "worst", "RPE m", "wrong%", "right%",
                    "mov.a%", "recall%", "wrongc");
    for (const Bundle& bundle : bundles_of(results)) {
        double ate = 0, ate_worst = 0, rpe = 0, cover_worst = 1;
        bool is_measured = true;
        std::size_t lost = 0;
        const auto count = static_cast<double>(bundle.runs.size());
        for (const Result* run : bundle.runs) {
            const Measures& m = run->measures;
            is_measured = is_measured && m.ate_m >= 0;
            ate += m.ate_m / count;
            ate_worst = std::max(ate_worst, m.ate_m);
            rpe += m.rpe_m / count;
            cover_worst = std::min(cover_worst, m.coverage());
            lost += m.is_lost();
        }
        const double bar = ate_bar(*bundle.runs.front());
        const bool is_over =
            bar > 0 && (bundle.variant == "on" || bundle.variant == "alone") && (ate_worst > bar || !is_measured);
        out +=
            fmt::format("{:<20} {:<8} {:>5} {:>8} {:>8} {:>6} {:>7} {:>7.1f} {:>7} {:>7} {:>7} {:>7} {:>7} {:>6}{}{}\n",
                        bundle.scene, bundle.variant, bundle.runs.size(), is_measured ? metres(ate) : "-",
                        metres(ate_worst), bar > 0 ? fmt::format("{:.3f}", bar) : "-",
                        percent(sum(bundle, [](const Measures& m) { return m.tracked + m.unsure; }),
                                sum(bundle, [](const Measures& m) { return m.frames; })),
                        100 * cover_worst, metres(rpe),
                        percent(sum(bundle, [](const Measures& m) { return m.wrong_tracked; }),
                                sum(bundle, [](const Measures& m) { return m.judged_tracked; }), 2),
                        percent(sum(bundle, [](const Measures& m) { return m.right_tracked; }),
                                sum(bundle, [](const Measures& m) { return m.right; })),
                        percent(sum(bundle, [](const Measures& m) { return m.moving_accepted; }),
                                sum(bundle, [](const Measures& m) { return m.moving; })),
                        percent(sum(bundle, [](const Measures& m) { return m.still_accepted; }),
                                sum(bundle, [](const Measures& m) { return m.still; })),
                        percent(sum(bundle, [](const Measures& m) { return m.wrong_choices; }),
                                sum(bundle, [](const Measures& m) { return m.masked_frames; })),
                        lost > 0 ? fmt::format("  {} LOST", lost) : "", is_over ? "  over the bar" : "");
    }
    return out;
}

std::string shares_table(const std::vector<Result>& results) {
    // Columns are scenes with moving bodies; rows the variants.
    std::vector<Bundle> bundles = bundles_of(results);
    std::erase_if(bundles,
                  [](const Bundle& bundle) { return sum(bundle, [](const Measures& m) { return m.moving; }) == 0; });
    std::vector<std::string> scenes, variants;
    for (const Bundle& bundle : bundles) {
        if (std::find(scenes.begin(), scenes.end(), bundle.scene) == scenes.end()) scenes.push_back(bundle.scene);
        if (std::find(variants.begin(), variants.end(), bundle.variant) == variants.end()) {
            variants.push_back(bundle.variant);
        }
    }
    if (scenes.empty()) return "";
    std::string out = "ATE m / moving matches accepted as static % / still matches accepted % / wrong choices %\n";
    out += fmt::format("{:<20}", "");
    for (const std::string& variant : variants) {
        out += fmt::format(" {:<28}", variant == "on"    ? "region on"
                                      : variant == "off" ? "region off (all matches)"
                                                         : variant);
    }
    out += "\n";
    for (const std::string& scene : scenes) {
        out += fmt::format("{:<20}", scene);
        for (const std::string& variant : variants) {
            std::string cell = "-";
            for (const Bundle& bundle : bundles) {
                if (bundle.scene != scene || bundle.variant != variant) continue;
                const double ate =
                    sum_of(bundle, [](const Measures& m) { return m.ate_m; }) / static_cast<double>(bundle.runs.size());
                cell = fmt::format("{} / {} / {} / {}", metres(ate),
                                   percent(sum(bundle, [](const Measures& m) { return m.moving_accepted; }),
                                           sum(bundle, [](const Measures& m) { return m.moving; })),
                                   percent(sum(bundle, [](const Measures& m) { return m.still_accepted; }),
                                           sum(bundle, [](const Measures& m) { return m.still; })),
                                   percent(sum(bundle, [](const Measures& m) { return m.wrong_choices; }),
                                           sum(bundle, [](const Measures& m) { return m.masked_frames; })));
            }
            out += fmt::format(" {:<28}", cell);
        }
        out += "\n";
    }
    return out;
}

std::string nees_table(const std::vector<Result>& results) {
    std::string out;
    for (const Bundle& bundle : bundles_of(results)) {
        const std::uint64_t n = sum(bundle, [](const Measures& m) { return m.nees_frames; });
        const std::uint64_t bad = sum(bundle, [](const Measures& m) { return m.covariance_bad; });
        if (group_of(*bundle.runs.front()) != Group::kStatic || bundle.variant == "off" || n + bad == 0) continue;
        const auto root_mean = [&](double total) { return n == 0 ? 0 : std::sqrt(total / static_cast<double>(n)); };
        constexpr double kDegrees = 180 / 3.14159265358979323846;
        out += fmt::format(
            "{:<20} {:<8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>9.2f} {:>9.2f} {:>9.3f} {:>9.3f} {:>5}\n",
            bundle.scene, bundle.variant, mean(sum_of(bundle, [](const Measures& m) { return m.nees_first_sum; }), n),
            mean(sum_of(bundle, [](const Measures& m) { return m.nees_first_translation_sum; }), n),
            mean(sum_of(bundle, [](const Measures& m) { return m.nees_first_rotation_sum; }), n),
            mean(sum_of(bundle, [](const Measures& m) { return m.nees_fit_sum; }), n),
            mean(sum_of(bundle, [](const Measures& m) { return m.nees_fit_translation_sum; }), n),
            mean(sum_of(bundle, [](const Measures& m) { return m.nees_fit_rotation_sum; }), n),
            mean(sum_of(bundle, [](const Measures& m) { return m.nees_ate_sum; }), n),
            1000 * root_mean(sum_of(bundle, [](const Measures& m) { return m.fit_m2_sum; })),
            1000 * root_mean(sum_of(bundle, [](const Measures& m) { return m.said_m2_sum; })),
            kDegrees * root_mean(sum_of(bundle, [](const Measures& m) { return m.fit_rad2_sum; })),
            kDegrees * root_mean(sum_of(bundle, [](const Measures& m) { return m.said_rad2_sum; })), bad);
    }
    if (out.empty()) return out;
    return fmt::format("{:<20} {:<8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>9} {:>9} {:>9} {:>9} {:>5}\n",
                       "NEES, static scenes", "region", "first", "transl", "rotat", "fit", "transl", "rotat", "ate",
                       "error mm", "said mm", "error deg", "said deg", "bad") +
           out +
           "first: first pose aligned (the promise; ideal 6), of it translation and rotation alone (ideal 3 each); "
           "fit: "
           "all poses aligned; ate: aligned as for ATE.\nerror: RMS after the fit; said: RMS the covariance says; bad: "
           "covariances that cannot be inverted.\n";
}

std::string mapping_table(const std::vector<Result>& results) {
    const std::vector<MappingSet> sets = mapping_sets(results);
    if (sets.empty()) return "";
    std::string out =
        fmt::format("{:<20} {:>5} {:>9} {:>9} {:>7}\n", "mean ATE m", "runs", "mapping", "alone", "ratio");
    for (const MappingSet& set : sets) {
        out += fmt::format("{:<20} {:>5} {:>9.4f} {:>9.4f} {:>7.2f}{}\n", set.name, set.runs, set.on_m, set.alone_m,
                           set.ratio(), set.ratio() > kMappingSetGoal ? "  worse than it should be" : "");
    }
    const MappingSet mean = mapping_mean(sets);
    return out + fmt::format(
                     "{:<20} {:>5} {:>9.4f} {:>9.4f} {:>7.2f}\nto reach: mean {:.2f}, no set above {:.2f}; "
                     "gated today: mean {:.2f}, no set above {:.2f} or {:.0f} mm more. Sets of at least {} "
                     "frames.\n",
                     mean.name, mean.runs, mean.on_m, mean.alone_m, mean.ratio(), kMappingMeanGoal, kMappingSetGoal,
                     kMappingMeanMax, kMappingSetGoal, 1000 * kMappingSetSlack_m, kMappingFramesMin);
}

// How often a pose is wrong, by what the engine said of it: all simulated scenes together, those without a bar too.
[[nodiscard]] static std::string states_table(const std::vector<Result>& results) {
    struct Row {
        const char* name;
        std::uint64_t Measures::*judged;
        std::uint64_t Measures::*wrong;
    };
    constexpr Row kRows[] = {{"tracked", &Measures::judged_tracked, &Measures::wrong_tracked},
                             {"unsure", &Measures::judged_unsure, &Measures::wrong_unsure},
                             {"predicted", &Measures::judged_predicted, &Measures::wrong_predicted}};
    std::string out;
    for (const Row& row : kRows) {
        std::uint64_t judged = 0, wrong = 0;
        for (const Result& result : results) {
            if (result.variant != "on" || result.is_recording) continue;
            judged += result.measures.*row.judged;
            wrong += result.measures.*row.wrong;
        }
        if (judged > 0) {
            out += fmt::format("wrong when {:<10}{} % ({} of {}, all simulated scenes)\n", row.name,
                               percent(wrong, judged, 3), wrong, judged);
        }
    }
    return out;
}

std::string summary(const std::vector<Result>& results) {
    std::string out = states_table(results);
    const Sureness s = sureness_of(results);
    if (s.judged_tracked > 0) {
        out += fmt::format("tracked but wrong    {} % ({} of {}; at most {:.1f} %)\n",
                           percent(s.wrong_tracked, s.judged_tracked, 3), s.wrong_tracked, s.judged_tracked,
                           100 * kWrongTrackedMax);
    }
    if (s.right > 0) {
        out += fmt::format("right and tracked    {} % ({} of {}; at least {:.0f} %)\n",
                           percent(s.right_tracked, s.right), s.right_tracked, s.right, 100 * kRightTrackedMin);
    }
    const Consistency c = consistency_of(results);
    if (c.frames > 0) {
        out += fmt::format(
            "NEES, static scenes  {:.2f} first pose aligned ({:.0f} to {:.0f}); {:.2f} fit; {:.2f} as ATE\n", c.first,
            kNeesMin, kNeesMax, c.fit, c.ate);
    }
    const RegionEarns r = region_earns(results);
    if (r.runs > 0) {
        out += fmt::format(
            "walking scenes       mean ATE {:.4f} m with region extraction, {:.4f} m without: {:.1f} times (at least "
            "{:.0f})\n",
            r.on_m, r.off_m, r.ratio(), kRegionEarnsMin);
    }
    return out;
}

}  // namespace stillmesh::accuracy
