#include "engine/matching/map_matcher.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "engine/base/arena.hpp"
#include "engine/base/random.hpp"
#include "engine/features/hamming.hpp"
#include "engine/geometry/camera.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::map_matcher_test {
namespace {

constexpr CameraModel kCamera{640, 480, 520, 520, 319.5, 239.5, 0, 0, 0, 0, 0};
constexpr double kScales[] = {1.0, 1.2, 1.44};

Descriptor random_descriptor(Random& random) {
    Descriptor d;
    for (std::uint64_t& word : d.words) word = static_cast<std::uint64_t>(random.next()) << 32U | random.next();
    return d;
}

Descriptor with_errors(Descriptor d, std::uint32_t bits, Random& random) {
    for (std::uint32_t i = 0; i < bits; ++i) {
        const std::uint32_t bit = random.below(256);
        d.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    return d;
}

// A map of points before the camera and the features that show them, in an order of their own.
class MapMatcherTest : public testing::Test {
protected:
    MapMatcherTest() {
        limits_.features_max = 400;
        limits_.map_points_max = 600;
        limits_.keyframes_max = 4;
        ArenaPlan plan;
        MapMatcher::plan(plan, limits_);
        Map::plan(plan, limits_);
        FeatureSet::plan(plan, limits_.features_max);
        bytes_ = std::vector<std::byte>(plan.used_bytes() + kArenaAlignment);
        void* start = bytes_.data();
        std::size_t space = bytes_.size();
        std::align(kArenaAlignment, plan.used_bytes(), start, space);
        Arena arena({static_cast<std::byte*>(start), plan.used_bytes()});
        matcher_.create(arena, limits_, parameters_, kCamera, kScales);
        map_.create(arena, limits_);
        features_.create(arena, limits_.features_max);
    }

    void add_point(const Vector3& world, const Descriptor& descriptor, float angle_rad, Handle<Keyframe> keyframe) {
        const Handle<MapPoint> handle = map_.points().take().value();
        MapPoint& point = *map_.points().find(handle);
        for (int i = 0; i < 3; ++i) point.world[i] = world(i);
        point.distance_m = static_cast<float>(world.z());
        point.descriptor = descriptor;
        point.angle_rad = angle_rad;
        Observation observation;
        observation.point = handle;
        map_.add_observation(keyframe, observation);
    }
    void add_feature(double x, double y, const Descriptor& descriptor, float angle_rad, std::uint8_t level = 0) {
        Keypoint keypoint;
        keypoint.x = static_cast<float>(x);
        keypoint.y = static_cast<float>(y);
        keypoint.angle_rad = angle_rad;
        keypoint.level = level;
        ASSERT_TRUE(features_.keypoints.push(keypoint));
        ASSERT_TRUE(features_.descriptors.push(descriptor));
    }

    Limits limits_;
    MatchingParameters parameters_;
    std::vector<std::byte> bytes_;
    MapMatcher matcher_;
    Map map_;
    FeatureSet features_;
    Random random_{7};
};

// Promise: matching by projection claims what a search over all pairs claims: nearest descriptor within radius and
// levels, ratio test against the same level, the nearer point when two want one feature.
TEST_F(MapMatcherTest, ProjectionEqualsBruteForce) {
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    std::vector<Descriptor> pool;
    for (int i = 0; i < 60; ++i) pool.push_back(random_descriptor(random_));
    for (int i = 0; i < 350; ++i) {
        const Vector3 p(random_.uniform(-1.2, 1.2), random_.uniform(-0.9, 0.9), random_.uniform(0.8, 3));
        const Descriptor& d = pool[random_.below(60)];
        add_point(p, with_errors(d, 10, random_), 0, keyframe);
        if (i % 2 == 0) continue;
        const Vector2 pixel = distort_to_pixel(kCamera, {p.x() / p.z(), p.y() / p.z()});
        add_feature(std::min(std::max(pixel.x() + random_.uniform(-9, 9), 1.0), 638.0),
                    std::min(std::max(pixel.y() + random_.uniform(-9, 9), 1.0), 478.0), with_errors(d, 14, random_), 0,
                    static_cast<std::uint8_t>(random_.below(3)));
    }
    for (int i = 0; i < 200; ++i) {  // a crowd: more in one row of cells than are looked at together
        add_feature(random_.uniform(250, 390), random_.uniform(241, 255),
                    with_errors(pool[random_.below(60)], 14, random_), 0, static_cast<std::uint8_t>(random_.below(3)));
    }
    matcher_.begin(features_);
    const double radius = 15;
    matcher_.by_projection(map_, nullptr, SE3{}, radius);

    std::vector<Claim> expected(features_.size());
    for (std::uint32_t slot = 0; slot < map_.points().slots_count(); ++slot) {
        if (!map_.points().is_taken(slot)) continue;
        const MapPoint& point = map_.points().at(slot);
        const Vector3 q = vector_of(point.world);
        const Vector2 pixel = distort_to_pixel(kCamera, {q.x() / q.z(), q.y() / q.z()});
        if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() >= 640 || pixel.y() >= 480) continue;
        // Every point is as far as when it was made, on level 0: features of levels 0 and 1 will do.
        int best = -1;
        std::uint32_t distances[2] = {257, 257};
        int second = -1;
        for (std::size_t i = 0; i < features_.size(); ++i) {
            const Keypoint& k = features_.keypoints[i];
            if (k.level > 1) continue;
            if (std::hypot(static_cast<double>(k.x) - pixel.x(), static_cast<double>(k.y) - pixel.y()) > radius)
                continue;
            const std::uint32_t d = hamming_distance(features_.descriptors[i], point.descriptor);
            if (d > parameters_.hamming_max) continue;
            if (d < distances[0]) {
                second = best;
                distances[1] = distances[0];
                best = static_cast<int>(i);
                distances[0] = d;
            } else if (d < distances[1]) {
                second = static_cast<int>(i);
                distances[1] = d;
            }
        }
        if (best < 0) continue;
        const auto b = static_cast<std::size_t>(best);
        if (second >= 0 &&
            features_.keypoints[b].level == features_.keypoints[static_cast<std::size_t>(second)].level &&
            distances[0] > parameters_.ratio_max * distances[1]) {
            continue;
        }
        if (expected[b].is_free() || distances[0] < expected[b].distance_bits) expected[b] = {slot + 1, distances[0]};
    }
    std::uint32_t claimed = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        EXPECT_EQ(matcher_.claim(i).point_slot_plus_one, expected[i].point_slot_plus_one) << i;
        EXPECT_EQ(matcher_.claim(i).distance_bits, expected[i].distance_bits) << i;
        claimed += expected[i].is_free() ? 0U : 1U;
    }
    EXPECT_GT(claimed, 60U);
}

