#include "engine/map/map.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/base/sort.hpp"

namespace stillmesh {
namespace {

// What the hash of changes calls them.
enum class Change : std::uint64_t { kPoint = 1, kPointGone, kKeyframe, kKeyframeGone, kLink, kUnlink, kFuse, kParent };
constexpr std::uint64_t word_of(Change change, std::uint64_t a, std::uint64_t b = 0) noexcept {
    return static_cast<std::uint64_t>(change) << 56U | a << 28U | b;
}

// In the order in which points go. 38 bits of frame (centuries at 30 Hz), 24 bits of slot.
enum class Worth : std::uint8_t { kWeak, kSurplus, kNeeded };
constexpr std::uint64_t age_of(Worth worth, std::uint64_t frame, std::uint32_t slot) noexcept {
    return static_cast<std::uint64_t>(worth) << 62U | frame << 24U | slot;
}

}  // namespace

void Map::create(Arena& arena, const Limits& limits, const MapParameters& parameters) noexcept {
    parameters_ = parameters;
    points_.create(arena, limits.map_points_max);
    keyframes_.create(arena, limits.keyframes_max);
    const std::size_t features = static_cast<std::size_t>(limits.keyframes_max) * limits.features_max;
    observations_ = arena.array<Observation>(features);
    descriptors_ = arena.array<Descriptor>(features);
    words_ = words(limits.keyframes_max);
    observers_ = arena.array<std::uint64_t>(limits.map_points_max * words_);
    shared_ = arena.array<std::uint16_t>(static_cast<std::size_t>(limits.keyframes_max) * limits.keyframes_max);
    by_age_ = arena.array<std::uint64_t>(limits.map_points_max);
    place_counts_ = arena.array<std::uint16_t>(std::size_t{kSeenClasses} * limits.keyframes_max);
    features_max_ = limits.features_max;
}

void Map::reset() noexcept {
    points_.reset();
    keyframes_.reset();
    std::fill(observers_.begin(), observers_.end(), 0);
    std::fill(shared_.begin(), shared_.end(), 0);
    readout_s_ = 0;
    statistics_ = MapStatistics{};
    changes_ = StateHash{};
}

// --- points ----------------------------------------------------------------------------------------------------------

Result<Handle<MapPoint>> Map::add_point() noexcept {
    const Result<Handle<MapPoint>> taken = points_.take();
    if (taken.is_ok()) changes_.add(word_of(Change::kPoint, taken.value().slot()));
    return taken;
}

void Map::share(std::uint32_t slot_a, std::uint32_t slot_b, std::int32_t change) noexcept {
    const std::size_t count = keyframes_.slots_count();
    std::uint16_t& there = shared_[slot_a * count + slot_b];
    there = static_cast<std::uint16_t>(there + change);
    shared_[slot_b * count + slot_a] = there;
}

void Map::release_point(Handle<MapPoint> point) noexcept {
    STILLMESH_CHECK(points_.find(point) != nullptr);
    const std::uint32_t slot = point.slot();
    visit_observers(slot, [&](std::uint32_t a) {
        visit_observers(slot, [&](std::uint32_t b) {
            if (a < b) share(a, b, -1);
        });
    });
    for (std::size_t w = 0; w < words_; ++w) observers_[slot * words_ + w] = 0;
    points_.release(point);
    changes_.add(word_of(Change::kPointGone, slot));
}

// In powers of two.
std::uint32_t Map::seen_class(std::uint16_t seen) noexcept {
    const auto bits = static_cast<std::uint32_t>(std::bit_width(seen));
    return std::min(bits, kSeenClasses - 1);
}

// How many points of each keyframe and class of being seen are needed there: its share of what need not go or stay.
template <typename Stays>
void Map::share_places(std::uint32_t count, const Stays& stays) noexcept {
    std::fill(place_counts_.begin(), place_counts_.end(), std::uint16_t{0});
    std::size_t staying = 0;
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        if (!points_.is_taken(slot)) continue;
        const MapPoint& point = points_.at(slot);
        if (stays(slot)) {
            ++staying;
        } else if (!is_weak(point) && !point.reference.is_null()) {
            ++place_counts_[point.reference.slot() * kSeenClasses + seen_class(point.seen)];
        }
    }
    const std::size_t taken = std::min<std::size_t>(points_.capacity(), staying + count);
    const std::size_t each = (points_.capacity() - taken) / std::max<std::size_t>(1, keyframes_.size());
    for (std::size_t place = 0; place < place_counts_.size(); place += kSeenClasses) {
        std::size_t left = each;
        for (std::uint32_t i = kSeenClasses; i-- > 0;) {  // those seen most often first
            std::uint16_t& here = place_counts_[place + i];
            here = static_cast<std::uint16_t>(std::min<std::size_t>(here, left));
            left -= here;
        }
    }
}

