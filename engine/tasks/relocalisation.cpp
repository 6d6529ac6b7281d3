#include "engine/tasks/relocalisation.hpp"

namespace stillmesh {

void Relocalisation::create(const Configuration& configuration, PlaceSearch& places) noexcept {
    configuration_ = &configuration;
    places_ = &places;
    reset();
}

void Relocalisation::reset() noexcept {
    turn_ = 0;
    queries_ = candidates_ = successes_ = 0;
}

void Relocalisation::begin(std::span<const Descriptor> descriptors) noexcept {
    places_->take(PlaceSearch::User::kRelocalisation);
    places_->verifier().begin_query(descriptors);
}

void Relocalisation::add_feature(const Observation& observation) noexcept {
    places_->verifier().add_feature(observation, observation.var_z >= 0);
}

bool Relocalisation::find(const Map& map, std::span<const Descriptor> descriptors,
                          const PlaceVerifier::Noise& noise) noexcept {
    PlaceVerifier& verifier = places_->verifier();
    const std::span<const Observation> features = verifier.query();
    STILLMESH_CHECK(features.size() == descriptors.size());
    if (features.size() < configuration_->loop.inliers_min) return false;  // a covered lens
    const std::span<std::uint8_t> eligible = places_->eligible().first(features.size());
    for (std::size_t i = 0; i < features.size(); ++i) eligible[i] = features[i].var_z >= 0 ? 1 : 0;
    FrameWords& words = places_->words();
    words.find(places_->vocabulary(), descriptors);
    words.weigh(places_->vocabulary(), eligible);
    verifier.end_query(words.by_word());
    places_->purge(map);
    WorkBudget unlimited(UINT32_MAX);
    places_->query().begin(places_->database(), words.bag());
    static_cast<void>(places_->query().step(places_->database(), unlimited));
    ++queries_;
    // Groups of places, the best of each: two in this frame, the next two in the next.
    Handle<Keyframe> tried[kTriesPerFrame * kTurns];
    std::uint32_t groups = 0;
    const std::uint32_t first = kTriesPerFrame * (turn_++ % kTurns);
    for (const PlaceCandidate& place : places_->query().candidates()) {
        if (groups == first + kTriesPerFrame) break;
        if (!map.keyframes().is_taken(place.keyframe_slot)) continue;
        const Handle<Keyframe> handle = map.keyframes().handle_of(place.keyframe_slot);
        if (!places_->has(handle)) continue;
        bool is_new = true;
        for (std::uint32_t i = 0; i < groups && is_new; ++i) {
            is_new = map.shared(tried[i].slot(), handle.slot()) < PlaceSearch::kSharedMin;
        }
        if (!is_new) continue;
        tried[groups++] = handle;
        if (groups <= first) continue;
        ++candidates_;
        verifier.start(map, handle, noise);
        WorkBudget budget(UINT32_MAX);
        static_cast<void>(
            verifier.step(map, places_->vocabulary(), places_->database().direct_index(place.keyframe_slot), budget));
        if (!verifier.is_accepted()) continue;
        turn_ = 0;
        return true;
    }
    if (groups <= first) turn_ = 0;  // there were no more: begin again with the best
    return false;
}

void Relocalisation::fill(EngineStatistics& statistics) const noexcept {
    statistics.loop.relocalisations = successes_;
    statistics.loop.relocalisation_queries = queries_;
    statistics.loop.relocalisation_candidates = candidates_;
}

}  // namespace stillmesh
