// Two maps into one: pictures and truth are those of hal/simulated, every map goes through its file.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "engine/map_merge.hpp"
#include "engine/record/map_checks.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#include "tests/persist/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::map_merge_test {
namespace {

using test::Bytes;
using test::Sequence;

constexpr std::uint32_t kWidth = 320;
constexpr std::uint32_t kHeight = 240;

Limits limits_of_test() {
    Limits out = Limits::pocket();
    out.keyframes_max = 80;
    out.map_points_max = 11000;
    return out;
}

// An engine that recognises places.
class Rig {
public:
    explicit Rig(const Limits& limits, bool has_vocabulary = true) : memory_(bytes_needed(limits)) {
        made_ = create_engine(
            memory_.span(), limits, test::fitting(limits), empty_room().camera,
            {cpu_kernels(), nullptr, has_vocabulary ? default_vocabulary() : std::span<const std::byte>{}});
    }
    // The room while nobody is there; the same on another day, with people; another one; what a camera sees that goes
    // round the desk, in two halves that overlap.
    static const Sequence& empty_room() {
        static const Sequence sequence = test::rendered("static_xyz", 60, kWidth, kHeight, 1);
        return sequence;
    }
    static const Sequence& another_day() {
        static const Sequence sequence = test::rendered("sitting_xyz", 60, kWidth, kHeight, 1, 7);
        return sequence;
    }
    static const Sequence& another_room() {
        static const Sequence sequence = test::rendered("static_xyz", 60, kWidth, kHeight, 4);
        return sequence;
    }
    static const Sequence& round_the_desk() {
        static const Sequence sequence = test::rendered("static_halfsphere", 200, kWidth, kHeight, 1);
        return sequence;
    }
    [[nodiscard]] Engine* operator->() const { return made_.value(); }
    [[nodiscard]] Engine& operator*() const { return *made_.value(); }

private:
    test::Memory memory_;
    Result<Engine*> made_{Status::kInvalid};
};

Bytes map_of_frames(const Sequence& sequence, std::size_t first, std::size_t last) {
    Rig engine(Limits::pocket());
    test::run(*engine, sequence, first, last);
    return test::saved(*engine, Limits::pocket());
}
Bytes map_of_sequence(const Sequence& sequence) {
    return map_of_frames(sequence, 0, sequence.frames.size());
}

// The first, the second joined to it, all of it adjusted, as a file.
struct Joined {
    Status status = Status::kInvalid;
    MapMerge merge;
    MapFileProblem problem;
    Bytes map;
};
Joined join(const Bytes& first, const Bytes& second, const Limits& limits) {
    Joined out;
    Rig engine(limits);
    MapFileProblem problem;
    EXPECT_EQ(engine->load_map(first, MapUse::kContinue, problem), Status::kOk) << problem.part;
    out.status = merge_map(*engine, second, out.problem, out.merge);
    if (out.status != Status::kOk) return out;
    EXPECT_EQ(test::find_fault(test::map_of(*engine)), nullptr);
    while (engine->step(100'000) != Progress::kIdle) {
    }
    EXPECT_EQ(test::find_fault(test::map_of(*engine)), nullptr);
    out.map = test::saved(*engine, limits);
    return out;
}

// How far each keyframe of a map lies from the truth, by its frame, in the world that `first` began; frames from
// `first_frames` on are those of `second` from `second_begin` on.
std::map<std::uint64_t, double> keyframes_off(const Bytes& map, const Sequence& first, std::uint64_t first_frames,
                                              const Sequence& second, std::size_t second_begin = 0) {
    Rig engine(limits_of_test());
    MapFileProblem problem;
    EXPECT_EQ(engine->load_map(map, MapUse::kLocalise, problem), Status::kOk) << problem.part;
    std::vector<KeyframePose> keyframes(limits_of_test().keyframes_max);
    keyframes.resize(engine->keyframes(keyframes));
    std::map<std::uint64_t, double> out;
    for (const KeyframePose& keyframe : keyframes) {
        const auto& truth = keyframe.id < first_frames ? first.frames[keyframe.id].truth
                                                       : second.frames[keyframe.id - first_frames + second_begin].truth;
        out[keyframe.id] = test::metres_off(keyframe.map_from_camera, first.frames[0].truth, truth);
    }
    return out;
}

// The most that a keyframe of a joined map is farther off than it was in its own map, m.
double farther_off(const Bytes& joined, const Bytes& first_map, const Sequence& first, const Bytes& second_map,
                   const Sequence& second) {
    const std::uint64_t first_frames = test::info_of(first_map).frames;
    const auto now = keyframes_off(joined, first, first_frames, second);
    double most = 0;
    std::size_t found = 0;
    for (const auto& [frame, off] : keyframes_off(first_map, first, first_frames, first)) {
        found += now.count(frame);
        most = std::max(most, now.at(frame) - off);
    }
    const std::uint64_t second_frames = test::info_of(second_map).frames;
    for (const auto& [frame, off] : keyframes_off(second_map, second, second_frames, second)) {
        found += now.count(frame + first_frames);
        most = std::max(most, now.at(frame + first_frames) - off);
    }
    EXPECT_EQ(found, now.size());
    return most;
}

// Promise: maps of one room from two days, the second with people in it, are one map afterwards: whole by all that
// loading checks, larger than each, with no keyframe of either more than 1 cm farther from the truth, now that of the
// first one's world, than it was in its own map, whichever comes first; and the same bytes each time.
TEST(MapMerge, TwoDaysInOneRoom) {
    const Bytes empty = map_of_sequence(Rig::empty_room()), walked = map_of_sequence(Rig::another_day());
    const Joined joined = join(empty, walked, limits_of_test());
    ASSERT_EQ(joined.status, Status::kOk) << joined.merge.found << " " << joined.merge.agreeing;
    const MapFileInfo a = test::info_of(empty), b = test::info_of(walked), c = test::info_of(joined.map);
    EXPECT_EQ(joined.merge.keyframes, b.keyframes);
    EXPECT_EQ(c.keyframes, a.keyframes + b.keyframes);
    EXPECT_EQ(c.frames, a.frames + b.frames);
    EXPECT_LT(c.points, a.points + b.points);
    EXPECT_GE(c.points + joined.merge.points_fused, std::max(a.points, b.points));
    EXPECT_GT(joined.merge.points_fused, 100U);
    const double off = farther_off(joined.map, empty, Rig::empty_room(), walked, Rig::another_day());
    const Joined other_way = join(walked, empty, limits_of_test());
    ASSERT_EQ(other_way.status, Status::kOk);
    const double off_other_way = farther_off(other_way.map, walked, Rig::another_day(), empty, Rig::empty_room());
    std::printf("%u of %u keyframes agree, elsewhere %.2f; farther off by %.4f m at most, other way round %.4f m\n",
                joined.merge.agreeing, joined.merge.keyframes, joined.merge.elsewhere_share, off, off_other_way);
    EXPECT_LT(off, 0.01);
    EXPECT_LT(off_other_way, 0.01);
    EXPECT_EQ(join(empty, walked, limits_of_test()).map, joined.map);
}

// Promise: of a way that was mapped in two halves one map is made in which a camera is found all along it, within 3 cm
// of the truth.
TEST(MapMerge, HalvesOfOneWay) {
    const Sequence& way = Rig::round_the_desk();
    constexpr std::size_t kSecondBegin = 80, kFirstEnd = 120;
    const Bytes first = map_of_frames(way, 0, kFirstEnd), second = map_of_frames(way, kSecondBegin, way.frames.size());
    const Joined joined = join(first, second, limits_of_test());
    ASSERT_EQ(joined.status, Status::kOk) << joined.merge.found << " " << joined.merge.agreeing;
    double off = 0;
    for (const auto& [frame, metres] : keyframes_off(joined.map, way, kFirstEnd, way, kSecondBegin)) {
        off = std::max(off, metres);
    }
    EXPECT_LT(off, 0.03);
    Rig engine(limits_of_test());
    MapFileProblem problem;
    ASSERT_EQ(engine->load_map(joined.map, MapUse::kLocalise, problem), Status::kOk) << problem.part;
    std::size_t posed = 0, posed_late = 0;
    double most = 0;
    for (std::size_t i = 0; i < way.frames.size(); ++i) {
        static_cast<void>(engine->submit(way.frames[i].frame()));
        static_cast<void>(engine->step(20000));
        if (engine->pose().state < PoseState::kUnsure) continue;
        ++posed;
        posed_late += i >= kFirstEnd ? 1U : 0U;
        const RigidTransform& pose = engine->pose().odom_from_camera;
        most = std::max(most, test::metres_off(pose, way.frames[0].truth, way.frames[i].truth));
    }
    std::printf("keyframes off by %.4f m at most; localised in %zu of %zu frames, %zu of the last %zu, off by %.4f m\n",
                off, posed, way.frames.size(), posed_late, way.frames.size() - kFirstEnd, most);
    EXPECT_GT(posed, way.frames.size() * 8 / 10);
    EXPECT_GT(posed_late, (way.frames.size() - kFirstEnd) * 9 / 10);
    EXPECT_LT(most, 0.03);
}

// Promise: a map that is more than limits allow is thinned to them, whole, and a camera is still found all along it.
TEST(MapMerge, FitsIntoLimits) {
    const Sequence& way = Rig::round_the_desk();
    Limits narrow = Limits::pocket();
    narrow.keyframes_max = 16;
    narrow.map_points_max = 2500;
    Rig engine(limits_of_test());
    MapFileProblem problem;
    MapMerge merge;
    ASSERT_EQ(engine->load_map(map_of_frames(way, 0, 120), MapUse::kContinue, problem), Status::kOk);
    ASSERT_EQ(merge_map(*engine, map_of_frames(way, 80, way.frames.size()), problem, merge), Status::kOk);
    ASSERT_GT(test::map_of(*engine).keyframes().size(), narrow.keyframes_max);
    ASSERT_GT(test::map_of(*engine).points().size(), narrow.map_points_max);
    fit_map(*engine, narrow);
    EXPECT_EQ(test::map_of(*engine).keyframes().size(), narrow.keyframes_max);
    EXPECT_LE(test::map_of(*engine).points().size(), narrow.map_points_max);
    EXPECT_EQ(test::find_fault(test::map_of(*engine)), nullptr);
    const Bytes map = test::saved(*engine, limits_of_test());
    Rig small(narrow);
    ASSERT_EQ(small->load_map(map, MapUse::kLocalise, problem), Status::kOk) << problem.part;
    std::size_t posed = 0;
    for (const auto& frame : way.frames) {
        static_cast<void>(small->submit(frame.frame()));
        static_cast<void>(small->step(20000));
        posed += small->pose().state >= PoseState::kUnsure ? 1U : 0U;
    }
    EXPECT_GT(posed, way.frames.size() * 8 / 10);
}

// All depth images that an engine has, by frame.
std::map<std::uint64_t, DepthImage> images_of(const Engine& engine, const Limits& limits) {
    std::map<std::uint64_t, DepthImage> out;
    for (std::uint32_t i = 0; i < limits.depth_images_max; ++i) {
        if (const DepthImage image = engine.depth_image(i); image.columns > 0) out[image.frame] = image;
    }
    return out;
}
double most_off(const RigidTransform& a, const RigidTransform& b) {
    double out = 0;
    for (int i = 0; i < 3; ++i) out = std::max(out, std::abs(a.translation_m[i] - b.translation_m[i]));
    for (int i = 0; i < 4; ++i) out = std::max(out, std::abs(a.rotation_xyzw[i] - b.rotation_xyzw[i]));
    return out;
}

// Promise: depth images of both maps are in the joined one, cell by cell, those of the second moved as it moved; they
// are in its file; and where there is room for fewer, it is filled, with some of what each map's keyframes saw.
TEST(MapMerge, DepthImagesOfBothStay) {
    const Sequence way = test::slowed(Rig::round_the_desk());
    Limits limits = limits_of_test();
    limits.depth_images_max = 64;
    Rig one(limits), other(limits);
    test::run(*one, way, 0, 120);
    test::run(*other, way, 80, way.frames.size());
    const Bytes first = test::saved(*one, limits), second = test::saved(*other, limits);
    const auto of_first = images_of(*one, limits), of_second = images_of(*other, limits);
    const std::uint64_t frames = test::info_of(first).frames;
    ASSERT_GT(of_first.size(), 8U);
    ASSERT_GT(of_second.size(), 8U);
    ASSERT_LE(of_first.size() + of_second.size(), 64U);
    const auto of_one = static_cast<std::uint32_t>(std::max(of_first.size(), of_second.size()));
    for (const std::uint32_t places : {64U, of_one}) {
        limits.depth_images_max = places;
        Rig engine(limits);
        MapFileProblem problem;
        MapMerge merge;
        ASSERT_EQ(engine->load_map(first, MapUse::kContinue, problem), Status::kOk) << problem.part;
        ASSERT_EQ(merge_map(*engine, second, problem, merge), Status::kOk) << problem.part;
        const auto both = images_of(*engine, limits);
        EXPECT_EQ(both.size(), std::min<std::size_t>(places, of_first.size() + of_second.size()));
        std::size_t seconds = 0;
        for (const auto& [frame, image] : both) {
            const bool is_second = frame >= frames;
            seconds += is_second ? 1U : 0U;
            const DepthImage& was = is_second ? of_second.at(frame - frames) : of_first.at(frame);
            EXPECT_TRUE(std::equal(image.depth_mm.begin(), image.depth_mm.end(), was.depth_mm.begin())) << frame;
            const RigidTransform lay =
                is_second ? compose(merge.map_from_second, was.map_from_camera) : was.map_from_camera;
            EXPECT_LT(most_off(image.map_from_camera, lay), 1e-5) << frame;
        }
        EXPECT_GE(seconds, both.size() / 4);
        EXPECT_GE(both.size() - seconds, both.size() / 4);
        const Bytes map = test::saved(*engine, limits);
        EXPECT_EQ(test::info_of(map).depth_images, both.size());
        Limits fewer = limits;
        fewer.depth_images_max = 8;
        fit_map(*engine, fewer);
        const auto left = images_of(*engine, limits);
        EXPECT_EQ(left.size(), 8U);
        EXPECT_LT(left.begin()->first, frames);
        EXPECT_GE(left.rbegin()->first, frames);
        ASSERT_EQ(engine->load_map(map, MapUse::kContinue, problem), Status::kOk) << problem.part;
        EXPECT_EQ(images_of(*engine, limits).size(), both.size());
    }
}

// Promise: maps of two rooms are not joined, and the engine has forgotten the first as well.
TEST(MapMerge, TwoRoomsAreRefused) {
    Rig engine(limits_of_test());
    MapFileProblem problem;
    MapMerge merge;
    ASSERT_EQ(engine->load_map(map_of_sequence(Rig::empty_room()), MapUse::kContinue, problem), Status::kOk);
    const Bytes other = map_of_sequence(Rig::another_room());
    EXPECT_EQ(merge_map(*engine, other, problem, merge), Status::kNotFound);
    EXPECT_EQ(merge.keyframes, test::info_of(other).keyframes);
    EXPECT_LT(merge.agreeing, 4U);
    EXPECT_EQ(test::map_of(*engine).keyframes().size(), 0U);
    EXPECT_EQ(test::map_of(*engine).points().size(), 0U);
}

// Promise: whatever the numbers of a second map say that passes loading's checks, the maps are joined into one that
// loads again, or not joined.
TEST(MapMerge, AnyNumbers) {
    const Bytes first = map_of_sequence(Rig::empty_room());
    const MapFileInfo info = test::info_of(first);
    const std::size_t keyframes_at = kMapHeaderBytes + 16 + 88 + 4 + 16;
    const std::size_t points_at = keyframes_at + 328 * std::size_t{info.keyframes} + 4 + 16;
    Rig engine(limits_of_test());
    Random random(5);
    std::size_t passed = 0, joined = 0;
    for (int i = 0; i < 120; ++i) {
        Bytes second = first;
        for (std::uint32_t edits = 1 + random.below(3); edits > 0; --edits) {
            const bool is_keyframe = random.below(2) == 0;
            const std::size_t at = is_keyframe ? keyframes_at + random.below(328 * info.keyframes)
                                               : points_at + random.below(184 * info.points);
            second[at] = static_cast<std::byte>(random.below(256));
        }
        test::mend(second);
        MapFileProblem problem;
        MapMerge merge;
        ASSERT_EQ(engine->load_map(first, MapUse::kContinue, problem), Status::kOk);
        const Status status = merge_map(*engine, second, problem, merge);
        ASSERT_TRUE(status == Status::kOk || status == Status::kNotFound || status == Status::kCorrupt ||
                    status == Status::kInvalid || status == Status::kFull);
        passed += status == Status::kOk || status == Status::kNotFound ? 1U : 0U;
        if (status != Status::kOk) continue;
        ++joined;
        while (engine->step(100'000) != Progress::kIdle) {
        }
        const Bytes both = test::saved(*engine, limits_of_test());
        ASSERT_EQ(engine->load_map(both, MapUse::kLocalise, problem), Status::kOk) << problem.part << " after " << i;
    }
    std::printf("%zu of 120 passed the checks, %zu were joined\n", passed, joined);
    EXPECT_GT(passed, 20U);
    EXPECT_GT(joined, 10U);
}

// Promise: what is just enough is enough, and no problem: room for both maps and no more, and as much time and as many
// frames as a map can have; a nanosecond or a frame more is refused. What is joined so loses nothing where it is
// fitted.
TEST(MapMerge, JustEnoughIsEnough) {
    const Bytes map = map_of_sequence(Rig::empty_room());
    const MapFileInfo info = test::info_of(map);
    Limits limits = limits_of_test();
    limits.keyframes_max = 2 * info.keyframes;
    limits.map_points_max = 2 * info.points;
    const auto time_max_ns = static_cast<std::uint64_t>(map_checks::kTimeMax_ns - 1'000'000'000 - info.time_ns);
    const std::uint64_t frames_max = map_checks::kFramesMax - info.frames;
    for (const std::uint64_t beyond : {0U, 1U}) {
        for (const bool is_time : {true, false}) {
            Bytes second = map;
            test::put(second, is_time ? 56 : 64, (is_time ? time_max_ns : frames_max) + beyond, 8);
            test::mend(second);
            Rig engine(limits);
            MapFileProblem problem;
            MapMerge merge;
            ASSERT_EQ(engine->load_map(map, MapUse::kContinue, problem), Status::kOk);
            EXPECT_EQ(merge_map(*engine, second, problem, merge), beyond == 0 ? Status::kOk : Status::kCorrupt);
            EXPECT_EQ(problem.fault, beyond == 0 ? MapFault::kNone : MapFault::kImpossible);
            if (beyond > 0) {
                EXPECT_STREQ(problem.part, "the time of both maps together");
                continue;
            }
            const std::uint64_t before = test::map_hash(*engine);
            Limits as_it_is = limits;
            as_it_is.map_points_max = static_cast<std::uint32_t>(test::map_of(*engine).points().size());
            fit_map(*engine, as_it_is);
            EXPECT_EQ(test::map_hash(*engine), before);
            const Bytes both = test::saved(*engine, limits);
            EXPECT_EQ(test::info_of(both).frames, is_time ? 2 * info.frames : map_checks::kFramesMax);
            EXPECT_EQ(test::info_of(both).time_ns,
                      is_time ? map_checks::kTimeMax_ns : 2 * info.time_ns + 1'000'000'000);
        }
    }
}

// Promise: what does not go together is refused by name, and nothing changes: more than the limits, another camera,
// damage, no vocabulary, an engine that has a map of its own or none.
TEST(MapMerge, RefusesWithoutATrace) {
    const Bytes map = map_of_sequence(Rig::empty_room());
    const MapFileInfo info = test::info_of(map);
    MapFileProblem problem;
    MapMerge merge;
    Limits narrow = limits_of_test();
    narrow.keyframes_max = 2 * info.keyframes - 1;
    {
        Rig engine(narrow);
        EXPECT_EQ(merge_map(*engine, map, problem, merge), Status::kUnavailable);
        ASSERT_EQ(engine->load_map(map, MapUse::kContinue, problem), Status::kOk);
        const std::uint64_t hash = test::map_hash(*engine);
        EXPECT_EQ(merge_map(*engine, map, problem, merge), Status::kFull);
        EXPECT_EQ(problem.fault, MapFault::kTooManyFor);
        EXPECT_STREQ(problem.part, "limits.keyframes_max");
        EXPECT_EQ(problem.value, 2 * info.keyframes);
        EXPECT_EQ(problem.limit, narrow.keyframes_max);
        Bytes damaged = map;
        damaged[damaged.size() / 2] ^= std::byte{1};
        EXPECT_EQ(merge_map(*engine, damaged, problem, merge), Status::kCorrupt);
        Bytes other_camera = map;
        test::put(other_camera, kMapHeaderBytes + 16, 321, 4);
        test::mend(other_camera);
        EXPECT_EQ(merge_map(*engine, other_camera, problem, merge), Status::kInvalid);
        EXPECT_EQ(problem.fault, MapFault::kOtherCamera);
        EXPECT_EQ(test::map_hash(*engine), hash);
        ASSERT_EQ(engine->submit(Rig::empty_room().frames[0].frame()), Status::kOk);
        EXPECT_EQ(merge_map(*engine, map, problem, merge), Status::kUnavailable);
    }
    narrow = limits_of_test();
    narrow.map_points_max = 2 * info.points - 1;
    Rig few_points(narrow);
    ASSERT_EQ(few_points->load_map(map, MapUse::kContinue, problem), Status::kOk);
    EXPECT_EQ(merge_map(*few_points, map, problem, merge), Status::kFull);
    EXPECT_STREQ(problem.part, "limits.map_points_max");
    Rig no_words(limits_of_test(), false);
    ASSERT_EQ(no_words->load_map(map, MapUse::kContinue, problem), Status::kOk);
    EXPECT_EQ(merge_map(*no_words, map, problem, merge), Status::kUnavailable);
}

}  // namespace
}  // namespace stillmesh::map_merge_test