std::uint32_t Map::make_room_for_points(std::uint32_t count, std::uint64_t frame, const SparedPoints& spared) noexcept {
    STILLMESH_CHECK(points_.slots_count() < (1U << 24U) && frame < (std::uint64_t{1} << 38U));
    const auto stays = [&](std::uint32_t slot) {
        const MapPoint& point = points_.at(slot);
        return point.last_seen_frame >= frame || (!is_weak(point) && spared.has(slot));
    };
    share_places(count, stays);
    std::size_t candidates = 0;
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        if (!points_.is_taken(slot) || stays(slot)) continue;
        const MapPoint& point = points_.at(slot);
        Worth worth = is_weak(point) ? Worth::kWeak : Worth::kSurplus;
        if (worth != Worth::kWeak && !point.reference.is_null()) {
            std::uint16_t& left = place_counts_[point.reference.slot() * kSeenClasses + seen_class(point.seen)];
            if (left > 0) {
                --left;
                worth = Worth::kNeeded;
            }
        }
        by_age_[candidates++] = age_of(worth, point.last_seen_frame, slot);
    }
    const std::size_t going = std::min<std::size_t>(count, candidates);
    const auto begin = by_age_.begin();
    std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(going),
                     begin + static_cast<std::ptrdiff_t>(candidates));
    // Release in order, so that the free list does not depend on how the library partitions.
    sort(by_age_.first(going));
    for (std::size_t i = 0; i < going; ++i) {
        release_point(points_.handle_of(static_cast<std::uint32_t>(by_age_[i] & 0xffffffU)));
    }
    statistics_.points_evicted += going;
    return static_cast<std::uint32_t>(going);
}

std::uint32_t Map::cull_points(std::uint64_t frame, std::uint32_t first, std::uint32_t count) noexcept {
    const std::uint32_t end = points_.slots_count() - first > count ? first + count : points_.slots_count();
    for (std::uint32_t slot = first; slot < end; ++slot) {
        if (!points_.is_taken(slot)) continue;
        const MapPoint& point = points_.at(slot);
        if (point.last_seen_frame + parameters_.cull_after_frames >= frame) continue;
        if (!is_weak(point)) continue;
        release_point(points_.handle_of(slot));
        ++statistics_.points_culled;
    }
    return end < points_.slots_count() ? end : 0;
}

