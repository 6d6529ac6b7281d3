#include "engine/tracking/tracking.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "engine/features/hamming.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::tracking_test {
namespace {

using test::DrawnScene;
using test::KeptFrame;

constexpr Limits kLimits{320, 240, 4, 300, 12, 1500, 32};

Parameters fitting() {
    Parameters out;
    out.features.count = kLimits.features_max;
    out.features.levels = kLimits.pyramid_levels_max;
    return out;
}

// Tracking alone, with its map open to the eye.
class Rig {
public:
    explicit Rig(const CameraModel& camera, const Parameters& configuration) : memory_(planned()) {
        Arena arena(memory_.span());
        world_.create(arena, kLimits, configuration, camera);
        tracking_.create(arena, world_, cpu_kernels(), nullptr);
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
    }
    [[nodiscard]] Tracking* operator->() { return &tracking_; }
    [[nodiscard]] World& world() { return world_; }
    [[nodiscard]] const PoseEstimate& pose() const { return world_.pose; }
    [[nodiscard]] const Map& map() const { return world_.map; }

private:
    static std::size_t planned() {
        ArenaPlan plan;
        World::plan(plan, kLimits);
        Tracking::plan(plan, kLimits);
        return plan.used_bytes();
    }
    test::Memory memory_;
    World world_;
    Tracking tracking_;
};

bool is_of_board(const DrawnScene& scene, const MapPoint& point) {
    return point.world[2] < 0.5 * (scene.wall_m + scene.board_m);
}

struct Seen {
    std::uint32_t generation = 0;
    std::uint32_t weight = 0;
};

std::map<std::uint32_t, Seen> weights_of(const Map& map) {
    std::map<std::uint32_t, Seen> out;
    for (std::uint32_t slot = 0; slot < map.points().slots_count(); ++slot) {
        if (!map.points().is_taken(slot)) continue;
        out[slot] = {map.points().handle_of(slot).generation, map.points().at(slot).weight_tenths};
    }
    return out;
}

// Promise: static weights (Algorithm 2): new points start at 1 (0.9 beside what moves), a frame adds or takes theta at
// most, within [0, 2]; what stands still rises, what moves falls and loses its weight.
TEST(Tracking, WeightsRiseAndFall) {
    for (const std::uint32_t max : {20U, 16U}) {
        const DrawnScene scene;
        Parameters configuration = fitting();
        configuration.weights.max = max;
        configuration.keyframes.tracked_urgent_permille = 300;  // what comes into view is followed soon
        Rig rig(scene.camera(), configuration);
        std::map<std::uint32_t, Seen> before;
        std::uint32_t rises = 0, falls = 0;
        for (std::uint32_t i = 0; i < 60; ++i) {
            const KeptFrame kept = scene.draw(i);
            rig->track(kept.frame());
            const auto now = weights_of(rig.map());
            for (const auto& [slot, seen] : now) {
                ASSERT_LE(seen.weight, max);
                const auto known = before.find(slot);
                if (known == before.end() || known->second.generation != seen.generation) {
                    ASSERT_TRUE(seen.weight == configuration.weights.eligible ||
                                seen.weight == configuration.weights.suspicious)
                        << seen.weight;
                    continue;
                }
                const auto change =
                    static_cast<std::int32_t>(seen.weight) - static_cast<std::int32_t>(known->second.weight);
                ASSERT_LE(std::abs(change), 1);
                if (rig.pose().state != PoseState::kTracked) {
                    ASSERT_EQ(change, 0);
                }
                rises += change > 0;
                falls += change < 0;
            }
            before = now;
        }
        EXPECT_EQ(rig.pose().state, PoseState::kTracked);
        EXPECT_GT(rises, 1000U);
        EXPECT_GT(falls, 100U);
        std::uint32_t still = 0, still_high = 0, moving = 0, moving_low = 0, moving_mute = 0;
        for (std::uint32_t slot = 0; slot < rig.map().points().slots_count(); ++slot) {
            if (!rig.map().points().is_taken(slot)) continue;
            const MapPoint& point = rig.map().points().at(slot);
            if (point.seen < 25) continue;
            if (is_of_board(scene, point)) {
                ++moving;
                moving_low += point.weight_tenths < configuration.weights.eligible;
                moving_mute += point.is_suspect;
            } else {
                ++still;
                still_high += point.weight_tenths >= max - 2;
            }
        }
        ASSERT_GT(still, 50U);
        ASSERT_GT(moving, 10U);
        EXPECT_GE(still_high, still * 95 / 100);
        EXPECT_GE(moving_low, moving * 9 / 10);
        EXPECT_GE(moving_mute, moving * 9 / 10);
    }
}

// Promise: a frame whose choice was unsure changes no weight, and neither does a run without region extraction.
TEST(Tracking, UnsureFramesChangeNoWeight) {
    const DrawnScene scene;
    for (const bool is_enabled : {true, false}) {
        Parameters configuration = fitting();
        configuration.region.is_enabled = is_enabled;
        Rig rig(scene.camera(), configuration);
        for (std::uint32_t i = 0; i < 30; ++i) {
            const KeptFrame kept = scene.draw(i);
            rig->track(kept.frame());
            if (is_enabled) rig.world().parameters.pose.sure_inliers_factor = 100;  // from now on nothing is sure
            if (i > 0 && is_enabled) {
                EXPECT_EQ(rig.pose().state, PoseState::kUnsure) << i;
            }
            for (const auto& [slot, seen] : weights_of(rig.map())) {
                ASSERT_TRUE(seen.weight == configuration.weights.eligible ||
                            seen.weight == configuration.weights.suspicious);
            }
        }
        EXPECT_GT(rig->frame_statistics().matches, 100U);
    }
}

// Promise: points that come back into view as far aside as odometry may have drifted meanwhile keep their weight and
// stay where they are; those that were in view all the time and lie as far aside have moved.
TEST(Tracking, DriftIsNoMotion) {
    constexpr double kAside_m = 0.035;
    constexpr float kTravelled = 15;
    constexpr std::int64_t kTime_ns = 20'000'000'000;
    DrawnScene scene;
    scene.has_board = false;
    for (const bool was_out_of_view : {true, false}) {
        Rig rig(scene.camera(), fitting());
        std::uint32_t i = 0;
        for (; i < 30; ++i) rig->track(scene.draw(i).frame());
        // The upper third of the wall, where odometry has it now.
        std::map<std::uint32_t, double> aside;
        Pool<MapPoint>& points = rig.world().map.points();
        for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
            if (!points.is_taken(slot) || points.at(slot).world[1] > -0.1 || points.at(slot).seen < 25) continue;
            MapPoint& point = points.at(slot);
            point.world[1] += kAside_m;
            point.anchor[1] += kAside_m;
            if (was_out_of_view) point.agreed_travelled -= kTravelled;
            if (was_out_of_view) point.anchor_ns -= kTime_ns;
            aside[slot] = point.world[1];
        }
        ASSERT_GT(aside.size(), 20U);
        for (; i < 46; ++i) {
            rig->track(scene.draw(i).frame());
            ASSERT_EQ(rig.pose().state, PoseState::kTracked);
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[1], 0, 0.005) << i;
        }
        std::uint32_t mute = 0, moved = 0;
        for (const auto& [slot, y] : aside) {
            mute += points.at(slot).is_suspect;
            moved += std::abs(points.at(slot).world[1] - y) > 0.25 * kAside_m;
        }
        if (was_out_of_view) {
            EXPECT_LE(mute, aside.size() / 20);
            EXPECT_LE(moved, aside.size() / 10);
        } else {
            EXPECT_GE(mute, aside.size() * 9 / 10);
        }
    }
}

