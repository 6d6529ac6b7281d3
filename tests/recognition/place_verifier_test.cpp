#include "engine/recognition/place_verifier.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/recognition/places.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kFeatures = 160;

Limits limits_of_test() {
    Limits out = Limits::tiny();
    out.image_width_max = 640;
    out.image_height_max = 480;
    out.features_max = 200;
    out.map_points_max = 1000;
    return out;
}

// A keyframe at a place, and a query of the same features from a camera that stands aside and is turned.
class Verification {
public:
    Verification() : rig(limits_of_test(), Parameters{}) {
        Vector6 xi;
        xi << 0.1, -0.05, 0.08, 0.02, -0.03, 0.05;
        place_from_query_ = se3_exp(xi);
        world_from_place_ = se3_exp((Vector6() << 4, 1, -2, 0.3, 1.2, -0.4).finished());
        Random random(7);
        candidate = rig.map().add_keyframe();
        rig.at(candidate).world_from_camera = world_from_place_;
        rig.at(candidate).frame = 5;
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            const Observation there =
                rig.seen_at(random.uniform(60, 580), random.uniform(50, 430), random.uniform(2, 4));
            const Descriptor descriptor = test::random_descriptor(random);
            Observation o = there;
            o.point = rig.add_point(world_from_place_, there, descriptor);
            rig.map().add_observation(candidate, o, descriptor);
            points.push_back(o.point);
            const auto z = static_cast<double>(there.z_m);
            const Vector3 q = place_from_query_.inverse() * Vector3(static_cast<double>(there.normalised_x) * z,
                                                                    static_cast<double>(there.normalised_y) * z, z);
            Observation here = rig.seen_at(320 + 525 * q.x() / q.z(), 240 + 525 * q.y() / q.z(), q.z());
            query.push_back(here);
            descriptors.push_back(test::disturbed(descriptor, random.below(24), random));
        }
    }
    // Features from `features` on are left out.
    void begin(std::uint32_t features = kFeatures) {
        rig.look_up(candidate);
        verifier().begin_query({descriptors.data(), features});
        for (std::uint32_t i = 0; i < features; ++i) verifier().add_feature(query[i], true);
        words_->find(rig.places.vocabulary(), {descriptors.data(), features});
        verifier().end_query(words_->by_word());
        verifier().start(rig.map(), candidate, {}, {30, 25});
    }
    Refusal finish(std::uint32_t slice_units = 1000) {
        for (;;) {
            WorkBudget budget(slice_units);
            const Progress progress = verifier().step(rig.map(), rig.places.vocabulary(),
                                                      rig.places.database().direct_index(candidate.slot()), budget);
            EXPECT_LE(budget.units_spent(), std::uint64_t{slice_units} + verifier().piece_units_max());
            if (progress != Progress::kWorking) break;
        }
        EXPECT_EQ(verifier().is_accepted(), verifier().refusal() == Refusal::kNone);
        return verifier().refusal();
    }
    Refusal verify(std::uint32_t features = kFeatures) {
        begin(features);
        return finish();
    }
    [[nodiscard]] PlaceVerifier& verifier() { return rig.places.verifier(); }
    [[nodiscard]] double off_m() {
        return (verifier().world_from_query().translation - (world_from_place_ * place_from_query_).translation).norm();
    }

    test::Places rig;
    Handle<Keyframe> candidate;
    std::vector<Handle<MapPoint>> points;
    std::vector<Observation> query;
    std::vector<Descriptor> descriptors;

private:
    SE3 place_from_query_, world_from_place_;
    test::InMemory<FrameWords> words_{kFeatures};
};

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
}  // namespace stillmesh
