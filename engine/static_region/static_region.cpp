#include "engine/static_region/static_region.hpp"

#include "engine/pose/agreeing.hpp"

namespace stillmesh {

void StaticRegion::create(Arena& arena, const Limits& limits) noexcept {
    groups_.create(arena, limits);
    hypotheses_.create(arena, limits);
    voters_.create(arena, limits.features_max);
    chosen_.create(arena, limits.features_max);
    scratch_.create(arena, limits.features_max);
}

void StaticRegion::build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
                         const RegionParameters& parameters, const RegionContext& context) noexcept {
    groups_.build(correspondences, keypoints, parameters, context);
    hypotheses_.clear();
    voters_.clear();
    chosen_.clear();
}

RegionChoice StaticRegion::choose(std::span<const Correspondence> correspondences, const Parameters& parameters,
                                  const RegionContext& context, Random& random) noexcept {
    choose_voters(correspondences, voters_);
    const RegionInput input{correspondences, voters_.span(), groups_, parameters, context, scratch_};
    hypotheses_.propose(input, random);
    return choose_best(input, hypotheses_, chosen_);
}

}  // namespace stillmesh
