// The engine with a store: a world larger than the pools, in memory that a test can look into and spoil.
#include "engine/paging/map_pager.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <vector>

#include "engine/engine_state.hpp"
#include "engine/paging/map_store.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#include "tests/engine/engine_rig.hpp"
#include "tests/persist/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::map_pager_test {
namespace {

// A store in memory that answers at the next poll, unless it is told to fail.
class MemoryStore final : public MapStore {
public:
    enum class Fault : std::uint8_t { kNone, kMute, kLate, kWrongNumber, kShort, kGarbage, kFull, kTooLong, kTwice };
    struct Kept {
        std::vector<WordWeight> words;
        std::vector<std::byte> body;
        std::int64_t time_ns = 0;
    };

    explicit MemoryStore(Fault fault = Fault::kNone) : fault_(fault) {}
    std::map<std::uint64_t, Kept> regions;
    StoreContent claimed;  // instead of what is there, if it has regions
    std::uint64_t keeps = 0, asks = 0, uses = 0;

    [[nodiscard]] StoreContent content() const noexcept override {
        if (claimed.regions > 0) return claimed;
        StoreContent out;
        out.regions = regions.size();
        for (const auto& [id, kept] : regions) {
            out.ids_end = id + 1;
            out.time_ns = std::max(out.time_ns, kept.time_ns);
        }
        return out;
    }
    [[nodiscard]] Status keep(const LeavingRegion& region) noexcept override {
        if (fault_ == Fault::kFull) return Status::kFull;
        ++keeps;
        EXPECT_FALSE(region.words.empty());
        Kept& kept = regions[region.id];
        kept.words.assign(region.words.begin(), region.words.end());
        kept.body.assign(region.body.begin(), region.body.end());
        kept.time_ns = region.time_ns;
        return Status::kOk;
    }
    [[nodiscard]] Status ask(const StoreQuestion& question) noexcept override {
        ++asks;
        number_ = question.number;
        best_ = ~std::uint64_t{0};
        std::uint32_t score = question.score_min - 1;
        for (const auto& [id, kept] : regions) {
            if (id >= question.older_than) break;
            if (std::find(question.without.begin(), question.without.end(), id) != question.without.end()) continue;
            const std::uint32_t here = bag_score(question.words, kept.words);
            if (here <= score) continue;
            score = here;
            best_ = id;
        }
        is_asked_ = true;
        waited_ = 0;
        return Status::kOk;
    }
    [[nodiscard]] Status poll(StoreAnswer& answer, std::span<std::byte> body) noexcept override {
        if (!is_asked_ || fault_ == Fault::kMute) return Status::kTimedOut;
        if (fault_ == Fault::kLate && ++waited_ < 3000) return Status::kTimedOut;
        is_asked_ = fault_ == Fault::kTwice && !is_repeated_;
        is_repeated_ = !is_repeated_;
        answer.question = fault_ == Fault::kWrongNumber ? number_ + 1 : number_;
        if (best_ == ~std::uint64_t{0}) return Status::kNotFound;
        const Kept& kept = regions.at(best_);
        answer.id = best_;
        answer.size_bytes = kept.body.size();
        std::copy(kept.body.begin(), kept.body.end(), body.begin());
        if (fault_ == Fault::kShort) answer.size_bytes /= 2;
        if (fault_ == Fault::kTooLong) answer.size_bytes = body.size() + 1;
        if (fault_ == Fault::kGarbage) {
            Random random(asks);
            for (int i = 0; i < 8; ++i) {
                body[random.below(static_cast<std::uint32_t>(kept.body.size()))] =
                    static_cast<std::byte>(random.below(256));
            }
        }
        return Status::kOk;
    }
    void note_use(std::uint64_t) noexcept override { ++uses; }

private:
    Fault fault_;
    bool is_asked_ = false, is_repeated_ = false;
    std::uint64_t number_ = 0, best_ = 0, waited_ = 0;
};

// Small pools, room for the vocabulary that comes with the program.
Limits small(bool has_store) {
    Limits limits = Limits::tiny();
    limits.image_width_max = 320;
    limits.image_height_max = 240;
    limits.pyramid_levels_max = 5;
    limits.features_max = 250;
    limits.keyframes_max = 8;
    limits.map_points_max = 900;
    limits.local_points_max = 600;
    limits.vocabulary_words_max = 10000;
    limits.store_features_max = has_store ? 250 : 0;
    return limits;
}

Parameters configuration_of(const Limits& limits) {
    Parameters out = test::fitting(limits);
    out.keyframes.gap_min = 3;
    out.keyframes.new_points_min = 20;
    out.store.gap_frames = 20;
    out.loop.inliers_min = 20;
    out.weights.proven_s = 0.01;  // keyframes of pools as small do not grow old
    out.local_map.near_keyframes = 2;
    out.local_map.sharing_keyframes = 2;
    return out;
}

// Out and back again: forwards through the frames, then backwards, then forwards, at times that go on.
const test::Sequence& there_and_back() {
    static const test::Sequence kept = [] {
        test::Sequence once = test::rendered("static_loop", 90, 320, 240, 1);
        test::Sequence out;
        out.camera = once.camera;
        const auto add = [&](std::size_t i) {
            out.frames.push_back(once.frames[i]);
            out.frames.back().time_ns = 1'000'000'000 + static_cast<std::int64_t>(out.frames.size()) * 33'333'333;
        };
        for (std::size_t i = 0; i < once.frames.size(); ++i) add(i);
        for (std::size_t i = once.frames.size(); i-- > 0;) add(i);
        return out;
    }();
    return kept;
}

struct Ran {
    std::vector<std::uint64_t> hashes;
    EngineStatistics statistics;
    std::uint32_t without_pose = 0;
    ScheduleStatistics schedule;
};

class Rig {
public:
    Rig(const Limits& limits, const Parameters& configuration, MapStore* store) : memory_(bytes_needed(limits)) {
        std::string message;
        EXPECT_TRUE(vocabulary_.open("default", limits.vocabulary_words_max, message)) << message;
        const auto made = create_engine(memory_.span(), limits, configuration, there_and_back().camera,
                                        {cpu_kernels(), nullptr, vocabulary_.bytes(), store});
        EXPECT_TRUE(made.is_ok());
        engine_ = made.value();
    }
    Engine& operator*() { return *engine_; }
    Engine* operator->() { return engine_; }
    Map& map() { return static_cast<EngineState*>(engine_)->world.map; }

