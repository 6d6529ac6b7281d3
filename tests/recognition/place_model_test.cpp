// Matching at a place beside models of it that ask every feature, and one number over what verification computes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/base/hash.hpp"
#include "engine/features/hamming.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/place/bag_of_words.hpp"
#include "tests/recognition/verification.hpp"

namespace stillmesh::place_model_test {
namespace {

constexpr std::uint32_t kSeen = 90;

CameraModel camera() {
    return {.width = 160, .height = 120, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
}

struct Matcher : PlaceMatcher {
    void create(Arena& arena, const Limits& limits) { PlaceMatcher::create(arena, limits, configuration, camera()); }
    Parameters configuration;
};

// A keyframe and a query whose descriptors come from few, so that many are alike; some features are not eligible, some
// points move, some are gone, some features show none.
class Crowd {
public:
    explicit Crowd(std::uint64_t seed)
        : bytes_(test::vocabulary_bytes({.branching = 4, .levels = 3, .leaf_percent = 10, .seed = seed})),
          random_(seed) {
        const char* sentence = "";
        STILLMESH_CHECK(vocabulary.open(bytes_, kVocabularyWordsMax, sentence) == Status::kOk);
        std::vector<Descriptor> some;
        for (int i = 0; i < 25; ++i) some.push_back(test::random_descriptor(random_));
        keyframe = map->add_keyframe();
        std::vector<Handle<MapPoint>> points;
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            Observation seen;
            if (random_.below(10) != 0) seen.point = map->add_point().value();
            const Descriptor& kind = some[random_.below(25)];
            const Descriptor descriptor = like(kind);
            if (MapPoint* const point = map->points().find(seen.point)) {
                point->is_suspect = random_.below(12) == 0;
                point->weight_tenths = static_cast<std::uint8_t>(9 + random_.below(6));
                place(*point, descriptor);
            }
            map->add_observation(keyframe, seen, descriptor);
            points.push_back(seen.point);

            // Near where the point is seen, and mostly alike.
            Observation here;
            here.x = static_cast<float>(std::clamp(seen_at_.x() + random_.uniform(-7, 7), 0.0, 159.0));
            here.y = static_cast<float>(std::clamp(seen_at_.y() + random_.uniform(-7, 7), 0.0, 119.0));
            here.level = static_cast<std::uint8_t>(random_.below(Limits::tiny().pyramid_levels_max));
            query.push_back(here);
            descriptors.push_back(like(random_.below(3) == 0 ? some[random_.below(25)] : kind));
            is_eligible.push_back(random_.below(10) != 0);
        }
        for (const Handle<MapPoint> point : points)
            if (map->points().find(point) != nullptr && random_.below(15) == 0) map->release_point(point);
        mine->find(vocabulary, descriptors);
        there->find(vocabulary, map->descriptors(keyframe));
        matcher->begin_query(descriptors);
        for (std::uint32_t i = 0; i < kSeen; ++i) matcher->add_feature(query[i], is_eligible[i]);
        matcher->end_query(mine->by_word());
        matcher->begin_place();
    }
    [[nodiscard]] static bool is_static(const MapPoint& point) {
        return !point.is_suspect && point.weight_tenths >= Parameters{}.weights.eligible;
    }

    const SE3 camera_from_world = se3_exp((Vector6() << 0.1, -0.1, 0.2, 0.05, 0.02, -0.1).finished());
    Vocabulary vocabulary;
    test::InMemory<Map> map{Limits::tiny()};
    test::InMemory<FrameWords> mine{kSeen};
    test::InMemory<FrameWords> there{kSeen};
    test::InMemory<Matcher> matcher{Limits::tiny()};
    Handle<Keyframe> keyframe;
    std::vector<Observation> query;
    std::vector<Descriptor> descriptors;
    std::vector<bool> is_eligible;

private:
    Descriptor like(const Descriptor& descriptor) { return test::disturbed(descriptor, random_.below(45), random_); }
    // Mostly where the picture shows it, at a scale that is sometimes that of a feature.
    void place(MapPoint& point, const Descriptor& descriptor) {
        seen_at_.x() = random_.uniform(-20, 180);
        seen_at_.y() = random_.uniform(-20, 140);
        const double z = random_.uniform(0.1, 4) * (random_.below(10) == 0 ? -1 : 1);
        store(
            camera_from_world.inverse() * Vector3((seen_at_.x() - 79.5) / 130 * z, (seen_at_.y() - 59.5) / 130 * z, z),
            point.world);
        point.distance_m = static_cast<float>(std::abs(z) * random_.uniform(0.5, 2.5));
        point.level = static_cast<std::uint8_t>(random_.below(Limits::tiny().pyramid_levels_max));
        point.descriptor = descriptor;
    }
    std::vector<std::byte> bytes_;
    Random random_;
    Vector2 seen_at_ = Vector2::Zero();
};

// Promise: a feature claims the point of the keyframe's feature that is most alike, of those under its node whose point
// stands still, where that is alike enough and clearly more than the next; whatever the pieces.
TEST(PlaceModel, ClaimsByDescriptor) {
    std::uint32_t claimed = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        Crowd crowd(seed);
        const MatchingParameters& p = crowd.matcher->configuration.matching;
        while (!crowd.matcher->is_matched()) {
            static_cast<void>(
                crowd.matcher->match(*crowd.map, crowd.vocabulary, crowd.keyframe, crowd.there->by_word()));
        }
        std::vector<Handle<MapPoint>> expected(kSeen);
        std::vector<std::uint32_t> bits(kSeen, 0);
        for (const WordOfFeature& mine : crowd.mine->by_word()) {
            if (!crowd.is_eligible[mine.feature]) continue;
            const WordRange node = crowd.vocabulary.node_of(mine.word, PlaceMatcher::kNodesLevel);
            std::vector<std::pair<std::uint32_t, Handle<MapPoint>>> alike;
            for (const WordOfFeature& there : crowd.there->by_word()) {
                const Handle<MapPoint> seen = crowd.map->observations(crowd.keyframe)[there.feature].point;
                const MapPoint* const point = crowd.map->points().find(seen);
                if (there.word < node.begin || there.word >= node.end || point == nullptr) continue;
                const std::uint32_t distance = hamming_distance(crowd.descriptors[mine.feature],
                                                                crowd.map->descriptors(crowd.keyframe)[there.feature]);
                if (crowd.is_static(*point) && distance <= p.hamming_max) alike.emplace_back(distance, seen);
            }
            std::stable_sort(alike.begin(), alike.end(),
                             [](const auto& a, const auto& b) { return a.first < b.first; });
            const double next = alike.size() > 1 ? alike[1].first : p.hamming_max + 1;
            if (alike.empty() || alike[0].first > p.ratio_max * next) continue;
            bits[mine.feature] = alike[0].first;
            expected[mine.feature] = alike[0].second;
        }
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            ASSERT_TRUE(crowd.matcher->claim(i).point == expected[i]) << seed << " " << i;
            if (expected[i].is_null()) continue;
            ASSERT_EQ(crowd.matcher->claim(i).distance_bits, bits[i]);
            ++claimed;
        }
    }
    EXPECT_GT(claimed, 500U);
}

