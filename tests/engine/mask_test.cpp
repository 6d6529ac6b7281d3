// Masks of a detector through the front door, on a rendered trolley that fills the picture from the first frame: there
// nothing but the mask tells it from the room. 320x240 rather than tiny: the room beside the trolley has to have
// features.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "tests/engine/engine_rig.hpp"

namespace stillmesh::mask_test {
namespace {

using test::EngineRig;
using test::fitting;
using test::KeptFrame;
using test::Sequence;

struct Outcome {
    double worst_m = 0, last_m = 0;
    std::uint64_t hash = 0;
};

enum class Masks { kNone, kRight, kInverted, kEverything, kNothing };

// `reach`: of a match before points have a past.
Outcome run(const Sequence& sequence, Masks masks, bool is_used = true, double reach = 0.075) {
    Parameters parameters = fitting(Limits::pocket());
    parameters.region.reach = reach;
    parameters.mask.is_used = is_used;
    const EngineRig engine(Limits::pocket(), sequence.camera, parameters);
    EXPECT_EQ(engine.status(), Status::kOk);
    Outcome out;
    std::vector<std::uint8_t> pixels;
    for (const KeptFrame& kept : sequence.frames) {
        Frame frame = kept.frame();
        pixels.assign(kept.moving.size(), masks == Masks::kEverything ? 255 : 0);
        for (std::size_t i = 0; i < pixels.size() && (masks == Masks::kRight || masks == Masks::kInverted); ++i)
            pixels[i] = (kept.moving[i] == 255) == (masks == Masks::kRight) ? 255 : 0;
        if (masks != Masks::kNone) frame.mask = {pixels.data(), kept.width, kept.height, kept.width};
        EXPECT_EQ(engine->submit(frame), Status::kOk);
        static_cast<void>(engine->step(20000));
        out.last_m = test::metres_off(engine->pose().odom_from_camera, sequence.frames[0].truth, kept.truth);
        out.worst_m = std::max(out.worst_m, out.last_m);
    }
    out.hash = engine->state_hash();
    return out;
}

// Promise: where a body fills the picture from the first frame, a mask says what is the room: without it, or switched
// off, and where the larger surface has no say, the body is followed; with it the pose is right from the start.
TEST(Masks, ABodyThatFillsThePictureIsNotTheRoom) {
    const Sequence trolley = test::rendered("trolley_first", 45, 320, 240, 5);
    const Outcome without = run(trolley, Masks::kNone, true, 0);
    EXPECT_GT(without.last_m, 0.2);
    EXPECT_EQ(run(trolley, Masks::kRight, false, 0).hash, without.hash);
    EXPECT_LT(run(trolley, Masks::kRight, true, 0).worst_m, 0.03);
}

// Promise: a mask turned round, one that covers everything and one that covers nothing change no bit: the first two are
// not believed, the last says nothing.
TEST(Masks, OnesThatCannotBeRightChangeNothing) {
    const Sequence people = test::rendered("walking_xyz", 40, 320, 240, 2);
    const std::uint64_t without = run(people, Masks::kNone).hash;
    EXPECT_EQ(run(people, Masks::kEverything).hash, without);
    EXPECT_EQ(run(people, Masks::kNothing).hash, without);
    EXPECT_EQ(run(people, Masks::kInverted).hash, without);
    EXPECT_NE(run(people, Masks::kRight).hash, without);
}

// Promise: a mask of another size, or with rows that are shorter than the picture's, is refused with its frame, and
// nothing else changes.
TEST(Masks, OneOfAnotherSizeIsRefusedWithItsFrame) {
    const Sequence room = test::rendered("static_xyz", 2, 160, 120);
    const EngineRig engine(Limits::tiny(), room.camera);
    const std::vector<std::uint8_t> pixels(160 * 120, 0);
    Frame frame = room.frames[0].frame();
    for (const ImageView<std::uint8_t>& wrong :
         {ImageView<std::uint8_t>{pixels.data(), 80, 120, 80}, ImageView<std::uint8_t>{pixels.data(), 160, 60, 160},
          ImageView<std::uint8_t>{pixels.data(), 160, 120, 159}}) {
        const std::uint64_t before = engine->state_hash();
        frame.mask = wrong;
        EXPECT_EQ(engine->submit(frame), Status::kInvalid);
        EXPECT_EQ(engine->state_hash(), before);
    }
    frame.mask = {pixels.data(), 160, 120, 160};
    EXPECT_EQ(engine->submit(frame), Status::kOk);
    EXPECT_EQ(engine->statistics().frames_refused, 3U);
}

}  // namespace
}  // namespace stillmesh::mask_test
