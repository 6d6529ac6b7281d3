#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "engine/static_region/paper_choice.hpp"
#include "engine/tracking/keyframe_inserter.hpp"
#include "engine/tracking/tracking.hpp"
#include "engine/tuned_engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::paper_method_test {
namespace {

constexpr Limits kLimits{320, 240, 4, 300, 12, 1500, 32};

Parameters paper() {
    Parameters out;
    out.features.count = kLimits.features_max;
    out.features.levels = kLimits.pyramid_levels_max;
    out.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
    return out;
}

struct Rig {
    explicit Rig(const CameraModel& camera, const Parameters& parameters = paper()) : memory(planned()) {
        Arena arena(memory.span());
        world.create(arena, kLimits, parameters, camera);
        tracking.create(arena, world, cpu_kernels(), nullptr);
    }
    static std::size_t planned() {
        ArenaPlan plan;
        World::plan(plan, kLimits);
        Tracking::plan(plan, kLimits);
        return plan.used_bytes();
    }
    test::Memory memory;
    World world;
    Tracking tracking;
};

// Promise: with the method of the paper a room in which nothing moves is tracked in every frame, the path is right to
// some millimetres, and there are keyframes, but not of every frame.
TEST(PaperMethod, TracksAStaticScene) {
    test::DrawnScene scene;
    scene.has_board = false;
    Rig rig(scene.camera());
    std::uint32_t keyframes = 0;
    for (std::uint32_t i = 0; i < 90; ++i) {
        rig.tracking.track(scene.draw(i).frame());
        keyframes += rig.tracking.frame_statistics().is_keyframe ? 1U : 0U;
        ASSERT_EQ(rig.world.pose.state, PoseState::kTracked) << i;
        const Vector3 off = rig.tracking.world_from_camera().translation - Vector3(scene.travelled_m(i), 0, 0);
        ASSERT_LT(off.norm(), 0.008) << i;
    }
    EXPECT_GE(keyframes, 2U);
    EXPECT_LE(keyframes, 30U);
}

// Promise: Algorithm 2: a weight begins at 1; a frame adds .1 to every match with depth that is in the chosen group and
// agrees with the pose, takes .1 from every other one, and leaves the rest as they are, within [0, 2]; what loses its
// weight keeps its say in the mesh.
TEST(PaperMethod, WeightsAreThoseOfAlgorithmTwo) {
    const test::DrawnScene scene;
    Rig rig(scene.camera());
    std::map<std::uint32_t, std::pair<std::uint32_t, std::uint32_t>> before;  // by slot: generation, weight
    std::uint32_t risen = 0, fallen = 0, light = 0;
    for (std::uint32_t i = 0; i < 60; ++i) {
        const test::KeptFrame kept = scene.draw(i);
        rig.tracking.track(kept.frame());
        const TrackingView view = rig.tracking.view();
        std::map<std::uint32_t, std::int32_t> steps;  // by slot
        std::set<std::int32_t> groups;                // of what is static
        for (const Correspondence& c : rig.tracking.correspondences()) {
            if (!c.has_depth) continue;
            steps[c.point_slot] = view.features[c.feature].is_static ? 1 : -1;
            if (view.features[c.feature].is_static) groups.insert(view.features[c.feature].group);
            const auto known = before.find(c.point_slot);
            light += known != before.end() && known->second.second < 10 && view.features[c.feature].group >= 0;
        }
        ASSERT_LE(groups.size(), 1U) << "one group is chosen: frame " << i;
        ASSERT_FALSE(groups.contains(-1)) << "what is in no group is not chosen: frame " << i;
        const Pool<MapPoint>& points = rig.world.map.points();
        std::map<std::uint32_t, std::pair<std::uint32_t, std::uint32_t>> now;
        for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
            if (!points.is_taken(slot)) continue;
            const std::uint32_t weight = points.at(slot).weight_tenths;
            now[slot] = {points.handle_of(slot).generation, weight};
            ASSERT_FALSE(points.at(slot).is_suspect);
            const auto known = before.find(slot);
            if (known == before.end() || known->second.first != now[slot].first) {
                ASSERT_EQ(weight, 10U) << "a new point";
                continue;
            }
            const std::int32_t step = steps.contains(slot) ? steps[slot] : 0;
            const auto old = static_cast<std::int32_t>(known->second.second);
            ASSERT_EQ(static_cast<std::int32_t>(weight), std::clamp(old + step, 0, 20)) << "frame " << i;
            risen += step > 0 ? 1U : 0U;
            fallen += step < 0 ? 1U : 0U;
        }
        before = now;
    }
    EXPECT_GT(risen, 1000U);
    EXPECT_GT(fallen, 100U);
    EXPECT_GT(light, 20U);
}

