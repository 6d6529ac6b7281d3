#include "engine/recognition/recovery.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include "tests/map/map_rig.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::recovery_test {
namespace {

// Promise: where the camera was known the newest keyframes_max keyframes are compared in turn, the newest first; in a
// map from before every keyframe of it, each once a round, and not one after the next.
TEST(Recovery, CandidatesVisitTheMap) {
    for (std::uint32_t count = 1; count <= 40; ++count) {
        test::MapInMemory map(test::small(40, 50, 10));
        for (std::uint32_t i = 0; i < count; ++i) test::add_keyframe(*map, 10 * i);
        for (const std::uint32_t most : {1U, 5U, 16U, 100U}) {
            for (std::uint64_t turn = 0; turn < 120; ++turn) {
                EXPECT_EQ(recovery_candidate(*map, true, turn, most),
                          map->recent_keyframe(static_cast<std::uint32_t>(turn % std::min(count, most))));
            }
        }
        for (std::uint64_t round = 0; round < 3; ++round) {
            std::set<std::uint32_t> visited;
            std::uint64_t before = 0;
            std::uint32_t neighbours = 0;
            for (std::uint64_t turn = 0; turn < count; ++turn) {
                const Handle<Keyframe> candidate = recovery_candidate(*map, false, round * count + turn, 5);
                ASSERT_NE(map->keyframes().find(candidate), nullptr);
                visited.insert(candidate.slot());
                const std::uint64_t frame = map->keyframes().find(candidate)->frame;
                if (turn > 0 && (frame == before + 10 || before == frame + 10)) ++neighbours;
                before = frame;
            }
            EXPECT_EQ(visited.size(), count);
            EXPECT_LE(neighbours, count > 4 && count != 6 ? 0U : count) << count;  // six have no other step
        }
    }
}

// Matches of which some agree with a pose and the others lie anywhere.
class Matches {
public:
    Matches(std::uint32_t right, std::uint32_t wrong, std::uint64_t seed = 1) : random(seed) {
        pose = test::random_motion(random, 1, 0.5);
        correspondences = test::measure_scene(right + wrong, pose, {1e-3, 1e-3, 0}, random);
        for (std::uint32_t i = 0; i < wrong; ++i) {
            correspondences[right + i].p_world =
                pose * test::random_point_in_view(random) + test::random_vector(random, 1);
        }
        chosen = test::all_of(correspondences);
        last_seen.world_from_camera = pose;
    }
    [[nodiscard]] bool propose(const Parameters& parameters, bool is_placed = true) {
        const Result<SE3> proposed =
            propose_recovery(correspondences, chosen, is_placed ? &last_seen : nullptr, parameters, random);
        if (proposed.is_ok()) found = proposed.value();
        return proposed.is_ok();
    }

    Random random;
    SE3 pose, found;
    std::vector<Correspondence> correspondences;
    std::vector<std::uint16_t> chosen;
    LastSeen last_seen;
};

// Promise: a pose on which the matches agree is found among those that do not, as well as they were measured.
TEST(Recovery, FindsThePoseAmongOutliers) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        Matches matches(40, 20, seed);
        ASSERT_TRUE(matches.propose({})) << seed;
        EXPECT_LT(test::metres_between(matches.found, matches.pose), 0.005);
        EXPECT_LT(test::radians_between(matches.found, matches.pose), 0.003);
    }
}

// Promise: what cannot be a place proposes none and leaves the pose alone: fewer than pose.inliers_min that agree, or
// fewer than inlier_share_min of all; exactly.
TEST(Recovery, EnoughMustAgree) {
    struct Case {
        std::uint32_t inliers_min;
        double share_min;
        std::uint32_t right, wrong;
        bool is_found;
    };
    const Case cases[] = {{10, 0.1, 10, 0, true},  {10, 0.1, 9, 0, false},   {9, 0.1, 9, 0, true},
                          {12, 0.1, 12, 3, true},  {12, 0.1, 11, 3, false},  {11, 0.1, 11, 3, true},
                          {8, 0.6, 30, 20, true},  {8, 0.62, 30, 20, false}, {8, 0.5, 30, 30, true},
                          {8, 0.51, 30, 30, false}};
    for (const Case& c : cases) {
        Parameters parameters;
        parameters.pose.inliers_min = c.inliers_min;
        parameters.recovery.inlier_share_min = c.share_min;
        parameters.region.point_chi2_max = 30;  // all that are right agree
        Matches matches(c.right, c.wrong);
        EXPECT_EQ(matches.propose(parameters), c.is_found) << c.right << " of " << c.right + c.wrong;
        EXPECT_EQ(test::metres_between(matches.found, SE3{}) > 0, c.is_found);
    }
}

