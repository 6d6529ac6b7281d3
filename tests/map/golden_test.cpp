// One number over a life of a map and of what lies beside it, as in tests/pose/golden_test.cpp: the models of this room
// ask for one part of it each. Whoever changes what goes or moves changes the number, and says so in the commit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/base/hash.hpp"
#include "engine/map/depth_images.hpp"
#include "engine/map/eviction.hpp"
#include "engine/map/local_map.hpp"
#include "engine/map/map_correction.hpp"
#include "engine/map/map_readout.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/support/map_hash.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::golden_test {
namespace {

constexpr std::uint32_t kFeatures = 40;

// Everything of a room that holds a map, in one block.
struct Life {
    static void plan(ArenaPlan& arena, const Limits& limits, const MapParameters&) {
        Map::plan(arena, limits);
        LocalMap::plan(arena, limits);
        MapCorrection::plan(arena, limits);
        DepthImages::plan(arena, limits);
    }
    void create(Arena& arena, const Limits& limits, const MapParameters& parameters) {
        map.create(arena, limits, parameters);
        local.create(arena, limits);
        correction.create(arena, limits);
        camera.width = 160, camera.height = 120;
        camera.fx = camera.fy = 130;
        camera.cx = 79.5, camera.cy = 59.5;
        images.create(arena, limits, camera);
    }
    Map map;
    LocalMap local;
    MapCorrection correction;
    DepthImages images;
    CameraModel camera;
};

// A keyframe a step farther on, which sees points of those before and new ones.
Handle<Keyframe> add_keyframe(Life& life, std::uint64_t frame, const SE3& pose, Random& random) {
    Map& map = life.map;
    if (map.keyframes().is_full() && !evict_keyframe(map, life.local.keyframes())) return {};
    const Handle<Keyframe> out = test::add_keyframe(map, frame);
    Keyframe& keyframe = *map.keyframes().find(out);
    keyframe.world_from_camera = pose;
    keyframe.time_ns = static_cast<std::int64_t>(frame) * 33'000'000;
    for (int i = 0; i < 6; ++i) keyframe.speed(i) = random.uniform(-1, 1);
    for (int i = 0; i < 6; ++i) keyframe.pose_by_readout(i) = random.uniform(-0.3, 0.3);
    for (std::uint32_t slot = 0; slot < map.points().slots_count(); ++slot) {
        if (!map.points().is_taken(slot) || map.observations(out).size() >= kFeatures - 5) continue;
        const Vector3 p = pose.inverse() * vector_of(map.points().at(slot).world);
        if (p.z() < 0.3 || p.head<2>().norm() > 0.6 * p.z() || random.below(3) == 0) continue;
        Observation o = test::observation_of(map.points().handle_of(slot), 10);
        o.normalised_x = static_cast<float>(p.x() / p.z());
        o.normalised_y = static_cast<float>(p.y() / p.z());
        o.y = static_cast<float>(random.below(120));
        o.z_m = static_cast<float>(p.z());
        o.var_z = random.below(4) == 0 ? -1.0F : 1e-4F;
        map.add_observation(out, o, {});
        map.points().at(slot).last_seen_frame = frame;
        ++map.points().at(slot).seen;
    }
    while (map.observations(out).size() < kFeatures) {
        if (map.points().is_full()) make_room_for_points(map, 20, frame, life.local.spared());
        const auto taken = map.add_point();
        Observation o = test::observation_of(taken.is_ok() ? taken.value() : Handle<MapPoint>{}, 20);
        o.z_m = static_cast<float>(random.uniform(0.5, 4));
        o.var_z = 1e-4F;
        o.normalised_x = static_cast<float>(random.uniform(-0.5, 0.5));
        o.normalised_y = static_cast<float>(random.uniform(-0.4, 0.4));
        o.y = static_cast<float>(random.below(120));
        if (taken.is_ok()) {
            MapPoint& point = *map.points().find(taken.value());
            const auto z = static_cast<double>(o.z_m);
            store(pose * Vector3(static_cast<double>(o.normalised_x) * z, static_cast<double>(o.normalised_y) * z, z),
                  point.world);
            store(vector_of(point.world), point.anchor);
            store(test::random_vector(random, 0.2), point.world_by_readout);
            store(test::random_vector(random, 0.2), point.anchor_by_readout);
            point.distance_m = static_cast<float>(z * random.uniform(0.5, 2));
            point.last_seen_frame = frame;
            point.seen = static_cast<std::uint16_t>(random.below(12));
            point.is_suspect = random.below(8) == 0;
            point.weight_tenths = static_cast<std::uint8_t>(random.below(21));
        }
        map.add_observation(out, o, {});
    }
    random.below(6) == 0 ? map.attach_returned(out) : map.attach(out);
    return out;
}

// Something happens to what is there.
void happen(Life& life, std::uint64_t frame, Random& random) {
    Map& map = life.map;
    const auto keyframes = static_cast<std::uint32_t>(map.keyframes().size());
    const Handle<Keyframe> some = map.recent_keyframe(random.below(keyframes));
    const auto features = static_cast<std::uint32_t>(map.observations(some).size());
    const std::uint32_t index = random.below(features);
    const Handle<MapPoint> seen = map.observations(some)[index].point;
    const std::uint32_t slot = random.below(map.points().slots_count());
    switch (random.below(9)) {
        case 0: map.unlink(some, index); break;
        case 1:
            if (!map.points().is_taken(slot)) break;
            static_cast<void>(map.link(some, index, map.points().handle_of(slot)));
            break;
        case 2:
            if (map.points().find(seen) == nullptr || !map.points().is_taken(slot) || seen.slot() == slot) break;
            static_cast<void>(map.fuse(seen, map.points().handle_of(slot)));
            break;
        case 3: map.average(some, index, seen, test::random_point_in_view(random)); break;
        case 4:
            if (is_redundant(map, some) && keyframes > 4) release_redundant(map, some);
            break;
        case 5: cull_points(map, frame + 20); break;
        case 6:
            map.express_with_readout(random.uniform(0, 0.03));
            static_cast<void>(map.carry_observations(map.recent_keyframe(0), 120));
            break;
        case 7:
            life.correction.begin();
            for (int i = 0; i < 2; ++i) {
                const Handle<Keyframe> moved = map.recent_keyframe(random.below(keyframes));
                const SE3 before = map.keyframes().find(moved)->world_from_camera;
                life.correction.correct(map, moved, before, before * test::random_motion(random, 0.1, 0.1));
            }
            life.correction.follow(map, random.below(2) * frame / 2);
            life.correction.move_points(map);
            life.local.invalidate();
            break;
        default:
            if (keyframes > 8) random.below(2) == 0 ? evict_oldest(map) : map.release_keyframe(some);
    }
}

void add(const Life& life, const SE3& camera, StateHash& hash) {
    for (const std::uint32_t slot : life.local.points()) hash.add(slot);
    for (const std::uint8_t is_local : life.local.keyframes()) hash.add(std::uint32_t{is_local});
    const Handle<Keyframe> reference = life.local.reference(life.map);
    hash.add(reference.is_null() ? 0U : 1U + reference.slot());
    hash.add(life.local.is_stale(life.map, camera) ? 1U : 0U);
    std::vector<KeyframeLink> links(40);
    links.resize(list_covisible(life.map, 3, links));
    for (const KeyframeLink& link : links) hash.add(link.older_id + 1000 * link.newer_id + link.shared_points);
    EngineStatistics s;
    fill_map_statistics(life.map, s);
    for (const std::uint64_t count :
         {s.keyframes_evicted, s.keyframes_redundant, s.points_culled, s.points_fused, s.points_evicted}) {
        hash.add(count);
    }
    for (const PoolStatistics& pool : {s.keyframes, s.map_points}) hash.add(pool.size + 1000 * pool.high_water);
    for (std::uint32_t i = 0; i < 6; ++i) {
        const DepthImage image = life.images.at(i, life.map.keyframes());
        hash.add(image.columns + 100 * image.rows);
        hash.add(image.frame);
        for (const double metres : image.map_from_camera.translation_m) hash.add(metres);
    }
    for (std::uint32_t slot = 0; slot < life.map.points().slots_count(); ++slot) {
        if (!life.map.points().is_taken(slot)) continue;
        const MapPoint& point = life.map.points().at(slot);
        hash.add(std::uint32_t{point.observers});
        hash.add(std::uint32_t{point.seen});
        hash.add(point.agreed_travelled);
    }
    hash.add(life.map.changes_hash());
}

// Promise: what is linked, forgotten, moved and listed is the same to the bit on every processor, compiler and
// optimisation level: with full pools, points that are fused, keyframes that leave or come back, and a map that moves.
TEST(Map, GoldenBits) {
    StateHash hash;
    MapStatistics all;
    for (std::uint32_t seed = 1; seed <= 4; ++seed) {
        Limits limits = test::small(seed == 4 ? 70 : 6 + 5 * seed, 150 + 100 * seed, kFeatures);
        limits.local_points_max = 60 * seed;
        limits.depth_images_max = 6;
        MapParameters parameters;
        parameters.shared_min = 4;
        parameters.near_m = 0.5;
        parameters.redundant_permille = 500;
        test::InMemory<Life> memory(limits, parameters);
        Life& life = *memory;
        Random random(seed);
        SE3 camera;
        for (std::uint64_t i = 0; i < 90; ++i) {
            const std::uint64_t frame = 10 * i + random.below(5);
            camera = camera * test::random_motion(random, 0.15, 0.1);
            const Handle<Keyframe> made = add_keyframe(life, frame, camera, random);
            for (int k = 0; k < 4; ++k) happen(life, frame, random);
            if (!made.is_null() && life.map.keyframes().find(made) != nullptr) {
                const SE3 aside = test::random_motion(random, 0.1, 0.1);
                const auto image =
                    random.below(3) == 0
                        ? life.images.join({made, aside, frame, false}, life.map.keyframes())
                        : life.images.add({made, aside, frame, random.below(2) == 0}, life.map.keyframes());
                std::fill(image.begin(), image.end(), static_cast<std::uint16_t>(i));
            }
            if (i % 30 == 29) life.images.thin(3, life.map.keyframes());
            if (random.below(3) != 0) life.local.begin_counting();
            for (std::uint32_t slot = 0; slot < life.map.points().slots_count(); slot += 1 + random.below(9))
                life.local.count(life.map, slot);
            if (random.below(8) == 0) life.local.keep_counts();
            if (random.below(8) == 0) life.local.restore_counts();
            life.local.note_useful(life.map, frame);
            if (life.local.is_stale(life.map, camera) || random.below(4) == 0) life.local.build(life.map, camera);
            add(life, camera, hash);
            if (i % 10 == 9) hash.add(test::map_hash(life.map, life.camera));
            if (i == 45 && seed == 2) {
                life.map.reset();
                life.local.reset();
                life.images.reset();
            }
        }
        const MapStatistics& s = life.map.statistics();
        all.keyframes_evicted += s.keyframes_evicted, all.keyframes_redundant += s.keyframes_redundant;
        all.points_culled += s.points_culled, all.points_fused += s.points_fused;
        all.points_evicted += s.points_evicted;
    }
    for (const std::uint64_t count :
         {all.keyframes_evicted, all.keyframes_redundant, all.points_culled, all.points_fused, all.points_evicted}) {
        EXPECT_GT(count, 10U);
    }
    EXPECT_EQ(hash.value(), 0xd9ca7e71e08a857fULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
