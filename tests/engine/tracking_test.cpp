#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "engine/features/own_extractor.hpp"
#include "tests/engine/engine_rig.hpp"

namespace stillmesh::tracking_test {
namespace {

using test::EngineRig;
using test::fitting;
using test::KeptFrame;
using test::kFrameGap_ns;
using test::Sequence;

constexpr std::uint32_t kWidth = 160, kHeight = 120;

Sequence tiny_sequence(const char* scene, std::uint32_t frames, std::uint64_t seed = 1) {
    return test::rendered(scene, frames, kWidth, kHeight, seed);
}

KeptFrame flat(const KeptFrame& like, std::uint8_t grey, std::uint16_t depth) {
    KeptFrame out = like;
    std::fill(out.colour.begin(), out.colour.end(), grey);
    std::fill(out.depth.begin(), out.depth.end(), depth);
    return out;
}

Frame at_time(const KeptFrame& kept, std::int64_t time_ns) {
    Frame frame = kept.frame();
    frame.time_ns = frame.depth_time_ns = time_ns;
    return frame;
}

void expect_sane(const PoseEstimate& pose) {
    double squared = 0;
    for (const double q : pose.odom_from_camera.rotation_xyzw) squared += q * q;
    EXPECT_NEAR(squared, 1.0, 1e-9);
    for (const double t : pose.odom_from_camera.translation_m) EXPECT_TRUE(std::isfinite(t));
    for (int i = 0; i < 6; ++i) {
        EXPECT_GE(pose.covariance[7 * i], 0.0);
        for (int j = 0; j < 6; ++j) {
            EXPECT_TRUE(std::isfinite(pose.covariance[6 * i + j]));
            const double scale = std::sqrt(pose.covariance[7 * i] * pose.covariance[7 * j]);
            EXPECT_NEAR(pose.covariance[6 * i + j], pose.covariance[6 * j + i], 1e-9 * scale + 1e-18);
        }
    }
}

void expect_same_pose(const RigidTransform& a, const RigidTransform& b) {
    for (int i = 0; i < 4; ++i) EXPECT_EQ(a.rotation_xyzw[i], b.rotation_xyzw[i]);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(a.translation_m[i], b.translation_m[i]);
}

// Promise: under tiny limits a run far longer than the pools fills every one of them, forgets by the stated policy, and
// stays where the truth is.
TEST(Engine, RunsOnWithAllPoolsFull) {
    const Sequence sequence = tiny_sequence("static_xyz", 300, 2);
    const EngineRig engine(Limits::tiny(), sequence.camera);
    ASSERT_EQ(engine.status(), Status::kOk);
    std::uint32_t measured = 0, keyframes = 0;
    double worst_step = 0, before = 0;
    for (const KeptFrame& kept : sequence.frames) {
        ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
        expect_sane(engine->pose());
        EXPECT_EQ(engine->pose().time_ns, kept.time_ns);
        measured += engine->pose().state >= PoseState::kUnsure ? 1U : 0U;
        keyframes += engine->frame_statistics().is_keyframe ? 1U : 0U;
        const double off = test::metres_off(engine->pose().odom_from_camera, sequence.frames[0].truth, kept.truth);
        worst_step = std::max(worst_step, std::abs(off - before));
        before = off;
        const EngineStatistics statistics = engine->statistics();
        ASSERT_LE(statistics.keyframes.size, Limits::tiny().keyframes_max);
        ASSERT_LE(statistics.map_points.size, Limits::tiny().map_points_max);
    }
    const EngineStatistics statistics = engine->statistics();
    EXPECT_EQ(statistics.keyframes.high_water, statistics.keyframes.capacity);
    EXPECT_EQ(statistics.map_points.high_water, statistics.map_points.capacity);
    EXPECT_EQ(statistics.keyframes.capacity, Limits::tiny().keyframes_max);
    EXPECT_EQ(statistics.map_points.capacity, Limits::tiny().map_points_max);
    EXPECT_EQ(statistics.keyframes_made, keyframes);
    EXPECT_EQ(statistics.keyframes_forgotten, keyframes - statistics.keyframes.size);
    EXPECT_GT(statistics.points_forgotten, Limits::tiny().map_points_max);
    EXPECT_EQ(statistics.frames, sequence.frames.size());
    EXPECT_EQ(statistics.frames_refused, 0U);
    EXPECT_GE(measured, sequence.frames.size() * 9 / 10);
    RecordProperty("measured", static_cast<int>(measured));
    EXPECT_LT(before, 0.5) << "m off at the end";
    EXPECT_LT(worst_step, 0.2) << "m";
}

// Promise: a trembling hand behind a rolling shutter costs neither trust nor place: rows say how the camera turned.
// Before they were asked, one frame in ten was tracked and the camera 12 mm off.
TEST(Engine, FollowsATremblingHand) {
    const Sequence sequence = test::rendered("shaken_xyz", 60, 320, 240);
    Limits limits = Limits::pocket();
    const EngineRig engine(limits, sequence.camera);
    ASSERT_EQ(engine.status(), Status::kOk);
    std::size_t tracked = 0;
    double square_m2 = 0;
    for (const KeptFrame& kept : sequence.frames) {
        ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
        expect_sane(engine->pose());
        tracked += engine->pose().state == PoseState::kTracked ? 1U : 0U;
        const double off_m = test::metres_off(engine->pose().odom_from_camera, sequence.frames[0].truth, kept.truth);
        square_m2 += off_m * off_m;
    }
    const auto frames = static_cast<double>(sequence.frames.size());
    EXPECT_GE(static_cast<double>(tracked), 0.8 * frames);
    EXPECT_LT(std::sqrt(square_m2 / frames), 0.006);
}

// Promise: what is called moving moves: next to nothing in a still room, a good part of what is matched among people.
TEST(Engine, WhatMovesIsCalledMoving) {
    const auto share_of = [](const char* scene) {
        const Sequence sequence = test::rendered(scene, 60, 320, 240);
        const EngineRig engine(Limits::pocket(), sequence.camera);
        std::uint32_t moving = 0, matches = 0;
        for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
            EXPECT_EQ(engine->submit(sequence.frames[i].frame()), Status::kOk);
            if (i < 30) continue;
            moving += engine->frame_statistics().dynamic_matches;
            matches += engine->frame_statistics().matches;
        }
        return static_cast<double>(moving) / matches;
    };
    EXPECT_LT(share_of("static_xyz"), 0.05);
    EXPECT_GT(share_of("walking_xyz"), 0.25);
}

// Promise: statistics and what is drawn say the same, and no more than there is.
TEST(Engine, StatisticsAndViewAgree) {
    const Sequence sequence = test::rendered("walking_xyz", 45, 320, 240);
    Limits limits = Limits::pocket();
    limits.features_max = 300;
    const EngineRig engine(limits, sequence.camera);
    std::uint64_t frame = 0;
    std::uint32_t with_groups = 0, with_rival = 0;
    for (const KeptFrame& kept : sequence.frames) {
        ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
        const FrameStatistics& s = engine->frame_statistics();
        const TrackingView view = engine->tracking_view();
        EXPECT_EQ(s.frame, frame++);
        EXPECT_EQ(view.features.size(), s.features);
        EXPECT_LE(s.features, limits.features_max);
        EXPECT_LE(s.features_with_depth, s.features);
        EXPECT_LE(s.static_matches + s.dynamic_matches, s.matches);
        EXPECT_LE(s.mesh_edges_kept, s.mesh_edges);
        EXPECT_EQ(s.unsure == UnsureReason::kNone, engine->pose().state != PoseState::kUnsure);
        EXPECT_GE(s.region_margin, -1.0);
        EXPECT_LE(s.region_margin, 1.0);
        ASSERT_EQ(view.explained_by.size(), view.features.size());
        const auto count_by = [&view](unsigned motion) {
            return std::count_if(view.explained_by.begin(), view.explained_by.end(),
                                 [motion](std::uint8_t by) { return (by & motion) != 0; });
        };
        EXPECT_EQ(s.rival_share > 0, count_by(TrackingView::kByRival) > 0) << s.frame;
        EXPECT_EQ(s.chosen_share > 0, count_by(TrackingView::kByChoice) > 0) << s.frame;
        EXPECT_LE(std::max(s.chosen_share, s.rival_share), 1.0);
        with_rival += s.rival_share > 0 ? 1U : 0U;
        std::uint32_t matched = 0, still = 0, moving = 0, kept_edges = 0;
        for (const TrackedFeature& f : view.features) {
            matched += f.is_matched;
            still += f.is_static;
            moving += f.is_dynamic;
            EXPECT_TRUE(f.is_matched || !(f.is_static || f.is_dynamic));
            EXPECT_FALSE(f.is_static && f.is_dynamic);
            EXPECT_LT(f.group, static_cast<std::int32_t>(s.groups));
            with_groups += f.group >= 0 ? 1U : 0U;
        }
        for (const TrackedEdge& e : view.edges) kept_edges += e.is_kept;
        EXPECT_EQ(matched, s.matches);
        EXPECT_EQ(still, s.static_matches);
        EXPECT_EQ(moving, s.dynamic_matches);
        EXPECT_EQ(view.edges.size(), s.mesh_edges);
        EXPECT_EQ(kept_edges, s.mesh_edges_kept);
    }
    EXPECT_GT(with_groups, 100U);
    EXPECT_GT(with_rival, 0U);
}

// Promise: a wrong frame is kInvalid, counted, and nothing else changes: a run with wrong frames between the right ones
// gives the bits of a run without.
TEST(Engine, WrongFramesChangeNothing) {
    const Sequence sequence = tiny_sequence("walking_static", 25);
    const EngineRig clean(Limits::tiny(), sequence.camera), engine(Limits::tiny(), sequence.camera);
    const std::vector<std::function<void(Frame&)>> wrongs = {
        [](Frame& f) { f.colour.data = nullptr; },
        [](Frame& f) { f.depth.data = nullptr; },
        [](Frame& f) { --f.colour.width; },
        [](Frame& f) { ++f.colour.width; },
        [](Frame& f) { --f.colour.height; },
        [](Frame& f) { f.depth.width = 0; },
        [](Frame& f) { ++f.depth.height; },
        [](Frame& f) { f.colour.stride = kWidth - 1; },
        [](Frame& f) { f.depth.stride = kWidth - 1; },
        [](Frame& f) { f.format = PixelFormat::kRgb8; },  // three times as wide as the stride says
        [](Frame& f) { f.format = static_cast<PixelFormat>(0); },
        [](Frame& f) {
            f.format = static_cast<PixelFormat>(77);
            f.colour.stride = 3 * kWidth;
        },
        [](Frame& f) { f.time_ns = -1; },
        [](Frame& f) { f.time_ns = std::numeric_limits<std::int64_t>::min(); },
        [](Frame& f) { f.time_ns = std::numeric_limits<std::int64_t>::max(); },
        [](Frame& f) { f.time_ns = std::int64_t{1} << 62U; },
        [](Frame& f) { f.depth_units_per_m = 0; },
        [](Frame& f) { f.depth_units_per_m = -5000; },
        [](Frame& f) { f.depth_units_per_m = 1e9; },
        [](Frame& f) { f.depth_units_per_m = std::numeric_limits<double>::quiet_NaN(); },
        [](Frame& f) { f.depth_units_per_m = std::numeric_limits<double>::infinity(); },
    };
    std::uint64_t refused = 0;
    for (const KeptFrame& kept : sequence.frames) {
        const std::uint64_t hash = engine->state_hash();
        const std::size_t features = engine->tracking_view().features.size();
        for (std::size_t i = 0; i < wrongs.size(); ++i) {
            Frame wrong = kept.frame();
            wrongs[i](wrong);
            ASSERT_EQ(engine->submit(wrong), Status::kInvalid) << i;
            ASSERT_EQ(engine->statistics().frames_refused, ++refused);
            ASSERT_EQ(engine->state_hash(), hash) << i;
        }
        EXPECT_EQ(engine->tracking_view().features.size(), features);
        ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
        ASSERT_EQ(engine->submit(kept.frame()), Status::kInvalid) << "the same time again";
        ASSERT_EQ(engine->submit(at_time(kept, kept.time_ns - 1)), Status::kInvalid) << "a time before";
        refused += kept.time_ns > 0 ? 2U : 2U;
        ASSERT_EQ(clean->submit(kept.frame()), Status::kOk);
        ASSERT_EQ(engine->state_hash(), clean->state_hash());
        expect_same_pose(engine->pose().odom_from_camera, clean->pose().odom_from_camera);
    }
    EXPECT_EQ(clean->statistics().frames_refused, 0U);
    EXPECT_EQ(engine->statistics().frames, sequence.frames.size());
}

// Promise: a covered lens gives predicted poses for as long as configured, then none; the pose stays where the motion
// before ended, its covariance grows; uncovered, the engine finds itself again by its keyframes and counts it.
TEST(Engine, CoveredLensThenRecovery) {
    const Sequence sequence = tiny_sequence("static_xyz", 90);
    Parameters configuration = fitting(Limits::tiny());
    configuration.pose.lost_frames_max = 12;
    const EngineRig engine(Limits::tiny(), sequence.camera, configuration);
    std::int64_t time_ns = 0;
    std::size_t next = 0;
    for (; next < 50; ++next)
        ASSERT_EQ(engine->submit(at_time(sequence.frames[next], time_ns += kFrameGap_ns)), Status::kOk);
    ASSERT_GE(engine->pose().state, PoseState::kUnsure);
    const RigidTransform last = engine->pose().odom_from_camera;
    double trace_before = 0;
    for (int i = 0; i < 6; ++i) trace_before += engine->pose().covariance[7 * i];
    RigidTransform at_the_end;
    const KeptFrame black = flat(sequence.frames[0], 0, 0), dark = flat(sequence.frames[0], 3, 4000);
    for (std::uint32_t i = 0; i < 30; ++i) {
        ASSERT_EQ(engine->submit(at_time(i % 2 == 0 ? black : dark, time_ns += kFrameGap_ns)), Status::kOk);
        expect_sane(engine->pose());
        EXPECT_EQ(engine->pose().state, i < 12 ? PoseState::kPredicted : PoseState::kNone) << i;
        EXPECT_EQ(engine->frame_statistics().matches, 0U);
        EXPECT_FALSE(engine->frame_statistics().is_keyframe);
        EXPECT_EQ(engine->statistics().frames_lost, i < 12 ? 0U : i - 11);
        double trace = 0;
        for (int k = 0; k < 6; ++k) trace += engine->pose().covariance[7 * k];
        EXPECT_GT(trace, trace_before) << i;
        trace_before = trace;
        const auto& t = engine->pose().odom_from_camera.translation_m;
        const double away =
            std::hypot(t[0] - last.translation_m[0], t[1] - last.translation_m[1], t[2] - last.translation_m[2]);
        EXPECT_LT(away, 0.2) << "m; a motion nobody saw";
        if (i == 12) at_the_end = engine->pose().odom_from_camera;
        if (i > 12) expect_same_pose(engine->pose().odom_from_camera, at_the_end);
    }
    EXPECT_EQ(engine->statistics().recoveries, 0U);
    // Uncovered, a little off the way, so that the prediction alone does not do.
    std::uint32_t until_found = 0;
    next += 3;
    for (std::uint32_t i = 0; next < sequence.frames.size(); ++next, ++i) {
        ASSERT_EQ(engine->submit(at_time(sequence.frames[next], time_ns += kFrameGap_ns)), Status::kOk);
        if (engine->pose().state >= PoseState::kUnsure) {
            EXPECT_LT(test::metres_off(engine->pose().odom_from_camera, sequence.frames[0].truth,
                                       sequence.frames[next].truth),
                      0.1);
        } else {
            until_found = i + 1;
        }
    }
    EXPECT_LE(until_found, 16U + 8U) << "one round over the keyframes, and the probation";
    EXPECT_EQ(engine->statistics().recoveries, 1U);
    EXPECT_GE(engine->pose().state, PoseState::kUnsure);
}

// Promise: while depth is gone no pose is `tracked`, however many points agree; a second behind it poses are again.
TEST(Engine, WithoutDepthNothingIsSure) {
    const Sequence sequence = tiny_sequence("static_xyz", 102);
    const EngineRig engine(Limits::tiny(), sequence.camera, fitting(Limits::tiny()));
    std::uint32_t measured = 0, tracked = 0;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        KeptFrame frame = sequence.frames[i];
        const bool is_blind = i >= 40 && i < 60;
        if (is_blind) std::fill(frame.depth.begin(), frame.depth.end(), std::uint16_t{0});
        ASSERT_EQ(engine->submit(frame.frame()), Status::kOk);
        if (is_blind) {
            EXPECT_NE(engine->pose().state, PoseState::kTracked) << i;
            measured += engine->pose().state == PoseState::kUnsure ? 1U : 0U;
        }
        if (i >= 92 && engine->pose().state == PoseState::kTracked) ++tracked;
    }
    EXPECT_GE(measured, 10U) << "the map's points are followed all the same";
    EXPECT_EQ(tracked, 10U);
}