std::uint32_t Map::fuse(Handle<MapPoint> kept, Handle<MapPoint> gone) noexcept {
    STILLMESH_CHECK(points_.find(kept) != nullptr && points_.find(gone) != nullptr && !(kept == gone));
    MapPoint& stays = *points_.find(kept);
    const MapPoint going = *points_.find(gone);
    std::uint32_t looked_at = 0;
    visit_observers(gone.slot(), [&](std::uint32_t keyframe) {
        const Handle<Keyframe> handle = keyframes_.handle_of(keyframe);
        const std::span<Observation> seen = observations_of(keyframe);
        for (std::uint32_t i = 0; i < seen.size(); ++i) {
            ++looked_at;
            if (!(seen[i].point == gone)) continue;
            // Taken away from `gone` without its bit, which release_point needs; then given to `kept`, unless it is
            // there already.
            seen[i].point = {};
            ++keyframes_.at(keyframe).observations_changed;
            static_cast<void>(link(handle, i, kept));
            break;
        }
    });
    if (going.seen > stays.seen) {
        stays.weight_tenths = going.weight_tenths;
        stays.is_suspect = going.is_suspect;
        stays.created_ns = std::min(stays.created_ns, going.created_ns);
    }
    stays.seen = static_cast<std::uint16_t>(std::min<std::uint32_t>(0xffffU, std::uint32_t{stays.seen} + going.seen));
    stays.last_seen_frame = std::max(stays.last_seen_frame, going.last_seen_frame);
    stays.agreed_way_m = std::max(stays.agreed_way_m, going.agreed_way_m);
    changes_.add(word_of(Change::kFuse, kept.slot(), gone.slot()));
    release_point(gone);
    ++statistics_.points_fused;
    return looked_at;
}

// --- observations ----------------------------------------------------------------------------------------------------

void Map::add_observation(Handle<Keyframe> keyframe, const Observation& observation,
                          const Descriptor& descriptor) noexcept {
    Keyframe* const found = keyframes_.find(keyframe);
    STILLMESH_CHECK(found != nullptr && found->observations < features_max_);
    const std::uint32_t index = found->observations++;
    ++found->observations_changed;
    const std::size_t at = static_cast<std::size_t>(keyframe.slot()) * features_max_ + index;
    observations_[at] = observation;
    observations_[at].point = {};
    descriptors_[at] = descriptor;
    if (points_.find(observation.point) != nullptr) static_cast<void>(link(keyframe, index, observation.point));
}

std::span<const Observation> Map::observations(Handle<Keyframe> keyframe) const noexcept {
    const Keyframe* const found = keyframes_.find(keyframe);
    if (found == nullptr) return {};
    return observations_.subspan(static_cast<std::size_t>(keyframe.slot()) * features_max_, found->observations);
}

std::span<const Descriptor> Map::descriptors(Handle<Keyframe> keyframe) const noexcept {
    const Keyframe* const found = keyframes_.find(keyframe);
    if (found == nullptr) return {};
    return descriptors_.subspan(static_cast<std::size_t>(keyframe.slot()) * features_max_, found->observations);
}

bool Map::link(Handle<Keyframe> keyframe, std::uint32_t index, Handle<MapPoint> point) noexcept {
    STILLMESH_CHECK(keyframes_.find(keyframe) != nullptr && points_.find(point) != nullptr);
    const std::uint32_t slot = keyframe.slot();
    Observation& observation = observations_of(slot)[index];
    if (points_.find(observation.point) != nullptr || is_observed_by(point.slot(), slot)) return false;
    observation.point = point;
    ++keyframes_.at(slot).observations_changed;
    visit_observers(point.slot(), [&](std::uint32_t other) { share(slot, other, 1); });
    observers_[point.slot() * words_ + slot / 64] |= std::uint64_t{1} << (slot % 64);
    MapPoint& seen = points_.at(point.slot());
    if (seen.observers++ == 0) seen.reference = keyframe;
    changes_.add(word_of(Change::kLink, std::uint64_t{slot} << 14U | index, point.slot()));
    return true;
}

// Bit, count and reference; the numbers of shared points are the caller's.
void Map::forget_observer(std::uint32_t point_slot, std::uint32_t keyframe_slot) noexcept {
    observers_[point_slot * words_ + keyframe_slot / 64] &= ~(std::uint64_t{1} << (keyframe_slot % 64));
    MapPoint& point = points_.at(point_slot);
    --point.observers;
    if (point.reference.is_null() || point.reference.slot() != keyframe_slot) return;
    // The newest of the others: its pose is the surest about where the point was filtered to.
    point.reference = {};
    std::uint64_t newest = 0;
    visit_observers(point_slot, [&](std::uint32_t other) {
        if (!point.reference.is_null() && keyframes_.at(other).frame <= newest) return;
        newest = keyframes_.at(other).frame;
        point.reference = keyframes_.handle_of(other);
    });
}

