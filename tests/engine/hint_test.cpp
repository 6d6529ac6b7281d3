// Hints of the motion through the front door, on a rendered trolley that fills the picture from the first frame: there
// nothing but the hint tells it from the room. 320x240 rather than tiny: the room beside the trolley has to have
// features.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>

#include "platform/motion/simulated_motion.hpp"
#include "tests/engine/engine_rig.hpp"

namespace stillmesh::hint_test {
namespace {

using test::EngineRig;
using test::fitting;
using test::KeptFrame;
using test::Sequence;

struct Outcome {
    double worst_m = 0, last_m = 0;
    std::uint32_t tracked = 0, tracked_wrong = 0;
};

// What becomes of a frame's hint.
enum class Fault { kNone, kNoHint, kStands, kTooSure };

// `from`, `to`: frames with the fault; `reach`: of a match before points have a past.
Outcome run(const Sequence& sequence, Fault fault, std::size_t from = 0, std::size_t to = 1000, double reach = 0.075) {
    Parameters parameters = fitting(Limits::pocket());
    parameters.region.reach = reach;
    const EngineRig engine(Limits::pocket(), sequence.camera, parameters);
    EXPECT_EQ(engine.status(), Status::kOk);
    SimulatedMotion motion(3, {}, fault == Fault::kTooSure ? 5 : 1);
    Outcome out;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        const KeptFrame& kept = sequence.frames[i];
        const bool has_hint = motion.step({kept.time_ns, kept.truth.t, kept.truth.q}) && fault != Fault::kNoHint;
        MotionHint hint = motion.wheels();
        if (fault == Fault::kStands && i >= from && i < to) {
            hint.last_from_camera = RigidTransform{};
            hint.sigma_m = hint.sigma_rad = 0.0003;
        }
        EXPECT_EQ(engine->submit(kept.frame(), has_hint ? &hint : nullptr), Status::kOk);
        static_cast<void>(engine->step(20000));
        const PoseEstimate& pose = engine->pose();
        out.last_m = test::metres_off(pose.odom_from_camera, sequence.frames[0].truth, kept.truth);
        out.worst_m = std::max(out.worst_m, out.last_m);
        const bool is_tracked = pose.state == PoseState::kTracked;
        out.tracked += is_tracked ? 1U : 0U;
        out.tracked_wrong += is_tracked && out.last_m > 0.05 ? 1U : 0U;
    }
    return out;
}

// Promise: where a body fills the picture from the first frame, hints say what is the room: without them, and where the
// larger surface has no say, it is followed, and not called tracked while the room goes on beside it; with them the
// pose is right from the start, and tracked, and as much with deviations five times too small.
TEST(Hints, ABodyThatFillsThePictureIsNotTheRoom) {
    const Sequence trolley = test::rendered("trolley_first", 45, 320, 240, 5);
    const Outcome without = run(trolley, Fault::kNoHint, 0, 0, 0);
    EXPECT_GT(without.last_m, 0.2);
    EXPECT_LE(without.tracked_wrong, 9U) << "frames: .3 s; what it is taken from goes on beside it";
    for (const Fault fault : {Fault::kNone, Fault::kTooSure}) {
        const Outcome with = run(trolley, fault);
        EXPECT_LT(with.worst_m, 0.03);
        EXPECT_EQ(with.tracked_wrong, 0U);
        EXPECT_GT(with.tracked, 40U);
    }
}

// Promise: where the picture is right, wheels that stand while the camera moves take it nowhere: from the first frame
// on the poses are no worse than without, but for the first second they are not sure; later they stay tracked.
TEST(Hints, AWheelThatSlipsCostsNoPose) {
    constexpr std::size_t kProven = 32;  // frames: a second
    for (const std::uint64_t seed : {4U, 7U}) {
        const Sequence trolley = test::rendered("trolley_first", 60, 320, 240, seed);
        const Outcome without = run(trolley, Fault::kNoHint);
        const Outcome early = run(trolley, Fault::kStands, 0, kProven);
        EXPECT_LT(early.worst_m, without.worst_m + 0.005) << seed;
        EXPECT_EQ(early.tracked_wrong, 0U) << seed;
        const Outcome late = run(trolley, Fault::kStands, kProven);
        EXPECT_LT(late.worst_m, without.worst_m + 0.005) << seed;
        EXPECT_EQ(late.tracked_wrong, 0U) << seed;
        EXPECT_GE(late.tracked + 3, without.tracked) << seed;
    }
}

// Promise: a hint that is no number is refused with its frame, and nothing else changes; one that says nothing is none.
TEST(Hints, WhatIsNoHintIsRefusedWithItsFrame) {
    const Sequence room = test::rendered("static_xyz", 6, 160, 120);
    const EngineRig plain(Limits::tiny(), room.camera);
    const EngineRig hinted(Limits::tiny(), room.camera);
    MotionHint bad;
    bad.sigma_m = 0.01;
    bad.last_from_camera.translation_m[1] = std::numeric_limits<double>::quiet_NaN();
    const MotionHint silent;
    for (const KeptFrame& kept : room.frames) {
        ASSERT_EQ(plain->submit(kept.frame()), Status::kOk);
        EXPECT_EQ(hinted->submit(kept.frame(), &bad), Status::kInvalid);
        ASSERT_EQ(hinted->submit(kept.frame(), &silent), Status::kOk);
        EXPECT_EQ(hinted->state_hash(), plain->state_hash());
    }
    EXPECT_EQ(hinted->statistics().frames_refused, room.frames.size());
}

// Promise: the same hints give the same bits, and reset() forgets them.
TEST(Hints, ResetForgetsThem) {
    const Sequence room = test::rendered("static_xyz", 12, 160, 120, 2);
    const EngineRig engine(Limits::tiny(), room.camera);
    std::uint64_t hashes[3] = {};  // the last one without hints
    for (std::uint64_t& hash : hashes) {
        engine->reset();
        SimulatedMotion motion(1, {}, 5);
        for (const KeptFrame& kept : room.frames) {
            const bool has_hint = motion.step({kept.time_ns, kept.truth.t, kept.truth.q}) && &hash != &hashes[2];
            const MotionHint hint = motion.wheels();
            ASSERT_EQ(engine->submit(kept.frame(), has_hint ? &hint : nullptr), Status::kOk);
        }
        hash = engine->state_hash();
    }
    EXPECT_EQ(hashes[0], hashes[1]);
    EXPECT_NE(hashes[0], hashes[2]);
}

}  // namespace
}  // namespace stillmesh::hint_test