// Promise: what is not there is not invented: from black, saturated, flat or depthless frames alone no pose ever comes.
TEST(Engine, NothingComesOfNothing) {
    const Sequence sequence = tiny_sequence("static_xyz", 6);
    const EngineRig engine(Limits::tiny(), sequence.camera);
    std::int64_t time_ns = 0;
    KeptFrame no_depth = sequence.frames[0];
    std::fill(no_depth.depth.begin(), no_depth.depth.end(), std::uint16_t{0});
    KeptFrame too_far = sequence.frames[0];
    std::fill(too_far.depth.begin(), too_far.depth.end(), std::uint16_t{65535});
    KeptFrame pressed = sequence.frames[0];
    std::fill(pressed.depth.begin(), pressed.depth.end(), std::uint16_t{200});
    const std::vector<KeptFrame> nothings = {flat(no_depth, 0, 0), flat(no_depth, 255, 5000), no_depth, too_far,
                                             pressed};
    for (int round = 0; round < 8; ++round) {
        for (const KeptFrame& nothing : nothings) {
            ASSERT_EQ(engine->submit(at_time(nothing, time_ns += kFrameGap_ns)), Status::kOk);
            ASSERT_EQ(engine->pose().state, PoseState::kNone);
            ASSERT_EQ(engine->statistics().map_points.size, 0U);
            expect_sane(engine->pose());
        }
    }
    EXPECT_EQ(engine->statistics().frames_lost, 0U) << "nobody is lost who never was anywhere";
    // The first good frame is the origin.
    for (const KeptFrame& kept : sequence.frames) {
        ASSERT_EQ(engine->submit(at_time(kept, time_ns += kFrameGap_ns)), Status::kOk);
        EXPECT_GE(engine->pose().state, PoseState::kUnsure);
        EXPECT_LT(test::metres_off(engine->pose().odom_from_camera, sequence.frames[0].truth, kept.truth), 0.05);
        if (&kept == &sequence.frames[0]) expect_same_pose(engine->pose().odom_from_camera, RigidTransform{});
    }
}

