#include "engine/loop_closing/loop_closing.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"
#include "engine/recognition/map_drift.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kSharedMin = PlaceSearch::kSharedMin;
constexpr std::uint32_t kStrong = 6;  // covisible keyframes of each that become edges
constexpr std::uint32_t kFusePiece = 32;
// What one edge of odometry is worth, with kSharedUsual points shared; a loop has been measured with care.
constexpr double kEdge_m = 0.01;
constexpr double kEdge_rad = 0.004;
constexpr double kSharedUsual = 100;
constexpr double kLoop_m = 0.005;
constexpr double kLoop_rad = 0.002;

double length(const Vector3& v) noexcept {
    return std::sqrt(v.squaredNorm());
}

// A keyframe that was measured to lie so far `off`, by so much `information`, may lie where it is: a few points far
// away tell its place to some centimetres only, and "correcting" it by less makes a map worse that knows better.
bool is_noise(const SE3& off, const Matrix6& information, const LoopParameters& p) noexcept {
    const Vector6 xi = se3_log(off);
    return xi.dot(information * xi) < p.correction_chi2_min;
}

}  // namespace

void LoopClosing::create(Arena& arena, World& world, PlaceSearch& places, PointFusion& fusion) noexcept {
    world_ = &world;
    places_ = &places;
    fusion_ = &fusion;
    const Limits& limits = world.limits;
    global_.create(arena, global_sizes(limits));
    point_index_ = arena.array<std::uint32_t>(global_sizes(limits).points_max);
    adjusted_ = arena.array<Handle<MapPoint>>(global_sizes(limits).points_max);
    graph_.create(arena, {keyframes_max(limits), edges_max(limits)});
    moved_ = arena.array<Moved>(keyframes_max(limits));
    node_ = arena.array<std::uint16_t>(keyframes_max(limits));
    loops_.create(arena, loops_max(limits));
    matches_.create(arena, PlaceVerifier::pairs_max(limits));
    const std::uint32_t commit = limits.map_points_max / 16 + 8 * limits.keyframes_max + 1;
    const std::uint32_t build = 24 * limits.keyframes_max + limits.keyframes_max * limits.keyframes_max / 64 + 1;
    const std::uint32_t choose = 64 * limits.keyframes_max;
    const std::uint32_t words = places.is_on() ? places.find_units(limits.features_max) : 1U;
    const std::uint32_t fuse = kFusePiece * (limits.features_max + 8);
    piece_units_max_ = std::max({commit, build, choose, words, fuse, places.verifier().piece_units_max(),
                                 limits.features_max, PoseGraph::kPieceUnitsMax, global_.piece_units_max()});
    reset();
}

void LoopClosing::reset() noexcept {
    graph_.begin();
    global_.begin();
    adjusting_ = Adjusting::kNone;
    adjusting_cursor_ = 0;
    adjusting_since_ = 0;
    loops_.clear();
    history_count_ = 0;
    candidates_count_ = 0;
    keyframe_ = found_ = {};
    matches_.clear();
    sources_count_ = targets_count_ = 0;
    stage_ = Stage::kIdle;
    cursor_ = source_ = target_ = 0;
    next_frame_ = 0;
    closed_frame_ = 0;
    has_closed_ = false;
    rest_ = 0;
    statistics_ = LoopStatistics{};
}

void LoopClosing::enter(Stage stage) noexcept {
    stage_ = stage;
    cursor_ = 0;
    source_ = target_ = 0;
}

// Overtaken: by a relocalisation that took the searcher, or the keyframe is gone.
void LoopClosing::drop() noexcept {
    ++statistics_.dropped;
    finish();
}

void LoopClosing::finish() noexcept {
    keyframe_ = found_ = {};
    enter(Stage::kIdle);
}

