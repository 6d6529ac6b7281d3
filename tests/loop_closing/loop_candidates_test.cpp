#include "engine/loop_closing/loop_candidates.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "tests/recognition/places.hpp"

namespace stillmesh::loop_candidates_test {
namespace {

constexpr std::uint32_t kFeatures = 60;
constexpr std::uint32_t kConsistency = 2;

Limits limits_of_test() {
    Limits limits = Limits::tiny();
    limits.keyframes_max = 32;
    limits.map_points_max = 2000;
    limits.features_max = kFeatures;
    return limits;
}

Parameters configuration_of_test() {
    Parameters out;
    out.loop.consistency = kConsistency;
    out.loop.gap_frames = 100;
    return out;
}

// Keyframes of a few places, each of which looks like itself from visit to visit. What a visit sees are points of its
// own: keyframes of one visit share them, and no others.
class Visits {
public:
    explicit Visits(const Parameters& configuration = configuration_of_test())
        : rig_(limits_of_test(), configuration), memory_(planned_bytes()) {
        Arena arena(memory_.span());
        candidates_.create(arena, rig_.world, rig_.places, limits_of_test().keyframes_max);
        Random random(5);
        looks_.resize(4);
        for (std::vector<Descriptor>& look : looks_) {
            for (std::uint32_t i = 0; i < kFeatures; ++i) look.push_back(test::random_descriptor(random));
        }
        std::copy_n(looks_[0].begin(), kFeatures * 9 / 10, looks_[kMostlyAlike].begin());
    }
    static constexpr std::size_t kMostlyAlike = 3;  // a place nine of whose ten features are those of place 0

    // Comes to a place.
    void arrive(std::size_t place) {
        place_ = place;
        points_.clear();
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            points_.push_back(rig_.add_point(SE3{}, seen(i), looks_[place_][i]));
        }
    }
    // The same points look otherwise from now on: as another place does.
    void turn_to(std::size_t place) { place_ = place; }
    // A keyframe there; what is worth verifying.
    std::vector<Handle<Keyframe>> see(std::uint64_t frame, bool is_resting = false) {
        return see_and(
            frame, [] {}, is_resting);
    }
    // The same; what happens between the query and the choice.
    template <typename Meanwhile>
    std::vector<Handle<Keyframe>> see_and(std::uint64_t frame, Meanwhile&& meanwhile, bool is_resting = false) {
        const Handle<Keyframe> keyframe = rig_.map().add_keyframe();
        rig_.at(keyframe).frame = frame;
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            Observation o = seen(i);
            o.point = points_[i];
            rig_.map().add_observation(keyframe, o, looks_[place_][i]);
        }
        rig_.map().attach(keyframe);
        rig_.look_up(keyframe);
        meanwhile();
        EXPECT_GT(candidates_.choose(keyframe, is_resting), 0U);
        last_ = keyframe;
        return {candidates_.chosen().begin(), candidates_.chosen().end()};
    }
    [[nodiscard]] std::uint64_t frame_of(Handle<Keyframe> keyframe) { return rig_.at(keyframe).frame; }
    [[nodiscard]] Handle<Keyframe> last() const { return last_; }
    void forget(Handle<Keyframe> keyframe) { rig_.map().release_keyframe(keyframe); }
    void purge() { rig_.places.purge(rig_.map()); }
    // Another keyframe, of which nobody has looked up the words yet.
    Handle<Keyframe> add_unknown() { return rig_.map().add_keyframe(); }
    LoopCandidates& candidates() { return candidates_; }

private:
    static std::size_t planned_bytes() {
        ArenaPlan plan;
        LoopCandidates::plan(plan, limits_of_test().keyframes_max);
        return plan.used_bytes();
    }
    [[nodiscard]] Observation seen(std::uint32_t i) const { return rig_.seen_at(10 + 2 * i, 60, 2); }

    test::Places rig_;
    test::Memory memory_;
    LoopCandidates candidates_;
    std::vector<std::vector<Descriptor>> looks_;
    std::vector<Handle<MapPoint>> points_;
    std::size_t place_ = 0;
    Handle<Keyframe> last_;
};

// Promise: a place is chosen once the k queries before found it too, the one of its keyframes that looks most alike
// alone; a look at another place in between begins the count anew.
TEST(LoopCandidates, KQueriesMustAgree) {
    Visits visits;
    visits.arrive(0);
    std::vector<std::uint64_t> first_visit;
    for (std::uint64_t i = 0; i < 3; ++i) {
        EXPECT_TRUE(visits.see(10 * i).empty());
        first_visit.push_back(10 * i);
    }
    visits.arrive(1);
    for (std::uint64_t i = 0; i < 3; ++i) EXPECT_TRUE(visits.see(300 + 10 * i).empty());
    visits.arrive(0);
    EXPECT_TRUE(visits.see(600).empty()) << "no neighbour says yet what alike means here";
    for (std::uint64_t i = 1; i <= kConsistency; ++i) EXPECT_TRUE(visits.see(600 + 10 * i).empty()) << i;
    const std::vector<Handle<Keyframe>> chosen = visits.see(680);
    ASSERT_EQ(chosen.size(), 1U);
    EXPECT_EQ(std::count(first_visit.begin(), first_visit.end(), visits.frame_of(chosen[0])), 1);
    visits.arrive(2);
    EXPECT_TRUE(visits.see(690).empty());
    EXPECT_TRUE(visits.see(695).empty());
    visits.arrive(0);
    EXPECT_TRUE(visits.see(700).empty());
    for (std::uint64_t i = 1; i <= kConsistency; ++i) EXPECT_TRUE(visits.see(700 + 10 * i).empty()) << i;
    EXPECT_FALSE(visits.see(780).empty());
}