void Map::unlink(Handle<Keyframe> keyframe, std::uint32_t index) noexcept {
    STILLMESH_CHECK(keyframes_.find(keyframe) != nullptr);
    const std::uint32_t slot = keyframe.slot();
    Observation& observation = observations_of(slot)[index];
    const Handle<MapPoint> point = observation.point;
    observation.point = {};
    ++keyframes_.at(slot).observations_changed;
    if (points_.find(point) == nullptr) return;
    forget_observer(point.slot(), slot);
    visit_observers(point.slot(), [&](std::uint32_t other) { share(slot, other, -1); });
    changes_.add(word_of(Change::kUnlink, std::uint64_t{slot} << 14U | index, point.slot()));
}

std::uint32_t Map::best_covisible(std::uint32_t slot, std::span<std::uint32_t> best,
                                  std::uint32_t shared_min) const noexcept {
    std::uint32_t count = 0;
    for (std::uint32_t other = 0; other < keyframes_.slots_count(); ++other) {
        const std::uint32_t weight = shared(slot, other);
        if (weight < shared_min || weight == 0) continue;
        std::uint32_t at = count;
        while (at > 0 && shared(slot, best[at - 1]) < weight) --at;
        if (at >= best.size()) continue;
        if (count < best.size()) ++count;
        for (std::uint32_t i = count - 1; i > at; --i) best[i] = best[i - 1];
        best[at] = other;
    }
    return count;
}

// --- keyframes -------------------------------------------------------------------------------------------------------

Handle<Keyframe> Map::add_keyframe() noexcept {
    const Result<Handle<Keyframe>> taken = keyframes_.take();
    if (!taken.is_ok()) return {};
    changes_.add(word_of(Change::kKeyframe, taken.value().slot()));
    return taken.value();
}

void Map::attach(Handle<Keyframe> keyframe) noexcept {
    Keyframe* const found = keyframes_.find(keyframe);
    STILLMESH_CHECK(found != nullptr);
    // An older one, so that the tree has no rings.
    Handle<Keyframe> parent;
    for (std::uint32_t other = 0; other < keyframes_.slots_count(); ++other) {
        if (!keyframes_.is_taken(other) || keyframes_.at(other).frame >= found->frame) continue;
        if (!parent.is_null()) {
            const std::uint32_t most = shared(keyframe.slot(), parent.slot());
            const std::uint32_t here = shared(keyframe.slot(), other);
            const bool is_newer = keyframes_.at(other).frame > keyframes_.at(parent.slot()).frame;
            if (here < most || (here == most && !is_newer)) continue;
        }
        parent = keyframes_.handle_of(other);
    }
    found->parent = parent;
    if (parent.is_null()) return;
    found->parent_from_camera = keyframes_.at(parent.slot()).world_from_camera.inverse() * found->world_from_camera;
    changes_.add(word_of(Change::kParent, keyframe.slot(), parent.slot()));
}

