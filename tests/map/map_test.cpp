#include "engine/map/map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/map/local_map.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

using MapInMemory = test::InMemory<Map>;

Limits small(std::uint32_t keyframes, std::uint32_t points, std::uint32_t features) {
    Limits limits = Limits::tiny();
    limits.keyframes_max = keyframes;
    limits.map_points_max = points;
    limits.features_max = features;
    return limits;
}

Observation observation_of(Handle<MapPoint> point, float x = 0) {
    Observation out;
    out.point = point;
    out.x = x;
    return out;
}

Handle<MapPoint> add_point(Map& map, std::uint64_t seen_in = 0) {
    const auto taken = map.add_point();
    EXPECT_TRUE(taken.is_ok());
    map.points().find(taken.value())->last_seen_frame = seen_in;
    return taken.value();
}

Handle<Keyframe> add_keyframe(Map& map, std::uint64_t frame) {
    const Handle<Keyframe> handle = map.add_keyframe();
    EXPECT_FALSE(handle.is_null());
    map.keyframes().find(handle)->frame = frame;
    map.keyframes().find(handle)->last_useful_frame = frame;
    return handle;
}

// Promise: a full pool of points says kFull and changes nothing; the least recently seen are forgotten, lower slots
// first, never those seen in the frame at hand nor the spared; handles to them are stale, others live.
TEST(Map, ForgetsTheLeastRecentlySeen) {
    MapInMemory map(small(4, 10, 8));
    ASSERT_EQ(map.used_bytes(), map.planned_bytes());
    std::vector<Handle<MapPoint>> handles;
    const std::uint64_t seen[10] = {5, 3, 3, 9, 1, 9, 3, 7, 2, 9};
    for (const std::uint64_t frame : seen) {
        handles.push_back(add_point(*map, frame));
        map->points().find(handles.back())->seen = 9;
    }
    const std::uint64_t hash = map->changes_hash();
    EXPECT_EQ(map->add_point().status(), Status::kFull);
    EXPECT_EQ(map->changes_hash(), hash);
    EXPECT_EQ(map->points().size(), 10U);
    const auto alive = [&] {
        std::vector<int> out;
        for (int i = 0; i < 10; ++i) {
            if (map->points().find(handles[static_cast<std::size_t>(i)]) != nullptr) out.push_back(i);
        }
        return out;
    };
    EXPECT_EQ(map->make_room_for_points(0, 9, {}), 0U);
    EXPECT_EQ(alive().size(), 10U);
    std::vector<std::uint8_t> marks(10, 0);
    marks[4] = 7;
    // Frames 1 (spared), 2 and two of the three seen in 3.
    EXPECT_EQ(map->make_room_for_points(3, 9, {marks, 7}), 3U);
    EXPECT_EQ(alive(), (std::vector<int>{0, 3, 4, 5, 6, 7, 9}));
    EXPECT_EQ(map->points_forgotten(), 3U);
    EXPECT_EQ(map->make_room_for_points(100, 9, {}), 4U);  // more than there are: those of frame 9 stay
    EXPECT_EQ(alive(), (std::vector<int>{3, 5, 9}));
    EXPECT_EQ(map->points_forgotten(), 7U);
    EXPECT_EQ(map->statistics().points_evicted, 7U);
    // What was seen later than the frame asked about stays as well.
    map->points().at(handles[3].slot()).last_seen_frame = 12;
    EXPECT_EQ(map->make_room_for_points(100, 11, {}), 2U);
    EXPECT_EQ(alive(), (std::vector<int>{3}));
}

// Promise: points that move or that hardly anybody has seen go before those that were seen long ago, spared or not, but
// not what was seen in the frame at hand.
TEST(Map, ForgetsWeakPointsFirst) {
    MapInMemory map(small(4, 6, 8));
    std::vector<Handle<MapPoint>> handles;
    const std::uint64_t last_seen[6] = {1, 8, 7, 6, 2, 9};
    const std::uint16_t seen[6] = {9, 2, 9, 2, 9, 1};
    for (std::size_t i = 0; i < 6; ++i) {
        handles.push_back(add_point(*map, last_seen[i]));
        map->points().find(handles[i])->seen = seen[i];
    }
    map->points().find(handles[2])->is_suspect = true;
    const std::vector<std::uint8_t> marks{0, 7, 7, 0, 7, 7};
    std::vector<int> order;
    for (int round = 0; round < 6; ++round) {
        const std::uint32_t went = map->make_room_for_points(1, 9, {marks, 7});
        for (int i = 0; i < 6; ++i) {
            if (map->points().find(handles[static_cast<std::size_t>(i)]) == nullptr &&
                std::find(order.begin(), order.end(), i) == order.end()) {
                order.push_back(i);
            }
        }
        if (went == 0) break;
    }
    EXPECT_EQ(order, (std::vector<int>{3, 2, 1, 0})) << "weak ones by age, then 0; 4 is spared, 5 of this frame";
}