// Promise: a point is looked for on the level on which it looks as it did where it was made, the nearest by scale, and
// on the neighbours of that level, within the radius that belongs to it, and nowhere else.
TEST_F(MapMatcherTest, LooksOnTheLevelThatFits) {
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    constexpr double kRadius_px = 5;
    std::vector<bool> expected;
    std::uint32_t on_level[3] = {};
    for (int i = 0; i < 360; ++i) {
        const Vector2 pixel(20 + 30 * (i % 20), 20 + 24 * (i / 20));
        const double z = random_.uniform(1, 3);
        const Descriptor d = random_descriptor(random_);
        add_point({(pixel.x() - kCamera.cx) / kCamera.fx * z, (pixel.y() - kCamera.cy) / kCamera.fy * z, z}, d, 0,
                  keyframe);
        MapPoint& point = map_.points().at(static_cast<std::uint32_t>(i));
        point.level = static_cast<std::uint8_t>(random_.below(3));
        point.distance_m = static_cast<float>(z * std::pow(1.2, random_.uniform(-3, 3)));
        const double look = std::log(static_cast<double>(point.distance_m) / z * kScales[point.level]);
        int level = 0;
        for (int k = 1; k < 3; ++k) {
            if (std::abs(look - std::log(kScales[k])) < std::abs(look - std::log(kScales[level]))) level = k;
        }
        ++on_level[level];
        const int of_feature = static_cast<int>(random_.below(3));
        const double off = random_.uniform(0, 1.5) * kRadius_px;
        add_feature(pixel.x() + off, pixel.y(), d, 0, static_cast<std::uint8_t>(of_feature));
        expected.push_back(std::abs(of_feature - level) <= 1 && off <= kRadius_px * kScales[level]);
    }
    matcher_.begin(features_);
    matcher_.by_projection(map_, nullptr, SE3{}, kRadius_px);
    for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(matcher_.claim(i).is_free(), !expected[i]) << i;
    for (const std::uint32_t count : on_level) EXPECT_GT(count, 60U);
}