// The oldest keyframe not looked up yet, once what it saw has had the time to prove that it stands still: people who
// had just come into the picture were taken for places.
bool LoopClosing::take() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const Handle<Keyframe> newest = world_->map.recent_keyframe(0);
    Handle<Keyframe> next;
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot) || slot == newest.slot() || keyframes.at(slot).frame < next_frame_) continue;
        if (next.is_null() || keyframes.at(slot).frame < keyframes.at(next.slot()).frame) {
            next = keyframes.handle_of(slot);
        }
    }
    if (next.is_null()) return false;
    const double age_s = seconds_between(keyframes.at(next.slot()).time_ns, world_->clock.time_ns);
    if (age_s < world_->configuration.loop.settle_s && !world_->is_frozen) return false;
    keyframe_ = next;
    places_->take(PlaceSearch::User::kLoopClosing);
    enter(Stage::kWords);
    return true;
}

Progress LoopClosing::step(WorkBudget& budget) noexcept {
    if (!places_->is_on()) return Progress::kIdle;
    while (!budget.is_spent()) {
        if (stage_ == Stage::kIdle && !take()) {
            if (adjusting_ == Adjusting::kNone) return budget.units_spent() == 0 ? Progress::kIdle : Progress::kDone;
            adjust(budget);
            continue;
        }
        if (is_searching()) {
            const bool is_overtaken = !places_->is_used_by(PlaceSearch::User::kLoopClosing);
            if (is_overtaken || world_->map.keyframes().find(keyframe_) == nullptr) {
                budget.spend(1);
                drop();
            }
        }
        switch (stage_) {
            case Stage::kIdle: break;  // dropped: on with the next
            case Stage::kWords: budget.spend(find_words()); break;
            case Stage::kQuery:
                if (places_->query().step(places_->database(), budget) != Progress::kWorking) enter(Stage::kChoose);
                break;
            case Stage::kChoose: budget.spend(choose()); break;
            case Stage::kAsk: budget.spend(ask()); break;
            case Stage::kVerify:
                if (!places_->has(places_->verifier().candidate()) ||
                    places_->verifier().step(world_->map, places_->vocabulary(),
                                             places_->database().direct_index(places_->verifier().candidate().slot()),
                                             budget) != Progress::kWorking) {
                    budget.spend(answer());
                }
                break;
            case Stage::kBuild: budget.spend(build()); break;
            case Stage::kSolve:
                if (graph_.step(budget) != Progress::kWorking) enter(Stage::kCommit);
                break;
            case Stage::kCommit: budget.spend(commit()); break;
            case Stage::kFuseMatches: budget.spend(fuse_matches()); break;
            case Stage::kFuseNeighbours: budget.spend(fuse_neighbours()); break;
        }
    }
    return Progress::kWorking;
}

// --- search ----------------------------------------------------------------------------------------------------------

std::uint32_t LoopClosing::find_words() noexcept {
    FrameWords& words = places_->words();
    places_->find_words(world_->map, keyframe_, world_->configuration, words);
    places_->purge(world_->map);
    places_->query().begin(places_->database(), words.bag());
    places_->add(keyframe_);
    next_frame_ = world_->map.keyframes().find(keyframe_)->frame + 1;
    const std::uint32_t units = places_->find_units(world_->map.observations(keyframe_).size());
    if (world_->is_frozen || moved_.empty()) {  // a map that stays as it is, or is small
        finish();
        return units;
    }
    ++statistics_.queries;
    enter(Stage::kQuery);
    return units;
}

// Seen together, or the same.
bool LoopClosing::is_near(Handle<Keyframe> a, Handle<Keyframe> b) const noexcept {
    return a == b || world_->map.shared(a.slot(), b.slot()) >= kSharedMin;
}

bool LoopClosing::agrees(const Places& places, Handle<Keyframe> candidate) const noexcept {
    for (std::uint32_t i = 0; i < places.count; ++i) {
        if (world_->map.keyframes().find(places.keyframes[i]) != nullptr && is_near(places.keyframes[i], candidate)) {
            return true;
        }
    }
    return false;
}

