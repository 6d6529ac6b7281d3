// The halves of paging without a camera: keyframes put into the map by hand, and a store that a test can look into.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/base/hash.hpp"
#include "engine/paging/map_pager.hpp"
#include "engine/paging/map_store.hpp"
#include "engine/paging/paging_state.hpp"
#include "engine/paging/region.hpp"
#include "engine/paging/region_keeper.hpp"
#include "engine/paging/region_return.hpp"
#include "tests/recognition/places.hpp"
#include "tests/support/map_fault.hpp"
#include "tests/support/map_hash.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::paging_parts_test {
namespace {

constexpr std::uint32_t kFeatures = 40;

Limits limits_of_test() {
    Limits limits = Limits::tiny();
    limits.keyframes_max = 20;
    limits.map_points_max = 1000;
    limits.features_max = 100;
    limits.store_features_max = 100;
    return limits;
}

Parameters configuration_of_test() {
    Parameters out;
    out.loop.inliers_min = 40;
    out.store.gap_frames = 10;
    out.store.pause_frames = 5;
    return out;
}

// Keeps what it is given and answers every question with the region it was told to.
class OneRegion final : public MapStore {
public:
    struct Kept {
        std::uint64_t id = 0;
        std::vector<std::byte> body;
        std::uint32_t alike_score = 0;
        std::vector<float> placed;  // where its camera was, and looked
    };
    std::vector<Kept> kept;
    std::vector<StoreQuestion> questions;
    std::vector<std::vector<std::uint64_t>> without;
    std::vector<std::uint64_t> used;
    std::size_t answer = 0;
    bool is_full = false, is_mute = false, is_busy = false;
    Status says = Status::kOk;  // of an answer

    [[nodiscard]] Status keep(const LeavingRegion& region) noexcept override {
        if (is_full) return Status::kFull;
        kept.push_back({region.id, {region.body.begin(), region.body.end()}, region.alike_score, {}});
        for (const float metres : region.position_m) kept.back().placed.push_back(metres);
        for (const float direction : region.axis) kept.back().placed.push_back(direction);
        return Status::kOk;
    }
    [[nodiscard]] Status ask(const StoreQuestion& question) noexcept override {
        if (is_busy) return Status::kFull;
        questions.push_back(question);
        without.emplace_back(question.without.begin(), question.without.end());
        return Status::kOk;
    }
    [[nodiscard]] Status poll(StoreAnswer& out, std::span<std::byte> body) noexcept override {
        if (is_mute) return Status::kTimedOut;
        out.question = questions.back().number;
        if (says != Status::kOk) return says;
        out.id = kept[answer].id;
        out.size_bytes = kept[answer].body.size();
        std::memcpy(body.data(), kept[answer].body.data(), out.size_bytes);
        return Status::kOk;
    }
    void note_use(std::uint64_t id) noexcept override { used.push_back(id); }
};

class Rig {
public:
    Rig() : places(limits_of_test(), configuration_of_test()), memory_(planned_bytes()) {
        Arena arena(memory_.span());
        state.create(arena, places.world, places.places, &store);
        keeper.create(arena, state);
        returns.create(arena, state);
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
        state.reset();
        keeper.reset();
        returns.reset();
    }
    // At x, with points of its own.
    Handle<Keyframe> add_keyframe(std::uint64_t frame, double x_m, std::uint32_t features = kFeatures) {
        const Handle<Keyframe> handle = places.map().add_keyframe();
        Keyframe& keyframe = places.at(handle);
        keyframe.frame = frame;
        keyframe.world_from_camera.translation.x() = x_m;
        for (std::uint32_t i = 0; i < features; ++i) {
            const Observation seen = places.seen_at(10 + 2 * i, 20 + (7 * i) % 80, 1.5 + 0.01 * i);
            add_feature(handle, seen, places.add_point(keyframe.world_from_camera, seen, some_descriptor()));
        }
        places.map().attach(handle);
        return handle;
    }
    void add_feature(Handle<Keyframe> handle, Observation seen, Handle<MapPoint> point) {
        seen.point = point;
        places.map().add_observation(handle, seen, places.map().points().find(point)->descriptor);
    }
    [[nodiscard]] World& world() { return places.world; }
    [[nodiscard]] Map& map() { return places.map(); }
    // A question goes out and a region comes back in.
    void take_back() {
        EXPECT_GT(returns.query(), 0U);
        EXPECT_GT(returns.receive(), 0U);
        while (returns.stage() != RegionReturn::Stage::kIdle) {
            const std::uint32_t units = returns.piece();
            EXPECT_GT(units, 0U);
            EXPECT_LE(units, returns.piece_units_max());
        }
        EXPECT_EQ(test::find_fault(map()), nullptr) << test::find_fault(map());
    }
    [[nodiscard]] Handle<Keyframe> of_frame(std::uint64_t frame) {
        for (std::uint32_t i = 0; i < map().keyframes().size(); ++i) {
            if (places.at(map().recent_keyframe(i)).frame == frame) return map().recent_keyframe(i);
        }
        return {};
    }

