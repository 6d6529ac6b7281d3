// The page about the format, against the bytes.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include "engine/record/map_copy.hpp"
#include "engine/record/map_load.hpp"
#include "tests/persist/map_rig.hpp"

namespace stillmesh::spec_test {
namespace {

using test::Bytes;

// The bytes of the dump in the first code block behind a heading.
Bytes dump_behind(const std::string& page, const std::string& heading) {
    const std::size_t from = page.find("```\n", page.find(heading)) + 4;
    std::istringstream lines(page.substr(from, page.find("```", from) - from));
    Bytes out;
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string word;
        words >> word;  // the offset
        while (words >> word) out.push_back(static_cast<std::byte>(std::stoul(word, nullptr, 16)));
    }
    return out;
}
std::string dump_of(const Bytes& bytes) {
    std::string out;
    char word[32];
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        if (i % 16 == 0) {
            std::snprintf(word, sizeof(word), "%s%04zx ", i == 0 ? "" : "\n", i);
            out += word;
        }
        std::snprintf(word, sizeof(word), " %02x", std::to_integer<unsigned>(bytes[i]));
        out += word;
    }
    return out + "\n";
}

// One keyframe, one feature, one point; every number different.
Bytes example() {
    const Limits limits = Limits::tiny();
    test::InMemory<Map> map(limits);
    const Handle<Keyframe> handle = map->add_keyframe();
    Keyframe& keyframe = *map->keyframes().find(handle);
    keyframe.world_from_camera.translation = Vector3(1, 2, 3);
    keyframe.frame = 4;
    keyframe.last_useful_frame = 5;
    keyframe.time_ns = 6;
    const Handle<MapPoint> taken = map->add_point().value();
    MapPoint& point = *map->points().find(taken);
    point.world[2] = 7;
    point.descriptor.words[0] = 0x0807060504030201;
    Observation observation;
    observation.point = taken;
    observation.x = 9;
    map->add_observation(handle, observation, point.descriptor);
    MapOrigin origin;
    origin.camera.width = 160;
    origin.camera.height = 120;
    origin.camera.fx = origin.camera.fy = 100;
    origin.pyramid_levels = 3;
    origin.scale_factor = 1.5;
    test::CopySpace space(limits);
    MapCopy copy;
    EXPECT_EQ(copy.begin(space.span(), limits, origin), Status::kOk);
    WorkBudget budget(1'000'000);
    EXPECT_EQ(copy.step(*map, {}, {10, 11}, budget), Progress::kDone);
    return space.file();
}

// Promise: what the page shows is what is written, and every section is where and as long as the page says.
TEST(MapSpec, TheExampleIsTrue) {
    std::ifstream stream(STILLMESH_SPEC);
    const std::string page{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    Bytes file = example();
    EXPECT_EQ(file.size(), 96U + 5 * 20 + 88 + 328 + 184 + 64 + 4);
    std::size_t at = 96;
    for (const char* const tag : {"CAMR", "KEYF", "PNTS", "FEAT", "LINK"}) {
        for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(static_cast<char>(file[at + i]), tag[i]) << tag;
        EXPECT_EQ(test::number_at(file, at + 4, 4), 1U) << tag;
        at += 20 + static_cast<std::size_t>(test::number_at(file, at + 8, 8));
    }
    EXPECT_EQ(at, file.size());
    file.resize(128);
    EXPECT_TRUE(dump_behind(page, "### Example: the begin of a map") == file) << dump_of(file);
}

// Promise: what changes between the copying of features and the instant is in the copy: links that come and go, points
// and keyframes that come and go.
TEST(MapCopy, LateChangesAreInTheCopy) {
    const Limits limits = Limits::tiny();
    test::InMemory<Map> map(limits);
    const CameraModel camera;
    const auto add_keyframe = [&](std::uint64_t frame) {
        const Handle<Keyframe> handle = map->add_keyframe();
        map->keyframes().find(handle)->frame = frame;
        for (std::uint32_t i = 0; i < 4; ++i) map->add_observation(handle, Observation{});
        return handle;
    };
    const Handle<Keyframe> first = add_keyframe(1);
    const Handle<Keyframe> second = add_keyframe(2);
    const Handle<MapPoint> points[3] = {map->add_point().value(), map->add_point().value(), map->add_point().value()};
    ASSERT_TRUE(map->link(first, 0, points[0]));
    ASSERT_TRUE(map->link(first, 1, points[1]));
    ASSERT_TRUE(map->link(second, 0, points[0]));
    test::CopySpace space(limits);
    for (int change = 0; change < 6; ++change) {
        MapCopy copy;
        ASSERT_EQ(copy.begin(space.span(), limits, {}), Status::kOk);
        WorkBudget features(1);
        ASSERT_EQ(copy.step(*map, {}, {10, 10}, features), Progress::kWorking);  // the first keyframe is copied
        switch (change) {
            case 0: break;
            case 1: map->unlink(first, 1); break;
            case 2: ASSERT_TRUE(map->link(first, 2, points[2])); break;
            case 3: map->release_point(points[0]); break;
            case 4: static_cast<void>(add_keyframe(3)); break;
            case 5: map->release_keyframe(first); break;
            default: break;
        }
        WorkBudget rest(1'000'000);
        ASSERT_EQ(copy.step(*map, {}, {10, 10}, rest), Progress::kDone);
        EXPECT_EQ(test::info_of(space.file()).hash, test::map_hash(*map, camera)) << "change " << change;
    }
}

}  // namespace
}  // namespace stillmesh::spec_test
