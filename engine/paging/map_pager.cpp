#include "engine/paging/map_pager.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"
#include "engine/base/sort.hpp"
#include "engine/map/eviction.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kNeighbours = PlaceSearch::kNeighbours;
constexpr std::uint32_t kMatchChunk = 256;  // slots in a piece
// Two points of one name that lie so far apart are two points.
constexpr double kSamePoint_m = 0.5;

}  // namespace

void MapPager::create(Arena& arena, World& world, PlaceSearch& places, MapStore* store) noexcept {
    world_ = &world;
    places_ = &places;
    store_ = store;
    const Limits& limits = world.limits;
    outgoing_ = arena.array<std::byte>(region_bytes_max(features_max(limits)));
    incoming_ = arena.array<std::byte>(region_bytes_max(features_max(limits)));
    named_ = arena.array<Named>(features_max(limits));
    known_ = arena.array<Known>(limits.keyframes_max);
    without_ = arena.array<std::uint64_t>(limits.keyframes_max + kRestMax);
    words_.create(arena, limits.features_max);
    resting_.create(arena, kRestMax);
    corrections_.create(arena, kCorrectionsMax);
    const std::uint32_t words = places.is_on() ? places.find_units(limits.features_max) : 1U;
    const std::uint32_t keeping = words + 4 * limits.features_max + kNeighbours * limits.features_max / 32;
    const std::uint32_t asking = kNeighbours * limits.features_max / 32 + limits.features_max / 4;
    const std::uint32_t room = limits.map_points_max / 16 + limits.features_max / 4;
    piece_units_max_ = std::max({keeping + limits.keyframes_max, asking + 2 * limits.keyframes_max,
                                 room + 2 * limits.keyframes_max, 6 * limits.features_max + limits.keyframes_max});
    reset();
}

void MapPager::reset() noexcept {
    incoming_bytes_ = 0;
    std::fill(known_.begin(), known_.end(), Known{});
    words_.clear();
    resting_.clear();
    corrections_.clear();
    loops_closed_ = 0;
    info_ = RegionInfo{};
    keyframe_ = {};
    stage_ = Stage::kIdle;
    cursor_ = 0;
    asked_frame_ = 0;
    asked_keyframe_ = 0;
    answered_id_ = 0;
    next_return_frame_ = 0;
    refused_frame_ = ~std::uint64_t{0};
    is_waiting_ = false;  // an answer that comes yet has an old number
    round_frame_ = ~std::uint64_t{0};
    round_ = Round::kDone;
    kept_in_round_ = 0;
    hash_ = StateHash{};
    statistics_ = StoreStatistics{};
}

Progress MapPager::step(WorkBudget& budget) noexcept {
    if (!is_on() || world_->is_frozen) return Progress::kIdle;
    if (round_frame_ != world_->clock.frame) {
        round_frame_ = world_->clock.frame;
        round_ = Round::kReceive;
        kept_in_round_ = 0;
        note_correction();
    }
    while (!budget.is_spent()) {
        const std::uint32_t units = piece();
        if (units == 0) return budget.units_spent() == 0 ? Progress::kIdle : Progress::kDone;
        budget.spend(units);
    }
    return Progress::kWorking;
}

Progress MapPager::keep_all(WorkBudget& budget) noexcept {
    if (!is_on() || world_->is_frozen) return Progress::kIdle;
    while (!budget.is_spent()) {
        refused_frame_ = ~std::uint64_t{0};
        const std::uint32_t units = keep_next(true);
        if (units == 0) return Progress::kIdle;
        budget.spend(units);
        if (refused_frame_ != ~std::uint64_t{0}) return Progress::kWorking;
    }
    return Progress::kWorking;
}

std::uint32_t MapPager::piece() noexcept {
    switch (stage_) {
        case Stage::kIdle: break;
        case Stage::kCheck: return check();
        case Stage::kNames: return name_points();
        case Stage::kMatch: return match_points();
        case Stage::kRoom: return make_room();
        case Stage::kInsert: return insert();
        case Stage::kWords: return find_words();
    }
    if (round_ == Round::kReceive) {
        round_ = Round::kKeep;
        if (const std::uint32_t units = receive(); units > 0) return units;
    }
    if (round_ == Round::kKeep) {
        if (kept_in_round_++ < kKeptPerRound) {
            if (const std::uint32_t units = keep_next(false); units > 0) return units;
        }
        round_ = Round::kAsk;
    }
    if (round_ == Round::kDone) return 0;
    round_ = Round::kDone;
    return ask();
}

