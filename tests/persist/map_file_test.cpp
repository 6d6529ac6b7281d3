#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/record/map_copy.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/persist/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::map_file_test {
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

// Promise: one keyframe is a map.
TEST(MapFile, OneKeyframeIsAMap) {
    EngineRig engine(Limits::tiny(), tiny_sequence().camera), loaded(Limits::tiny(), tiny_sequence().camera);
    test::run(*engine, tiny_sequence(), 0, 1);
    const Bytes map = test::saved(*engine, Limits::tiny());
    ASSERT_EQ(test::info_of(map).keyframes, 1U);
    MapFileProblem problem;
    ASSERT_EQ(loaded->load_map(map, MapUse::kContinue, problem), Status::kOk);
    EXPECT_EQ(test::map_hash(*loaded), test::map_hash(*engine));
}

// Promise: keyframes that change while a copy is made are copied anew, all at the instant if there are few, and in
// another round of slices if there are many; either way the copy is the map as it is then, and one step is bounded.
TEST(MapFile, KeyframesThatChangeTooLate) {
    constexpr std::uint32_t kKeyframes = 30, kFeatures = 40;
    const Limits limits = test::small(kKeyframes, kKeyframes * kFeatures, 2 * kFeatures);
    for (const std::uint32_t late : {0U, MapCopy::kLateMax, MapCopy::kLateMax + 1, kKeyframes}) {
        test::MapInMemory map(limits);
        std::vector<Handle<Keyframe>> keyframes;
        const auto show = [&](Handle<Keyframe> keyframe, std::uint32_t features) {
            for (std::uint32_t i = 0; i < features; ++i) {
                map->add_observation(keyframe, test::observation_of({}, static_cast<float>(i)), Descriptor{});
            }
        };
        for (std::uint32_t i = 0; i < kKeyframes; ++i) {
            keyframes.push_back(test::add_keyframe(*map, i));
            show(keyframes.back(), kFeatures);
        }
        test::CopySpace space(limits), whole(limits);
        MapCopy copy;
        const auto step = [&](std::uint32_t units) {
            WorkBudget budget(units);
            const Progress progress = copy.step(*map, DepthImages{}, {kKeyframes, 7}, budget);
            const std::uint64_t of_one = 2 * kFeatures / 16 + 1;
            EXPECT_LE(budget.units_spent(), units + of_one * MapCopy::kLateMax + map->points().slots_count() / 16 + 8);
            return progress;
        };
        ASSERT_EQ(copy.begin(space.span(), limits, {}), Status::kOk);
        for (std::uint32_t i = 0; i < kKeyframes; ++i) ASSERT_EQ(step(1), Progress::kWorking) << "a keyframe a step";
        for (std::uint32_t i = 0; i < late; ++i) show(keyframes[i], kFeatures / 2);
        const bool is_too_late = late > MapCopy::kLateMax;
        EXPECT_EQ(step(1), is_too_late ? Progress::kWorking : Progress::kDone) << late;
        std::uint32_t steps = 0;
        while (is_too_late && step(1) == Progress::kWorking) ++steps;
        EXPECT_EQ(steps, is_too_late ? late : 0U) << "those that changed, and the instant";
        EXPECT_EQ(step(1), Progress::kIdle);
        ASSERT_EQ(copy.begin(whole.span(), limits, {}), Status::kOk);
        ASSERT_EQ(step(1000), Progress::kDone);
        EXPECT_EQ(MapFileWriter(space.span()).info().features, kKeyframes * kFeatures + late * kFeatures / 2);
        EXPECT_TRUE(space.file() == whole.file()) << late;
    }
}

// Promise: a map that was made through a lens that Brown's five numbers do not tell is read by a camera of that very
// lens and by no other.
TEST(MapFile, TheLensMustBeTheSame) {
    const Sequence& sequence = tiny_sequence();
    CameraModel lens = sequence.camera;
    lens.k4 = 1e-6;
    EngineRig maker(Limits::tiny(), lens);
    test::run(*maker, sequence, 0, 5);
    const Bytes file = test::saved(*maker, Limits::tiny());
    for (const double k4 : {1e-6, 2e-6, 0.0}) {
        lens.k4 = k4;
        EngineRig reader(Limits::tiny(), lens);
        MapFileProblem problem;
        const Status status = reader->load_map(file, MapUse::kContinue, problem);
        EXPECT_EQ(status, k4 == 1e-6 ? Status::kOk : Status::kInvalid) << k4;
        EXPECT_EQ(problem.fault, k4 == 1e-6 ? MapFault::kNone : MapFault::kOtherCamera) << k4;
    }
}

// Promise: a zero of the camera has no sign: a camera with -0 makes the file that one with 0 makes, each reads the
// other's, and a file with -0 is taken and written back without.
TEST(MapFile, AZeroOfTheCameraHasNoSign) {
    const Sequence& sequence = tiny_sequence();
    CameraModel plain = sequence.camera;
    plain.k1 = plain.k4 = 0;
    plain.lens = Lens::kFisheye;
    CameraModel below = plain;
    below.k1 = below.k4 = -0.0;
    EngineRig with_plain(Limits::tiny(), plain);
    EngineRig with_below(Limits::tiny(), below);
    for (EngineRig* const engine : {&with_plain, &with_below}) test::run(**engine, sequence, 0, 5);
    const Bytes file = test::saved(*with_plain, Limits::tiny());
    EXPECT_TRUE(test::saved(*with_below, Limits::tiny()) == file);
    EXPECT_EQ(with_plain->state_hash(), with_below->state_hash());
    Bytes other = file;
    const auto k1_at = static_cast<std::size_t>(map_records::records_at(
                           test::info_of(file), static_cast<std::uint32_t>(map_records::Section::kCamera))) +
                       40;
    test::put(other, k1_at, std::bit_cast<std::uint64_t>(-0.0), 8);
    test::mend(other);
    for (EngineRig* const engine : {&with_plain, &with_below}) {
        MapFileProblem problem;
        ASSERT_EQ((*engine)->load_map(other, MapUse::kContinue, problem), Status::kOk) << problem.part;
        EXPECT_TRUE(test::saved(**engine, Limits::tiny()) == file);
    }
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
}  // namespace stillmesh::map_file_test