// Promise: two engines side by side, in blocks of different garbage, give the same bits, frame by frame.
TEST(Engine, TwoSideBySideGiveTheSameBits) {
    const Sequence sequence = tiny_sequence("walking_xyz", 40), other = tiny_sequence("walking_rpy", 40);
    const EngineRig a(Limits::tiny(), sequence.camera, fitting(Limits::tiny()), cpu_kernels(), 0);
    const EngineRig b(Limits::tiny(), sequence.camera, fitting(Limits::tiny()), cpu_kernels(), 0xa5);
    const EngineRig disturber(Limits::tiny(), sequence.camera);
    std::uint64_t last = 0;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        ASSERT_EQ(a->submit(sequence.frames[i].frame()), Status::kOk);
        ASSERT_EQ(disturber->submit(other.frames[i].frame()), Status::kOk);
        ASSERT_EQ(b->submit(sequence.frames[i].frame()), Status::kOk);
        ASSERT_EQ(a->state_hash(), b->state_hash()) << i;
        ASSERT_NE(a->state_hash(), last) << "the hash does not see the frame";
        last = a->state_hash();
        expect_same_pose(a->pose().odom_from_camera, b->pose().odom_from_camera);
        for (int k = 0; k < 36; ++k) ASSERT_EQ(a->pose().covariance[k], b->pose().covariance[k]);
    }
    ASSERT_NE(a->state_hash(), disturber->state_hash());
}

