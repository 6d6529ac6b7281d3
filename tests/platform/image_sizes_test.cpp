// Images of any size through the program: the limits follow, or what was given is named; halved on purpose; lens files
// without depth units.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "tests/replay/recording_folder.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh::image_sizes_test {
namespace {

using test::Answer;
using test::stillmesh_says;

// One frame without a room in it: enough to be opened and looked at.
[[nodiscard]] std::string folder_of(const test::TemporaryFolder& folder, std::uint32_t width, std::uint32_t height) {
    test::write_colour(folder.path() + "/rgb/0.png", width, height, false, 0);
    test::write_depth(folder.path() + "/depth/0.png", width, height, 0);
    test::write_text(folder.path() + "/rgb.txt", "1.0 rgb/0.png\n");
    test::write_text(folder.path() + "/depth.txt", "1.0 depth/0.png\n");
    const std::string focal = std::to_string(width);
    test::write_text(folder.path() + "/camera.json",
                     "{\"fx\": " + focal + ", \"fy\": " + focal + ", \"ppx\": " + std::to_string(width / 2) +
                         ", \"ppy\": " + std::to_string(height / 2) + ", \"depth_scale\": 0.001}");
    return folder.path();
}

// Promise: every size from 160x120 to 1920x1080 is tracked without a --set, and larger ones are said with their block
// before anything is tracked; limits that were given stand, and the sentence names them and both ways out.
TEST(ImageSizes, TheLimitsFollow) {
    struct Size {
        std::uint32_t width, height;
        bool is_larger;
    };
    for (const Size& size :
         {Size{160, 120, false}, {640, 480, false}, {848, 480, true}, {1280, 720, true}, {1920, 1080, true}}) {
        const test::TemporaryFolder folder;
        const std::string replay = "run --replay " + folder_of(folder, size.width, size.height);
        const Answer whole = stillmesh_says(replay);
        EXPECT_NE(whole.code, 2) << whole.text;
        EXPECT_EQ(whole.says("the limits follow, and the engine's block is "), size.is_larger) << whole.text;
        const Answer half = stillmesh_says(replay + " --half --json");
        EXPECT_NE(half.code, 2) << half.text;
        EXPECT_EQ(half.says("the limits follow"), size.width > 1280) << half.text;
        const Answer given = stillmesh_says(replay + " --set limits.image_width_max=640");
        EXPECT_EQ(given.code == 2, size.is_larger) << given.text;
        EXPECT_EQ(given.says("leave these out, or give --set limits.image_width_max=" + std::to_string(size.width)),
                  size.is_larger)
            << given.text;
    }
    const test::TemporaryFolder folder;
    const std::string replay = "run --replay " + folder_of(folder, 2560, 1440);
    const Answer whole = stillmesh_says(replay);
    EXPECT_EQ(whole.code, 2);
    EXPECT_TRUE(whole.says("the images are 2560x1440 pixels, at most 2047x2047 are tracked; halve them with --half."));
    EXPECT_NE(stillmesh_says(replay + " --half").code, 2);
}

// Promise: a room tracked at half its size is the same path, and the run is repeated bit for bit with the same switch;
// a lens file without depth units is asked for them, and --depth-units also stands above those of a file.
TEST(ImageSizes, HalvedOnPurpose) {
    const test::TemporaryFolder folder;
    const std::string room = folder.path() + "/room";
    ASSERT_EQ(stillmesh_says("simulate static_xyz --seed 3 --frames 15 --out " + room).code, 0);
    const std::string recording = folder.path() + "/run.rec";
    const Answer half = stillmesh_says("run --replay " + room + " --half --record " + recording);
    EXPECT_EQ(half.code, 0) << half.text;
    EXPECT_TRUE(half.says("100.0 % tracked")) << half.text;
    EXPECT_TRUE(half.says("ATE           0.000") || half.says("ATE           0.001")) << half.text;
    const Answer again = stillmesh_says("rerun " + recording + " --half --replay " + room);
    EXPECT_EQ(again.code, 0) << again.text;
    const Answer otherwise = stillmesh_says("rerun " + recording + " --replay " + room);
    EXPECT_EQ(otherwise.code, 2) << otherwise.text;

    const std::string lens = folder.path() + "/calibration.txt";
    test::write_text(lens, "528.0 528.0 319.5 239.5\n");
    const std::string replay = "run --replay " + room + " --calibration " + lens;
    const Answer asked = stillmesh_says(replay);
    EXPECT_EQ(asked.code, 2);
    EXPECT_TRUE(asked.says("does not say how many depth units make a metre; give --depth-units N")) << asked.text;
    const Answer given = stillmesh_says(replay + " --depth-units 5000");
    EXPECT_EQ(given.code, 0) << given.text;
    EXPECT_TRUE(given.says("ATE           0.000") || given.says("ATE           0.001")) << given.text;
    const Answer other = stillmesh_says("run --replay " + room + " --depth-units 1000");
    EXPECT_TRUE(other.says("scale")) << "above the file's: " << other.text;
}

}  // namespace
}  // namespace stillmesh::image_sizes_test