// Promise: in a map from before, where nothing foretells the camera, kPlacedFactor times as many must agree, and may
// be anywhere.
TEST(Recovery, MoreMustAgreeInAMapFromBefore) {
    for (const std::uint32_t inliers_min : {8U, 12U}) {
        Parameters parameters;
        parameters.pose.inliers_min = inliers_min;
        parameters.region.point_chi2_max = 30;
        Matches few(kPlacedFactor * inliers_min - 1, 0), enough(kPlacedFactor * inliers_min, 0);
        EXPECT_FALSE(few.propose(parameters, false));
        EXPECT_TRUE(few.propose(parameters, true));
        enough.last_seen.world_from_camera.translation += Vector3(100, 0, 0);
        EXPECT_TRUE(enough.propose(parameters, false));
        EXPECT_FALSE(enough.propose(parameters, true));
    }
}

// Promise: the camera is only found where it can have got since it was last measured: reach_m at once and reach_m_s a
// second, and likewise in turning; exactly.
TEST(Recovery, WithinReach) {
    for (const bool is_other : {false, true}) {
        Parameters p;
        if (is_other) {
            p.recovery.reach_m = 0.3;
            p.recovery.reach_m_s = 0.5;
            p.recovery.reach_rad = 0.4;
            p.recovery.reach_rad_s = 0.3;
        }
        for (const double away_s : {0.0, 0.5, 1.0}) {
            const auto is_found = [&](double off_m, double off_rad) {
                Matches matches(60, 0);
                SE3 off;
                off.rotation = so3_exp(Vector3(0, 0.6, 0.8) * off_rad);
                off.translation = Vector3(0.8, 0, -0.6) * off_m;
                matches.last_seen.world_from_camera = matches.pose * off.inverse();
                matches.last_seen.away_s = away_s;
                return matches.propose(p);
            };
            const double end_m = p.recovery.reach_m + p.recovery.reach_m_s * away_s;
            const double end_rad = p.recovery.reach_rad + p.recovery.reach_rad_s * away_s;
            EXPECT_TRUE(is_found(end_m - 0.02, 0));
            EXPECT_FALSE(is_found(end_m + 0.02, 0));
            EXPECT_TRUE(is_found(0, end_rad - 0.02));
            EXPECT_FALSE(is_found(0, end_rad + 0.02));
        }
    }
}

// Promise: how long is searched follows the share of matches expected to be right (pose.inlier_ratio_min), the
// confidence, and pose.final_factor, and ends where pose.coarse_factor says: a poor share needs a long search.
TEST(Recovery, SearchesAsLongAsConfigured) {
    const auto found = [](const Parameters& parameters) {
        int count = 0;
        for (std::uint64_t seed = 1; seed <= 40; ++seed) count += Matches(18, 42, seed).propose(parameters) ? 1 : 0;
        return count;
    };
    Parameters usual;
    usual.recovery.inlier_share_min = 0.2;
    EXPECT_GE(found(usual), 38);
    Parameters hopeful = usual;
    hopeful.pose.inlier_ratio_min = 1;
    hopeful.pose.coarse_factor = 100;
    EXPECT_LE(found(hopeful), 12);
    hopeful.pose.final_factor = 100;
    EXPECT_GE(found(hopeful), 20);
    Parameters brief = usual;
    brief.pose.confidence = 0.5;  // 26 samples
    brief.pose.coarse_factor = 1;
    EXPECT_LE(found(brief), 20) << "1 - (1 - 0.3^3)^26 is a half";
    Parameters careless = usual;
    careless.pose.confidence = 0.5;
    careless.pose.final_factor = 1;
    EXPECT_LE(found(careless), 20);
}

}  // namespace
}  // namespace stillmesh::recovery_test
