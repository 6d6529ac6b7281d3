// A world whose keyframes are put into the map by hand, with the search for places among them.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/recognition/place_search.hpp"
#include "engine/world/world.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::test {

class Places {
public:
    explicit Places(const Limits& limits, const Parameters& configuration)
        : bytes_(vocabulary_bytes({.branching = 6, .levels = 3, .leaf_percent = 0, .seed = 3})),
          memory_(planned_bytes(limits)) {
        const char* sentence = nullptr;
        EXPECT_EQ(vocabulary_.open(bytes_, limits.vocabulary_words_max, sentence), Status::kOk);
        Arena arena(memory_.span());
        const CameraModel camera = {.width = limits.image_width_max,
                                    .height = limits.image_height_max,
                                    .fx = 525,
                                    .fy = 525,
                                    .cx = 0.5 * limits.image_width_max,
                                    .cy = 0.5 * limits.image_height_max};
        world.create(arena, limits, configuration, camera);
        places.create(arena, limits, world.parameters, world.camera, vocabulary_);
    }
    [[nodiscard]] Map& map() { return world.map; }
    [[nodiscard]] Keyframe& at(Handle<Keyframe> handle) { return *map().keyframes().find(handle); }

    // A static point in front of the camera at `pose`, seen at this pixel, so far away.
    [[nodiscard]] Handle<MapPoint> add_point(const SE3& pose, const Observation& seen, const Descriptor& descriptor) {
        const Handle<MapPoint> handle = map().add_point().value();
        MapPoint& point = *map().points().find(handle);
        const auto z = static_cast<double>(seen.z_m);
        store(pose * Vector3(static_cast<double>(seen.normalised_x) * z, static_cast<double>(seen.normalised_y) * z, z),
              point.world);
        store(vector_of(point.world), point.anchor);
        point.var_z = point.var_lateral = 1e-4;
        point.descriptor = descriptor;
        point.distance_m = seen.z_m;
        point.weight_tenths = 20;
        point.seen = 10;
        return handle;
    }
    // Where the camera sees a pixel, `z_m` away.
    [[nodiscard]] Observation seen_at(double x, double y, double z_m) const {
        Observation out;
        out.x = static_cast<float>(x);
        out.y = static_cast<float>(y);
        out.normalised_x = static_cast<float>((x - world.camera.cx) / world.camera.fx);
        out.normalised_y = static_cast<float>((y - world.camera.cy) / world.camera.fy);
        out.z_m = static_cast<float>(z_m);
        out.var_z = 1e-4F;
        return out;
    }
    // As loop closing does: its words, the query with them, and into the database.
    void look_up(Handle<Keyframe> keyframe) {
        places.find_words(map(), keyframe, world.parameters, places.words());
        places.purge(map());
        places.query().begin(places.database(), places.words().bag());
        WorkBudget budget(1'000'000);
        EXPECT_NE(places.query().step(places.database(), budget), Progress::kWorking);
        places.add(keyframe);
    }

    World world;
    PlaceSearch places;

private:
    static std::size_t planned_bytes(const Limits& limits) {
        ArenaPlan plan;
        World::plan(plan, limits);
        PlaceSearch::plan(plan, limits);
        return plan.used_bytes();
    }
    std::vector<std::byte> bytes_;
    Vocabulary vocabulary_;
    Memory memory_;
};

}  // namespace stillmesh::test
