#include "engine/static_region/choice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/pose/residual.hpp"
#include "engine/static_region/hypotheses.hpp"
#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::choice_test {
namespace {

using namespace test;

struct Rig {
    Rig(std::uint32_t room_points, std::uint32_t body_points, const SE3& motion, Random& random)
        : pose(random_motion(random, 0.5, 0.3)),
          scene(room_and_body(room_points, body_points, pose, motion, random)),
          context(context_at(pose)),
          groups(limits_of(400)),
          hypotheses(limits_of(400)),
          chosen(std::size_t{400}),
          scratch(std::size_t{400}) {
        for (Correspondence& c : scene.correspondences) c.weight = random.uniform(0.2, 1.0);
    }
    RegionInput input() { return {scene.correspondences, weighted, *groups, configuration, context, *scratch}; }
    void propose(Random& random) {
        weighted.clear();
        for (const std::uint16_t i : all_of(scene.correspondences)) {
            if (scene.correspondences[i].weight > 0) weighted.push_back(i);
        }
        groups->build(scene.correspondences, scene.keypoints, configuration.region, context);
        hypotheses->propose(input(), random);
    }
    SE3 pose;
    Scene scene;
    Parameters configuration;
    RegionContext context;
    InMemory<MeshGroups> groups;
    InMemory<Hypotheses> hypotheses;
    InMemory<FixedVector<std::uint16_t>> chosen, scratch;
    std::vector<std::uint16_t> weighted;
};

SE3 moved(double metres) {
    SE3 out;
    out.translation = Vector3(metres, 0, 0);
    return out;
}

// Promise: a score is Eq. 1 with weights: W1 times the share of the area that agreeing points stand for, W2 times that
// of agreeing triangles, a share for the expected motion, over the sum of these weights, times how plausible the motion
// is; a point counts as far as its group agrees.
TEST(Hypotheses, ScoreIsEquationOneWithWeights) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        Rig rig(150, 80, moved(0.1), random);
        rig.propose(random);
        const RegionParameters& region = rig.configuration.region;
        const SE3 looked_at = rig.pose * random_motion(random, 0.02, 0.01);
        const Hypothesis found = rig.hypotheses->score(rig.input(), looked_at);
        const SE3 camera_from_world = looked_at.inverse();
        const std::vector<Correspondence>& all = rig.scene.correspondences;
        const auto weight_of = [&](std::size_t i) {
            const bool agrees = chi2_of(all[i], camera_from_world) <= region.point_chi2_max;
            return agrees ? rig.hypotheses->motions().agreement_of(rig.groups->group_of(i)) : 0.0;
        };
        double points = 0, points_all = 0, triangles = 0, triangles_all = 0;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const double area = all[i].weight * all[i].p_camera.z() * all[i].p_camera.z();
            points += area * weight_of(i);
            points_all += area;
        }
        for (const MeshTriangle& t : rig.groups->mesh().triangles) {
            double weight = 0, z = 0, least = 1;
            Vector3 corner[3];
            for (int k = 0; k < 3; ++k) {
                const std::size_t i = rig.groups->correspondence_of(t.vertex[k]);
                const PixelPoint p = rig.groups->mesh().vertices[t.vertex[k]];
                corner[k] = Vector3(p.x, p.y, 0);
                weight += all[i].weight / 3;
                z += all[i].p_camera.z() / 3;
                least = std::min(least, weight_of(i));
            }
            const double area = (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm() * weight * z * z;
            triangles += area * least;
            triangles_all += area;
        }
        const SE3 off = rig.context.world_from_camera_predicted.inverse() * looked_at;
        const double d2 =
            off.translation.squaredNorm() / (0.02 * 0.02) + std::pow(so3_log(off.rotation).norm() / 0.02, 2);
        const double plausible = 1 / (1 + d2 / 25);
        const double score = 0.5 * points / points_all + triangles / triangles_all + 0.25 / (1 + d2 / 25);
        EXPECT_NEAR(found.score, score * plausible / 1.75, 1e-9) << "seed " << seed;
        EXPECT_NEAR(found.plausibility, plausible, 1e-9);
        rig.context.has_prediction = false;
        const Hypothesis unexpected = rig.hypotheses->score(rig.input(), looked_at);
        EXPECT_NEAR(unexpected.score, (0.5 * points / points_all + triangles / triangles_all) / 1.5, 1e-9);
        EXPECT_EQ(unexpected.plausibility, 1.0);
    }
}

