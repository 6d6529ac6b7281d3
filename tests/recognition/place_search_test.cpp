#include "engine/recognition/place_search.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "tests/place/vocabularies.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::place_search_test {
namespace {

class Places : public testing::Test {
protected:
    Places() {
        const char* sentence = nullptr;
        EXPECT_EQ(vocabulary_.open(bytes_, Limits::tiny().vocabulary_words_max, sentence), Status::kOk);
        start(test::small_parameters(), vocabulary_);
    }
    void start(const Parameters& parameters, const Vocabulary& vocabulary) {
        world_ = std::make_unique<test::SmallWorld>(parameters);
        ArenaPlan plan;
        PlaceSearch::plan(plan, Limits::tiny());
        memory_ = std::make_unique<test::Memory>(plan.used_bytes());
        Arena arena(memory_->span());
        places_.create(arena, (*world_)->limits, (*world_)->parameters, test::small_camera(), vocabulary);
        EXPECT_EQ(arena.used_bytes(), plan.used_bytes());
    }
    // A keyframe of so many features, the first of which show these points.
    Handle<Keyframe> add_keyframe(std::uint64_t frame, std::uint32_t features,
                                  const std::vector<Handle<MapPoint>>& points = {}) {
        const Handle<Keyframe> out = world_->add_keyframe(SE3{}, frame);
        for (std::uint32_t i = 0; i < features; ++i) {
            Observation seen;
            if (i < points.size()) seen.point = points[i];
            map().add_observation(out, seen, test::random_descriptor(random_));
        }
        return out;
    }
    std::vector<Handle<MapPoint>> add_points(std::uint32_t count) {
        std::vector<Handle<MapPoint>> out;
        for (std::uint32_t i = 0; i < count; ++i) out.push_back(world_->add_point(Vector3(0, 0, 2)));
        return out;
    }
    void enter(Handle<Keyframe> keyframe) {
        places_.find_words(map(), keyframe, (*world_)->parameters, places_.words());
        places_.add(keyframe);
    }
    [[nodiscard]] Map& map() { return world_->map(); }

