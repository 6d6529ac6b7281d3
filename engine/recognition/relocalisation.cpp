#include "engine/recognition/relocalisation.hpp"

#include <algorithm>
#include <utility>

#include "engine/recognition/recovery.hpp"

namespace stillmesh {

void Relocalisation::create(Arena& arena, const Limits& limits, const Parameters& configuration,
                            PlaceSearch& places) noexcept {
    marks_ = arena.array<std::uint8_t>(limits.keyframes_max);
    alike_ = arena.array<std::uint16_t>(limits.keyframes_max);
    there_.create(arena, limits.features_max);
    configuration_ = &configuration;
    places_ = &places;
    reset();
}

void Relocalisation::reset() noexcept {
    forget(kDismissed | kTried);
    rival_ = {};
    begin_frame();
    matched_ = queries_ = candidates_ = successes_ = 0;
}

// Of the frame, once: it may be matched, weighed and searched for.
void Relocalisation::find_words(std::span<const Descriptor> descriptors) noexcept {
    if (is_in_frame_) return;
    is_in_frame_ = true;
    places_->take(PlaceSearch::User::kRelocalisation);
    places_->words().find(places_->vocabulary(), descriptors);
    std::fill(alike_.begin(), alike_.end(), kUnknown);
    compared_ = 0;
}

bool Relocalisation::match(const Map& map, Handle<Keyframe> keyframe, std::span<const Descriptor> descriptors,
                           MapMatcher& matcher) noexcept {
    if (!is_on()) return false;
    find_words(descriptors);
    const bool is_known = places_->has(keyframe);
    if (!is_known) there_.find(places_->vocabulary(), map.descriptors(keyframe));
    matcher.by_words(map, keyframe, places_->vocabulary(), PlaceMatcher::kNodesLevel, places_->words().by_word(),
                     is_known ? places_->database().direct_index(keyframe.slot()) : there_.by_word());
    ++matched_;
    return true;
}

void Relocalisation::begin(std::span<const Descriptor> descriptors, const NoiseFactors& noise) noexcept {
    descriptors_ = descriptors;
    noise_ = noise;
    find_words(descriptors);
    places_->verifier().begin_query(descriptors);
}

void Relocalisation::add_feature(const Observation& observation) noexcept {
    places_->verifier().add_feature(observation, observation.var_z >= 0);
}

bool Relocalisation::query(const Map& map) noexcept {
    PlaceVerifier& verifier = places_->verifier();
    const std::span<const Observation> features = verifier.matcher().query();
    STILLMESH_CHECK(features.size() == descriptors_.size());
    if (features.size() < configuration_->loop.inliers_min) return false;  // a covered lens
    const std::span<std::uint8_t> eligible = places_->eligible().first(features.size());
    for (std::size_t i = 0; i < features.size(); ++i) eligible[i] = features[i].var_z >= 0 ? 1 : 0;
    FrameWords& words = places_->words();
    words.weigh(places_->vocabulary(), eligible);
    verifier.end_query(words.by_word());
    places_->purge(map);
    WorkBudget unlimited(UINT32_MAX);
    places_->query().begin(places_->database(), words.bag());
    static_cast<void>(places_->query().step(places_->database(), unlimited));
    ++queries_;
    return true;
}

std::uint32_t Relocalisation::count_alike(const Map& map, Handle<Keyframe> keyframe) noexcept {
    std::uint16_t& alike = alike_[keyframe.slot()];
    if (alike == kUnknown) {
        ++compared_;
        alike = static_cast<std::uint16_t>(places_->verifier().matcher().count_alike(
            map, places_->vocabulary(), keyframe, places_->database().direct_index(keyframe.slot())));
    }
    return alike;
}

bool Relocalisation::verify(const Map& map, Handle<Keyframe> keyframe) noexcept {
    // Less than of a loop, which nothing else is asked about: tracking has the last word here, and a probation follows.
    const PlaceVerifier::Demands demands{configuration_->pose.inliers_min,
                                         kPlacedFactor * configuration_->pose.inliers_min};
    ++candidates_;
    PlaceVerifier& verifier = places_->verifier();
    verifier.start(map, keyframe, noise_, demands);
    WorkBudget unlimited(UINT32_MAX);
    static_cast<void>(
        verifier.step(map, places_->vocabulary(), places_->database().direct_index(keyframe.slot()), unlimited));
    return verifier.is_accepted();
}

bool Relocalisation::find(const Map& map) noexcept {
    if (!query(map)) return false;
    Place best[kTriesPerFrame];  // the worthiest first
    for (const PlaceCandidate& candidate : places_->query().candidates()) {
        const std::uint32_t slot = candidate.keyframe_slot;
        if (compared_ == kComparedPerFrame && alike_[slot] == kUnknown) break;
        if ((marks_[slot] & kDismissed) != 0 || !map.keyframes().is_taken(slot)) continue;
        Place place{map.keyframes().handle_of(slot)};
        if (!places_->has(place.keyframe)) continue;
        const std::uint32_t alike = count_alike(map, place.keyframe);
        if (alike < kAlikeMin) {
            marks_[slot] |= kDismissed;
            continue;
        }
        place.worth = (marks_[slot] & kTried) != 0 ? alike / 2 : alike;
        if (place.keyframe == rival_) place.worth = UINT32_MAX;
        for (Place& other : best) {
            if (place.worth > other.worth) std::swap(place, other);
        }
    }
    rival_ = {};
    const bool is_all = compared_ < kComparedPerFrame;
    if (is_all) forget(kDismissed);  // begin again
    Handle<Keyframe> found;
    std::uint64_t likeness = 0;
    // The worthiest last: mostly it is the one to be held. Weighing has verified three already.
    for (std::uint32_t i = is_weighed_ ? 1 : kTriesPerFrame; i-- > 0;) {
        if (best[i].worth == 0) continue;
        marks_[best[i].keyframe.slot()] |= kTried;
        if (!verify(map, best[i].keyframe) || places_->verifier().likeness(map) < likeness) continue;
        found = best[i].keyframe;
        likeness = places_->verifier().likeness(map);
    }
    if (is_all && likeness == 0) forget(kTried);
    return likeness > 0 && (places_->verifier().candidate() == found || verify(map, found));
}

Relocalisation::Evidence Relocalisation::weigh(const Map& map, const SE3& world_from_camera) noexcept {
    Evidence out;
    rival_ = {};
    if (!query(map)) return out;
    is_weighed_ = true;
    // Verification finds a camera no farther from a keyframe than this: one farther away speaks for another place.
    const double near_m = configuration_->loop.distance_max_m;
    Place here, elsewhere[2];  // the worthiest first
    std::uint32_t compared_near = 0, compared_far = 0;
    for (const PlaceCandidate& candidate : places_->query().candidates()) {
        const std::uint32_t slot = candidate.keyframe_slot;
        if (!map.keyframes().is_taken(slot)) continue;
        Place place{map.keyframes().handle_of(slot)};
        if (!places_->has(place.keyframe)) continue;
        const SE3& there = map.keyframes().at(slot).world_from_camera;
        const bool is_near = (there.translation - world_from_camera.translation).squaredNorm() <= near_m * near_m;
        std::uint32_t& compared = is_near ? compared_near : compared_far;
        if (compared == (is_near ? kComparedNear : kComparedPerFrame - kComparedNear)) continue;
        ++compared;
        place.worth = count_alike(map, place.keyframe);
        if (place.worth < kAlikeMin) continue;
        if (is_near) {
            if (place.worth > here.worth) here = place;
            continue;
        }
        // Each for a place of its own: neighbours say the same.
        const auto is_with = [&](const Place& other) {
            if (other.worth == 0) return false;
            const Vector3& beside = map.keyframes().at(other.keyframe.slot()).world_from_camera.translation;
            return (there.translation - beside).squaredNorm() <= near_m * near_m;
        };
        Place& first = elsewhere[0];
        Place& second = elsewhere[1];
        if (place.worth > first.worth) {
            if (!is_with(first)) second = first;
            first = place;
            if (is_with(second)) second = {};
        } else if (place.worth > second.worth && !is_with(first)) {
            second = place;
        }
    }
    for (const Place& place : {here, elsewhere[0], elsewhere[1]}) {
        if (place.worth == 0 || !verify(map, place.keyframe)) continue;
        const SE3 off = world_from_camera.inverse() * places_->verifier().world_from_query();
        const bool is_here =
            off.translation.squaredNorm() <= kSame_m * kSame_m && rotation_angle(off.rotation) <= kSame_rad;
        const std::uint64_t likeness = places_->verifier().likeness(map);
        std::uint64_t& most = is_here ? out.here : out.elsewhere;
        if (likeness <= most) continue;
        most = likeness;
        if (!is_here) rival_ = place.keyframe;
    }
    return out;
}

void Relocalisation::fill(LoopStatistics& statistics) const noexcept {
    statistics.relocalisations = successes_;
    statistics.matched_by_words = matched_;
    statistics.relocalisation_queries = queries_;
    statistics.relocalisation_candidates = candidates_;
}

}  // namespace stillmesh
