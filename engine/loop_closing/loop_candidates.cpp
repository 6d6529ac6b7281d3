#include "engine/loop_closing/loop_candidates.hpp"

#include <algorithm>
#include <cstddef>

namespace stillmesh {

void LoopCandidates::create(Arena& arena, World& world, PlaceSearch& places, std::uint32_t keyframes_max) noexcept {
    world_ = &world;
    places_ = &places;
    history_ = arena.array<Places>(keyframes_max > 0 ? kConsistencyMax : 0U);
    reset();
}

void LoopCandidates::reset() noexcept {
    history_count_ = 0;
    chosen_count_ = 0;
}

// Seen together, or the same.
bool LoopCandidates::is_near(Handle<Keyframe> a, Handle<Keyframe> b) const noexcept {
    return a == b || world_->map.shared(a.slot(), b.slot()) >= world_->parameters.map.shared_min;
}

// The k queries before found this place, each of them.
bool LoopCandidates::is_consistent(Handle<Keyframe> place) const noexcept {
    const std::uint32_t consistency = world_->parameters.loop.consistency;
    if (history_count_ < consistency) return false;
    return std::all_of(
        history_.begin(), history_.begin() + static_cast<std::ptrdiff_t>(consistency), [&](const Places& places) {
            return std::any_of(places.keyframes, places.keyframes + places.count, [&](Handle<Keyframe> before) {
                return world_->map.keyframes().find(before) != nullptr && is_near(before, place);
            });
        });
}

// Of each group of places the best, which came first.
bool LoopCandidates::is_new(Handle<Keyframe> place) const noexcept {
    return std::none_of(chosen_, chosen_ + chosen_count_,
                        [&](Handle<Keyframe> before) { return is_near(before, place); });
}

std::uint32_t LoopCandidates::choose(Handle<Keyframe> keyframe, bool is_resting) noexcept {
    const LoopParameters& p = world_->parameters.loop;
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const auto [count, scored, score_min] = places_->neighbourhood(world_->map, keyframe.slot());
    const std::uint64_t frame = keyframes.find(keyframe)->frame;
    Places now;
    chosen_count_ = 0;
    std::uint32_t looked_at = 0;
    for (const PlaceCandidate& place : places_->query().candidates()) {
        ++looked_at;
        if (scored == 0 || now.count == kHistoryMax) break;
        if (static_cast<double>(place.score) < p.score_share * static_cast<double>(score_min)) break;  // they descend
        if (!places_->database().has(place.keyframe_slot) || !keyframes.is_taken(place.keyframe_slot)) continue;
        const Handle<Keyframe> handle = keyframes.handle_of(place.keyframe_slot);
        if (!places_->has(handle) || handle == keyframe) continue;
        const std::uint64_t then = keyframes.at(place.keyframe_slot).frame;
        if ((frame > then ? frame - then : then - frame) < p.gap_frames) continue;
        now.keyframes[now.count++] = handle;
        if (place.score < score_min || is_resting) continue;
        if (chosen_count_ == kCandidatesMax) continue;
        if (is_consistent(handle) && is_new(handle)) chosen_[chosen_count_++] = handle;
    }
    for (std::uint32_t k = kConsistencyMax - 1; k > 0; --k) history_[k] = history_[k - 1];
    history_[0] = now;
    if (history_count_ < kConsistencyMax) ++history_count_;
    // Scores are merged lists of words; agreement compares every place with those of the queries before.
    return 1 + count * world_->limits.features_max / 32 + looked_at / 4 +
           now.count * kHistoryMax * kConsistencyMax / 16;
}

}  // namespace stillmesh
