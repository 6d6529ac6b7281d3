#include <gtest/gtest.h>

#include <cmath>

#include "engine/base/random.hpp"
#include "tests/persist/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh {
namespace {

using test::Bytes;
using test::EngineRig;
using test::Sequence;

const Sequence& tiny_sequence() {
    static const Sequence sequence = test::rendered("walking_xyz", 90, 160, 120, 3);
    return sequence;
}

// Promise: a map that was saved and loaded has the hash of the map that was saved, whatever slots its objects had; all
// that is kept incrementally is right; saved again, it gives the same bytes.
TEST(MapFile, RoundTripKeepsEveryBit) {
    const Sequence sequence = test::rendered("static_halfsphere", 90, 160, 120, 3);
    Parameters configuration = test::fitting(Limits::tiny());
    configuration.keyframes.tracked_urgent_permille = 600;  // more keyframes than there is room for
    EngineRig first(Limits::tiny(), sequence.camera, configuration);
    EngineRig second(Limits::tiny(), sequence.camera, configuration);
    std::uint64_t evicted = 0;
    for (const std::size_t frames : {3U, 20U, 50U, 90U}) {
        first->reset();
        test::run(*first, sequence, 0, frames);
        evicted += first->statistics().keyframes_forgotten;
        const Bytes file = test::saved(*first, Limits::tiny());
        ASSERT_GT(file.size(), 5000U);
        const MapFileInfo info = test::info_of(file);
        EXPECT_EQ(info.size_bytes, file.size());
        EXPECT_EQ(info.frames, frames);
        EXPECT_EQ(info.keyframes, first->statistics().keyframes.size);
        EXPECT_EQ(info.points, first->statistics().map_points.size);
        EXPECT_EQ(info.hash, test::map_hash(*first));
        MapFileProblem problem;
        ASSERT_EQ(second->load_map(file, MapUse::kContinue, problem), Status::kOk) << problem.part;
        EXPECT_EQ(test::map_hash(*second), info.hash);
        EXPECT_EQ(test::find_fault(test::map_of(*second)), nullptr);
        EXPECT_TRUE(test::saved(*second, Limits::tiny()) == file);
    }
    EXPECT_GT(evicted, 0U) << "else slots and places in the file are the same anyway";
}

// Promise: the size of the pieces in which a file is fetched changes nothing.
TEST(MapFile, PiecesChangeNothing) {
    const Sequence& sequence = tiny_sequence();
    EngineRig engine(Limits::tiny(), sequence.camera);
    test::run(*engine, sequence, 0, 20);
    test::CopySpace space(Limits::tiny());
    ASSERT_EQ(engine->begin_map_copy(space.span()), Status::kOk);
    while (engine->step_map_copy(7) == Progress::kWorking) {
    }
    const Bytes whole = space.file(std::size_t{1} << 20U);
    for (const std::size_t piece : {std::size_t{512}, std::size_t{513}, std::size_t{1000}, std::size_t{65536}}) {
        EXPECT_TRUE(space.file(piece) == whole) << piece;
    }
}

// Promise: a copy taken in slices of any size while tracking and mapping go on is the map of one instant, exactly; and
// neither poses nor the state hash know of it.
TEST(MapFile, CopyInSlicesIsTheMapOfOneInstant) {
    const Sequence& sequence = tiny_sequence();
    EngineRig plain(Limits::tiny(), sequence.camera);
    EngineRig copied(Limits::tiny(), sequence.camera);
    EngineRig loaded(Limits::tiny(), sequence.camera);
    test::CopySpace space(Limits::tiny());
    Random random(5);
    std::uint32_t copies = 0;
    std::uint32_t over_frames = 0;
    bool is_copying = false;
    std::size_t begun = 0;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
        for (EngineRig* const engine : {&plain, &copied}) {
            ASSERT_EQ((*engine)->submit(sequence.frames[i].frame()), Status::kOk);
        }
        // Background work in three parts; before, between and behind them the copy goes on.
        for (int part = 0; part < 3; ++part) {
            static_cast<void>(plain->step(2000));
            if (!is_copying && random.uniform() < 0.5) {
                ASSERT_EQ(copied->begin_map_copy(space.span()), Status::kOk);
                is_copying = true;
                begun = i;
            }
            const Progress progress = copied->step_map_copy(random.below(8));
            static_cast<void>(is_copying);
            if (progress == Progress::kDone) {
                is_copying = false;
                ++copies;
                over_frames += i > begun ? 1U : 0U;
                const std::uint64_t hash = test::map_hash(*copied);
                const Bytes file = space.file();
                EXPECT_EQ(test::info_of(file).hash, hash);
                MapFileProblem problem;
                ASSERT_EQ(loaded->load_map(file, MapUse::kContinue, problem), Status::kOk) << problem.part;
                EXPECT_EQ(test::map_hash(*loaded), hash);
                EXPECT_EQ(test::find_fault(test::map_of(*loaded)), nullptr);
            }
            static_cast<void>(copied->step(2000));
        }
        EXPECT_EQ(plain->state_hash(), copied->state_hash()) << i;
    }
    EXPECT_GT(copies, 10U);
    EXPECT_GT(over_frames, 5U) << "copies that took more than a frame";
}

// Promise: nothing to copy, no room, nothing begun, reset in the middle: each has its answer.
TEST(MapFile, CopiesThatCannotBe) {
    const Sequence& sequence = tiny_sequence();
    EngineRig engine(Limits::tiny(), sequence.camera);
    test::CopySpace space(Limits::tiny());
    EXPECT_EQ(engine->step_map_copy(100), Progress::kIdle);
    EXPECT_EQ(engine->begin_map_copy(space.span()), Status::kNotFound);
    test::run(*engine, sequence, 0, 5);
    EXPECT_EQ(engine->begin_map_copy(space.span().first(space.span().size() - 1)), Status::kFull);
    ASSERT_EQ(engine->begin_map_copy(space.span()), Status::kOk);
    EXPECT_EQ(engine->step_map_copy(1), Progress::kWorking);
    engine->reset();
    EXPECT_EQ(engine->step_map_copy(1000), Progress::kIdle);
}

// Promise: an engine that loaded a map and one that loaded it from another processor's or its own file go on alike:
// the run after a load is a function of file and frames.
TEST(MapFile, RunsAfterALoadRepeat) {
    const Sequence& sequence = tiny_sequence();
    EngineRig first(Limits::tiny(), sequence.camera);
    test::run(*first, sequence, 0, 40);
    const Bytes file = test::saved(*first, Limits::tiny());
    std::uint64_t hashes[2] = {};
    for (std::uint64_t& hash : hashes) {
        EngineRig engine(Limits::tiny(), sequence.camera, test::fitting(Limits::tiny()), cpu_kernels(),
                         &hash == hashes ? 0 : 255);
        if (&hash != hashes) test::run(*engine, sequence, 10, 20);  // what was before is forgotten
        MapFileProblem problem;
        ASSERT_EQ(engine->load_map(file, MapUse::kContinue, problem), Status::kOk);
        test::run(*engine, sequence, 40, 90);
        EXPECT_EQ(test::find_fault(test::map_of(*engine)), nullptr);
        EXPECT_EQ(engine->statistics().frames, 50U);
        hash = engine->state_hash();
    }
    EXPECT_EQ(hashes[0], hashes[1]);
}

}  // namespace
}  // namespace stillmesh