void Map::attach_returned(Handle<Keyframe> keyframe) noexcept {
    Keyframe* const found = keyframes_.find(keyframe);
    STILLMESH_CHECK(found != nullptr);
    Handle<Keyframe> parent, root;
    bool is_oldest = true;
    const auto gap = [&](std::uint32_t slot) {
        const std::uint64_t frame = keyframes_.at(slot).frame;
        return frame > found->frame ? frame - found->frame : found->frame - frame;
    };
    for (std::uint32_t other = 0; other < keyframes_.slots_count(); ++other) {
        if (!keyframes_.is_taken(other) || other == keyframe.slot()) continue;
        is_oldest = is_oldest && found->frame < keyframes_.at(other).frame;
        if (keyframes_.at(other).parent.is_null()) root = keyframes_.handle_of(other);
        if (!parent.is_null()) {
            const std::uint32_t most = shared(keyframe.slot(), parent.slot());
            const std::uint32_t here = shared(keyframe.slot(), other);
            if (here < most || (here == most && gap(other) >= gap(parent.slot()))) continue;
        }
        parent = keyframes_.handle_of(other);
    }
    found->parent = {};
    found->parent_from_camera = SE3{};
    if (parent.is_null()) return;
    const Handle<Keyframe> child = is_oldest ? root : keyframe;
    const Handle<Keyframe> above = is_oldest ? keyframe : parent;
    Keyframe& below = keyframes_.at(child.slot());
    below.parent = above;
    below.parent_from_camera = keyframes_.at(above.slot()).world_from_camera.inverse() * below.world_from_camera;
    changes_.add(word_of(Change::kParent, child.slot(), above.slot()));
}

bool Map::is_below(std::uint32_t slot, std::uint32_t ancestor) const noexcept {
    // As many steps as there are keyframes at most: the tree has no rings.
    for (std::uint32_t i = 0; i <= keyframes_.slots_count(); ++i) {
        if (slot == ancestor) return true;
        const Handle<Keyframe> parent = keyframes_.at(slot).parent;
        if (parent.is_null()) return false;
        slot = parent.slot();
    }
    check_failed("the spanning tree has a ring", __FILE__, __LINE__);
}

void Map::release_keyframe(Handle<Keyframe> keyframe) noexcept {
    STILLMESH_CHECK(keyframes_.find(keyframe) != nullptr);
    const std::uint32_t slot = keyframe.slot();
    const std::uint32_t count = keyframes_.slots_count();
    for (Observation& observation : observations_of(slot)) {
        MapPoint* const point = points_.find(observation.point);
        if (point == nullptr) continue;
        forget_observer(observation.point.slot(), slot);
        if (point->observers > 0) continue;
        release_point(observation.point);
        ++statistics_.points_evicted;
    }
    // Children, one after the other, so that each sees what the ones before it have become: the best covisible keyframe
    // that is not below them, else the grandparent. When the root goes, its first child becomes the root.
    Handle<Keyframe> fallback = keyframes_.at(slot).parent;
    for (std::uint32_t child = 0; child < count; ++child) {
        if (!keyframes_.is_taken(child) || !(keyframes_.at(child).parent == keyframe)) continue;
        Keyframe& orphan = keyframes_.at(child);
        if (fallback.is_null()) {
            fallback = keyframes_.handle_of(child);
            orphan.parent = {};
            orphan.parent_from_camera = SE3{};
            continue;
        }
        std::uint32_t parent = fallback.slot();
        for (std::uint32_t other = 0; other < count; ++other) {
            if (other != slot && shared(child, other) > shared(child, parent) && !is_below(other, child))
                parent = other;
        }
        orphan.parent = keyframes_.handle_of(parent);
        orphan.parent_from_camera = keyframes_.at(parent).world_from_camera.inverse() * orphan.world_from_camera;
        changes_.add(word_of(Change::kParent, child, parent));
    }
    for (std::uint32_t other = 0; other < count; ++other) {
        shared_[static_cast<std::size_t>(slot) * count + other] = 0;
        shared_[static_cast<std::size_t>(other) * count + slot] = 0;
    }
    keyframes_.release(keyframe);
    changes_.add(word_of(Change::kKeyframeGone, slot));
}

void Map::release_redundant(Handle<Keyframe> keyframe) noexcept {
    release_keyframe(keyframe);
    ++statistics_.keyframes_redundant;
}