std::uint32_t LoopClosing::choose() noexcept {
    places_->purge(world_->map);
    const KeyframeDatabase& database = places_->database();
    const auto [count, scored, score_min] = places_->neighbourhood(world_->map, keyframe_.slot());
    Places now;
    candidates_count_ = 0;
    const double share = world_->configuration.loop.score_share;
    const std::uint64_t frame = world_->map.keyframes().find(keyframe_)->frame;
    const bool is_resting = rest_ > 0;
    if (rest_ > 0) --rest_;
    std::uint32_t looked_at = 0;
    for (const PlaceCandidate& place : places_->query().candidates()) {
        ++looked_at;
        if (scored == 0 || now.count == kHistoryMax) break;
        if (static_cast<double>(place.score) < share * static_cast<double>(score_min)) break;  // they descend
        if (!database.has(place.keyframe_slot) || !world_->map.keyframes().is_taken(place.keyframe_slot)) continue;
        const Handle<Keyframe> handle = world_->map.keyframes().handle_of(place.keyframe_slot);
        if (!places_->has(handle) || handle == keyframe_) continue;
        const std::uint64_t then = world_->map.keyframes().at(place.keyframe_slot).frame;
        if ((frame > then ? frame - then : then - frame) < world_->configuration.loop.gap_frames) continue;
        now.keyframes[now.count++] = handle;
        if (place.score < score_min || is_resting) continue;
        if (candidates_count_ == std::min(world_->configuration.loop.candidates_max, kCandidatesMax)) continue;
        // The k queries before must agree.
        if (history_count_ < world_->configuration.loop.consistency) continue;
        bool is_consistent = true;
        for (std::uint32_t k = 0; k < world_->configuration.loop.consistency && is_consistent; ++k) {
            is_consistent = agrees(history_[k], handle);
        }
        if (!is_consistent) continue;
        // Of each group the best, which came first.
        bool is_new = true;
        for (std::uint32_t i = 0; i < candidates_count_ && is_new; ++i) is_new = !is_near(candidates_[i], handle);
        if (is_new) candidates_[candidates_count_++] = handle;
    }
    for (std::uint32_t k = kConsistencyMax - 1; k > 0; --k) history_[k] = history_[k - 1];
    history_[0] = now;
    if (history_count_ < kConsistencyMax) ++history_count_;
    if (candidates_count_ == 0) {
        finish();
    } else {
        enter(Stage::kAsk);
    }
    // Scores are merged lists of words; agreement compares every place with those of the queries before.
    return 1 + count * world_->limits.features_max / 32 + looked_at / 4 +
           now.count * kHistoryMax * kConsistencyMax / 16;
}

std::uint32_t LoopClosing::ask() noexcept {
    PlaceVerifier& verifier = places_->verifier();
    const std::span<const Observation> seen = world_->map.observations(keyframe_);
    verifier.begin_query(world_->map.descriptors(keyframe_));
    for (std::size_t i = 0; i < seen.size(); ++i) {
        verifier.add_feature(
            seen[i], is_static(world_->map.points().find(seen[i].point), world_->configuration.weights.eligible));
    }
    verifier.end_query(places_->database().direct_index(keyframe_.slot()));
    const auto units = static_cast<std::uint32_t>(seen.size() / 4) + 1;
    const NoiseFactors noise{std::max(1.0, world_->noise.pixel), std::max(1.0, world_->noise.depth)};
    verifier.start(world_->map, candidates_[cursor_], noise,
                   {world_->configuration.loop.matches_min, world_->configuration.loop.inliers_min});
    ++statistics_.candidates;
    stage_ = Stage::kVerify;  // the cursor stays
    return units;
}

