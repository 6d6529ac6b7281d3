#include "engine/map/depth_images.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>

#include "engine/base/random.hpp"
#include "engine/geometry/camera.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::depth_images_test {
namespace {

Limits limits_with(std::uint32_t images) {
    Limits out = Limits::tiny();
    out.depth_images_max = images;
    return out;
}

// Frames of all that are there.
std::set<std::uint64_t> frames_of(const DepthImages& images, const Pool<Keyframe>& keyframes) {
    std::set<std::uint64_t> out;
    for (std::uint32_t i = 0; i < images.owners().size(); ++i) {
        if (images.at(i, keyframes).columns > 0) out.insert(images.at(i, keyframes).frame);
    }
    return out;
}

// Promise: a cell is a square of pixels, all of them in the picture, and its ray is that of its middle.
TEST(DepthImages, RaysAreThoseOfTheCells) {
    test::SmallWorld world(test::small_parameters(), limits_with(2));
    DepthImages& images = world->depth_images;
    EXPECT_EQ(images.cell_px(), 2U);
    EXPECT_EQ(images.columns(), 80U);
    EXPECT_EQ(images.rows(), 60U);
    const Handle<Keyframe> keyframe = world.add_keyframe(SE3{}, 5);
    ASSERT_EQ(images.add({keyframe, SE3{}, 5, false}, world.map().keyframes()).size(), 4800U);
    const DepthImage image = images.at(0, world.map().keyframes());
    ASSERT_EQ(image.rays.size(), 9600U);
    for (std::uint32_t row = 0; row < 60; row += 7) {
        for (std::uint32_t column = 0; column < 80; column += 7) {
            const Vector2 ray = undistort_to_normalised(test::small_camera(), {2 * column + 0.5, 2 * row + 0.5});
            const std::size_t cell = row * 80 + column;
            EXPECT_NEAR(static_cast<double>(image.rays[2 * cell]), ray.x(), 1e-6);
            EXPECT_NEAR(static_cast<double>(image.rays[2 * cell + 1]), ray.y(), 1e-6);
        }
    }
}

// Promise: whatever the size of the picture, there are at most so many columns and rows, no finer cells than needed,
// and all of them lie in the picture.
TEST(DepthImages, AnySizeHasItsCells) {
    ArenaPlan plan;
    DepthImages::plan(plan, limits_with(1));
    for (std::uint32_t side = 60; side < 1000; side += side < 330 ? 1 : 23) {
        for (const bool is_wide : {true, false}) {
            CameraModel camera = test::small_camera();
            camera.width = is_wide ? side : 64;
            camera.height = is_wide ? 48 : side;
            const test::Memory memory(plan.used_bytes());
            Arena arena(memory.span());
            DepthImages images;
            images.create(arena, limits_with(1), camera);
            const std::uint32_t cell = images.cell_px();
            ASSERT_LE(images.columns(), kDepthColumnsMax) << side;
            ASSERT_LE(images.rows(), kDepthRowsMax) << side;
            ASSERT_LE(images.columns() * cell, camera.width);
            ASSERT_LE(images.rows() * cell, camera.height);
            if (cell == 1) continue;
            const bool is_finer_enough =
                camera.width <= (cell - 1) * kDepthColumnsMax && camera.height <= (cell - 1) * kDepthRowsMax;
            EXPECT_FALSE(is_finer_enough) << side;
        }
    }
}

// Promise: an image lies where its keyframe lies now, and goes with it.
TEST(DepthImages, MoveWithTheirKeyframe) {
    test::SmallWorld world(test::small_parameters(), limits_with(2));
    DepthImages& images = world->depth_images;
    const Pool<Keyframe>& keyframes = world.map().keyframes();
    const Handle<Keyframe> keyframe = world.add_keyframe(SE3{}, 5);
    SE3 offset;
    offset.translation = {0.1, 0, 0};
    images.add({keyframe, offset, 9, true}, keyframes)[17] = 1234;
    world[keyframe].world_from_camera.translation = {1, 2, 3};
    const DepthImage image = images.at(0, keyframes);
    EXPECT_EQ(image.frame, 9U);
    EXPECT_EQ(image.depth_mm[17], 1234);
    EXPECT_NEAR(image.map_from_camera.translation_m[0], 1.1, 1e-12);
    EXPECT_EQ(images.at(1, keyframes).columns, 0U);
    EXPECT_EQ(images.at(2, keyframes).columns, 0U);
    world.map().release_keyframe(keyframe);
    EXPECT_EQ(images.at(0, keyframes).columns, 0U);
}

// Promise: full, a later image takes the oldest of its keyframe, a keyframe's the oldest later one, and those of
// keyframes that are gone come first: a camera that stands still forgets nothing of where it was before.
TEST(DepthImages, FullTheyForgetInOrder) {
    test::SmallWorld world(test::small_parameters(), limits_with(4));
    DepthImages& images = world->depth_images;
    const Pool<Keyframe>& keyframes = world.map().keyframes();
    const auto frames = [&] { return frames_of(images, keyframes); };
    const Handle<Keyframe> first = world.add_keyframe(SE3{}, 1), second = world.add_keyframe(SE3{}, 2);
    static_cast<void>(images.add({first, SE3{}, 1, false}, keyframes));
    static_cast<void>(images.add({second, SE3{}, 2, false}, keyframes));
    for (const std::uint64_t frame : {10U, 11U, 12U, 13U})
        static_cast<void>(images.add({second, SE3{}, frame, true}, keyframes));
    // The second keyframe's own went first: what is as old, and of the same place, tells least.
    EXPECT_EQ(frames(), (std::set<std::uint64_t>{1, 11, 12, 13}));
    const Handle<Keyframe> third = world.add_keyframe(SE3{}, 20);
    static_cast<void>(images.add({third, SE3{}, 20, false}, keyframes));
    EXPECT_TRUE(frames().contains(20));
    EXPECT_TRUE(frames().contains(1));
    EXPECT_EQ(frames().size(), 4U);
    world.map().release_keyframe(first);
    static_cast<void>(images.add({third, SE3{}, 21, true}, keyframes));
    EXPECT_TRUE(frames().contains(20) && frames().contains(21) && !frames().contains(1));
    images.reset();
    EXPECT_TRUE(frames().empty());
}

SE3 at_x(double x_m) {
    SE3 out;
    out.translation = {x_m, 0, 0};
    return out;
}

// Promise: where there is no room for what two maps saw, of the two views that are nearest to each other the one goes
// that has a third nearest to it, a keyframe's own or a later one: what one map alone has seen stays. On a line the
// nearest are neighbours, and both ends stay to the last.
TEST(DepthImages, JoinedTheyThinOutWhereTheyAreCrowded) {
    Random random(4);
    for (int round = 0; round < 40; ++round) {
        Limits limits = limits_with(5);
        limits.keyframes_max = 16;
        test::SmallWorld world(test::small_parameters(), limits);
        DepthImages& images = world->depth_images;
        const Pool<Keyframe>& keyframes = world.map().keyframes();
        std::map<double, std::uint64_t> line;  // what is to be there, by place
        const auto leave = [&](std::size_t most) {
            while (line.size() > std::max<std::size_t>(most, 1)) {
                auto nearest = line.begin();
                for (auto at = line.begin(); std::next(at) != line.end(); ++at) {
                    if (std::next(at)->first - at->first < std::next(nearest)->first - nearest->first) nearest = at;
                }
                const auto second = std::next(nearest), behind = std::next(second);
                const double left = nearest == line.begin() ? -9 : std::prev(nearest)->first;
                const double right = behind == line.end() ? 99 : behind->first;
                const double of_first = std::min(nearest->first - left, right - nearest->first);
                const double of_second = std::min(right - second->first, second->first - left);
                if (line.size() == 2) {
                    line.erase(nearest->second < second->second ? nearest : second);
                } else {
                    line.erase(of_first < of_second ? nearest : second);
                }
            }
            if (most == 0) line.clear();
        };
        const auto expected = [&] {
            std::set<std::uint64_t> out;
            for (const auto& [x, frame] : line) out.insert(frame);
            return out;
        };
        for (std::uint64_t frame = 1; frame <= 12; ++frame) {
            // The second half lies apart, as another map's may, and the image off its keyframe.
            const double x = random.uniform() + (frame > 6 ? 0.5 : 0.0);
            const Handle<Keyframe> keyframe = world.add_keyframe(at_x(x + 3), frame);
            static_cast<void>(images.join({keyframe, at_x(-3), frame, random.below(2) == 0}, keyframes));
            line[x] = frame;
            leave(5);
            ASSERT_EQ(frames_of(images, keyframes), expected()) << round << " " << frame;
        }
        for (const std::size_t most : {5U, 2U, 1U, 0U}) {
            images.thin(most, keyframes);
            leave(most);
            EXPECT_EQ(frames_of(images, keyframes), expected()) << round << " " << most;
        }
    }
}

// Promise: without room there is none, and it costs no byte.
TEST(DepthImages, WithoutRoomThereIsNone) {
    ArenaPlan plan;
    DepthImages::plan(plan, Limits::tiny());
    EXPECT_EQ(plan.used_bytes(), 0U);
    test::SmallWorld world;
    EXPECT_FALSE(world->depth_images.is_on());
    EXPECT_EQ(world->depth_images.at(0, world.map().keyframes()).columns, 0U);
}

}  // namespace
}  // namespace stillmesh::depth_images_test
