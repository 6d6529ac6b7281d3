#include "engine/static_region/choice.hpp"

#include <algorithm>

#include "engine/pose/agreeing.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kPosePoints = 3;  // that fix a pose

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

// What two motions disagree about: the surface that one of them alone explains, and the other alone.
struct Contradiction {
    double ours = 0;
    double theirs = 0;
    double all = 0;

    // The other's counts as far as it is plausible, and is noise below a share of all: then 1.
    [[nodiscard]] double margin(double plausibility, const RegionParameters& region) const noexcept {
        const double rival = theirs * std::min(plausibility, 1.0);
        return rival >= region.rival_area_min * all && rival > 0 ? (ours - rival) / (ours + rival) : 1.0;
    }
};

Contradiction contradiction_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t one,
                               std::size_t other) noexcept {
    Contradiction out;
    if (other == one || is_same_motion(hypotheses.all()[one].world_from_camera,
                                       hypotheses.with_rival()[other].world_from_camera, input.configuration.region)) {
        return out;
    }
    for (std::size_t k = 0; k < input.correspondences.size(); ++k) {
        const bool is_ours = hypotheses.explains(one, k);
        const bool is_theirs = hypotheses.explains(other, k);
        const double surface = surface_of(input.correspondences[k]);
        out.all += surface;
        if (is_ours && !is_theirs) out.ours += surface;
        if (!is_ours && is_theirs) out.theirs += surface;
    }
    return out;
}

// Beside the best one's, how plausible another motion is.
double relative_plausibility(const Hypotheses& hypotheses, std::size_t best, std::size_t other) noexcept {
    return hypotheses.all()[other].plausibility / hypotheses.all()[best].plausibility;
}

// So many of the matches that `one` explains and `other` does not, drift allowed for, have stood still for so long.
std::size_t count_stood(const RegionInput& input, const Hypotheses& hypotheses, std::size_t one, std::size_t other,
                        std::uint32_t tenths) noexcept {
    const SE3 camera_from_world = hypotheses.all()[other].world_from_camera.inverse();
    const double chi2_max = input.configuration.region.point_chi2_max;
    std::size_t count = 0;
    for (std::size_t k = 0; k < input.correspondences.size(); ++k) {
        const Correspondence& c = input.correspondences[k];
        if (c.stood_tenths < tenths || !(c.weight > 0)) continue;
        if (!hypotheses.explains(one, k) || hypotheses.explains(other, k)) continue;
        if (chi2_with_drift(c, camera_from_world) > chi2_max) ++count;
    }
    return count;
}

// Of two bodies with a past, `other` has points that were there before all that is seen of `one`.
bool is_elder(const RegionInput& input, const Hypotheses& hypotheses, std::size_t other, std::size_t one) noexcept {
    const std::uint32_t wanted = input.configuration.region.elder_points;
    const auto proven = static_cast<std::uint32_t>(10.0 * input.configuration.weights.proven_s);
    if (count_stood(input, hypotheses, one, other, proven) < wanted) return false;
    if (count_stood(input, hypotheses, other, one, proven) < wanted) return false;
    std::uint32_t oldest = 0;  // for so long at least, as many as are wanted; found bit by bit
    for (std::uint32_t bit = 0x8000; bit > 0; bit >>= 1U) {
        if (count_stood(input, hypotheses, other, one, oldest | bit) >= wanted) oldest |= bit;
    }
    return count_stood(input, hypotheses, one, other, oldest) < kPosePoints;
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

std::size_t elder_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept {
    if (input.configuration.region.elder_points == 0) return best;
    for (std::size_t i = 0; i < hypotheses.all().size(); ++i) {
        const double margin = contradiction_of(input, hypotheses, best, i)
                                  .margin(relative_plausibility(hypotheses, best, i), input.configuration.region);
        if (margin < 1 && is_elder(input, hypotheses, i, best)) return i;
    }
    return best;
}

Rival rival_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept {
    Rival rival;
    for (std::size_t i = 0; i < hypotheses.all().size(); ++i) {
        const double margin = contradiction_of(input, hypotheses, best, i)
                                  .margin(relative_plausibility(hypotheses, best, i), input.configuration.region);
        if (!(margin < rival.margin)) continue;
        rival.margin = margin;
        rival.hypothesis = i;
    }
    rival.chosen_share = share_in_view_of(input, hypotheses, best);
    rival.share = share_in_view_of(input, hypotheses, rival.hypothesis);
    return rival;
}

Contest contest_of(const RegionInput& input, const Hypotheses& hypotheses, std::size_t best) noexcept {
    const RegionParameters& region = input.configuration.region;
    Contest contest;
    double least = 1;
    for (std::size_t i = 0; i < hypotheses.with_rival().size(); ++i) {
        const Contradiction contradiction = contradiction_of(input, hypotheses, best, i);
        const double margin = contradiction.margin(1, region);
        if (!(margin < least)) continue;
        least = margin;
        const Hypothesis& other = hypotheses.with_rival()[i];
        contest.hypothesis = i;
        contest.world_from_camera = other.world_from_camera;
        const double as_rival =
            input.context.rival_frames > 0
                ? 1.0 / support_needed(input, input.context.world_from_camera_rival, other.world_from_camera)
                : 0.0;
        contest.is_carried_on = as_rival > other.plausibility;
        contest.margin =
            contradiction.margin(std::max(other.plausibility, as_rival) / hypotheses.all()[best].plausibility, region);
    }
    contest.is_tenable = contest.margin < region.contest_margin &&
                         (contest.is_carried_on ? input.context.rival_frames : 0) + 1 >= region.contest_frames;
    return contest;
}

RegionChoice choose_best(const RegionInput& input, Hypotheses& hypotheses,
                         FixedVector<std::uint16_t>& chosen) noexcept {
    RegionChoice choice;
    choice.iterations = hypotheses.iterations();
    chosen.clear();
    if (hypotheses.all().empty()) return choice;
    const std::size_t best = elder_of(input, hypotheses, largest_of(input, hypotheses, best_of(hypotheses)));
    choice.world_from_camera = hypotheses.all()[best].world_from_camera;
    choice.score = hypotheses.all()[best].score;
    choice.plausibility = hypotheses.all()[best].plausibility;
    choice.hypothesis = best;
    choice.rival = rival_of(input, hypotheses, best);
    choice.contest = contest_of(input, hypotheses, best);
    choice.margin = choice.rival.margin;
    if (choice.contest.is_tenable && choice.contest.margin < choice.rival.margin) {
        choice.rival.hypothesis = choice.contest.hypothesis;
        choice.rival.margin = choice.contest.margin;
        choice.rival.share = share_in_view_of(input, hypotheses, choice.contest.hypothesis);
    }
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
    choice.is_valid = kept >= kPosePoints;
    return choice;
}

}  // namespace stillmesh