// Geometric consistency, and how far odometry can have led astray.
Refusal LoopClosing::judge(const SE3& world_from_keyframe) const noexcept {
    const LoopParameters& p = world_->configuration.loop;
    const Keyframe& here = *world_->map.keyframes().find(keyframe_);
    const Keyframe* const there = world_->map.keyframes().find(places_->verifier().candidate());
    if (there == nullptr) return Refusal::kGone;
    const SE3 between = there->world_from_camera.inverse() * world_from_keyframe;
    if (length(between.translation) > p.distance_max_m) return Refusal::kFar;
    const std::uint32_t there_slot = places_->verifier().candidate().slot();
    const double drift_m = p.drift_m + drift_between(world_->map, keyframe_.slot(), there_slot, p);
    const SE3 off = here.world_from_camera.inverse() * world_from_keyframe;
    // A metre of drift comes with some tenths of a radian.
    if (length(off.translation) > drift_m || rotation_angle(off.rotation) > 0.2 + 0.3 * drift_m) {
        return Refusal::kUnlikely;
    }
    return Refusal::kNone;
}

void LoopClosing::refused(Refusal refusal) noexcept {
    switch (refusal) {
        case Refusal::kNone: break;
        case Refusal::kFewMatches: ++statistics_.refused_matches; break;
        case Refusal::kNoPose: ++statistics_.refused_pose; break;
        case Refusal::kFewInliers: ++statistics_.refused_inliers; break;
        case Refusal::kNotSpread: ++statistics_.refused_spread; break;
        case Refusal::kFar: ++statistics_.refused_far; break;
        case Refusal::kUnlikely: ++statistics_.refused_unlikely; break;
        case Refusal::kGone: ++statistics_.refused_gone; break;
    }
}

std::uint32_t LoopClosing::answer() noexcept {
    PlaceVerifier& verifier = places_->verifier();
    Refusal refusal = verifier.is_accepted() ? Refusal::kNone : verifier.refusal();
    if (verifier.is_running()) refusal = Refusal::kGone;
    if (refusal == Refusal::kNone) refusal = judge(verifier.world_from_query());
    if (refusal != Refusal::kNone) {
        refused(refusal);
        if (++cursor_ < candidates_count_) {
            stage_ = Stage::kAsk;
        } else {
            finish();
        }
        return 1;
    }
    // Found. What is needed of the verifier is copied: a lost camera may take it at any time.
    found_ = verifier.candidate();
    matches_.clear();
    for (const PlaceMatch& match : verifier.agreeing()) STILLMESH_CHECK(matches_.push(match));
    const Keyframe& here = *world_->map.keyframes().find(keyframe_);
    const Keyframe& there = *world_->map.keyframes().find(found_);
    const SE3 off = here.world_from_camera.inverse() * verifier.world_from_query();
    const LoopParameters& p = world_->configuration.loop;
    const bool is_small =
        length(off.translation) < p.correction_min_m && rotation_angle(off.rotation) < p.correction_min_rad;
    const bool is_told = !is_noise(off, verifier.information(), p);
    // The graph takes a loop at its word, to the millimetre: noise is none.
    if (is_small || is_told) {
        loops_.push_over({found_, keyframe_, there.world_from_camera.inverse() * verifier.world_from_query()});
    }
    rest_ = p.rest_keyframes;
    if (is_small || !is_told) {
        ++statistics_.confirmed;
        closed_frame_ = here.frame;
        has_closed_ = true;
        enter(Stage::kFuseMatches);
    } else {
        enter(Stage::kBuild);
    }
    return 1 + static_cast<std::uint32_t>(matches_.size()) / 8;
}

// --- correction ------------------------------------------------------------------------------------------------------

void LoopClosing::add_edge(std::uint32_t slot_a, std::uint32_t slot_b, double shared) noexcept {
    const double share = std::clamp(shared / kSharedUsual, 0.2, 3.0);
    PoseGraphEdge edge;
    edge.a = node_[slot_a] - 1U;
    edge.b = node_[slot_b] - 1U;
    edge.a_from_b = moved_[slot_a].before.inverse() * moved_[slot_b].before;
    edge.info_translation = share / (kEdge_m * kEdge_m);
    edge.info_rotation = share / (kEdge_rad * kEdge_rad);
    static_cast<void>(graph_.add_edge(edge));  // full: those that came first are the most needed
}

