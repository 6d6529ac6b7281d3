#include "engine/static_region/group_motions.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/pose/residual.hpp"
#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::group_motions_test {
namespace {

using namespace test;

// A room and a body in groups, ready to be asked for their motions.
struct Rig {
    Rig(std::uint32_t room_points, std::uint32_t body_points, const SE3& motion, Random& random)
        : pose(random_motion(random, 0.5, 0.3)),
          scene(room_and_body(room_points, body_points, pose, motion, random)),
          context(context_at(pose)),
          groups(limits_of(400)),
          scratch(std::size_t{400}) {
        groups->build(scene.correspondences, scene.keypoints, configuration.region, context);
        weighted = all_of(scene.correspondences);
    }
    std::uint32_t fit(Random& random) {
        return motions.fit({scene.correspondences, weighted, *groups, configuration, context, *scratch}, random);
    }
    SE3 pose;
    Scene scene;
    Parameters configuration;
    RegionContext context;
    InMemory<MeshGroups> groups;
    InMemory<FixedVector<std::uint16_t>> scratch;
    std::vector<std::uint16_t> weighted;
    GroupMotions motions;
};

// Promise: a group's own motion is that of its body: the room's is the camera's pose, that of a body which moved is the
// camera's pose as if the body had stood still.
TEST(GroupMotions, EachBodyHasItsOwn) {
    std::size_t bodies = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        SE3 motion;
        motion.translation = random_vector(random, 1.0).normalized() * 0.15;
        Rig rig(150, 100, motion, random);
        static_cast<void>(rig.fit(random));
        for (std::uint16_t group = 0; group < 2; ++group) {  // smaller ones are noisy
            std::size_t count[2] = {0, 0};
            for (std::size_t i = 0; i < rig.scene.body.size(); ++i) {
                if (rig.groups->group_of(i) == group) ++count[rig.scene.body[i]];
            }
            const int body = count[1] > count[0] ? 1 : 0;
            ASSERT_GT(count[body], 30 * count[1 - body]) << "a group of two bodies: seed " << seed;
            const SE3* const found = rig.motions.motion_of(group);
            ASSERT_NE(found, nullptr);
            const SE3 wanted = body == 0 ? rig.pose : motion * rig.pose;
            EXPECT_LT(metres_between(*found, wanted), 0.03) << "seed " << seed;
            EXPECT_LT(radians_between(*found, wanted), 0.02) << "seed " << seed;
            bodies += body == 1 ? 1U : 0U;
        }
        EXPECT_EQ(rig.motions.motion_of(kNoGroup), nullptr);
    }
    EXPECT_EQ(bodies, 20U);
}

// Promise: a group of fewer than region.group_points_min points with a weight has no motion, and hypotheses keep the
// cap of all groups.
TEST(GroupMotions, SmallGroupsHaveNoneAndIterationsAreBounded) {
    Random random(3);
    SE3 motion;
    motion.translation = Vector3(0.2, 0, 0);
    Rig rig(150, 100, motion, random);
    std::vector<std::uint16_t> few;
    for (const std::uint16_t i : rig.weighted) {
        if (rig.groups->group_of(i) == 0 || few.size() < 5) few.push_back(i);
    }
    std::uint32_t of_second = 0;
    for (const std::uint16_t i : few) of_second += rig.groups->group_of(i) == 1 ? 1U : 0U;
    ASSERT_LT(of_second, rig.configuration.region.group_points_min);
    rig.weighted = few;
    static_cast<void>(rig.fit(random));
    EXPECT_NE(rig.motions.motion_of(0), nullptr);
    EXPECT_EQ(rig.motions.motion_of(1), nullptr);
    rig.weighted = all_of(rig.scene.correspondences);
    for (std::uint32_t most = 1; most < 40; ++most) {
        rig.configuration.pose.coarse_total_max = most;
        EXPECT_LE(rig.fit(random), most);
    }
    rig.motions.clear();
    EXPECT_EQ(rig.motions.count(), 0U);
    EXPECT_EQ(rig.motions.motion_of(0), nullptr);
}

// Promise: agreement by its formula: what the residuals are above those of the group's own motion, over what may be
// borne; 1 for a group that nothing is known of, and never outside [0, 1].
TEST(GroupMotions, AgreementByHand) {
    Random random(4);
    Rig rig(200, 0, SE3{}, random);
    static_cast<void>(rig.fit(random));
    ASSERT_NE(rig.motions.motion_of(0), nullptr);
    const RegionParameters& region = rig.configuration.region;
    const SE3 own = rig.motions.motion_of(0)->inverse();
    double mean = 0;
    std::uint32_t weighted = 0;
    for (std::size_t i = 0; i < rig.scene.correspondences.size(); ++i) {
        if (rig.groups->group_of(i) != 0) continue;
        mean += chi2_over_time(rig.scene.correspondences[i], own, rig.configuration);
        ++weighted;
    }
    mean /= weighted;
    for (const double more : {0.0, 0.05, 0.1, 0.5, 5.0}) {
        rig.motions.begin_agreement();
        for (std::uint32_t k = 0; k < weighted; ++k) {
            rig.motions.add_residual(0, mean + more);
            rig.motions.add_residual(kNoGroup, 1000);
        }
        rig.motions.end_agreement(region);
        const double bearable = (10 + 0.1 * weighted) * (mean + 0.5);
        EXPECT_NEAR(rig.motions.agreement_of(0), std::max(1 - weighted * more / bearable, 0.0), 1e-9) << more;
        EXPECT_EQ(rig.motions.agreement_of(kNoGroup), 1.0);
    }
}

}  // namespace
}  // namespace stillmesh::group_motions_test
