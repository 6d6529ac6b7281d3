#include "engine/map/eviction.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "engine/base/sort.hpp"
#include "engine/geometry/view_distance.hpp"

namespace stillmesh {
namespace {

// Of squared distances: from so much farther a point is seen on the same level of the pyramid, half a step of 1.2.
constexpr double kRangeSlack2 = 1.2;

constexpr std::uint32_t kSeenClasses = Map::kSeenClasses;

// In the order in which points go. 38 bits of frame (centuries at 30 Hz), 24 bits of slot.
enum class Worth : std::uint8_t { kWeak, kSurplus, kNeeded };
constexpr std::uint64_t age_of(Worth worth, std::uint64_t frame, std::uint32_t slot) noexcept {
    return static_cast<std::uint64_t>(worth) << 62U | frame << 24U | slot;
}

// Seen to move, or hardly ever seen.
bool is_weak(const Map& map, const MapPoint& point) noexcept {
    return point.is_suspect || point.seen < map.parameters().seen_min;
}

// Where a point that some keyframe observes is counted: by its keyframe and by how often it was seen, in powers of two.
std::uint16_t& class_of(Map& map, const MapPoint& point) noexcept {
    const auto bits = static_cast<std::uint32_t>(std::bit_width(point.seen));
    return map.class_counts()[point.reference.slot() * kSeenClasses + std::min(bits, kSeenClasses - 1)];
}

// How many points of each keyframe and class of being seen are needed there: its share of what need not go or stay.
template <typename Stays>
void share_places(Map& map, std::uint32_t count, const Stays& stays) noexcept {
    const Pool<MapPoint>& points = map.points();
    const std::span<std::uint16_t> counts = map.class_counts();
    std::fill(counts.begin(), counts.end(), std::uint16_t{0});
    std::size_t staying = 0;
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (!points.is_taken(slot)) continue;
        const MapPoint& point = points.at(slot);
        if (stays(slot)) {
            ++staying;
        } else if (!is_weak(map, point) && !point.reference.is_null()) {
            ++class_of(map, point);
        }
    }
    const std::size_t taken = std::min<std::size_t>(points.capacity(), staying + count);
    const std::size_t each = (points.capacity() - taken) / std::max<std::size_t>(1, map.keyframes().size());
    for (std::size_t place = 0; place < counts.size(); place += kSeenClasses) {
        std::size_t left = each;
        for (std::uint32_t i = kSeenClasses; i-- > 0;) {  // those seen most often first
            std::uint16_t& here = counts[place + i];
            here = static_cast<std::uint16_t>(std::min<std::size_t>(here, left));
            left -= here;
        }
    }
}

std::uint32_t proven_points(const Map& map, std::uint32_t slot) noexcept {
    std::uint32_t count = 0;
    for (const Observation& observation : map.observations(map.keyframes().handle_of(slot))) {
        const MapPoint* const point = map.points().find(observation.point);
        count += point != nullptr && !is_weak(map, *point) ? 1U : 0U;
    }
    return count;
}

}  // namespace

std::uint32_t make_room_for_points(Map& map, std::uint32_t count, std::uint64_t frame,
                                   const SparedPoints& spared) noexcept {
    const Pool<MapPoint>& points = map.points();
    STILLMESH_CHECK(points.slots_count() < (1U << 24U) && frame < (std::uint64_t{1} << 38U));
    const auto stays = [&](std::uint32_t slot) {
        const MapPoint& point = points.at(slot);
        return point.last_seen_frame >= frame || (!is_weak(map, point) && spared.has(slot));
    };
    share_places(map, count, stays);
    const std::span<std::uint64_t> by_age = map.scratch();  // worth, last seen frame and slot, packed
    std::size_t candidates = 0;
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (!points.is_taken(slot) || stays(slot)) continue;
        const MapPoint& point = points.at(slot);
        Worth worth = is_weak(map, point) ? Worth::kWeak : Worth::kSurplus;
        if (worth != Worth::kWeak && !point.reference.is_null()) {
            std::uint16_t& left = class_of(map, point);
            if (left > 0) {
                --left;
                worth = Worth::kNeeded;
            }
        }
        by_age[candidates++] = age_of(worth, point.last_seen_frame, slot);
    }
    const std::size_t going = std::min<std::size_t>(count, candidates);
    const auto begin = by_age.begin();
    std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(going),
                     begin + static_cast<std::ptrdiff_t>(candidates));
    // Release in order, so that the free list does not depend on how the library partitions.
    sort(by_age.first(going));
    for (std::size_t i = 0; i < going; ++i) {
        map.release_point(points.handle_of(static_cast<std::uint32_t>(by_age[i] & 0xffffffU)));
    }
    map.statistics().points_evicted += going;
    return static_cast<std::uint32_t>(going);
}

