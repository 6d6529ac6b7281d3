#include "engine/recognition/place_search.hpp"

#include <algorithm>

namespace stillmesh {

void PlaceSearch::create(Arena& arena, const Limits& limits, const Parameters& configuration, const CameraModel& camera,
                         const Vocabulary& vocabulary) noexcept {
    vocabulary_ = &vocabulary;
    database_.create(arena, limits);
    owners_ = arena.array<Handle<Keyframe>>(limits.keyframes_max);
    words_.create(arena, limits.features_max);
    query_.create(arena, limits);
    verifier_.create(arena, limits, configuration, camera);
    eligible_ = arena.array<std::uint8_t>(limits.features_max);
    // Places are recognised in a map that is refined: tracking alone keeps no more than a sliding set.
    is_on_ = !vocabulary.is_empty() && configuration.loop.is_enabled && configuration.mapping.is_enabled;
    reset();
}

void PlaceSearch::reset() noexcept {
    database_.reset();
    query_.reset();
    words_.clear();
    verifier_.begin_query();
    std::fill(owners_.begin(), owners_.end(), Handle<Keyframe>{});
    user_ = User::kNone;
}

void PlaceSearch::take(User user) noexcept {
    verifier_.begin_query();
    query_.reset();
    words_.clear();
    user_ = user;
}

void PlaceSearch::purge(const Map& map) noexcept {
    for (std::uint32_t slot = 0; slot < owners_.size(); ++slot) {
        if (owners_[slot].is_null() || map.keyframes().find(owners_[slot]) != nullptr) continue;
        database_.remove(slot);
        owners_[slot] = {};
    }
}

void PlaceSearch::add(Handle<Keyframe> keyframe, const FrameWords& words) noexcept {
    const std::uint32_t slot = keyframe.slot();
    if (!owners_[slot].is_null()) database_.remove(slot);
    database_.add(slot, words);
    owners_[slot] = keyframe;
}

void PlaceSearch::find_words(const Map& map, Handle<Keyframe> keyframe, const Parameters& configuration,
                             FrameWords& out) noexcept {
    const std::span<const Observation> seen = map.observations(keyframe);
    const std::span<std::uint8_t> eligible = eligible_.first(seen.size());
    for (std::size_t i = 0; i < seen.size(); ++i)
        eligible[i] = is_static(map.points().find(seen[i].point), configuration.weights.eligible) ? 1 : 0;
    out.find(*vocabulary_, map.descriptors(keyframe));
    out.weigh(*vocabulary_, eligible);
}

PlaceSearch::Neighbourhood PlaceSearch::neighbourhood(const Map& map, std::uint32_t slot) const noexcept {
    Neighbourhood out;
    std::uint32_t neighbours[kNeighbours] = {};
    out.neighbours = map.best_covisible(slot, neighbours, map.parameters().shared_min);
    for (std::uint32_t i = 0; i < out.neighbours; ++i) {
        if (!database_.has(neighbours[i])) continue;
        const std::uint32_t score = database_.score(slot, neighbours[i]);
        if (out.scored++ == 0 || score < out.score_min) out.score_min = score;
    }
    return out;
}

}  // namespace stillmesh