// Promise: keyframes of the same while are no places to come back to.
TEST(LoopCandidates, WhatIsNearInTimeIsNone) {
    Visits visits;
    visits.arrive(0);
    for (std::uint64_t i = 0; i < 3; ++i) EXPECT_TRUE(visits.see(i).empty());
    visits.arrive(0);  // its points were lost: other points, the same look
    for (std::uint64_t i = 0; i < 6; ++i) EXPECT_TRUE(visits.see(50 + i).empty()) << i;
    for (std::uint64_t i = 0; i < kConsistency; ++i) EXPECT_TRUE(visits.see(150 + i).empty()) << i;
    EXPECT_FALSE(visits.see(160).empty());
}

// Promise: near in time is near whichever of both came first: keyframes may be looked up in any order.
TEST(LoopCandidates, WhatComesLaterIsNearToo) {
    Visits visits;
    visits.arrive(0);
    for (std::uint64_t i = 0; i < 3; ++i) EXPECT_TRUE(visits.see(1000 - i).empty());
    visits.arrive(0);
    for (std::uint64_t i = 0; i < 6; ++i) EXPECT_TRUE(visits.see(950 - i).empty()) << i;
    for (std::uint64_t i = 0; i < kConsistency; ++i) EXPECT_TRUE(visits.see(850 - i).empty()) << i;
    EXPECT_FALSE(visits.see(840).empty());
}

// Promise: a query has found a place that scores score_share of what neighbours score, and not one that scores less.
TEST(LoopCandidates, WhatIsLessAlikeIsNotFound) {
    for (const double share : {0.5, 0.95}) {
        Parameters configuration = configuration_of_test();
        configuration.loop.score_share = share;
        Visits visits(configuration);
        visits.arrive(0);
        for (std::uint64_t i = 0; i < 3; ++i) EXPECT_TRUE(visits.see(10 * i).empty());
        visits.arrive(Visits::kMostlyAlike);
        for (std::uint64_t i = 0; i < 6; ++i) EXPECT_TRUE(visits.see(500 + 10 * i).empty()) << "less alike";
        visits.turn_to(0);
        EXPECT_EQ(visits.see(560).size(), share < 0.9 ? 1U : 0U) << "those before may have found it";
    }
}

// Promise: while it rests after a loop none is chosen, but what was found is remembered.
TEST(LoopCandidates, RestsAndRemembers) {
    Visits visits;
    visits.arrive(0);
    for (std::uint64_t i = 0; i < 3; ++i) static_cast<void>(visits.see(10 * i));
    visits.arrive(0);
    for (std::uint64_t i = 0; i < 4; ++i) EXPECT_TRUE(visits.see(500 + 10 * i, true).empty());
    EXPECT_EQ(visits.see(560).size(), 1U);
}

// Promise: a place that has left the map is not chosen, and agrees with none; reset() forgets the queries before.
TEST(LoopCandidates, WhatLeftIsNoPlace) {
    Visits visits;
    visits.arrive(0);
    static_cast<void>(visits.see(0));
    const Handle<Keyframe> old = visits.last();
    visits.arrive(0);
    for (std::uint64_t i = 0; i < 4; ++i) static_cast<void>(visits.see(500 + 10 * i));
    ASSERT_EQ(visits.candidates().chosen().size(), 1U);
    EXPECT_TRUE(visits.candidates().chosen()[0] == old);
    visits.candidates().reset();
    EXPECT_TRUE(visits.candidates().chosen().empty());
    EXPECT_TRUE(visits.see(550).empty());
    EXPECT_TRUE(visits.see(560).empty());
    EXPECT_FALSE(visits.see(570).empty());
    visits.forget(old);
    EXPECT_TRUE(visits.see(580).empty());
}

// Promise: a place that leaves the map after it was found by its words is not chosen, whether the database knows that
// yet or not, nor is a keyframe that has taken its slot since.
TEST(LoopCandidates, APlaceMayLeaveAfterTheQuery) {
    for (const int what : {0, 1, 2, 3}) {
        Visits visits;
        visits.arrive(0);
        static_cast<void>(visits.see(0));
        const Handle<Keyframe> old = visits.last();
        visits.arrive(0);
        for (std::uint64_t i = 0; i < kConsistency + 1; ++i) static_cast<void>(visits.see(500 + 10 * i));
        const std::vector<Handle<Keyframe>> chosen = visits.see_and(560, [&] {
            if (what == 0) return;
            visits.forget(old);
            if (what == 2) visits.purge();
            if (what == 3) {
                std::uint32_t tries = limits_of_test().keyframes_max;
                while (visits.add_unknown().slot() != old.slot()) ASSERT_GT(--tries, 0U);
            }
        });
        EXPECT_EQ(chosen.size(), what == 0 ? 1U : 0U) << what;
    }
}

}  // namespace
}  // namespace stillmesh::loop_candidates_test
