#include "platform/grid/floor_finder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/grid/synthetic_room.hpp"
#include "tests/support/heap_calls.hpp"

namespace stillmesh::floor_finder_test {
namespace {

using test::camera_at;
using test::SeenRoom;

constexpr double kDegree = 3.14159265358979323846 / 180;

// The floor of what cameras see, the first of which is where the map begins.
Floor floor_of(SeenRoom& room, const std::vector<RigidTransform>& cameras) {
    std::vector<std::vector<std::uint16_t>> images;
    for (const RigidTransform& camera : cameras) images.push_back(room.look(camera));
    const RigidTransform map_from_room = inverse_of(cameras.front());
    FloorFinder finder;
    finder.begin();
    do {
        for (std::size_t i = 0; i < cameras.size(); ++i) {
            finder.add(room.image(images[i]), compose(map_from_room, cameras[i]));
        }
    } while (!finder.end_pass());
    return finder.floor();
}
// How far it leans, and how far it is off at the place under the first camera.
double degrees_off(const Floor& floor, const RigidTransform& first) {
    const double up = rotated(compose(floor.level_from_map, inverse_of(first)), {0, 0, 1})[2];
    return std::acos(std::min(up, 1.0)) / kDegree;
}
double metres_off(const Floor& floor, const RigidTransform& first) {
    return std::abs(transformed(compose(floor.level_from_map, inverse_of(first)), {1.5, 0, 0})[2]);
}

// Promise: a floor is found within a degree and 2 cm from cameras that are held at any angle within 40 degrees of
// upright, at any height, over noise, beside a table larger than what is seen of the floor.
TEST(FloorFinder, FindsTheFloorHoweverTheCameraIsHeld) {
    Random random(3);
    for (int trial = 0; trial < 40; ++trial) {
        SeenRoom room;
        room.noise = 0.002;  // a Kinect has .0014
        room.boxes = {{2.0, 3.2, -1.5, 0.4, 0.70, 0.74}, {4.0, 4.2, -4, 4, 0, 3}};
        const double height = random.uniform(0.5, 1.6);
        std::vector<RigidTransform> cameras;
        const double down = random.uniform(5, 35) * kDegree, roll = random.uniform(-20, 20) * kDegree;
        for (int i = 0; i < 4; ++i) cameras.push_back(camera_at({0.1 * i, 0, height}, 0.1 * i, down, roll));
        const Floor floor = floor_of(room, cameras);
        ASSERT_TRUE(floor.is_known) << trial << " height " << height << " down " << down / kDegree;
        EXPECT_LT(degrees_off(floor, cameras[0]), 1) << trial;
        EXPECT_LT(metres_off(floor, cameras[0]), 0.02) << trial;
    }
}

// Promise: level coordinates are x ahead of the first camera, y to its left, z up, from the floor under it.
TEST(FloorFinder, SaysWhereTheFirstCameraLookedAndStood) {
    SeenRoom room;
    const RigidTransform camera = camera_at({5, -3, 1.2}, 0.7, 0.4);
    const Floor floor = floor_of(room, {camera});
    ASSERT_TRUE(floor.is_known);
    const RigidTransform level_from_room = compose(floor.level_from_map, inverse_of(camera));
    const std::array<double, 3> under = transformed(level_from_room, {5, -3, 0});
    const std::array<double, 3> ahead = rotated(level_from_room, {std::cos(0.7), std::sin(0.7), 0});
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(under[i], 0, 0.01);
    EXPECT_NEAR(ahead[0], 1, 1e-3);
    EXPECT_NEAR(rotated(level_from_room, {-std::sin(0.7), std::cos(0.7), 0})[1], 1, 1e-3);
}

// Promise: what is no floor is none: a wall, a ceiling, a table over a deep hole, a strip too narrow to say how it
// leans, nothing at all.
TEST(FloorFinder, SaysWhenThereIsNone) {
    SeenRoom wall;
    wall.has_floor = false;
    wall.boxes = {{2, 2.2, -5, 5, -5, 5}};
    EXPECT_FALSE(floor_of(wall, {camera_at({0, 0, 1}, 0, 0.2)}).is_known);
    SeenRoom ceiling;
    ceiling.has_floor = false;
    ceiling.boxes = {{-5, 5, -5, 5, 2.0, 2.2}};
    EXPECT_FALSE(floor_of(ceiling, {camera_at({0, 0, 1}, 0, -0.6)}).is_known);
    SeenRoom table;
    table.has_floor = false;  // a slope behind it goes down beyond reach of a level plane
    table.boxes = {{0.6, 1.2, -0.3, 0.3, 0.6, 0.64}, {3, 3.2, -5, 5, -5, 5}};
    EXPECT_FALSE(floor_of(table, {camera_at({0, 0, 1}, 0, 0.35)}).is_known);
    SeenRoom strip;
    strip.has_floor = false;
    strip.boxes = {{0.5, 3, -0.04, 0.04, -0.1, 0}};
    EXPECT_FALSE(floor_of(strip, {camera_at({0, 0, 1}, 0, 0.4)}).is_known);
    SeenRoom nothing;
    nothing.has_floor = false;
    EXPECT_FALSE(floor_of(nothing, {camera_at({0, 0, 1}, 0, 0.4)}).is_known);
}

// Promise: looking for it takes nothing from the heap.
TEST(FloorFinder, AsksForNoMemory) {
    SeenRoom room;
    const RigidTransform camera = camera_at({0, 0, 1}, 0, 0.4);
    const std::vector<std::uint16_t> image = room.look(camera);
    FloorFinder finder;
    const std::uint64_t before = test::heap_calls();
    finder.begin();
    do finder.add(room.image(image), RigidTransform{});
    while (!finder.end_pass());
    EXPECT_EQ(test::heap_calls(), before);
    EXPECT_TRUE(finder.floor().is_known);
}

}  // namespace
}  // namespace stillmesh::floor_finder_test