std::uint32_t LoopClosing::build() noexcept {
    drop_adjustment();  // its keyframes are about to move
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const std::uint32_t slots = keyframes.slots_count();
    graph_.begin();
    std::fill(moved_.begin(), moved_.end(), Moved{});
    std::fill(node_.begin(), node_.end(), std::uint16_t{0});
    // Parents before children.
    std::uint32_t units = 1;
    for (bool has_grown = true; has_grown;) {
        has_grown = false;
        units += slots / 64;
        for (std::uint32_t slot = 0; slot < slots; ++slot) {
            if (!keyframes.is_taken(slot) || node_[slot] != 0) continue;
            const Keyframe& keyframe = keyframes.at(slot);
            std::uint32_t parent = PoseGraph::kNoParent;
            if (!keyframe.parent.is_null()) {
                if (node_[keyframe.parent.slot()] == 0) continue;
                parent = node_[keyframe.parent.slot()] - 1U;
            }
            const auto added = graph_.add_node(keyframe.world_from_camera, parent);
            STILLMESH_CHECK(added.is_ok());
            node_[slot] = static_cast<std::uint16_t>(added.value() + 1);
            moved_[slot].handle = keyframes.handle_of(slot);
            moved_[slot].before = keyframe.world_from_camera;
            has_grown = true;
        }
    }
    // First what must not be missing: the tree and the loops.
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
        if (node_[slot] == 0 || keyframes.at(slot).parent.is_null()) continue;
        const std::uint32_t parent = keyframes.at(slot).parent.slot();
        add_edge(parent, slot, world_->map.shared(parent, slot));
    }
    for (std::size_t i = 0; i < loops_.size(); ++i) {
        const Loop& loop = loops_[i];
        if (keyframes.find(loop.a) == nullptr || keyframes.find(loop.b) == nullptr) continue;
        PoseGraphEdge edge;
        edge.a = node_[loop.a.slot()] - 1U;
        edge.b = node_[loop.b.slot()] - 1U;
        edge.a_from_b = loop.a_from_b;
        edge.info_translation = 1.0 / (kLoop_m * kLoop_m);
        edge.info_rotation = 1.0 / (kLoop_rad * kLoop_rad);
        static_cast<void>(graph_.add_edge(edge));
    }
    const std::uint32_t strong = std::max(world_->limits.features_max / 10, kSharedMin);
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
        if (node_[slot] == 0) continue;
        std::uint32_t best[kStrong] = {};
        const std::uint32_t count = world_->map.best_covisible(slot, best, strong);
        units += 8 + slots / 16;
        const Keyframe& keyframe = keyframes.at(slot);
        for (std::uint32_t i = 0; i < count; ++i) {
            const Keyframe& other = keyframes.at(best[i]);
            if (other.frame >= keyframe.frame) continue;
            if (keyframe.parent.slot_plus_one == best[i] + 1 || other.parent.slot_plus_one == slot + 1) continue;
            // What tracking matched across the gap before anybody corrected it says nothing about where it lies.
            const bool is_old = has_closed_ && keyframe.frame <= closed_frame_;
            if (!is_old && keyframe.frame - other.frame >= world_->configuration.loop.gap_frames) continue;
            add_edge(best[i], slot, world_->map.shared(slot, best[i]));
        }
    }
    graph_.start(PoseGraphOptions{});
    enter(Stage::kSolve);
    return units;
}