    Ran run(std::uint32_t units = 20000, std::uint32_t parts = 1) {
        Ran out;
        for (const test::KeptFrame& kept : there_and_back().frames) {
            EXPECT_EQ(engine_->submit(kept.frame()), Status::kOk);
            for (std::uint32_t part = 0; part < parts; ++part) static_cast<void>(engine_->step(units / parts));
            EXPECT_EQ(test::find_fault(map()), nullptr) << test::find_fault(map());
            out.hashes.push_back(engine_->state_hash());
            out.without_pose += engine_->pose().state < PoseState::kUnsure ? 1U : 0U;
        }
        out.statistics = engine_->statistics();
        out.schedule = out.statistics.schedule;
        return out;
    }

private:
    test::Memory memory_;
    VocabularyFile vocabulary_;
    Engine* engine_ = nullptr;
};

// Promise: in a world larger than the pools places leave for the store and come back when the camera does, and are seen
// again; without a store they are gone. The same store gives the same bits, however the units are granted.
TEST(MapPager, PlacesComeBack) {
    const Limits limits = small(true);
    std::vector<std::uint64_t> wanted;
    for (const std::uint32_t parts : {1U, 4U}) {
        MemoryStore store;
        Rig rig(limits, configuration_of(limits), &store);
        const Ran ran = rig.run(20000, parts);
        const StoreStatistics& s = ran.statistics.store;
        EXPECT_GT(s.kept, 5U);
        EXPECT_EQ(s.kept, store.keeps);
        EXPECT_GT(s.returned, 2U);
        EXPECT_GT(s.useful, 0U);
        EXPECT_GT(store.uses, 0U);
        EXPECT_GT(s.points_made, 50U);
        EXPECT_EQ(s.damaged, 0U);
        EXPECT_EQ(s.refused, 0U);
        EXPECT_LE(ran.statistics.keyframes.high_water, limits.keyframes_max);
        if (wanted.empty()) wanted = ran.hashes;
        EXPECT_EQ(ran.hashes, wanted) << parts;
    }
}

// Promise: the map may be written at any moment, also between the return of a place and the next frame, and what is
// written can be read. (Its points carry the mark of a frame that is still to come, and the file was refused.)
TEST(MapPager, AMapIsWholeRightAfterAReturn) {
    const Limits limits = small(true);
    MemoryStore store;
    Rig rig(limits, configuration_of(limits), &store);
    Rig reader(limits, configuration_of(limits), nullptr);
    std::uint64_t returned = 0;
    for (const test::KeptFrame& kept : there_and_back().frames) {
        ASSERT_EQ(rig->submit(kept.frame()), Status::kOk);
        static_cast<void>(rig->step(20000));
        if (rig->statistics().store.returned == returned) continue;
        returned = rig->statistics().store.returned;
        MapFileProblem problem;
        EXPECT_EQ(reader->load_map(test::saved(*rig, limits), MapUse::kContinue, problem, 0), Status::kOk)
            << problem.part;
    }
    EXPECT_GT(returned, 2U);
}

// Promise: whatever a store says that it holds, the camera is tracked in a map that was loaded, and the map that comes
// of it can be loaded again.
TEST(MapPager, AStoreMayClaimAnything) {
    const Limits limits = small(true);
    const std::vector<test::KeptFrame>& frames = there_and_back().frames;
    const auto follow = [&](Rig& rig, std::size_t count) {
        std::uint32_t measured = 0;
        for (std::size_t i = 0; i < count; ++i) {
            EXPECT_EQ(rig->submit(frames[i].frame()), Status::kOk);
            static_cast<void>(rig->step(20000));
            measured += rig->pose().state >= PoseState::kUnsure ? 1U : 0U;
        }
        return measured;
    };
    MapFileProblem problem;
    Rig reader(limits, configuration_of(limits), nullptr);
    EXPECT_EQ(follow(reader, 40), 40U);
    const test::Bytes file = test::saved(*reader, limits);
    constexpr std::uint64_t kEnd = ~std::uint64_t{0};
    constexpr std::int64_t kLast_ns = std::numeric_limits<std::int64_t>::max();
    for (const StoreContent& claimed : {StoreContent{1, 41, 0}, StoreContent{1, kEnd, 0},
                                        StoreContent{1, kEnd / 2, kLast_ns}, StoreContent{1, 0, -kLast_ns}}) {
        MemoryStore store;
        store.claimed = claimed;
        Rig rig(limits, configuration_of(limits), &store);
        ASSERT_EQ(rig->load_map(file, MapUse::kContinue, problem, 0), Status::kOk) << problem.part;
        EXPECT_GT(follow(rig, 40), 25U) << claimed.ids_end;
        EXPECT_EQ(reader->load_map(test::saved(*rig, limits), MapUse::kContinue, problem, 0), Status::kOk)
            << claimed.ids_end << ", " << claimed.time_ns << ": " << problem.part;
    }
}

// Promise: an engine that could have a store and was given none does what one without does, bit by bit.
TEST(MapPager, WithoutAStoreNothingChanges) {
    Rig without(small(false), configuration_of(small(false)), nullptr);
    Rig unused(small(true), configuration_of(small(true)), nullptr);
    EXPECT_EQ(without.run().hashes, unused.run().hashes);
    MemoryStore store;
    const Limits limits = small(false);
    test::Memory memory(bytes_needed(limits));
    EXPECT_EQ(create_engine(memory.span(), limits, configuration_of(limits), there_and_back().camera,
                            {cpu_kernels(), nullptr, {}, &store})
                  .status(),
              Status::kInvalid);
}

// Promise: a store whose answers never come, come late, twice, to another question, cut off, too long or with any bytes
// in them, and one that takes nothing, leaves the map right and the camera tracked; each is counted.
TEST(MapPager, AStoreMayFail) {
    using Fault = MemoryStore::Fault;
    for (const Fault fault : {Fault::kMute, Fault::kLate, Fault::kWrongNumber, Fault::kShort, Fault::kGarbage,
                              Fault::kFull, Fault::kTooLong, Fault::kTwice}) {
        MemoryStore store(fault);
        const Limits limits = small(true);
        Parameters configuration = configuration_of(limits);
        configuration.store.gap_frames = 10;
        Rig rig(limits, configuration, &store);
        const Ran ran = rig.run();
        const StoreStatistics& s = ran.statistics.store;
        EXPECT_LT(ran.without_pose, 20U) << static_cast<int>(fault);
        if (fault == Fault::kFull) {
            EXPECT_EQ(s.kept, 0U);
            EXPECT_GT(s.refused, 0U);
        } else {
            EXPECT_GT(s.asked, 0U);
        }
        if (fault == Fault::kMute || fault == Fault::kLate || fault == Fault::kWrongNumber) {
            EXPECT_GT(s.late, 0U) << static_cast<int>(fault);
            EXPECT_EQ(s.returned, 0U) << static_cast<int>(fault);
        }
        if (fault == Fault::kShort || fault == Fault::kTooLong) {
            EXPECT_GT(s.damaged, 0U) << static_cast<int>(fault);
            EXPECT_EQ(s.returned, 0U) << static_cast<int>(fault);
        }
    }
}

// Promise: no slice takes more than its ceiling, while regions go and come.
TEST(MapPager, WorkIsBounded) {
    MemoryStore store;
    const Limits limits = small(true);
    Parameters configuration = configuration_of(limits);
    configuration.schedule.slice_units = 1;
    Rig rig(limits, configuration, &store);
    const Ran ran = rig.run(4000);
    EXPECT_GT(ran.statistics.store.kept, 0U);
    EXPECT_LE(ran.schedule.largest_overdraw_units, 12'000U);
}

// Promise: a region that was kept is one; cut off anywhere it is none, and with any byte flipped it is refused or every
// feature of it can still be read: nothing that cannot be gets into the map.
TEST(MapPager, ARegionIsCheckedBeforeItIsUsed) {
    MemoryStore store;
    const Limits limits = small(true);
    Rig rig(limits, configuration_of(limits), &store);
    static_cast<void>(rig.run());
    ASSERT_FALSE(store.regions.empty());
    const std::vector<std::byte> body = store.regions.begin()->second.body;
    RegionInfo info;
    const auto checked = [&](std::span<const std::byte> bytes) {
        return check_region(bytes, {250, 5, 320, 240}, info);
    };
    ASSERT_EQ(checked(body), Status::kOk);
    EXPECT_EQ(info.keyframe.frame, store.regions.begin()->first);
    EXPECT_EQ(body.size(), region_bytes_max(info.keyframe.observations));
    EXPECT_EQ(check_region(body, {info.keyframe.observations - 1, 5, 320, 240}, info), Status::kFull);
    for (std::size_t size = 0; size < body.size(); size += size < 700 ? 1 : 37) {
        ASSERT_NE(checked(std::span(body).first(size)), Status::kOk) << size;
    }
    std::uint32_t refused = 0;
    const std::size_t end = kRegionHeadBytes + 2 * kRegionFeatureBytes;
    for (std::size_t at = 0; at < end; ++at) {
        std::vector<std::byte> bytes = body;
        bytes[at] ^= std::byte{0xff};
        const Status status = checked(bytes);
        refused += status == Status::kOk ? 0U : 1U;
        if (at < 4) {
            EXPECT_EQ(status, Status::kInvalid);
        }
        for (std::uint32_t i = 0; status == Status::kOk && i < info.keyframe.observations; ++i) {
            Observation observation;
            Descriptor descriptor;
            MapPoint point;
            read_region_feature(bytes, i, observation, descriptor, point);
            ASSERT_LT(point.level, 5U);
            ASSERT_FALSE(point.is_suspect);
        }
    }
    EXPECT_GT(refused, end / 8);
}

// Promise: what a map's point has and a region's has not is refused in any of its points: a keyframe that it was first
// seen from, and no vote.
TEST(MapPager, ARegionsPointsNameNoKeyframe) {
    MemoryStore store;
    const Limits limits = small(true);
    Rig rig(limits, configuration_of(limits), &store);
    static_cast<void>(rig.run());
    ASSERT_FALSE(store.regions.empty());
    const std::vector<std::byte> body = store.regions.begin()->second.body;
    RegionInfo info;
    ASSERT_EQ(check_region(body, {250, 5, 320, 240}, info), Status::kOk);
    ASSERT_GT(info.keyframe.observations, 2U);
    for (const std::uint32_t i : {0U, 1U, info.keyframe.observations - 1}) {
        for (const bool is_suspect : {false, true}) {
            Observation observation;
            Descriptor descriptor;
            MapPoint point;
            read_region_feature(body, i, observation, descriptor, point);
            point.is_suspect = is_suspect;
            std::vector<std::byte> bytes = body;
            ByteWriter writer(
                std::span<std::byte>(bytes).subspan(kRegionHeadBytes + kRegionFeatureBytes * i, kRegionFeatureBytes));
            map_records::feature_fields(writer, observation, descriptor);
            map_records::point_fields(writer, point, std::uint32_t{is_suspect ? 0U : 1U});
            ASSERT_EQ(writer.remaining(), 0U);
            EXPECT_EQ(check_region(bytes, {250, 5, 320, 240}, info), Status::kCorrupt) << i;
        }
    }
}

// Promise: with hardly any room for points or keyframes, whatever comes back, the map stays right.
TEST(MapPager, EveryPoolMayBeFull) {
    for (const std::uint32_t points : {250U, 300U, 400U}) {
        for (const std::uint32_t keyframes : {3U, 5U}) {
            MemoryStore store;
            Limits limits = small(true);
            limits.map_points_max = points;
            limits.keyframes_max = keyframes;
            limits.local_points_max = 200;
            limits.store_features_max = 60 + points / 4;
            Parameters configuration = configuration_of(limits);
            configuration.store.pause_frames = 1;
            configuration.store.gap_frames = 5;
            Rig rig(limits, configuration, &store);
            const Ran ran = rig.run();
            EXPECT_GT(ran.statistics.store.kept, 0U);
            EXPECT_LE(ran.statistics.map_points.high_water, points);
        }
    }
}

// Promise: one region is something to begin in, an empty store is nothing; an engine without a store has nothing to
// keep.
TEST(MapPager, OneRegionIsAMapToBeginIn) {
    const Limits limits = small(true);
    MemoryStore store;
    {
        Rig rig(limits, configuration_of(limits), &store);
        static_cast<void>(rig->submit(there_and_back().frames[0].frame()));
        EXPECT_GE(rig->pose().state, PoseState::kUnsure) << "where it begins is where it is";
        rig->reset();
        static_cast<void>(rig.run());
    }
    ASSERT_FALSE(store.regions.empty());
    store.regions.erase(std::next(store.regions.begin()), store.regions.end());
    Rig rig(limits, configuration_of(limits), &store);
    static_cast<void>(rig->submit(there_and_back().frames[0].frame()));
    EXPECT_EQ(rig->pose().state, PoseState::kNone) << "it has to be found first";
    rig->reset();
    static_cast<void>(rig->submit(there_and_back().frames[0].frame()));
    EXPECT_EQ(rig->pose().state, PoseState::kNone) << "after a reset, too";
    Rig without(small(false), configuration_of(small(false)), nullptr);
    EXPECT_EQ(without->step_store(1000), Progress::kIdle);
}

// Promise: with a store, too, an engine that was reset is as a new one, bit by bit.
TEST(MapPager, AResetEngineIsAsANewOne) {
    const Limits limits = small(true);
    MemoryStore store;
    Rig used(limits, configuration_of(limits), &store);
    EXPECT_GT(used.run().statistics.store.asked, 0U);
    used->reset();
    MemoryStore same = store;
    Rig fresh(limits, configuration_of(limits), &same);
    EXPECT_EQ(used.run().hashes, fresh.run().hashes);
}

// Promise: an engine that begins with a store that holds regions finds the camera among them, in their world, and its
// keyframes get names of their own; step_store() has given the store all that was in memory before.
TEST(MapPager, AStoreIsAMapToBeginIn) {
    MemoryStore store;
    const Limits limits = small(true);
    Parameters configuration = configuration_of(limits);
    configuration.loop.inliers_min = 25;
    {
        Rig rig(limits, configuration, &store);
        static_cast<void>(rig.run());
        while (rig->step_store(1000) == Progress::kWorking) {
        }
        EXPECT_EQ(rig->step_store(1000), Progress::kIdle);
    }
    ASSERT_GT(store.regions.size(), 5U);
    const std::uint64_t ids_end = store.content().ids_end;
    Rig rig(limits, configuration, &store);
    const Ran ran = rig.run();
    EXPECT_GT(ran.statistics.store.returned, 0U);
    EXPECT_LT(ran.without_pose, there_and_back().frames.size() / 2);
    for (const auto& [id, kept] : store.regions) {
        if (id >= ids_end) {
            EXPECT_GT(kept.time_ns, 0);
        }
    }
}

}  // namespace
}  // namespace stillmesh::map_pager_test