// Promise: a full pool thins out every place rather than forgetting the oldest ones: however long the way, each
// keyframe keeps its share of the points, those that were seen most often.
TEST(Map, EachPlaceKeepsItsShare) {
    constexpr std::uint32_t kKeyframes = 8, kSeen = 20, kPoints = 60;
    MapInMemory map(small(kKeyframes, kPoints, kSeen));
    std::vector<std::vector<Handle<MapPoint>>> seen(kKeyframes);
    for (std::uint32_t k = 0; k < kKeyframes; ++k) {
        const std::uint64_t frame = 10 * (k + 1);
        const std::size_t free = kPoints - map->points().size();
        if (free < kSeen) map->make_room_for_points(static_cast<std::uint32_t>(kSeen - free), frame, {});
        const Handle<Keyframe> keyframe = add_keyframe(*map, frame);
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            seen[k].push_back(add_point(*map, frame));
            map->points().find(seen[k].back())->seen = static_cast<std::uint16_t>(i % 4 == 0 ? 40 : 5);
            map->add_observation(keyframe, observation_of(seen[k].back()), {});
        }
        map->attach(keyframe);
        ASSERT_EQ(map->find_fault(), nullptr);
    }
    for (std::uint32_t k = 0; k < kKeyframes; ++k) {
        std::uint32_t alive = 0, often = 0;
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            if (map->points().find(seen[k][i]) == nullptr) continue;
            ++alive;
            often += i % 4 == 0 ? 1U : 0U;
        }
        EXPECT_GE(alive, (kPoints - kSeen) / kKeyframes) << k;
        EXPECT_EQ(often, kSeen / 4) << k;
    }
}

// Promise: culling takes what is unseen for a second and weak, in any slices the same.
TEST(Map, CullsInSlices) {
    for (const std::uint32_t slice : {1U, 3U, 100U}) {
        MapInMemory map(small(2, 20, 8));
        for (std::uint32_t i = 0; i < 20; ++i) {
            const Handle<MapPoint> handle = add_point(*map, i % 2 == 0 ? 5 : 50);
            map->points().find(handle)->seen = i % 3 == 0 ? 2 : 9;
            map->points().find(handle)->is_suspect = i % 5 == 0;
        }
        std::uint32_t next = 0;
        do {
            next = map->cull_points(5 + MapParameters{}.cull_after_frames + 1, next, slice);
        } while (next != 0);
        for (std::uint32_t i = 0; i < 20; ++i) {
            EXPECT_EQ(map->points().is_taken(i), !(i % 2 == 0 && (i % 3 == 0 || i % 5 == 0))) << i;
        }
        EXPECT_EQ(map->statistics().points_culled, 20 - map->points().size());
    }
}

