#include "engine/static_region/choice.hpp"

#include <algorithm>

#include "engine/pose/agreeing.hpp"

namespace stillmesh {
namespace {

bool is_same_motion(const SE3& a, const SE3& b, const RegionParameters& region) noexcept {
    const SE3 off = a.inverse() * b;
    return off.translation.squaredNorm() < region.edge_sigma_floor_m * region.edge_sigma_floor_m &&
           rotation_angle(off.rotation) < region.edge_sigma_floor_m;
}

// Of what the other explains, more than half is not explained by this one.
bool is_another_body(const RegionInput& input, const Hypotheses& hypotheses, std::size_t other,
                     std::size_t one) noexcept {
    double all = 0;
    double alone = 0;
    for (std::size_t k = 0; k < input.correspondences.size(); ++k) {
        if (!hypotheses.explains(other, k)) continue;
        const double area = surface_of(input.correspondences[k]);
        all += area;
        if (!hypotheses.explains(one, k)) alone += area;
    }
    return alone > 0.5 * all;
}

// Of the surface in view, whatever its weight, in [0, 1].
double share_in_view_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t one) noexcept {
    double all = 0;
    double explained = 0;
    for (std::size_t k = 0; k < input.correspondences.size(); ++k) {
        const Correspondence& c = input.correspondences[k];
        const double surface = c.has_depth ? c.extent * c.p_camera.z() * c.p_camera.z() : 0.0;
        all += surface;
        if (hypotheses.explains(one, k)) explained += surface;
    }
    return all > 0 ? explained / all : 0.0;
}

}  // namespace

std::size_t best_of(const Hypotheses& hypotheses) noexcept {
    std::size_t best = 0;
    for (std::size_t i = 1; i < hypotheses.all().size(); ++i) {
        if (hypotheses.all()[i].score > hypotheses.all()[best].score) best = i;
    }
    return best;
}

std::size_t largest_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept {
    std::size_t largest = best;
    for (std::size_t i = 0; i < hypotheses.all().size(); ++i) {
        if (hypotheses.all()[i].surface > hypotheses.all()[largest].surface &&
            is_another_body(input, hypotheses, i, best))
            largest = i;
    }
    return largest;
}

Rival rival_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept {
    const RegionParameters& region = input.configuration.region;
    const Hypothesis& ours = hypotheses.all()[best];
    double area_all = 0;
    for (const Correspondence& c : input.correspondences) area_all += surface_of(c);
    Rival rival;
    for (std::size_t i = 0; i < hypotheses.all().size(); ++i) {
        const Hypothesis& theirs = hypotheses.all()[i];
        if (i == best || is_same_motion(ours.world_from_camera, theirs.world_from_camera, region)) continue;
        double only_ours = 0;
        double only_theirs = 0;
        for (std::size_t k = 0; k < input.correspondences.size(); ++k) {
            const bool is_ours = hypotheses.explains(best, k);
            const bool is_theirs = hypotheses.explains(i, k);
            if (is_ours && !is_theirs) only_ours += surface_of(input.correspondences[k]);
            if (!is_ours && is_theirs) only_theirs += surface_of(input.correspondences[k]);
        }
        only_theirs *= std::min(theirs.plausibility / ours.plausibility, 1.0);
        if (only_theirs < region.rival_area_min * area_all) continue;  // noise
        const double margin = (only_ours - only_theirs) / (only_ours + only_theirs);
        if (!(margin < rival.margin)) continue;
        rival.margin = margin;
        rival.hypothesis = i;
    }
    rival.chosen_share = share_in_view_of(input, hypotheses, best);
    rival.share = share_in_view_of(input, hypotheses, rival.hypothesis);
    return rival;
}

RegionChoice choose_best(const RegionInput& input, Hypotheses& hypotheses,
                         FixedVector<std::uint16_t>& chosen) noexcept {
    RegionChoice choice;
    choice.iterations = hypotheses.iterations();
    chosen.clear();
    if (hypotheses.all().empty()) return choice;
    const std::size_t best = largest_of(input, hypotheses, best_of(hypotheses));
    choice.world_from_camera = hypotheses.all()[best].world_from_camera;
    choice.score = hypotheses.all()[best].score;
    choice.plausibility = hypotheses.all()[best].plausibility;
    choice.hypothesis = best;
    choice.rival = rival_of(input, hypotheses, best);
    choice.margin = choice.rival.margin;
    choice.explained_share = hypotheses.explained_share(input.weighted);
    static_cast<void>(hypotheses.score(input, choice.world_from_camera));  // each group's agreement with it
    const RegionParameters& region = input.configuration.region;
    choose_agreeing(input.correspondences, choice.world_from_camera, region.point_chi2_max,
                    region.wide_factor * region.point_chi2_max, chosen);
    std::size_t kept = 0;
    for (const std::uint16_t i : chosen) {
        if (hypotheses.motions().agreement_of(input.groups.group_of(i)) > 0) chosen[kept++] = i;
    }
    chosen.set_size(kept);
    choice.is_valid = kept >= 3;
    return choice;
}

}  // namespace stillmesh
