#include "engine/static_region/static_region.hpp"

#include "engine/outputs.hpp"
#include "engine/pose/agreeing.hpp"
#include "engine/static_region/paper_choice.hpp"

namespace stillmesh {

void StaticRegion::create(Arena& arena, const Limits& limits) noexcept {
    groups_.create(arena, limits);
    hypotheses_.create(arena, limits);
    weighted_.create(arena, limits.features_max);
    chosen_.create(arena, limits.features_max);
    scratch_.create(arena, limits.features_max);
}

void StaticRegion::build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
                         const RegionParameters& parameters, const RegionContext& context) noexcept {
    groups_.build(correspondences, keypoints, parameters, context);
    hypotheses_.clear();
    weighted_.clear();
    chosen_.clear();
    only_group_ = kNoGroup;
}

RegionChoice StaticRegion::choose(std::span<const Correspondence> correspondences, const Parameters& parameters,
                                  const RegionContext& context, Random& random) noexcept {
    choose_weighted(correspondences, weighted_);
    const RegionInput input{correspondences, weighted_.span(), groups_, parameters, context, scratch_};
    if (parameters.region.is_paper()) {
        const RegionChoice choice = choose_as_in_paper(input, groups_, chosen_, random);
        if (choice.is_valid) only_group_ = groups_.group_of(chosen_[0]);
        return choice;
    }
    hypotheses_.propose(input, random);
    return choose_best(input, hypotheses_, chosen_);
}

std::uint8_t StaticRegion::explained_by(const RegionChoice& choice, std::size_t correspondence) const noexcept {
    unsigned by = 0;
    if (hypotheses_.explains(choice.hypothesis, correspondence)) by |= TrackingView::kByChoice;
    if (hypotheses_.explains(choice.rival.hypothesis, correspondence)) by |= TrackingView::kByRival;
    return static_cast<std::uint8_t>(by);
}

}  // namespace stillmesh
