#include "engine/map/map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <utility>
#include <vector>

#include "engine/base/hash.hpp"
#include "engine/base/random.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

const test::PrintChecks kPrintChecks;
using MapInMemory = test::InMemory<Map>;

Limits small(std::uint32_t keyframes, std::uint32_t points, std::uint32_t features) {
    Limits limits = Limits::tiny();
    limits.keyframes_max = keyframes;
    limits.map_points_max = points;
    limits.features_max = features;
    return limits;
}

// Promise: a full pool of points says kFull and changes nothing; the least recently seen are forgotten, lower slots
// first, never those seen in the frame at hand; handles to them are stale, others live.
TEST(Map, ForgetsTheLeastRecentlySeen) {
    MapInMemory map(small(4, 10, 8));
    ASSERT_EQ(map.used_bytes(), map.planned_bytes());
    std::vector<Handle<MapPoint>> handles;
    const std::uint64_t seen[10] = {5, 3, 3, 9, 1, 9, 3, 7, 2, 9};
    for (const std::uint64_t frame : seen) {
        const auto taken = map->points().take();
        ASSERT_TRUE(taken.is_ok());
        map->points().find(taken.value())->last_seen_frame = frame;
        handles.push_back(taken.value());
    }
    EXPECT_EQ(map->points().take().status(), Status::kFull);
    EXPECT_EQ(map->points().size(), 10U);
    const auto alive = [&] {
        std::vector<int> out;
        for (int i = 0; i < 10; ++i) {
            if (map->points().find(handles[static_cast<std::size_t>(i)]) != nullptr) out.push_back(i);
        }
        return out;
    };
    map->make_room_for_points(0, 9);
    EXPECT_EQ(alive().size(), 10U);
    map->make_room_for_points(3, 9);  // frames 1, 2 and one of the three seen in 3
    EXPECT_EQ(alive(), (std::vector<int>{0, 2, 3, 5, 6, 7, 9}));
    EXPECT_EQ(map->points_forgotten(), 3U);
    map->make_room_for_points(100, 9);  // more than there are: those of frame 9 stay
    EXPECT_EQ(alive(), (std::vector<int>{3, 5, 9}));
    EXPECT_EQ(map->points_forgotten(), 7U);
    map->make_room_for_points(100, 9);
    EXPECT_EQ(map->points_forgotten(), 7U);
    // What was seen later than the frame asked about stays as well.
    map->points().at(handles[3].slot()).last_seen_frame = 12;
    map->make_room_for_points(100, 10);
    EXPECT_EQ(alive(), (std::vector<int>{3}));
}