// Promise: the state hash sees decisions that poses do not show: another start weight of new points, the same poses,
// another hash.
TEST(Engine, HashSeesMoreThanPoses) {
    const Sequence sequence = tiny_sequence("static_xyz", 4);
    Parameters configuration = fitting(Limits::tiny());
    const EngineRig a(Limits::tiny(), sequence.camera, configuration);
    configuration.weights.eligible = 12;
    const EngineRig b(Limits::tiny(), sequence.camera, configuration);
    std::uint32_t same_poses = 0, same_hashes = 0;
    for (const KeptFrame& kept : sequence.frames) {
        ASSERT_EQ(a->submit(kept.frame()), Status::kOk);
        ASSERT_EQ(b->submit(kept.frame()), Status::kOk);
        const auto& s = a->pose().odom_from_camera.translation_m;
        const auto& t = b->pose().odom_from_camera.translation_m;
        same_poses += s[0] == t[0] && s[1] == t[1] && s[2] == t[2] ? 1U : 0U;
        same_hashes += a->state_hash() == b->state_hash() ? 1U : 0U;
    }
    EXPECT_GE(same_poses, 1U);
    EXPECT_LE(same_hashes, 1U) << "only the first frame has no match to tell by";
}

// Promise: after reset() everything is as in a new engine, bit by bit, wherever it was before: lost, full, or new.
TEST(Engine, ResetEqualsANewEngine) {
    const Sequence sequence = tiny_sequence("walking_xyz", 40), before = tiny_sequence("static_loop", 120);
    for (const int history : {0, 1, 40, 120, 160}) {
        const EngineRig used(Limits::tiny(), sequence.camera), fresh(Limits::tiny(), sequence.camera);
        std::int64_t time_ns = 0;
        for (int i = 0; i < history; ++i) {
            const KeptFrame& kept = i < 120 ? before.frames[static_cast<std::size_t>(i)] : flat(before.frames[0], 0, 0);
            ASSERT_EQ(used->submit(at_time(kept, time_ns += kFrameGap_ns)), Status::kOk);
            ASSERT_EQ(used->submit(at_time(kept, time_ns)), Status::kInvalid);
        }
        used->reset();
        EXPECT_EQ(used->state_hash(), fresh->state_hash());
        EXPECT_EQ(used->pose().state, PoseState::kNone);
        expect_same_pose(used->pose().odom_from_camera, RigidTransform{});
        EXPECT_TRUE(used->tracking_view().features.empty());
        EXPECT_TRUE(used->tracking_view().edges.empty());
        for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
            const KeptFrame kept = i < 2 ? flat(sequence.frames[i], 0, 0) : sequence.frames[i];
            ASSERT_EQ(used->submit(kept.frame()), Status::kOk) << "times start anew";
            ASSERT_EQ(fresh->submit(kept.frame()), Status::kOk);
            ASSERT_EQ(used->state_hash(), fresh->state_hash()) << "history " << history;
            expect_same_pose(used->pose().odom_from_camera, fresh->pose().odom_from_camera);
            for (int k = 0; k < 36; ++k) ASSERT_EQ(used->pose().covariance[k], fresh->pose().covariance[k]) << history;
            ASSERT_EQ(used->frame_statistics().frame, fresh->frame_statistics().frame);
            ASSERT_EQ(used->frame_statistics().matches, fresh->frame_statistics().matches);
        }
        const EngineStatistics a = used->statistics(), b = fresh->statistics();
        EXPECT_EQ(a.frames, b.frames);
        EXPECT_EQ(a.frames_refused, b.frames_refused);
        EXPECT_EQ(a.keyframes_made, b.keyframes_made);
        EXPECT_EQ(a.keyframes_forgotten, b.keyframes_forgotten);
        EXPECT_EQ(a.points_forgotten, b.points_forgotten);
        EXPECT_EQ(a.frames_lost, b.frames_lost);
        EXPECT_EQ(a.recoveries, b.recoveries);
    }
}

