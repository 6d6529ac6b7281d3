// Grids as a user meets them: switches, sentences, exit codes, and what is on the disk afterwards.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/support/answer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh {
namespace {

using test::Answer;
using test::stillmesh_says;
using test::TemporaryFolder;

std::string text_of(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// Promise: a run leaves a grid and a level cloud that agree with its summary; the picture is as large as it says.
TEST(GridProgram, LeavesGridAndCloud) {
    const TemporaryFolder folder;
    const std::string name = folder.path("office"), cloud = folder.path("office.ply");
    const Answer answer = stillmesh_says("run --simulate static_halfsphere:1 --frames 40 --grid " + name + " --cloud " +
                                         cloud + " --level floor");
    EXPECT_EQ(answer.code, 0) << answer.text;
    EXPECT_NE(answer.text.find("grid          " + name + ".yaml: "), std::string::npos) << answer.text;
    EXPECT_NE(answer.text.find("office.ply, level"), std::string::npos) << answer.text;
    const std::string yaml = text_of(name + ".yaml"), pgm = text_of(name + ".pgm"), ply = text_of(cloud);
    EXPECT_EQ(yaml.substr(0, 20), "image: \"office.pgm\"\n");
    unsigned width = 0, height = 0;
    ASSERT_EQ(std::sscanf(pgm.c_str(), "P5\n%u %u\n255\n", &width, &height), 2);
    const std::size_t head = pgm.find("\n255\n") + 5;
    EXPECT_EQ(pgm.size(), head + std::size_t{width} * height);
    EXPECT_NE(answer.text.find(std::to_string(width) + "x" + std::to_string(height) + " cells"), std::string::npos);
    unsigned points = 0;
    ASSERT_EQ(std::sscanf(ply.c_str() + ply.find("element vertex"), "element vertex %u", &points), 1);
    EXPECT_GT(points, 4000U);
    EXPECT_EQ(ply.size(), ply.find("end_header\n") + 11 + std::size_t{12} * points);
}

// Promise: while the run goes on the grid is written as often as --map-every says.
TEST(GridProgram, IsWrittenWhileTheRunGoesOn) {
    const TemporaryFolder folder;
    const std::string name = folder.path("office");
    const Answer answer =
        stillmesh_says("run --simulate static_halfsphere:1 --frames 60 --map-every 0.1 --grid " + name);
    EXPECT_EQ(answer.code, 0) << answer.text;
    EXPECT_TRUE(std::filesystem::exists(name + ".yaml"));
    EXPECT_FALSE(std::filesystem::exists(name + ".pgm.part"));
}

// Promise: a map that was saved has its grid and its cloud: `map export` makes of the file what the run that saved it
// made, and a run that goes on in it has them from the start. A map without depth images is refused with a sentence,
// and nothing is written.
TEST(GridProgram, ComesOutOfAMap) {
    const TemporaryFolder folder;
    const std::string map = folder.path("office.map"), run = folder.path("run"), out = folder.path("out");
    const std::string simulate = "run --simulate static_halfsphere:1 --frames ";
    const Answer made =
        stillmesh_says(simulate + "60 --map-out " + map + " --grid " + run + " --cloud " + run + ".ply --level floor");
    ASSERT_EQ(made.code, 0) << made.text;
    const Answer exported = stillmesh_says("map export " + map + " --grid " + out + " --cloud " + out +
                                           ".ply --level floor --tum " + out + ".txt");
    ASSERT_EQ(exported.code, 0) << exported.text;
    EXPECT_GT(text_of(out + ".txt").size(), 100U);
    // The last bit of a pose may differ, and with it a cell that a surface just reaches.
    const std::string wanted = text_of(run + ".pgm"), pgm = text_of(out + ".pgm");
    ASSERT_EQ(pgm.size(), wanted.size());
    ASSERT_GT(pgm.size(), 2000U);
    std::size_t differing = 0;
    for (std::size_t i = 0; i < pgm.size(); ++i) differing += pgm[i] != wanted[i] ? 1U : 0U;
    EXPECT_LE(differing, pgm.size() / 1000);
    EXPECT_EQ(text_of(out + ".yaml").substr(0, 18), "image: \"out.pgm\"\nm");
    const auto points_of = [](const std::string& file) {
        const std::string ply = text_of(file);
        return std::strtoul(ply.c_str() + ply.find("element vertex ") + 15, nullptr, 10);
    };
    EXPECT_GT(points_of(out + ".ply"), 4000U);
    EXPECT_NEAR(static_cast<double>(points_of(out + ".ply")), static_cast<double>(points_of(run + ".ply")), 20);

    // Too short for a look of its own.
    const Answer again = stillmesh_says(simulate + "8 --map-in " + map + " --grid " + folder.path("again"));
    EXPECT_NE(again.text.find("again.yaml: "), std::string::npos) << again.text;
    EXPECT_GE(text_of(folder.path("again.pgm")).size(), pgm.size());

    const std::string bare = folder.path("bare.map");
    ASSERT_EQ(stillmesh_says(simulate + "40 --set limits.depth_images_max=0 --map-out " + bare).code, 0);
    const Answer none =
        stillmesh_says("map export " + bare + " --ply " + folder.path("n.ply") + " --grid " + folder.path("none"));
    EXPECT_EQ(none.code, 2) << none.text;
    EXPECT_NE(none.text.find("bare.map: holds no depth images"), std::string::npos) << none.text;
    EXPECT_EQ(stillmesh_says("map export " + bare + " --octomap " + folder.path("none.bt")).code, 2);
    EXPECT_FALSE(std::filesystem::exists(folder.path("none.yaml")));
    EXPECT_FALSE(std::filesystem::exists(folder.path("n.ply")));
    EXPECT_EQ(stillmesh_says("map export " + map + " --grid " + out + " --robot-height .2 --obstacle-height .5").code,
              2);
}

// Promise: what cannot be is refused before a frame is tracked, with the option and what helps.
TEST(GridProgram, RefusesWhatCannotBe) {
    const TemporaryFolder folder;
    const std::string run = "run --simulate static_xyz:1 --frames 4 --grid ";
    const struct {
        std::string arguments, says;
    } cases[] = {
        {run + folder.path("none/office"), "--grid " + folder.path("none/office.yaml") + ": the folder"},
        {run + folder.path("a") + " --limits pocket", "limits.depth_images_max=40"},
        {run + folder.path("a") + " --robot-height 0.5 --obstacle-height 0.6", "--robot-height 0.5"},
        {run + folder.path("a") + " --map-out " + folder.path("a.pgm"), "name one place"},
        {"run --simulate static_xyz:1 --frames 4 --map-every 1", "--grid NAME"},
    };
    for (const auto& c : cases) {
        const Answer answer = stillmesh_says(c.arguments);
        EXPECT_EQ(answer.code, 2) << c.arguments;
        EXPECT_NE(answer.text.find(c.says), std::string::npos) << answer.text;
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder.path(".")));
}

// Promise: without a floor there is no grid, and a sentence says why; the cloud is there all the same.
TEST(GridProgram, WithoutAFloorItSaysSo) {
    const TemporaryFolder folder;
    const std::string name = folder.path("office"), cloud = folder.path("office.ply");
    const Answer answer = stillmesh_says(
        "run --simulate static_halfsphere:1 --frames 45 --set depth.z_max_m=1.2 --grid " + name + " --cloud " + cloud);
    EXPECT_EQ(answer.code, 1) << answer.text;
    EXPECT_NE(answer.text.find("--grid " + name + ": was not written: no floor was seen for certain"),
              std::string::npos)
        << answer.text;
    EXPECT_FALSE(std::filesystem::exists(name + ".pgm"));
    EXPECT_TRUE(std::filesystem::exists(cloud));
}

}  // namespace
}  // namespace stillmesh
