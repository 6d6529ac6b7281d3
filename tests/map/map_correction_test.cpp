#include "engine/map/map_correction.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::map_correction_test {
namespace {

using test::add_keyframe;
using test::add_point;
using test::MapInMemory;
using test::observation_of;
using test::small;

constexpr std::uint32_t kKeyframes = 24, kPoints = 120;

SE3 some_motion(Random& random, double reach) {
    Vector6 xi;
    for (int i = 0; i < 6; ++i) xi(i) = random.uniform(-reach, reach);
    return se3_exp(xi);
}

double distance(const SE3& a, const SE3& b) {
    return (a.rotation - b.rotation).norm() + (a.translation - b.translation).norm();
}

void move_no_points(const MapCorrection& correction, Map& map) {
    correction.move_points(map, [](std::uint32_t, const MapPoint&, Vector3&) { return false; });
}

// A map of keyframes anywhere in any tree (a parent may be newer than its child, as after a return from the store, or
// when a parent was forgotten), each of which observes points of its own; some points are observed by none.
class RandomMap {
public:
    explicit RandomMap(std::uint64_t seed)
        : random(seed), map(small(kKeyframes, kPoints, 8)), correction(small(kKeyframes, kPoints, 8)) {
        std::vector<std::uint64_t> frames;
        for (std::uint64_t i = 0; i < kKeyframes; ++i) frames.push_back(10 * i + 5);
        for (std::size_t i = frames.size(); i-- > 1;) {
            std::swap(frames[i], frames[random.below(static_cast<std::uint32_t>(i + 1))]);
        }
        for (const std::uint64_t frame : frames) {
            const Handle<Keyframe> handle = add_keyframe(*map, frame);
            Keyframe& keyframe = *map->keyframes().find(handle);
            keyframe.world_from_camera = some_motion(random, 3);
            if (!handles.empty()) keyframe.parent = handles[random.below(static_cast<std::uint32_t>(handles.size()))];
            handles.push_back(handle);
            for (int i = 0; i < 4; ++i) map->add_observation(handle, observation_of(some_point()));
        }
        for (int i = 0; i < 6; ++i) orphans.push_back(some_point());
        if (seed % 3 == 0) {  // the first may have been hung on its child
            keyframe(0).parent = handles[1];
            keyframe(1).parent = {};
            root = 1;
        }
        EXPECT_EQ(test::find_fault(*map), nullptr) << test::find_fault(*map);
        for (const Handle<Keyframe> handle : handles) before.push_back(pose(handle));
        points_before.resize(kPoints);
        for (std::uint32_t slot = 0; slot < kPoints; ++slot) {
            if (map->points().is_taken(slot)) points_before[slot] = map->points().at(slot);
        }
    }
    [[nodiscard]] const SE3& pose(Handle<Keyframe> handle) { return map->keyframes().find(handle)->world_from_camera; }
    [[nodiscard]] Keyframe& keyframe(std::size_t i) { return *map->keyframes().find(handles[i]); }
    [[nodiscard]] std::size_t index_of(Handle<Keyframe> handle) const {
        return static_cast<std::size_t>(std::find(handles.begin(), handles.end(), handle) - handles.begin());
    }
    // Gives keyframe i a new pose.
    void correct(std::size_t i) { correction->correct(*map, handles[i], before[i], some_motion(random, 3)); }
    // What keyframe i has to move by, said by the tree alone.
    [[nodiscard]] std::optional<SE3> expected(std::size_t i, const std::vector<bool>& is_given,
                                              std::uint64_t first_frame) {
        if (is_given[i]) return *correction->of(handles[i].slot());
        if (keyframe(i).frame < first_frame || keyframe(i).parent.is_null()) return std::nullopt;
        return expected(index_of(keyframe(i).parent), is_given, first_frame);
    }