// Promise: the motions of a room and of a body are both among the hypotheses, whatever was expected; what each explains
// are the points of its own body, and together they explain the frame.
TEST(Hypotheses, EveryMotionIsProposed) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        Rig rig(150, 100, moved(0.15), random);
        rig.context.has_prediction = seed % 2 == 0;
        rig.propose(random);
        for (const int body : {0, 1}) {
            const SE3 wanted = body == 0 ? rig.pose : moved(0.15) * rig.pose;
            std::size_t nearest = 0;
            for (std::size_t h = 0; h < rig.hypotheses->all().size(); ++h) {
                if (metres_between(rig.hypotheses->all()[h].world_from_camera, wanted) <
                    metres_between(rig.hypotheses->all()[nearest].world_from_camera, wanted)) {
                    nearest = h;
                }
            }
            EXPECT_LT(metres_between(rig.hypotheses->all()[nearest].world_from_camera, wanted), 0.03);
            std::size_t own = 0, others = 0;
            for (std::size_t i = 0; i < rig.scene.body.size(); ++i) {
                if (!rig.hypotheses->explains(nearest, i)) continue;
                ++(rig.scene.body[i] == body ? own : others);
            }
            EXPECT_GT(own, 0.9 * static_cast<double>(rig.scene.count(body))) << "seed " << seed;
            EXPECT_LT(others, 0.1 * static_cast<double>(rig.scene.count(1 - body))) << "seed " << seed;
        }
        EXPECT_GT(rig.hypotheses->explained_share(rig.weighted), 0.95);
    }
}

bool is_same(const Hypothesis& a, const Hypothesis& b) {
    return metres_between(a.world_from_camera, b.world_from_camera) < 0.005 &&
           radians_between(a.world_from_camera, b.world_from_camera) < 0.005;
}

// The area that one motion alone explains, and another alone.
struct Only {
    double ours = 0, theirs = 0;
};
Only only_of(Rig& rig, std::size_t one, std::size_t other) {
    Only out;
    for (std::size_t i = 0; i < rig.scene.correspondences.size(); ++i) {
        const Correspondence& c = rig.scene.correspondences[i];
        const bool is_ours = rig.hypotheses->explains(one, i), is_theirs = rig.hypotheses->explains(other, i);
        if (is_ours != is_theirs) (is_theirs ? out.theirs : out.ours) += c.weight * c.p_camera.z() * c.p_camera.z();
    }
    return out;
}

// Promise: the best hypothesis has the highest score; its margin over each other motion is, of the area that only one
// of both explains, what the best does minus what the other does, the other's share counting by its plausibility. The
// rival that is told is the one with the least margin, and the shares are what each of both explains of the surface in
// view, whatever its weight.
TEST(Choice, MarginAndRivalByBruteForce) {
    std::size_t rivals = 0, with_rival = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        Rig rig(150, 100, moved(0.08), random);
        rig.propose(random);
        const std::span<const Hypothesis> all = rig.hypotheses->all();
        const std::size_t best = best_of(*rig.hypotheses);
        for (const Hypothesis& h : all) EXPECT_LE(h.score, all[best].score);
        double area_all = 0, margin = 1;
        double in_view = 0;
        for (const Correspondence& c : rig.scene.correspondences) in_view += c.p_camera.z() * c.p_camera.z();
        std::size_t rival = Hypotheses::kNone;
        const auto explained_by = [&](std::size_t h) {
            double explained = 0;
            for (std::size_t i = 0; i < rig.scene.body.size(); ++i) {
                const Correspondence& c = rig.scene.correspondences[i];
                if (rig.hypotheses->explains(h, i)) explained += c.p_camera.z() * c.p_camera.z();
            }
            return explained / in_view;
        };
        for (const Correspondence& c : rig.scene.correspondences)
            area_all += c.weight * c.p_camera.z() * c.p_camera.z();
        for (std::size_t h = 0; h < all.size(); ++h) {
            if (is_same(all[h], all[best])) continue;
            Only only = only_of(rig, best, h);
            only.theirs *= std::min(all[h].plausibility / all[best].plausibility, 1.0);
            if (only.theirs < 0.05 * area_all) continue;
            ++rivals;
            const double over_this = (only.ours - only.theirs) / (only.ours + only.theirs);
            if (over_this < margin) rival = h;
            margin = std::min(margin, over_this);
        }
        const Rival found = rival_of(rig.input(), *rig.hypotheses, best);
        EXPECT_NEAR(found.margin, margin, 1e-9) << "seed " << seed;
        EXPECT_EQ(found.hypothesis, rival) << "seed " << seed;
        EXPECT_NEAR(found.chosen_share, explained_by(best), 1e-9) << "seed " << seed;
        EXPECT_NEAR(found.share, rival == Hypotheses::kNone ? 0 : explained_by(rival), 1e-9);
        with_rival += rival != Hypotheses::kNone ? 1U : 0U;
    }
    EXPECT_GT(with_rival, 5U);
}