// Promise: a full pool of keyframes says so and changes nothing; the policy forgets the newer of two neighbours, unless
// nothing is left of what the older one saw, then the least recently useful, never the newest nor the spared, who are
// nobody's neighbours; what nobody else observes goes with it.
TEST(Map, EvictsByPolicy) {
    for (const bool is_older_empty : {false, true}) {
        MapInMemory map(small(6, 20, 5));
        std::vector<Handle<Keyframe>> keyframes;
        std::vector<Handle<MapPoint>> points;
        for (std::uint64_t i = 0; i < 6; ++i) {
            keyframes.push_back(add_keyframe(*map, 10 * i + 1));
            Keyframe& keyframe = *map->keyframes().find(keyframes.back());
            // 2 and 3 are neighbours, and nearer ones are 0 and 1, one of which is spared.
            keyframe.world_from_camera.translation.x() = i == 3 ? 20.5 : i == 1 ? 0.2 : 10.0 * static_cast<double>(i);
            points.push_back(add_point(*map));
            map->points().find(points.back())->seen = 9;
            map->points().find(points.back())->is_suspect = is_older_empty && i == 2;
            map->add_observation(keyframes.back(), observation_of(points.back()));
            map->attach(keyframes.back());
        }
        ASSERT_EQ(map->find_fault(), nullptr);
        const std::uint64_t hash = map->changes_hash();
        EXPECT_TRUE(map->add_keyframe().is_null());
        EXPECT_EQ(map->changes_hash(), hash);
        std::vector<std::uint8_t> spared(6, 0);
        spared[0] = 1;
        ASSERT_TRUE(map->evict_keyframe(spared));
        const std::size_t gone = is_older_empty ? 2 : 3;
        EXPECT_EQ(map->keyframes().find(keyframes[gone]), nullptr);
        EXPECT_EQ(map->points().find(points[gone]), nullptr);
        ASSERT_EQ(map->find_fault(), nullptr);
        map->keyframes().find(keyframes[1])->last_useful_frame = 1000;
        ASSERT_TRUE(map->evict_keyframe(spared));
        EXPECT_EQ(map->keyframes().find(keyframes[is_older_empty ? 3 : 2]), nullptr) << "the least recently useful";
        ASSERT_TRUE(map->evict_keyframe({}));
        EXPECT_EQ(map->keyframes().find(keyframes[1]), nullptr) << "nobody is spared: the newer of two neighbours";
        ASSERT_TRUE(map->evict_keyframe({}));
        EXPECT_EQ(map->keyframes().find(keyframes[0]), nullptr);
        ASSERT_TRUE(map->evict_keyframe({}));
        EXPECT_FALSE(map->evict_keyframe({})) << "the newest stays";
        EXPECT_NE(map->keyframes().find(keyframes[5]), nullptr);
        EXPECT_EQ(map->points().size(), 1U);
        EXPECT_EQ(map->statistics().keyframes_evicted, 5U);
        EXPECT_EQ(map->statistics().points_evicted, 5U);
    }
}

// Promise: a way longer than the pool is thinned from all of its length; neither its beginning nor its middle is
// forgotten, and the gaps stay even. Turning on the spot counts as a way, too.
TEST(Map, ThinsAWayOut) {
    for (const bool is_turn : {false, true}) {
        MapInMemory map(small(12, 20, 5));
        std::vector<std::uint8_t> spared(12, 0);
        const double length = is_turn ? 3.0 : 6.0;  // rad or m
        constexpr std::uint64_t kSteps = 120;
        for (std::uint64_t i = 0; i <= kSteps; ++i) {
            std::fill(spared.begin(), spared.end(), std::uint8_t{0});
            for (std::uint32_t k = 0; k < 3; ++k) {
                if (const Handle<Keyframe> recent = map->recent_keyframe(k); !recent.is_null()) {
                    spared[recent.slot()] = 1;
                }
            }
            if (map->keyframes().is_full()) {
                ASSERT_TRUE(map->evict_keyframe(spared));
            }
            Keyframe& keyframe = *map->keyframes().find(add_keyframe(*map, i + 1));
            const double at = length * static_cast<double>(i) / static_cast<double>(kSteps);
            if (is_turn) {
                keyframe.world_from_camera = se3_exp((Vector6() << 0, 0, 0, 0, at, 0).finished());
            } else {
                keyframe.world_from_camera.translation.x() = at;
            }
        }
        std::vector<std::uint64_t> left;
        for (std::uint32_t i = 12; i-- > 0;) left.push_back(map->keyframes().find(map->recent_keyframe(i))->frame);
        left.push_back(kSteps + 1);
        EXPECT_LE(left[0], kSteps / 8) << is_turn;
        for (std::size_t i = 1; i < left.size(); ++i) {
            EXPECT_LE(left[i] - left[i - 1], kSteps / 4) << is_turn << " after " << left[i - 1];
        }
    }
}

// Promise: fusing moves observations over, joins covisibility, and the longer past has the say about the weight.
TEST(Map, FusesDuplicates) {
    MapInMemory map(small(4, 20, 5));
    const Handle<MapPoint> a = add_point(*map), b = add_point(*map);
    map->points().find(a)->seen = 3;
    map->points().find(b)->seen = 8;
    map->points().find(b)->weight_tenths = 17;
    const Handle<Keyframe> one = add_keyframe(*map, 1), two = add_keyframe(*map, 2), both = add_keyframe(*map, 3);
    map->add_observation(one, observation_of(a));
    map->add_observation(two, observation_of(b));
    map->add_observation(both, observation_of(b));
    map->add_observation(both, observation_of(a));
    for (const Handle<Keyframe> keyframe : {one, two, both}) map->attach(keyframe);
    EXPECT_EQ(map->shared(one.slot(), two.slot()), 0U);
    map->fuse(a, b);
    EXPECT_EQ(map->find_fault(), nullptr);
    EXPECT_EQ(map->points().find(b), nullptr);
    EXPECT_EQ(map->shared(one.slot(), two.slot()), 1U);
    EXPECT_EQ(map->shared(two.slot(), both.slot()), 1U);
    EXPECT_EQ(map->points().find(a)->observers, 3U);
    EXPECT_EQ(map->points().find(a)->seen, 11U);
    EXPECT_EQ(map->points().find(a)->weight_tenths, 17U);
    EXPECT_EQ(map->statistics().points_fused, 1U);
}

