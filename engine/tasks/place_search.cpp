#include "engine/tasks/place_search.hpp"

#include <algorithm>

namespace stillmesh {

void PlaceSearch::create(Arena& arena, const Limits& limits, const Configuration& configuration,
                         const CameraModel& camera, const Vocabulary& vocabulary) noexcept {
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
    user_ = User::kNobody;
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

}  // namespace stillmesh