// Promise: a full pool of keyframes forgets the oldest; its handle goes stale, its observations with it.
TEST(Map, ForgetsTheOldestKeyframe) {
    MapInMemory map(small(3, 20, 5));
    std::vector<Handle<Keyframe>> handles;
    EXPECT_TRUE(map->recent_keyframe(0).is_null());
    for (std::uint64_t i = 0; i < 11; ++i) {
        handles.push_back(map->add_keyframe());
        map->keyframes().find(handles.back())->frame = 10 * i + 1;
        map->add_observation(handles.back(), {{7, 3}, static_cast<float>(i), 0});
        for (std::size_t age = 0; age < 13; ++age) {
            const Handle<Keyframe> recent = map->recent_keyframe(static_cast<std::uint32_t>(age));
            if (age > i || age >= 3) {
                EXPECT_TRUE(recent.is_null());
            } else {
                EXPECT_EQ(recent, handles[i - age]);
            }
        }
        for (std::size_t k = 0; k <= i; ++k) {
            const bool is_alive = k + 3 > i;
            EXPECT_EQ(map->keyframes().find(handles[k]) != nullptr, is_alive);
            EXPECT_EQ(map->observations(handles[k]).size(), is_alive ? 1U : 0U);
            if (is_alive) {
                EXPECT_EQ(map->observations(handles[k])[0].x, static_cast<float>(k));
            }
        }
    }
    EXPECT_EQ(map->keyframes_forgotten(), 8U);
    EXPECT_EQ(map->keyframes().high_water(), 3U);
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

// The map, as one would write it with the standard library.
struct Model {
    struct Point {
        std::uint64_t last_seen = 0;
        std::uint64_t name = 0;
        bool is_worth_keeping = false;
    };
    struct Frame {
        Handle<Keyframe> handle;
        std::vector<std::pair<std::uint64_t, float>> observations;  // name of the point, x
    };
    std::map<std::uint32_t, Point> points;  // by slot
    std::deque<Frame> keyframes;            // newest first
    std::uint64_t points_forgotten = 0, keyframes_forgotten = 0;
};

// One random life of a map beside its model; returns a hash over everything seen.
std::uint64_t live(std::uint64_t seed, const Limits& limits, int steps) {
    MapInMemory map(limits);
    Model model;
    Random random(seed);
    StateHash hash;
    std::map<std::uint64_t, Handle<MapPoint>> handles;  // of every point ever, by name
    std::uint64_t name = 0, frame = 1;
    for (int step = 0; step < steps; ++step) {
        const std::uint32_t what = random.below(100);
        if (what < 40) {
            const auto taken = map->points().take();
            EXPECT_EQ(taken.is_ok(), model.points.size() < limits.map_points_max);
            if (taken.is_ok()) {
                MapPoint& point = *map->points().find(taken.value());
                EXPECT_EQ(point.seen, 0U) << "something of the tenant before";
                point.last_seen_frame = frame;
                point.created_ns = static_cast<std::int64_t>(name);
                EXPECT_EQ(model.points.count(taken.value().slot()), 0U);
                point.seen = static_cast<std::uint16_t>(random.below(2 * Map::kSeenMin + 1));
                point.is_suspect = random.below(4) == 0;
                model.points[taken.value().slot()] = {frame, name, point.seen >= Map::kSeenMin && !point.is_suspect};
                handles[name++] = taken.value();
                hash.add(taken.value().slot_plus_one);
            }
        } else if (what < 60) {
            ++frame;
            for (auto& [slot, point] : model.points) {
                if (random.below(2) == 0) continue;
                point.last_seen = frame;
                map->points().at(slot).last_seen_frame = frame;
            }
        } else if (what < 75) {
            const std::uint32_t count = random.below(limits.map_points_max / 2 + 1);
            map->make_room_for_points(count, frame);
            std::vector<std::pair<std::uint64_t, std::uint32_t>> old;
            for (const auto& [slot, point] : model.points) {
                if (point.last_seen < frame) old.emplace_back(point.last_seen, slot);
            }
            std::sort(old.begin(), old.end());
            old.resize(std::min<std::size_t>(old.size(), count));
            for (const auto& [seen, slot] : old) model.points.erase(slot);
            model.points_forgotten += old.size();
        } else if (what < 90) {
            ++frame;
            Model::Frame keyframe;
            keyframe.handle = map->add_keyframe();
            map->keyframes().find(keyframe.handle)->frame = frame;
            for (const auto& [slot, point] : model.points) {
                if (keyframe.observations.size() == limits.features_max || random.below(3) == 0) continue;
                keyframe.observations.emplace_back(point.name, static_cast<float>(step));
                map->add_observation(keyframe.handle, {map->points().handle_of(slot), static_cast<float>(step), 0.0F});
            }
            model.keyframes.push_front(keyframe);
            if (model.keyframes.size() > limits.keyframes_max) {
                model.keyframes.pop_back();
                ++model.keyframes_forgotten;
            }
        } else if (what < 95) {
            frame += random.below(2 * Map::kCullAfter_frames);
            map->cull_points(frame);
            for (auto i = model.points.begin(); i != model.points.end();) {
                const bool goes = !i->second.is_worth_keeping && frame - i->second.last_seen > Map::kCullAfter_frames;
                model.points_forgotten += goes ? 1U : 0U;
                i = goes ? model.points.erase(i) : std::next(i);
            }
        } else if (what < 96) {
            map->reset();
            model.points.clear();
            model.keyframes.clear();
            model.points_forgotten = model.keyframes_forgotten = 0;
        }
        // All of it, seen from outside.
        EXPECT_EQ(map->points().size(), model.points.size());
        EXPECT_EQ(map->keyframes().size(), model.keyframes.size());
        EXPECT_EQ(map->points_forgotten(), model.points_forgotten);
        EXPECT_EQ(map->keyframes_forgotten(), model.keyframes_forgotten);
        EXPECT_LE(map->points().high_water(), limits.map_points_max);
        for (std::size_t i = 0; i < model.keyframes.size(); ++i) {
            const Model::Frame& wanted = model.keyframes[i];
            EXPECT_EQ(map->recent_keyframe(static_cast<std::uint32_t>(i)), wanted.handle);
            const auto observations = map->observations(wanted.handle);
            EXPECT_EQ(observations.size(), wanted.observations.size());
            for (std::size_t k = 0; k < std::min(observations.size(), wanted.observations.size()); ++k) {
                const auto& [point_name, x] = wanted.observations[k];
                EXPECT_EQ(observations[k].x, x);
                EXPECT_EQ(observations[k].point, handles[point_name]);
                // An observation never names the next tenant of a slot.
                const MapPoint* const found = map->points().find(observations[k].point);
                const auto there = model.points.find(handles[point_name].slot());
                const bool is_alive = there != model.points.end() && there->second.name == point_name;
                EXPECT_EQ(found != nullptr, is_alive);
                if (found != nullptr) {
                    EXPECT_EQ(found->created_ns, static_cast<std::int64_t>(point_name));
                }
                hash.add(observations[k].point.slot_plus_one);
                hash.add(found != nullptr ? 1U : 0U);
            }
        }
        if (::testing::Test::HasFailure()) return 0;
    }
    return hash.value();
}

// Promise: over long random lives the map does what a model of standard containers does, and does it again.
TEST(Map, EqualsItsModel) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
        const Limits limits = small(2 + static_cast<std::uint32_t>(seed) % 5, 30, 12);
        const std::uint64_t first = live(seed, limits, 600);
        ASSERT_FALSE(HasFailure()) << "seed " << seed;
        EXPECT_EQ(live(seed, limits, 600), first) << "seed " << seed;
    }
}

}  // namespace
}  // namespace stillmesh
