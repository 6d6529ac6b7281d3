// What people and other programs see of a map, against the engine that made it.
#include "platform/record/map_content.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/persist/map_rig.hpp"

namespace stillmesh::map_content_test {
namespace {

using test::Bytes;
using test::EngineRig;

struct MapContentTest : testing::Test {
    static void SetUpTestSuite() {
        const test::Sequence sequence = test::slowed(test::rendered("static_halfsphere", 60, 160, 120, 3));
        Limits limits = Limits::tiny();
        limits.depth_images_max = kImages;
        rig = std::make_unique<EngineRig>(limits, sequence.camera);
        test::run(**rig, sequence, 0, 60);
        file = test::saved(**rig, limits);
    }
    static void TearDownTestSuite() { rig.reset(); }
    static constexpr std::uint32_t kImages = 4;
    static inline std::unique_ptr<EngineRig> rig;
    static inline Bytes file;
};

// Promise: keyframes stand where the engine has them, by their frames' numbers, and hang on the same parents; there
// are as many points, each with as many observers as the links say.
TEST_F(MapContentTest, IsTheEnginesMap) {
    SavedMap content;
    std::string message;
    ASSERT_EQ(parse_map_content(file, "room.map", content, message), Status::kOk) << message;
    std::vector<KeyframePose> poses(content.keyframes.size() + 1);
    const std::uint32_t count = (*rig)->keyframes(poses);
    ASSERT_EQ(content.keyframes.size(), count);
    ASSERT_GE(count, 3U);
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto same = std::find_if(content.keyframes.begin(), content.keyframes.end(),
                                       [&](const SavedKeyframe& k) { return k.frame == poses[i].id; });
        ASSERT_NE(same, content.keyframes.end());
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_NEAR(same->pose.t[k], poses[i].map_from_camera.translation_m[k], 1e-12);
        }
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_NEAR(same->pose.q[k], poses[i].map_from_camera.rotation_xyzw[k], 1e-12);
        }
        const std::uint64_t parent = same->parent == 0 ? kNoKeyframe : content.keyframes[same->parent - 1].frame;
        EXPECT_EQ(parent, poses[i].parent_id);
    }
    EXPECT_EQ(content.points.size(), (*rig)->statistics().map_points.size);
    std::uint64_t observed = 0, observing = 0;
    for (const SavedPoint& point : content.points) {
        observed += point.observers;
        EXPECT_LE(point.static_weight, 2.0);
        EXPECT_GE(point.along_m2, 0);
    }
    for (const SavedKeyframe& keyframe : content.keyframes) observing += keyframe.points;
    EXPECT_EQ(observed, observing);
    EXPECT_GT(observed, content.points.size());
    EXPECT_EQ(content.camera.width, 160U);
}

// Promise: keyframes that share points are those that the engine says, with as many points; the least number counts.
TEST_F(MapContentTest, LinksAreThoseOfTheEngine) {
    SavedMap content;
    std::string message;
    ASSERT_EQ(parse_map_content(file, "room.map", content, message), Status::kOk) << message;
    const auto newest_last = [](const KeyframeLink& a, const KeyframeLink& b) {
        return std::pair(a.newer_id, a.older_id) < std::pair(b.newer_id, b.older_id);
    };
    std::vector<KeyframeLink> wanted(100);
    wanted.resize((*rig)->keyframe_links(wanted, 100));
    ASSERT_GE(wanted.size(), 3U);
    std::sort(wanted.begin(), wanted.end(), newest_last);
    const std::vector<KeyframeLink> links = covisible_keyframes(content);
    ASSERT_EQ(links.size(), wanted.size());
    std::uint32_t most = 0;
    for (std::size_t i = 0; i < links.size(); ++i) {
        EXPECT_EQ(links[i].older_id, wanted[i].older_id);
        EXPECT_EQ(links[i].newer_id, wanted[i].newer_id);
        EXPECT_EQ(links[i].shared_points, wanted[i].shared_points);
        most = std::max(most, links[i].shared_points);
    }
    EXPECT_GE(covisible_keyframes(content, most).size(), 1U);
    EXPECT_TRUE(covisible_keyframes(content, most + 1).empty());
}