double Map::apart_m2(std::uint32_t slot, std::uint32_t other) const noexcept {
    const SE3& here = keyframes_.at(slot).world_from_camera;
    const SE3& there = keyframes_.at(other).world_from_camera;
    const double cosine = here.rotation.col(2).dot(there.rotation.col(2));
    return (there.translation - here.translation).squaredNorm() + parameters_.turn_m2 * (1.0 - cosine);
}

std::uint32_t Map::proven_points(std::uint32_t slot) const noexcept {
    std::uint32_t count = 0;
    for (const Observation& observation : observations(keyframes_.handle_of(slot))) {
        const MapPoint* const point = points_.find(observation.point);
        count += point != nullptr && !is_weak(*point) ? 1U : 0U;
    }
    return count;
}

bool Map::evict_keyframe(std::span<const std::uint8_t> spared) noexcept {
    struct Candidate {
        std::uint64_t useful = 0;
        std::uint32_t slot = 0;
    };
    Candidate oldest[kCrowdedCandidates];  // least recently useful first; ties: the lower slot
    std::uint32_t count = 0;
    const Handle<Keyframe> newest = recent_keyframe(0);
    for (std::uint32_t slot = 0; slot < keyframes_.slots_count(); ++slot) {
        if (!keyframes_.is_taken(slot) || slot == newest.slot()) continue;
        if (slot < spared.size() && spared[slot] != 0) continue;
        const std::uint64_t useful = keyframes_.at(slot).last_useful_frame;
        std::uint32_t at = count;
        while (at > 0 && oldest[at - 1].useful > useful) --at;
        if (at >= kCrowdedCandidates) continue;
        if (count < kCrowdedCandidates) ++count;
        for (std::uint32_t i = count - 1; i > at; --i) oldest[i] = oldest[i - 1];
        oldest[at] = {useful, slot};
    }
    if (count == 0) return false;
    // Of the two nearest to each other the newer goes, so that a way is thinned out evenly and the map keeps what it
    // was built on; but not for one whose points are mostly gone. Spared ones are nobody's neighbour: beside them
    // whatever has just left the local map would go, and the places it shows be forgotten.
    std::uint32_t going = oldest[0].slot;
    std::uint32_t staying = going;
    double least_m2 = parameters_.crowded_m * parameters_.crowded_m;
    for (std::uint32_t i = 1; i < count; ++i) {
        for (std::uint32_t k = 0; k < i; ++k) {
            const double between_m2 = apart_m2(oldest[i].slot, oldest[k].slot);
            if (between_m2 >= least_m2) continue;
            least_m2 = between_m2;
            going = oldest[i].slot;
            staying = oldest[k].slot;
        }
    }
    if (keyframes_.at(going).frame < keyframes_.at(staying).frame) std::swap(going, staying);
    if (going != staying && 2 * proven_points(staying) < proven_points(going)) going = staying;
    release_keyframe(keyframes_.handle_of(going));
    ++statistics_.keyframes_evicted;
    return true;
}

void Map::evict_oldest() noexcept {
    release_keyframe(recent_keyframe(static_cast<std::uint32_t>(keyframes_.size()) - 1));
    ++statistics_.keyframes_evicted;
}

Handle<Keyframe> Map::recent_keyframe(std::uint32_t i) const noexcept {
    if (i >= keyframes_.size()) return {};
    // Frames of keyframes differ, so that each round finds the next older one; i is small, or the pool is.
    std::uint64_t below = ~std::uint64_t{0};
    std::uint32_t best = 0;
    for (std::uint32_t round = 0; round <= i; ++round) {
        bool is_found = false;
        for (std::uint32_t slot = 0; slot < keyframes_.slots_count(); ++slot) {
            if (!keyframes_.is_taken(slot) || keyframes_.at(slot).frame >= below) continue;
            if (is_found && keyframes_.at(slot).frame <= keyframes_.at(best).frame) continue;
            best = slot;
            is_found = true;
        }
        if (!is_found) return {};
        below = keyframes_.at(best).frame;
    }
    return keyframes_.handle_of(best);
}

