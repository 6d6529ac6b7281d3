#include "bench/accuracy/gate.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "hal/simulated/simulated_camera.hpp"

namespace stillmesh::accuracy {
namespace {

constexpr const char* kOn = "on";
constexpr const char* kOff = "off";
constexpr const char* kAlone = "alone";  // tracking without mapping

// Real recordings that must reach something of their own.
struct RecordingBar {
    const char* name;
    double ate_m, ate_alone_m;
};
constexpr RecordingBar kRecordingBars[] = {{"fr1_rpy_a", 0.027, 0.050}, {"fr1_rpy_a_walking", 0.045, 0.080}};

std::string name_of(const Result& result) {
    const std::string name = result.is_recording ? result.scene : fmt::format("{}:{}", result.scene, result.seed);
    return result.variant == kAlone ? name + " (tracking alone)" : name;
}

void check_runs(const std::vector<Result>& results, Group group, const char* gate, std::vector<std::string>& failures) {
    bool is_seen = false;
    for (const Result& result : results) {
        if ((result.variant != kOn && result.variant != kAlone) || group_of(result) != group) continue;
        is_seen = true;
        const Measures& m = result.measures;
        const double bar = ate_bar(result);
        const bool is_seen_throughout = group != Group::kMinority;  // where nothing of the room is in view
        if (is_seen_throughout && m.is_lost()) {
            failures.push_back(fmt::format("{}: {} lost: {} frames in a row without a pose{}", gate, name_of(result),
                                           m.hole_longest, m.ends_with_pose ? "" : ", and none at the end"));
        }
        if (bar > 0 && !(m.ate_m >= 0 && m.ate_m <= bar)) {
            failures.push_back(fmt::format("{}: {} ATE {:.4f} m, at most {:.3f}", gate, name_of(result), m.ate_m, bar));
        }
        if (is_seen_throughout && m.coverage() < kCoverageMin) {
            failures.push_back(fmt::format("{}: {} coverage {:.1f} %, at least {:.0f} %", gate, name_of(result),
                                           100 * m.coverage(), 100 * kCoverageMin));
        }
    }
    if (!is_seen) failures.push_back(fmt::format("{}: no run", gate));
}

// Where the right answer is not to be had, or nothing is promised yet.
bool has_bars(Group group) {
    return group != Group::kOpen && group != Group::kDirty;
}

}  // namespace

Group group_of(const Result& result) {
    if (result.is_recording) return Group::kRecording;
    if (!result.dirt.empty()) return Group::kDirty;
    for (const SimulatedScene& scene : simulated_scenes()) {
        if (result.scene == scene.name && !is_clean(scene.dirt)) return Group::kDirty;
    }
    if (result.scene.starts_with("static_")) return Group::kStatic;
    if (result.scene.starts_with("sitting_")) return Group::kSitting;
    if (result.scene.starts_with("walking_")) return Group::kWalking;
    if (result.scene == "rearranged") return Group::kRearranged;
    if (result.scene == "trolley_returns") return Group::kMinority;
    return result.scene == "trolley_xyz" ? Group::kTrolley : Group::kOpen;
}

double ate_bar(const Result& result) {
    const bool is_alone = result.variant == kAlone;
    switch (group_of(result)) {
        case Group::kStatic:
        case Group::kSitting: return is_alone ? 0.02 : 0.008;
        case Group::kRearranged: return 0.02;
        case Group::kWalking: return is_alone ? 0.04 : 0.02;
        case Group::kTrolley: return is_alone ? 0.08 : 0.05;
        case Group::kMinority: return is_alone ? 0 : 0.02;
        case Group::kDirty:
        case Group::kOpen: return 0;
        case Group::kRecording:
            for (const RecordingBar& bar : kRecordingBars) {
                if (result.scene == bar.name) return is_alone ? bar.ate_alone_m : bar.ate_m;
            }
            return 0;
    }
    return 0;
}

Sureness sureness_of(const std::vector<Result>& results) {
    Sureness out;
    for (const Result& result : results) {
        if (result.variant != kOn || !has_bars(group_of(result))) continue;
        if (!result.is_recording) {
            out.judged_tracked += result.measures.judged_tracked;
            out.wrong_tracked += result.measures.wrong_tracked;
        }
        out.right += result.measures.right;
        out.right_tracked += result.measures.right_tracked;
    }
    return out;
}

Consistency consistency_of(const std::vector<Result>& results) {
    Consistency out;
    for (const Result& result : results) {
        if (result.variant != kOn || group_of(result) != Group::kStatic) continue;
        out.frames += result.measures.nees_frames;
        out.covariance_bad += result.measures.covariance_bad;
        out.first += result.measures.nees_first_sum;
        out.fit += result.measures.nees_fit_sum;
        out.ate += result.measures.nees_ate_sum;
    }
    if (out.frames > 0) {
        const auto count = static_cast<double>(out.frames);
        out.first /= count;
        out.fit /= count;
        out.ate /= count;
    }
    return out;
}

RegionEarns region_earns(const std::vector<Result>& results) {
    RegionEarns out;
    for (const Result& on : results) {
        if (on.variant != kOn || group_of(on) != Group::kWalking || on.measures.ate_m < 0) continue;
        for (const Result& off : results) {
            if (off.variant != kOff || off.scene != on.scene || off.seed != on.seed || off.is_recording ||
                off.measures.ate_m < 0) {
                continue;
            }
            ++out.runs;
            out.on_m += on.measures.ate_m;
            out.off_m += off.measures.ate_m;
        }
    }
    if (out.runs > 0) {
        out.on_m /= static_cast<double>(out.runs);
        out.off_m /= static_cast<double>(out.runs);
    }
    return out;
}

std::vector<MappingSet> mapping_sets(const std::vector<Result>& results) {
    std::vector<MappingSet> out;
    for (const Result& on : results) {
        const Group group = group_of(on);
        if (on.variant != kOn || !has_bars(group) || group == Group::kMinority || on.measures.ate_m < 0) continue;
        if (on.measures.frames < kMappingFramesMin) continue;
        for (const Result& alone : results) {
            if (alone.variant != kAlone || alone.scene != on.scene || alone.seed != on.seed ||
                alone.is_recording != on.is_recording || alone.measures.ate_m < 0) {
                continue;
            }
            auto at = std::find_if(out.begin(), out.end(), [&](const MappingSet& set) { return set.name == on.scene; });
            if (at == out.end()) at = out.insert(out.end(), MappingSet{on.scene, 0, 0, 0});
            ++at->runs;
            at->on_m += on.measures.ate_m;
            at->alone_m += alone.measures.ate_m;
        }
    }
    for (MappingSet& set : out) {
        set.on_m /= static_cast<double>(set.runs);
        set.alone_m /= static_cast<double>(set.runs);
    }
    return out;
}

MappingSet mapping_mean(const std::vector<MappingSet>& sets) {
    MappingSet out;
    out.name = "all sets";
    for (const MappingSet& set : sets) {
        out.runs += set.runs;
        out.on_m += set.on_m / static_cast<double>(sets.size());
        out.alone_m += set.alone_m / static_cast<double>(sets.size());
    }
    return out;
}

const std::vector<std::string>& gate_names() {
    static const std::vector<std::string> names = {"static",   "sitting",    "walking",    "trolley",
                                                   "minority", "rearranged", "recordings", "tracked",
                                                   "right",    "nees",       "region",     "mapping"};
    return names;
}

std::vector<std::string> failures_of(const std::vector<Result>& results, const std::vector<std::string>& names) {
    std::vector<std::string> failures;
    const auto is_wanted = [&](const char* name) { return std::find(names.begin(), names.end(), name) != names.end(); };
    const auto missing = [&](const char* gate) { failures.push_back(fmt::format("{}: no run", gate)); };
    if (is_wanted("static")) check_runs(results, Group::kStatic, "static", failures);
    if (is_wanted("sitting")) check_runs(results, Group::kSitting, "sitting", failures);
    if (is_wanted("walking")) check_runs(results, Group::kWalking, "walking", failures);
    if (is_wanted("trolley")) check_runs(results, Group::kTrolley, "trolley", failures);
    if (is_wanted("minority")) check_runs(results, Group::kMinority, "minority", failures);
    if (is_wanted("rearranged")) check_runs(results, Group::kRearranged, "rearranged", failures);
    if (is_wanted("recordings")) check_runs(results, Group::kRecording, "recordings", failures);
    const Sureness s = sureness_of(results);
    if (is_wanted("tracked")) {
        if (s.judged_tracked == 0) missing("tracked");
        const double wrong = Measures::share(s.wrong_tracked, s.judged_tracked);
        if (wrong > kWrongTrackedMax) {
            failures.push_back(
                fmt::format("tracked: {:.2f} % of the tracked frames are wrong ({} of {}), at most {:.1f} %",
                            100 * wrong, s.wrong_tracked, s.judged_tracked, 100 * kWrongTrackedMax));
        }
    }
    if (is_wanted("right")) {
        if (s.right == 0) missing("right");
        const double right = Measures::share(s.right_tracked, s.right, 1);
        if (right < kRightTrackedMin) {
            failures.push_back(
                fmt::format("right: {:.1f} % of the right frames are tracked ({} of {}), at least {:.0f} %",
                            100 * right, s.right_tracked, s.right, 100 * kRightTrackedMin));
        }
    }
    if (is_wanted("nees")) {
        const Consistency c = consistency_of(results);
        if (c.frames == 0 && c.covariance_bad == 0) missing("nees");
        if (c.covariance_bad > 0) {
            failures.push_back(fmt::format("nees: {} covariances cannot be inverted", c.covariance_bad));
        }
        if (c.frames > 0 && !(c.first >= kNeesMin && c.first <= kNeesMax)) {
            failures.push_back(fmt::format("nees: {:.2f} on static scenes, from {:.0f} to {:.0f} (ideal 6)", c.first,
                                           kNeesMin, kNeesMax));
        }
    }
    if (is_wanted("region")) {
        const RegionEarns r = region_earns(results);
        if (r.runs == 0) missing("region");
        if (r.runs > 0 && r.ratio() < kRegionEarnsMin) {
            failures.push_back(fmt::format(
                "region: walking scenes {:.4f} m with, {:.4f} m without extraction: {:.1f} times, at least {:.0f}",
                r.on_m, r.off_m, r.ratio(), kRegionEarnsMin));
        }
    }
    if (is_wanted("mapping")) {
        const std::vector<MappingSet> sets = mapping_sets(results);
        if (sets.empty()) missing("mapping");
        const MappingSet mean = mapping_mean(sets);
        if (mean.on_m > kMappingMeanMax * mean.alone_m) {
            failures.push_back(
                fmt::format("mapping: mean ATE {:.4f} m, tracking alone {:.4f} m: {:.2f}, at most {:.2f}", mean.on_m,
                            mean.alone_m, mean.ratio(), kMappingMeanMax));
        }
        for (const MappingSet& set : sets) {
            if (set.on_m > std::max(kMappingSetGoal * set.alone_m, set.alone_m + kMappingSetSlack_m)) {
                failures.push_back(
                    fmt::format("mapping: {} {:.4f} m, tracking alone {:.4f} m, at most {:.2f} or 1 mm more", set.name,
                                set.on_m, set.alone_m, kMappingSetGoal));
            }
        }
    }
    return failures;
}

}  // namespace stillmesh::accuracy