// Promise: redundant is who sees nothing that three others do not see from as near.
TEST(Map, KnowsRedundantKeyframes) {
    MapInMemory map(small(6, 40, 20));
    std::vector<Handle<Keyframe>> keyframes;
    for (std::uint64_t i = 0; i < 5; ++i) {
        keyframes.push_back(add_keyframe(*map, i + 1));
        map->keyframes().find(keyframes.back())->world_from_camera.translation.z() = -0.5 * static_cast<double>(i);
    }
    for (std::uint32_t i = 0; i < 20; ++i) {
        const Handle<MapPoint> point = add_point(*map);
        map->points().find(point)->world[2] = 2;
        for (std::size_t k = 0; k < 5; ++k) {
            if (k != 4 || i >= 2) map->add_observation(keyframes[k], observation_of(point));
        }
    }
    EXPECT_TRUE(map->is_redundant(keyframes[4])) << "three nearer ones see it all";
    EXPECT_TRUE(map->is_redundant(keyframes[3]));
    EXPECT_FALSE(map->is_redundant(keyframes[0])) << "all others are farther away";
}

// Promise: more observations than features, or on a stale keyframe, are our bug.
TEST(MapDeathTest, ObservationsHaveALimit) {
    MapInMemory map(small(2, 20, 3));
    const Handle<Keyframe> keyframe = map->add_keyframe();
    for (int i = 0; i < 3; ++i) map->add_observation(keyframe, {});
    EXPECT_DEATH(map->add_observation(keyframe, {}), "observations < features_max_");
    EXPECT_DEATH(map->add_observation({}, {}), "found != nullptr");
    EXPECT_EQ(map->observations(keyframe).size(), 3U);
}