// Promise: a further search keeps the claims there are and passes over points seen in this frame.
TEST_F(MapMatcherTest, MoreAddsOnly) {
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    const Descriptor one = random_descriptor(random_);
    const Descriptor two = random_descriptor(random_);
    add_point({0, 0, 2}, one, 0, keyframe);
    add_point({0.5, 0, 2}, two, 0, keyframe);
    add_feature(319.5, 239.5, one, 0);
    add_feature(319.5 + 130, 239.5, two, 0);
    matcher_.begin(features_);
    map_.points().at(1).last_seen_frame = 5;
    std::uint64_t frame = 5;
    matcher_.by_projection(map_, nullptr, SE3{}, 10, &frame);
    EXPECT_EQ(matcher_.claim(0).point_slot_plus_one, 1U);
    EXPECT_TRUE(matcher_.claim(1).is_free());
    map_.points().at(0).last_seen_frame = 6;
    frame = 6;
    matcher_.by_projection(map_, nullptr, SE3{}, 10, &frame);
    EXPECT_EQ(matcher_.claim(0).point_slot_plus_one, 1U);
    EXPECT_EQ(matcher_.claim(1).point_slot_plus_one, 2U);
}

// Promise: with a rolling shutter a point is looked for where its own row's camera saw it.
TEST_F(MapMatcherTest, LooksWhereTheRowWasExposed) {
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    Vector6 speed = Vector6::Zero();
    speed(4) = 1.5;  // rad/s about y
    constexpr double kReadout_s = 0.026;
    std::vector<Vector3> points;
    for (int i = 0; i < 40; ++i) points.emplace_back(random_.uniform(-0.5, 0.5), -0.75, 2.0);
    for (const Vector3& p : points) {
        const Descriptor d = random_descriptor(random_);
        add_point(p, d, 0, keyframe);
        // The top rows are exposed before the middle one: the camera had turned less.
        const double row_s = (distort_to_pixel(kCamera, {p.x() / p.z(), p.y() / p.z()}).y() / 480 - 0.5) * kReadout_s;
        const Vector3 seen = se3_exp(speed * row_s).inverse() * p;
        const Vector2 pixel = distort_to_pixel(kCamera, {seen.x() / seen.z(), seen.y() / seen.z()});
        add_feature(pixel.x(), pixel.y(), d, 0);
    }
    const auto claimed = [&](double radius) {
        matcher_.by_projection(map_, nullptr, SE3{}, radius);
        std::size_t n = 0;
        for (std::size_t i = 0; i < features_.size(); ++i) n += matcher_.claim(i).is_free() ? 0U : 1U;
        return n;
    };
    matcher_.begin(features_);
    EXPECT_EQ(claimed(3.0), 0U);
    matcher_.set_sweep(speed * kReadout_s);
    EXPECT_EQ(claimed(0.5), points.size());
}

// Promise: matching by descriptor finds the points of a rolled picture, and drops those that turn otherwise, but for
// those of the two turns (12 degrees) that come next.
TEST_F(MapMatcherTest, OneTurnOfThePicture) {
    constexpr float kRoll = 2.5F;
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    for (std::uint32_t i = 0; i < 120; ++i) {
        const Descriptor d = random_descriptor(random_);
        const auto angle = static_cast<float>(random_.uniform(-3.1, 3.1));
        add_point({0, 0, 2}, d, angle, keyframe);
        // Every fifth is a look-alike that turned by something else.
        float turned = angle + kRoll + (i % 5 == 0 ? 0.6F + 0.2F * static_cast<float>(i / 5) : 0.0F);
        while (turned > 3.1415927F) turned -= 6.2831853F;
        add_feature(10.0 + 4 * i, 100, with_errors(d, 8, random_), turned);
    }
    matcher_.begin(features_);
    matcher_.by_descriptor(map_, keyframe);
    std::uint32_t kept = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        if (i % 5 != 0) {
            EXPECT_FALSE(matcher_.claim(i).is_free()) << i;
        } else {
            kept += matcher_.claim(i).is_free() ? 0U : 1U;
        }
    }
    EXPECT_LE(kept, 4U) << "of 24 that turn by all angles there is";
}