std::uint32_t LoopClosing::commit() noexcept {
    const PoseGraphSummary& summary = graph_.summary();
    statistics_.graph_iterations += summary.iterations;
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const Handle<Keyframe> newest = world_->map.recent_keyframe(0);
    const SE3 before = newest.is_null() ? SE3{} : keyframes.find(newest)->world_from_camera;
    move_keyframes(graph_);
    world_->map_correction.move_points(world_->map, [](std::uint32_t, const MapPoint&, Vector3&) { return false; });
    move_camera();
    const SE3 after = newest.is_null() ? SE3{} : keyframes.find(newest)->world_from_camera;
    statistics_.last_correction_m = length(after.translation - before.translation);
    statistics_.largest_correction_m = std::max(statistics_.largest_correction_m, statistics_.last_correction_m);
    ++statistics_.closed;
    const Keyframe* const here = keyframes.find(keyframe_);
    const Keyframe* const there = keyframes.find(found_);
    ++world_->loops_closed;
    world_->last_loop = {};
    if (here != nullptr && there != nullptr) {
        world_->last_loop = {there->frame, here->frame, after * before.inverse()};
    }
    if (here != nullptr) {
        closed_frame_ = here->frame;
        has_closed_ = true;
    }
    if (world_->configuration.loop.is_adjusting && !point_index_.empty()) adjusting_ = Adjusting::kWanted;
    enter(Stage::kFuseMatches);
    return world_->limits.map_points_max / 16 + 8 * world_->limits.keyframes_max;
}

// Keyframes of the graph go where it says, all others with them.
template <typename Solved>
void LoopClosing::move_keyframes(const Solved& solved) noexcept {
    Map& map = world_->map;
    world_->map_correction.begin();
    for (std::uint32_t slot = 0; slot < moved_.size(); ++slot) {
        const Keyframe* const keyframe = map.keyframes().find(moved_[slot].handle);
        if (node_[slot] == 0 || keyframe == nullptr) continue;
        const SE3 correction = correction_between(solved.pose(node_[slot] - 1U), moved_[slot].before);
        SE3 now = correction * keyframe->world_from_camera;
        renormalise(now.rotation);
        world_->map_correction.correct(map, moved_[slot].handle, now, correction);
        for (int i = 0; i < 3; ++i) map.note_change(now.translation(i));
    }
    world_->map_correction.follow(map, 0);
}

// Where the global adjustment put a point.
bool LoopClosing::adjusted_place(std::uint32_t slot, const MapPoint& point, Vector3& world) const noexcept {
    if (point_index_[slot] == 0) return false;
    const std::uint32_t index = point_index_[slot] - 1;
    // What tracking has followed since knows better where it is beside its keyframe.
    if (!(adjusted_[index] == world_->map.points().handle_of(slot)) || point.is_suspect ||
        !global_.is_point_used(index) || point.last_seen_frame > adjusting_since_) {
        return false;
    }
    world = global_.point(index);
    return true;
}

void LoopClosing::move_camera() noexcept {
    const SE3* const of_camera = world_->map_correction.of_newest(world_->map);
    world_->move_everything(of_camera != nullptr ? *of_camera : SE3{});
}

// --- global adjustment -----------------------------------------------------------------------------------------------

void LoopClosing::adjust(WorkBudget& budget) noexcept {
    switch (adjusting_) {
        case Adjusting::kNone: break;
        case Adjusting::kWanted: budget.spend(begin_adjustment()); break;
        case Adjusting::kPoints: budget.spend(collect_points()); break;
        case Adjusting::kReserve: budget.spend(collect_observations(true)); break;
        case Adjusting::kObservations: budget.spend(collect_observations(false)); break;
        case Adjusting::kRun: {
            // Piece by piece: a keyframe that comes goes first.
            WorkBudget piece(std::min(budget.units_left(), 256U));
            if (global_.step(piece) != Progress::kWorking) adjusting_ = Adjusting::kCommit;
            budget.spend(static_cast<std::uint32_t>(piece.units_spent()));
            break;
        }
        case Adjusting::kCommit: budget.spend(commit_adjustment()); break;
    }
}

void LoopClosing::drop_adjustment() noexcept {
    if (adjusting_ != Adjusting::kNone && adjusting_ != Adjusting::kWanted) ++statistics_.adjustments_dropped;
    global_.begin();
    adjusting_ = Adjusting::kNone;
}