// Promise: plain, SSE2 and AVX2 kernels give the same state hash at every frame, in grey, RGB and BGR.
TEST(Engine, KernelsGiveTheSameBits) {
    std::vector<const Kernels*> all = {&plain_kernels()};
    if (sse2_kernels() != nullptr) all.push_back(sse2_kernels());
    if (&cpu_kernels() == neon_kernels()) all.push_back(neon_kernels());
#if defined(__x86_64__)
    if (avx2_kernels() != nullptr && __builtin_cpu_supports("avx2")) all.push_back(avx2_kernels());
#endif
    RecordProperty("kernels", static_cast<int>(all.size()));
    const Sequence sequence = tiny_sequence("sitting_xyz", 30);
    for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kRgb8, PixelFormat::kBgr8}) {
        std::vector<std::uint64_t> wanted;
        for (const Kernels* kernels : all) {
            const EngineRig engine(Limits::tiny(), sequence.camera, fitting(Limits::tiny()), *kernels);
            for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
                KeptFrame kept = sequence.frames[i];
                if (format != PixelFormat::kGrey8) {
                    kept.format = format;
                    std::vector<std::uint8_t> colour;
                    for (const std::uint8_t grey : kept.colour) {  // three different channels
                        colour.push_back(static_cast<std::uint8_t>(grey / 2 + 40));
                        colour.push_back(grey);
                        colour.push_back(static_cast<std::uint8_t>(255 - grey / 3));
                    }
                    kept.colour = colour;
                }
                ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
                if (kernels == all[0]) wanted.push_back(engine->state_hash());
                ASSERT_EQ(engine->state_hash(), wanted[i]) << "frame " << i;
            }
            EXPECT_GE(engine->pose().state, PoseState::kUnsure);
        }
    }
}