// Promise: matching by words claims what comparing all pairs under one node claims, at every level.
TEST_F(MapMatcherTest, WordsEqualBruteForceUnderOneNode) {
    const std::vector<std::byte> bytes = test::vocabulary_bytes({4, 3, 10, 3});
    Vocabulary vocabulary;
    const char* sentence = "";
    ASSERT_EQ(vocabulary.open(bytes, kVocabularyWordsMax, sentence), Status::kOk);
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    std::vector<Descriptor> of_keyframe;
    for (std::uint32_t i = 0; i < 200; ++i) {
        of_keyframe.push_back(random_descriptor(random_));
        add_point({0, 0, 2}, of_keyframe.back(), 0, keyframe);
        if (i % 10 == 0) map_.points().release(map_.points().handle_of(i));  // a point that went
        add_feature(10.0 + 3 * i, 100, with_errors(of_keyframe.back(), random_.below(60), random_), 0);
        if (i % 7 == 0) add_feature(10.0 + 3 * i, 200, with_errors(of_keyframe.back(), 20, random_), 0);
    }
    test::InMemory<FrameWords> frame{limits_.features_max};
    test::InMemory<FrameWords> words{limits_.features_max};
    frame->find(vocabulary, features_.descriptors.span());
    words->find(vocabulary, of_keyframe);
    matcher_.begin(features_);
    std::size_t claimed_above = features_.size();
    for (std::uint32_t level = 1; level <= 3; ++level) {
        matcher_.by_words(map_, keyframe, vocabulary, level, frame->by_word(), words->by_word());
        std::vector<Claim> expected(features_.size());
        for (std::uint32_t slot = 0; slot < of_keyframe.size(); ++slot) {
            if (!map_.points().is_taken(slot)) continue;
            const WordRange node = vocabulary.node_of(vocabulary.word_of(of_keyframe[slot]), level);
            std::uint32_t best = 257;
            std::uint32_t second = 257;
            std::size_t best_feature = 0;
            for (std::size_t i = 0; i < features_.size(); ++i) {
                const std::uint32_t word = vocabulary.word_of(features_.descriptors[i]);
                if (word < node.begin || word >= node.end) continue;
                const std::uint32_t distance = hamming_distance(features_.descriptors[i], of_keyframe[slot]);
                if (distance < best) {
                    second = best;
                    best = distance;
                    best_feature = i;
                } else {
                    second = std::min(second, distance);
                }
            }
            if (best > parameters_.hamming_wide_max || best > parameters_.ratio_max * second) continue;
            Claim& claim = expected[best_feature];
            if (claim.is_free() || best < claim.distance_bits) claim = {slot + 1, best};
        }
        std::size_t claimed = 0;
        for (std::size_t i = 0; i < features_.size(); ++i) {
            EXPECT_EQ(matcher_.claim(i).point_slot_plus_one, expected[i].point_slot_plus_one) << level << " " << i;
            claimed += expected[i].is_free() ? 0U : 1U;
        }
        EXPECT_GT(claimed, 20U);
        EXPECT_LE(claimed, claimed_above);
        claimed_above = claimed;
    }
}

// Promise: a descriptor that fits two features as well matches neither.
TEST_F(MapMatcherTest, RatioBites) {
    const Handle<Keyframe> keyframe = map_.add_keyframe();
    const Descriptor d = random_descriptor(random_);
    add_point({0, 0, 2}, d, 0, keyframe);
    add_feature(100, 100, with_errors(d, 6, random_), 0);
    matcher_.begin(features_);
    matcher_.by_descriptor(map_, keyframe);
    EXPECT_FALSE(matcher_.claim(0).is_free());
    add_feature(200, 100, with_errors(d, 6, random_), 0);
    matcher_.begin(features_);
    matcher_.by_descriptor(map_, keyframe);
    EXPECT_TRUE(matcher_.claim(0).is_free());
    EXPECT_TRUE(matcher_.claim(1).is_free());
}

}  // namespace
}  // namespace stillmesh::map_matcher_test
