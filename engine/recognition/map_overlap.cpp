#include "engine/recognition/map_overlap.hpp"

#include <algorithm>

namespace stillmesh {

bool MapOverlap::is_same(const SE3& a, const SE3& b) noexcept {
    const SE3 off = a.inverse() * b;
    return off.translation.squaredNorm() <= Relocalisation::kSame_m * Relocalisation::kSame_m &&
           rotation_angle(off.rotation) <= Relocalisation::kSame_rad;
}

void MapOverlap::learn_places() noexcept {
    places_.reset();
    relocalisation_.reset();
    places_.take(PlaceSearch::User::kRelocalisation);
    for (std::uint32_t slot = 0; slot < slots_of_map_; ++slot) {
        const Handle<Keyframe> keyframe = map_.keyframes().handle_of(slot);
        places_.find_words(map_, keyframe, parameters_, places_.words());
        places_.add(keyframe);
    }
}

// A frame of a lost camera, with what the keyframe knows to stand still.
void MapOverlap::begin(std::uint32_t slot) noexcept {
    const Handle<Keyframe> keyframe = map_.keyframes().handle_of(slot);
    relocalisation_.reset();
    relocalisation_.begin_frame();
    relocalisation_.begin(map_.descriptors(keyframe), NoiseFactors{1, 1});
    for (Observation seen : map_.observations(keyframe)) {
        if (!is_static(map_.points().find(seen.point), parameters_.weights.eligible)) seen.var_z = -1;
        relocalisation_.add_feature(seen);
    }
}

bool MapOverlap::recognise(std::uint32_t slot) noexcept {
    begin(slot);
    return relocalisation_.find(map_);
}

void MapOverlap::vote(std::uint32_t slot) noexcept {
    const SE3& other_from_camera = map_.keyframes().at(slot).world_from_camera;
    const SE3& map_from_camera = relocalisation_.world_from_camera();
    const std::uint64_t likeness = places_.verifier().likeness(map_);
    Motion* const end = motions_ + motions_count_;
    Motion* motion = std::find_if(
        motions_, end, [&](const Motion& m) { return is_same(m.map_from_other * other_from_camera, map_from_camera); });
    if (motion == end) {
        const auto is_weaker = [](const Motion& a, const Motion& b) { return a.keyframes < b.keyframes; };
        if (motions_count_ < kMotionsMax) {
            ++motions_count_;
        } else {
            motion = std::min_element(motions_, end, is_weaker);
        }
        *motion = Motion{};
    }
    ++motion->keyframes;
    if (likeness <= motion->likeness) return;
    motion->likeness = likeness;
    motion->map_from_other = map_from_camera * other_from_camera.inverse();
    renormalise(motion->map_from_other.rotation);
    motion->keyframe = map_.keyframes().handle_of(slot);
    motion->place = places_.verifier().candidate();
}

// What looks like the map where the motion puts it, and what looks like another place of it.
void MapOverlap::weigh(Overlap& overlap) noexcept {
    for (std::uint32_t slot = slots_of_map_; slot < map_.keyframes().slots_count(); ++slot) {
        if (!map_.keyframes().is_taken(slot)) continue;
        begin(slot);
        const SE3 map_from_camera = overlap.map_from_other * map_.keyframes().at(slot).world_from_camera;
        const Relocalisation::Evidence evidence = relocalisation_.weigh(map_, map_from_camera);
        overlap.likeness += evidence.here;
        overlap.elsewhere += evidence.elsewhere;
        overlap.agreeing += evidence.here > evidence.elsewhere ? 1U : 0U;
    }
}

Overlap MapOverlap::find() noexcept {
    Overlap overlap;
    learn_places();
    for (std::uint32_t slot = slots_of_map_; slot < map_.keyframes().slots_count(); ++slot) {
        if (!map_.keyframes().is_taken(slot) || !recognise(slot)) continue;
        ++overlap.found;
        vote(slot);
    }
    const Motion* const best =
        std::max_element(motions_, motions_ + motions_count_,
                         [](const Motion& a, const Motion& b) { return a.keyframes < b.keyframes; });
    if (motions_count_ == 0) return overlap;
    overlap.map_from_other = best->map_from_other;
    overlap.keyframe = best->keyframe;
    overlap.place = best->place;
    weigh(overlap);
    overlap.is_found = overlap.agreeing >= kAgreeingMin &&
                       static_cast<double>(overlap.elsewhere) <= kElsewhereMax * static_cast<double>(overlap.likeness);
    return overlap;
}

}  // namespace stillmesh