// One random life of a map: whatever is done to it, all that is kept incrementally equals what brute force counts, the
// tree hangs together, and what was counted adds up. Returns a hash over the changes.
std::uint64_t live(std::uint64_t seed, const Limits& limits, int steps) {
    MapInMemory map(limits);
    Random random(seed);
    std::uint64_t frame = 1, points_added = 0, keyframes_added = 0;
    const auto some_point = [&]() -> Handle<MapPoint> {
        const std::uint32_t slot = random.below(limits.map_points_max);
        return map->points().is_taken(slot) ? map->points().handle_of(slot) : Handle<MapPoint>{};
    };
    const auto some_keyframe = [&]() -> Handle<Keyframe> {
        const std::uint32_t slot = random.below(limits.keyframes_max);
        return map->keyframes().is_taken(slot) ? map->keyframes().handle_of(slot) : Handle<Keyframe>{};
    };
    std::uint64_t released = 0;
    for (int step = 0; step < steps; ++step) {
        const std::uint32_t what = random.below(100);
        if (what < 30) {
            const auto taken = map->add_point();
            if (taken.is_ok()) {
                ++points_added;
                MapPoint& point = *map->points().find(taken.value());
                EXPECT_EQ(point.seen, 0U) << "something of the tenant before";
                EXPECT_EQ(point.observers, 0U);
                point.last_seen_frame = frame;
                point.seen = static_cast<std::uint16_t>(random.below(2 * MapParameters{}.seen_min + 1));
                point.is_suspect = random.below(4) == 0;
                for (double& w : point.world) w = random.uniform(-2, 2);
            } else {
                EXPECT_TRUE(map->points().is_full());
            }
        } else if (what < 45) {
            ++frame;
            if (map->keyframes().is_full()) {
                std::vector<std::uint8_t> spared(limits.keyframes_max, 0);
                spared[random.below(limits.keyframes_max)] = 1;
                if (random.below(3) == 0) {
                    map->evict_oldest();
                } else if (!map->evict_keyframe(spared)) {
                    EXPECT_TRUE(map->evict_keyframe({}));
                }
            }
            const Handle<Keyframe> keyframe = map->add_keyframe();
            EXPECT_FALSE(keyframe.is_null());
            ++keyframes_added;
            map->keyframes().find(keyframe)->frame = frame;
            map->keyframes().find(keyframe)->last_useful_frame = frame - random.below(3);
            map->keyframes().find(keyframe)->world_from_camera.translation.x() = random.uniform(0, 4);
            for (std::uint32_t i = 0; i < limits.features_max; ++i) {
                map->add_observation(keyframe, observation_of(some_point(), static_cast<float>(i)));
            }
            map->attach(keyframe);
        } else if (what < 60) {
            const Handle<Keyframe> keyframe = some_keyframe();
            const Handle<MapPoint> point = some_point();
            if (!keyframe.is_null() && !point.is_null()) {
                static_cast<void>(map->link(keyframe, random.below(limits.features_max), point));
            }
        } else if (what < 68) {
            const Handle<Keyframe> keyframe = some_keyframe();
            if (!keyframe.is_null()) map->unlink(keyframe, random.below(limits.features_max));
        } else if (what < 76) {
            const Handle<MapPoint> kept = some_point(), gone = some_point();
            if (!kept.is_null() && !gone.is_null() && !(kept == gone)) map->fuse(kept, gone);
        } else if (what < 82) {
            const Handle<MapPoint> point = some_point();
            if (!point.is_null()) {
                map->release_point(point);
                ++released;
                EXPECT_EQ(map->points().find(point), nullptr);
            }
        } else if (what < 87) {
            const Handle<Keyframe> keyframe = some_keyframe();
            if (!keyframe.is_null()) map->release_redundant(keyframe);
        } else if (what < 92) {
            static_cast<void>(map->make_room_for_points(random.below(limits.map_points_max / 3), frame, {}));
        } else if (what < 95) {
            frame += random.below(2 * MapParameters{}.cull_after_frames);
            map->cull_points(frame);
        } else if (what < 96) {
            map->reset();
            points_added = keyframes_added = released = 0;
        } else {
            ++frame;
            for (std::uint32_t slot = 0; slot < limits.map_points_max; ++slot) {
                if (map->points().is_taken(slot) && random.below(2) == 0)
                    map->points().at(slot).last_seen_frame = frame;
            }
        }
        EXPECT_EQ(map->find_fault(), nullptr) << map->find_fault() << " after step " << step << " of kind " << what;
        EXPECT_EQ(map->points().size() + map->points_forgotten() + released, points_added);
        EXPECT_EQ(map->keyframes().size() + map->keyframes_forgotten(), keyframes_added);
        for (std::uint32_t i = 1; i < map->keyframes().size(); ++i) {
            EXPECT_LT(map->keyframes().find(map->recent_keyframe(i))->frame,
                      map->keyframes().find(map->recent_keyframe(i - 1))->frame);
        }
        if (::testing::Test::HasFailure()) return 0;
    }
    return map->changes_hash();
}

// Promise: over long random lives what is kept incrementally equals brute force after every step, and the same life
// leaves the same hash of changes.
TEST(Map, EqualsBruteForce) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
        const Limits limits = small(2 + static_cast<std::uint32_t>(seed) % 5 + (seed == 11 ? 70U : 0U), 30, 12);
        const std::uint64_t first = live(seed, limits, 500);
        ASSERT_FALSE(HasFailure()) << "seed " << seed;
        EXPECT_EQ(live(seed, limits, 500), first) << "seed " << seed;
    }
}

// Promise: the checker finds a planted fault of each kind it can be reached with from outside.
TEST(Map, TheCheckerCanFail) {
    MapInMemory map(small(3, 10, 4));
    const Handle<MapPoint> point = add_point(*map);
    const Handle<Keyframe> a = add_keyframe(*map, 1), b = add_keyframe(*map, 2);
    map->add_observation(a, observation_of(point));
    EXPECT_NE(map->find_fault(), nullptr) << "b has no parent: two roots";
    map->attach(a);
    map->attach(b);
    EXPECT_EQ(map->find_fault(), nullptr);
    map->points().find(point)->observers = 2;
    EXPECT_NE(map->find_fault(), nullptr);
    map->points().find(point)->observers = 1;
    map->points().find(point)->reference = b;
    EXPECT_NE(map->find_fault(), nullptr);
    map->points().find(point)->reference = a;
    map->keyframes().find(a)->parent = b;
    EXPECT_NE(map->find_fault(), nullptr);
}

