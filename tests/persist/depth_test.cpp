// Depth images in a map file: what a grid is made of, and nothing else depends on.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/record/map_records.hpp"
#include "tests/persist/map_rig.hpp"

namespace stillmesh::depth_test {
namespace {

using test::Bytes;
using test::EngineRig;
using test::Sequence;

Limits limits_with(std::uint32_t images) {
    Limits out = Limits::tiny();
    out.depth_images_max = images;
    return out;
}

// 13 seconds, in which keyframes come and go.
const Sequence& sequence() {
    static const Sequence out = test::slowed(test::rendered("static_halfsphere", 90, 160, 120, 3));
    return out;
}

struct Seen {
    std::vector<std::uint16_t> depth_mm;
    std::vector<float> rays;
    RigidTransform map_from_camera;
    friend bool operator==(const Seen& a, const Seen& b) {
        return a.depth_mm == b.depth_mm && a.rays == b.rays &&
               std::equal(a.map_from_camera.translation_m, a.map_from_camera.translation_m + 3,
                          b.map_from_camera.translation_m) &&
               std::equal(a.map_from_camera.rotation_xyzw, a.map_from_camera.rotation_xyzw + 4,
                          b.map_from_camera.rotation_xyzw);
    }
};
// All that an engine has, by frame.
std::map<std::uint64_t, Seen> seen_by(const Engine& engine, std::uint32_t images) {
    std::map<std::uint64_t, Seen> out;
    for (std::uint32_t i = 0; i < images; ++i) {
        const DepthImage image = engine.depth_image(i);
        if (image.columns == 0) continue;
        out[image.frame] = {{image.depth_mm.begin(), image.depth_mm.end()},
                            {image.rays.begin(), image.rays.end()},
                            image.map_from_camera};
    }
    return out;
}

// Promise: images lie after a load where they lay, cell by cell; saved again they give the same bytes; and they change
// neither the map's hash nor a byte of the map before them.
TEST(MapDepth, ComesBackAsItWas) {
    EngineRig with(limits_with(8), sequence().camera), without(limits_with(0), sequence().camera);
    EngineRig other(limits_with(8), sequence().camera);
    std::uint32_t most = 0;
    for (const std::size_t frames : {20U, 45U, 90U}) {
        for (EngineRig* const engine : {&with, &without}) {
            (*engine)->reset();
            test::run(**engine, sequence(), 0, frames);
        }
        const Bytes file = test::saved(*with, limits_with(8)), bare = test::saved(*without, limits_with(0));
        const auto images = seen_by(*with, 8);
        const MapFileInfo info = test::info_of(file);
        most = std::max(most, info.depth_images);
        EXPECT_EQ(info.depth_images, images.size());
        EXPECT_EQ(test::number_at(file, 8, 4), images.empty() ? 2U : 3U);
        EXPECT_EQ(test::number_at(bare, 8, 4), 2U);
        EXPECT_EQ(info.hash, test::info_of(bare).hash);
        ASSERT_LE(bare.size(), file.size());
        EXPECT_TRUE(std::equal(bare.begin() + kMapHeaderBytes, bare.end(), file.begin() + kMapHeaderBytes));
        MapFileProblem problem;
        ASSERT_EQ(other->load_map(file, MapUse::kContinue, problem), Status::kOk) << problem.part;
        EXPECT_TRUE(seen_by(*other, 8) == images) << frames;
        EXPECT_TRUE(test::saved(*other, limits_with(8)) == file) << frames;
        // And of a map that has none, none is left of those before.
        ASSERT_EQ(other->load_map(bare, MapUse::kContinue, problem), Status::kOk) << problem.part;
        EXPECT_TRUE(seen_by(*other, 8).empty());
        EXPECT_TRUE(test::saved(*other, limits_with(8)) == bare);
    }
    EXPECT_GE(most, 5U);
}

// Promise: limits that hold fewer take the images of the keyframes' own moments rather than later ones, of each the
// newest; limits that hold none take the map without; tracking goes on alike in all of them.
TEST(MapDepth, FewerAreTakenWhereThereIsLessRoom) {
    EngineRig maker(limits_with(8), sequence().camera);
    test::run(*maker, sequence(), 0, 60);
    const Bytes file = test::saved(*maker, limits_with(8));
    const MapFileInfo info = test::info_of(file);
    ASSERT_GE(info.depth_images, 4U);
    const auto all = seen_by(*maker, 8);
    // In the order of their worth, from the records of the file.
    std::vector<std::pair<bool, std::uint64_t>> worth;
    for (std::uint32_t i = 0; i < info.depth_images; ++i) {
        const auto at = static_cast<std::size_t>(map_records::records_at(info, 5)) + std::size_t{i} * 112;
        worth.emplace_back(test::number_at(file, at + 108, 1) == 0, test::number_at(file, at + 96, 8));
    }
    std::sort(worth.rbegin(), worth.rend());
    EXPECT_NE(worth.front().first, worth.back().first) << "else the order tells little";
    std::vector<std::uint64_t> hashes;
    for (std::uint32_t room = 0; room <= info.depth_images; ++room) {
        EngineRig engine(limits_with(room), sequence().camera);
        MapFileProblem problem;
        ASSERT_EQ(engine->load_map(file, MapUse::kContinue, problem), Status::kOk) << problem.part;
        std::map<std::uint64_t, Seen> wanted;
        for (std::uint32_t i = 0; i < room; ++i) wanted[worth[i].second] = all.at(worth[i].second);
        EXPECT_TRUE(seen_by(*engine, room) == wanted) << room;
        EXPECT_EQ(test::map_hash(*engine), info.hash);
        test::run(*engine, sequence(), 60, 75);
        hashes.push_back(engine->state_hash());
    }
    EXPECT_EQ(std::count(hashes.begin(), hashes.end(), hashes.front()), static_cast<std::ptrdiff_t>(hashes.size()));
}

// Promise: a copy taken in slices of any size while images come and go has those of one instant, exactly.
TEST(MapDepth, CopyInSlicesHasTheImagesOfOneInstant) {
    const Limits limits = limits_with(5);
    EngineRig engine(limits, sequence().camera), loaded(limits, sequence().camera);
    test::CopySpace space(limits);
    Random random(3);
    std::uint32_t copies = 0, late = 0;
    for (std::size_t i = 0; i < sequence().frames.size(); ++i) {
        ASSERT_EQ(engine->submit(sequence().frames[i].frame()), Status::kOk);
        static_cast<void>(engine->step(4000));
        if (engine->step_map_copy(random.below(60)) == Progress::kWorking) continue;
        if (i > 0) {
            const Bytes file = space.file(512 + random.below(600));
            MapFileProblem problem;
            ASSERT_EQ(loaded->load_map(file, MapUse::kContinue, problem), Status::kOk) << problem.part;
            const auto images = seen_by(*engine, 5);
            EXPECT_TRUE(seen_by(*loaded, 5) == images) << i;
            ++copies;
            late += images.empty() ? 0U : 1U;
        }
        ASSERT_EQ(engine->begin_map_copy(space.span()), Status::kOk);
    }
    EXPECT_GT(copies, 8U);
    EXPECT_GT(late, 5U);
}

}  // namespace
}  // namespace stillmesh::depth_test