// Promise: the camera's way comes out, the wall's points lie on the wall, and nearly nothing on the board that slides
// through the view counts.
TEST(Tracking, FollowsTheWallNotTheBoard) {
    for (const std::int32_t board_speed : {-4, 2, 3, 5}) {
        DrawnScene scene;
        scene.board_px_per_frame = board_speed;
        scene.board_left = board_speed > 0 ? 10 : 200;
        Rig rig(scene.camera(), fitting());
        std::uint32_t wrong = 0, counted = 0, board = 0;
        for (std::uint32_t i = 0; i < 50; ++i) {
            const KeptFrame kept = scene.draw(i);
            rig->track(kept.frame());
            ASSERT_GE(rig.pose().state, PoseState::kUnsure) << "speed " << board_speed << " frame " << i;
            // Who moves is not known from two frames.
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(i), i < 5 ? 0.02 : 0.01)
                << "speed " << board_speed << " frame " << i;
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[1], 0, 0.01);
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[2], 0, 0.01);
            const double left = scene.board_left + static_cast<double>(i) * board_speed;
            for (const TrackedFeature& f : rig->view().features) {
                const bool is_board =
                    static_cast<double>(f.x) > left + 8 && static_cast<double>(f.x) < left + 92 && f.y > 48;
                if (i < 15 || !f.is_matched) continue;
                board += is_board;
                wrong += f.is_static && is_board;
                counted += f.is_static && !is_board;
            }
        }
        EXPECT_GT(counted, 2000U);
        EXPECT_GT(board, 300U) << "the board must stay matched, lest it breeds new points";
        EXPECT_LE(wrong, board / 50) << "speed " << board_speed;
        std::uint32_t off = 0, all = 0;
        for (std::uint32_t slot = 0; slot < rig.map().points().slots_count(); ++slot) {
            if (!rig.map().points().is_taken(slot)) continue;
            const MapPoint& point = rig.map().points().at(slot);
            if (point.weight_tenths < 15 || is_of_board(scene, point)) continue;
            ++all;
            off += std::abs(point.world[2] - scene.wall_m) > 0.02;
        }
        EXPECT_GT(all, 80U);
        EXPECT_LE(off, all / 50);
    }
}