// Promise: a point is projected once; it is claimed by the feature that is most alike among all of about its scale
// within the radius, unless that has a better claim; a point out of view, or of no level's scale, is not in view.
TEST(PlaceModel, ClaimsByProjection) {
    std::uint32_t claimed = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        Crowd crowd(seed);
        const Parameters& parameters = crowd.matcher->configuration;
        const MatchingParameters& p = parameters.matching;
        PixelNoise noise;
        noise.create(parameters, camera());
        crowd.matcher->begin_projection();
        std::uint32_t in_view = 0;
        for (std::uint32_t at = 0; at < 2 * kSeen; ++at) {  // each twice
            const Handle<MapPoint> handle = crowd.map->observations(crowd.keyframe)[at % kSeen].point;
            const MapPoint* const point = crowd.map->points().find(handle);
            std::vector<PlaceMatcher::Claim> before;
            for (std::uint32_t i = 0; i < kSeen; ++i) before.push_back(crowd.matcher->claim(i));
            const std::uint32_t units = crowd.matcher->project(*crowd.map, handle, crowd.camera_from_world);
            std::vector<std::uint32_t> nearest;  // the features that are most alike
            Vector2 pixel = Vector2::Zero();
            bool is_asked = at < kSeen && point != nullptr && crowd.is_static(*point);
            double ratio = 0;
            if (is_asked) {
                const Vector3 q = crowd.camera_from_world * vector_of(point->world);
                ratio = static_cast<double>(point->distance_m) / q.z() * noise.scale(point->level);
                is_asked = visible_pixel(camera(), q, parameters.depth.z_min_m, pixel) && ratio >= 1.0 / kScaleSlack &&
                           ratio <= kScaleSlack * noise.scales().back();
            }
            ASSERT_EQ(units, is_asked ? 2U : 0U);
            in_view += is_asked ? 1U : 0U;
            std::uint32_t least = p.hamming_max;
            for (std::uint32_t i = 0; is_asked && i < kSeen; ++i) {
                const double scale = noise.scale(crowd.query[i].level);
                const double off = std::max(scale / ratio, ratio / scale);
                const Vector2 here(static_cast<double>(crowd.query[i].x), static_cast<double>(crowd.query[i].y));
                const std::uint32_t distance = hamming_distance(crowd.descriptors[i], point->descriptor);
                if (!crowd.is_eligible[i] || off > kScaleSlack || distance > least) continue;
                if ((here - pixel).norm() > p.radius_posed_px * scale) continue;
                if (distance < least) nearest.clear();
                least = distance;
                nearest.push_back(i);
            }
            std::uint32_t changed = 0, could_change = 0;
            for (std::uint32_t i = 0; i < kSeen; ++i) {
                const bool is_nearest = std::find(nearest.begin(), nearest.end(), i) != nearest.end();
                const bool is_free = before[i].point.is_null() || before[i].distance_bits > least;
                could_change += is_nearest && is_free ? 1U : 0U;
                if (crowd.matcher->claim(i).point == before[i].point) continue;
                ++changed;
                ASSERT_TRUE(is_nearest && is_free && crowd.matcher->claim(i).point == handle) << seed << " " << at;
                ASSERT_EQ(crowd.matcher->claim(i).distance_bits, least);
            }
            ASSERT_LE(changed, 1U);
            if (nearest.size() == 1) {
                ASSERT_EQ(changed, could_change) << seed << " " << at;
            }
            claimed += changed;
        }
        ASSERT_EQ(crowd.matcher->points_in_view(), in_view);
        crowd.matcher->begin_place();
        ASSERT_EQ(crowd.matcher->points_in_view(), 0U);
    }
    EXPECT_GT(claimed, 100U);
}

