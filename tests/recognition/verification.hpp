// A keyframe at a place, and a query of the same features from a camera that stands aside and is turned: what
// verification is given.
#pragma once

#include <cstdint>
#include <vector>

#include "tests/recognition/places.hpp"

namespace stillmesh::test {

inline constexpr std::uint32_t kFeatures = 160;

inline Limits verification_limits() {
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
    explicit Verification(std::uint64_t seed = 7) : rig(verification_limits(), Parameters{}) {
        Vector6 xi;
        xi << 0.1, -0.05, 0.08, 0.02, -0.03, 0.05;
        place_from_query_ = se3_exp(xi);
        world_from_place_ = se3_exp((Vector6() << 4, 1, -2, 0.3, 1.2, -0.4).finished());
        Random random(seed);
        candidate = rig.map().add_keyframe();
        rig.at(candidate).world_from_camera = world_from_place_;
        rig.at(candidate).frame = 5;
        for (std::uint32_t i = 0; i < kFeatures; ++i) {
            const double x = random.uniform(60, 580);  // one draw a statement: arguments have no order of evaluation
            const double y = random.uniform(50, 430);
            const Observation there = rig.seen_at(x, y, random.uniform(2, 4));
            const Descriptor descriptor = random_descriptor(random);
            Observation o = there;
            o.point = rig.add_point(world_from_place_, there, descriptor);
            rig.map().add_observation(candidate, o, descriptor);
            points.push_back(o.point);
            const auto z = static_cast<double>(there.z_m);
            const Vector3 q = place_from_query_.inverse() * Vector3(static_cast<double>(there.normalised_x) * z,
                                                                    static_cast<double>(there.normalised_y) * z, z);
            Observation here = rig.seen_at(320 + 525 * q.x() / q.z(), 240 + 525 * q.y() / q.z(), q.z());
            query.push_back(here);
            descriptors.push_back(disturbed(descriptor, random.below(24), random));
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

    Places rig;
    Handle<Keyframe> candidate;
    std::vector<Handle<MapPoint>> points;
    std::vector<Observation> query;
    std::vector<Descriptor> descriptors;

private:
    SE3 place_from_query_, world_from_place_;
    InMemory<FrameWords> words_{kFeatures};
};

}  // namespace stillmesh::test
