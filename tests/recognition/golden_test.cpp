// One number over what a lost camera is proposed and how far a map has drifted, as in tests/pose/golden_test.cpp.
// Whoever changes a rule changes the number, and says so in the commit.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/base/hash.hpp"
#include "engine/recognition/map_drift.hpp"
#include "engine/recognition/recovery.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::golden_test {
namespace {

// Promise: where a camera may be by its matches is the same bits on every processor, compiler and optimisation level,
// for the same draws: with few right ones and many, within reach and beyond, in a map of now and of before.
TEST(Recovery, GoldenBits) {
    StateHash hash;
    Random random(1);
    std::uint32_t proposed = 0;
    for (std::uint32_t i = 0; i < 150; ++i) {
        const SE3 pose = test::random_motion(random, 1, 0.5);
        const std::uint32_t count = 4 + random.below(60);
        auto matches = test::measure_scene(count, pose, {1e-3, 1e-3, 1e-3}, random);
        for (Correspondence& c : matches) {
            if (random.below(4) < i % 4) c.p_world = pose * test::random_point_in_view(random);
            c.has_depth = random.below(8) != 0;
        }
        const SE3 off = test::random_motion(random, 0.8, 0.8);
        const LastSeen last_seen{pose * off, random.uniform(0, 0.8)};
        const Result<SE3> place =
            propose_recovery(matches, test::all_of(matches), i % 3 == 0 ? nullptr : &last_seen, Parameters{}, random);
        hash.add(static_cast<std::uint32_t>(place.status()));
        hash.add(random.next());
        if (!place.is_ok()) continue;
        ++proposed;
        for (int k = 0; k < 9; ++k) hash.add(place.value().rotation(k / 3, k % 3));
        for (int k = 0; k < 3; ++k) hash.add(place.value().translation(k));
    }
    EXPECT_GT(proposed, 15U);
    EXPECT_LT(proposed, 120U);
    EXPECT_EQ(hash.value(), 0xbb83ab5a7a40b53cULL) << std::hex << hash.value();
}

// Promise: so is the drift between any two keyframes of any tree, and which keyframe is compared next.
TEST(MapDriftAlone, GoldenBits) {
    StateHash hash;
    Random random(2);
    for (std::uint32_t round = 0; round < 12; ++round) {
        test::MapInMemory map(test::small(24, 900, 40));
        const std::uint32_t count = 2 + random.below(22);
        float drift_m = 0;
        SE3 pose;
        for (std::uint32_t i = 0; i < count; ++i) {
            const Handle<Keyframe> made = test::add_keyframe(*map, 60 * i + random.below(50));
            Keyframe& keyframe = *map->keyframes().find(made);
            pose = pose * test::random_motion(random, 1, 0.5);
            drift_m += static_cast<float>(random.uniform(-0.05, 0.2));
            keyframe.world_from_camera = pose;
            keyframe.drift_m = drift_m;
            const Handle<Keyframe> other = map->recent_keyframe(random.below(i + 1));
            const std::uint32_t shared = random.below(30);
            for (std::uint32_t k = 0; k < shared && other.slot() != made.slot(); ++k) {
                if (k >= map->observations(other).size()) break;
                map->add_observation(made, test::observation_of(map->observations(other)[k].point), {});
            }
            while (map->observations(made).size() < 36)
                map->add_observation(made, test::observation_of(test::add_point(*map)), {});
            map->attach(made);
        }
        for (std::uint32_t a = 0; a < count; ++a)
            for (std::uint32_t b = 0; b < count; ++b) hash.add(drift_between(*map, a, b, LoopParameters{}));
        for (std::uint64_t turn = 0; turn < 40; ++turn) {
            hash.add(recovery_candidate(*map, true, turn, 1 + round).slot());
            hash.add(recovery_candidate(*map, false, turn, 1 + round).slot());
        }
    }
    EXPECT_EQ(hash.value(), 0x138812988189059bULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