// The body is near and has little surface: with as much of a say as the room, nearly.
void fade_room(Scene& scene) {
    for (std::size_t i = 0; i < scene.body.size(); ++i) {
        if (scene.body[i] == 0) scene.correspondences[i].weight *= 0.3;
    }
}

// Promise: what contradicts the best motion most by surface alone is the one to carry on, by brute force; its margin is
// a rival's, and what goes where the rival before should is as much to be expected as what goes where the camera
// should.
TEST(Choice, WhatIsCarriedOnByBruteForce) {
    std::size_t carried = 0, tenable = 0, missed = 0;
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
        Random random(seed);
        // Far off what is expected of the camera, and half of the time where the rival of the frames before should be.
        const SE3 motion = moved(random.uniform(0.1, 0.4));
        Rig rig(150, 130, motion, random);
        fade_room(rig.scene);
        rig.context.rival_frames = static_cast<std::uint32_t>(seed % 4);
        rig.context.world_from_camera_rival = (seed % 8 < 4 ? motion : moved(3)) * rig.pose;
        rig.propose(random);
        const std::span<const Hypothesis> all = rig.hypotheses->with_rival();
        const std::size_t best = best_of(*rig.hypotheses);
        double area_all = 0;
        for (const Correspondence& c : rig.scene.correspondences)
            area_all += c.weight * c.p_camera.z() * c.p_camera.z();
        std::size_t most = Hypotheses::kNone;
        double least = 1, margin = 1;
        for (std::size_t h = 0; h < all.size(); ++h) {
            if (is_same(all[h], all[best])) continue;
            Only only = only_of(rig, best, h);
            const double by_surface = (only.ours - only.theirs) / (only.ours + only.theirs);
            if (only.theirs < 0.05 * area_all || !(by_surface < least)) continue;
            least = by_surface;
            most = h;
            const SE3 off = rig.context.world_from_camera_rival.inverse() * all[h].world_from_camera;
            const double d2 =
                off.translation.squaredNorm() / (0.02 * 0.02) + std::pow(so3_log(off.rotation).norm() / 0.02, 2);
            const double as_rival = rig.context.rival_frames > 0 ? 1 / (1 + d2 / 25) : 0;
            only.theirs *= std::min(1.0, std::max(all[h].plausibility, as_rival) / all[best].plausibility);
            margin = only.theirs < 0.05 * area_all ? 1 : (only.ours - only.theirs) / (only.ours + only.theirs);
        }
        const Contest found = contest_of(rig.input(), *rig.hypotheses, best);
        ASSERT_EQ(found.hypothesis, most) << "seed " << seed;
        EXPECT_NEAR(found.margin, margin, 1e-9) << "seed " << seed;
        EXPECT_EQ(found.is_carried_on, most != Hypotheses::kNone && rig.context.rival_frames > 0 && seed % 8 < 4);
        EXPECT_EQ(found.is_tenable, margin < rig.configuration.region.contest_margin && found.is_carried_on &&
                                        rig.context.rival_frames + 1 >= rig.configuration.region.contest_frames)
            << "seed " << seed;
        rig.configuration.region.contest_margin = -1;
        EXPECT_FALSE(contest_of(rig.input(), *rig.hypotheses, best).is_tenable);
        if (most == Hypotheses::kNone) continue;
        EXPECT_EQ(metres_between(found.world_from_camera, all[most].world_from_camera), 0);
        carried += found.is_carried_on ? 1U : 0U;
        tenable += found.is_tenable ? 1U : 0U;
        missed += !found.is_carried_on && found.margin == 1 ? 1U : 0U;
    }
    EXPECT_GT(carried, 3U);
    EXPECT_GT(tenable, 3U);
    EXPECT_GT(missed, 3U);  // which nothing but its own past makes a rival
}