// Promise: any times that rise within their bounds are taken, seconds or years apart, and poses stay finite.
TEST(Engine, TakesAnyRisingTimes) {
    const Sequence sequence = tiny_sequence("static_xyz", 20);
    const EngineRig engine(Limits::tiny(), sequence.camera);
    std::int64_t time_ns = 0;
    const std::int64_t gaps[] = {0,
                                 1,
                                 1,
                                 2,
                                 1'000'000,
                                 kFrameGap_ns,
                                 kFrameGap_ns,
                                 5'000'000'000,
                                 kFrameGap_ns,
                                 std::int64_t{1} << 61U,
                                 kFrameGap_ns,
                                 1};
    std::size_t i = 0;
    for (const std::int64_t gap : gaps) {
        ASSERT_EQ(engine->submit(at_time(sequence.frames[i++], time_ns += gap)), Status::kOk);
        expect_sane(engine->pose());
    }
    ASSERT_EQ(engine->submit(at_time(sequence.frames[i++], (std::int64_t{1} << 62U) - 1)), Status::kOk);
    expect_sane(engine->pose());
    ASSERT_EQ(engine->submit(at_time(sequence.frames[i++], std::numeric_limits<std::int64_t>::max())),
              Status::kInvalid);
}

// Promise: the observer sees every stage begin and end, one at a time, in the order of a frame.
TEST(Engine, ObserverSeesEveryStage) {
    struct Watch {
        std::vector<Stage> begun;
        bool is_open = false;
        bool is_proper = true;
    } watch;
    const Sequence sequence = tiny_sequence("static_xyz", 10);
    const EngineRig engine(Limits::tiny(), sequence.camera);
    engine->set_stage_observer({[](void* user, Stage stage, bool is_begin) noexcept {
                                    auto& w = *static_cast<Watch*>(user);
                                    if (is_begin == w.is_open) w.is_proper = false;
                                    if (!is_begin && (w.begun.empty() || w.begun.back() != stage)) w.is_proper = false;
                                    w.is_open = is_begin;
                                    if (is_begin) w.begun.push_back(stage);
                                },
                                &watch});
    for (const KeptFrame& kept : sequence.frames) {
        watch.begun.clear();
        ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
        EXPECT_TRUE(watch.is_proper);
        EXPECT_FALSE(watch.is_open);
    }
    ASSERT_EQ(watch.begun.size(), kStages);
    for (std::uint32_t i = 0; i < kStages; ++i)
        EXPECT_EQ(watch.begun[i], static_cast<Stage>(i)) << stage_name(static_cast<Stage>(i));
    engine->set_stage_observer({});
    watch.begun.clear();
    ASSERT_EQ(engine->submit(at_time(sequence.frames[0], sequence.frames[9].time_ns + 1)), Status::kOk);
    EXPECT_TRUE(watch.begun.empty());
}

