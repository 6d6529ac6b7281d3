#include "engine/recognition/map_drift.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::map_drift_test {
namespace {

constexpr std::uint32_t kSeen = 20;  // points that neighbours share: more than map.shared_min
constexpr std::uint32_t kFewSeen = 5;

Limits limits_of_test() {
    Limits out = Limits::tiny();
    out.keyframes_max = 16;
    out.features_max = 2 * kSeen;
    out.map_points_max = 400;
    return out;
}

// A camera on its way along z, a keyframe every 30 frames and every metre, each of which sees what the one before saw
// newly; its odometry gathers a twentieth of the way.
class MapDrift : public testing::Test {
protected:
    // Sees the first `old` points that keyframe `seen_again` saw newly, and new ones.
    void add(double z_m, double drift_m, std::uint32_t frame, std::int32_t seen_again = -1, std::uint32_t old = 0) {
        const Handle<Keyframe> handle = map_->add_keyframe();
        Keyframe& keyframe = *map_->keyframes().find(handle);
        keyframe.world_from_camera.translation = Vector3(0, 0, z_m);
        keyframe.drift_m = static_cast<float>(drift_m);
        keyframe.frame = frame;
        std::vector<Handle<MapPoint>> points;
        const auto see = [&](Handle<MapPoint> point) {
            Observation observation;
            observation.point = point;
            map_->add_observation(handle, observation, {});
        };
        for (std::uint32_t i = 0; i < old; ++i) see(seen_[static_cast<std::size_t>(seen_again)][i]);
        for (std::uint32_t i = 0; i < kSeen; ++i) {
            points.push_back(map_->add_point().value());
            see(points.back());
        }
        map_->attach(handle);
        seen_.push_back(points);
        slots_.push_back(handle.slot());
    }
    void go(std::uint32_t keyframes) {
        for (std::uint32_t i = 0; i < keyframes; ++i) {
            add(i, 0.05 * i, 30 * i, static_cast<std::int32_t>(i) - 1, i > 0 ? kSeen : 0);
        }
    }
    [[nodiscard]] double between(std::size_t a, std::size_t b) {
        return drift_between(*map_, slots_[a], slots_[b], LoopParameters{});
    }
    test::InMemory<Map> map_{limits_of_test()};

private:
    std::vector<std::vector<Handle<MapPoint>>> seen_;  // of each keyframe, the new ones
    std::vector<std::uint32_t> slots_;
};

// Promise: along the way it is what odometry has gathered, in either direction, and nothing from a keyframe to itself.
TEST_F(MapDrift, AddsUpAlongTheWay) {
    go(6);
    for (std::size_t a = 0; a < 6; ++a) {
        for (std::size_t b = 0; b < 6; ++b) {
            EXPECT_NEAR(between(a, b), 0.05 * std::abs(static_cast<double>(a) - static_cast<double>(b)), 1e-6);
        }
    }
}

// Promise: a camera that was lost for a minute and is found where the map has it already lies as far from everything
// else as the place where it was found, however far it can have been carried; one that shares nothing with the place
// lies as far off as it can have been carried.
TEST_F(MapDrift, WhatIsFoundAgainIsNoFartherThanThePlace) {
    go(6);
    const double lost_m = 90;
    add(1.5, 0.25 + lost_m, 2000, 1, kSeen);     // 6: sees what keyframes 1 and 2 saw
    add(2.5, 0.30 + lost_m, 2030, 6, kSeen);     // 7: a metre on
    add(4.5, 0.30 + lost_m, 4000, 5, kFewSeen);  // 8: looks a little like keyframe 5
    EXPECT_NEAR(between(6, 2), 0.05 * 0.5, 1e-6);
    EXPECT_NEAR(between(2, 6), 0.05 * 0.5, 1e-6);
    EXPECT_NEAR(between(6, 5), 0.05 * 0.5 + 0.05 * 3, 1e-6);
    EXPECT_NEAR(between(7, 0), 0.05 + 0.05 * 0.5 + 0.05 * 2, 1e-5);
    EXPECT_NEAR(between(8, 5), lost_m + 0.30 - 0.25, 1e-4);
}

// Promise: what was gathered since a little while ago counts, though points are shared: people may have carried them.
TEST_F(MapDrift, AMomentAgoIsNotFoundAgain) {
    go(6);
    const auto gap = LoopParameters{}.gap_frames;
    add(5, 3, 150 + gap - 1, 5, kSeen);
    EXPECT_NEAR(between(6, 5), 2.75, 1e-6);
    add(5, 3, 150 + gap, 4, kSeen);  // which keyframe 5 sees as well
    EXPECT_NEAR(between(7, 5), 0, 1e-6);
}

// Promise: what was gathered counts though it was taken back: a camera that is found again knows less drift than
// before, and what lies between is off by the difference.
TEST_F(MapDrift, WhatIsTakenBackCountsToo) {
    go(6);
    add(5.5, 0.05, 200, 5, kSeen);
    EXPECT_NEAR(between(6, 5), 0.2, 1e-6);
    EXPECT_NEAR(between(5, 6), 0.2, 1e-6);
    EXPECT_NEAR(between(6, 4), 0.25, 1e-6);
}

}  // namespace
}  // namespace stillmesh::map_drift_test