// Promise: a keyframe's measurement is the mean of the looks at it, a sliding one beyond the most that count; a look at
// what a feature does not show (any more), at one without depth, or from behind changes nothing, nor does one in a
// keyframe that is gone.
TEST(Map, AKeyframesMeasurementIsTheMeanOfItsLooks) {
    MapInMemory map(small(4, 10, 8));
    const Handle<Keyframe> handle = add_keyframe(*map, 1);
    const Handle<MapPoint> point = add_point(*map);
    const Handle<MapPoint> other = add_point(*map);
    Observation seen = observation_of(point);
    seen.normalised_x = 0.125F;
    seen.normalised_y = -0.25F;
    seen.z_m = 2.0F;
    seen.var_z = 1e-4F;
    map->add_observation(handle, seen);
    Observation flat = observation_of(other);
    flat.normalised_x = 0.5F;
    map->add_observation(handle, flat);

    map->average(handle, 0, other, {1, 1, 1});
    map->average(handle, 1, other, {1, 1, 1});
    map->average(handle, 0, point, {1, 1, 0});
    EXPECT_EQ(map->observations(handle)[0].normalised_x, 0.125F);
    EXPECT_EQ(map->observations(handle)[0].looks, 1);
    EXPECT_EQ(map->observations(handle)[1].normalised_x, 0.5F);

    const std::uint32_t before = map->keyframes().find(handle)->observations_changed;
    const Vector3 looks[] = {{0.3, -0.3, 2.4}, {0.2, -0.9, 1.8}, {0.4, -0.4, 2.2}};
    double x = 0.125, y = -0.25, z = 2.0;
    for (const Vector3& look : looks) {
        map->average(handle, 0, point, look);
        x += look.x() / look.z();
        y += look.y() / look.z();
        z += look.z();
    }
    const Observation four = map->observations(handle)[0];
    EXPECT_NEAR(four.normalised_x, x / 4, 1e-6);
    EXPECT_NEAR(four.normalised_y, y / 4, 1e-6);
    EXPECT_NEAR(four.z_m, z / 4, 1e-6);
    EXPECT_EQ(four.looks, 4);
    EXPECT_EQ(map->keyframes().find(handle)->observations_changed, before + 3);

    const std::uint32_t most = map->parameters().looks_max;
    for (std::uint32_t i = 4; i < most; ++i) map->average(handle, 0, point, {0.3, -0.3, 2.4});
    EXPECT_EQ(map->observations(handle)[0].looks, most);
    const double mean_z = static_cast<double>(map->observations(handle)[0].z_m);
    map->average(handle, 0, point, {0, 0, 3});
    EXPECT_EQ(map->observations(handle)[0].looks, most);
    const float sliding_z = map->observations(handle)[0].z_m;
    EXPECT_NEAR(sliding_z, mean_z + (3 - mean_z) / (most + 1), 1e-6);

    map->unlink(handle, 0);
    map->average(handle, 0, point, {9, 9, 9});
    EXPECT_EQ(map->observations(handle)[0].z_m, sliding_z);
    map->release_keyframe(handle);
    map->average(handle, 0, point, {9, 9, 9});
}

