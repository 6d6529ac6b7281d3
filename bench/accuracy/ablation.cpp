#include "bench/accuracy/ablation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace stillmesh::accuracy {
namespace {

constexpr std::array kRules = {
    Rule{"the static region", "3 to 6", "region.is_enabled=false"},
    Rule{"an edge is tested beside its noise", "3", "region.edge_chi2_max=1000"},
    Rule{"steps in depth part groups", "4", "region.step_slope=100"},
    Rule{"a group bears so much and no more", "5", "region.agreement_share=10"},
    Rule{"motions of what is left over", "5", "region.left_over_rounds=0"},
    Rule{"a rival needs some area", "5", "region.rival_area_min=0"},
    Rule{"a rival is carried on", "5", "region.contest_margin=-1"},
    Rule{"a low score makes unsure", "5", "region.score_min=0"},
    Rule{"the expected motion is scored", "5", "region.prior_weight=0"},
    Rule{"and what is far off it is implausible", "5", "region.prior_sigmas=100"},
    Rule{"without a past the larger surface wins", "5", "region.reach=0"},
    Rule{"fewer features where bodies move", "1", "attention.is_used=0"},
    Rule{"more noise is tried", "1", "noise.tries=0"},
    Rule{"noise is learnt from each group first", "1", "noise.young_frames=0"},
    Rule{"depth slips while the camera turns", "1", "prediction.slip_share=0"},
    Rule{"a rolling shutter is estimated", "6", "camera.readout_s=0"},
    Rule{"rows say how the camera turned", "6", "shutter.turn_sigma_rad=0"},
    Rule{"depth is looked up where the camera looked then", "6", "pose.depth_trust=0"},
    Rule{"the search is widened", "2", "matching.radius_wide_px=12"},
    Rule{"what does not turn along is no match", "2", "matching.turn_bins=30"},
    Rule{"new points hardly count", "7", "weights.unproven=1"},
    Rule{"new points beside moving ones are suspicious", "7", "weights.suspicious=10"},
    Rule{"what came into free space has no say", "7", "emptiness.ray_px=0"},
    Rule{"what moves loses its say", "7", "weights.suspect_steps=200"},
    Rule{"what was out of sight may be off", "7", "weights.drift_share=0"},
    Rule{"places seen to be empty", "7", "emptiness.places_per_frame=0"},
    Rule{"a velocity fades", "6", "prediction.fading=0.99"},
    Rule{"a widened search is less certain", "6", "prediction.retry_sigma_factor=1"},
    Rule{"an unsure pose far off is doubted", "6", "prediction.jump_sigmas=100"},
    Rule{"and any pose behind a gap", "6", "prediction.doubts_gaps=0"},
    Rule{"and unsure ones that are seen to have strayed", "6", "pose.stray_m=1000"},
    Rule{"a keyframe when little is tracked", "8", "keyframes.tracked_urgent_permille=0"},
    Rule{"a keyframe's measurement is a mean", "6", "map.averaged_max=1"},
    Rule{"mapping", "6", "mapping.is_enabled=false"},
    Rule{"local adjustment", "6", "mapping.is_adjusting=false"},
};

struct Row {
    const Rule* rule = nullptr;
    double log_sum = 0, log2_sum = 0, ate_sum = 0, with_sum = 0;
    std::uint32_t runs = 0, lost = 0;
    std::uint64_t tracked = 0, frames = 0, wrong = 0;

    [[nodiscard]] double mean() const { return runs > 0 ? log_sum / runs : 0.0; }
    [[nodiscard]] double error() const {
        if (runs < 2) return 0;
        return std::sqrt(std::max(log2_sum / runs - mean() * mean(), 0.0) / (runs - 1));
    }
};

[[nodiscard]] const Result* find(const std::vector<Result>& results, const Result& like, const std::string& variant) {
    for (const Result& r : results) {
        if (r.scene == like.scene && r.seed == like.seed && r.variant == variant) return &r;
    }
    return nullptr;
}

}  // namespace

std::span<const Rule> rules() {
    return kRules;
}

std::string ablation_table(const std::vector<Result>& results, const std::string& with) {
    std::vector<Row> rows;
    for (const Rule& rule : kRules) {
        Row row;
        row.rule = &rule;
        for (const Result& without : results) {
            if (without.variant != rule.name) continue;
            const Result* const base = find(results, without, with);
            if (base == nullptr) continue;
            row.frames += without.measures.frames;
            row.tracked += without.measures.tracked;
            row.wrong += without.measures.wrong_tracked;
            row.lost += without.measures.is_lost() ? 1U : 0U;
            if (!(without.measures.ate_m > 0 && base->measures.ate_m > 0)) continue;
            const double ratio = std::log(without.measures.ate_m / base->measures.ate_m);
            row.log_sum += ratio;
            row.log2_sum += ratio * ratio;
            row.ate_sum += without.measures.ate_m;
            row.with_sum += base->measures.ate_m;
            ++row.runs;
        }
        if (row.frames > 0) rows.push_back(row);
    }
    std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.mean() > b.mean(); });
    std::string out =
        "| rule | section | without | runs | ATE with | without | loss | +- | tracked | wrong | lost |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (const Row& row : rows) {
        const double runs = std::max(row.runs, 1U);
        out += fmt::format("| {} | {} | `{}` | {} | {:.4f} | {:.4f} | {:+.1f} % | {:.1f} % | {:.1f} % | {} | {} |\n",
                           row.rule->name, row.rule->section, row.rule->off, row.runs, row.with_sum / runs,
                           row.ate_sum / runs, 100 * (std::exp(row.mean()) - 1), 100 * row.error(),
                           100.0 * static_cast<double>(row.tracked) / static_cast<double>(row.frames), row.wrong,
                           row.lost);
    }
    return out;
}

}  // namespace stillmesh::accuracy