bool Map::is_redundant(Handle<Keyframe> keyframe) const noexcept {
    const std::uint32_t enough = parameters_.redundant_observers;
    const double slack = parameters_.redundant_scale_factor * parameters_.redundant_scale_factor;
    std::uint32_t points = 0;
    std::uint32_t known = 0;
    const std::span<const Observation> here = observations(keyframe);
    const Vector3 from = keyframes_.at(keyframe.slot()).world_from_camera.translation;
    for (const Observation& observation : here) {
        const MapPoint* const point = points_.find(observation.point);
        if (point == nullptr || point->is_suspect) continue;
        ++points;
        if (point->observers <= enough) continue;
        // Scale: seen from no farther (with some slack) is seen on the same level or a finer one.
        const Vector3 world = vector_of(point->world);
        const double away = slack * (world - from).squaredNorm();
        std::uint32_t others = 0;
        visit_observers(observation.point.slot(), [&](std::uint32_t other) {
            if (other == keyframe.slot()) return;
            others += (world - keyframes_.at(other).world_from_camera.translation).squaredNorm() <= away ? 1U : 0U;
        });
        known += others >= enough ? 1U : 0U;
    }
    return std::uint64_t{1000} * known >= std::uint64_t{parameters_.redundant_permille} * points;
}

// --- the checker -----------------------------------------------------------------------------------------------------

// --- readout ---------------------------------------------------------------------------------------------------------

void Map::express_with_readout(double readout_s) noexcept {
    const double change_s = readout_s - readout_s_;
    readout_s_ = readout_s;
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        if (!points_.is_taken(slot)) continue;
        MapPoint& point = points_.at(slot);
        for (int i = 0; i < 3; ++i) {
            point.world[i] += static_cast<double>(point.world_by_readout[i]) * change_s;
            point.anchor[i] += static_cast<double>(point.anchor_by_readout[i]) * change_s;
        }
    }
    for (std::uint32_t slot = 0; slot < keyframes_.slots_count(); ++slot) {
        if (!keyframes_.is_taken(slot)) continue;
        Keyframe& keyframe = keyframes_.at(slot);
        keyframe.world_from_camera = keyframe.world_from_camera * se3_exp(keyframe.pose_by_readout * change_s);
        renormalise(keyframe.world_from_camera.rotation);
    }
    changes_.add(readout_s);
}

void Map::average(Handle<Keyframe> handle, std::uint32_t index, Handle<MapPoint> point, const Vector3& look) noexcept {
    Keyframe* const keyframe = keyframes_.find(handle);
    if (keyframe == nullptr || !(look.z() > 0.0)) return;
    STILLMESH_CHECK(index < keyframe->observations);
    Observation& o = observations_of(handle.slot())[index];
    if (!(o.point == point) || o.var_z < 0) return;
    const double share = 1.0 / (1.0 + o.looks);
    o.normalised_x += static_cast<float>(share * (look.x() / look.z() - static_cast<double>(o.normalised_x)));
    o.normalised_y += static_cast<float>(share * (look.y() / look.z() - static_cast<double>(o.normalised_y)));
    o.z_m += static_cast<float>(share * (look.z() - static_cast<double>(o.z_m)));
    if (o.looks < parameters_.looks_max) ++o.looks;
    ++keyframe->observations_changed;
}