// Promise: verification gives the same bits on every processor, compiler and optimisation level, for the same work:
// with few features and many, with outliers, without depth, with neighbours of the place.
TEST(PlaceVerifier, GoldenBits) {
    StateHash hash;
    std::uint32_t accepted = 0;
    for (std::uint32_t round = 0; round < 12; ++round) {
        test::Verification v(round);
        Random random(100 + round);
        const Handle<Keyframe> neighbour = v.rig.map().add_keyframe();
        v.rig.at(neighbour).frame = 3;
        v.rig.at(neighbour).world_from_camera = v.rig.at(v.candidate).world_from_camera;
        for (std::uint32_t i = 0; i < test::kFeatures; ++i) {
            Observation o = v.query[i];
            o.point = v.points[i];
            if (random.below(3) == 0) v.rig.map().add_observation(neighbour, o, v.descriptors[i]);
            const double noisy_x = static_cast<double>(o.x) + 0.8 * random.normal();
            const double noisy_y = static_cast<double>(o.y) + 0.8 * random.normal();
            const double noisy_z = static_cast<double>(o.z_m) * (1 + 0.005 * random.normal());
            v.query[i] = v.rig.seen_at(noisy_x, noisy_y, noisy_z);
            const std::uint32_t kind = random.below(10 + 4 * (round % 3));
            if (kind == 0) v.query[i].var_z = -1;
            if (kind == 1) v.query[i].level = static_cast<std::uint8_t>(random.below(3));
            if (kind == 2) v.query[i].angle_rad = static_cast<float>(random.uniform(-3, 3));
            if (kind < 3 + round / 3) continue;
            const double x = random.uniform(60, 580);
            const double y = random.uniform(50, 430);
            const double z = random.uniform(1, 5);
            if (kind == 9) v.query[i] = v.rig.seen_at(x, y, z);
            if (kind == 8) v.descriptors[i] = v.descriptors[(i + 1) % test::kFeatures];
        }
        v.begin(round % 4 == 3 ? 45 : test::kFeatures);
        WorkBudget budget(UINT32_MAX);
        const Progress progress = v.verifier().step(v.rig.map(), v.rig.places.vocabulary(),
                                                    v.rig.places.database().direct_index(v.candidate.slot()), budget);
        ASSERT_EQ(progress, Progress::kDone);
        hash.add(static_cast<std::uint64_t>(budget.units_spent()));
        hash.add(static_cast<std::uint32_t>(v.verifier().refusal()));
        hash.add(v.verifier().matches());
        if (!v.verifier().is_accepted()) continue;
        ++accepted;
        const SE3& pose = v.verifier().world_from_query();
        for (int i = 0; i < 9; ++i) hash.add(pose.rotation(i / 3, i % 3));
        for (int i = 0; i < 3; ++i) hash.add(pose.translation(i));
        for (int i = 0; i < 36; ++i) hash.add(v.verifier().information()(i / 6, i % 6));
        hash.add(v.verifier().inliers());
        hash.add(v.verifier().likeness(v.rig.map()));
        for (const PlaceMatch& match : v.verifier().agreeing()) {
            hash.add(static_cast<std::uint32_t>(match.feature));
            hash.add(match.point.slot());
        }
    }
    EXPECT_GE(accepted, 6U);
    EXPECT_LT(accepted, 12U);
    EXPECT_EQ(hash.value(), 0x17b00f829770f5d6ULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::place_model_test
