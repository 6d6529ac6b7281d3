#include "engine/map/eviction.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "tests/map/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::eviction_test {
namespace {

using test::add_keyframe;
using test::add_point;
using test::MapInMemory;
using test::observation_of;
using test::small;

// Promise: a full pool of points says kFull and changes nothing; the least recently seen are forgotten, lower slots
// first, never those seen in the frame at hand nor the spared; handles to them are stale, others live.
TEST(Eviction, ForgetsTheLeastRecentlySeen) {
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
    EXPECT_EQ(make_room_for_points(*map, 0, 9, {}), 0U);
    EXPECT_EQ(alive().size(), 10U);
    std::vector<std::uint8_t> marks(10, 0);
    marks[4] = 7;
    // Frames 1 (spared), 2 and two of the three seen in 3.
    EXPECT_EQ(make_room_for_points(*map, 3, 9, {marks, 7}), 3U);
    EXPECT_EQ(alive(), (std::vector<int>{0, 3, 4, 5, 6, 7, 9}));
    EXPECT_EQ(map->points_forgotten(), 3U);
    EXPECT_EQ(make_room_for_points(*map, 100, 9, {}), 4U);  // more than there are: those of frame 9 stay
    EXPECT_EQ(alive(), (std::vector<int>{3, 5, 9}));
    EXPECT_EQ(map->points_forgotten(), 7U);
    EXPECT_EQ(map->statistics().points_evicted, 7U);
    // What was seen later than the frame asked about stays as well.
    map->points().at(handles[3].slot()).last_seen_frame = 12;
    EXPECT_EQ(make_room_for_points(*map, 100, 11, {}), 2U);
    EXPECT_EQ(alive(), (std::vector<int>{3}));
}

// Promise: points that move or that hardly anybody has seen go before those that were seen long ago, spared or not, but
// not what was seen in the frame at hand.
TEST(Eviction, ForgetsWeakPointsFirst) {
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
        const std::uint32_t went = make_room_for_points(*map, 1, 9, {marks, 7});
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
TEST(Eviction, EachPlaceKeepsItsShare) {
    constexpr std::uint32_t kKeyframes = 9, kSeen = 20, kPoints = 60;
    MapInMemory map(small(kKeyframes, kPoints, kSeen));
    std::vector<std::vector<Handle<MapPoint>>> seen(kKeyframes);
    for (std::uint32_t k = 0; k < kKeyframes; ++k) {
        const std::uint64_t frame = 10 * (k + 1);
        const std::size_t free = kPoints - map->points().size();
        if (free < kSeen) make_room_for_points(*map, static_cast<std::uint32_t>(kSeen - free), frame, {});
        const Handle<Keyframe> keyframe = add_keyframe(*map, frame);
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            seen[k].push_back(add_point(*map, frame));
            map->points().find(seen[k].back())->seen = static_cast<std::uint16_t>(i % 4 == 0 ? 40 : 5);
            map->add_observation(keyframe, observation_of(seen[k].back()), {});
        }
        map->attach(keyframe);
        ASSERT_EQ(test::find_fault(*map), nullptr);
    }
    for (std::uint32_t k = 0; k < kKeyframes; ++k) {
        std::uint32_t alive = 0, often = 0;
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            if (map->points().find(seen[k][i]) == nullptr) continue;
            ++alive;
            often += i % 4 == 0 ? 1U : 0U;
        }
        EXPECT_GE(alive, (kPoints - kSeen) / (kKeyframes - 1)) << k << ": of what was left to those before the last";
        EXPECT_EQ(often, kSeen / 4) << k;
    }
}

