#include "engine/map/map.hpp"

#include <algorithm>

#include "engine/base/sort.hpp"

namespace stillmesh {
namespace {

// What the hash of changes calls them.
enum class Change : std::uint64_t { kPoint = 1, kPointGone, kKeyframe, kKeyframeGone, kLink, kUnlink, kFuse, kParent };
constexpr std::uint64_t word_of(Change change, std::uint64_t a, std::uint64_t b = 0) noexcept {
    return static_cast<std::uint64_t>(change) << 56U | a << 28U | b;
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
    scratch_ = arena.array<std::uint64_t>(limits.map_points_max);
    class_counts_ = arena.array<std::uint16_t>(std::size_t{kSeenClasses} * limits.keyframes_max);
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
    stays.agreed_travelled = std::max(stays.agreed_travelled, going.agreed_travelled);
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
        if (shared(slot, other) < std::max(shared_min, 1U)) continue;
        keep_best(best, count, other,
                  [&](std::uint32_t a, std::uint32_t b) { return shared(slot, a) > shared(slot, b); });
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
    if (parent.is_null()) return;
    const Handle<Keyframe> child = is_oldest ? root : keyframe;
    const Handle<Keyframe> above = is_oldest ? keyframe : parent;
    keyframes_.at(child.slot()).parent = above;
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
            continue;
        }
        std::uint32_t parent = fallback.slot();
        for (std::uint32_t other = 0; other < count; ++other) {
            if (other != slot && shared(child, other) > shared(child, parent) && !is_below(other, child))
                parent = other;
        }
        orphan.parent = keyframes_.handle_of(parent);
        changes_.add(word_of(Change::kParent, child, parent));
    }
    for (std::uint32_t other = 0; other < count; ++other) {
        shared_[static_cast<std::size_t>(slot) * count + other] = 0;
        shared_[static_cast<std::size_t>(other) * count + slot] = 0;
    }
    keyframes_.release(keyframe);
    changes_.add(word_of(Change::kKeyframeGone, slot));
}

Handle<Keyframe> Map::recent_keyframe(std::uint32_t i) const noexcept {
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

}  // namespace stillmesh