// Promise: a board that keeps its place in the world, nearer than the wall and hence faster in the image, is no mover.
TEST(Tracking, AcceptsABoardThatStandsStill) {
    DrawnScene scene;
    scene.board_px_per_frame = -2;  // half the wall's distance, twice its speed
    scene.board_left = 150;
    Rig rig(scene.camera(), fitting());
    std::uint32_t moving = 0, all = 0;
    for (std::uint32_t i = 0; i < 50; ++i) {
        const KeptFrame kept = scene.draw(i);
        rig->track(kept.frame());
        ASSERT_GE(rig.pose().state, PoseState::kUnsure);
        EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(i), 0.01) << i;
        if (i < 5) continue;
        all += rig->frame_statistics().matches;
        moving += rig->frame_statistics().dynamic_matches;
    }
    EXPECT_GT(all, 5000U);
    EXPECT_LE(moving, all / 5) << "what comes out from behind its edge is no corner of either";
}

struct KeyframeLog {
    std::vector<std::uint32_t> frames;
};

KeyframeLog log_of(const DrawnScene& scene, const Parameters& configuration, std::uint32_t frames) {
    Rig rig(scene.camera(), configuration);
    KeyframeLog log;
    for (std::uint32_t i = 0; i < frames; ++i) {
        const KeptFrame kept = scene.draw(i);
        rig->track(kept.frame());
        const Map& map = rig.map();
        EXPECT_EQ(rig->frame_statistics().is_keyframe,
                  map.recent_keyframe(0).is_null() ? false : map.keyframes().find(map.recent_keyframe(0))->frame == i);
        if (!rig->frame_statistics().is_keyframe) continue;
        log.frames.push_back(i);
        // What a keyframe keeps is what was given out and seen.
        const Keyframe& keyframe = *map.keyframes().find(map.recent_keyframe(0));
        EXPECT_EQ(keyframe.time_ns, kept.time_ns);
        for (int k = 0; k < 3; ++k) {
            EXPECT_EQ(keyframe.world_from_camera.translation(k), rig.pose().odom_from_camera.translation_m[k]);
        }
        const auto observations = map.observations(map.recent_keyframe(0));
        EXPECT_LE(observations.size(), kLimits.features_max);
        std::uint32_t shown = 0;
        for (const Observation& o : observations) {
            const MapPoint* const point = map.points().find(o.point);
            EXPECT_EQ(point == nullptr, o.point.is_null()) << "the newest keyframe sees what is not there";
            if (point != nullptr) {
                EXPECT_EQ(point->last_seen_frame, i);
            }
            shown += point != nullptr ? 1U : 0U;
            EXPECT_TRUE(o.x >= 0 && o.x < 320 && o.y >= 0 && o.y < 240);
        }
        EXPECT_GT(shown, 50U);
    }
    return log;
}

