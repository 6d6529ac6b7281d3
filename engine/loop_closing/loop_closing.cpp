#include "engine/loop_closing/loop_closing.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"
#include "engine/recognition/map_drift.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kFusePiece = 32;

// Of a candidate that was refused, in the order of Refusal.
constexpr std::uint64_t LoopStatistics::*kCountOf[] = {nullptr,
                                                       &LoopStatistics::refused_matches,
                                                       &LoopStatistics::refused_pose,
                                                       &LoopStatistics::refused_inliers,
                                                       &LoopStatistics::refused_spread,
                                                       &LoopStatistics::refused_far,
                                                       &LoopStatistics::refused_unlikely,
                                                       &LoopStatistics::refused_gone};
static_assert(std::size(kCountOf) == static_cast<std::size_t>(Refusal::kGone) + 1);

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
    graph_.create(arena, world, World::loop_keyframes_max(limits));
    candidates_.create(arena, world, places, World::loop_keyframes_max(limits));
    matches_.create(arena, PlaceVerifier::pairs_max(limits));
    const std::uint32_t commit = limits.map_points_max / 16 + 8 * limits.keyframes_max + 1;
    const std::uint32_t choose = 64 * limits.keyframes_max;
    const std::uint32_t words = places.is_on() ? places.find_units(limits.features_max) : 1U;
    const std::uint32_t fuse = kFusePiece * (limits.features_max + 8);
    piece_units_max_ = std::max({commit, EssentialGraph::build_units_max(limits), choose, words, fuse,
                                 places.verifier().piece_units_max(), limits.features_max, PoseGraph::kPieceUnitsMax});
    reset();
}

void LoopClosing::reset() noexcept {
    graph_.reset();
    candidates_.reset();
    keyframe_ = found_ = {};
    matches_.clear();
    sources_count_ = targets_count_ = 0;
    stage_ = Stage::kIdle;
    cursor_ = source_ = target_ = 0;
    next_frame_ = 0;
    settled_end_ = 0;
    rest_ = 0;
}

void LoopClosing::enter(Stage stage) noexcept {
    stage_ = stage;
    cursor_ = 0;
    source_ = target_ = 0;
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
    if (age_s < world_->parameters.weights.proven_s && !world_->is_frozen) return false;
    keyframe_ = next;
    places_->take(PlaceSearch::User::kLoopClosing);
    enter(Stage::kWords);
    return true;
}

