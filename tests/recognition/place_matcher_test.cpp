#include "engine/recognition/place_matcher.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "engine/place/bag_of_words.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::place_matcher_test {
namespace {

constexpr std::uint32_t kFeatures = 90;
constexpr float kTurn_rad = 1.0F;

struct Matcher : PlaceMatcher {
    void create(Arena& arena, const Limits& limits) {
        PlaceMatcher::create(arena, limits, configuration, {.width = 160, .height = 120, .fx = 130, .fy = 130});
    }
    Parameters configuration;
};

// A keyframe of points, and a query of its descriptors with every angle turned.
class Look {
public:
    Look() : bytes_(test::vocabulary_bytes({.branching = 4, .levels = 3, .leaf_percent = 0, .seed = 3})) {
        const char* sentence = "";
        STILLMESH_CHECK(vocabulary_.open(bytes_, kVocabularyWordsMax, sentence) == Status::kOk);
        Random random(7);
        keyframe_ = map_->add_keyframe();
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            Observation seen;
            seen.point = map_->add_point().value();
            seen.angle_rad = 0.01F * static_cast<float>(i);
            const Descriptor descriptor = test::random_descriptor(random);
            map_->add_observation(keyframe_, seen, descriptor);
            seen.angle_rad += kTurn_rad;
            seen.var_z = 1e-4F;
            query_.push_back(seen);
            descriptors_.push_back(descriptor);
        }
        there_->find(vocabulary_, map_->descriptors(keyframe_));
    }
    [[nodiscard]] MapPoint& point(std::uint32_t i) { return *map_->points().find(query_[i].point); }
    [[nodiscard]] Observation& query(std::uint32_t i) { return query_[i]; }
    [[nodiscard]] Descriptor& descriptor(std::uint32_t i) { return descriptors_[i]; }
    // Features from `eligible` on are not.
    [[nodiscard]] std::uint32_t count(std::uint32_t eligible = kFeatures) {
        mine_->find(vocabulary_, descriptors_);
        matcher_->begin_query(descriptors_);
        for (std::uint32_t i = 0; i < kFeatures; ++i) matcher_->add_feature(query_[i], i < eligible);
        matcher_->end_query(mine_->by_word());
        return matcher_->count_alike(*map_, vocabulary_, keyframe_, there_->by_word());
    }

private:
    std::vector<std::byte> bytes_;
    Vocabulary vocabulary_;
    test::InMemory<Map> map_{Limits::tiny()};
    test::InMemory<FrameWords> mine_{kFeatures};
    test::InMemory<FrameWords> there_{kFeatures};
    test::InMemory<Matcher> matcher_{Limits::tiny()};
    Handle<Keyframe> keyframe_;
    std::vector<Observation> query_;
    std::vector<Descriptor> descriptors_;
};

// Promise: the first look at a keyframe counts every feature that shows a point of it, however the camera is rolled.
TEST(PlaceMatcher, CountsWhatIsAlike) {
    Look look;
    EXPECT_EQ(look.count(), kFeatures);
}

// Promise: people look alike everywhere: what shows a point that moves, or did, does not count, nor do features that
// are not asked about, nor points that are gone.
TEST(PlaceMatcher, CountsOnlyWhatStandsStill) {
    Look look;
    for (std::uint32_t i = 0; i < 20; ++i) look.point(i).is_suspect = true;
    for (std::uint32_t i = 20; i < 30; ++i) look.point(i).weight_tenths = 9;
    EXPECT_EQ(look.count(), kFeatures - 30);
    EXPECT_EQ(look.count(80), kFeatures - 40);
}

// Promise: other descriptors are not counted, nor those that turned as no others did.
TEST(PlaceMatcher, DoesNotCountLookAlikes) {
    Look look;
    for (std::uint32_t i = 0; i < 15; ++i) look.query(i).angle_rad -= 0.7F + 0.1F * static_cast<float>(i);
    EXPECT_EQ(look.count(), kFeatures - 15);
    Random random(11);
    for (std::uint32_t i = 15; i < kFeatures; ++i) look.descriptor(i) = test::random_descriptor(random);
    EXPECT_LE(look.count(), 7U);  // three bins hold no more of those 0.1 apart
}

}  // namespace
}  // namespace stillmesh::place_matcher_test
