// Grids as a user meets them: switches, sentences, exit codes, and what is on the disk afterwards.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "engine/geometry/rigid_transform.hpp"
#include "tests/support/answer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::grid_program_test {
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

// Promise: `map export --base-from-camera` lays the grid's origin below where the robot was at first, with the robot's
// x: read back from the line that says how a pose becomes one in the grid. A pose that is none is refused.
TEST(GridProgram, LiesAsTheRobotStood) {
    const TemporaryFolder folder;
    const std::string map = folder.path("office.map"), out = folder.path("out");
    ASSERT_EQ(stillmesh_says("run --simulate static_halfsphere:1 --frames 60 --map-out " + map).code, 0);
    const std::string maker = "map export " + map + " --grid " + out;
    // Where base_link and a metre of its x are, seen by a camera .2 m before, .1 m left of and .5 m above it: x right,
    // y down, z forward. In the second case the camera looks to the robot's left.
    const struct {
        std::string arguments;
        std::array<double, 3> origin, x;
    } cases[] = {{"", {0, 0, 0}, {0, 0, 1}},
                 {" --base-from-camera .2,.1,.5", {.1, .5, -.2}, {0, 0, 1}},
                 {" --base-from-camera .2,.1,.5,0,0,1,1", {-.2, .5, -.1}, {1, 0, 0}}};
    for (const auto& c : cases) {
        const Answer made = stillmesh_says(maker + c.arguments);
        ASSERT_EQ(made.code, 0) << made.text;
        const std::string yaml = text_of(out + ".yaml");
        const std::size_t line = yaml.find("a pose in this grid: ");
        ASSERT_NE(line, std::string::npos) << yaml;
        RigidTransform level;
        auto& t = level.translation_m;
        auto& q = level.rotation_xyzw;
        ASSERT_EQ(std::sscanf(yaml.c_str() + line, "a pose in this grid: %lf %lf %lf %lf %lf %lf %lf", &t[0], &t[1],
                              &t[2], &q[0], &q[1], &q[2], &q[3]),
                  7);
        const std::array<double, 3> origin = transformed(level, c.origin), x = rotated(level, c.x);
        EXPECT_NEAR(origin[0], 0, 1e-5) << c.arguments;
        EXPECT_NEAR(origin[1], 0, 1e-5) << c.arguments;
        EXPECT_GT(x[0], 0.7) << c.arguments;
        EXPECT_NEAR(x[1], 0, 1e-5) << c.arguments;
    }
    const Answer none = stillmesh_says(maker + " --base-from-camera 1,2");
    EXPECT_EQ(none.code, 2);
    EXPECT_NE(none.text.find("give x,y,z (m) or x,y,z,qx,qy,qz,qw"), std::string::npos) << none.text;
    const Answer alone = stillmesh_says("map export " + map + " --tum " + out + ".txt --base-from-camera 0,0,1");
    EXPECT_EQ(alone.code, 2);
    EXPECT_FALSE(std::filesystem::exists(out + ".txt"));
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

// Where up is in the map of a simulated recording: seen from its first camera, whose pose in a world with z up is
// known.
std::array<double, 3> true_up(const std::string& truth_file) {
    std::ifstream stream(truth_file);
    std::string line;
    while (std::getline(stream, line) && line.starts_with('#')) {
    }
    double x = 0, y = 0, z = 0, w = 1;
    EXPECT_EQ(std::sscanf(line.c_str(), "%*f %*f %*f %*f %lf %lf %lf %lf", &x, &y, &z, &w), 4);
    return {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)};
}

// Promise: by a simulated accelerometer of half a tenth of a m/s^2 bias, up is right to a degree in the map of a
// rendered recording, the cloud is level with the floor at 0; too short a run says that up is unknown, and why, and
// leaves the cloud as the map lies; without an accelerometer nothing is begun.
TEST(GridProgram, LevelByGravity) {
    const TemporaryFolder folder;
    const std::string recording = folder.path("hand"), cloud = folder.path("hand.ply");
    ASSERT_EQ(stillmesh_says("simulate static_xyz --seed 1 --frames 130 --width 320 --motion --out " + recording).code,
              0);
    const std::string run = "run --replay " + recording + " --cloud " + cloud + " --level gravity";
    const Answer answer = stillmesh_says(run);
    EXPECT_EQ(answer.code, 0) << answer.text;
    EXPECT_NE(answer.text.find("hand.ply, level"), std::string::npos) << answer.text;
    std::array<double, 3> up{};
    const std::size_t line = answer.text.find("gravity       up is ");
    ASSERT_NE(line, std::string::npos) << answer.text;
    ASSERT_EQ(std::sscanf(answer.text.c_str() + line, "gravity up is %lf %lf %lf in", &up[0], &up[1], &up[2]), 3);
    const std::array<double, 3> truth = true_up(recording + "/groundtruth.txt");
    const double cosine = up[0] * truth[0] + up[1] * truth[1] + up[2] * truth[2];
    EXPECT_GT(cosine, 0.99985) << answer.text;  // a degree, less what the printed digits leave
    // The floor: many points lie at z = 0 and none to speak of lower down.
    const std::string ply = text_of(cloud);
    std::size_t floor = 0, below = 0, all = 0;
    for (std::size_t at = ply.find("end_header\n") + 11; at + 12 <= ply.size(); at += 12, ++all) {
        float z = 0;
        std::memcpy(&z, ply.data() + at + 8, sizeof(z));
        floor += std::abs(z) < 0.08F ? 1U : 0U;
        below += z < -0.15F ? 1U : 0U;
    }
    EXPECT_GT(floor, all / 20) << all;
    EXPECT_LT(below, all / 50) << all;

    const Answer brief = stillmesh_says(run + " --frames 60");
    EXPECT_EQ(brief.code, 1) << brief.text;
    EXPECT_NE(brief.text.find("gravity       unknown: "), std::string::npos) << brief.text;
    EXPECT_NE(brief.text.find("--cloud " + cloud + ": is not level"), std::string::npos) << brief.text;
    EXPECT_TRUE(std::filesystem::remove(recording + "/accelerometer.txt"));
    const Answer without = stillmesh_says(run);
    EXPECT_EQ(without.code, 2) << without.text;
    EXPECT_NE(without.text.find("--accelerometer FILE"), std::string::npos) << without.text;
}

// Promise: an accelerometer that nothing asks for is refused at once, whatever the camera; none is waited for.
TEST(GridProgram, AnAccelerometerIsOfLevelGravity) {
    for (const std::string camera : {"--replay nowhere", "--simulate static_xyz", "--camera ros2 --wait"}) {
        const Answer answer = stillmesh_says("run " + camera + " --accelerometer ros2");
        EXPECT_EQ(answer.code, 2) << camera;
        EXPECT_NE(answer.text.find("--accelerometer: says where up is"), std::string::npos) << answer.text;
    }
}

}  // namespace
}  // namespace stillmesh::grid_program_test
