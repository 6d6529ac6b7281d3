#include "engine/paging/region_return.hpp"

#include <algorithm>

#include "engine/base/sort.hpp"
#include "engine/map/eviction.hpp"
#include "engine/map/map_correction.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kMatchChunk = 256;  // slots in a piece
// Two points of one name that lie so far apart are two points.
constexpr double kSamePoint_m = 0.5;

}  // namespace

void RegionReturn::create(Arena& arena, PagingState& state) noexcept {
    state_ = &state;
    incoming_ = arena.array<std::byte>(region_bytes_max(state.features_max()));
    named_ = arena.array<Named>(state.features_max());
    without_ = arena.array<std::uint64_t>(state.world->limits.keyframes_max + kRestMax);
    resting_.create(arena, kRestMax);
}

void RegionReturn::reset() noexcept {
    resting_.clear();
    stage_ = Stage::kIdle;  // all of the region at hand is written before it is read
    queried_frame_ = 0;
    queried_keyframe_ = 0;
    next_return_frame_ = 0;
    is_waiting_ = false;  // an answer that comes yet has an old number
}

std::uint32_t RegionReturn::piece_units_max() const noexcept {
    const Limits& limits = state_->world->limits;
    const std::uint32_t querying = PlaceSearch::kNeighbours * limits.features_max / 32 + limits.features_max / 4;
    const std::uint32_t room = limits.map_points_max / 16 + limits.features_max / 4;
    return std::max({querying + 2 * limits.keyframes_max, room + 2 * limits.keyframes_max,
                     6 * limits.features_max + limits.keyframes_max});
}

std::uint32_t RegionReturn::piece() noexcept {
    switch (stage_) {
        case Stage::kIdle: break;
        case Stage::kCheck: return check();
        case Stage::kNames: return name_points();
        case Stage::kMatch: return match_points();
        case Stage::kRoom: return make_room();
        case Stage::kInsert: return insert();
        case Stage::kWords: return find_words();
    }
    return 0;
}

// --- the store -------------------------------------------------------------------------------------------------------

bool RegionReturn::is_lost() const noexcept {
    return state_->world->pose.state < PoseState::kUnsure &&
           state_->places->is_used_by(PlaceSearch::User::kRelocalisation);
}

// The newest keyframe that can be looked up and was not queried yet, by slot; slots_count(): none.
std::uint32_t RegionReturn::newest_to_query() const noexcept {
    const Pool<Keyframe>& keyframes = state_->world->map.keyframes();
    std::uint32_t next = keyframes.slots_count();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot) || keyframes.at(slot).frame < queried_keyframe_) continue;
        if (!state_->places->has(keyframes.handle_of(slot))) continue;
        if (next == keyframes.slots_count() || keyframes.at(slot).frame >= keyframes.at(next).frame) next = slot;
    }
    return next;
}

std::uint32_t RegionReturn::query() noexcept {
    const World& world = *state_->world;
    if (!may_query()) return 0;
    if (is_lost()) {
        const std::span<const WordWeight> words = state_->places->words().bag();
        if (words.empty() || queried_frame_ == world.clock.frame) return 0;
        const double least = world.parameters.store.lost_score_min * static_cast<double>(kBagWeightOne);
        send(words, ~std::uint64_t{0}, static_cast<std::uint32_t>(least));
        return 1 + static_cast<std::uint32_t>(words.size()) / 8 + world.limits.keyframes_max;
    }
    const std::uint32_t slot = newest_to_query();
    if (slot == world.map.keyframes().slots_count()) return 0;
    const std::uint64_t made = world.map.keyframes().at(slot).frame;
    queried_keyframe_ = made + 1;
    std::uint32_t units = 1 + 2 * world.limits.keyframes_max;
    const std::uint32_t least = state_->least_score(slot, units);
    const std::uint64_t gap = world.parameters.store.gap_frames;
    if (least == 0 || made < gap) return units;
    const double score_min = world.parameters.store.score_share * static_cast<double>(least);
    send(state_->places->database().bag(slot), made - gap, static_cast<std::uint32_t>(score_min));
    return units + world.limits.features_max / 8;
}

void RegionReturn::send(std::span<const WordWeight> words, std::uint64_t older_than, std::uint32_t score_min) noexcept {
    const std::uint64_t frame = state_->world->clock.frame;
    const Pool<Keyframe>& keyframes = state_->world->map.keyframes();
    std::size_t count = 0;
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (keyframes.is_taken(slot)) without_[count++] = keyframes.at(slot).frame;
    }
    for (std::size_t i = 0; i < resting_.size(); ++i) {
        if (resting_[i].until_frame > frame) without_[count++] = resting_[i].id;
    }
    StoreQuestion question;
    question.number = ++question_;
    question.words = words;
    question.without = without_.first(count);
    question.older_than = older_than;
    question.score_min = std::max(score_min, 1U);
    queried_frame_ = frame;
    if (state_->store->ask(question) != Status::kOk) return;  // the next keyframe is queried again
    ++state_->world->statistics.store.asked;
    is_waiting_ = true;
}

