// The robot's own arm in the picture: it stands still before a camera that moves, which is the paper's assumption
// turned round.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/record/png_file.hpp"
#include "tests/replay/recording_folder.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh::mask_test {
namespace {

using test::stillmesh_says;
using test::TemporaryFolder;
using test::write_text;

constexpr std::uint32_t kWidth = 640, kHeight = 480;

// A textured arm, half a metre away, that leaves a border of the room above and at the sides.
[[nodiscard]] bool is_arm(std::uint32_t x, std::uint32_t y) {
    return y > 50 && x > 40 && x < 600;
}

// A simulated room with the arm before it, as a recording, and the arm's mask.
void record_with_arm(const TemporaryFolder& folder) {
    SimulatedCamera camera({.scene = "static_xyz", .seed = 2, .frames = 60, .width = kWidth, .height = kHeight});
    ASSERT_EQ(camera.open(), Status::kOk);
    std::filesystem::create_directories(folder.path() + "/rgb");
    std::filesystem::create_directories(folder.path() + "/depth");
    std::mt19937 random(3);
    std::vector<std::uint8_t> paint(kWidth * kHeight), mask(kWidth * kHeight);
    for (std::uint32_t y = 0; y < kHeight; y += 12) {
        for (std::uint32_t x = 0; x < kWidth; x += 12) {
            const auto shade = static_cast<std::uint8_t>(random() % 256);
            for (std::uint32_t i = 0; i < 144; ++i)
                paint[(y + i / 12) * kWidth + std::min(x + i % 12, kWidth - 1)] = shade;
        }
    }
    std::string rgb, depth, truth;
    Frame frame;
    while (camera.poll(frame) == Status::kOk) {
        std::vector<std::uint8_t> colour(frame.colour.data, frame.colour.data + kWidth * kHeight);
        std::vector<std::uint16_t> distance(frame.depth.data, frame.depth.data + kWidth * kHeight);
        for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) {
            if (!is_arm(i % kWidth, i / kWidth)) continue;
            colour[i] = paint[i];
            distance[i] = static_cast<std::uint16_t>(2600 + i / kWidth);
            mask[i] = 255;
        }
        const std::string time = time_text(frame.time_ns);
        const std::string colour_file = "rgb/" + time + ".png", depth_file = "depth/" + time + ".png";
        ASSERT_EQ(write_png_file(folder.path(colour_file), colour.data(), kWidth, kHeight, PngPixels::kGrey8), "");
        ASSERT_EQ(write_png_file(folder.path(depth_file), distance.data(), kWidth, kHeight, PngPixels::kGrey16), "");
        rgb += time + " " + colour_file + "\n";
        depth += time + " " + depth_file + "\n";
        truth += pose_line({frame.time_ns, camera.true_pose().t, camera.true_pose().q});
    }
    write_text(folder.path("rgb.txt"), rgb);
    write_text(folder.path("depth.txt"), depth);
    write_text(folder.path("groundtruth.txt"), truth);
    const CameraModel& m = camera.info().model;
    write_text(folder.path("camera.toml"), "width = 640\nheight = 480\nfx = " + std::to_string(m.fx) +
                                               "\nfy = " + std::to_string(m.fy) +
                                               "\ncx = 319.5\ncy = 239.5\ndepth_units_per_m = 5000\n");
    ASSERT_EQ(write_png_file(folder.path("arm.png"), mask.data(), kWidth, kHeight, PngPixels::kGrey8), "");
}

[[nodiscard]] double error_of(const test::Answer& answer) {
    const std::size_t begin = answer.text.find('{'), end = answer.text.rfind("\n}");
    if (begin == std::string::npos || end == std::string::npos) return -1;
    const auto json = nlohmann::json::parse(answer.text.substr(begin, end + 2 - begin), nullptr, false);
    return json.contains("evaluation") && json["evaluation"].is_object() ? json["evaluation"].value("ate_rmse_m", -1.0)
                                                                         : -1;
}