std::uint32_t LoopClosing::begin_adjustment() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    global_.begin();
    std::fill(moved_.begin(), moved_.end(), Moved{});
    std::fill(node_.begin(), node_.end(), std::uint16_t{0});
    std::fill(point_index_.begin(), point_index_.end(), 0U);
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot)) continue;
        const Keyframe& keyframe = keyframes.at(slot);
        const auto added = global_.add_keyframe(keyframe.world_from_camera, keyframe.parent.is_null());
        STILLMESH_CHECK(added.is_ok());
        node_[slot] = static_cast<std::uint16_t>(added.value() + 1);
        moved_[slot].handle = keyframes.handle_of(slot);
        moved_[slot].before = keyframe.world_from_camera;
    }
    adjusting_since_ = world_->clock.frame;
    adjusting_cursor_ = 0;
    adjusting_ = Adjusting::kPoints;
    ++statistics_.adjustments;
    return world_->limits.keyframes_max + world_->limits.map_points_max / 64;
}

std::uint32_t LoopClosing::collect_points() noexcept {
    const Pool<MapPoint>& points = world_->map.points();
    for (std::uint32_t n = 0; n < 512 && adjusting_cursor_ < points.slots_count(); ++n, ++adjusting_cursor_) {
        const std::uint32_t slot = adjusting_cursor_;
        if (!points.is_taken(slot) || points.at(slot).observers < 2) continue;
        if (!is_static(&points.at(slot), world_->configuration.weights.eligible)) continue;
        const auto added = global_.add_point(vector_of(points.at(slot).world));
        STILLMESH_CHECK(added.is_ok());
        point_index_[slot] = added.value() + 1;
        adjusted_[added.value()] = points.handle_of(slot);
    }
    if (adjusting_cursor_ == points.slots_count()) {
        adjusting_cursor_ = 0;
        adjusting_ = Adjusting::kReserve;
    }
    return 128;
}

// One keyframe a piece, twice: first how many observations each point has, then the observations.
std::uint32_t LoopClosing::collect_observations(bool is_reserving) noexcept {
    const std::uint32_t slots = world_->map.keyframes().slots_count();
    while (adjusting_cursor_ < slots && (node_[adjusting_cursor_] == 0 ||
                                         world_->map.keyframes().find(moved_[adjusting_cursor_].handle) == nullptr)) {
        ++adjusting_cursor_;
    }
    if (adjusting_cursor_ == slots) {
        adjusting_cursor_ = 0;
        if (is_reserving) {
            global_.fill();
            adjusting_ = Adjusting::kObservations;
        } else {
            global_.start(GlobalOptions{});
            adjusting_ = Adjusting::kRun;
        }
        return 1 + slots / 32;
    }
    const std::uint32_t keyframe_slot = adjusting_cursor_++;
    const Handle<Keyframe> handle = moved_[keyframe_slot].handle;
    if (is_reserving) static_cast<void>(world_->map.carry_observations(handle, world_->camera.height));
    for (const Observation& o : world_->map.observations(handle)) {
        const MapPoint* const point = world_->map.points().find(o.point);
        if (point == nullptr || point_index_[o.point.slot()] == 0) continue;
        const std::uint32_t index = point_index_[o.point.slot()] - 1;
        if (!(adjusted_[index] == o.point)) continue;
        if (is_reserving) {
            static_cast<void>(global_.reserve(index));  // full: the rest has no say
            continue;
        }
        GlobalObservation in;
        in.keyframe = node_[keyframe_slot] - 1U;
        in.point = index;
        in.x = static_cast<double>(o.normalised_x);
        in.y = static_cast<double>(o.normalised_y);
        in.var_pixel = world_->pixel_noise.var(o.level) * world_->noise.pixel / o.looks;
        if (o.var_z >= 0) {
            in.z_m = static_cast<double>(o.z_m);
            in.var_z = static_cast<double>(o.var_z) * world_->noise.depth / o.looks;
        }
        static_cast<void>(global_.add_observation(in));  // more than were reserved: linked meanwhile
    }
    return 1 + world_->limits.features_max / 4;
}

