// The map beside models of it that sort where it counts: small ranges of numbers, so that every tie happens.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <tuple>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/map/eviction.hpp"
#include "engine/map/map.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::map_model_test {
namespace {

using test::add_keyframe;
using test::add_point;
using test::MapInMemory;
using test::observation_of;
using test::small;

std::vector<std::uint64_t> shuffled(std::vector<std::uint64_t> numbers, Random& random) {
    for (std::size_t i = numbers.size(); i > 1; --i)
        std::swap(numbers[i - 1], numbers[random.below(static_cast<std::uint32_t>(i))]);
    return numbers;
}

// A map of keyframes whose frames are in no order, the first frame 0, and points that some of them share.
void fill(Map& map, std::vector<Handle<Keyframe>>& keyframes, std::uint32_t points, Random& random) {
    for (const std::uint64_t frame : shuffled({0, 10, 20, 30, 40, 50, 60, 70}, random))
        keyframes.push_back(add_keyframe(map, frame));
    for (std::uint32_t i = 0; i < points; ++i) {
        const Handle<MapPoint> point = add_point(map);
        for (const Handle<Keyframe> keyframe : keyframes)
            if (random.below(4) == 0) map.add_observation(keyframe, observation_of(point));
    }
}

// Promise: a new keyframe hangs on the older one that shares most with it, of equals on the newest; one that returns on
// whichever shares most, of equals on the nearest in time, of those on the lower slot; the oldest that returns becomes
// the root, and nothing else is moved.
TEST(MapModel, Parents) {
    Random random(1);
    for (int round = 0; round < 300; ++round) {
        MapInMemory map(small(8, 12, 12));
        std::vector<Handle<Keyframe>> keyframes;
        fill(*map, keyframes, 6, random);
        const Handle<Keyframe> one = keyframes[random.below(8)];
        const Handle<Keyframe> root = keyframes[(one.slot() + 1) % 8];
        for (const Handle<Keyframe> other : keyframes)
            if (!(other == one) && !(other == root)) map->keyframes().find(other)->parent = root;
        const std::uint64_t frame = map->keyframes().find(one)->frame;
        const auto before = [&](const Handle<Keyframe>& other) { return map->keyframes().find(other)->frame; };
        const auto shared = [&](const Handle<Keyframe>& other) { return map->shared(one.slot(), other.slot()); };

        std::vector<std::tuple<std::uint32_t, std::uint64_t>> older;                // shared, frame
        std::vector<std::tuple<std::int64_t, std::int64_t, std::uint32_t>> others;  // least first: -shared, gap, slot
        for (const Handle<Keyframe> other : keyframes) {
            if (other == one) continue;
            if (before(other) < frame) older.emplace_back(shared(other), before(other));
            const auto gap = static_cast<std::int64_t>(before(other)) - static_cast<std::int64_t>(frame);
            others.emplace_back(-static_cast<std::int64_t>(shared(other)), std::abs(gap), other.slot());
        }
        map->attach(one);
        const Handle<Keyframe> new_parent = map->keyframes().find(one)->parent;
        ASSERT_EQ(new_parent.is_null(), older.empty());
        if (!older.empty()) {
            ASSERT_EQ(before(new_parent), std::get<1>(*std::max_element(older.begin(), older.end()))) << round;
        }

        map->attach_returned(one);
        const bool is_oldest = frame == 0;
        const std::uint32_t nearest = std::get<2>(*std::min_element(others.begin(), others.end()));
        for (const Handle<Keyframe> other : keyframes) {
            const Handle<Keyframe> parent = map->keyframes().find(other)->parent;
            if (other == one) {
                ASSERT_EQ(parent.is_null(), is_oldest);
                ASSERT_TRUE(is_oldest || parent.slot() == nearest) << round;
            } else if (other == root) {
                ASSERT_TRUE(parent == (is_oldest ? one : Handle<Keyframe>{})) << round;
            } else {
                ASSERT_TRUE(parent == root) << round;
            }
        }
    }
}

// Promise: a keyframe that is alone is the root, new or returned.
TEST(MapModel, ALoneKeyframeIsTheRoot) {
    MapInMemory map(small(2, 4, 4));
    const Handle<Keyframe> alone = add_keyframe(*map, 5);
    for (const bool is_returned : {false, true}) {
        map->keyframes().find(alone)->parent = alone;
        is_returned ? map->attach_returned(alone) : map->attach(alone);
        EXPECT_TRUE(map->keyframes().find(alone)->parent.is_null());
        EXPECT_EQ(test::find_fault(*map), nullptr);
    }
}

// Promise: of two points made one, the longer past has the say about weight and suspicion, and the one that stays where
// both are as long; the seeing of both counts, up to what the number holds; times are the later, or of birth the
// earlier where the one that goes has the say.
TEST(MapModel, FusedPoints) {
    Random random(2);
    for (int round = 0; round < 300; ++round) {
        MapInMemory map(small(4, 20, 5));
        MapPoint was[2];
        Handle<MapPoint> points[2];
        for (int i = 0; i < 2; ++i) {
            points[i] = add_point(*map, random.below(3));
            MapPoint& point = *map->points().find(points[i]);
            point.seen = static_cast<std::uint16_t>((round % 10 == 0 ? 0x7fff : 0) + random.below(3));
            point.weight_tenths = static_cast<std::uint8_t>(random.below(20));
            point.is_suspect = random.below(2) == 0;
            point.created_ns = random.below(3);
            point.agreed_travelled = static_cast<float>(random.below(3));
            was[i] = point;
        }
        map->fuse(points[0], points[1]);
        const MapPoint& is = *map->points().find(points[0]);
        const bool is_longer = was[1].seen > was[0].seen;
        ASSERT_EQ(is.weight_tenths, was[is_longer ? 1 : 0].weight_tenths) << round;
        ASSERT_EQ(is.is_suspect, was[is_longer ? 1 : 0].is_suspect) << round;
        ASSERT_EQ(is.created_ns, is_longer ? std::min(was[0].created_ns, was[1].created_ns) : was[0].created_ns);
        ASSERT_EQ(is.seen, std::min(0xffff, was[0].seen + was[1].seen));
        ASSERT_EQ(is.last_seen_frame, std::max(was[0].last_seen_frame, was[1].last_seen_frame));
        ASSERT_EQ(is.agreed_travelled, std::max(was[0].agreed_travelled, was[1].agreed_travelled));
    }
}

// What goes when room is made for `count`: of each keyframe's points those seen most often, by powers of two, are
// needed, up to its share; then weak before surplus before needed, by when they were last seen.
std::vector<std::uint32_t> going(const Map& map, std::uint32_t count, std::uint64_t frame, const std::uint8_t* spared) {
    const std::uint32_t enough = map.parameters().seen_min;
    const std::uint32_t capacity = map.points().slots_count();
    std::uint32_t staying = 0;
    std::vector<std::tuple<std::uint32_t, int, std::uint32_t>> needed;  // keyframe, -class, slot
    std::vector<std::tuple<int, std::uint64_t, std::uint32_t>> order;   // worth, last seen, slot
    for (std::uint32_t slot = 0; slot < capacity; ++slot) {
        if (!map.points().is_taken(slot)) continue;
        const MapPoint& point = map.points().at(slot);
        const bool is_weak = point.is_suspect || point.seen < enough;
        if (point.last_seen_frame >= frame || (!is_weak && spared[slot] != 0)) {
            ++staying;
            continue;
        }
        order.emplace_back(is_weak ? 0 : 1, point.last_seen_frame, slot);
        int doublings = 0;
        while (doublings < 7 && point.seen >> doublings != 0) ++doublings;
        if (!is_weak && !point.reference.is_null()) needed.emplace_back(point.reference.slot(), -doublings, slot);
    }
    std::sort(needed.begin(), needed.end());
    const std::uint32_t left = capacity - std::min(capacity, staying + count);
    const std::uint32_t each = left / static_cast<std::uint32_t>(std::max<std::size_t>(1, map.keyframes().size()));
    std::vector<std::uint32_t> of_keyframe(map.keyframes().slots_count(), 0);
    for (const auto& [keyframe, doublings, needed_slot] : needed) {
        if (of_keyframe[keyframe]++ >= each) continue;
        for (auto& [worth, seen, slot] : order)
            if (slot == needed_slot) worth = 2;
    }
    std::sort(order.begin(), order.end());
    if (order.size() > count) order.resize(count);
    std::vector<std::uint32_t> out;
    for (const auto& entry : order) out.push_back(std::get<2>(entry));
    std::sort(out.begin(), out.end());
    return out;
}

// Promise: which points go when room is made is what sorting them says, for any pool, any number of places and any
// past.
TEST(MapModel, RoomForPoints) {
    Random random(3);
    for (int round = 0; round < 300; ++round) {
        constexpr std::uint32_t kPoints = 40;
        MapInMemory map(small(4, kPoints, kPoints));
        std::vector<Handle<Keyframe>> keyframes;
        for (std::uint32_t i = 0; i < random.below(5); ++i) keyframes.push_back(add_keyframe(*map, i));
        std::vector<std::uint8_t> marks(kPoints, 0);
        const std::uint32_t points = random.below(2) == 0 ? kPoints : 20 + random.below(20);
        for (std::uint32_t i = 0; i < points; ++i) {
            const Handle<MapPoint> handle = add_point(*map, random.below(6));
            MapPoint& point = *map->points().find(handle);
            point.seen = static_cast<std::uint16_t>(random.below(2U << random.below(10)));
            point.is_suspect = random.below(8) == 0;
            marks[handle.slot()] = random.below(6) == 0 ? 7 : 0;
            if (!keyframes.empty() && random.below(5) != 0) {
                map->add_observation(keyframes[random.below(static_cast<std::uint32_t>(keyframes.size()))],
                                     observation_of(handle));
            }
        }
        const std::uint32_t count = random.below(kPoints);
        const std::vector<std::uint32_t> expected = going(*map, count, 5, marks.data());
        std::vector<bool> was(kPoints);
        for (std::uint32_t slot = 0; slot < kPoints; ++slot) was[slot] = map->points().is_taken(slot);
        ASSERT_EQ(make_room_for_points(*map, count, 5, {marks, 7}), expected.size());
        std::vector<std::uint32_t> gone;
        for (std::uint32_t slot = 0; slot < kPoints; ++slot)
            if (was[slot] && !map->points().is_taken(slot)) gone.push_back(slot);
        ASSERT_EQ(gone, expected) << round;
    }
}

// Promise: a point whose reference keyframe leaves follows the newest of those that still observe it.
TEST(MapModel, ReferencesFollowTheNewest) {
    Random random(4);
    for (int round = 0; round < 200; ++round) {
        MapInMemory map(small(8, 12, 12));
        std::vector<Handle<Keyframe>> keyframes;
        fill(*map, keyframes, 8, random);
        const Handle<Keyframe> leaving = keyframes[random.below(8)];
        std::vector<std::tuple<std::uint32_t, Handle<Keyframe>>> expected;  // point, reference
        for (std::uint32_t slot = 0; slot < 8; ++slot) {
            const MapPoint& point = map->points().at(slot);
            if (point.observers == 0) continue;
            Handle<Keyframe> reference = point.reference;
            std::int64_t newest = -1;
            for (const Handle<Keyframe> other : keyframes) {
                const auto frame = static_cast<std::int64_t>(map->keyframes().find(other)->frame);
                if (!(point.reference == leaving) || other == leaving) continue;
                if (!map->is_observed_by(slot, other.slot()) || frame <= newest) continue;
                newest = frame;
                reference = other;
            }
            expected.emplace_back(slot, reference);
        }
        map->release_keyframe(leaving);
        for (const auto& [slot, reference] : expected) {
            if (reference == leaving) {
                ASSERT_FALSE(map->points().is_taken(slot)) << "nobody else observed it";
            } else {
                ASSERT_TRUE(map->points().at(slot).reference == reference) << round;
            }
        }
    }
}

// Which keyframe goes, said anew: of the least recently useful the newer of the two nearest, or the older where hardly
// anything is left of what it saw.
std::uint32_t going_keyframe(const Map& map, const std::vector<std::uint8_t>& spared) {
    std::vector<std::tuple<std::uint64_t, std::uint32_t>> useful;
    const std::uint32_t newest = map.recent_keyframe(0).slot();
    for (std::uint32_t slot = 0; slot < map.keyframes().slots_count(); ++slot)
        if (slot != newest && spared[slot] == 0) useful.emplace_back(map.keyframes().at(slot).last_useful_frame, slot);
    std::sort(useful.begin(), useful.end());
    const auto x = [&](std::uint32_t slot) { return map.keyframes().at(slot).world_from_camera.translation.x(); };
    const auto proven = [&](std::uint32_t slot) {
        std::uint32_t count = 0;
        for (const Observation& o : map.observations(map.keyframes().handle_of(slot))) {
            const MapPoint* const point = map.points().find(o.point);
            if (point != nullptr && !point->is_suspect && point->seen >= map.parameters().seen_min) ++count;
        }
        return count;
    };
    double least = map.parameters().near_m;
    std::uint32_t older = std::get<1>(useful[0]), newer = older;
    for (const auto& one : useful) {
        for (const auto& two : useful) {
            const std::uint32_t a = std::get<1>(one), b = std::get<1>(two);
            if (map.keyframes().at(a).frame >= map.keyframes().at(b).frame || std::abs(x(a) - x(b)) >= least) continue;
            least = std::abs(x(a) - x(b));
            older = a;
            newer = b;
        }
    }
    return 2 * proven(older) < proven(newer) ? older : newer;
}

// Promise: which keyframe goes from a full pool is what looking at all pairs says.
TEST(MapModel, RoomForAKeyframe) {
    Random random(5);
    for (int round = 0; round < 300; ++round) {
        MapInMemory map(small(8, 40, 8));
        std::vector<Handle<Keyframe>> keyframes;
        std::vector<std::uint8_t> spared(8, 0);
        for (const std::uint64_t frame : shuffled({1, 2, 3, 4, 5, 6, 7, 8}, random)) {
            keyframes.push_back(add_keyframe(*map, frame));
            Keyframe& keyframe = *map->keyframes().find(keyframes.back());
            keyframe.last_useful_frame = random.below(4);
            keyframe.world_from_camera.translation.x() = random.uniform(0, 4 * map->parameters().near_m);
            spared[keyframes.back().slot()] = random.below(4) == 0 ? 1 : 0;
            for (std::uint32_t i = 0; i < random.below(5); ++i) {
                const Handle<MapPoint> point = add_point(*map);
                map->points().find(point)->seen = random.below(3) == 0 ? 1 : 9;
                map->add_observation(keyframes.back(), observation_of(point));
            }
            map->attach(keyframes.back());
        }
        spared[map->recent_keyframe(1).slot()] = 0;
        const std::uint32_t expected = going_keyframe(*map, spared);
        ASSERT_TRUE(evict_keyframe(*map, spared));
        for (std::uint32_t slot = 0; slot < 8; ++slot)
            ASSERT_EQ(map->keyframes().is_taken(slot), slot != expected) << round;
    }
}

// Promise: whoever was seen as often as it takes is not weak, and points are culled after as many frames as it takes
// and one more.
TEST(MapModel, WhenPointsAreCulled) {
    for (const std::uint64_t later : {0U, 1U}) {
        for (const std::uint32_t fewer : {0U, 1U}) {
            MapInMemory map(small(2, 4, 4));
            const Handle<MapPoint> point = add_point(*map, 7);
            map->points().find(point)->seen = static_cast<std::uint16_t>(map->parameters().seen_min - fewer);
            cull_points(*map, 7 + map->parameters().cull_after_frames + later);
            EXPECT_EQ(map->points().find(point) == nullptr, later == 1 && fewer == 1);
        }
    }
}

// Promise: a feature whose depth is exact has a depth, and is averaged; a readout that is the same to a nanosecond is
// the same.
TEST(MapModel, LeastDifferences) {
    MapInMemory map(small(2, 4, 4));
    const Handle<Keyframe> keyframe = add_keyframe(*map, 1);
    const Handle<MapPoint> point = add_point(*map);
    Observation exact = observation_of(point);
    exact.z_m = 2;
    exact.var_z = 0;
    map->add_observation(keyframe, exact);
    map->average(keyframe, 0, point, {0, 0, 4});
    EXPECT_EQ(map->observations(keyframe)[0].z_m, 3);
    map->express_with_readout(0.75e-9);
    EXPECT_FALSE(map->carry_observations(keyframe, 120));
    map->express_with_readout(1.5e-9);
    EXPECT_TRUE(map->carry_observations(keyframe, 120));
}

}  // namespace
}  // namespace stillmesh::map_model_test