std::uint64_t MapPager::state_hash() const noexcept {
    StateHash hash = hash_;
    hash.add(question_);
    hash.add(statistics_.kept);
    hash.add(statistics_.refused);
    hash.add(statistics_.returned);
    hash.add(statistics_.corrections);
    hash.add(static_cast<std::uint32_t>(stage_));
    return hash.value();
}

// Before anything else is done with the map as it is now.
void MapPager::note_correction() noexcept {
    if (world_->loops_closed == loops_closed_) return;
    loops_closed_ = world_->loops_closed;
    const LoopCorrection& last = world_->last_loop;
    if (last.frame_new <= last.frame_old) return;
    ++statistics_.corrections;
    corrections_.push_over({last, moment()});
}

MapPager::Known& MapPager::known(std::uint32_t slot) noexcept {
    const Handle<Keyframe> handle = world_->map.keyframes().handle_of(slot);
    if (!(known_[slot].handle == handle)) {
        known_[slot] = Known{};
        known_[slot].handle = handle;
    }
    return known_[slot];
}

void MapPager::note_useful() noexcept {
    for (Known& k : known_) {
        if (!k.has_returned || k.is_useful) continue;
        const Keyframe* const keyframe = world_->map.keyframes().find(k.handle);
        if (keyframe == nullptr || keyframe->last_useful_frame <= k.returned_frame) continue;
        k.is_useful = true;
        ++statistics_.useful;
        store_->note_use(keyframe->frame);
    }
}

// --- out -------------------------------------------------------------------------------------------------------------

bool MapPager::has_moved(const Known& of, const SE3& world_from_camera) const noexcept {
    const SE3 off = of.kept_at.inverse() * world_from_camera;
    const double reach_m = world_->configuration.store.moved_m;
    return off.translation.squaredNorm() > reach_m * reach_m ||
           rotation_angle(off.rotation) > world_->configuration.store.moved_rad;
}

bool MapPager::has_kept_twin(std::uint32_t slot) const noexcept {
    const SE3& here = world_->map.keyframes().at(slot).world_from_camera;
    const double reach_m = world_->configuration.store.twin_m;
    for (std::uint32_t other = 0; other < known_.size(); ++other) {
        const Known& k = known_[other];
        if (other == slot || !k.is_stored || world_->map.keyframes().find(k.handle) == nullptr) continue;
        const SE3& there = world_->map.keyframes().at(other).world_from_camera;
        if ((there.translation - here.translation).squaredNorm() > reach_m * reach_m) continue;
        const Vector3 axis_here = here.rotation.col(2);
        const Vector3 axis_there = there.rotation.col(2);
        if (axis_here.dot(axis_there) > world_->configuration.store.twin_cosine_min) return true;
    }
    return false;
}

std::uint32_t MapPager::least_score(std::uint32_t slot, std::uint32_t& units) const noexcept {
    const PlaceSearch::Neighbourhood around = places_->neighbourhood(world_->map, slot);
    units += around.neighbours * world_->limits.features_max / 32;
    return around.score_min;
}

// The oldest keyframe that waits for it.
std::uint32_t MapPager::keep_next(bool is_closing) noexcept {
    if (refused_frame_ == world_->clock.frame) return 0;  // there may be room after the next frame
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const std::span<const std::uint8_t> is_local = world_->local_map.keyframes();
    const Handle<Keyframe> newest = world_->map.recent_keyframe(0);
    std::uint32_t next = keyframes.slots_count();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot)) continue;
        const Known& k = known(slot);
        const Keyframe& keyframe = keyframes.at(slot);
        if (k.is_kept && !has_moved(k, keyframe.world_from_camera)) continue;
        if (!is_closing) {
            // Its points are refined as long as it is in view, and its words settle.
            if (is_local[slot] != 0 || slot == newest.slot()) continue;
            if (!places_->has(k.handle)) continue;
        }
        if (next < keyframes.slots_count() && keyframe.frame >= keyframes.at(next).frame) continue;
        next = slot;
    }
    return next < keyframes.slots_count() ? keep(next) : 0;
}

