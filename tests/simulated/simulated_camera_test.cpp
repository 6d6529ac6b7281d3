#include "hal/simulated/simulated_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "engine/base/hash.hpp"

namespace stillmesh::simulated_camera_test {
namespace {

SimulationOptions small(const std::string& scene, std::uint64_t seed, std::uint32_t frames) {
    return {.scene = scene, .seed = seed, .frames = frames, .width = 160, .height = 120};
}

// All bytes and the truth of a run.
std::uint64_t hash_of(const SimulationOptions& options) {
    SimulatedCamera camera(options);
    EXPECT_EQ(camera.open(), Status::kOk) << camera.message();
    StateHash hash;
    Frame frame;
    while (camera.poll(frame) == Status::kOk) {
        for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
            for (std::uint32_t x = 0; x < frame.colour.width; ++x) {
                hash.add(static_cast<std::uint32_t>(frame.colour.at(x, y)));
                hash.add(static_cast<std::uint32_t>(frame.depth.at(x, y)));
                hash.add(static_cast<std::uint32_t>(camera.dynamic_mask().at(x, y)));
            }
        }
        for (const double value : camera.true_pose().t) hash.add(value);
        for (const double value : camera.true_pose().q) hash.add(value);
        hash.add(frame.time_ns);
    }
    return hash.value();
}

// A copy of a polled frame with its truth.
struct Kept {
    std::vector<std::uint8_t> grey, mask;
    std::vector<std::uint16_t> depth;
    SimulatedPose pose;
};

Kept keep(const SimulatedCamera& camera, const Frame& frame) {
    const std::size_t n = static_cast<std::size_t>(frame.colour.width) * frame.colour.height;
    const auto mask = camera.dynamic_mask();
    return {{frame.colour.data, frame.colour.data + n},
            {mask.data, mask.data + n},
            {frame.depth.data, frame.depth.data + n},
            camera.true_pose()};
}

std::vector<Kept> run(const SimulationOptions& options, CameraInfo& info) {
    SimulatedCamera camera(options);
    EXPECT_EQ(camera.open(), Status::kOk);
    info = camera.info();
    std::vector<Kept> frames;
    Frame frame;
    while (camera.poll(frame) == Status::kOk) frames.push_back(keep(camera, frame));
    return frames;
}

struct Point {
    double x, y, z;
};

// q v q^-1, or its inverse.
Point rotate(const std::array<double, 4>& q, const Point& v, bool is_inverse) {
    const double s = is_inverse ? -1 : 1;
    const double x = s * q[0];
    const double y = s * q[1];
    const double z = s * q[2];
    const double w = q[3];
    const Point t{2 * (y * v.z - z * v.y), 2 * (z * v.x - x * v.z), 2 * (x * v.y - y * v.x)};
    return {v.x + w * t.x + y * t.z - z * t.y, v.y + w * t.y + z * t.x - x * t.z, v.z + w * t.z + x * t.y - y * t.x};
}

struct Agreement {
    double checked = 0, depth_agrees = 0, grey_agrees = 0;
};

// Every second pixel of `from` with depth, whose mask is `mask`, looked up in `to` where the true poses put it. What
// something nearer hides there says nothing.
Agreement compare(const Kept& from, const Kept& to, const CameraModel& m, std::uint8_t mask, double shift_m = 0) {
    Agreement sum;
    const double gain = [&] {
        double a = 0;
        double b = 0;
        for (std::size_t i = 0; i < from.grey.size(); ++i) {
            a += from.grey[i];
            b += to.grey[i];
        }
        return mask != 0 ? 1.0 : b / a;
    }();
    for (std::uint32_t y = 2; y < m.height - 2; y += 2) {
        for (std::uint32_t x = 2; x < m.width - 2; x += 2) {
            const std::size_t i = y * m.width + x;
            if (from.depth[i] == 0 || from.mask[i] != mask) continue;
            const double z = from.depth[i] / 5000.0;
            Point p{(x - m.cx) / m.fx * z, (y - m.cy) / m.fy * z, z};
            p = rotate(from.pose.q, p, false);
            p = {p.x + from.pose.t[0] - to.pose.t[0] + shift_m, p.y + from.pose.t[1] - to.pose.t[1],
                 p.z + from.pose.t[2] - to.pose.t[2]};
            p = rotate(to.pose.q, p, true);
            const double u = p.x / p.z * m.fx + m.cx;
            const double v = p.y / p.z * m.fy + m.cy;
            if (p.z < 0.55 || u < 1 || v < 1 || u > m.width - 2 || v > m.height - 2) continue;
            const std::size_t j =
                static_cast<std::size_t>(std::lround(v)) * m.width + static_cast<std::size_t>(std::lround(u));
            if (to.depth[j] == 0) continue;
            const double found = to.depth[j] / 5000.0;
            const double tolerance = 5 * 1.425e-3 * p.z * p.z + 0.02;
            if (mask == 0 && (found < p.z - tolerance || to.mask[j] != 0)) continue;  // hidden
            ++sum.checked;
            sum.depth_agrees += std::abs(found - p.z) < tolerance;
            sum.grey_agrees += std::abs(to.grey[j] - gain * from.grey[i]) < 25;
        }
    }
    return sum;
}

// Promise: same scene and seed, same bytes and same truth; another seed, another world.
TEST(SimulatedCamera, IsDeterministic) {
    EXPECT_EQ(hash_of(small("walking_xyz", 3, 3)), hash_of(small("walking_xyz", 3, 3)));
    EXPECT_NE(hash_of(small("walking_xyz", 3, 3)), hash_of(small("walking_xyz", 4, 3)));
    EXPECT_NE(hash_of(small("walking_xyz", 3, 3)), hash_of(small("walking_rpy", 3, 3)));
}

// Promise: these bytes on every processor, compiler and optimisation level. Who changes the world changes them.
TEST(SimulatedCamera, GoldenFrames) {
    EXPECT_EQ(hash_of(small("static_xyz", 1, 2)), 0xd5e10505f529e0b7U);
    EXPECT_EQ(hash_of(small("walking_halfsphere", 2, 2)), 0xef255f1b84e539ffU);
    EXPECT_EQ(hash_of(small("sitting_rpy", 3, 2)), 0xcb182db7eb391889U);
    EXPECT_EQ(hash_of(small("walking_loop", 4, 2)), 0xef8e0a1393c6c90aU);
    EXPECT_EQ(hash_of(small("trolley_first", 5, 2)), 0x94eb931768354683U);
    EXPECT_EQ(hash_of(small("rearranged", 6, 2)), 0x1b7423fceb69aa3fU);
}

// Promise: reopened, the camera starts again from the first frame.
TEST(SimulatedCamera, ReopensAtTheStart) {
    SimulatedCamera camera(small("sitting_static", 1, 2));
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
    ASSERT_EQ(camera.open(), Status::kOk);
    EXPECT_EQ(camera.frame_count(), 2U);
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    const Kept first = keep(camera, frame);
    EXPECT_EQ(camera.wait(0), Status::kOk);
    EXPECT_EQ(camera.poll(frame), Status::kOk);
    EXPECT_EQ(frame.time_ns - first.pose.time_ns, 33'333'333);
    EXPECT_EQ(camera.wait(0), Status::kEnd);
    EXPECT_EQ(camera.poll(frame), Status::kEnd);
    ASSERT_EQ(camera.open(), Status::kOk);
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    EXPECT_EQ(keep(camera, frame).grey, first.grey);
    camera.close();
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
}

// Promise: a frame looked up is the frame that polling comes to.
TEST(SimulatedCamera, SeeksAnyFrame) {
    SimulatedCamera in_turn(small("walking_loop", 1, 6));
    SimulatedCamera jumping(small("walking_loop", 1, 6));
    ASSERT_EQ(in_turn.open(), Status::kOk);
    ASSERT_EQ(jumping.open(), Status::kOk);
    Frame frame;
    std::vector<Kept> frames;
    while (in_turn.poll(frame) == Status::kOk) frames.push_back(keep(in_turn, frame));
    for (const std::uint32_t i : {4U, 1U, 5U, 0U}) {
        jumping.seek(i);
        ASSERT_EQ(jumping.poll(frame), Status::kOk);
        const Kept kept = keep(jumping, frame);
        EXPECT_EQ(kept.grey, frames[i].grey) << i;
        EXPECT_EQ(kept.depth, frames[i].depth) << i;
        EXPECT_EQ(kept.pose.time_ns, frames[i].pose.time_ns) << i;
    }
    jumping.seek(6);
    EXPECT_EQ(jumping.poll(frame), Status::kEnd);
}

// Promise: every name in the list opens; what is not in the list, or out of range, is refused with a sentence.
TEST(SimulatedCamera, RefusesWithASentence) {
    EXPECT_EQ(simulated_scenes().size(), 32U);
    for (const SimulatedScene& scene : simulated_scenes()) {
        SimulatedCamera camera({.scene = scene.name, .width = 64, .height = 48});
        EXPECT_EQ(camera.open(), Status::kOk) << scene.name;
        EXPECT_EQ(camera.frame_count(), scene.frames);
        EXPECT_GE(scene.frames, 300U);
    }
    const SimulationOptions wrong[] = {{.scene = "walking"},
                                       {.scene = ""},
                                       {.scene = "static_xyz", .width = 16},
                                       {.scene = "static_xyz", .height = 5000},
                                       {.scene = "static_xyz", .depth_lag_ns = 50'000'000},
                                       {.scene = "static_xyz", .exposure_ns = -1},
                                       {.scene = "static_xyz", .frames = 2'000'000}};
    for (const SimulationOptions& options : wrong) {
        SimulatedCamera camera(options);
        EXPECT_EQ(camera.open(), Status::kInvalid);
        EXPECT_GT(camera.message().size(), 20U);
    }
}

// Promise: another day is the same room (what does not move is found again where the true poses say), with another way
// of the camera, other people and other light; no day is the seed's own.
TEST(SimulatedCamera, AnotherDayIsTheSameRoom) {
    SimulationOptions options = small("static_xyz", 2, 2);
    options.width = 320;
    options.height = 240;
    CameraInfo info;
    const std::vector<Kept> first = run(options, info);
    options.day = 7;
    const std::vector<Kept> other = run(options, info);
    const Agreement same_room = compare(first[0], other[0], info.model, 0);
    ASSERT_GT(same_room.checked, 2000);
    EXPECT_GT(same_room.depth_agrees / same_room.checked, 0.95);
    EXPECT_NE(first[0].pose.t, other[0].pose.t);
    options.day = 0;
    options.seed = 3;
    const Agreement other_room = compare(first[0], run(options, info)[0], info.model, 0);
    EXPECT_LT(other_room.depth_agrees / other_room.checked, 0.8);

    SimulationOptions walking = small("walking_xyz", 2, 2);
    const std::uint64_t own = hash_of(walking);
    walking.day = 2;
    EXPECT_EQ(hash_of(walking), own);
    walking.day = 3;
    EXPECT_NE(hash_of(walking), own);
}

// Promise: truth and pixels belong together: what does not move is found again, in depth and grey, where the true poses
// say; with a truth 5 cm wrong it is not.
TEST(SimulatedCamera, TruthExplainsWhatStandsStill) {
    for (const char* scene : {"static_xyz", "static_rpy", "static_halfsphere", "walking_xyz", "walking_loop",
                              "trolley_first", "rearranged", "corridor"}) {
        CameraInfo info;
        SimulationOptions options = small(scene, 2, 12);
        options.width = 320;
        options.height = 240;
        const std::vector<Kept> frames = run(options, info);
        const Agreement right = compare(frames[0], frames[11], info.model, 0);
        ASSERT_GT(right.checked, 2000) << scene;
        EXPECT_GT(right.depth_agrees / right.checked, 0.95) << scene;
        EXPECT_GT(right.grey_agrees / right.checked, 0.85) << scene;
        const Agreement wrong = compare(frames[0], frames[11], info.model, 0, 0.05);
        EXPECT_LT(wrong.grey_agrees / wrong.checked, right.grey_agrees / right.checked - 0.03) << scene;
    }
}

// Promise: colour, depth and mask are registered to the pixel: grey changes most where depth jumps and the mask ends,
// and less a few pixels beside.
TEST(SimulatedCamera, ImagesAreRegistered) {
    SimulationOptions options{.scene = "walking_static", .seed = 1, .frames = 4, .width = 320, .height = 240};
    options.exposure_ns = 0;
    CameraInfo info;
    double at_mask[9] = {};
    double at_depth[9] = {};
    for (const Kept& frame : run(options, info)) {
        for (std::uint32_t y = 0; y < 240; ++y) {
            for (std::uint32_t x = 8; x < 310; ++x) {
                const std::size_t i = y * 320 + x;
                const bool mask_ends = frame.mask[i] != frame.mask[i + 1];
                const bool depth_jumps = frame.depth[i] != 0 && frame.depth[i + 1] > frame.depth[i] + 2500;
                if (!mask_ends && !depth_jumps) continue;
                for (std::size_t s = 0; s < 9; ++s) {
                    const double change = std::abs(frame.grey[i + s - 3] - frame.grey[i + s - 4]);
                    if (mask_ends) at_mask[s] += change;
                    if (depth_jumps) at_depth[s] += change;
                }
            }
        }
    }
    EXPECT_EQ(std::max_element(at_mask, at_mask + 9) - at_mask, 4);
    EXPECT_NEAR(static_cast<double>(std::max_element(at_depth, at_depth + 9) - at_depth), 4, 1);
    EXPECT_GT(at_mask[4], 1.3 * at_mask[1]);
}

// Promise: what the mask marks does move: a good part of it is not found again where the true poses say.
TEST(SimulatedCamera, MaskMarksWhatMoves) {
    for (const char* scene : {"walking_static", "walking_xyz", "walking_halfsphere"}) {
        CameraInfo info;
        SimulationOptions options = small(scene, 2, 12);
        options.width = 320;
        options.height = 240;
        const std::vector<Kept> frames = run(options, info);
        const Agreement moving = compare(frames[0], frames[11], info.model, 255);
        ASSERT_GT(moving.checked, 500) << scene;
        EXPECT_LT(moving.grey_agrees / moving.checked, 0.75) << scene;
    }
}

// Promise: depth is 0 or 0.5 to 4.5 m, most of it is there, and holes are there too.
TEST(SimulatedCamera, DepthStaysInRange) {
    CameraInfo info;
    for (const char* scene : {"walking_xyz", "static_loop", "sitting_halfsphere"}) {
        double missing = 0;
        double count = 0;
        for (const Kept& frame : run(small(scene, 1, 5), info)) {
            for (const std::uint16_t d : frame.depth) {
                ASSERT_TRUE(d == 0 || (d >= 2500 && d <= 22500)) << d;
                missing += d == 0;
                ++count;
            }
        }
        EXPECT_LT(missing / count, 0.35) << scene;
        EXPECT_GT(missing / count, 0.005) << scene;
    }
}

// Promise: a lag between colour and depth moves the depth image and its time, and leaves colour and truth alone.
TEST(SimulatedCamera, DepthMayLag) {
    CameraInfo info;
    SimulationOptions options = small("static_rpy", 1, 2);
    const std::vector<Kept> together = run(options, info);
    options.depth_lag_ns = 20'000'000;
    const std::vector<Kept> late = run(options, info);
    EXPECT_EQ(together[1].grey, late[1].grey);
    EXPECT_EQ(together[1].mask, late[1].mask);
    EXPECT_EQ(together[1].pose.t, late[1].pose.t);
    EXPECT_NE(together[1].depth, late[1].depth);
}

double share_above_30(const std::string& scene, std::uint64_t seed, std::uint32_t frames) {
    SimulatedCamera camera({.scene = scene, .seed = seed, .frames = frames, .width = 64, .height = 48});
    EXPECT_EQ(camera.open(), Status::kOk);
    Frame frame;
    double above = 0;
    while (camera.poll(frame) == Status::kOk) above += camera.dynamic_share() > 0.3;
    return above / frames;
}

// Promise: nothing moves in static scenes; in walking scenes moving bodies hold more than 30 % of the pixels in more
// than half of the frames.
TEST(SimulatedCamera, WalkingScenesAreHard) {
    EXPECT_EQ(share_above_30("static_loop", 1, 20), 0);
    for (const char* scene : {"walking_static", "walking_xyz"}) EXPECT_GT(share_above_30(scene, 1, 300), 0.5) << scene;
}
TEST(SimulatedCamera, EveryWalkingSceneAndSeedIsHard) {
    for (const char* scene : {"walking_static", "walking_xyz", "walking_rpy", "walking_halfsphere", "walking_loop"}) {
        for (std::uint64_t seed = 1; seed <= 10; ++seed) {
            const std::uint32_t frames = std::string(scene) == "walking_loop" ? 1200 : 300;
            EXPECT_GT(share_above_30(scene, seed, frames), 0.5) << scene << ":" << seed;
        }
    }
}

// Promise: the trolley is out of sight for three seconds, and later holds more than half of the picture.
TEST(SimulatedCamera, TrolleyComesLate) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        SimulatedCamera camera({.scene = "trolley_xyz", .seed = seed, .width = 64, .height = 48});
        ASSERT_EQ(camera.open(), Status::kOk);
        Frame frame;
        double most = 0;
        for (int i = 0; camera.poll(frame) == Status::kOk; ++i) {
            if (i < 90) {
                ASSERT_EQ(camera.dynamic_share(), 0) << seed << " frame " << i;
            }
            most = std::max(most, camera.dynamic_share());
        }
        EXPECT_GT(most, 0.5) << seed;
        SimulatedCamera first({.scene = "trolley_first", .seed = seed, .width = 64, .height = 48});
        ASSERT_EQ(first.open(), Status::kOk);
        ASSERT_EQ(first.poll(frame), Status::kOk);
        EXPECT_GT(first.dynamic_share(), 0.25) << seed;
    }
}