// Promise: what is no map of an engine, with more keyframes or a point shown twice in one, breaks nothing.
TEST(MapLinks, OfAnyMap) {
    SavedMap map;
    map.points.resize(1);
    for (const std::uint64_t frame : {7U, 5U}) map.keyframes.push_back({{}, frame, 0, 20, 20});
    map.shown.assign(40, 1);
    EXPECT_TRUE(covisible_keyframes(map).empty());
    const std::vector<KeyframeLink> links = covisible_keyframes(map, 0);
    ASSERT_EQ(links.size(), 1U);
    EXPECT_EQ(links[0].older_id, 5U);
    EXPECT_EQ(links[0].newer_id, 7U);
    EXPECT_EQ(links[0].shared_points, 1U);
    map.keyframes.assign(1025, {{}, 0, 0, 1, 1});
    map.shown.assign(1025, 1);
    EXPECT_TRUE(covisible_keyframes(map, 1).empty());
}

// Promise: depth images are those of the engine, cells, rays and all, and stand where it has them.
TEST_F(MapContentTest, HasTheDepthImagesOfTheEngine) {
    SavedMap content;
    std::string message;
    ASSERT_EQ(parse_map_content(file, "room.map", content, message), Status::kOk) << message;
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < kImages; ++i) {
        const DepthImage wanted = (*rig)->depth_image(i);
        if (wanted.columns == 0) continue;
        const DepthImage image = content.depth_image(count++);
        EXPECT_EQ(image.frame, wanted.frame);
        EXPECT_EQ(image.columns, wanted.columns);
        EXPECT_EQ(image.rows, wanted.rows);
        EXPECT_TRUE(
            std::equal(image.depth_mm.begin(), image.depth_mm.end(), wanted.depth_mm.begin(), wanted.depth_mm.end()));
        EXPECT_TRUE(std::equal(image.rays.begin(), image.rays.end(), wanted.rays.begin(), wanted.rays.end()));
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_NEAR(image.map_from_camera.translation_m[k], wanted.map_from_camera.translation_m[k], 1e-12);
        }
        for (std::size_t k = 0; k < 4; ++k) {
            EXPECT_NEAR(image.map_from_camera.rotation_xyzw[k], wanted.map_from_camera.rotation_xyzw[k], 1e-12);
        }
    }
    EXPECT_GE(count, 3U);
    EXPECT_EQ(content.depth.size(), count);
    EXPECT_EQ(content.depth_image(count).columns, 0U);
}

// Promise: whatever byte is wrong, and wherever the file ends, it is refused with a sentence that names it, and what
// was there before is not touched.
TEST_F(MapContentTest, DamageIsRefused) {
    Random random(4);
    for (int trial = 0; trial < 300; ++trial) {
        Bytes damaged = file;
        const std::size_t at = random.below(static_cast<std::uint32_t>(file.size()));
        if (trial % 3 == 0) {
            damaged.resize(at);
        } else {
            damaged[at] ^= static_cast<std::byte>(1U << random.below(8));
        }
        SavedMap content;
        content.readout_s = 7;
        std::string message;
        EXPECT_EQ(parse_map_content(damaged, "room.map", content, message), Status::kInvalid) << trial << " " << at;
        EXPECT_EQ(message.find("room.map"), 0U) << message;
        EXPECT_EQ(content.readout_s, 7);
    }
}

// Promise: any bytes are safe, also where all checksums are right.
TEST_F(MapContentTest, AnyBytesAreSafe) {
    Random random(5);
    int read = 0;
    for (int trial = 0; trial < 300; ++trial) {
        Bytes changed = file;
        for (int i = 0; i < 8; ++i) {
            const std::size_t at = random.below(static_cast<std::uint32_t>(file.size()));
            changed[at] = static_cast<std::byte>(random.below(256));
        }
        test::mend(changed);
        SavedMap content;
        std::string message;
        read += parse_map_content(changed, "room.map", content, message) == Status::kOk ? 1 : 0;
    }
    EXPECT_GT(read, 0);
}

}  // namespace
}  // namespace stillmesh::map_content_test
