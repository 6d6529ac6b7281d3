#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <string>

#include "engine/record/map_bytes.hpp"
#include "engine/record/map_checks.hpp"
#include "engine/record/map_records.hpp"
#include "tests/persist/map_rig.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::damage_test {
namespace {

using namespace map_records;
using test::Bytes;
using test::EngineRig;
using test::Sequence;

const Sequence& sequence() {
    static const Sequence out = test::slowed(test::rendered("static_xyz", 20, 160, 120));
    return out;
}
const Limits& small() {
    static const Limits out = [] {
        Limits limits = Limits::tiny();
        limits.depth_images_max = 3;
        return limits;
    }();
    return out;
}

// A small map, two keyframes, two depth images, and an engine in the middle of another run, who must not notice.
struct Damage : testing::Test {
    Damage() : engine(small(), sequence().camera) {
        EngineRig maker(small(), sequence().camera);
        test::run(*maker, sequence(), 0, 20);
        file = test::saved(*maker, small());
        test::run(*engine, sequence(), 0, 5);
        before = test::map_hash(*engine);
    }
    // What load_map says; it must not say yes, and the engine must be as it was.
    MapFileProblem refused(const Bytes& bytes, Status& status) {
        MapFileProblem problem;
        status = engine->load_map(bytes, MapUse::kContinue, problem);
        EXPECT_NE(status, Status::kOk);
        EXPECT_NE(problem.fault, MapFault::kNone);
        return problem;
    }
    MapFault fault_of(const Bytes& bytes) {
        Status status = Status::kOk;
        return refused(bytes, status).fault;
    }
    void TearDown() override {
        EXPECT_EQ(test::map_hash(*engine), before) << "a file that was refused touched the engine";
        EXPECT_EQ(engine->statistics().frames, 5U);
        MapFileProblem problem;
        EXPECT_EQ(engine->load_map(file, MapUse::kContinue, problem), Status::kOk) << "and the good one is good";
    }
    // Where record `index` of a section begins.
    [[nodiscard]] std::size_t at(Section section, std::uint32_t index) const {
        const auto s = static_cast<std::uint32_t>(section);
        return static_cast<std::size_t>(records_at(test::info_of(file), s)) +
               index * record_bytes(test::info_of(file), s);
    }
    // Where the links to a point are, and by which keyframes, 1 for the first.
    [[nodiscard]] std::map<std::uint32_t, std::size_t> links_to(std::uint32_t point) const {
        std::map<std::uint32_t, std::size_t> out;
        const MapFileInfo info = test::info_of(file);
        const MapFile records{file, info};
        std::uint32_t i = 0;
        for (std::uint32_t k = 0; k < info.keyframes; ++k) {
            const std::uint64_t end = i + test::number_at(file, at(Section::kKeyframes, k) + 300, 4);
            for (; i < end; ++i) {
                if (records.link(i) == point + 1) out[k + 1] = at(Section::kLinks, i);
            }
        }
        return out;
    }
    // A point that one keyframe alone shows.
    [[nodiscard]] std::uint32_t point_seen_once() const {
        std::uint32_t point = 0;
        while (links_to(point).size() != 1) ++point;
        return point;
    }

