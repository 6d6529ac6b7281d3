#include "engine/tracking/frame_hash.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "engine/static_region/static_region.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::frame_hash_test {
namespace {

// Three matches, one still, one moving and one of a point that has left the map; all that a frame adds to the hash.
class Outcome {
public:
    Outcome() : frame_(*world_), judge_(*world_) {
        for (std::uint32_t n = 0; n < 3; ++n) {
            frame_.add(20 + 30 * n, 40, 2, test::descriptor_of(n));
            points.push_back(world_.add_point(test::point_at_pixel(20 + 30 * n, 40, 2)));
        }
        frame_.measure();
        for (std::uint32_t n = 0; n < 3; ++n) {
            Correspondence c;
            c.feature = n;
            c.point_slot = points[n].slot();
            c.distance_bits = static_cast<std::uint16_t>(10 + n);
            c.p_camera = frame_.measured[n].point();
            c.normalised = frame_.measured[n].normalised;
            c.p_world = c.p_anchor = c.p_camera + Vector3(0, 0, n == 1 ? 1 : 0);
            c.var_z = c.var_pixel = c.map_var_z = c.map_var_lateral = c.anchor_var_z = c.anchor_var_lateral = 1e-4;
            c.has_depth = true;
            correspondences.push_back(c);
        }
        judge(false);
        map().release_point(points[2]);
        statistics.mesh_edges_kept = 17;
        pose.state = PoseState::kTracked;
        for (int i = 0; i < 36; ++i) pose.covariance[i] = 1e-4 * i;
        world_from_camera = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
    }
    // As the frame judged them, or the other way round.
    void judge(bool is_inverted) {
        test::InMemory<FixedVector<std::uint16_t>> still(std::size_t{100});
        TrackedShutter shutter;
        shutter.create(world_->parameters, 120);
        shutter.reset();
        std::vector<Correspondence> seen(correspondences.begin(), correspondences.begin() + 2);
        if (is_inverted) std::swap(seen[0].feature, seen[1].feature);
        judge_->judge(seen, {{frame_.measured, shutter, SE3{}, 0, 0, 0}, false, true}, map(), *still);
    }
    [[nodiscard]] std::uint64_t hash() {
        StateHash out;
        add_to(out);
        return out.value();
    }
    void add_to(StateHash& out) {
        add_frame({time_ns, world_from_camera, pose, statistics, correspondences, groups, *judge_}, map(), out);
    }
    [[nodiscard]] Map& map() { return world_.map(); }
    [[nodiscard]] test::SmallWorld& world() { return world_; }

    std::int64_t time_ns = 5;
    SE3 world_from_camera;
    PoseEstimate pose;
    FrameStatistics statistics;
    std::vector<Handle<MapPoint>> points;
    std::vector<Correspondence> correspondences;
    std::vector<std::uint16_t> groups = {0, 1, kNoGroup};

private:
    test::SmallWorld world_;
    test::SmallFrame frame_;
    test::InWorld<PointJudge> judge_;
};

// Promise: frames that are the same hash the same, and whatever a frame decided or measured changes the hash: its time,
// every number of its pose and covariance, its matches with their groups, verdicts, weights and points, what became of
// the map, and whether it became a keyframe. Every change has a hash of its own.
TEST(FrameHash, SeesEverythingThatWasDecided) {
    std::map<std::uint64_t, std::string> seen;
    const auto add = [&](const std::string& name, const std::function<void(Outcome&)>& change) {
        Outcome outcome, again;
        change(outcome);
        change(again);
        EXPECT_EQ(outcome.hash(), again.hash()) << name;
        const auto [at, is_new] = seen.emplace(outcome.hash(), name);
        EXPECT_TRUE(is_new) << name << " and " << at->second;
    };
    add("nothing", [](Outcome&) {});
    add("time", [](Outcome& o) { ++o.time_ns; });
    for (int i = 0; i < 3; ++i) {
        add("translation " + std::to_string(i), [i](Outcome& o) { o.world_from_camera.translation(i) += 1e-12; });
    }
    for (int i = 0; i < 9; ++i) {
        add("rotation " + std::to_string(i), [i](Outcome& o) { o.world_from_camera.rotation(i / 3, i % 3) += 1e-12; });
    }
    for (int i = 0; i < 36; ++i) {
        add("covariance " + std::to_string(i), [i](Outcome& o) { o.pose.covariance[i] += 1e-12; });
    }
    for (const PoseState state : {PoseState::kNone, PoseState::kPredicted, PoseState::kUnsure}) {
        add(pose_state_name(state), [state](Outcome& o) { o.pose.state = state; });
    }
    add("fewer matches", [](Outcome& o) { o.correspondences.pop_back(); });
    add("order", [](Outcome& o) { std::swap(o.correspondences[0], o.correspondences[1]); });
    add("feature", [](Outcome& o) { o.correspondences[0].feature = 2; });
    add("point", [](Outcome& o) { o.correspondences[0].point_slot = o.points[1].slot(); });
    add("distance", [](Outcome& o) { ++o.correspondences[1].distance_bits; });
    add("group", [](Outcome& o) { o.groups[0] = 3; });
    add("no group", [](Outcome& o) { o.groups[1] = kNoGroup; });
    add("verdicts", [](Outcome& o) { o.judge(true); });
    add("weight", [](Outcome& o) { ++o.world()[o.points[0]].weight_tenths; });
    add("place", [](Outcome& o) { o.world()[o.points[1]].world[2] += 1e-12; });
    add("keyframe", [](Outcome& o) { o.statistics.is_keyframe = true; });
    add("edges kept", [](Outcome& o) { ++o.statistics.mesh_edges_kept; });
    add("a point more", [](Outcome& o) { static_cast<void>(o.map().add_point()); });
    add("a point emptied", [](Outcome& o) { ++o.map().statistics().points_emptied; });
    add("a change of the map", [](Outcome& o) { o.map().note_change(1.5); });
}

// Promise: frame after frame the hash goes on from what it was.
TEST(FrameHash, GoesOnFromFrameToFrame) {
    Outcome outcome;
    StateHash once, twice;
    outcome.add_to(once);
    outcome.add_to(twice);
    EXPECT_EQ(once.value(), twice.value());
    outcome.add_to(twice);
    EXPECT_NE(once.value(), twice.value());
}

}  // namespace
}  // namespace stillmesh::frame_hash_test