// Promise: culling takes what is unseen for a second and weak, in any slices the same.
TEST(Eviction, CullsInSlices) {
    for (const std::uint32_t slice : {1U, 3U, 100U}) {
        MapInMemory map(small(2, 20, 8));
        for (std::uint32_t i = 0; i < 20; ++i) {
            const Handle<MapPoint> handle = add_point(*map, i % 2 == 0 ? 5 : 50);
            map->points().find(handle)->seen = i % 3 == 0 ? 2 : 9;
            map->points().find(handle)->is_suspect = i % 5 == 0;
        }
        std::uint32_t next = 0;
        do {
            next = cull_points(*map, 5 + MapParameters{}.cull_after_frames + 1, next, slice);
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
TEST(Eviction, EvictsByPolicy) {
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
        ASSERT_EQ(test::find_fault(*map), nullptr);
        const std::uint64_t hash = map->changes_hash();
        EXPECT_TRUE(map->add_keyframe().is_null());
        EXPECT_EQ(map->changes_hash(), hash);
        std::vector<std::uint8_t> spared(6, 0);
        spared[0] = 1;
        ASSERT_TRUE(evict_keyframe(*map, spared));
        const std::size_t gone = is_older_empty ? 2 : 3;
        EXPECT_EQ(map->keyframes().find(keyframes[gone]), nullptr);
        EXPECT_EQ(map->points().find(points[gone]), nullptr);
        ASSERT_EQ(test::find_fault(*map), nullptr);
        map->keyframes().find(keyframes[1])->last_useful_frame = 1000;
        ASSERT_TRUE(evict_keyframe(*map, spared));
        EXPECT_EQ(map->keyframes().find(keyframes[is_older_empty ? 3 : 2]), nullptr) << "the least recently useful";
        ASSERT_TRUE(evict_keyframe(*map, {}));
        EXPECT_EQ(map->keyframes().find(keyframes[1]), nullptr) << "nobody is spared: the newer of two neighbours";
        ASSERT_TRUE(evict_keyframe(*map, {}));
        EXPECT_EQ(map->keyframes().find(keyframes[0]), nullptr);
        ASSERT_TRUE(evict_keyframe(*map, {}));
        EXPECT_FALSE(evict_keyframe(*map, {})) << "the newest stays";
        EXPECT_NE(map->keyframes().find(keyframes[5]), nullptr);
        EXPECT_EQ(map->points().size(), 1U);
        EXPECT_EQ(map->statistics().keyframes_evicted, 5U);
        EXPECT_EQ(map->statistics().points_evicted, 5U);
    }
}

// Promise: a way longer than the pool is thinned from all of its length; neither its beginning nor its middle is
// forgotten, and the gaps stay even. Turning on the spot counts as a way, too.
TEST(Eviction, ThinsAWayOut) {
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
                ASSERT_TRUE(evict_keyframe(*map, spared));
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

// Promise: a keyframe is redundant when three others see, from as near, everything that it sees.
TEST(Eviction, KnowsRedundantKeyframes) {
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
    EXPECT_TRUE(is_redundant(*map, keyframes[4])) << "three nearer ones see it all";
    EXPECT_TRUE(is_redundant(*map, keyframes[3]));
    EXPECT_FALSE(is_redundant(*map, keyframes[0])) << "all others are farther away";
}

// Promise: whether a keyframe is redundant is asked of its points that are there and stand still: features whose point
// has left or moves count neither for it nor against it.
TEST(Eviction, RedundancyIsOfWhatStands) {
    for (const bool is_gone : {false, true}) {
        MapInMemory map(small(6, 40, 20));
        std::vector<Handle<Keyframe>> keyframes;
        for (std::uint64_t i = 0; i < 4; ++i) keyframes.push_back(add_keyframe(*map, i + 1));
        std::vector<Handle<MapPoint>> points;
        for (std::uint32_t i = 0; i < 20; ++i) {
            points.push_back(add_point(*map));
            map->points().find(points.back())->world[2] = 2;
            // The last ten are the keyframe's alone.
            for (std::size_t k = 0; k < (i < 10 ? 4U : 1U); ++k)
                map->add_observation(keyframes[k], observation_of(points[i]));
        }
        ASSERT_FALSE(is_redundant(*map, keyframes[0]));
        for (std::size_t i = 10; i < 20; ++i) {
            if (is_gone) {
                map->release_point(points[i]);
            } else {
                map->points().find(points[i])->is_suspect = true;
            }
        }
        EXPECT_TRUE(is_redundant(*map, keyframes[0])) << is_gone;
    }
}

// Promise: three others make a keyframe redundant; it does not speak for itself.
TEST(Eviction, NoKeyframeSpeaksForItself) {
    MapInMemory map(small(6, 40, 20));
    std::vector<Handle<Keyframe>> keyframes;
    for (std::uint64_t i = 0; i < 4; ++i) keyframes.push_back(add_keyframe(*map, i + 1));
    for (std::uint32_t i = 0; i < 20; ++i) {
        const Handle<MapPoint> point = add_point(*map);
        map->points().find(point)->world[2] = 2;
        for (const Handle<Keyframe> keyframe : keyframes) map->add_observation(keyframe, observation_of(point));
    }
    ASSERT_TRUE(is_redundant(*map, keyframes[0]));
    map->keyframes().find(keyframes[3])->world_from_camera.translation.z() = -5;
    EXPECT_FALSE(is_redundant(*map, keyframes[0])) << "one of the three is far away";
}

// Promise: so many of its points (redundant_permille) have to be seen by others for a keyframe to be redundant.
TEST(Eviction, HowMuchMakesAKeyframeRedundant) {
    for (const std::uint32_t permille : {900U, 901U}) {
        const Limits limits = small(6, 40, 20);
        ArenaPlan plan;
        Map::plan(plan, limits);
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        MapParameters parameters;
        parameters.redundant_permille = permille;
        Map map;
        map.create(arena, limits, parameters);
        std::vector<Handle<Keyframe>> keyframes;
        for (std::uint64_t i = 0; i < 4; ++i) keyframes.push_back(add_keyframe(map, i + 1));
        for (std::uint32_t i = 0; i < 20; ++i) {
            const Handle<MapPoint> point = add_point(map);
            map.points().find(point)->world[2] = 2;
            for (std::size_t k = 0; k < 4; ++k) {
                if (k == 0 || i >= 2) map.add_observation(keyframes[k], observation_of(point));
            }
        }
        EXPECT_EQ(is_redundant(map, keyframes[0]), permille == 900) << "18 of 20";
    }
}

}  // namespace
}  // namespace stillmesh::eviction_test