// Promise: an arm that covers four fifths of the picture and never moves in it captures the camera, and with its mask
// it does not: the error is that of the room. The run can be repeated to the bit with the same mask, and is not itself
// without; at half the size the mask is halved with the images.
TEST(Mask, TheRobotsOwnArm) {
    const TemporaryFolder folder;
    record_with_arm(folder);
    if (HasFatalFailure()) return;
    const std::string run = "run --vocabulary none --no-check-camera --json --replay " + folder.path();
    const std::string mask = " --mask " + folder.path("arm.png");
    const test::Answer captured = stillmesh_says(run);
    const test::Answer masked = stillmesh_says(run + mask + " --record " + folder.path("run.rec"));
    EXPECT_GT(error_of(captured), 0.05) << captured.text;
    EXPECT_LT(error_of(masked), 0.01) << masked.text;
    EXPECT_GE(error_of(masked), 0) << masked.text;
    EXPECT_TRUE(masked.says("of the picture are masked")) << masked.text;
    const std::string again = "rerun " + folder.path("run.rec") + " --replay " + folder.path();
    EXPECT_EQ(stillmesh_says(again + mask).code, 0);
    EXPECT_NE(stillmesh_says(again).code, 0);
    const test::Answer half = stillmesh_says(run + mask + " --half");
    EXPECT_TRUE(half.says("of the picture are masked")) << half.text;
    EXPECT_NE(half.code, 2) << half.text;
}

// Promise: a mask that cannot be meant is refused before anything starts, with its size, or with what to do.
TEST(Mask, WrongOnesAreRefused) {
    const TemporaryFolder folder;
    test::write_recording(folder.path());
    const std::string run = "run --limits pocket --vocabulary none --replay " + folder.path() + " --mask ";
    const std::vector<std::uint8_t> white(64 * 48, 255);
    ASSERT_EQ(write_png_file(folder.path("white.png"), white.data(), 64, 48, PngPixels::kGrey8), "");
    ASSERT_EQ(write_png_file(folder.path("small.png"), white.data(), 32, 24, PngPixels::kGrey8), "");
    const auto refused = [&](const std::string& file, const char* words) {
        const test::Answer answer = stillmesh_says(run + file);
        EXPECT_EQ(answer.code, 2) << answer.text;
        EXPECT_TRUE(answer.says(words)) << answer.text;
    };
    refused(folder.path("white.png"), "100 % of it are white");
    refused(folder.path("small.png"), "is 32x24, the images are 64x48");
    refused(folder.path("none.png"), "none.png: ");
    refused(folder.path("depth/0.png"), "16-bit grey");
    refused(folder.path("rgb.txt"), "rgb.txt: ");
}

// Promise: a folder mask/ in a recording is taken, or another that is named, with a PNG for each colour image; the run
// is another one then, and repeats to the bit with the same masks alone. `none`, and a folder without any picture's
// name, are told apart.
TEST(Mask, OneForEachPicture) {
    const TemporaryFolder folder;
    ASSERT_EQ(stillmesh_says("simulate walking_xyz --seed 3 --frames 12 --out " + folder.path("run")).code, 0);
    const std::string vocabulary = " --vocabulary none";
    const std::string replay = " --replay " + folder.path("run");
    const std::string run = "run --no-check-camera" + vocabulary + replay;
    const std::string masks = " --mask " + folder.path("run/masks");
    const std::string rerun = "rerun " + folder.path("run.rec") + replay;
    const test::Answer masked = stillmesh_says(run + masks + " --record " + folder.path("run.rec"));
    EXPECT_TRUE(masked.says("12 of 12 frames have a mask")) << masked.text;
    EXPECT_EQ(stillmesh_says(rerun + masks).code, 0);
    EXPECT_NE(stillmesh_says(rerun).code, 0);  // no folder mask/ yet
    std::filesystem::rename(folder.path("run/masks"), folder.path("run/mask"));
    EXPECT_EQ(stillmesh_says(rerun).code, 0);
    EXPECT_NE(stillmesh_says(rerun + " --mask none").code, 0);
    std::filesystem::create_directory(folder.path("empty"));
    const test::Answer empty = stillmesh_says(run + " --mask " + folder.path("empty"));
    EXPECT_EQ(empty.code, 2);
    EXPECT_TRUE(empty.says("holds no PNG named as a colour image is")) << empty.text;
    EXPECT_EQ(stillmesh_says("run --simulate static_xyz --frames 2 --mask " + folder.path("empty")).code, 2);
}

}  // namespace
}  // namespace stillmesh::mask_test