std::uint32_t RegionReturn::receive() noexcept {
    if (!is_waiting_) return 0;
    StoreStatistics& statistics = state_->world->statistics.store;
    StoreAnswer answer;
    const Status status = state_->store->poll(answer, incoming_);
    if (status == Status::kTimedOut) {
        if (state_->world->clock.frame - queried_frame_ > state_->world->parameters.store.gap_frames) {
            is_waiting_ = false;
            ++statistics.late;
        }
        return 0;
    }
    if ((status == Status::kOk || status == Status::kNotFound) && answer.question != question_) {
        ++statistics.late;  // to a question that was given up; its own is still to come
        return 1;
    }
    is_waiting_ = false;
    if (status == Status::kNotFound) {
        ++statistics.not_found;
        return 1;
    }
    if (status != Status::kOk || answer.size_bytes > incoming_.size()) {
        ++statistics.damaged;
        return 1;
    }
    incoming_bytes_ = answer.size_bytes;
    answered_id_ = answer.id;
    stage_ = Stage::kCheck;
    return 1 + static_cast<std::uint32_t>(answer.size_bytes / 1024);
}

void RegionReturn::rest(std::uint64_t id) noexcept {
    resting_.push_over({id, state_->world->clock.frame + state_->world->parameters.store.gap_frames});
}

void RegionReturn::drop() noexcept {
    stage_ = Stage::kIdle;
    rest(answered_id_);  // whatever was wrong with it
}

// --- the region ------------------------------------------------------------------------------------------------------

std::uint32_t RegionReturn::check() noexcept {
    const World& world = *state_->world;
    const RegionBounds bounds{state_->features_max(), world.parameters.features.levels, world.camera.width,
                              world.camera.height};
    const Status status = check_region(region(), bounds, info_);
    const std::uint32_t units = 1 + 2 * state_->features_max();
    bool is_right = status == Status::kOk && info_.keyframe.frame == answered_id_ && info_.keyframe.observations > 0;
    const Pool<Keyframe>& keyframes = world.map.keyframes();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count() && is_right; ++slot) {
        is_right = !keyframes.is_taken(slot) || keyframes.at(slot).frame != info_.keyframe.frame;
    }
    // A camera that was found has made every region of this map before now.
    if (is_right && info_.keyframe.frame < world.clock.frame) {
        stage_ = Stage::kNames;
    } else {
        ++state_->world->statistics.store.damaged;
        drop();
    }
    return units;
}

std::uint32_t RegionReturn::name_points() noexcept {
    const std::uint32_t count = info_.keyframe.observations;
    for (std::uint32_t i = 0; i < count; ++i) {
        Observation observation;
        Descriptor descriptor;
        MapPoint point;
        read_region_feature(region(), i, observation, descriptor, point);
        named_[i] = {point_name(point), {}, i};
    }
    sort(named_.first(count),
         [](const Named& a, const Named& b) { return a.name < b.name || (a.name == b.name && a.index < b.index); });
    stage_ = Stage::kMatch;
    cursor_ = 0;
    return 1 + 3 * state_->features_max();
}

std::uint32_t RegionReturn::match_points() noexcept {
    const Pool<MapPoint>& points = state_->world->map.points();
    const std::span<Named> named = named_.first(info_.keyframe.observations);
    const std::uint32_t end = std::min(cursor_ + kMatchChunk, points.slots_count());
    for (; cursor_ < end; ++cursor_) {
        if (!points.is_taken(cursor_) || points.at(cursor_).is_suspect) continue;
        const std::uint64_t name = point_name(points.at(cursor_));
        const auto found = std::lower_bound(named.begin(), named.end(), name,
                                            [](const Named& a, std::uint64_t b) { return a.name < b; });
        if (found != named.end() && found->name == name && found->point.is_null()) {
            found->point = points.handle_of(cursor_);
        }
    }
    if (cursor_ == points.slots_count()) stage_ = Stage::kRoom;
    return kMatchChunk;
}