std::uint32_t MapPager::keep(std::uint32_t slot) noexcept {
    Known& k = known(slot);
    const Keyframe& keyframe = world_->map.keyframes().at(slot);
    std::uint32_t units = 1 + world_->limits.keyframes_max / 16;
    const bool is_again = k.is_stored;
    k.kept_at = keyframe.world_from_camera;
    k.is_kept = true;
    if (!is_again && has_kept_twin(slot)) {
        ++statistics_.known;
        return units;
    }
    const std::size_t size =
        encode_region(world_->map, k.handle, world_->configuration.weights.eligible, moment(), outgoing_);
    units += 2 * world_->limits.features_max;
    LeavingRegion leaving;
    leaving.body = outgoing_.first(size);
    if (leaving.body.size() <
        region_bytes_max(std::min(world_->configuration.store.points_min, features_max(world_->limits)))) {
        ++statistics_.poor;
        return units;
    }
    leaving.words = places_->has(k.handle) ? places_->database().bag(slot) : std::span<const WordWeight>{};
    if (leaving.words.empty()) {  // at the end: nobody has looked it up yet
        places_->find_words(world_->map, k.handle, world_->configuration, words_);
        leaving.words = words_.bag();
        units += places_->find_units(world_->map.observations(k.handle).size());
    } else {
        leaving.alike_score = least_score(slot, units);
    }
    if (leaving.words.empty()) return units;
    leaving.id = keyframe.frame;
    leaving.time_ns = keyframe.time_ns;
    for (int i = 0; i < 3; ++i) {
        leaving.position_m[i] = static_cast<float>(keyframe.world_from_camera.translation(i));
        leaving.axis[i] = static_cast<float>(keyframe.world_from_camera.rotation(i, 2));
    }
    if (store_->keep(leaving) != Status::kOk) {
        ++statistics_.refused;
        k.is_kept = false;  // it is tried again, as long as it is in the map
        refused_frame_ = world_->clock.frame;
        return units;
    }
    k.is_stored = true;
    ++statistics_.kept;
    hash_.add(leaving.id);
    return units;
}

// --- in --------------------------------------------------------------------------------------------------------------

bool MapPager::is_lost() const noexcept {
    const PoseState state = world_->pose.state;
    return (state == PoseState::kNone || state == PoseState::kPredicted) &&
           places_->is_used_by(PlaceSearch::User::kRelocalisation);
}

std::uint32_t MapPager::ask() noexcept {
    const std::uint64_t frame = world_->clock.frame;
    if (is_waiting_ || frame < next_return_frame_) return 0;
    note_useful();
    if (is_lost()) {
        const std::span<const WordWeight> words = places_->words().bag();
        if (words.empty() || asked_frame_ == frame) return 0;
        const double least = world_->configuration.store.lost_score_min * static_cast<double>(kBagWeightOne);
        put(words, ~std::uint64_t{0}, static_cast<std::uint32_t>(least));
        return 1 + static_cast<std::uint32_t>(words.size()) / 8 + world_->limits.keyframes_max;
    }
    // The newest keyframe that can be looked up.
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    std::uint32_t next = keyframes.slots_count();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot) || keyframes.at(slot).frame < asked_keyframe_) continue;
        if (!places_->has(keyframes.handle_of(slot))) continue;
        if (next < keyframes.slots_count() && keyframes.at(slot).frame < keyframes.at(next).frame) continue;
        next = slot;
    }
    if (next == keyframes.slots_count()) return 0;
    const Keyframe& keyframe = keyframes.at(next);
    asked_keyframe_ = keyframe.frame + 1;
    std::uint32_t units = 1 + 2 * world_->limits.keyframes_max;
    const std::uint32_t least = least_score(next, units);
    const std::uint64_t gap = world_->configuration.store.gap_frames;
    if (least == 0 || keyframe.frame < gap) return units;
    const double score_min = world_->configuration.store.score_share * static_cast<double>(least);
    put(places_->database().bag(next), keyframe.frame - gap, static_cast<std::uint32_t>(score_min));
    return units + world_->limits.features_max / 8;
}