// Promise: rearranged: two pieces of furniture stand for 2 s, marked by nothing; while one slides, and while the other
// does, the mask marks a good part of the picture; from 4.5 s on all is still. What stood at the old places is gone:
// pixels with the depth of then are found no more, while the room is where it was.
TEST(SimulatedCamera, FurnitureChangesPlace) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        SimulationOptions options = small("rearranged", seed, 150);
        options.width = 320;
        options.height = 240;
        SimulatedCamera camera(options);
        ASSERT_EQ(camera.open(), Status::kOk);
        const CameraInfo info = camera.info();
        const auto at = [&](std::uint32_t i) {
            Frame frame;
            camera.seek(i);
            EXPECT_EQ(camera.poll(frame), Status::kOk);
            return keep(camera, frame);
        };
        for (const std::uint32_t i : {0U, 60U, 96U, 105U, 135U, 149U}) {
            static_cast<void>(at(i));
            EXPECT_EQ(camera.dynamic_share(), 0) << seed << " frame " << i;
        }
        for (const std::uint32_t i : {61U, 70U, 80U, 95U, 106U, 120U, 134U}) {
            static_cast<void>(at(i));
            EXPECT_GT(camera.dynamic_share(), 0.015) << seed << " frame " << i;
            EXPECT_LT(camera.dynamic_share(), 0.25) << seed << " frame " << i;
        }
        const Kept before = at(60), chair_moves = at(61), between = at(100), crate_moves = at(106), after = at(140);
        // Where each stood, by the mask of its first moving frame, 33 ms later.
        Kept chair = before;
        chair.mask = chair_moves.mask;
        const Agreement chair_gone = compare(chair, between, info.model, 255);
        ASSERT_GT(chair_gone.checked, 200) << seed;
        EXPECT_LT(chair_gone.depth_agrees / chair_gone.checked, 0.3) << seed;
        Kept crate = between;
        crate.mask = crate_moves.mask;
        const Agreement crate_gone = compare(crate, after, info.model, 255);
        ASSERT_GT(crate_gone.checked, 200) << seed;
        EXPECT_LT(crate_gone.depth_agrees / crate_gone.checked, 0.5) << seed;
        const Agreement room = compare(before, after, info.model, 0);
        ASSERT_GT(room.checked, 2000) << seed;
        EXPECT_GT(room.depth_agrees / room.checked, 0.75) << seed;
    }
}