// Promise: the keyframe rule of section 1: fewer than 80 % of the points that the last keyframe tracked are tracked,
// and more than 40 are new, in whatever frame.
TEST(PaperMethod, KeyframeRule) {
    const Parameters parameters = as_in_paper(paper());
    test::SmallWorld world(parameters);
    test::InWorld<KeyframeInserter> room(*world);
    KeyframeInserter& inserter = *room;
    inserter.reset();
    inserter.begin_after(7);
    inserter.set_tracked(100);
    for (const auto& [tracked, possible, wants] :
         {std::tuple{79U, 41U, true}, {80U, 41U, false}, {79U, 40U, false}, {10U, 40U, false}, {10U, 500U, true}}) {
        EXPECT_EQ(inserter.wants(8, tracked, possible), wants) << tracked << " tracked, " << possible << " new";
        EXPECT_EQ(inserter.wants(1000, tracked, possible), wants);
    }
    inserter.set_tracked(1000);
    EXPECT_FALSE(inserter.wants(8, 800, 41));
    EXPECT_TRUE(inserter.wants(8, 799, 41));
}

// Promise: what the last keyframe tracked are the members of its best group that fit, without the points that it added;
// and the rule is asked with such members of a frame.
TEST(PaperMethod, KeyframesAreComparedByWhatTheyTracked) {
    const test::DrawnScene scene;
    Rig rig(scene.camera());
    std::uint32_t tracked = 0, keyframes = 0, moving = 0;
    for (std::uint32_t i = 0; i < 60; ++i) {
        rig.tracking.track(scene.draw(i).frame());
        const FrameStatistics& s = rig.tracking.frame_statistics();
        if (i == 0) {
            tracked = s.features_with_depth;
            continue;
        }
        if (s.is_keyframe) {
            EXPECT_LT(s.static_matches, 0.8 * tracked) << i;
            tracked = s.static_matches;
            ++keyframes;
        } else if (s.static_matches < 0.8 * tracked) {
            EXPECT_LE(s.features_with_depth - std::min(s.features_with_depth, s.matches), 60U) << "few new ones: " << i;
        }
        moving += s.matches - s.static_matches;
    }
    EXPECT_GT(moving, 500U);
    EXPECT_GE(keyframes, 3U);
}

// Promise: what the method sets besides is within the ranges of the configuration, is the same when it is set again,
// and leaves all that it does not name.
TEST(PaperMethod, ItsParametersAreOneSet) {
    Parameters given;
    given.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
    given.matching.radius_px = 17;
    given.region.edge_change_max_m = 0.5;
    const Parameters once = as_in_paper(given);
    EXPECT_EQ(validate(once, Limits::room()).key, nullptr);
    EXPECT_EQ(once.matching.radius_px, 17);
    EXPECT_EQ(once.region.edge_change_max_m, 0.5);
    Parameters twice = as_in_paper(once), same = once;
    visit_all_parameters(twice, [&](const char* key, auto& value, double, double, const char*, const char*) {
        const auto mine = static_cast<double>(value);
        visit_all_parameters(same, [&](const char* other, auto& theirs, double, double, const char*, const char*) {
            if (std::string_view(key) == other) {
                EXPECT_EQ(static_cast<double>(theirs), mine) << key;
            }
        });
    });
}

}  // namespace
}  // namespace stillmesh::paper_method_test