// Promise: where the motion that is carried on is the stronger rival, it is the one that is told.
TEST(Choice, TheStrongerRivalIsTold) {
    std::size_t told = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        const SE3 motion = moved(random.uniform(0.2, 0.4));
        Rig rig(150, 130, motion, random);
        fade_room(rig.scene);
        rig.context.rival_frames = static_cast<std::uint32_t>(seed % 4);
        rig.context.world_from_camera_rival = motion * rig.pose;
        rig.propose(random);
        const RegionChoice choice = choose_best(rig.input(), *rig.hypotheses, *rig.chosen);
        const Rival expected = rival_of(rig.input(), *rig.hypotheses, choice.hypothesis);
        EXPECT_EQ(choice.margin, expected.margin) << "which decides as before";
        EXPECT_EQ(choice.rival.chosen_share, expected.chosen_share);
        if (choice.contest.is_tenable && choice.contest.margin < expected.margin) {
            EXPECT_EQ(choice.rival.hypothesis, choice.contest.hypothesis);
            EXPECT_EQ(choice.rival.margin, choice.contest.margin);
            EXPECT_GT(choice.rival.share, 0.05);
            ++told;
        } else {
            EXPECT_EQ(choice.rival.hypothesis, expected.hypothesis);
            EXPECT_EQ(choice.rival.share, expected.share);
        }
    }
    EXPECT_GT(told, 3U);
}

// Promise: chosen is exactly what agrees with the choice, has a weight and belongs to no group that disagrees.
TEST(Choice, ChosenIsWhatAgrees) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        Rig rig(150, 100, moved(0.1), random);
        for (std::size_t i = 0; i < rig.scene.body.size(); i += 7) rig.scene.correspondences[i].weight = 0;
        rig.propose(random);
        const RegionChoice choice = choose_best(rig.input(), *rig.hypotheses, *rig.chosen);
        ASSERT_TRUE(choice.is_valid);
        std::vector<std::uint16_t> wanted;
        for (std::uint16_t i = 0; i < rig.scene.body.size(); ++i) {
            const Correspondence& c = rig.scene.correspondences[i];
            if (c.weight > 0 && chi2_of(c, choice.world_from_camera.inverse()) <= 11.34 &&
                rig.hypotheses->motions().agreement_of(rig.groups->group_of(i)) > 0) {
                wanted.push_back(i);
            }
        }
        EXPECT_EQ(std::vector<std::uint16_t>(rig.chosen->begin(), rig.chosen->end()), wanted) << "seed " << seed;
    }
}

// Promise: before points have a past, a body that most points lie on is not chosen over the room whose few points stand
// for more surface; with a past its points and triangles count alone, and it is.
TEST(Choice, TheLargerSurfaceBeforeThereIsAPast) {
    std::size_t captured = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        Rig rig(0, 330, moved(0.05), random);
        while (rig.scene.count(0) < 15) {  // on things at many depths: hardly a triangle of the mesh is whole
            const double x = random.uniform(10, 630), y = random.uniform(10, 470);
            if (x > 210 && x < 410 && y > 110) continue;
            const Vector3 p = at_pixel(x, y, random.uniform(2.2, 3.4));
            rig.scene.add(measure(p, rig.pose * p, kKinect, random), 0);
        }
        for (std::size_t i = 0; i < rig.scene.body.size(); ++i) {
            rig.scene.correspondences[i].weight = 1;
            rig.scene.correspondences[i].extent = rig.scene.body[i] == 0 ? 40 : 1;
        }
        const SE3 body_pose = moved(0.05) * rig.pose;
        rig.context = context_at(moved(0.025) * rig.pose);  // nothing tells them apart but what they explain
        rig.context.has_past = false;
        rig.propose(random);
        RegionChoice choice = choose_best(rig.input(), *rig.hypotheses, *rig.chosen);
        EXPECT_GE(rig.chosen->size(), 6U) << "seed " << seed;
        EXPECT_GE(choice.margin, 0) << "seed " << seed;
        for (const std::uint16_t i : *rig.chosen) EXPECT_EQ(rig.scene.body[i], 0) << "seed " << seed;
        rig.context.has_past = true;
        rig.propose(random);
        choice = choose_best(rig.input(), *rig.hypotheses, *rig.chosen);
        captured += metres_between(choice.world_from_camera, body_pose) < 0.02 ? 1U : 0U;
    }
    EXPECT_GT(captured, 15U) << "the scene tells nothing";
}