// The share of the picture that moves, frame by frame.
std::vector<double> moving_shares(const char* scene, std::uint64_t seed) {
    SimulatedCamera camera({.scene = scene, .seed = seed, .width = 64, .height = 48});
    EXPECT_EQ(camera.open(), Status::kOk);
    std::vector<double> out;
    Frame frame;
    while (camera.poll(frame) == Status::kOk) out.push_back(camera.dynamic_share());
    return out;
}

// Promise: the trolley that returns is out of sight for three seconds, and then covers more than 60 % of the picture
// again and again, and now and then nearly none of it.
TEST(SimulatedCamera, TrolleyComesAgainAndAgain) {
    for (const std::uint64_t seed : {1U, 2U, 5U}) {
        const std::vector<double> shares = moving_shares("trolley_returns", seed);
        ASSERT_EQ(shares.size(), 450U);
        EXPECT_EQ(*std::max_element(shares.begin(), shares.begin() + 90), 0) << seed;
        int passes = 0;
        bool is_away = true;
        for (const double share : shares) {
            passes += is_away && share > 0.6 ? 1 : 0;
            if (share > 0.6) is_away = false;
            if (share < 0.15) is_away = true;
        }
        EXPECT_GE(passes, 2) << seed;
    }
}

// Promise: two people at arm's length hold more than half of the picture in the mean, and are never out of sight.
TEST(SimulatedCamera, CrowdIsClose) {
    for (const std::uint64_t seed : {1U, 2U, 5U}) {
        const std::vector<double> shares = moving_shares("crowd_close", seed);
        double sum = 0;
        for (const double share : shares) sum += share;
        EXPECT_GT(sum / static_cast<double>(shares.size()), 0.5) << seed;
        EXPECT_GT(*std::min_element(shares.begin(), shares.end()), 0.1) << seed;
    }
}

