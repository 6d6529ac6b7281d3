#include "engine/tasks/relocalisation.hpp"

#include <utility>

#include "engine/tasks/recovery.hpp"

namespace stillmesh {

void Relocalisation::create(const Configuration& configuration, PlaceSearch& places) noexcept {
    configuration_ = &configuration;
    places_ = &places;
    STILLMESH_CHECK(places.database().slots_count() <= kSlotsMax);
    reset();
}

void Relocalisation::reset() noexcept {
    forget(kDismissed | kTried);
    matched_ = queries_ = candidates_ = successes_ = 0;
}

bool Relocalisation::match(const Map& map, Handle<Keyframe> keyframe, std::span<const Descriptor> descriptors,
                           MapMatcher& matcher) noexcept {
    if (!is_on() || !places_->has(keyframe)) return false;
    places_->take(PlaceSearch::User::kRelocalisation);
    FrameWords& words = places_->words();
    words.find(places_->vocabulary(), descriptors);
    matcher.by_words(map, keyframe, places_->vocabulary(), configuration_->loop.nodes_level, words.by_word(),
                     places_->database().direct_index(keyframe.slot()));
    ++matched_;
    return true;
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
    // Less than of a loop, which nothing else is asked about: tracking has the last word here, and a probation follows.
    const PlaceVerifier::Demands demands{configuration_->loop.first_inliers_min,
                                         kPlacedFactor * configuration_->pose.inliers_min};
    struct Place {
        Handle<Keyframe> keyframe;
        std::uint32_t worth = 0;  // features alike, half of them when it has been tried
    };
    Place best[kTriesPerFrame];  // the worthiest first
    std::uint32_t looks = 0;
    for (const PlaceCandidate& place : places_->query().candidates()) {
        const std::uint32_t slot = place.keyframe_slot;
        if (looks == kLooksPerFrame) break;
        if ((marks_[slot] & kDismissed) != 0 || !map.keyframes().is_taken(slot)) continue;
        Place look{map.keyframes().handle_of(slot)};
        if (!places_->has(look.keyframe)) continue;
        ++looks;
        const std::uint32_t alike =
            verifier.count_alike(map, places_->vocabulary(), look.keyframe, places_->database().direct_index(slot));
        if (alike < kAlikeMin) {
            marks_[slot] |= kDismissed;
            continue;
        }
        look.worth = (marks_[slot] & kTried) != 0 ? alike / 2 : alike;
        for (Place& other : best) {
            if (look.worth > other.worth) std::swap(look, other);
        }
    }
    const bool is_all = looks < kLooksPerFrame;
    if (is_all) forget(kDismissed);  // begin again
    bool is_found = false;
    for (const Place& place : best) {
        if (place.worth == 0 || is_found) break;
        ++candidates_;
        marks_[place.keyframe.slot()] |= kTried;
        verifier.start(map, place.keyframe, noise, demands);
        WorkBudget budget(UINT32_MAX);
        static_cast<void>(
            verifier.step(map, places_->vocabulary(), places_->database().direct_index(place.keyframe.slot()), budget));
        is_found = verifier.is_accepted();
    }
    if (is_all && !is_found) forget(kTried);
    return is_found;
}

void Relocalisation::fill(EngineStatistics& statistics) const noexcept {
    statistics.loop.relocalisations = successes_;
    statistics.loop.matched_by_words = matched_;
    statistics.loop.relocalisation_queries = queries_;
    statistics.loop.relocalisation_candidates = candidates_;
}

}  // namespace stillmesh