    Random random;
    MapInMemory map;
    test::InMemory<MapCorrection> correction;
    std::vector<Handle<Keyframe>> handles;
    std::size_t root = 0;
    std::vector<Handle<MapPoint>> orphans;
    std::vector<SE3> before;
    std::vector<MapPoint> points_before;

private:
    Handle<MapPoint> some_point() {
        const Handle<MapPoint> handle = add_point(*map);
        MapPoint& point = *map->points().find(handle);
        for (int i = 0; i < 3; ++i) {
            point.world[i] = random.uniform(-3, 3);
            point.anchor[i] = random.uniform(-3, 3);
            point.world_by_readout[i] = static_cast<float>(random.uniform(-1, 1));
            point.anchor_by_readout[i] = static_cast<float>(random.uniform(-1, 1));
        }
        return handle;
    }
};

// Promise: in any tree, however old parents and children are, what follows moves by exactly what its nearest corrected
// ancestor moves by; what is older than the first that follows, and what hangs below it, stays to the bit.
TEST(MapCorrection, KeyframesFollowTheirNearestCorrectedAncestor) {
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
        RandomMap rig(seed);
        // Between two keyframes, or the frame of one, which follows then.
        const std::uint64_t first_frame =
            seed % 2 == 0 ? 0 : 10 * (rig.random.below(kKeyframes)) + (seed % 4 == 1 ? 5 : 0);
        std::vector<bool> is_given(kKeyframes);
        rig.correction->begin();
        for (std::size_t i = 0; i < kKeyframes; ++i) {
            is_given[i] = rig.random.below(5) == 0;
            if (is_given[i]) rig.correct(i);
        }
        rig.correction->follow(*rig.map, first_frame);
        std::size_t followed = 0;
        for (std::size_t i = 0; i < kKeyframes; ++i) {
            const std::optional<SE3> expected = rig.expected(i, is_given, first_frame);
            const SE3* const moved_by = rig.correction->of(rig.handles[i].slot());
            ASSERT_EQ(moved_by != nullptr, expected.has_value()) << "seed " << seed << ", keyframe " << i;
            const SE3& now = rig.pose(rig.handles[i]);
            if (!expected) {
                EXPECT_EQ(distance(now, rig.before[i]), 0) << "seed " << seed << ", keyframe " << i;
                continue;
            }
            followed += is_given[i] ? 0U : 1U;
            EXPECT_LT(distance(*moved_by, *expected), 1e-12) << "seed " << seed << ", keyframe " << i;
            EXPECT_LT(distance(now, *expected * rig.before[i]), 1e-12) << "seed " << seed << ", keyframe " << i;
        }
        if (first_frame == 0 && is_given[rig.root]) {
            EXPECT_EQ(followed + static_cast<std::size_t>(std::count(is_given.begin(), is_given.end(), true)),
                      kKeyframes)
                << "the root is corrected: all move";
        }
    }
}

// Promise: two ways lead to a child that is older than its parent, a return from the store and a parent that was
// forgotten; when an ancestor of both is corrected, the child goes along with its parent.
TEST(MapCorrection, OlderChildrenGoAlong) {
    for (const bool is_return : {true, false}) {
        MapInMemory map(small(4, 20, 4));
        test::InMemory<MapCorrection> correction(small(4, 20, 4));
        const Handle<MapPoint> shared[2] = {add_point(*map), add_point(*map)};
        const auto make = [&](std::uint64_t frame, std::size_t points) {
            const Handle<Keyframe> handle = add_keyframe(*map, frame);
            for (std::size_t i = 0; i < points; ++i) map->add_observation(handle, observation_of(shared[i]));
            return handle;
        };
        const Handle<Keyframe> root = make(1, 0);
        map->attach(root);
        const Handle<Keyframe> forgotten = make(10, 0);
        map->attach(forgotten);
        const Handle<Keyframe> older = make(20, is_return ? 0 : 2);
        if (is_return) {
            map->release_keyframe(older);
        } else {
            map->attach(older);
            ASSERT_TRUE(map->keyframes().find(older)->parent == forgotten);
        }
        const Handle<Keyframe> newer = make(30, 2);
        map->keyframes().find(newer)->parent = root;
        const Handle<Keyframe> child = is_return ? make(20, 2) : older;
        if (is_return) {
            map->attach_returned(child);
        } else {
            map->release_keyframe(forgotten);
        }
        ASSERT_TRUE(map->keyframes().find(child)->parent == newer);
        ASSERT_EQ(test::find_fault(*map), nullptr);

        SE3 moved;
        moved.translation.y() = 5;
        correction->begin();
        correction->correct(*map, root, SE3{}, moved);
        correction->follow(*map, 0);
        for (const Handle<Keyframe> handle : {root, newer, child}) {
            EXPECT_EQ(map->keyframes().find(handle)->world_from_camera.translation.y(), 5)
                << (is_return ? "returned, " : "parent forgotten, ") << handle.slot();
        }
    }
}

