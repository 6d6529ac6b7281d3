#include "engine/map/map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/map/eviction.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::map_test {
namespace {

using test::add_keyframe;
using test::add_point;
using test::MapInMemory;
using test::observation_of;
using test::small;

// Promise: a keyframe hangs on the older one that shares most points with it, of equals on the newer; one that returns
// on the one nearest in time of those that share most.
TEST(Map, AKeyframeHangsOnWhatItSharesMostWith) {
    for (const bool is_returned : {false, true}) {
        MapInMemory map(small(8, 60, 40));
        std::vector<Handle<Keyframe>> keyframes;
        const std::uint64_t frames[] = {10, 20, 30, 40, 50};
        for (const std::uint64_t frame : frames) keyframes.push_back(add_keyframe(*map, frame));
        const auto share = [&](std::size_t a, std::size_t b, int points) {
            for (int i = 0; i < points; ++i) {
                const Handle<MapPoint> point = add_point(*map);
                map->add_observation(keyframes[a], observation_of(point));
                map->add_observation(keyframes[b], observation_of(point));
            }
        };
        share(4, 1, 6);
        share(4, 2, 6);
        share(4, 3, 2);
        if (is_returned) {
            map->attach_returned(keyframes[4]);
        } else {
            map->attach(keyframes[4]);
        }
        EXPECT_TRUE(map->keyframes().find(keyframes[4])->parent == keyframes[2]) << is_returned;
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
    EXPECT_EQ(test::find_fault(*map), nullptr);
    EXPECT_EQ(map->points().find(b), nullptr);
    EXPECT_EQ(map->shared(one.slot(), two.slot()), 1U);
    EXPECT_EQ(map->shared(two.slot(), both.slot()), 1U);
    EXPECT_EQ(map->points().find(a)->observers, 3U);
    EXPECT_EQ(map->points().find(a)->seen, 11U);
    EXPECT_EQ(map->points().find(a)->weight_tenths, 17U);
    EXPECT_EQ(map->statistics().points_fused, 1U);
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
                    evict_oldest(*map);
                } else if (!evict_keyframe(*map, spared)) {
                    EXPECT_TRUE(evict_keyframe(*map, {}));
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
            if (!keyframe.is_null()) release_redundant(*map, keyframe);
        } else if (what < 92) {
            static_cast<void>(make_room_for_points(*map, random.below(limits.map_points_max / 3), frame, {}));
        } else if (what < 95) {
            frame += random.below(2 * MapParameters{}.cull_after_frames);
            cull_points(*map, frame);
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
        EXPECT_EQ(test::find_fault(*map), nullptr)
            << test::find_fault(*map) << " after step " << step << " of kind " << what;
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
    EXPECT_NE(test::find_fault(*map), nullptr) << "b has no parent: two roots";
    map->attach(a);
    map->attach(b);
    EXPECT_EQ(test::find_fault(*map), nullptr);
    map->points().find(point)->observers = 2;
    EXPECT_NE(test::find_fault(*map), nullptr);
    map->points().find(point)->observers = 1;
    map->points().find(point)->reference = b;
    EXPECT_NE(test::find_fault(*map), nullptr);
    map->points().find(point)->reference = a;
    map->keyframes().find(a)->parent = b;
    EXPECT_NE(test::find_fault(*map), nullptr);
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
    EXPECT_EQ(map->observations(handle)[0].averaged, 1);
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
    EXPECT_EQ(four.averaged, 4);
    EXPECT_EQ(map->keyframes().find(handle)->observations_changed, before + 3);

    const std::uint32_t most = map->parameters().averaged_max;
    for (std::uint32_t i = 4; i < most; ++i) map->average(handle, 0, point, {0.3, -0.3, 2.4});
    EXPECT_EQ(map->observations(handle)[0].averaged, most);
    const double mean_z = static_cast<double>(map->observations(handle)[0].z_m);
    map->average(handle, 0, point, {0, 0, 3});
    EXPECT_EQ(map->observations(handle)[0].averaged, most);
    const float sliding_z = map->observations(handle)[0].z_m;
    EXPECT_NEAR(sliding_z, mean_z + (3 - mean_z) / (most + 1), 1e-6);

    map->unlink(handle, 0);
    map->average(handle, 0, point, {9, 9, 9});
    EXPECT_EQ(map->observations(handle)[0].z_m, sliding_z);
    map->release_keyframe(handle);
    map->average(handle, 0, point, {9, 9, 9});
}

// Promise: a keyframe that returns and is older than all others becomes the root, above the one that was; one that is
// not hangs on another; there is one root either way.
TEST(Map, TheOldestThatReturnsIsTheRoot) {
    for (const std::uint64_t frame : {10U, 25U, 40U}) {
        MapInMemory map(small(8, 60, 40));
        const Handle<Keyframe> first = add_keyframe(*map, 20);
        map->attach(first);
        const Handle<Keyframe> second = add_keyframe(*map, 30);
        map->attach(second);
        const Handle<Keyframe> returned = add_keyframe(*map, frame);
        map->attach_returned(returned);
        const Keyframe& keyframe = *map->keyframes().find(returned);
        EXPECT_EQ(keyframe.parent.is_null(), frame == 10) << frame;
        EXPECT_TRUE(map->keyframes().find(first)->parent == (frame == 10 ? returned : Handle<Keyframe>{})) << frame;
        EXPECT_EQ(test::find_fault(*map), nullptr) << test::find_fault(*map);
    }
}

// Promise: a map that was reset knows no readout: what comes next is carried as in a new map.
TEST(Map, ResetForgetsTheReadout) {
    MapInMemory map(small(4, 10, 8));
    map->express_with_readout(0.02);
    EXPECT_EQ(map->readout_s(), 0.02);
    map->reset();
    EXPECT_EQ(map->readout_s(), 0);
    const std::uint64_t as_new = map->changes_hash();
    EXPECT_EQ(as_new, MapInMemory(small(4, 10, 8))->changes_hash());
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

}  // namespace
}  // namespace stillmesh::map_test
