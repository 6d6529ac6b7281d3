#include "platform/ros2/map_points.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "tests/persist/map_rig.hpp"

namespace stillmesh::map_points_test {
namespace {

using Place = std::array<double, 3>;

[[nodiscard]] std::vector<Place> static_points(Engine& engine) {
    std::vector<Place> out;
    const Pool<MapPoint>& points = test::map_of(engine).points();
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (!points.is_taken(slot)) continue;
        const MapPoint& point = points.at(slot);
        if (is_static(&point, 5)) out.push_back({point.world[0], point.world[1], point.world[2]});
    }
    std::sort(out.begin(), out.end());
    return out;
}

[[nodiscard]] std::vector<Place> places(const std::vector<ShownPoint>& points) {
    std::vector<Place> out;
    for (const ShownPoint& point : points) out.push_back({point.in_map_m[0], point.in_map_m[1], point.in_map_m[2]});
    std::sort(out.begin(), out.end());
    return out;
}

// Promise: who asks for the map's points gets those that stand still, all of them and to the bit, however the copy was
// cut; nothing is copied for who does not ask, and neither changes what the engine decides.
TEST(MapPoints, AreThoseOfTheMap) {
    const test::Sequence sequence = test::rendered("walking_xyz", 3, 160, 120, 30);
    test::EngineRig alone(Limits::tiny(), sequence.camera);
    test::EngineRig shown(Limits::tiny(), sequence.camera);
    MapPoints points;
    std::string message;
    ASSERT_TRUE(points.open(Limits::tiny(), message)) << message;
    std::vector<ShownPoint> taken;
    points.ask();
    int copies = 0;
    std::size_t compared = 0;
    for (std::size_t i = 0; i < 30; ++i) {
        test::run(*alone, sequence, i, i + 1);
        test::run(*shown, sequence, i, i + 1);
        points.work(*shown, true, i % 2 == 0 ? 5 : 100000);
        EXPECT_EQ(alone->state_hash(), shown->state_hash());
        if (!points.take(taken)) continue;
        ++copies;
        compared += taken.size();
        EXPECT_EQ(places(taken), static_points(*shown)) << "frame " << i;
        EXPECT_FALSE(points.take(taken));
        points.work(*shown, true, 100000);
        EXPECT_FALSE(points.is_copying()) << "nobody asked";
        points.ask();
    }
    EXPECT_GT(copies, 5);
    EXPECT_GT(compared, 500U);
}

// Promise: a copy waits while another is made, and one that the map was taken away from begins anew.
TEST(MapPoints, WaitTheirTurn) {
    const test::Sequence sequence = test::rendered("static_xyz", 3, 160, 120, 6);
    test::EngineRig engine(Limits::tiny(), sequence.camera);
    MapPoints points;
    std::string message;
    ASSERT_TRUE(points.open(Limits::tiny(), message)) << message;
    std::vector<ShownPoint> taken;
    points.ask();
    points.work(*engine, true, 100000);  // no map yet
    EXPECT_FALSE(points.take(taken));
    test::run(*engine, sequence, 0, 3);
    points.work(*engine, false, 100000);
    EXPECT_FALSE(points.is_copying());
    points.work(*engine, true, 0);
    EXPECT_TRUE(points.is_copying());
    engine->reset();
    points.work(*engine, true, 100000);
    EXPECT_FALSE(points.is_copying());
    test::run(*engine, sequence, 0, 6);
    points.work(*engine, true, 100000);
    ASSERT_TRUE(points.take(taken));
    EXPECT_EQ(places(taken), static_points(*engine));
}

}  // namespace
}  // namespace stillmesh::map_points_test
