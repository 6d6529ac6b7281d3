#include "engine/tracking/frame_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::frame_view_test {
namespace {

// Promise: every feature is shown where it is, with its group; as static where the pose was estimated from it, as
// moving where it was matched and did not, and as neither where it was not matched. What the frame before showed is
// gone.
TEST(FrameView, ShowsWhatBecameOfFeatures) {
    const Limits limits = test::limits_of(100);
    test::InMemory<FrameView> view(limits);
    test::InMemory<StaticRegion> region(limits);
    for (const std::uint32_t count : {12U, 5U}) {
        std::vector<Keypoint> keypoints(count);
        std::vector<std::uint16_t> groups(count, kNoGroup);
        std::vector<Correspondence> correspondences;
        std::vector<std::uint16_t> chosen;
        for (std::uint32_t i = 0; i < count; ++i) {
            keypoints[i].x = static_cast<float>(10 * i) + 0.25F;
            keypoints[i].y = static_cast<float>(7 * i) + 0.5F;
            if (i % 3 != 0) groups[i] = static_cast<std::uint16_t>(i);
            if (i % 4 == 3) continue;  // not matched
            Correspondence c;
            c.feature = count - 1 - i;  // in another order
            c.is_moving = i % 2 != 0;
            if (i % 2 == 0) chosen.push_back(static_cast<std::uint16_t>(correspondences.size()));
            correspondences.push_back(c);
        }
        const TrackingView shown = view->show(keypoints, groups, correspondences, chosen, *region);
        ASSERT_EQ(shown.features.size(), count);
        EXPECT_TRUE(shown.edges.empty());
        for (std::uint32_t i = 0; i < count; ++i) {
            const TrackedFeature& f = shown.features[i];
            const std::uint32_t n = count - 1 - i;
            EXPECT_EQ(f.x, keypoints[i].x);
            EXPECT_EQ(f.y, keypoints[i].y);
            EXPECT_EQ(f.group, i % 3 != 0 ? static_cast<std::int32_t>(i) : -1);
            EXPECT_EQ(f.is_matched, n % 4 != 3);
            EXPECT_EQ(f.is_static, n % 4 != 3 && n % 2 == 0);
            EXPECT_EQ(f.is_dynamic, n % 4 != 3 && n % 2 != 0);
        }
    }
}

// Promise: the mesh is shown in pixels, edge by edge: between features, each kept as the region keeps it.
TEST(FrameView, ShowsTheMesh) {
    const Limits limits = test::limits_of(200);
    test::InMemory<FrameView> view(limits);
    test::InMemory<StaticRegion> region(limits);
    Random random(1);
    SE3 motion;
    motion.translation = Vector3(0.3, 0, 0.2);
    const test::Scene scene = test::room_and_body(90, 40, SE3{}, motion, random);
    const RegionParameters parameters;
    region->build(scene.correspondences, scene.keypoints, parameters, test::context_at(SE3{}));
    const std::vector<std::uint16_t> groups(scene.keypoints.size(), kNoGroup);
    const TrackingView shown = view->show(scene.keypoints, groups, scene.correspondences, {}, *region);
    const Mesh& mesh = region->mesh();
    ASSERT_EQ(shown.edges.size(), mesh.edges.size());
    ASSERT_GT(shown.edges.size(), 100U);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
        const TrackedEdge& e = shown.edges[i];
        EXPECT_EQ(e.is_kept, region->is_kept(i));
        kept += e.is_kept ? 1U : 0U;
        const auto is_feature = [&](float x, float y) {
            for (const Keypoint& k : scene.keypoints) {
                if (std::abs(k.x - x) <= 0.5F && std::abs(k.y - y) <= 0.5F) return true;
            }
            return false;
        };
        EXPECT_TRUE(is_feature(e.x0, e.y0) && is_feature(e.x1, e.y1)) << i;
        EXPECT_TRUE(e.x0 != e.x1 || e.y0 != e.y1);
        const auto& a = mesh.vertices[mesh.edges[i].a];
        EXPECT_EQ(e.x0 * kMeshUnitsPerPixel, static_cast<float>(a.x));
        EXPECT_EQ(e.y0 * kMeshUnitsPerPixel, static_cast<float>(a.y));
    }
    EXPECT_EQ(kept, region->kept_count());
    EXPECT_LT(kept, shown.edges.size());
    EXPECT_GT(kept, 0U);
}

}  // namespace
}  // namespace stillmesh::frame_view_test