// The engine's own, with a look at what it is told of bodies that move.
class Told final : public FeatureExtractor {
public:
    MovingCells moving;
    explicit Told(const Limits& limits)
        : memory_(own_extractor_bytes(limits)),
          own_(create_own_extractor(memory_.span(), limits, fitting(limits).features, cpu_kernels()).value()) {}
    [[nodiscard]] Status extract(const GreyView& image, FeatureSet& features) noexcept override {
        return own_.extractor->extract(image, features);
    }
    void set_moving(const MovingCells& cells) noexcept override {
        moving = cells;
        own_.extractor->set_moving(cells);
    }

private:
    test::Memory memory_;
    OwnExtractor own_;
};

// Promise: an extractor is told where bodies move, from the second second on; in a still room nothing does; a camera
// that is lost has no say, nor has an engine before.
TEST(Engine, LooksLessWhereBodiesMove) {
    for (const bool walk : {true, false}) {
        const Sequence sequence = test::rendered(walk ? "walking_xyz" : "static_xyz", 60, 320, 240);
        Told told(Limits::pocket());
        told.moving.add(3, 4);
        const EngineRig engine(Limits::pocket(), sequence.camera, fitting(Limits::pocket()), cpu_kernels(), 0, &told);
        std::uint32_t frames = 0;
        for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
            ASSERT_EQ(engine->submit(sequence.frames[i].frame()), Status::kOk);
            if (i < 25) {
                EXPECT_TRUE(told.moving.is_empty()) << i;
            }
            frames += told.moving.is_empty() ? 0U : 1U;
        }
        if (walk) {
            EXPECT_GT(frames, 25U);
        } else {
            EXPECT_LT(frames, 5U);
        }
        const KeptFrame black = flat(sequence.frames.back(), 0, 0);
        ASSERT_EQ(engine->submit(at_time(black, black.time_ns + kFrameGap_ns)), Status::kOk);
        EXPECT_TRUE(told.moving.is_empty());
    }
}