// Promise: keyframes (method.md 8): never without new points, never while enough is tracked, at least the gap apart
// unless tracks run out, and then a quarter of that.
TEST(Tracking, KeyframesKeepTheirConditions) {
    DrawnScene scene;
    scene.wall_px_per_frame = 4;  // new wall comes into view quickly
    scene.has_board = false;
    Parameters configuration = fitting();
    configuration.keyframes.tracked_urgent_permille = 0;
    configuration.keyframes.tracked_share_max = 0.6;
    configuration.keyframes.new_points_min = 1;
    for (const std::uint32_t gap : {3U, 10U}) {
        configuration.keyframes.gap_min = gap;
        const KeyframeLog log = log_of(scene, configuration, 45);
        ASSERT_GE(log.frames.size(), 3U);
        EXPECT_EQ(log.frames[0], 0U);
        for (std::size_t i = 1; i < log.frames.size(); ++i) EXPECT_GE(log.frames[i] - log.frames[i - 1], gap);
    }
    configuration.keyframes.tracked_share_max = 0;
    EXPECT_EQ(log_of(scene, configuration, 20).frames.size(), 1U) << "nothing is ever too little";
    configuration.keyframes.tracked_share_max = 1.0;
    configuration.keyframes.new_points_min = 4000;
    configuration.keyframes.tracked_urgent_permille = 1000;
    EXPECT_EQ(log_of(scene, configuration, 20).frames.size(), 1U) << "never so many new points";
    configuration.keyframes.new_points_min = 0;
    configuration.keyframes.gap_min = 8;
    const KeyframeLog urgent = log_of(scene, configuration, 21);
    ASSERT_EQ(urgent.frames.size(), 11U);
    for (std::size_t i = 1; i < urgent.frames.size(); ++i) EXPECT_EQ(urgent.frames[i] - urgent.frames[i - 1], 2U);
}

// Promise: matches are one to one, of live points, within the descriptor distance; the limit and the ratio bite.
TEST(Tracking, MatchesAreOneToOne) {
    const DrawnScene scene;
    std::uint32_t matches_of[3] = {};
    for (int variant = 0; variant < 3; ++variant) {
        Parameters configuration = fitting();
        configuration.matching.hamming_max = variant == 1 ? 4 : 64;
        configuration.matching.ratio_max = variant == 2 ? 0.1 : 0.85;
        Rig rig(scene.camera(), configuration);
        for (std::uint32_t i = 0; i < 30; ++i) {
            KeptFrame kept = scene.draw(i);
            Random noise(i);
            for (std::uint8_t& grey : kept.colour) {
                grey = static_cast<std::uint8_t>(std::clamp(static_cast<int>(grey + noise.below(25)) - 12, 0, 255));
            }
            std::map<std::uint32_t, Descriptor> before;
            for (std::uint32_t slot = 0; slot < rig.map().points().slots_count(); ++slot) {
                if (rig.map().points().is_taken(slot)) before[slot] = rig.map().points().at(slot).descriptor;
            }
            rig->track(kept.frame());
            std::set<std::uint32_t> features, points;
            for (const Correspondence& c : rig->correspondences()) {
                ASSERT_LT(c.feature, rig->features().size());
                EXPECT_TRUE(features.insert(c.feature).second) << "a feature of two points";
                EXPECT_TRUE(points.insert(c.point_slot).second) << "a point in two places";
                ASSERT_EQ(before.count(c.point_slot), 1U) << "matched to what was not in the map";
                EXPECT_LE(c.distance_bits, configuration.matching.hamming_max);
                EXPECT_EQ(c.distance_bits,
                          hamming_distance(before[c.point_slot], rig->features().descriptors[c.feature]));
            }
            matches_of[variant] += static_cast<std::uint32_t>(features.size());
        }
    }
    EXPECT_GT(matches_of[0], 3000U);
    EXPECT_LT(matches_of[1], matches_of[0] * 9 / 10) << "the distance";
    EXPECT_LT(matches_of[2], matches_of[0] * 95 / 100) << "the ratio";
}

// Promise: nobody is found again farther away than a camera can have got; with time enough the same picture is
// believed.
TEST(Tracking, RecoversNoFartherThanACameraGets) {
    DrawnScene scene;
    scene.has_board = false;
    Parameters configuration = fitting();
    configuration.pose.lost_frames_max = 1;
    for (const bool has_time : {false, true}) {
        Rig rig(scene.camera(), configuration);
        std::uint32_t i = 0;
        for (; i < 60; ++i) {
            const KeptFrame kept = scene.draw(i);
            rig->track(kept.frame());
        }
        const double away_m = scene.travelled_m(59);
        ASSERT_NEAR(rig.pose().odom_from_camera.translation_m[0], away_m, 0.01);
        ASSERT_GT(away_m, 0.5);
        const auto show = [&](std::uint32_t at, bool is_dark) {
            KeptFrame kept = scene.draw(at);
            if (is_dark) std::fill(kept.colour.begin(), kept.colour.end(), std::uint8_t{0});
            kept.time_ns = std::int64_t{i++} * test::kFrameGap_ns;
            rig->track(kept.frame());
        };
        for (int k = 0; k < (has_time ? 60 : 3); ++k) show(0, true);
        ASSERT_EQ(rig.pose().state, PoseState::kNone);
        // Back where it all began, 0.6 m away: in 2 s one can be there, not in 0.1 s.
        for (int k = 0; k < (has_time ? 12 : 4); ++k) show(0, false);
        const EngineStatistics statistics = rig.world().all_statistics();
        if (has_time) {
            EXPECT_GE(rig.pose().state, PoseState::kUnsure);
            EXPECT_EQ(statistics.recoveries, 1U);
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], 0, 0.02);
        } else {
            EXPECT_EQ(rig.pose().state, PoseState::kNone);
            EXPECT_EQ(statistics.recoveries, 0U);
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], away_m, 0.1);
        }
    }
}