// Promise: of two bodies with a past the choice falls on the one of which a dozen points were there before all but two
// of the other's own, however much larger that is; without such a dozen, where the other has points as old, where
// either has no past, and with the rule switched off, the larger one is chosen.
TEST(Choice, TheElderBody) {
    const struct {
        std::uint16_t old_room, old_body, room_tenths, body_tenths;  // so many of each are older than these: 6 s
        std::uint32_t elder_points;
        bool is_room;
        const char* why;
    } cases[] = {
        {60, 0, 30, 30, 12, true, "the room was there before"},
        {0, 0, 30, 30, 12, false, "both are as old"},
        {14, 0, 20, 30, 12, true, "a dozen, or two more for what noise takes"},
        {11, 0, 20, 30, 12, false, "not a dozen"},
        {60, 2, 30, 30, 12, true, "two fix no pose"},
        {60, 3, 30, 30, 12, false, "three do"},
        {60, 0, 30, 6, 12, false, "the body has no past"},
        {60, 0, 30, 7, 12, true, "it just has"},
        {0, 0, 6, 5, 12, false, "neither has one"},
        {60, 0, 30, 30, 0, false, "switched off"},
        {60, 0, 30, 30, 61, false, "more are wanted"},
    };
    for (const auto& c : cases) {
        for (std::uint64_t seed = 0; seed < 10; ++seed) {
            Random random(seed);
            Rig rig(60, 330, moved(0.05), random);
            std::uint16_t seen[2] = {0, 0};
            for (std::size_t i = 0; i < rig.scene.body.size(); ++i) {
                const bool is_body = rig.scene.body[i] == 1;
                Correspondence& match = rig.scene.correspondences[i];
                const bool is_old = seen[is_body ? 1 : 0]++ < (is_body ? c.old_body : c.old_room);
                match.stood_tenths = is_old ? 60 : is_body ? c.body_tenths : c.room_tenths;
                match.weight = is_body ? 1 : 0.2;
            }
            rig.context = context_at(moved(0.025) * rig.pose);  // nothing else tells them apart
            rig.configuration.region.elder_points = c.elder_points;
            rig.propose(random);
            const RegionChoice choice = choose_best(rig.input(), *rig.hypotheses, *rig.chosen);
            const SE3 wanted = c.is_room ? rig.pose : moved(0.05) * rig.pose;
            EXPECT_LT(metres_between(choice.world_from_camera, wanted), 0.02) << c.why << ", seed " << seed;
        }
    }
}

// Promise: of hypotheses of one body none is preferred for its surface: more than half of what it explains has to be
// explained by it alone.
TEST(Choice, OneBodyIsNotAnother) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        Rig rig(300, 0, SE3{}, random);
        rig.context.has_past = false;
        rig.propose(random);
        const std::size_t best = best_of(*rig.hypotheses);
        EXPECT_EQ(largest_of(rig.input(), *rig.hypotheses, best), best) << "seed " << seed;
    }
}

// Promise: with the static region switched off no body is told from another by its surface either.
TEST(Choice, NoSurfaceWithoutARegion) {
    Random random(1);
    Rig rig(30, 330, moved(0.05), random);
    for (const bool is_enabled : {false, true}) {
        rig.configuration.region.is_enabled = is_enabled;
        rig.context.has_past = false;
        rig.propose(random);
        ASSERT_FALSE(rig.hypotheses->all().empty());
        double most = 0;
        for (const Hypothesis& h : rig.hypotheses->all()) most = std::max(most, h.surface);
        EXPECT_EQ(most > 0, is_enabled);
    }
}

}  // namespace
}  // namespace stillmesh::choice_test