std::uint32_t cull_points(Map& map, std::uint64_t frame, std::uint32_t first, std::uint32_t count) noexcept {
    const Pool<MapPoint>& points = map.points();
    const std::uint32_t end = points.slots_count() - first > count ? first + count : points.slots_count();
    for (std::uint32_t slot = first; slot < end; ++slot) {
        if (!points.is_taken(slot)) continue;
        const MapPoint& point = points.at(slot);
        if (point.last_seen_frame + map.parameters().cull_after_frames >= frame) continue;
        if (!is_weak(map, point)) continue;
        map.release_point(points.handle_of(slot));
        ++map.statistics().points_culled;
    }
    return end < points.slots_count() ? end : 0;
}

void cull_points(Map& map, std::uint64_t frame) noexcept {
    static_cast<void>(cull_points(map, frame, 0, map.points().slots_count()));
}

bool evict_keyframe(Map& map, std::span<const std::uint8_t> spared) noexcept {
    struct Candidate {
        std::uint64_t useful = 0;
        std::uint32_t slot = 0;
    };
    const Pool<Keyframe>& keyframes = map.keyframes();
    Candidate oldest[kCrowdedCandidates];  // least recently useful first; ties: the lower slot
    std::uint32_t count = 0;
    const Handle<Keyframe> newest = map.recent_keyframe(0);
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot) || slot == newest.slot()) continue;
        if (slot < spared.size() && spared[slot] != 0) continue;
        keep_best(std::span<Candidate>(oldest), count, Candidate{keyframes.at(slot).last_useful_frame, slot},
                  [](const Candidate& a, const Candidate& b) { return a.useful < b.useful; });
    }
    if (count == 0) return false;
    // Of the two nearest to each other the newer goes, so that a way is thinned out evenly and the map keeps what it
    // was built on; but not for one whose points are mostly gone. Spared ones do not count as neighbours: beside them
    // whatever has just left the local map would go, and the places it shows be forgotten.
    std::uint32_t going = oldest[0].slot;
    std::uint32_t staying = going;
    double least_m2 = map.parameters().near_m * map.parameters().near_m;
    for (std::uint32_t i = 1; i < count; ++i) {
        for (std::uint32_t k = 0; k < i; ++k) {
            const double between_m2 = view_distance_m2(keyframes.at(oldest[i].slot).world_from_camera,
                                                       keyframes.at(oldest[k].slot).world_from_camera);
            if (between_m2 >= least_m2) continue;
            least_m2 = between_m2;
            going = oldest[i].slot;
            staying = oldest[k].slot;
        }
    }
    if (keyframes.at(going).frame < keyframes.at(staying).frame) std::swap(going, staying);
    if (going != staying && 2 * proven_points(map, staying) < proven_points(map, going)) going = staying;
    map.release_keyframe(keyframes.handle_of(going));
    ++map.statistics().keyframes_evicted;
    return true;
}

void evict_oldest(Map& map) noexcept {
    map.release_keyframe(map.recent_keyframe(static_cast<std::uint32_t>(map.keyframes().size()) - 1));
    ++map.statistics().keyframes_evicted;
}

bool is_redundant(const Map& map, Handle<Keyframe> keyframe) noexcept {
    const std::uint32_t enough = map.parameters().seen_min;
    std::uint32_t points = 0;
    std::uint32_t known = 0;
    const Vector3 from = map.keyframes().at(keyframe.slot()).world_from_camera.translation;
    for (const Observation& observation : map.observations(keyframe)) {
        const MapPoint* const point = map.points().find(observation.point);
        if (point == nullptr || point->is_suspect) continue;
        ++points;
        if (point->observers <= enough) continue;
        // Scale: seen from no farther (with some slack) is seen on the same level or a finer one.
        const Vector3 world = vector_of(point->world);
        const double away = kRangeSlack2 * (world - from).squaredNorm();
        std::uint32_t others = 0;
        map.visit_observers(observation.point.slot(), [&](std::uint32_t other) {
            if (other == keyframe.slot()) return;
            const Vector3 there = map.keyframes().at(other).world_from_camera.translation;
            others += (world - there).squaredNorm() <= away ? 1U : 0U;
        });
        known += others >= enough ? 1U : 0U;
    }
    return std::uint64_t{1000} * known >= std::uint64_t{map.parameters().redundant_permille} * points;
}

void release_redundant(Map& map, Handle<Keyframe> keyframe) noexcept {
    map.release_keyframe(keyframe);
    ++map.statistics().keyframes_redundant;
}

}  // namespace stillmesh