// Promise: a map expressed with another readout is the map that would have been made with it: observations carried,
// points and poses moved by what they said they would, and back again.
TEST(Map, IsExpressedWithAnotherReadout) {
    MapInMemory map(small(4, 10, 8));
    Random random(3);
    const Handle<Keyframe> handle = add_keyframe(*map, 1);
    Vector6 speed;
    speed << 0.3, -0.2, 0.1, 0.8, -1.2, 0.5;
    {
        Keyframe& keyframe = *map->keyframes().find(handle);
        keyframe.world_from_camera = se3_exp(speed * 0.3);
        keyframe.speed = speed;
        keyframe.pose_by_readout = speed * 0.01;
    }
    const SE3 pose = map->keyframes().find(handle)->world_from_camera;
    std::vector<Vector3> seen;
    for (int i = 0; i < 8; ++i) {
        const Handle<MapPoint> point = add_point(*map);
        MapPoint& p = *map->points().find(point);
        store(Vector3(0.1 * i, 0.2, 2.0), p.world);
        store(Vector3(0.1 * i, 0.3, 2.0), p.anchor);
        store(Vector3(1.0, 0.5, -0.25), p.world_by_readout);
        store(Vector3(-1.0, 0.0, 0.5), p.anchor_by_readout);
        Observation o = observation_of(point, static_cast<float>(10 * i));
        o.y = static_cast<float>(random.uniform(0, 119));
        o.normalised_x = static_cast<float>(random.uniform(-0.5, 0.5));
        o.normalised_y = static_cast<float>(o.y / 120 - 0.5);
        o.z_m = i == 0 ? 0.0F : 2.0F;
        o.var_z = i == 0 ? -1.0F : 1e-4F;
        map->add_observation(handle, o);
        seen.emplace_back(static_cast<double>(o.normalised_x), static_cast<double>(o.normalised_y), 1.0);
    }
    EXPECT_FALSE(map->carry_observations(handle, 120));
    const std::uint64_t before = map->changes_hash();
    map->express_with_readout(0.02);
    EXPECT_NE(map->changes_hash(), before);
    EXPECT_EQ(map->readout_s(), 0.02);
    for (const Observation& o : map->observations(handle)) {
        const MapPoint& p = *map->points().find(o.point);
        const double x = static_cast<double>(o.x) / 100;
        EXPECT_NEAR(p.world[0], x + 0.02, 1e-7);
        EXPECT_NEAR(p.world[2], 2.0 - 0.005, 1e-7);
        EXPECT_NEAR(p.anchor[0], x - 0.02, 1e-7);
        EXPECT_NEAR(p.anchor[2], 2.01, 1e-7);
    }
    const SE3 expected = pose * se3_exp(speed * (0.01 * 0.02));
    EXPECT_LE((map->keyframes().find(handle)->world_from_camera.translation - expected.translation).norm(), 1e-12);
    EXPECT_TRUE(map->carry_observations(handle, 120));
    EXPECT_FALSE(map->carry_observations(handle, 120));
    for (std::size_t i = 0; i < seen.size(); ++i) {
        const Observation& o = map->observations(handle)[i];
        Vector6 carrying = speed * ((static_cast<double>(o.y) / 120 - 0.5) * 0.02);
        const double z = i == 0 ? 1.0 : 2.0;
        if (i == 0) carrying.head<3>().setZero();
        const Vector3 p = se3_exp(carrying) * (seen[i] * z);
        EXPECT_NEAR(static_cast<double>(o.normalised_x), p.x() / p.z(), 2e-5) << i;
        EXPECT_NEAR(static_cast<double>(o.normalised_y), p.y() / p.z(), 2e-5) << i;
        EXPECT_NEAR(static_cast<double>(o.z_m), i == 0 ? 0.0 : p.z(), 1e-4) << i;
    }
    map->express_with_readout(0.0);
    EXPECT_TRUE(map->carry_observations(handle, 120));
    for (std::size_t i = 0; i < seen.size(); ++i) {
        EXPECT_NEAR(static_cast<double>(map->observations(handle)[i].normalised_x), seen[i].x(), 1e-4) << i;
    }
    EXPECT_LE((map->keyframes().find(handle)->world_from_camera.translation - pose.translation).norm(), 1e-12);
}

Handle<MapPoint> add_point_ahead(Map& map, const Vector3& world = {0, 0, 2}, float made_at_m = 2) {
    const Handle<MapPoint> handle = add_point(map);
    store(world, map.points().find(handle)->world);
    map.points().find(handle)->distance_m = made_at_m;
    return handle;
}

// Promise: what is in view is listed although only a keyframe far away observes it; what is behind, beside, or was made
// from much farther or nearer is not, whoever observes it; the view is as wide as the camera's, and a little more.
TEST(LocalMap, ListsAllThatIsInView) {
    MapInMemory map(small(8, 60, 20));
    test::InMemory<LocalMap> local(small(8, 60, 20));
    const Handle<Keyframe> far = add_keyframe(*map, 1);
    map->keyframes().find(far)->world_from_camera.translation = Vector3(50, 0, 0);
    const Handle<Keyframe> here = add_keyframe(*map, 2);
    struct Case {
        Vector3 world;
        float made_at_m;
        bool is_in_view;
    };
    // Created with a cosine of 0.7: 45.6 degrees, and 5.7 more.
    const Case cases[] = {{{0, 0, 2}, 2, true},    {{0, 0, -2}, 2, false},   {{1.9, 0, 2}, 2, true},
                          {{2.35, 0, 2}, 2, true}, {{2.6, 0, 2}, 2, false},  {{0, -2.6, 2}, 2, false},
                          {{0, 0, 2}, 7, false},   {{0, 0, 2}, 0.6F, false}, {{0, 0, 2}, 6, true},
                          {{0, 0, 2}, 0.7F, true}};
    std::vector<Handle<MapPoint>> points;
    for (const Case& one : cases) {
        points.push_back(add_point_ahead(*map, one.world, one.made_at_m));
        map->add_observation(points.size() % 2 == 0 ? far : here, observation_of(points.back()));
    }
    local->build(*map, SE3{});
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto listed = local->points();
        EXPECT_EQ(std::count(listed.begin(), listed.end(), points[i].slot()), cases[i].is_in_view ? 1 : 0) << i;
    }
}