// Promise: while nothing is measured a camera may have been carried anywhere, but what was found again is as far off as
// the keyframe it was found at, and so are the keyframes that come after it.
TEST(Tracking, WhoIsFoundHasTheDriftOfThePlace) {
    DrawnScene scene;
    scene.has_board = false;
    Parameters configuration = fitting();
    configuration.pose.lost_frames_max = 1;
    Rig rig(scene.camera(), configuration);
    std::uint32_t now = 0;
    const auto show = [&](std::uint32_t at, bool is_dark) {
        KeptFrame kept = scene.draw(at);
        if (is_dark) std::fill(kept.colour.begin(), kept.colour.end(), std::uint8_t{0});
        kept.time_ns = std::int64_t{now++} * test::kFrameGap_ns;
        rig->track(kept.frame());
    };
    for (std::uint32_t i = 0; i < 60; ++i) show(i, false);
    const std::uint64_t frame_before = rig.map().keyframes().find(rig.map().recent_keyframe(0))->frame;
    for (int i = 0; i < 60; ++i) show(59, true);
    ASSERT_EQ(rig.pose().state, PoseState::kNone);
    for (std::uint32_t i = 0; i < 120; ++i) show(59 + i, false);  // on from there, until new keyframes are made
    const EngineStatistics statistics = rig.world().all_statistics();
    ASSERT_EQ(statistics.recoveries, 1U);
    const Keyframe& last = *rig.map().keyframes().find(rig.map().recent_keyframe(0));
    ASSERT_GT(last.frame, 120U);
    ASSERT_LT(frame_before, 60U);
    const double lost_m = configuration.recovery.reach_m_s * 2.0;  // room that the darkness would have made
    ASSERT_GT(lost_m, 2);
    EXPECT_LT(last.drift_m, 0.2);
}

// Promise: nobody is found again turned farther than a camera can have turned; with time enough the same picture is
// believed. (The picture upside down, seen from where the camera was lost.)
TEST(Tracking, RecoversNoFartherThanACameraTurns) {
    DrawnScene scene;
    scene.has_board = false;
    Parameters configuration = fitting();
    configuration.pose.lost_frames_max = 1;
    for (const bool has_time : {false, true}) {
        Rig rig(scene.camera(), configuration);
        for (std::uint32_t i = 0; i < 20; ++i) {
            const KeptFrame kept = scene.draw(i);
            rig->track(kept.frame());
        }
        std::uint32_t now = 20;
        const auto show = [&](bool is_dark) {
            KeptFrame kept = scene.draw(19);
            if (is_dark) {
                std::fill(kept.colour.begin(), kept.colour.end(), std::uint8_t{0});
            } else {
                std::reverse(kept.colour.begin(), kept.colour.end());
                std::reverse(kept.depth.begin(), kept.depth.end());
            }
            kept.time_ns = std::int64_t{now++} * test::kFrameGap_ns;
            rig->track(kept.frame());
        };
        for (int k = 0; k < (has_time ? 60 : 3); ++k) show(true);
        ASSERT_EQ(rig.pose().state, PoseState::kNone);
        // Half a turn: in 2 s one can have made it, not in 0.3 s.
        for (int k = 0; k < (has_time ? 14 : 6); ++k) show(false);
        const EngineStatistics statistics = rig.world().all_statistics();
        const double turned = std::abs(rig.pose().odom_from_camera.rotation_xyzw[2]);  // sin of half the angle
        if (has_time) {
            EXPECT_GE(rig.pose().state, PoseState::kUnsure);
            EXPECT_EQ(statistics.recoveries, 1U);
            EXPECT_NEAR(turned, 1, 0.01);
        } else {
            EXPECT_EQ(rig.pose().state, PoseState::kNone);
            EXPECT_EQ(statistics.recoveries, 0U);
            EXPECT_NEAR(turned, 0, 0.1);
        }
    }
}

