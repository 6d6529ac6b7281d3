// Two maps in one pool: whether they show the same place, and how one lies in the other.
#include "engine/recognition/map_overlap.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/place/vocabularies.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::map_overlap_test {
namespace {

constexpr std::uint32_t kFeatures = 160;
constexpr double kApart_m = 6;  // of places that look alike

Limits limits_of_test() {
    Limits out = Limits::tiny();
    out.image_width_max = 640;
    out.image_height_max = 480;
    out.features_max = 200;
    out.keyframes_max = 20;
    out.map_points_max = 4000;
    return out;
}

CameraModel camera_of_test() {
    return {.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
}

// Cameras that stand beside each other and see one wall, each with points of its own.
class MapsThatOverlap : public testing::Test {
protected:
    MapsThatOverlap() : bytes_(test::vocabulary_bytes({.branching = 6, .levels = 3, .leaf_percent = 0, .seed = 3})) {
        const char* sentence = nullptr;
        EXPECT_EQ(vocabulary_.open(bytes_, limits_of_test().vocabulary_words_max, sentence), Status::kOk);
        Arena arena(memory_.span());
        places_.create(arena, limits_of_test(), parameters_, camera_of_test(), vocabulary_);
        relocalisation_.create(arena, limits_of_test(), parameters_, places_);
        Random random(7);
        for (Feature& feature : wall_) {
            feature.place = Vector3(random.uniform(-1, 1), random.uniform(-0.8, 0.8), random.uniform(2.4, 3));
            feature.descriptor = test::random_descriptor(random);
        }
        // Turned by some, and a way off: where the second map has its world.
        map_from_other_.rotation = so3_exp(Vector3(0.2, -0.9, 0.1));
        map_from_other_.translation = Vector3(3, -1, 2);
    }
    // A keyframe `step` steps aside, of the map if its place in it is given, which looks like the wall `at_m` farther
    // on; else of the other one.
    void add_keyframe(std::uint32_t step, double at_m, bool is_other) {
        SE3 wall_from_camera;
        wall_from_camera.translation = Vector3(0.06 * step, 0.02 * step, 0);
        SE3 world_from_wall;
        world_from_wall.translation = Vector3(at_m, 0, 0);
        if (is_other) world_from_wall = map_from_other_.inverse() * world_from_wall;
        const Handle<Keyframe> handle = map_->add_keyframe();
        Keyframe& keyframe = *map_->keyframes().find(handle);
        keyframe.world_from_camera = world_from_wall * wall_from_camera;
        keyframe.frame = handle.slot();
        for (const Feature& feature : wall_) {
            const Vector3 q = wall_from_camera.inverse() * feature.place;
            Observation seen;
            seen.normalised_x = static_cast<float>(q.x() / q.z());
            seen.normalised_y = static_cast<float>(q.y() / q.z());
            seen.x = seen.normalised_x * 525.0F + 319.5F;
            seen.y = seen.normalised_y * 525.0F + 239.5F;
            seen.z_m = static_cast<float>(q.z());
            seen.var_z = 1e-4F;
            seen.point = map_->add_point().value();
            MapPoint& point = *map_->points().find(seen.point);
            store(world_from_wall * feature.place, point.world);
            point.descriptor = feature.descriptor;
            point.distance_m = seen.z_m;
            point.weight_tenths = 20;
            point.var_z = point.var_lateral = 1e-4;
            map_->add_observation(handle, seen, point.descriptor);
        }
    }
    void add_map(double at_m = 0) {
        for (std::uint32_t i = 0; i < 3; ++i) add_keyframe(i, at_m, false);
    }
    [[nodiscard]] Overlap overlap_with(std::uint32_t keyframes) {
        const auto slots_of_map = static_cast<std::uint32_t>(map_->keyframes().size());
        for (std::uint32_t i = 0; i < keyframes; ++i) add_keyframe(i, 0, true);
        return MapOverlap(*map_, parameters_, places_, relocalisation_, slots_of_map).find();
    }

    test::InMemory<Map> map_{limits_of_test()};
    SE3 map_from_other_;

private:
    struct Feature {
        Vector3 place;
        Descriptor descriptor;
    };
    [[nodiscard]] static std::size_t planned() {
        ArenaPlan plan;
        PlaceSearch::plan(plan, limits_of_test());
        Relocalisation::plan(plan, limits_of_test());
        return plan.used_bytes();
    }

    Parameters parameters_;
    std::vector<std::byte> bytes_;
    Vocabulary vocabulary_;
    test::Memory memory_{planned()};
    PlaceSearch places_;
    Relocalisation relocalisation_;
    std::vector<Feature> wall_ = std::vector<Feature>(kFeatures);
};

// Promise: maps of one wall overlap, and the motion between both is found to a millimetre and a milliradian.
TEST_F(MapsThatOverlap, TheMotionIsFound) {
    add_map();
    const Overlap overlap = overlap_with(5);
    ASSERT_TRUE(overlap.is_found);
    EXPECT_EQ(overlap.found, 5U);
    EXPECT_EQ(overlap.agreeing, 5U);
    EXPECT_EQ(overlap.elsewhere, 0U);
    const SE3 off = map_from_other_.inverse() * overlap.map_from_other;
    EXPECT_LT(off.translation.norm(), 0.001);
    EXPECT_LT(rotation_angle(off.rotation), 0.001);
    EXPECT_GE(overlap.keyframe.slot(), 3U);
    EXPECT_LT(overlap.place.slot(), 3U);
}

// Promise: fewer keyframes than kAgreeingMin are no proof.
TEST_F(MapsThatOverlap, AFewAreNoProof) {
    add_map();
    const Overlap overlap = overlap_with(MapOverlap::kAgreeingMin - 1);
    EXPECT_EQ(overlap.found, MapOverlap::kAgreeingMin - 1);
    EXPECT_FALSE(overlap.is_found);
}

// Promise: where two places of a map look alike, another map of one of them is not joined to either.
TEST_F(MapsThatOverlap, TwoPlacesThatLookAlikeAreNone) {
    add_map();
    add_map(kApart_m);
    const Overlap overlap = overlap_with(5);
    EXPECT_EQ(overlap.found, 5U);
    EXPECT_GT(overlap.elsewhere, 0U);
    EXPECT_FALSE(overlap.is_found);
}

}  // namespace
}  // namespace stillmesh::map_overlap_test