    EngineRig engine;
    Bytes file;
    std::uint64_t before = 0;
};

// Promise: a file cut off anywhere is refused as cut off (as no map when nothing is left of it); one with a byte too
// many too.
TEST_F(Damage, CutOffAtEveryByte) {
    for (std::size_t size = 0; size < file.size(); ++size) {
        const Bytes cut(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(size));
        ASSERT_EQ(fault_of(cut), size == 0 ? MapFault::kNoMap : MapFault::kCutOff) << size;
    }
    Bytes longer = file;
    longer.push_back(std::byte{0});
    EXPECT_EQ(fault_of(longer), MapFault::kTooLong);
}

// Promise: no bit of the header can change unnoticed, and no byte of the rest (of the records every seventh is tried,
// of what depth images consist of every 97th).
TEST_F(Damage, EveryByteFlipped) {
    Bytes flipped = file;
    for (std::size_t i = 0; i < kMapHeaderBytes; ++i) {
        for (std::uint32_t bit = 0; bit < 8; ++bit) {
            flipped[i] = file[i] ^ static_cast<std::byte>(1U << bit);
            const bool is_known = i == 8 && bit == 0;  // 2 instead of 3
            const MapFault wanted = i < 8                 ? MapFault::kNoMap
                                    : i < 12 && !is_known ? MapFault::kOtherVersion
                                                          : MapFault::kDamaged;
            ASSERT_EQ(fault_of(flipped), wanted) << i << " bit " << bit;
        }
        flipped[i] = file[i];
    }
    std::vector<std::size_t> places;
    const MapFileInfo info = test::info_of(file);
    ASSERT_EQ(sections_of(info), kSections);
    for (std::uint32_t s = 0; s < kSections; ++s) {
        const auto begin = static_cast<std::size_t>(records_at(info, s));
        const std::size_t end = begin + static_cast<std::size_t>(section_bytes(info, s));
        for (std::size_t i = begin - kSectionHeadBytes; i < begin; ++i) places.push_back(i);
        const std::size_t step = s > static_cast<std::uint32_t>(Section::kDepth) ? 97 : 7;
        for (std::size_t i = begin; i < end; i += step) places.push_back(i);
        for (std::size_t i = end; i < end + kCrcBytes; ++i) places.push_back(i);
    }
    EXPECT_EQ(places.back(), file.size() - 1);
    for (const std::size_t i : places) {
        flipped[i] = file[i] ^ static_cast<std::byte>(1U << (i % 8));
        ASSERT_EQ(fault_of(flipped), MapFault::kDamaged) << i;
        flipped[i] = file[i];
    }
}

// Promise: a map that is larger than the engine's limits is refused by the key that would have to grow.
TEST_F(Damage, LargerThanTheLimits) {
    const MapFileInfo info = test::info_of(file);
    ASSERT_GE(info.keyframes, 2U);
    const struct {
        std::size_t at;
        std::uint32_t limit;
        const char* key;
    } counts[] = {{24, small().keyframes_max, "limits.keyframes_max"},
                  {28, small().map_points_max, "limits.map_points_max"},
                  {36, small().features_max, "limits.features_max"}};
    for (const auto& count : counts) {
        for (const std::uint64_t value : {std::uint64_t{count.limit} + 1, std::uint64_t{0xffffffffU}}) {
            Bytes larger = file;
            test::put(larger, count.at, value, 4);
            // A file of the size that its header says, as far as it is there.
            MapFileInfo said = info;
            (count.at == 24   ? said.keyframes
             : count.at == 28 ? said.points
                              : said.features_of_keyframe) = static_cast<std::uint32_t>(value);
            test::put(larger, 16, file_bytes(said), 8);
            test::mend(larger);
            Status status = Status::kOk;
            const MapFileProblem problem = refused(larger, status);
            EXPECT_EQ(status, Status::kFull);
            EXPECT_EQ(problem.fault, MapFault::kTooManyFor);
            EXPECT_STREQ(problem.part, count.key);
            EXPECT_EQ(problem.value, static_cast<double>(value));
            EXPECT_EQ(problem.limit, static_cast<double>(count.limit));
        }
    }
}

// Promise: what another camera, extractor or pyramid made is refused by name.
TEST_F(Damage, MadeByOthers) {
    MapFileProblem problem;
    EXPECT_EQ(engine->load_map(file, MapUse::kContinue, problem, 1), Status::kInvalid);
    EXPECT_EQ(problem.fault, MapFault::kOtherExtractor);
    Bytes other = file;
    test::put(other, 40, 5, 4);
    test::mend(other);
    Status status = Status::kOk;
    problem = refused(other, status);
    EXPECT_EQ(problem.fault, MapFault::kOtherFeatures);
    EXPECT_STREQ(problem.part, "features.levels");
    other = file;
    test::put(other, 48, std::bit_cast<std::uint64_t>(1.25), 8);
    test::mend(other);
    problem = refused(other, status);
    EXPECT_EQ(problem.fault, MapFault::kOtherFeatures);
    EXPECT_STREQ(problem.part, "features.scale_factor");
    EXPECT_EQ(problem.value, 1.25);
    other = file;
    test::put(other, at(Section::kCamera, 0) + 8, std::bit_cast<std::uint64_t>(100.0), 8);
    test::mend(other);
    problem = refused(other, status);
    EXPECT_EQ(problem.fault, MapFault::kOtherCamera);
    EXPECT_STREQ(problem.part, "fx");
    other = file;
    test::put(other, 80, 1, 4);  // of a lens that Brown's five numbers do not tell
    test::mend(other);
    problem = refused(other, status);
    EXPECT_EQ(problem.fault, MapFault::kOtherCamera);
    EXPECT_STREQ(problem.part, "checksum of the lens model");
}

// Promise: contents that cannot be are refused although every CRC is right.
TEST_F(Damage, ImpossibleContents) {
    const MapFileInfo info = test::info_of(file);
    constexpr auto kNan = std::numeric_limits<double>::quiet_NaN();
    const auto bits = [](double number) { return std::bit_cast<std::uint64_t>(number); };
    const std::uint64_t nan_float = 0x7fc00000U;
    const std::size_t keyframe = at(Section::kKeyframes, 1);
    const std::size_t point = at(Section::kPoints, 3);
    const std::size_t feature = at(Section::kFeatures, 5);
    const std::size_t depth = at(Section::kDepth, 1);
    const std::size_t ray = at(Section::kRays, 7);
    std::uint32_t linked[2] = {};  // two features of the first keyframe that show points
    for (std::uint32_t i = 0, count = 0; count < 2; ++i) {
        if (test::number_at(file, at(Section::kLinks, i), 4) != 0) linked[count++] = i;
    }
    const std::uint64_t first_link = test::number_at(file, at(Section::kLinks, linked[0]), 4);
    const struct {
        const char* what;
        std::size_t at;
        std::uint64_t value;
        std::size_t bytes;
    } edits[] = {
        {"features too many", 32, info.features + 1, 4},
        {"largest keyframe", 36, info.features_of_keyframe - 1, 4},
        {"time below zero", 56, ~std::uint64_t{0}, 8},
        {"frames beyond all time", 64, std::uint64_t{1} << 60U, 8},
        {"fewer frames than keyframes know", 64, 1, 8},
        {"depth images too many", 84, info.depth_images + 1, 4},
        {"no depth images", 84, 0, 4},
        {"columns of depth images", 88, info.depth_columns - 1U, 2},
        {"rows of depth images", 90, info.depth_rows + 1U, 2},
        {"the version of a file without depth images", 8, kMapVersion, 4},
        {"readout of the camera", at(Section::kCamera, 0) + 80, bits(kNan), 8},
        {"a rotation that is none", keyframe, bits(0.5), 8},
        {"NaN in a rotation", keyframe + 8, bits(kNan), 8},
        {"NaN in a translation", keyframe + 72, bits(kNan), 8},
        {"far away", keyframe + 80, bits(1e7), 8},
        {"NaN derivative of a pose", keyframe + 200, bits(kNan), 8},
        {"speed of light", keyframe + 240, bits(3e8), 8},
        {"readout of a keyframe", keyframe + 288, bits(kNan), 8},
        {"parent that is not there", keyframe + 296, info.keyframes + 1, 4},
        {"its own parent", keyframe + 296, 2, 4},
        {"two roots", keyframe + 296, 0, 4},
        {"features of a keyframe", keyframe + 300, 0xffffffffU, 4},
        {"time of a keyframe", keyframe + 304, std::uint64_t{1} << 62U, 8},
        {"frame of a keyframe", keyframe + 312, info.frames, 8},
        {"frame of the other", keyframe + 312, test::number_at(file, at(Section::kKeyframes, 0) + 312, 8), 8},
        {"use of a keyframe", keyframe + 320, info.frames + 1, 8},
        {"NaN in a point", point + 16, bits(kNan), 8},
        {"NaN in an anchor", point + 24, bits(kNan), 8},
        {"variance below zero", point + 48, bits(-1e-9), 8},
        {"infinite variance", point + 72, bits(std::numeric_limits<double>::infinity()), 8},
        {"created in the future", point + 112, std::uint64_t{1} << 62U, 8},
        {"anchor before time", point + 120, ~std::uint64_t{0}, 8},
        {"seen in the future", point + 128, info.frames + 1, 8},
        {"reference that is not there", point + 136, info.keyframes + 1, 4},
        {"no reference", point + 136, 0, 4},
        {"NaN distance", point + 140, nan_float, 4},
        {"NaN angle", point + 144, nan_float, 4},
        {"level beyond the pyramid", point + 150, info.pyramid_levels, 1},
        {"suspect twice", point + 153, 2, 1},
        {"NaN derivative of a point", point + 164, nan_float, 4},
        {"NaN derivative of an anchor", point + 168, nan_float, 4},
        {"padding of a point", point + 180, 1, 4},
        {"feature outside", feature, std::bit_cast<std::uint32_t>(161.0F), 4},
        {"NaN feature", feature + 4, nan_float, 4},
        {"NaN position", feature + 8, nan_float, 4},
        {"NaN depth", feature + 16, nan_float, 4},
        {"NaN variance", feature + 20, nan_float, 4},
        {"level of a feature", feature + 28, info.pyramid_levels, 1},
        {"looks of a feature", feature + 29, 0, 1},
        {"padding of a feature", feature + 30, 1, 2},
        {"NaN position across", feature + 12, nan_float, 4},
        {"NaN angle of a feature", feature + 24, nan_float, 4},
        {"another size of the header", 12, 95, 4},
        {"features that are no keyframe's", keyframe + 300, test::number_at(file, keyframe + 300, 4) - 1, 4},
        {"link to nowhere", at(Section::kLinks, linked[0]), info.points + 1, 4},
        {"one point twice in a keyframe", at(Section::kLinks, linked[1]), first_link, 4},
        {"a rotation of a depth image that is none", depth, bits(0.5), 8},
        {"NaN in its translation", depth + 72, bits(kNan), 8},
        {"far from its keyframe", depth + 88, bits(-1e7), 8},
        {"seen in the future", depth + 96, info.frames, 8},
        {"seen when the other was", depth + 96, test::number_at(file, depth - kDepthBytes + 96, 8), 8},
        {"of no keyframe", depth + 104, 0, 4},
        {"of a keyframe that is not there", depth + 104, info.keyframes + 1, 4},
        {"later twice", depth + 108, 2, 1},
        {"padding of a depth image", depth + 109, 1, 1},
        {"NaN ray", ray, nan_float, 4},
        {"ray to the side", ray + 4, std::bit_cast<std::uint32_t>(-2e4F), 4},
    };
    for (const auto& edit : edits) {
        Bytes bad = file;
        test::put(bad, edit.at, edit.value, edit.bytes);
        ASSERT_FALSE(bad == file) << edit.what;
        test::mend(bad);
        EXPECT_EQ(fault_of(bad), MapFault::kImpossible) << edit.what;
    }
    // Depth images of another picture, turned by a right angle: all sizes fit.
    Bytes turned = file;
    test::put(turned, 88, info.depth_rows, 2);
    test::put(turned, 90, info.depth_columns, 2);
    test::put(turned, at(Section::kCells, 0) - 12, std::uint64_t{info.depth_images} * info.depth_columns, 4);
    test::mend(turned);
    EXPECT_EQ(fault_of(turned), MapFault::kImpossible);
}

// Promise: a header has depth images from the first to the last that there can be, of one cell to the most, or none of
// no cells; its time and frames end where the format says, and the version says whether there are images.
TEST_F(Damage, HeadersUpToTheirLimits) {
    const Bytes header(file.begin(), file.begin() + kMapHeaderBytes);
    const auto is_read = [](Bytes bytes, const MapFileInfo& info, std::uint32_t version) {
        test::put(bytes, 8, version, 4);
        test::put(bytes, 16, file_bytes(info), 8);
        test::put(bytes, 56, static_cast<std::uint64_t>(info.time_ns), 8);
        test::put(bytes, 64, info.frames, 8);
        test::put(bytes, 84, info.depth_images, 4);
        test::put(bytes, 88, info.depth_columns, 2);
        test::put(bytes, 90, info.depth_rows, 2);
        test::mend(bytes);
        MapFileInfo read;
        MapFileProblem problem;
        return read_map_header(bytes, read, problem) == Status::kOk;
    };
    MapFileInfo info = test::info_of(file);
    for (info.depth_images = 0; info.depth_images < 1026; info.depth_images += info.depth_images == 2 ? 1021 : 1) {
        for (const std::uint32_t columns : {0U, 1U, 2U, 79U, 80U, 81U}) {
            for (const std::uint32_t rows : {0U, 1U, 2U, 59U, 60U, 61U}) {
                info.depth_columns = static_cast<std::uint16_t>(columns);
                info.depth_rows = static_cast<std::uint16_t>(rows);
                const bool has_size = columns >= 1 && columns <= 80 && rows >= 1 && rows <= 60;
                const bool has_none = columns == 0 && rows == 0;
                const bool is_possible = info.depth_images <= 1024 && (info.depth_images == 0 ? has_none : has_size);
                EXPECT_EQ(is_read(header, info, info.version()), is_possible) << columns << "x" << rows;
                EXPECT_FALSE(is_read(header, info, info.depth_images == 0 ? kMapVersionWithDepth : kMapVersion));
            }
        }
    }
    info = test::info_of(file);
    const std::uint64_t frames = info.frames;
    for (const std::int64_t beyond : {-1, 0, 1}) {
        info.time_ns = map_checks::kTimeMax_ns + beyond;
        EXPECT_EQ(is_read(header, info, info.version()), beyond <= 0);
        info.time_ns = beyond;
        EXPECT_EQ(is_read(header, info, info.version()), beyond >= 0);
        info.time_ns = 0;
        info.frames = map_checks::kFramesMax + static_cast<std::uint64_t>(beyond);
        EXPECT_EQ(is_read(header, info, info.version()), beyond <= 0);
        info.frames = frames;
    }
}

// Promise: records each of which can be, but not together, are refused: a keyframe that shows a point twice, a
// reference that does not show its point, points with a reference that nobody shows.
TEST_F(Damage, RecordsThatContradictEachOther) {
    const MapFileInfo info = test::info_of(file);
    std::uint32_t linked = 0;
    while (test::number_at(file, at(Section::kLinks, linked), 4) == 0) ++linked;
    const std::uint64_t first_link = test::number_at(file, at(Section::kLinks, linked), 4);
    // A feature that showed nothing shows what another one of its keyframe shows; all else is as it was.
    std::uint32_t unlinked = linked + 1;
    while (test::number_at(file, at(Section::kLinks, unlinked), 4) != 0) ++unlinked;
    ASSERT_LT(unlinked, test::number_at(file, at(Section::kKeyframes, 0) + 300, 4)) << "of the first keyframe";
    Bytes twice = file;
    test::put(twice, at(Section::kLinks, unlinked), first_link, 4);
    test::mend(twice);
    Status status = Status::kOk;
    EXPECT_STREQ(refused(twice, status).part, "a keyframe that shows a point twice");
    // A keyframe that is there, but does not show the point.
    Bytes elsewhere = file;
    const std::uint32_t lone = point_seen_once();
    const std::uint32_t other = links_to(lone).begin()->first == 1 ? 2U : 1U;
    test::put(elsewhere, at(Section::kPoints, lone) + 136, other, 4);
    test::mend(elsewhere);
    EXPECT_EQ(fault_of(elsewhere), MapFault::kImpossible);
    // Unlinking everything leaves points with a reference that does not observe them.
    Bytes bad = file;
    for (std::uint32_t i = 0; i < info.features; ++i) test::put(bad, at(Section::kLinks, i), 0, 4);
    test::mend(bad);
    EXPECT_EQ(fault_of(bad), MapFault::kImpossible);
}

// Promise: a map of nothing is refused, though all of its checksums are right: nobody could be found in it.
TEST_F(Damage, NoKeyframes) {
    MapFileInfo none = test::info_of(file);
    none.keyframes = none.points = none.features = none.features_of_keyframe = 0;
    none.depth_images = none.depth_columns = none.depth_rows = 0;
    Bytes empty(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(at(Section::kCamera, 0) + kCameraBytes + 4));
    for (const std::size_t count : {24U, 28U, 32U, 36U, 84U, 88U}) test::put(empty, count, 0, 4);
    test::put(empty, 8, none.version(), 4);
    test::put(empty, 16, file_bytes(none), 8);
    for (std::uint32_t s = 1; s < sections_of(none); ++s) {
        for (const char letter : kTags[s]) empty.push_back(static_cast<std::byte>(letter));
        empty.insert(empty.end(), 16, std::byte{0});  // none, of no size, and its checksum
    }
    ASSERT_EQ(empty.size(), file_bytes(none));
    test::mend(empty);
    Status status = Status::kOk;
    const MapFileProblem problem = refused(empty, status);
    EXPECT_EQ(problem.fault, MapFault::kImpossible);
    EXPECT_STREQ(problem.part, "a map without keyframes");
}

// Promise: a point that nobody shows any more and that has no reference may be in a map, as the page of the format
// says; it is read as such.
TEST_F(Damage, APointThatNobodyShowsIsNone) {
    const std::uint32_t point = point_seen_once();
    Bytes forgotten = file;
    test::put(forgotten, links_to(point).begin()->second, 0, 4);
    test::put(forgotten, at(Section::kPoints, point) + 136, 0, 4);
    test::mend(forgotten);
    EngineRig other(small(), sequence().camera);
    MapFileProblem problem;
    ASSERT_EQ(other->load_map(forgotten, MapUse::kContinue, problem), Status::kOk) << problem.part;
    const Map& map = test::map_of(*other);
    EXPECT_EQ(map.points().size(), test::info_of(file).points);
    EXPECT_EQ(test::find_fault(map), nullptr);
    EXPECT_EQ(map.points().at(point).observers, 0U);
    EXPECT_TRUE(test::saved(*other, small()).size() == file.size());
}

}  // namespace
}  // namespace stillmesh::damage_test
