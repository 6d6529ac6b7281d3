// Two rooms of one building that look alike: the same walls and screens, but for some.
#include <gtest/gtest.h>

#include <vector>

#include "engine/recognition/relocalisation.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::look_alike_rooms_test {
namespace {

constexpr std::uint32_t kFeatures = 160;
constexpr std::uint32_t kOwn = 50;       // of them, that the other room has not
constexpr std::uint32_t kKeyframes = 2;  // of each room
constexpr double kApart_m = 6;
constexpr std::uint32_t kBits = MatchingParameters{}.hamming_max + 1;  // what a feature that is the same counts

Limits limits_of_test() {
    Limits out = Limits::tiny();
    out.image_width_max = 640;
    out.image_height_max = 480;
    out.features_max = 200;  // fewer pairs are verified than agree
    out.map_points_max = 1000;
    return out;
}

CameraModel camera_of_test() {
    return {.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
}

class LookAlikeRooms : public testing::Test {
protected:
    LookAlikeRooms() : bytes_(test::vocabulary_bytes({.branching = 6, .levels = 3, .leaf_percent = 0, .seed = 3})) {
        const char* sentence = nullptr;
        EXPECT_EQ(vocabulary_.open(bytes_, limits_of_test().vocabulary_words_max, sentence), Status::kOk);
        Arena arena(memory_.span());
        places_.create(arena, limits_of_test(), configuration_, camera_of_test(), vocabulary_);
        relocalisation_.create(arena, limits_of_test(), configuration_, places_);
        Random random(7);
        for (Feature& feature : features_) {
            feature.seen.x = static_cast<float>(random.uniform(20, 620));
            feature.seen.y = static_cast<float>(random.uniform(20, 460));
            feature.seen.normalised_x = (feature.seen.x - 319.5F) / 525.0F;
            feature.seen.normalised_y = (feature.seen.y - 239.5F) / 525.0F;
            feature.seen.z_m = static_cast<float>(random.uniform(2, 4));
            feature.seen.var_z = 1e-4F;
            feature.descriptor = test::random_descriptor(random);
        }
        for (std::uint32_t i = 0; i < kKeyframes; ++i) {
            add_keyframe(pose(true), 0, random);
            add_keyframe(pose(false), kOwn, random);
        }
    }
    // Of the room that the query is in, or of the other.
    [[nodiscard]] static SE3 pose(bool is_here) {
        SE3 out;
        out.translation = Vector3(is_here ? 0 : kApart_m, 0, 0);
        return out;
    }
    void ask() {
        descriptors_.clear();
        for (const Feature& feature : features_) descriptors_.push_back(feature.descriptor);
        relocalisation_.begin_frame();
        ask_again();
    }
    // In the same frame.
    void ask_again() {
        relocalisation_.begin(descriptors_, {});
        for (const Feature& feature : features_) relocalisation_.add_feature(feature.seen);
    }
    // Places verified so far.
    [[nodiscard]] std::uint64_t verified() const {
        LoopStatistics out;
        relocalisation_.fill(out);
        return out.relocalisation_candidates;
    }
    [[nodiscard]] double metres_from(bool is_here) const {
        return (relocalisation_.world_from_camera().translation - pose(is_here).translation).norm();
    }

    test::InMemory<Map> map_{limits_of_test()};
    Relocalisation relocalisation_;

private:
    struct Feature {
        Observation seen;
        Descriptor descriptor;
    };
    [[nodiscard]] static std::size_t planned() {
        ArenaPlan plan;
        PlaceSearch::plan(plan, limits_of_test());
        Relocalisation::plan(plan, limits_of_test());
        return plan.used_bytes();
    }
    // A keyframe of all features, the first `others` of which look like nothing else.
    void add_keyframe(const SE3& world_from_camera, std::uint32_t others, Random& random) {
        const Handle<Keyframe> handle = map_->add_keyframe();
        map_->keyframes().find(handle)->world_from_camera = world_from_camera;
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            Observation seen = features_[i].seen;
            const Vector3 ray(static_cast<double>(seen.normalised_x), static_cast<double>(seen.normalised_y), 1);
            seen.point = map_->add_point().value();
            MapPoint& point = *map_->points().find(seen.point);
            store(world_from_camera * (static_cast<double>(seen.z_m) * ray), point.world);
            point.descriptor = i < others ? test::random_descriptor(random) : features_[i].descriptor;
            point.distance_m = seen.z_m;
            point.weight_tenths = 20;
            point.var_z = point.var_lateral = 1e-4;
            map_->add_observation(handle, seen, point.descriptor);
        }
        map_->attach(handle);
        places_.find_words(*map_, handle, configuration_, places_.words());
        places_.add(handle);
    }

    Parameters configuration_;
    std::vector<std::byte> bytes_;
    Vocabulary vocabulary_;
    test::Memory memory_{planned()};
    PlaceSearch places_;
    std::vector<Feature> features_ = std::vector<Feature>(kFeatures);
    std::vector<Descriptor> descriptors_;
};

// Promise: a frame speaks for the room that it shows, and for the other by what both have, wherever the camera is taken
// to be.
TEST_F(LookAlikeRooms, AFrameIsHeldAgainstBoth) {
    for (const bool is_here : {true, false}) {
        ask();
        const Relocalisation::Evidence evidence = relocalisation_.weigh(*map_, pose(is_here));
        EXPECT_EQ(is_here ? evidence.here : evidence.elsewhere, kFeatures * kBits * kBits);
        constexpr std::uint64_t kCommon = (kFeatures - kOwn) * kBits;  // of kFeatures points in view
        EXPECT_EQ(is_here ? evidence.elsewhere : evidence.here, kCommon * kCommon / kFeatures);
    }
}

// Promise: where nothing is alike but what is here, nothing speaks for anywhere else.
TEST_F(LookAlikeRooms, NothingElsewhere) {
    ask();
    SE3 nowhere = pose(true);
    nowhere.translation.y() = 100;
    EXPECT_EQ(relocalisation_.weigh(*map_, nowhere).here, 0U);
    for (std::uint32_t slot = 0; slot < map_->keyframes().slots_count(); ++slot) {
        if (!map_->keyframes().is_taken(slot) || slot % 2 == 0) continue;
        const Handle<Keyframe> other = map_->keyframes().handle_of(slot);
        EXPECT_GT(map_->keyframes().find(other)->world_from_camera.translation.x(), 0);
        map_->release_keyframe(other);
    }
    ask();
    const Relocalisation::Evidence evidence = relocalisation_.weigh(*map_, pose(true));
    EXPECT_EQ(evidence.here, kFeatures * kBits * kBits);
    EXPECT_EQ(evidence.elsewhere, 0U);
}

// Promise: a frame has an end: one that was weighed, which verifies three places at most, and is searched for after all
// tries the worthiest alone, where a frame that is only searched for tries two; and finds the same place.
TEST_F(LookAlikeRooms, AWeighedFrameTriesTheWorthiestAlone) {
    ask();
    const std::uint64_t before = verified();
    ASSERT_GT(relocalisation_.weigh(*map_, pose(false)).elsewhere, 0U);
    const std::uint64_t weighed = verified() - before;
    EXPECT_LE(weighed, 3U);
    ask_again();
    ASSERT_TRUE(relocalisation_.find(*map_));
    EXPECT_LT(metres_from(true), 0.01);
    EXPECT_EQ(verified() - before - weighed, 1U);
    relocalisation_.note_success();
    ask();
    const std::uint64_t at_first = verified();
    ASSERT_TRUE(relocalisation_.find(*map_));
    EXPECT_LT(metres_from(true), 0.01);
    EXPECT_EQ(verified() - at_first, Relocalisation::kTriesPerFrame);
}

// Promise: what spoke for another place than the camera was taken to be at is tried next, and found there.
TEST_F(LookAlikeRooms, TheRivalIsTriedNext) {
    ask();
    ASSERT_GT(relocalisation_.weigh(*map_, pose(false)).elsewhere, 0U);
    ask();
    ASSERT_TRUE(relocalisation_.find(*map_));
    EXPECT_LT(metres_from(true), 0.01);
    relocalisation_.note_success();
    // The other way round the rival is tried, and the better of the two found all the same.
    ask();
    ASSERT_GT(relocalisation_.weigh(*map_, pose(true)).elsewhere, 0U);
    ask();
    ASSERT_TRUE(relocalisation_.find(*map_));
    EXPECT_LT(metres_from(true), 0.01);
}

}  // namespace
}  // namespace stillmesh::look_alike_rooms_test
