#include "engine/recognition/place_verifier.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/recognition/verification.hpp"

namespace stillmesh::place_verifier_test {
namespace {

using test::kFeatures;
using test::Verification;

// Promise: a place that is the same is accepted, the camera stands where it stood, and what agrees are the right pairs;
// any slicing gives the same pose.
TEST(PlaceVerifier, FindsTheCameraAtThePlace) {
    Vector3 wanted = Vector3::Zero();
    for (const std::uint32_t slice : {100'000U, 1U, 77U}) {
        Verification v;
        v.begin();
        ASSERT_EQ(v.finish(slice), Refusal::kNone);
        EXPECT_LT(v.off_m(), 0.005);
        EXPECT_GE(v.verifier().inliers(), 90U);  // pairs_max of them at most
        EXPECT_EQ(v.verifier().agreeing().size(), v.verifier().inliers());
        for (const PlaceMatch& match : v.verifier().agreeing()) EXPECT_TRUE(match.point == v.points[match.feature]);
        EXPECT_GT(v.verifier().likeness(v.rig.map()), 0U);
        const Vector3 found = v.verifier().world_from_query().translation;
        if (slice == 100'000U) wanted = found;
        EXPECT_EQ(found, wanted) << slice;
    }
}

// Promise: each reason not to be the place is named: too few look alike, no pose explains them, few agree, all in a
// corner, gone.
TEST(PlaceVerifier, NamesWhyNot) {
    Random random(3);
    Verification few;
    EXPECT_EQ(few.verify(20), Refusal::kFewMatches);

    Verification alike_only;  // the same descriptors in other places
    for (std::uint32_t i = kFeatures; i-- > 1;) std::swap(alike_only.query[i], alike_only.query[random.below(i + 1)]);
    EXPECT_EQ(alike_only.verify(), Refusal::kNoPose);

    Verification half;  // enough for a pose, too few to be believed
    for (std::uint32_t i = 24; i < kFeatures; ++i) {
        half.query[i] = half.rig.seen_at(random.uniform(60, 580), random.uniform(50, 430), random.uniform(1, 6));
    }
    const Refusal refusal = half.verify();
    EXPECT_TRUE(refusal == Refusal::kFewInliers || refusal == Refusal::kNoPose) << static_cast<int>(refusal);
    EXPECT_LT(half.verifier().inliers(), 25U);

    Verification corner;
    std::vector<Observation> kept;
    std::vector<Descriptor> descriptors;
    for (int round = 0; round < 2; ++round) {  // what lies in the corner first, what lies elsewhere looks like nothing
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            const bool is_in_corner = corner.query[i].x < 250 && corner.query[i].y < 480;
            if (is_in_corner != (round == 0)) continue;
            kept.push_back(corner.query[i]);
            descriptors.push_back(round == 0 ? corner.descriptors[i] : test::random_descriptor(random));
        }
    }
    corner.query = kept;
    corner.descriptors = descriptors;
    corner.rig.world.parameters.loop.spread_min = 0.5;
    EXPECT_EQ(corner.verify(), Refusal::kNotSpread);

    Verification gone;
    gone.begin();
    gone.rig.map().release_keyframe(gone.candidate);
    EXPECT_EQ(gone.finish(), Refusal::kGone);
}

// Promise: points that move, and features that are not eligible, take no part.
TEST(PlaceVerifier, OnlyWhatStandsStillCounts) {
    Verification v;
    for (std::uint32_t i = 0; i < 90; ++i) v.rig.map().points().find(v.points[i])->is_suspect = true;
    ASSERT_EQ(v.verify(), Refusal::kNone);
    EXPECT_LE(v.verifier().inliers(), 70U);
    for (const PlaceMatch& match : v.verifier().agreeing()) EXPECT_GE(match.feature, 90U);
    for (std::uint32_t i = 90; i < 135; ++i) v.rig.map().points().find(v.points[i])->is_suspect = true;
    EXPECT_EQ(v.verify(), Refusal::kFewMatches);
}

}  // namespace
}  // namespace stillmesh::place_verifier_test