// Promise: of the lift only its doors move, while they close and while they open; shut, they hide the room: nothing
// that is seen is more than a lift's depth away. Behind them is another floor in the end.
TEST(SimulatedCamera, LiftShutsTheRoomOut) {
    SimulatedCamera camera({.scene = "lift", .seed = 3, .width = 64, .height = 48});
    ASSERT_EQ(camera.open(), Status::kOk);
    Frame frame;
    for (int i = 0; camera.poll(frame) == Status::kOk; ++i) {
        const double time_s = i / 30.0;
        const bool is_shut = time_s > 5.3 && time_s < 8.4;
        const bool is_open = time_s < 2.9 || time_s > 10.8;
        if (is_shut || is_open) {
            EXPECT_EQ(camera.dynamic_share(), 0) << i;
        }
        double farthest_m = 0;
        for (std::uint32_t y = 0; y < 48; ++y) {
            for (std::uint32_t x = 0; x < 64; ++x)
                farthest_m = std::max(farthest_m, frame.depth.row(y)[x] / frame.depth_units_per_m);
        }
        if (is_shut) {
            EXPECT_LT(farthest_m, 1.8) << i;
        }
        if (is_open) {
            EXPECT_GT(farthest_m, 1.8) << i;
        }
    }
}

// Promise: at its closest the trolley holds most of the picture, never the whole of it.
TEST(SimulatedCamera, TrolleyLeavesSomeRoomInSight) {
    for (const char* scene : {"trolley_xyz", "trolley_first"}) {
        for (const std::uint64_t seed : {3U, 7U, 15U}) {
            SimulatedCamera camera({.scene = scene, .seed = seed, .width = 64, .height = 48});
            ASSERT_EQ(camera.open(), Status::kOk);
            Frame frame;
            double peak = 0;
            while (camera.poll(frame) == Status::kOk) peak = std::max(peak, camera.dynamic_share());
            EXPECT_GT(peak, 0.5) << scene << ":" << seed;
            EXPECT_LT(peak, 0.9) << scene << ":" << seed;
        }
    }
}

}  // namespace
}  // namespace stillmesh::simulated_camera_test