std::uint32_t RegionReturn::make_room() noexcept {
    World& world = *state_->world;
    std::uint32_t units = 1;
    stage_ = Stage::kInsert;
    if (world.map.keyframes().is_full()) {
        units += world.limits.features_max / 4 + 2 * world.limits.keyframes_max;
        if (!evict_keyframe(world.map, world.local_map.keyframes())) {
            ++state_->world->statistics.store.no_room;
            drop();
            return units;
        }
    }
    std::uint32_t wanted = 0;
    for (std::uint32_t i = 0; i < info_.keyframe.observations; ++i) wanted += named_[i].point.is_null() ? 1U : 0U;
    const std::size_t free = world.map.points().capacity() - world.map.points().size();
    if (free < wanted) {
        static_cast<void>(make_room_for_points(world.map, wanted - static_cast<std::uint32_t>(free), world.clock.frame,
                                               world.local_map.spared()));
        units += world.limits.map_points_max / 16;
    }
    return units;
}

std::uint32_t RegionReturn::insert() noexcept {
    World& world = *state_->world;
    stage_ = Stage::kIdle;
    const std::uint32_t units = 6 * state_->features_max() + world.limits.keyframes_max;
    const Handle<Keyframe> handle = world.map.add_keyframe();
    if (handle.is_null()) {  // a frame came between, and took the room
        ++state_->world->statistics.store.no_room;
        drop();
        return units;
    }
    const SE3 correction = state_->correction_since(info_.left_at, info_.keyframe.frame);
    const double readout_change_s = world.map.readout_s() - info_.map_readout_s;
    Keyframe& keyframe = *world.map.keyframes().find(handle);
    keyframe = info_.keyframe;
    keyframe.observations = 0;
    keyframe.observations_changed = 0;
    keyframe.parent = {};
    keyframe.last_useful_frame = world.clock.frame;
    keyframe.world_from_camera =
        correction * (keyframe.world_from_camera * se3_exp(keyframe.pose_by_readout * readout_change_s));
    renormalise(keyframe.world_from_camera.rotation);
    for (int i = 0; i < 3; ++i) world.map.note_change(keyframe.world_from_camera.translation(i));
    for (const Named& named : named_.first(info_.keyframe.observations)) insert_feature(handle, named, correction);
    world.map.attach_returned(handle);
    PagingState::Known& k = state_->known_of(handle.slot());
    k.returned_frame = world.clock.frame;
    k.is_kept = k.is_stored = k.has_returned = true;
    // One that loops have moved since is kept again, where it lies now.
    k.kept_at = info_.keyframe.world_from_camera;
    rest(info_.keyframe.frame);
    next_return_frame_ = world.clock.frame + world.parameters.store.pause_frames;
    ++state_->world->statistics.store.returned;
    state_->hash.add(info_.keyframe.frame);
    keyframe_ = handle;
    stage_ = Stage::kWords;
    world.local_map.invalidate();
    return units;
}

void RegionReturn::insert_feature(Handle<Keyframe> handle, const Named& named, const SE3& correction) noexcept {
    Map& map = state_->world->map;
    Observation observation;
    Descriptor descriptor;
    MapPoint read;
    read_region_feature(region(), named.index, observation, descriptor, read);
    shift_by_readout(read, map.readout_s() - info_.map_readout_s);
    move_point(read, correction);
    observation.point = named.point;
    const MapPoint* const there = map.points().find(named.point);
    const bool is_there = there != nullptr && !there->is_suspect &&
                          (vector_of(there->world) - vector_of(read.world)).squaredNorm() < kSamePoint_m * kSamePoint_m;
    if (is_there) {
        ++state_->world->statistics.store.points_known;
    } else {
        observation.point = {};
        const Result<Handle<MapPoint>> made = map.add_point();
        if (!made.is_ok()) return;  // the pool counts it; the feature is of no use without
        MapPoint& point = *map.points().find(made.value());
        point = read;
        // Points may be younger than the keyframes of a store, and a run that begins in it begins where those end.
        point.created_ns = std::min(point.created_ns, state_->world->clock.time_ns);
        point.anchor_ns = std::min(point.anchor_ns, state_->world->clock.time_ns);
        point.last_seen_frame = state_->world->clock.frame;
        point.empty_views = 0;
        observation.point = made.value();
        ++state_->world->statistics.store.points_made;
    }
    map.add_observation(handle, observation, descriptor);
}

std::uint32_t RegionReturn::find_words() noexcept {
    PlaceSearch& places = *state_->places;
    const Map& map = state_->world->map;
    stage_ = Stage::kIdle;
    if (map.keyframes().find(keyframe_) == nullptr) return 1;
    const std::span<const Descriptor> descriptors = map.descriptors(keyframe_);
    const std::span<std::uint8_t> eligible = places.eligible().first(descriptors.size());
    std::fill(eligible.begin(), eligible.end(), std::uint8_t{1});  // a region has no others
    state_->words.find(places.vocabulary(), descriptors);
    state_->words.weigh(places.vocabulary(), eligible);
    places.purge(map);
    places.add(keyframe_, state_->words);
    return places.find_units(descriptors.size());
}

}  // namespace stillmesh