    OneRegion store;
    test::Places places;
    PagingState state;
    RegionKeeper keeper;
    RegionReturn returns;

private:
    static std::size_t planned_bytes() {
        ArenaPlan plan;
        PagingState::plan(plan, limits_of_test());
        RegionKeeper::plan(plan, limits_of_test());
        RegionReturn::plan(plan, limits_of_test());
        return plan.used_bytes();
    }
    [[nodiscard]] Descriptor some_descriptor() { return test::random_descriptor(random_); }
    test::Memory memory_;
    Random random_{9};
};

// Promise: what left the map follows each loop that was closed since by the share of the loop's way that lay before it:
// nothing before the way, all behind it, half in the middle; a loop before it left does not move it; loops add up.
TEST(PagingState, WhatIsOutsideFollowsTheLoops) {
    Rig rig;
    SE3 aside;
    aside.translation.y() = 2;
    const auto close_loop = [&](std::uint64_t at_frame, std::uint64_t from, std::uint64_t to) {
        rig.world().clock.frame = at_frame;
        ++rig.world().loops_closed;
        rig.world().last_loop = {from, to, aside};
        rig.state.note_correction();
        rig.state.note_correction();  // once
    };
    rig.world().clock.frame = 250;
    const std::uint64_t before = rig.state.moment();
    close_loop(300, 100, 200);
    const std::uint64_t between = rig.state.moment();
    EXPECT_GT(between, before);
    const auto moved_m = [&](std::uint64_t left_at, std::uint64_t frame) {
        return rig.state.correction_since(left_at, frame).translation.y();
    };
    for (const auto& [frame, expected_m] :
         {std::pair{50U, 0.0}, {100U, 0.0}, {150U, 1.0}, {175U, 1.5}, {200U, 2.0}, {290U, 2.0}}) {
        EXPECT_NEAR(moved_m(before, frame), expected_m, 1e-12) << frame;
        EXPECT_EQ(moved_m(between, frame), 0) << frame;
    }
    close_loop(400, 0, 300);
    EXPECT_NEAR(moved_m(before, 150), 1.0 + 1.0, 1e-12);
    EXPECT_NEAR(moved_m(between, 150), 1.0, 1e-12);
    EXPECT_EQ(rig.state.world->statistics.store.corrections, 2U);
    for (std::uint64_t i = 0; i < PagingState::kCorrectionsMax; ++i) close_loop(500 + i, 450, 460);
    EXPECT_EQ(moved_m(before, 300), 0) << "only so many are remembered";
    rig.state.reset();
    EXPECT_EQ(moved_m(before, 500), 0);
}

// Promise: a keyframe is kept once, the oldest first; not what sees the same as one that was kept, nor what has few
// points; once more when the map has moved it.
TEST(RegionKeeper, KeepsEachPlaceOnce) {
    Rig rig;
    rig.world().clock.frame = 100;
    static_cast<void>(rig.add_keyframe(30, 3));
    static_cast<void>(rig.add_keyframe(10, 1));
    static_cast<void>(rig.add_keyframe(20, 1.01));  // as 10
    static_cast<void>(rig.add_keyframe(40, 5, 10));
    for (int i = 0; i < 4; ++i) {
        const std::uint32_t units = rig.keeper.keep_next(true);
        EXPECT_GT(units, 0U);
        EXPECT_LE(units, rig.keeper.keep_units_max() + limits_of_test().keyframes_max);
    }
    EXPECT_EQ(rig.keeper.keep_next(true), 0U) << "nothing waits";
    ASSERT_EQ(rig.store.kept.size(), 2U);
    EXPECT_EQ(rig.store.kept[0].id, 10U);
    EXPECT_EQ(rig.store.kept[1].id, 30U);
    EXPECT_EQ(rig.state.world->statistics.store.kept, 2U);
    EXPECT_EQ(rig.state.world->statistics.store.known, 1U);
    EXPECT_EQ(rig.state.world->statistics.store.poor, 1U);
    rig.places.at(rig.of_frame(30)).world_from_camera.translation.x() += 1;
    EXPECT_GT(rig.keeper.keep_next(true), 0U);
    EXPECT_EQ(rig.keeper.keep_next(true), 0U);
    ASSERT_EQ(rig.store.kept.size(), 3U);
    EXPECT_EQ(rig.store.kept[2].id, 30U);
}

// Promise: while the map lives, what is in view, the newest keyframe, and what has no words yet wait.
TEST(RegionKeeper, WaitsUntilAKeyframeIsOutOfView) {
    Rig rig;
    rig.world().clock.frame = 100;
    const Handle<Keyframe> first = rig.add_keyframe(10, 1);
    static_cast<void>(rig.add_keyframe(90, 50));
    EXPECT_EQ(rig.keeper.keep_next(false), 0U) << "no words";
    rig.places.look_up(first);
    rig.world().local_map.build(rig.map(), rig.places.at(first).world_from_camera);
    EXPECT_EQ(rig.keeper.keep_next(false), 0U) << "in view";
    SE3 far;
    far.translation.x() = 50;
    rig.world().local_map.build(rig.map(), far);
    EXPECT_GT(rig.keeper.keep_next(false), 0U);
    ASSERT_EQ(rig.store.kept.size(), 1U);
    EXPECT_EQ(rig.store.kept[0].id, 10U);
    EXPECT_EQ(rig.keeper.keep_next(false), 0U) << "the newest";
}

// Promise: after each frame a few keyframes are kept and no more, the oldest first, however the work is cut.
TEST(MapPager, KeepsAFewARound) {
    for (const std::uint32_t slice : {1U, UINT32_MAX}) {
        Rig rig;
        rig.store.is_mute = true;
        ArenaPlan plan;
        MapPager::plan(plan, limits_of_test());
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        MapPager pager;
        pager.create(arena, rig.world(), rig.places.places, &rig.store);
        for (std::uint32_t i = 0; i < 11; ++i) rig.places.look_up(rig.add_keyframe(10 + i, 20.0 * i));
        for (std::uint32_t round = 1; round <= 4; ++round) {
            rig.world().clock.frame = 100 + round;
            for (int again = 0; again < 100; ++again) {
                WorkBudget budget(slice);
                static_cast<void>(pager.step(budget));
            }
            ASSERT_EQ(rig.store.kept.size(), std::min(MapPager::kKeptPerRound * round, 10U)) << "the newest waits";
        }
        for (std::uint32_t i = 0; i < 10; ++i) EXPECT_EQ(rig.store.kept[i].id, 10U + i);
    }
}

// Promise: a store without room is asked again after the next frame, or when it is told to, not before.
TEST(RegionKeeper, TriesAgainWhatWasRefused) {
    Rig rig;
    rig.world().clock.frame = 100;
    static_cast<void>(rig.add_keyframe(10, 1));
    rig.store.is_full = true;
    EXPECT_GT(rig.keeper.keep_next(true), 0U);
    EXPECT_TRUE(rig.keeper.was_refused());
    EXPECT_EQ(rig.keeper.keep_next(true), 0U);
    rig.store.is_full = false;
    EXPECT_EQ(rig.keeper.keep_next(true), 0U) << "in this frame";
    ++rig.world().clock.frame;
    EXPECT_GT(rig.keeper.keep_next(true), 0U);
    EXPECT_EQ(rig.store.kept.size(), 1U);
    EXPECT_EQ(rig.state.world->statistics.store.refused, 1U);
}

// A map of a keyframe that was kept and has left, and of two later ones that share points with each other.
struct Left : Rig {
    explicit Left(std::int64_t points_ns = 0) {
        world().clock.frame = 100;
        const Handle<Keyframe> gone = add_keyframe(10, 1);
        for (const Observation& o : map().observations(gone)) {
            MapPoint& point = *map().points().find(o.point);
            point.created_ns = point.anchor_ns = points_ns;
        }
        before =
            map().observations(gone).empty() ? MapPoint{} : *map().points().find(map().observations(gone)[0].point);
        EXPECT_GT(keeper.keep_next(true), 0U);
        const Handle<Keyframe> last = add_keyframe(80, 20);
        const Handle<Keyframe> newest = add_keyframe(90, 20.5, 0);
        for (const Observation& o : map().observations(last)) add_feature(newest, o, o.point);
        map().release_keyframe(gone);
        places.look_up(last);
        places.look_up(newest);
        EXPECT_TRUE(of_frame(10).is_null());
    }
    // The point that looks like `before`.
    [[nodiscard]] const MapPoint& same_point(Handle<Keyframe> keyframe) {
        for (const Observation& o : map().observations(keyframe)) {
            const MapPoint& point = *map().points().find(o.point);
            if (point.descriptor == before.descriptor) return point;
        }
        ADD_FAILURE() << "it did not come back";
        return before;
    }
    MapPoint before;  // the first of its points
};

// Promise: a region comes back where it lay, with its points and its words, and is kept already; it rests afterwards.
TEST(RegionReturn, APlaceComesBackWhereItLay) {
    Left rig;
    const std::size_t points = rig.map().points().size();
    rig.take_back();
    const Handle<Keyframe> back = rig.of_frame(10);
    ASSERT_FALSE(back.is_null());
    EXPECT_EQ(rig.places.at(back).world_from_camera.translation, Vector3(1, 0, 0));
    EXPECT_EQ(rig.map().points().size(), points + kFeatures);
    EXPECT_EQ(rig.state.world->statistics.store.points_made, kFeatures);
    const MapPoint& point = rig.same_point(back);
    EXPECT_LT((vector_of(point.world) - vector_of(rig.before.world)).norm(), 1e-9);
    EXPECT_EQ(point.seen, rig.before.seen);
    EXPECT_TRUE(rig.places.places.has(back));
    ASSERT_EQ(rig.store.questions.size(), 1U);
    EXPECT_EQ(rig.store.questions[0].older_than, 80U) << "ten frames before the newest";
    EXPECT_EQ(rig.store.without[0].size(), 2U) << "what is in the map";
    EXPECT_FALSE(rig.returns.may_query()) << "it pauses";
    rig.world().clock.frame += configuration_of_test().store.pause_frames;
    EXPECT_TRUE(rig.returns.may_query());
    // Tracking sees it: the store hears of it once.
    rig.keeper.note_useful();
    EXPECT_TRUE(rig.store.used.empty());
    rig.places.at(back).last_useful_frame = rig.world().clock.frame + 1;
    rig.keeper.note_useful();
    rig.keeper.note_useful();
    EXPECT_EQ(rig.store.used, std::vector<std::uint64_t>{10});
}

// Promise: no point comes back from the future: points may be younger than the keyframe they are kept with, and a run
// that begins in a store begins where its keyframes end. (A map with such points was written and then refused as
// damaged.)
TEST(RegionReturn, NoPointIsOfTheFuture) {
    Left rig(5'000'000'000);
    rig.world().clock.time_ns = 3'000'000'000;
    rig.take_back();
    const Handle<Keyframe> back = rig.of_frame(10);
    ASSERT_FALSE(back.is_null());
    ASSERT_EQ(rig.map().observations(back).size(), kFeatures);
    for (const Observation& o : rig.map().observations(back)) {
        const MapPoint& point = *rig.map().points().find(o.point);
        EXPECT_EQ(point.created_ns, rig.world().clock.time_ns);
        EXPECT_EQ(point.anchor_ns, rig.world().clock.time_ns);
    }
}

// Promise: after a loop it lies where the loop says, its points beside it, and what the readout does to them turns; it
// is kept once more.
TEST(RegionReturn, ALoopMovesWhatWasOutside) {
    Left rig;
    const SE3 moved = se3_exp((Vector6() << 0.5, 1, 0, 0, 0.7, 0).finished());
    ++rig.world().loops_closed;
    rig.world().clock.frame = 120;
    rig.world().last_loop = {0, 5, moved};
    rig.state.note_correction();
    rig.take_back();
    const Handle<Keyframe> back = rig.of_frame(10);
    ASSERT_FALSE(back.is_null());
    EXPECT_LT((rig.places.at(back).world_from_camera.translation - moved * Vector3(1, 0, 0)).norm(), 1e-12);
    const MapPoint& point = rig.same_point(back);
    EXPECT_LT((vector_of(point.world) - moved * vector_of(rig.before.world)).norm(), 1e-9);
    EXPECT_LT((vector_of(point.anchor) - moved * vector_of(rig.before.anchor)).norm(), 1e-9);
    const std::size_t kept = rig.store.kept.size();
    while (rig.keeper.keep_next(true) > 0) {
    }
    EXPECT_EQ(std::count_if(rig.store.kept.begin() + static_cast<std::ptrdiff_t>(kept), rig.store.kept.end(),
                            [](const OneRegion::Kept& one) { return one.id == 10; }),
              1);
}

// Promise: what is still in the map is not made twice, unless it lies somewhere else; a region that is in the map, is
// damaged, or finds no room leaves the map as it was and rests.
TEST(RegionReturn, NothingIsMadeTwice) {
    Rig rig;
    rig.world().clock.frame = 100;
    const Handle<Keyframe> gone = rig.add_keyframe(10, 1);
    EXPECT_GT(rig.keeper.keep_next(true), 0U);
    const Handle<Keyframe> newest = rig.add_keyframe(90, 20, 0);
    std::uint32_t shared = 0;
    for (const Observation& o : rig.map().observations(gone)) {
        if (shared++ < 30) rig.add_feature(newest, o, o.point);
    }
    rig.places.look_up(gone);
    rig.places.look_up(newest);
    rig.take_back();
    EXPECT_EQ(rig.state.world->statistics.store.damaged, 1U) << "it is there";
    rig.world().clock.frame += 60;
    rig.map().release_keyframe(gone);
    const Handle<MapPoint> elsewhere = rig.map().observations(newest)[3].point;
    rig.map().points().find(elsewhere)->world[1] += 2;
    const Handle<Keyframe> asking = rig.add_keyframe(150, 20.5, 0);
    for (const Observation& o : rig.map().observations(newest)) rig.add_feature(asking, o, o.point);
    rig.places.look_up(asking);
    rig.take_back();
    EXPECT_EQ(rig.state.world->statistics.store.points_known, 29U);
    EXPECT_EQ(rig.state.world->statistics.store.points_made, kFeatures - 29);
    ASSERT_FALSE(rig.of_frame(10).is_null());
    EXPECT_TRUE(rig.map().is_observed_by(rig.map().observations(newest)[0].point.slot(), rig.of_frame(10).slot()));
}

// Promise: a question asks for score_share of what the newest keyframe's neighbours score.
TEST(RegionReturn, HowMuchAlikeIsAskedFor) {
    std::uint32_t asked[2] = {};
    for (int i = 0; i < 2; ++i) {
        Left rig;
        rig.world().parameters.store.score_share = i == 0 ? 0.25 : 0.5;
        EXPECT_GT(rig.returns.query(), 0U);
        asked[i] = rig.store.questions.back().score_min;
    }
    EXPECT_GT(asked[0], 1U);
    EXPECT_NEAR(asked[1], 2 * asked[0], 1);
}

// Promise: a lost camera's question asks for lost_score_min of a whole bag's score, however old the region.
TEST(RegionReturn, HowMuchAlikeALostCameraAsksFor) {
    Left rig;
    rig.world().parameters.store.lost_score_min = 0.25;
    rig.world().pose.state = PoseState::kNone;
    rig.places.places.take(PlaceSearch::User::kRelocalisation);
    rig.places.places.find_words(rig.map(), rig.of_frame(90), rig.world().parameters, rig.places.places.words());
    EXPECT_GT(rig.returns.query(), 0U);
    EXPECT_EQ(rig.store.questions.back().score_min, kBagWeightOne / 4);
    EXPECT_EQ(rig.store.questions.back().older_than, ~std::uint64_t{0});
    rig.store.says = Status::kNotFound;
    EXPECT_GT(rig.returns.receive(), 0U);
    EXPECT_EQ(rig.returns.query(), 0U) << "once a frame";
    EXPECT_EQ(rig.store.questions.size(), 1U);
}

// Promise: an answer that does not come is given up after a while, and a spoilt one is counted; both leave nothing.
TEST(RegionReturn, TheStoreMayFail) {
    Left mute;
    mute.store.is_mute = true;
    EXPECT_GT(mute.returns.query(), 0U);
    EXPECT_EQ(mute.returns.receive(), 0U);
    EXPECT_FALSE(mute.returns.may_query());
    mute.world().clock.frame += configuration_of_test().store.gap_frames + 1;
    EXPECT_EQ(mute.returns.receive(), 0U);
    EXPECT_EQ(mute.state.world->statistics.store.late, 1U);
    EXPECT_TRUE(mute.returns.may_query());

    Left spoilt;
    spoilt.store.kept[0].body[20] ^= std::byte{1};
    spoilt.store.kept[0].body.pop_back();
    const std::uint64_t before = spoilt.map().changes_hash();
    spoilt.take_back();
    EXPECT_EQ(spoilt.state.world->statistics.store.damaged, 1U);
    EXPECT_EQ(spoilt.map().changes_hash(), before);
    EXPECT_TRUE(spoilt.of_frame(10).is_null());

    for (const Status says : {Status::kCorrupt, Status::kOk}) {
        Left wrong;
        wrong.store.says = says;
        if (says == Status::kOk) wrong.store.kept[0].body.clear();
        wrong.take_back();
        EXPECT_EQ(wrong.state.world->statistics.store.damaged, 1U);
        EXPECT_TRUE(wrong.of_frame(10).is_null());
        EXPECT_TRUE(wrong.returns.may_query()) << "it is not waited for any more";
    }
}

// Promise: a store that takes no question now is not waited for, and nothing is counted as asked; the next keyframe
// asks, and its region comes back.
TEST(RegionReturn, AStoreMayBeBusy) {
    Left left;
    left.store.is_busy = true;
    EXPECT_GT(left.returns.query(), 0U);
    EXPECT_EQ(left.state.world->statistics.store.asked, 0U);
    EXPECT_EQ(left.returns.receive(), 0U);
    EXPECT_TRUE(left.returns.may_query());
    left.store.is_busy = false;
    const Handle<Keyframe> last = left.map().recent_keyframe(0);
    const Handle<Keyframe> next = left.add_keyframe(95, 20.6, 0);
    const std::vector<Observation> seen(left.map().observations(last).begin(), left.map().observations(last).end());
    for (const Observation& o : seen) left.add_feature(next, o, o.point);
    left.places.look_up(next);
    left.take_back();
    EXPECT_EQ(left.state.world->statistics.store.asked, 1U);
    EXPECT_FALSE(left.of_frame(10).is_null());
}

// A life of a few places: kept, left, moved by loops and by what is learnt of the shutter, and back again. What it came
// to goes into the hash.
void live(std::uint64_t seed, StateHash& hash, StoreStatistics& all) {
    Rig rig;
    Random random(seed);
    Map& map = rig.map();
    const auto look = [&] {
        hash.add(test::map_hash(map, rig.world().camera));
        hash.add(map.changes_hash());
        hash.add(rig.state.moment());
    };
    for (std::uint64_t frame = 10; frame < 400; frame += 10) {
        rig.world().clock.frame = frame;
        rig.world().clock.time_ns = static_cast<std::int64_t>(frame) * 33'000'000;
        rig.state.note_correction();
        if (!map.keyframes().is_full()) {
            const double x_m = 0.7 * random.below(30);
            const Handle<Keyframe> made = rig.add_keyframe(frame, x_m, 5 + random.below(50));
            Keyframe& keyframe = rig.places.at(made);
            keyframe.time_ns = rig.world().clock.time_ns;
            keyframe.pose_by_readout(3) = random.uniform(-1, 1);
            for (const Observation& seen : map.observations(made)) {
                MapPoint& point = *map.points().find(seen.point);
                point.is_suspect = random.below(20) == 0;
                if (random.below(20) == 0) point.weight_tenths = 5;
                point.world_by_readout[2] = static_cast<float>(random.uniform(-1, 1));
                point.created_ns = point.anchor_ns = keyframe.time_ns + random.below(100'000'000);
            }
            const Handle<Keyframe> other = map.recent_keyframe(random.below(3));
            for (const Observation& seen : map.observations(other)) {  // seen together
                if (other == made || map.observations(made).size() >= 90 || random.below(2) == 0) continue;
                if (map.points().find(seen.point) != nullptr) rig.add_feature(made, seen, seen.point);
            }
            if (random.below(4) != 0) rig.places.look_up(made);
        }
        if (random.below(3) == 0)
            rig.world().local_map.build(map, rig.places.at(map.recent_keyframe(0)).world_from_camera);
        for (int i = 0; i < 3; ++i) hash.add(rig.keeper.keep_next(random.below(8) == 0));
        if (random.below(5) == 0) map.express_with_readout(random.uniform(0, 0.01));
        if (random.below(9) == 0) {
            rig.world().last_loop = {frame / 2, frame - 5 * random.below(3), test::random_motion(random, 0.3, 0.05)};
            ++rig.world().loops_closed;
        }
        if (map.keyframes().size() > 6 && random.below(2) == 0) {
            map.release_keyframe(map.recent_keyframe(2 + random.below(4)));
        }
        if (rig.store.kept.empty()) continue;
        rig.store.answer = random.below(static_cast<std::uint32_t>(rig.store.kept.size()));
        rig.store.says = random.below(4) == 0 ? Status::kNotFound : Status::kOk;
        rig.store.is_mute = random.below(5) < seed % 4;
        hash.add(rig.returns.query());
        hash.add(rig.returns.receive());
        while (rig.returns.stage() != RegionReturn::Stage::kIdle) hash.add(rig.returns.piece());
        const auto keyframes = static_cast<std::uint32_t>(map.keyframes().size());
        rig.places.at(map.recent_keyframe(random.below(keyframes))).last_useful_frame = frame + 1;
        rig.keeper.note_useful();
        ASSERT_EQ(test::find_fault(map), nullptr) << test::find_fault(map);
        look();
    }
    for (std::size_t i = 0; i < rig.store.questions.size(); ++i) {
        const StoreQuestion& question = rig.store.questions[i];
        for (const std::uint64_t n : {question.number, question.older_than, std::uint64_t{question.score_min}})
            hash.add(n);
        for (const std::uint64_t id : rig.store.without[i]) hash.add(id);
    }
    for (const OneRegion::Kept& kept : rig.store.kept) {
        hash.add(kept.id);
        hash.add(crc32(kept.body));
        hash.add(kept.alike_score);
        for (const float number : kept.placed) hash.add(number);
    }
    for (const std::uint64_t id : rig.store.used) hash.add(id);
    const StoreStatistics& s = rig.state.world->statistics.store;
    all.kept += s.kept, all.known += s.known, all.poor += s.poor, all.asked += s.asked, all.late += s.late;
    all.not_found += s.not_found, all.damaged += s.damaged, all.returned += s.returned, all.useful += s.useful;
    all.points_made += s.points_made, all.points_known += s.points_known, all.corrections += s.corrections;
}

// Promise: what is kept, asked for and put back is the same to the bit on every processor, compiler and optimisation
// level, for the same work.
TEST(Paging, GoldenBits) {
    StateHash hash;
    StoreStatistics all;
    int which = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) ASSERT_NO_FATAL_FAILURE(live(seed, hash, all));
    for (const std::uint64_t count : {all.kept, all.known, all.poor, all.asked, all.late, all.not_found, all.damaged,
                                      all.returned, all.useful, all.points_made, all.points_known, all.corrections}) {
        EXPECT_GT(count, 0U) << which;
        ++which;
        hash.add(count);
    }
    EXPECT_EQ(hash.value(), 0xd334e7ced6a7a20eULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::paging_parts_test