void MapPager::put(std::span<const WordWeight> words, std::uint64_t older_than, std::uint32_t score_min) noexcept {
    const std::uint64_t frame = world_->clock.frame;
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
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
    asked_frame_ = frame;
    if (store_->ask(question) != Status::kOk) return;  // the next keyframe asks again
    ++statistics_.asked;
    is_waiting_ = true;
}

std::uint32_t MapPager::receive() noexcept {
    if (!is_waiting_) return 0;
    StoreAnswer answer;
    const Status status = store_->poll(answer, incoming_);
    if (status == Status::kTimedOut) {
        if (world_->clock.frame - asked_frame_ > world_->configuration.store.patience_frames) {
            is_waiting_ = false;
            ++statistics_.late;
        }
        return 0;
    }
    if ((status == Status::kOk || status == Status::kNotFound) && answer.question != question_) {
        ++statistics_.late;  // to a question that was given up; its own is still to come
        return 1;
    }
    is_waiting_ = false;
    if (status == Status::kNotFound) {
        ++statistics_.not_found;
        return 1;
    }
    if (status != Status::kOk || answer.size_bytes == 0 || answer.size_bytes > incoming_.size()) {
        ++statistics_.damaged;
        return 1;
    }
    incoming_bytes_ = answer.size_bytes;
    answered_id_ = answer.id;
    stage_ = Stage::kCheck;
    return 1 + static_cast<std::uint32_t>(answer.size_bytes / 1024);
}

void MapPager::drop() noexcept {
    stage_ = Stage::kIdle;
    incoming_bytes_ = 0;
    // Whatever was wrong with it, it does not come again at once.
    resting_.push_over({answered_id_, world_->clock.frame + world_->configuration.store.rest_frames});
}

std::uint32_t MapPager::check() noexcept {
    const CameraModel& camera = world_->camera;
    const Status status = check_region(region(), features_max(world_->limits), world_->configuration.features.levels,
                                       camera.width, camera.height, info_);
    const std::uint32_t units = 1 + 2 * features_max(world_->limits);
    bool is_right = status == Status::kOk && info_.keyframe.frame == answered_id_ && info_.keyframe.observations > 0;
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count() && is_right; ++slot) {
        is_right = !keyframes.is_taken(slot) || keyframes.at(slot).frame != info_.keyframe.frame;
    }
    // A camera that was found has made every region of this map before now.
    is_right = is_right && info_.keyframe.frame < world_->clock.frame;
    if (!is_right) {
        ++statistics_.damaged;
        drop();
        return units;
    }
    stage_ = Stage::kNames;
    return units;
}

std::uint32_t MapPager::name_points() noexcept {
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
    return 1 + 3 * features_max(world_->limits);
}