// Promise: nothing is bent. From its reference keyframe's camera a point, its anchor, and what the readout does to
// both look as before; so does one keyframe from another that follows the same; points without a keyframe look as
// before from the newest one. What stays, stays to the bit.
TEST(MapCorrection, WhatMovesTogetherKeepsItsShape) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        RandomMap rig(seed);
        rig.correction->begin();
        std::size_t newest = 0;
        for (std::size_t i = 0; i < kKeyframes; ++i) {
            if (rig.keyframe(i).frame > rig.keyframe(newest).frame) newest = i;
            if (rig.random.below(4) == 0) rig.correct(i);
        }
        rig.correction->follow(*rig.map, 0);
        move_no_points(*rig.correction, *rig.map);
        for (std::uint32_t slot = 0; slot < kPoints; ++slot) {
            if (!rig.map->points().is_taken(slot)) continue;
            const MapPoint& point = rig.map->points().at(slot);
            const MapPoint& was = rig.points_before[slot];
            const std::size_t at = point.reference.is_null() ? newest : rig.index_of(point.reference);
            if (rig.correction->of(rig.handles[at].slot()) == nullptr) {
                for (int i = 0; i < 3; ++i) {
                    EXPECT_EQ(point.world[i], was.world[i]);
                    EXPECT_EQ(point.anchor[i], was.anchor[i]);
                    EXPECT_EQ(point.world_by_readout[i], was.world_by_readout[i]);
                }
                continue;
            }
            const SE3 now = rig.pose(rig.handles[at]).inverse(), then = rig.before[at].inverse();
            const auto seen = [](const SE3& from, const double(&p)[3]) { return Vector3(from * vector_of(p)); };
            const auto turned = [](const SE3& from, const float(&d)[3]) {
                return Vector3(from.rotation * vector_of(d));
            };
            EXPECT_LT((seen(now, point.world) - seen(then, was.world)).norm(), 1e-12) << seed;
            EXPECT_LT((seen(now, point.anchor) - seen(then, was.anchor)).norm(), 1e-12) << seed;
            EXPECT_LT((turned(now, point.world_by_readout) - turned(then, was.world_by_readout)).norm(), 1e-6) << seed;
            EXPECT_LT((turned(now, point.anchor_by_readout) - turned(then, was.anchor_by_readout)).norm(), 1e-6)
                << seed;
        }
        for (std::size_t a = 0; a < kKeyframes; ++a) {
            for (std::size_t b = 0; b < a; ++b) {
                const SE3* const one = rig.correction->of(rig.handles[a].slot());
                const SE3* const other = rig.correction->of(rig.handles[b].slot());
                if (one == nullptr || other == nullptr || distance(*one, *other) > 0) continue;
                const SE3 now = rig.pose(rig.handles[a]).inverse() * rig.pose(rig.handles[b]);
                EXPECT_LT(distance(now, rig.before[a].inverse() * rig.before[b]), 1e-12) << seed;
            }
        }
    }
}

// Promise: where it is known better than by following, a point lies there, its anchor follows; it is asked of the point
// as it was before the map moved, once for each.
TEST(MapCorrection, APointMayBeKnownBetter) {
    RandomMap rig(7);
    rig.correction->begin();
    for (std::size_t i = 0; i < kKeyframes; ++i) rig.correct(i);
    std::vector<int> asked(kPoints);
    const Vector3 aside(1, 2, 3);
    rig.correction->move_points(*rig.map, [&](std::uint32_t slot, const MapPoint& point, Vector3& world) {
        ++asked[slot];
        EXPECT_EQ(vector_of(point.world), vector_of(rig.points_before[slot].world));
        world = vector_of(point.world) + aside;
        return slot % 2 == 0;
    });
    for (std::uint32_t slot = 0; slot < kPoints; ++slot) {
        EXPECT_EQ(asked[slot], rig.map->points().is_taken(slot) ? 1 : 0);
        if (!rig.map->points().is_taken(slot)) continue;
        const MapPoint& point = rig.map->points().at(slot);
        MapPoint followed = rig.points_before[slot];
        const SE3* const of_camera = rig.correction->of_newest(*rig.map);
        ASSERT_NE(of_camera, nullptr);
        move_point(followed, point.reference.is_null() ? *of_camera : *rig.correction->of(point.reference.slot()));
        EXPECT_EQ(vector_of(point.anchor), vector_of(followed.anchor));
        const Vector3 better = vector_of(rig.points_before[slot].world) + aside;
        EXPECT_EQ(vector_of(point.world), slot % 2 == 0 ? better : vector_of(followed.world));
    }
}

// Promise: what was learnt of a keyframe since its problem was made stays: it moves by the difference that the solution
// makes, from where it lies by now.
TEST(MapCorrection, WhatWasLearntMeanwhileStays) {
    RandomMap rig(5);
    const SE3 learnt = some_motion(rig.random, 0.01);
    rig.keyframe(2).world_from_camera = rig.before[2] * learnt;
    const SE3 now = some_motion(rig.random, 3);
    rig.correction->begin();
    rig.correction->correct(*rig.map, rig.handles[2], rig.before[2], now);
    EXPECT_LT(distance(rig.pose(rig.handles[2]), now * learnt), 1e-12);
}

// Promise: begin() forgets the correction before, and a map without keyframes has none.
TEST(MapCorrection, BeginsAnew) {
    RandomMap rig(3);
    rig.correction->begin();
    for (std::size_t i = 0; i < kKeyframes; ++i) rig.correct(i);
    EXPECT_NE(rig.correction->of_newest(*rig.map), nullptr);
    rig.correction->begin();
    for (const Handle<Keyframe> handle : rig.handles) EXPECT_EQ(rig.correction->of(handle.slot()), nullptr);
    const std::vector<MapPoint> points = rig.points_before;
    move_no_points(*rig.correction, *rig.map);
    for (std::uint32_t slot = 0; slot < kPoints; ++slot) {
        if (!rig.map->points().is_taken(slot)) continue;
        EXPECT_EQ(rig.map->points().at(slot).world[0], points[slot].world[0]);
    }
    rig.map->reset();
    EXPECT_EQ(rig.correction->of_newest(*rig.map), nullptr);
}

}  // namespace
}  // namespace stillmesh::map_correction_test