    Random random_{7};
    std::vector<std::byte> bytes_ = test::vocabulary_bytes({4, 3, 0, 3});
    Vocabulary vocabulary_;
    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::Memory> memory_;
    PlaceSearch places_;
};

// Promise: places are recognised with a vocabulary, where loops are and mapping is on; otherwise never.
TEST_F(Places, OnWithAVocabularyAndAMap) {
    const Vocabulary none;
    for (const bool has_vocabulary : {true, false}) {
        for (const bool has_loops : {true, false}) {
            for (const bool is_mapping : {true, false}) {
                Parameters parameters = test::small_parameters();
                parameters.loop.is_enabled = has_loops;
                parameters.mapping.is_enabled = is_mapping;
                start(parameters, has_vocabulary ? vocabulary_ : none);
                EXPECT_EQ(places_.is_on(), has_vocabulary && has_loops && is_mapping);
            }
        }
    }
}

// Promise: a keyframe has the words of all its features, and its bag is of those whose points stand still: known, with
// a weight, and a weight of weights.eligible.
TEST_F(Places, WordsOfWhatStandsStill) {
    for (const std::uint32_t eligible : {10U, 16U}) {
        Parameters parameters = test::small_parameters();
        parameters.weights.eligible = eligible;
        start(parameters, vocabulary_);
        const std::vector<Handle<MapPoint>> points = add_points(40);
        for (std::size_t i = 0; i < 10; ++i) (*world_)[points[i]].is_suspect = true;
        for (std::size_t i = 10; i < 20; ++i) (*world_)[points[i]].weight_tenths = 9;
        for (std::size_t i = 20; i < 30; ++i) (*world_)[points[i]].weight_tenths = 16;
        const Handle<Keyframe> keyframe = add_keyframe(1, 60, points);  // 20 features show no point
        map().release_point(points[39]);
        std::vector<std::uint8_t> is_still(60, 0);
        for (std::size_t i = 20; i < 39; ++i) is_still[i] = i < 30 || eligible == 10 ? 1 : 0;
        test::InMemory<FrameWords> expected(std::uint32_t{60}), found(std::uint32_t{60});
        expected->find(vocabulary_, map().descriptors(keyframe));
        expected->weigh(vocabulary_, is_still);
        places_.find_words(map(), keyframe, (*world_)->parameters, *found);
        EXPECT_TRUE(std::equal(found->by_word().begin(), found->by_word().end(), expected->by_word().begin(),
                               expected->by_word().end()));
        EXPECT_EQ(found->by_word().size(), 60U);
        ASSERT_EQ(found->bag().size(), expected->bag().size());
        ASSERT_GT(found->bag().size(), 3U);
        for (std::size_t i = 0; i < found->bag().size(); ++i) {
            EXPECT_EQ(found->bag()[i].word, expected->bag()[i].word);
            EXPECT_EQ(found->bag()[i].weight, expected->bag()[i].weight);
        }
    }
}

// Promise: a keyframe is in until it has left the map and is purged, or another takes its slot; one that is entered
// again counts with its new words. Stale handles are not in.
TEST_F(Places, KeyframesComeAndGo) {
    const std::vector<Handle<MapPoint>> points = add_points(60);
    std::vector<Handle<Keyframe>> keyframes;
    for (std::uint32_t i = 0; i < 8; ++i) {
        keyframes.push_back(add_keyframe(i, 30, {points.begin() + 5 * i, points.begin() + 5 * i + 20}));
        EXPECT_FALSE(places_.has(keyframes[i]));
        enter(keyframes[i]);
        EXPECT_TRUE(places_.has(keyframes[i]));
        EXPECT_EQ(places_.database().size(), i + 1);
    }
    places_.purge(map());
    EXPECT_EQ(places_.database().size(), 8U);
    enter(keyframes[3]);
    EXPECT_EQ(places_.database().size(), 8U);
    map().release_keyframe(keyframes[3]);
    map().release_keyframe(keyframes[5]);
    places_.purge(map());
    EXPECT_EQ(places_.database().size(), 6U);
    for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(places_.has(keyframes[i]), i != 3 && i != 5) << i;
    // Without a purge in between: the new tenant of a slot is not in, and replaces the old one when it is.
    map().release_keyframe(keyframes[0]);
    Handle<Keyframe> tenant;
    while (tenant.is_null() || tenant.slot() != keyframes[0].slot()) tenant = add_keyframe(50, 10);
    EXPECT_FALSE(places_.has(tenant));
    enter(tenant);
    EXPECT_TRUE(places_.has(tenant));
    EXPECT_FALSE(places_.has(keyframes[0]));
    EXPECT_EQ(places_.database().size(), 6U);
    EXPECT_EQ(places_.database().direct_index(tenant.slot()).size(), 10U);
    map().release_keyframe(tenant);
    Handle<Keyframe> next;
    while (next.is_null() || next.slot() != tenant.slot()) next = add_keyframe(next.is_null() ? 60 : 70, 5);
    places_.purge(map());
    EXPECT_FALSE(places_.has(tenant));
    EXPECT_FALSE(places_.has(next));
    EXPECT_EQ(places_.database().size(), 5U);
    for (std::uint32_t word = 0; word < vocabulary_.info().words; ++word) {  // what went left no word behind
        places_.database().visit_keyframes(
            word, [&](std::uint32_t slot, std::uint32_t) { EXPECT_TRUE(places_.database().has(slot)); });
    }
    enter(next);
    places_.reset();
    EXPECT_EQ(places_.database().size(), 0U);
    EXPECT_FALSE(places_.has(next));
}

// Promise: words may come from elsewhere, and the searcher's own stay as they are.
TEST_F(Places, EntersWordsOfAnother) {
    const Handle<Keyframe> keyframe = add_keyframe(1, 30, add_points(30)), other = add_keyframe(2, 12, add_points(12));
    test::InMemory<FrameWords> words(std::uint32_t{60});
    places_.find_words(map(), other, (*world_)->parameters, places_.words());
    places_.find_words(map(), keyframe, (*world_)->parameters, *words);
    places_.add(keyframe, *words);
    EXPECT_EQ(places_.database().direct_index(keyframe.slot()).size(), 30U);
    EXPECT_EQ(places_.words().by_word().size(), 12U);
}

// Promise: whoever takes the searcher finds it without words or question, and the one who had it before can tell.
TEST_F(Places, OneSearchesAtATime) {
    using User = PlaceSearch::User;
    EXPECT_TRUE(places_.is_used_by(User::kNone));
    const Handle<Keyframe> keyframe = add_keyframe(1, 30, add_points(30));
    for (const User user : {User::kLoopClosing, User::kRelocalisation, User::kLoopClosing}) {
        places_.take(user);
        for (const User other : {User::kNone, User::kLoopClosing, User::kRelocalisation}) {
            EXPECT_EQ(places_.is_used_by(other), other == user);
        }
        EXPECT_TRUE(places_.words().by_word().empty());
        EXPECT_TRUE(places_.words().bag().empty());
        EXPECT_FALSE(places_.query().is_running());
        enter(keyframe);
        places_.query().begin(places_.database(), places_.words().bag());
        EXPECT_TRUE(places_.query().is_running());
    }
    places_.reset();
    EXPECT_TRUE(places_.is_used_by(User::kNone));
    EXPECT_TRUE(places_.words().by_word().empty());
    EXPECT_FALSE(places_.query().is_running());
}

// Promise: "alike" is the least score among the keyframes that share at least map.shared_min points and are in the
// database; those that share fewer, or are not in, are not asked.
TEST_F(Places, AlikeIsWhatNeighboursAre) {
    const std::vector<Handle<MapPoint>> points = add_points(100);
    const auto first = [&](std::uint32_t count) {
        return std::vector<Handle<MapPoint>>(points.begin(), points.begin() + count);
    };
    const Handle<Keyframe> keyframe = add_keyframe(1, 90, first(60));
    const PlaceSearch::Neighbourhood alone = places_.neighbourhood(map(), keyframe.slot());
    EXPECT_EQ(alone.neighbours, 0U);
    EXPECT_EQ(alone.scored, 0U);
    enter(keyframe);
    const Handle<Keyframe> much = add_keyframe(2, 90, first(50)),
                           enough = add_keyframe(3, 60, first(MapParameters{}.shared_min)),
                           little = add_keyframe(4, 20, first(MapParameters{}.shared_min - 1)),
                           absent = add_keyframe(5, 40, first(30));
    for (const Handle<Keyframe> other : {much, enough, little}) enter(other);
    const auto score = [&](Handle<Keyframe> other) { return places_.database().score(keyframe.slot(), other.slot()); };
    const PlaceSearch::Neighbourhood found = places_.neighbourhood(map(), keyframe.slot());
    EXPECT_EQ(found.neighbours, 3U);
    EXPECT_EQ(found.scored, 2U);
    EXPECT_EQ(found.score_min, std::min(score(much), score(enough)));
    EXPECT_NE(score(much), score(enough));
    EXPECT_FALSE(places_.has(absent));
    EXPECT_TRUE(places_.has(little));
}

// Promise: finding words costs units that grow with the features and are never nothing.
TEST_F(Places, FindingWordsCosts) {
    EXPECT_GE(places_.find_units(0), 1U);
    std::uint32_t before = 0;
    for (const std::size_t features : {0U, 40U, 100U, 1000U}) {
        const std::uint32_t units = places_.find_units(features);
        EXPECT_GE(units, FrameWords::find_units(vocabulary_, features) + features / 4);
        EXPECT_GT(units, before);
        before = units;
    }
}

}  // namespace
}  // namespace stillmesh::place_search_test