// Promise: how far apart colour and depth were taken, for doubting depth while the camera turns, comes from the frame
// where it tells, and from the configuration where it does not: 0, the same time, or times that no frame can have.
// Where depth is looked up as well it matters which of both was first (late_depth_test.cpp).
TEST(Tracking, TheLagOfDepthIsTheFrames) {
    const test::Sequence sequence = test::rendered("static_rpy", 20, 320, 240);
    double depth_trust = 0;
    const auto hash_of = [&](double configured_s, std::int64_t depth_ns, bool is_absolute) {
        Parameters configuration = fitting();
        configuration.region.colour_depth_lag_s = configured_s;
        configuration.pose.depth_trust = depth_trust;
        Rig rig(sequence.camera, configuration);
        for (const KeptFrame& kept : sequence.frames) {
            Frame frame = kept.frame();
            frame.depth_time_ns = is_absolute ? depth_ns : frame.time_ns + depth_ns;
            rig->track(frame);
        }
        return rig->state_hash();
    };
    const std::uint64_t configured = hash_of(0.010, 0, false);
    EXPECT_EQ(hash_of(0.010, 0, true), configured);
    EXPECT_EQ(hash_of(0.010, 200'000'000, false), configured);
    EXPECT_EQ(hash_of(0.010, std::numeric_limits<std::int64_t>::max(), true), configured);
    EXPECT_EQ(hash_of(0.010, std::numeric_limits<std::int64_t>::min(), true), configured);
    EXPECT_EQ(hash_of(0.050, 10'000'000, false), configured) << "the frame told";
    EXPECT_EQ(hash_of(0.050, -10'000'000, false), configured) << "earlier or later is the same";
    EXPECT_NE(hash_of(0.050, 0, false), configured);
    EXPECT_NE(hash_of(0.010, 50'000'000, false), configured);
    depth_trust = 0.1;
    EXPECT_EQ(hash_of(0.010, 0, false), configured) << "of one time";
    EXPECT_NE(hash_of(0.010, 10'000'000, false), hash_of(0.010, -10'000'000, false));
}

// Promise: a point that stands still keeps the place where it was first seen; its estimate only gets surer.
TEST(Tracking, AnchorsOfStillPointsStay) {
    DrawnScene scene;
    scene.has_board = false;
    Rig rig(scene.camera(), fitting());
    std::map<std::uint32_t, std::pair<std::uint32_t, MapPoint>> before;
    std::uint32_t checked = 0;
    for (std::uint32_t i = 0; i < 40; ++i) {
        const KeptFrame kept = scene.draw(i);
        rig->track(kept.frame());
        std::map<std::uint32_t, std::pair<std::uint32_t, MapPoint>> now;
        for (std::uint32_t slot = 0; slot < rig.map().points().slots_count(); ++slot) {
            if (!rig.map().points().is_taken(slot)) continue;
            const MapPoint& point = rig.map().points().at(slot);
            const std::uint32_t generation = rig.map().points().handle_of(slot).generation;
            now[slot] = {generation, point};
            EXPECT_LE(point.last_seen_frame, i);
            EXPECT_GT(point.var_z, 0);
            EXPECT_GT(point.var_lateral, 0);
            const auto known = before.find(slot);
            if (known == before.end() || known->second.first != generation || point.is_suspect ||
                known->second.second.is_suspect) {
                continue;
            }
            ++checked;
            for (int k = 0; k < 3; ++k) ASSERT_EQ(point.anchor[k], known->second.second.anchor[k]);
            ASSERT_EQ(point.anchor_ns, known->second.second.anchor_ns);
            ASSERT_LE(point.var_z, known->second.second.var_z * 1.5);
            ASSERT_GE(point.seen, known->second.second.seen);
        }
        before = now;
    }
    EXPECT_GT(checked, 3000U);
}

