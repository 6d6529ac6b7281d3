#include "engine/mapping/point_fusion.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>

#include "tests/recognition/places.hpp"

namespace stillmesh {
namespace {

Limits limits_of_test() {
    Limits limits = Limits::tiny();
    limits.image_width_max = 640;
    limits.image_height_max = 480;
    limits.keyframes_max = 24;
    return limits;
}

// A target keyframe at the origin, one feature of which shows `there`, and a point `here` that another keyframe, a
// little aside, saw at the same place of the wall.
class Rig {
public:
    Rig() : places(limits_of_test(), Parameters{}), memory_(planned_bytes()) {
        Arena arena(memory_.span());
        fusion.create(arena, places.world);
        Random random(2);
        descriptor = test::random_descriptor(random);
        source = places.map().add_keyframe();
        places.at(source).frame = 1;
        places.at(source).world_from_camera.translation.x() = 0.1;
        target = places.map().add_keyframe();
        places.at(target).frame = 2;
        const Observation seen = places.seen_at(300, 200, 2);
        there = places.add_point(SE3{}, seen, descriptor);
        add(target, seen, there);
        const Observation from_aside = places.seen_at(300 - 0.1 / 2 * 525, 200, 2);
        here = places.add_point(places.at(source).world_from_camera, from_aside, descriptor);
        add(source, from_aside, here);
        places.map().attach(source);
        places.map().attach(target);
    }
    void add(Handle<Keyframe> keyframe, Observation seen, Handle<MapPoint> point) {
        seen.point = point;
        places.map().add_observation(keyframe, seen, descriptor);
    }
    [[nodiscard]] MapPoint* find(Handle<MapPoint> point) { return places.map().points().find(point); }
    [[nodiscard]] MapPoint& at(Handle<MapPoint> point) { return *find(point); }
    // `here` into the target.
    void fuse() {
        const std::uint32_t units = fusion.fuse_into(here, target);
        EXPECT_LE(units, PointFusion::units_max(limits_of_test()) + limits_of_test().features_max / 8 + 1);
        EXPECT_EQ(places.map().find_fault(), nullptr) << places.map().find_fault();
    }
    [[nodiscard]] bool is_seen(Handle<MapPoint> point, Handle<Keyframe> keyframe) {
        return places.map().is_observed_by(point.slot(), keyframe.slot());
    }

    test::Places places;
    PointFusion fusion;
    Handle<Keyframe> source, target;
    Handle<MapPoint> there, here;
    Descriptor descriptor;

private:
    static std::size_t planned_bytes() {
        ArenaPlan plan;
        PointFusion::plan(plan, limits_of_test());
        return plan.used_bytes();
    }
    test::Memory memory_;
};

// Promise: two points at one place become one, that which more keyframes observe, or the older of equals; it is seen by
// the keyframes of both.
TEST(PointFusion, TheSamePlaceTwiceBecomesOne) {
    for (const bool is_here_older : {true, false}) {
        Rig rig;
        rig.at(rig.here).created_ns = is_here_older ? 1 : 3;
        rig.at(rig.there).created_ns = 2;
        rig.fuse();
        const Handle<MapPoint> kept = is_here_older ? rig.here : rig.there;
        EXPECT_EQ(rig.find(is_here_older ? rig.there : rig.here), nullptr);
        ASSERT_NE(rig.find(kept), nullptr);
        EXPECT_TRUE(rig.is_seen(kept, rig.source));
        EXPECT_TRUE(rig.is_seen(kept, rig.target));
    }
    Rig more;
    more.at(more.here).created_ns = 1;
    more.at(more.there).created_ns = 2;
    const Handle<Keyframe> third = more.places.map().add_keyframe();
    more.places.at(third).frame = 3;
    more.add(third, more.places.seen_at(300, 200, 2), more.there);
    more.places.map().attach(third);
    more.fuse();
    EXPECT_NE(more.find(more.there), nullptr) << "two keyframes observe it";
    EXPECT_EQ(more.find(more.here), nullptr);
}

// Promise: a feature that looks like the point and shows none shows it from then on.
TEST(PointFusion, AMissedObservationIsFound) {
    Rig rig;
    rig.places.map().unlink(rig.target, 0);
    rig.places.map().release_point(rig.there);
    EXPECT_EQ(rig.fusion.observations_found(), 0U);
    rig.fuse();
    EXPECT_TRUE(rig.is_seen(rig.here, rig.target));
    EXPECT_EQ(rig.fusion.observations_found(), 1U);
    rig.fuse();
    EXPECT_EQ(rig.fusion.observations_found(), 1U) << "it is there";
    rig.fusion.reset();
    EXPECT_EQ(rig.fusion.observations_found(), 0U);
}

// Promise: what lies elsewhere, looks otherwise, moves, is out of view or behind the camera, and what would take too
// long, stays two points.
TEST(PointFusion, OtherPointsStayTwo) {
    const auto stays = [](const char* why, const std::function<void(Rig&)>& change) {
        Rig rig;
        change(rig);
        rig.fuse();
        EXPECT_NE(rig.find(rig.here), nullptr) << why;
        EXPECT_NE(rig.find(rig.there), nullptr) << why;
        EXPECT_FALSE(rig.is_seen(rig.here, rig.target)) << why;
    };
    stays("farther away", [](Rig& rig) { rig.at(rig.here).world[2] += 0.5; });
    stays("beside it", [](Rig& rig) { rig.at(rig.here).world[0] += 0.5; });
    stays("the other is known to lie elsewhere", [](Rig& rig) { rig.at(rig.there).world[0] += 0.2; });
    stays("looks otherwise", [](Rig& rig) {
        for (std::uint64_t& word : rig.at(rig.here).descriptor.words) word = ~word;
    });
    stays("moves", [](Rig& rig) { rig.at(rig.here).is_suspect = true; });
    stays("the other moves", [](Rig& rig) { rig.at(rig.there).is_suspect = true; });
    stays("out of view", [](Rig& rig) { rig.at(rig.here).world[0] += 3; });
    stays("behind", [](Rig& rig) { rig.at(rig.here).world[2] = -2; });
    stays("another scale", [](Rig& rig) { rig.at(rig.here).distance_m = 20; });
    stays("many observers", [](Rig& rig) {
        rig.at(rig.there).created_ns = -1;  // it would stay
        for (std::uint64_t i = 0; i < 17; ++i) {
            const Handle<Keyframe> keyframe = rig.places.map().add_keyframe();
            rig.places.at(keyframe).frame = 10 + i;
            rig.add(keyframe, rig.places.seen_at(300, 200, 2), rig.here);
            rig.add(keyframe, rig.places.seen_at(310, 200, 2), rig.there);
            rig.places.map().attach(keyframe);
        }
    });
}

// Promise: a keyframe or a point that has left is passed over.
TEST(PointFusion, WhatLeftIsPassedOver) {
    Rig rig;
    rig.places.map().release_keyframe(rig.target);
    rig.fuse();
    EXPECT_NE(rig.find(rig.here), nullptr);
    Rig gone;
    gone.places.map().release_point(gone.here);
    gone.fuse();
    EXPECT_NE(gone.find(gone.there), nullptr);
}

}  // namespace
}  // namespace stillmesh