Progress LoopClosing::step(WorkBudget& budget) noexcept {
    if (!places_->is_on()) return Progress::kIdle;
    while (!budget.is_spent()) {
        if (stage_ == Stage::kIdle && !take()) {
            return budget.units_spent() == 0 ? Progress::kIdle : Progress::kDone;
        }
        if (is_searching()) {  // a relocalisation may have taken the searcher, or the keyframe be gone
            const bool is_overtaken = !places_->is_used_by(PlaceSearch::User::kLoopClosing);
            if (is_overtaken || world_->map.keyframes().find(keyframe_) == nullptr) {
                budget.spend(1);
                ++world_->statistics.loop.dropped;
                finish();
            }
        }
        switch (stage_) {
            case Stage::kIdle: break;  // dropped: on with the next
            case Stage::kWords: budget.spend(find_words()); break;
            case Stage::kQuery:
                if (places_->query().step(places_->database(), budget) != Progress::kWorking) enter(Stage::kChoose);
                break;
            case Stage::kChoose: budget.spend(choose()); break;
            case Stage::kPrepare: budget.spend(prepare()); break;
            case Stage::kVerify:
                if (!places_->has(places_->verifier().candidate()) ||
                    places_->verifier().step(world_->map, places_->vocabulary(),
                                             places_->database().direct_index(places_->verifier().candidate().slot()),
                                             budget) != Progress::kWorking) {
                    budget.spend(accept_or_refuse());
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
    places_->find_words(world_->map, keyframe_, world_->parameters, words);
    places_->purge(world_->map);
    places_->query().begin(places_->database(), words.bag());
    places_->add(keyframe_);
    next_frame_ = world_->map.keyframes().find(keyframe_)->frame + 1;
    const std::uint32_t units = places_->find_units(world_->map.observations(keyframe_).size());
    const bool is_small = World::loop_keyframes_max(world_->limits) == 0;
    if (world_->is_frozen || is_small) {
        finish();
        return units;
    }
    ++world_->statistics.loop.queries;
    enter(Stage::kQuery);
    return units;
}

std::uint32_t LoopClosing::choose() noexcept {
    places_->purge(world_->map);
    const bool is_resting = rest_ > 0;
    if (rest_ > 0) --rest_;
    const std::uint32_t units = candidates_.choose(keyframe_, is_resting);
    if (candidates_.chosen().empty()) {
        finish();
    } else {
        enter(Stage::kPrepare);
    }
    return units;
}

std::uint32_t LoopClosing::prepare() noexcept {
    PlaceVerifier& verifier = places_->verifier();
    const std::span<const Observation> seen = world_->map.observations(keyframe_);
    verifier.begin_query(world_->map.descriptors(keyframe_));
    for (std::size_t i = 0; i < seen.size(); ++i) {
        verifier.add_feature(seen[i],
                             is_static(world_->map.points().find(seen[i].point), world_->parameters.weights.eligible));
    }
    verifier.end_query(places_->database().direct_index(keyframe_.slot()));
    const auto units = static_cast<std::uint32_t>(seen.size() / 4) + 1;
    const NoiseFactors noise{std::max(1.0, world_->noise.pixel), std::max(1.0, world_->noise.depth)};
    verifier.start(world_->map, candidates_.chosen()[cursor_], noise,
                   {world_->parameters.loop.inliers_min / 2, world_->parameters.loop.inliers_min});
    ++world_->statistics.loop.candidates;
    stage_ = Stage::kVerify;  // the cursor stays
    return units;
}

// Geometric consistency, and how far odometry can have led astray.
Refusal LoopClosing::judge(const SE3& world_from_keyframe) const noexcept {
    const LoopParameters& p = world_->parameters.loop;
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

std::uint32_t LoopClosing::accept_or_refuse() noexcept {
    PlaceVerifier& verifier = places_->verifier();
    Refusal refusal = verifier.is_accepted() ? Refusal::kNone : verifier.refusal();
    if (verifier.is_running()) refusal = Refusal::kGone;
    if (refusal == Refusal::kNone) refusal = judge(verifier.world_from_query());
    if (refusal != Refusal::kNone) {
        ++(world_->statistics.loop.*kCountOf[static_cast<std::size_t>(refusal)]);
        if (++cursor_ < candidates_.chosen().size()) {
            stage_ = Stage::kPrepare;
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
    const LoopParameters& p = world_->parameters.loop;
    const bool is_small =
        length(off.translation) < p.correction_min_m && rotation_angle(off.rotation) < p.correction_min_m;
    const bool is_significant = !is_noise(off, verifier.information(), p);
    // The graph takes a loop at its word, to the millimetre: noise is none.
    if (is_small || is_significant) {
        graph_.add_loop(found_, keyframe_, there.world_from_camera.inverse() * verifier.world_from_query());
    }
    rest_ = 2 * p.consistency;
    if (is_small || !is_significant) {
        ++world_->statistics.loop.confirmed;
        settled_end_ = here.frame + 1;
        enter(Stage::kFuseMatches);
    } else {
        enter(Stage::kBuild);
    }
    return 1 + static_cast<std::uint32_t>(matches_.size()) / 8;
}

// --- correction ------------------------------------------------------------------------------------------------------

// If an end of the loop has left since it was found, nothing holds it any more: the graph would move by noise alone.
std::uint32_t LoopClosing::build() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    if (keyframes.find(keyframe_) == nullptr || keyframes.find(found_) == nullptr) {
        ++world_->statistics.loop.dropped;
        finish();
        return 1;
    }
    const std::uint32_t units = graph_.build(settled_end_);
    enter(Stage::kSolve);
    return units;
}

std::uint32_t LoopClosing::commit() noexcept {
    LoopStatistics& statistics = world_->statistics.loop;
    statistics.graph_iterations += graph_.summary().iterations;
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const Handle<Keyframe> newest = world_->map.recent_keyframe(0);
    const SE3 before = newest.is_null() ? SE3{} : keyframes.find(newest)->world_from_camera;
    graph_.move_keyframes();
    world_->map_correction.move_points(world_->map);
    world_->follow_correction();
    const SE3 after = newest.is_null() ? SE3{} : keyframes.find(newest)->world_from_camera;
    statistics.last_correction_m = length(after.translation - before.translation);
    statistics.largest_correction_m = std::max(statistics.largest_correction_m, statistics.last_correction_m);
    ++statistics.closed;
    const Keyframe* const here = keyframes.find(keyframe_);
    const Keyframe* const there = keyframes.find(found_);
    ++world_->loops_closed;
    world_->last_loop = {};
    if (here != nullptr && there != nullptr) {
        world_->last_loop = {there->frame, here->frame, after * before.inverse()};
    }
    if (here != nullptr) settled_end_ = here->frame + 1;
    enter(Stage::kFuseMatches);
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
        if (!is_static(there, world_->parameters.weights.eligible)) continue;
        const Handle<MapPoint> own = world_->map.observations(keyframe_)[match.feature].point;
        const MapPoint* const mine = world_->map.points().find(own);
        if (mine == nullptr) {
            if (world_->map.link(keyframe_, match.feature, match.point)) ++world_->statistics.loop.observations_found;
            continue;
        }
        if (own == match.point || mine->is_suspect || mine->observers > kObserversMax) continue;
        units += 4 + world_->map.fuse(match.point, own) / 64;
        ++world_->statistics.loop.points_fused;
    }
    if (cursor_ >= matches_.size()) {
        find_fuse_sides();
        enter(Stage::kFuseNeighbours);
    }
    return units;
}

void LoopClosing::find_fuse_sides() noexcept {
    const std::uint64_t frame = world_->map.keyframes().find(keyframe_)->frame;
    const std::uint64_t gap = world_->parameters.loop.gap_frames;
    // After the matches were fused both sides see each other: time tells them apart.
    const auto find_side = [&](Handle<Keyframe> middle, std::span<Handle<Keyframe>> side, auto&& is_of_side) {
        std::uint32_t best[32] = {};
        const std::uint32_t shown = world_->map.best_covisible(middle.slot(), best, world_->parameters.map.shared_min);
        std::uint32_t count = 0;
        side[count++] = middle;
        for (std::uint32_t i = 0; i < shown && count < side.size(); ++i) {
            if (is_of_side(world_->map.keyframes().at(best[i]).frame + gap)) {
                side[count++] = world_->map.keyframes().handle_of(best[i]);
            }
        }
        return count;
    };
    sources_count_ = find_side(found_, sources_, [frame](std::uint64_t later) { return later <= frame; });
    targets_count_ = find_side(keyframe_, targets_, [frame](std::uint64_t later) { return later >= frame; });
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
        units += fusion_->fuse_into(seen[cursor_++].point, targets_[target_]);
    }
    if (target_ >= targets_count_) finish();
    return units;
}

}  // namespace stillmesh