std::uint32_t LoopClosing::commit_adjustment() noexcept {
    const GlobalSummary& summary = global_.summary();
    statistics_.adjustment_iterations += summary.iterations;
    if (summary.steps_accepted > 0) {
        move_keyframes(global_);
        world_->map_correction.move_points(world_->map,
                                           [this](std::uint32_t slot, const MapPoint& point, Vector3& world) {
                                               return adjusted_place(slot, point, world);
                                           });
        move_camera();
    }
    global_.begin();
    adjusting_ = Adjusting::kNone;
    return world_->limits.map_points_max / 16 + 8 * world_->limits.keyframes_max;
}

// --- fusion ----------------------------------------------------------------------------------------------------------

// Each feature that verification matched to a point of the place: its own point becomes that one.
std::uint32_t LoopClosing::fuse_matches() noexcept {
    constexpr std::uint32_t kObserversMax = 48;
    if (world_->map.keyframes().find(keyframe_) == nullptr || world_->map.keyframes().find(found_) == nullptr) {
        finish();
        return 1;
    }
    std::uint32_t units = 1;
    for (std::uint32_t n = 0; n < 8 && cursor_ < matches_.size(); ++n, ++cursor_) {
        const PlaceMatch& match = matches_[cursor_];
        const MapPoint* const there = world_->map.points().find(match.point);
        if (!is_static(there, world_->configuration.weights.eligible)) continue;
        const Handle<MapPoint> own = world_->map.observations(keyframe_)[match.feature].point;
        const MapPoint* const mine = world_->map.points().find(own);
        if (mine == nullptr) {
            if (world_->map.link(keyframe_, match.feature, match.point)) ++statistics_.observations_found;
            continue;
        }
        if (own == match.point || mine->is_suspect || mine->observers > kObserversMax) continue;
        units += 4 + world_->map.fuse(match.point, own) / 64;
        ++statistics_.points_fused;
    }
    if (cursor_ >= matches_.size()) {
        find_fuse_sides();
        enter(Stage::kFuseNeighbours);
    }
    return units;
}

void LoopClosing::find_fuse_sides() noexcept {
    const std::uint64_t frame = world_->map.keyframes().find(keyframe_)->frame;
    const std::uint64_t gap = world_->configuration.loop.gap_frames;
    std::uint32_t best[32] = {};
    sources_count_ = targets_count_ = 0;
    sources_[sources_count_++] = found_;
    targets_[targets_count_++] = keyframe_;
    // After the matches were fused both sides see each other: time tells them apart.
    std::uint32_t count = world_->map.best_covisible(found_.slot(), best, kSharedMin);
    for (std::uint32_t i = 0; i < count && sources_count_ < kFuseSources; ++i) {
        if (world_->map.keyframes().at(best[i]).frame + gap > frame) continue;
        sources_[sources_count_++] = world_->map.keyframes().handle_of(best[i]);
    }
    count = world_->map.best_covisible(keyframe_.slot(), best, kSharedMin);
    for (std::uint32_t i = 0; i < count && targets_count_ < kFuseTargets; ++i) {
        if (world_->map.keyframes().at(best[i]).frame + gap < frame) continue;
        targets_[targets_count_++] = world_->map.keyframes().handle_of(best[i]);
    }
}

std::uint32_t LoopClosing::fuse_neighbours() noexcept {
    std::uint32_t units = 1;
    for (std::uint32_t n = 0; n < kFusePiece && target_ < targets_count_;) {
        if (source_ >= sources_count_) {
            source_ = cursor_ = 0;
            ++target_;
            continue;
        }
        const std::span<const Observation> seen = world_->map.observations(sources_[source_]);
        if (cursor_ >= seen.size()) {
            cursor_ = 0;
            ++source_;
            continue;
        }
        ++n;
        units += fusion_->fuse_into(seen[cursor_++].point, targets_[target_], world_->noise.depth);
    }
    if (target_ >= targets_count_) finish();
    return units;
}

void LoopClosing::fill(EngineStatistics& statistics) const noexcept {
    statistics.loop = statistics_;
}

}  // namespace stillmesh