std::uint32_t MapPager::match_points() noexcept {
    const Pool<MapPoint>& points = world_->map.points();
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

std::uint32_t MapPager::make_room() noexcept {
    std::uint32_t units = 1;
    stage_ = Stage::kInsert;
    if (world_->map.keyframes().is_full()) {
        units += world_->limits.features_max / 4 + 2 * world_->limits.keyframes_max;
        if (!evict_keyframe(world_->map, world_->local_map.keyframes())) {
            ++statistics_.no_room;
            drop();
            return units;
        }
    }
    std::uint32_t wanted = 0;
    for (std::uint32_t i = 0; i < info_.keyframe.observations; ++i) wanted += named_[i].point.is_null() ? 1U : 0U;
    const std::size_t free = world_->map.points().capacity() - world_->map.points().size();
    if (free < wanted) {
        static_cast<void>(make_room_for_points(world_->map, wanted - static_cast<std::uint32_t>(free),
                                               world_->clock.frame, world_->local_map.spared()));
        units += world_->limits.map_points_max / 16;
    }
    return units;
}

// Where what lay somewhere then lies now: each loop that was closed since moved it by the share of the way on which it
// lay.
SE3 MapPager::correction_since(std::uint64_t left_at, std::uint64_t frame) const noexcept {
    SE3 out;
    for (std::size_t i = 0; i < corrections_.size(); ++i) {
        const LoopCorrection& loop = corrections_[i].loop;
        if (corrections_[i].at <= left_at || frame <= loop.frame_old) continue;
        if (frame >= loop.frame_new) {
            out = loop.world_from_world * out;
        } else {
            const double share =
                static_cast<double>(frame - loop.frame_old) / static_cast<double>(loop.frame_new - loop.frame_old);
            out = se3_exp(se3_log(loop.world_from_world) * share) * out;
        }
        renormalise(out.rotation);
    }
    return out;
}

std::uint32_t MapPager::insert() noexcept {
    stage_ = Stage::kIdle;
    const std::uint32_t units = 6 * features_max(world_->limits) + world_->limits.keyframes_max;
    const Handle<Keyframe> handle = world_->map.add_keyframe();
    if (handle.is_null()) {  // a frame came between, and took the room
        ++statistics_.no_room;
        drop();
        return units;
    }
    const SE3 correction = correction_since(info_.left_at, info_.keyframe.frame);
    const double readout_change_s = world_->map.readout_s() - info_.map_readout_s;
    const std::uint64_t frame = world_->clock.frame;
    Keyframe& keyframe = *world_->map.keyframes().find(handle);
    keyframe = info_.keyframe;
    keyframe.observations = 0;
    keyframe.observations_changed = 0;
    keyframe.parent = {};
    keyframe.last_useful_frame = frame;
    keyframe.world_from_camera =
        correction * (keyframe.world_from_camera * se3_exp(keyframe.pose_by_readout * readout_change_s));
    renormalise(keyframe.world_from_camera.rotation);
    for (int i = 0; i < 3; ++i) world_->map.note_change(keyframe.world_from_camera.translation(i));
    for (const Named& named : named_.first(info_.keyframe.observations)) {
        Observation observation;
        Descriptor descriptor;
        MapPoint read;
        read_region_feature(region(), named.index, observation, descriptor, read);
        const double change_s = readout_change_s;
        store(correction * Vector3(vector_of(read.world) + vector_of(read.world_by_readout) * change_s), read.world);
        store(correction * Vector3(vector_of(read.anchor) + vector_of(read.anchor_by_readout) * change_s), read.anchor);
        store(Vector3(correction.rotation * vector_of(read.world_by_readout)), read.world_by_readout);
        store(Vector3(correction.rotation * vector_of(read.anchor_by_readout)), read.anchor_by_readout);
        observation.point = named.point;
        const MapPoint* const there = world_->map.points().find(named.point);
        const bool is_there =
            there != nullptr && !there->is_suspect &&
            (vector_of(there->world) - vector_of(read.world)).squaredNorm() < kSamePoint_m * kSamePoint_m;
        if (is_there) {
            ++statistics_.points_known;
        } else {
            observation.point = {};
            const Result<Handle<MapPoint>> made = world_->map.add_point();
            if (!made.is_ok()) continue;  // the pool counts it; the feature is of no use without
            MapPoint& point = *world_->map.points().find(made.value());
            point = read;
            point.last_seen_frame = frame;
            point.empty_views = 0;
            observation.point = made.value();
            ++statistics_.points_made;
        }
        world_->map.add_observation(handle, observation, descriptor);
    }
    world_->map.attach_returned(handle);
    Known& k = known(handle.slot());
    k.returned_frame = frame;
    k.is_kept = k.is_stored = k.has_returned = true;
    // One that loops have moved since is kept again, where it lies now.
    k.kept_at = info_.keyframe.world_from_camera;
    resting_.push_over({info_.keyframe.frame, frame + world_->configuration.store.rest_frames});
    next_return_frame_ = frame + world_->configuration.store.pause_frames;
    ++statistics_.returned;
    hash_.add(info_.keyframe.frame);
    keyframe_ = handle;
    stage_ = Stage::kWords;
    world_->local_map.invalidate();
    return units;
}

std::uint32_t MapPager::find_words() noexcept {
    stage_ = Stage::kIdle;
    incoming_bytes_ = 0;
    if (world_->map.keyframes().find(keyframe_) == nullptr) return 1;
    const std::span<const Descriptor> descriptors = world_->map.descriptors(keyframe_);
    const std::span<std::uint8_t> eligible = places_->eligible().first(descriptors.size());
    std::fill(eligible.begin(), eligible.end(), std::uint8_t{1});  // a region has no others
    words_.find(places_->vocabulary(), descriptors);
    words_.weigh(places_->vocabulary(), eligible);
    places_->purge(world_->map);
    places_->add(keyframe_, words_);
    return places_->find_units(descriptors.size());
}

}  // namespace stillmesh
