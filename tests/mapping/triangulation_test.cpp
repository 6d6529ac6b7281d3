#include "engine/mapping/triangulation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/place/vocabularies.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kPoints = 20;

// Two keyframes side by side that show the same points, none of which has depth.
class Pair {
public:
    explicit Pair(double baseline_m) {
        pixel_noise_.create(configuration_, {.width = 160, .height = 120, .fx = 130, .fy = 130});
        Random random(5);
        for (std::uint32_t i = 0; i < kPoints; ++i) {
            points_.emplace_back(0.1 * (i % 5) - 0.2, 0.15 * (i / 5) - 0.3, 1.5 + 0.05 * i);
            descriptors_.push_back(test::random_descriptor(random));
        }
        there_ = add(SE3{}, 0);
        SE3 beside;
        beside.translation.x() = baseline_m;
        here_ = add(beside, 1);
        map_->keyframes().find(here_)->way_m = 7;
    }
    [[nodiscard]] const MapPoint* triangulated(std::uint32_t feature) {
        const Triangulation made = triangulate(*map_, here_, feature, there_, configuration_, pixel_noise_);
        return map_->points().find(made.point);
    }
    [[nodiscard]] const Vector3& truth(std::uint32_t feature) const { return points_[feature]; }
    [[nodiscard]] const char* fault() { return map_->find_fault(); }

private:
    Handle<Keyframe> add(const SE3& world_from_camera, std::uint64_t frame) {
        const Handle<Keyframe> out = map_->add_keyframe();
        map_->keyframes().find(out)->world_from_camera = world_from_camera;
        map_->keyframes().find(out)->frame = frame;
        for (std::uint32_t i = 0; i < kPoints; ++i) {
            const Vector3 p = world_from_camera.inverse() * points_[i];
            Observation seen;
            seen.normalised_x = static_cast<float>(p.x() / p.z());
            seen.normalised_y = static_cast<float>(p.y() / p.z());
            map_->add_observation(out, seen, descriptors_[i]);
        }
        map_->attach(out);
        return out;
    }

    Parameters configuration_;
    PixelNoise pixel_noise_;
    test::InMemory<Map> map_{Limits::tiny()};
    std::vector<Vector3> points_;
    std::vector<Descriptor> descriptors_;
    Handle<Keyframe> here_, there_;
};

// Promise: a point lies where the two rays meet, both keyframes observe it, and it has been in sight until it was made.
TEST(Triangulation, PointsLieWhereRaysMeet) {
    Pair pair(0.3);
    for (std::uint32_t i = 0; i < kPoints; ++i) {
        const MapPoint* const point = pair.triangulated(i);
        ASSERT_NE(point, nullptr) << i;
        EXPECT_LT(std::sqrt((vector_of(point->world) - pair.truth(i)).squaredNorm()), 1e-4) << i;
        EXPECT_EQ(point->observers, 2U);
        EXPECT_EQ(point->agreed_way_m, 7.0F);
        EXPECT_EQ(pair.triangulated(i), nullptr) << "feature " << i << " of there has its point";
    }
    EXPECT_STREQ(pair.fault(), nullptr);
}

// Promise: rays that are nearly parallel make no point.
TEST(Triangulation, NoParallaxNoPoint) {
    Pair pair(0.01);
    for (std::uint32_t i = 0; i < kPoints; ++i) EXPECT_EQ(pair.triangulated(i), nullptr) << i;
    EXPECT_STREQ(pair.fault(), nullptr);
}

}  // namespace
}  // namespace stillmesh