bool Map::carry_observations(Handle<Keyframe> handle, std::uint32_t image_height) noexcept {
    Keyframe& keyframe = *keyframes_.find(handle);
    const double change_s = readout_s_ - keyframe.readout_s;
    if (std::abs(change_s) < 1e-9) return false;
    keyframe.readout_s = readout_s_;
    ++keyframe.observations_changed;
    Vector6 turning = keyframe.speed;
    for (int i = 0; i < 3; ++i) turning(i) = 0;
    for (Observation& o : observations_of(handle.slot())) {
        const double row = static_cast<double>(o.y) / static_cast<double>(image_height) - 0.5;
        // How far away it is nobody may know: turned only.
        const bool has_depth = o.var_z >= 0;
        const double z = has_depth ? static_cast<double>(o.z_m) : 1.0;
        const Vector3 seen(static_cast<double>(o.normalised_x) * z, static_cast<double>(o.normalised_y) * z, z);
        const Vector3 p = moved_a_little((has_depth ? keyframe.speed : turning) * (row * change_s), seen);
        if (!(p.z() > 0.5 * z)) continue;
        o.normalised_x = static_cast<float>(p.x() / p.z());
        o.normalised_y = static_cast<float>(p.y() / p.z());
        if (has_depth) o.z_m = static_cast<float>(p.z());
    }
    return true;
}

const char* Map::find_fault() const noexcept {
    const std::uint32_t count = keyframes_.slots_count();
    for (std::uint32_t a = 0; a < count; ++a) {
        if (!keyframes_.is_taken(a)) {
            for (std::uint32_t b = 0; b < count; ++b) {
                if (shared(a, b) != 0) return "a free keyframe shares points";
            }
            continue;
        }
        const std::span<const Observation> seen = observations(keyframes_.handle_of(a));
        for (const Observation& o : seen) {
            if (points_.find(o.point) != nullptr && !is_observed_by(o.point.slot(), a)) return "an observer has no bit";
        }
        for (std::uint32_t b = 0; b < count; ++b) {
            if (shared(a, b) != shared(b, a)) return "the numbers of shared points are not symmetric";
            std::uint32_t together = 0;
            if (b != a && keyframes_.is_taken(b)) {
                for (const Observation& o : seen) {
                    if (points_.find(o.point) == nullptr) continue;
                    for (const Observation& p : observations(keyframes_.handle_of(b))) {
                        together += p.point == o.point ? 1U : 0U;
                    }
                }
            }
            if (together != shared(a, b)) return "a number of shared points is wrong";
        }
    }
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        std::uint32_t bits = 0;
        const char* fault = nullptr;
        visit_observers(slot, [&](std::uint32_t keyframe) {
            ++bits;
            if (keyframe >= count || !keyframes_.is_taken(keyframe) || !points_.is_taken(slot)) {
                fault = "a bit without keyframe or point";
                return;
            }
            std::uint32_t times = 0;
            for (const Observation& o : observations(keyframes_.handle_of(keyframe))) {
                times += o.point == points_.handle_of(slot) ? 1U : 0U;
            }
            if (times != 1) fault = "a keyframe observes a point never or twice";
        });
        if (fault != nullptr) return fault;
        if (!points_.is_taken(slot)) continue;
        const MapPoint& point = points_.at(slot);
        if (point.observers != bits) return "a number of observers is wrong";
        if (bits == 0) {
            if (!point.reference.is_null()) return "a reference without observers";
        } else if (keyframes_.find(point.reference) == nullptr || !is_observed_by(slot, point.reference.slot())) {
            return "a reference that does not observe";
        }
    }
    std::uint32_t roots = 0;
    for (std::uint32_t slot = 0; slot < count; ++slot) {
        if (!keyframes_.is_taken(slot)) continue;
        std::uint32_t at = slot;
        for (std::uint32_t steps = 0; !keyframes_.at(at).parent.is_null(); ++steps) {
            if (keyframes_.find(keyframes_.at(at).parent) == nullptr) return "a parent that is gone";
            if (steps > count) return "the spanning tree has a ring";
            at = keyframes_.at(at).parent.slot();
        }
        roots += at == slot ? 1U : 0U;
    }
    if (keyframes_.size() > 0 && roots != 1) return "the spanning tree has not one root";
    return nullptr;
}

}  // namespace stillmesh