// An extractor of others: wrong in every way a foreign library can be.
class Wild final : public FeatureExtractor {
public:
    int how = 0;
    [[nodiscard]] Status extract(const GreyView& image, FeatureSet& features) noexcept override {
        features.clear();
        const auto push = [&](float x, float y, std::uint8_t level) {
            Keypoint k;
            k.x = x;
            k.y = y;
            k.level = level;
            return features.keypoints.push(k) && features.descriptors.push(Descriptor{});
        };
        const auto width = static_cast<float>(image.width);
        bool fits = true;
        for (int i = 0; i < 40 && fits; ++i) fits = push(static_cast<float>(i * 3 + 5), 50, 0);
        switch (how) {
            case 0: return Status::kInvalid;
            case 1: fits = push(width, 5, 0); break;
            case 2: fits = push(-0.5F, 5, 0); break;
            case 3: fits = push(std::numeric_limits<float>::quiet_NaN(), 5, 0); break;
            case 4: fits = push(5, std::numeric_limits<float>::infinity(), 0); break;
            case 5: fits = push(5, 5, 255); break;
            case 6: fits = features.keypoints.push({}); break;  // without a descriptor
            case 7: break;                                      // all alike, on one line
            case 8: features.clear(); break;
            default:
                for (int i = 0; i < 60; ++i) fits = push(80, 60, 0);
                break;  // all in one place
        }
        return fits ? Status::kOk : Status::kFull;
    }
};

// Promise: a foreign extractor that fails or lies costs its frames, never the engine.
TEST(Engine, ForeignExtractorsMayLie) {
    const Sequence sequence = tiny_sequence("static_xyz", 4);
    Wild wild;
    const EngineRig engine(Limits::tiny(), sequence.camera, fitting(Limits::tiny()), cpu_kernels(), 0, &wild);
    std::int64_t time_ns = 0;
    for (int round = 0; round < 60; ++round) {
        wild.how = round % 10;
        const KeptFrame& kept = sequence.frames[static_cast<std::size_t>(round % 4)];
        ASSERT_EQ(engine->submit(at_time(kept, time_ns += kFrameGap_ns)), Status::kOk);
        expect_sane(engine->pose());
        if (wild.how < 7) {
            EXPECT_EQ(engine->frame_statistics().features, 0U) << wild.how;
        }
        EXPECT_NE(engine->pose().state, round < 7 ? PoseState::kTracked : static_cast<PoseState>(9));
    }
}

}  // namespace
}  // namespace stillmesh::tracking_test