// Promise: the local map lists points once, new ones at once, never more than its limit, and at most half the
// keyframes.
TEST(LocalMap, ListsPointsOnce) {
    Limits limits = small(8, 60, 20);
    limits.local_points_max = 25;
    MapInMemory map(limits);
    test::InMemory<LocalMap> local(limits);
    ASSERT_EQ(local.used_bytes(), local.planned_bytes());
    std::vector<Handle<MapPoint>> points;
    for (int i = 0; i < 40; ++i) points.push_back(add_point_ahead(*map));
    for (std::uint64_t k = 0; k < 8; ++k) {
        const Handle<Keyframe> keyframe = add_keyframe(*map, k + 1);
        for (std::size_t i = 0; i < 12; ++i) map->add_observation(keyframe, observation_of(points[4 * k + i]));
        map->attach(keyframe);
    }
    local->begin_counting();
    local->count(*map, points[5].slot());
    EXPECT_EQ(local->reference(*map).slot(), 0U);
    EXPECT_TRUE(local->is_stale(*map, SE3{}));
    local->build(*map, SE3{});
    EXPECT_FALSE(local->is_stale(*map, SE3{}));
    std::vector<std::uint32_t> listed(local->points().begin(), local->points().end());
    EXPECT_LE(listed.size(), 25U);
    EXPECT_GE(listed.size(), 20U);
    std::sort(listed.begin(), listed.end());
    EXPECT_EQ(std::adjacent_find(listed.begin(), listed.end()), listed.end());
    EXPECT_LE(std::count(local->keyframes().begin(), local->keyframes().end(), 1), 4);
    EXPECT_EQ(local->keyframes()[7], 1U) << "the newest is always local";
    EXPECT_EQ(local->keyframes()[0], 1U) << "it shares the point of the frame";
    const auto size = local->points().size();
    for (int i = 0; i < 2; ++i) local->add(points[39].slot());
    EXPECT_LE(local->points().size(), std::min<std::size_t>(size + 1, 25));
    SE3 away;
    away.translation.x() = 0.2;
    EXPECT_TRUE(local->is_stale(*map, away));
}

// Promise: where more is in view than the list holds, what the local keyframes observe comes first, the rest in the
// order of the pool; a list says the same however often it was built before, and who is spared is who is listed.
TEST(LocalMap, LocalKeyframesComeFirst) {
    Limits limits = small(8, 60, 20);
    limits.local_points_max = 25;
    MapInMemory map(limits);
    test::InMemory<LocalMap> local(limits);
    std::vector<Handle<MapPoint>> points;
    for (int i = 0; i < 40; ++i) points.push_back(add_point_ahead(*map));
    const Handle<Keyframe> far = add_keyframe(*map, 1);
    map->keyframes().find(far)->world_from_camera.translation = Vector3(50, 0, 0);
    const Handle<Keyframe> here = add_keyframe(*map, 2);
    for (std::size_t i = 0; i < 20; ++i) {
        map->add_observation(far, observation_of(points[i]));
        map->add_observation(here, observation_of(points[20 + i]));
    }
    std::vector<std::uint32_t> expected;
    for (std::size_t i = 20; i < 40; ++i) expected.push_back(points[i].slot());
    for (std::size_t i = 0; i < 5; ++i) expected.push_back(points[i].slot());
    SE3 elsewhere;  // where five other points are in view
    elsewhere.translation.x() = 4;
    for (int i = 0; i < 5; ++i) static_cast<void>(add_point_ahead(*map, {4, 0, 2}));
    for (int round = 0; round < 700; ++round) {  // more than marks have values
        const bool is_crowded = round % 3 != 0;
        local->build(*map, is_crowded ? SE3{} : elsewhere);
        if (!is_crowded) {
            ASSERT_EQ(local->points().size(), 5U);
            continue;
        }
        const std::vector<std::uint32_t> listed(local->points().begin(), local->points().end());
        std::vector<bool> is_listed(60);
        for (const std::uint32_t slot : listed) is_listed[slot] = true;
        for (std::uint32_t slot = 0; slot < 60; ++slot) ASSERT_EQ(local->spared().has(slot), is_listed[slot]) << round;
        ASSERT_EQ(listed, expected) << round;
    }
}

}  // namespace
}  // namespace stillmesh