// Promise: an unsure choice that is far from where the motion led makes every pose of the second after it unsure, and
// none later; a sure choice as far off is a jerk of the camera and costs nothing, and neither does an unsure one that
// goes where it is expected.
TEST(Tracking, AnUnsureJumpIsDoubtedForASecond) {
    constexpr std::uint32_t kJump = 40;
    for (const bool is_jumping : {true, false}) {
        for (const bool is_poor : {true, false}) {
            // 10 cm or 4 cm; the poor frame widens the search, and with it what is expected.
            const std::uint32_t jump_px = is_poor ? 10 : 4;
            DrawnScene scene;
            scene.has_board = false;
            Parameters configuration = fitting();
            configuration.pose.sure_inliers_factor = 12;  // what a third of the picture does not give
            configuration.recovery.reach_m = 10;          // LeapsAreRefused
            Rig rig(scene.camera(), configuration);
            for (std::uint32_t i = 0; i < kJump + 50; ++i) {
                const std::uint32_t drawn = is_jumping && i >= kJump ? i + jump_px : i;
                KeptFrame kept = scene.draw(drawn);
                kept.time_ns = std::int64_t{i} * test::kFrameGap_ns;
                if (is_poor && i == kJump) {
                    // Only the left third shows anything.
                    for (std::size_t at = 0; at < kept.colour.size(); ++at) {
                        if (at % kept.width > kept.width / 3) kept.colour[at] = 128;
                    }
                }
                rig->track(kept.frame());
                if (!is_poor || i != kJump) {
                    ASSERT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(drawn), 0.015) << i;
                }
                const bool is_doubted = is_poor && i >= kJump && (is_jumping ? i <= kJump + 29 : i == kJump);
                const bool is_between = is_poor && is_jumping && i > kJump + 29 && i <= kJump + 32;  // a bin
                if (is_between) continue;
                EXPECT_EQ(rig.pose().state, is_doubted ? PoseState::kUnsure : PoseState::kTracked)
                    << "frame " << i << (is_jumping ? ", jump" : "") << (is_poor ? ", poor" : "") << ", score "
                    << rig->frame_statistics().region_score << ", static " << rig->frame_statistics().static_matches;
            }
        }
    }
}

// Promise: an unsure pose farther from where the motion led than a camera gets is not given out, changes nothing, and
// the frames after it, which are sure, are where they say at once, and unsure while the motion across the frame without
// a pose counts; a near one is given out as unsure.
TEST(Tracking, LeapsAreRefused) {
    constexpr std::uint32_t kJump = 40;
    for (const std::uint32_t jump_px : {0U, 16U}) {
        DrawnScene scene;
        scene.has_board = false;
        Parameters configuration = fitting();
        configuration.pose.sure_inliers_factor = 12;
        Rig rig(scene.camera(), configuration);
        for (std::uint32_t i = 0; i < kJump + 20; ++i) {
            const std::uint32_t drawn = i >= kJump ? i + jump_px : i;
            KeptFrame kept = scene.draw(drawn);
            kept.time_ns = std::int64_t{i} * test::kFrameGap_ns;
            if (i == kJump) {  // Only the left third shows anything.
                for (std::size_t at = 0; at < kept.colour.size(); ++at) {
                    if (at % kept.width > kept.width / 3) kept.colour[at] = 128;
                }
            }
            const std::uint64_t changes = rig.map().changes_hash();
            rig->track(kept.frame());
            if (i == kJump) {
                EXPECT_EQ(rig.pose().state, jump_px == 16 ? PoseState::kPredicted : PoseState::kUnsure);
                if (jump_px == 16) {
                    EXPECT_EQ(rig.map().changes_hash(), changes);
                    // Where it was led to, not where the picture says.
                    EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(kJump), 0.02);
                }
            } else if (i > kJump + 1) {
                EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(drawn), 0.015) << i;
                EXPECT_EQ(rig.pose().state, jump_px == 16 ? PoseState::kUnsure : PoseState::kTracked) << i;
                EXPECT_EQ(rig->frame_statistics().unsure, jump_px == 16 ? UnsureReason::kJump : UnsureReason::kNone);
            }
        }
    }
}

// Promise: unsure poses do not lead each other away step by step either: they are held against the last sure one, and
// one that comes back within its reach is let in.
TEST(Tracking, UnsureStepsLeadNowhere) {
    constexpr std::uint32_t kFirst = 40, kUnsure = 8;
    DrawnScene scene;
    scene.has_board = false;
    Parameters configuration = fitting();
    configuration.pose.sure_inliers_factor = 12;
    Rig rig(scene.camera(), configuration);
    double farthest_m = 0;
    for (std::uint32_t i = 0; i < kFirst + kUnsure + 20; ++i) {
        // Every unsure frame shows the room 7 px farther on than the one before: 8 cm beyond where the motion leads.
        const bool is_unsure = i >= kFirst && i < kFirst + kUnsure;
        KeptFrame kept = scene.draw(is_unsure ? i + 7 * (i - kFirst + 1) : i);
        kept.time_ns = std::int64_t{i} * test::kFrameGap_ns;
        if (is_unsure) {  // Only the left third shows anything.
            for (std::size_t at = 0; at < kept.colour.size(); ++at) {
                if (at % kept.width > kept.width / 3) kept.colour[at] = 128;
            }
        }
        rig->track(kept.frame());
        const double off_m = rig.pose().odom_from_camera.translation_m[0] - scene.travelled_m(i);
        if (is_unsure && rig.pose().state == PoseState::kUnsure) farthest_m = std::max(farthest_m, off_m);
        if (i > kFirst + kUnsure + 1) {
            EXPECT_NEAR(off_m, 0, 0.015) << i;
            EXPECT_GE(rig.pose().state, PoseState::kUnsure) << i;
        }
    }
    EXPECT_GT(farthest_m, 0.05);
    EXPECT_LT(farthest_m, 0.25);  // 56 px are 0.6 m
}

// Promise: after a third of a second without a pose nothing foretells the next: a few points that agree are no pose
// then, a good look at the same place is one at once. After less they are, given out as unsure. A camera of three
// pictures a second is not lost between two of them.
TEST(Tracking, AnUnsurePoseFollowsFromOneBefore) {
    constexpr std::uint32_t kBefore = 30;
    struct Case {
        std::uint32_t dark_frames;
        bool is_poor;
        std::int64_t gap_ns;
        PoseState expected;
    };
    for (const Case& c : {Case{4, true, test::kFrameGap_ns, PoseState::kUnsure},
                          Case{14, true, test::kFrameGap_ns, PoseState::kNone},  // on probation: none is given out
                          Case{14, false, test::kFrameGap_ns, PoseState::kTracked},
                          Case{0, true, 10 * test::kFrameGap_ns, PoseState::kUnsure}}) {
        DrawnScene scene;
        scene.has_board = false;
        Parameters configuration = fitting();
        configuration.pose.sure_inliers_factor = 12;
        configuration.pose.stray_m = 1000;  // what was predicted in the dark is another promise's
        Rig rig(scene.camera(), configuration);
        std::int64_t time_ns = 0;
        for (std::uint32_t i = 0; i <= kBefore + c.dark_frames; ++i) {
            KeptFrame kept = scene.draw(std::min(i, kBefore - 1));  // it stands still in the end
            time_ns += c.gap_ns;
            kept.time_ns = time_ns;
            const bool is_last = i == kBefore + c.dark_frames;
            for (std::size_t at = 0; at < kept.colour.size(); ++at) {
                const bool is_hidden = is_last ? c.is_poor && at % kept.width > kept.width / 3 : i >= kBefore;
                if (is_hidden) kept.colour[at] = 128;
            }
            rig->track(kept.frame());
            if (i == kBefore - 1) {
                ASSERT_EQ(rig.pose().state, PoseState::kTracked);
            }
        }
        EXPECT_EQ(rig.pose().state, c.expected) << c.dark_frames << " dark frames" << (c.is_poor ? ", then poor" : "");
        EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(kBefore - 1), 0.05);
    }
}

// Promise: a hint that contradicts what the picture shows makes its pose unsure in the beginning, while nothing else
// tells a body from the room, and changes no word of it afterwards; the pose itself follows the picture throughout.
TEST(Tracking, AHintContradictsInTheBeginningAlone) {
    constexpr std::uint32_t kYoung = 30;  // frames
    DrawnScene scene;
    scene.has_board = false;
    Parameters configuration = fitting();
    configuration.hint.clock_s = 0;  // at a speed, clocks that are apart would explain any hint
    for (const std::uint32_t from : {3U, kYoung + 5}) {
        Rig rig(scene.camera(), configuration);
        std::uint32_t contradicted = 0;
        for (std::uint32_t i = 0; i < from + 10; ++i) {
            MotionHint hint;
            hint.last_from_camera.translation_m[0] = scene.travelled_m(1);
            if (i >= from) hint.last_from_camera.translation_m[1] = 0.1;
            hint.sigma_m = hint.sigma_rad = 0.002;
            rig->track(scene.draw(i).frame(), i == 0 ? nullptr : &hint);
            contradicted += rig->frame_statistics().unsure == UnsureReason::kHint ? 1U : 0U;
            if (i < from || from > kYoung) {
                EXPECT_EQ(rig.pose().state, PoseState::kTracked) << i;
            }
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[0], scene.travelled_m(i), 0.02) << i;
            EXPECT_NEAR(rig.pose().odom_from_camera.translation_m[1], 0, 0.02) << i;
        }
        if (from < kYoung) {
            EXPECT_GE(contradicted, 5U);
        } else {
            EXPECT_EQ(contradicted, 0U);
        }
    }
}

}  // namespace
}  // namespace stillmesh::tracking_test
