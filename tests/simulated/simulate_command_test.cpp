#include "platform/cli/simulate_command.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/trajectory.hpp"

namespace stillmesh::simulate_command_test {
namespace {

class SimulateCommand : public ::testing::Test {
protected:
    void SetUp() override {
        const auto* const info = ::testing::UnitTest::GetInstance()->current_test_info();
        folder_ = std::filesystem::temp_directory_path() /
                  ("stillmesh_" + std::string(info->name()) + std::to_string(::getpid()));
        std::filesystem::remove_all(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::filesystem::path folder_;
};

// Promise: the folder replays to the very bytes, times and intrinsics of the simulated camera, with its truth.
TEST_F(SimulateCommand, WritesWhatTheCameraSees) {
    ASSERT_EQ(simulate_command(
                  {.scene = {.name = "walking_xyz", .seed = 5}, .out = folder_.string(), .frames = 3, .is_json = true}),
              0);
    SimulatedCamera simulated({.scene = "walking_xyz", .seed = 5, .frames = 3});
    ReplayOptions options;
    options.folder = folder_.string();
    ReplayCamera replay(options);
    ASSERT_EQ(simulated.open(), Status::kOk);
    ASSERT_EQ(replay.open(), Status::kOk) << replay.message();
    EXPECT_EQ(replay.info().model.fx, simulated.info().model.fx);
    EXPECT_EQ(replay.info().model.cy, simulated.info().model.cy);
    EXPECT_EQ(replay.info().depth_units_per_m, simulated.info().depth_units_per_m);
    Trajectory truth;
    std::string message;
    ASSERT_EQ(read_trajectory((folder_ / "groundtruth.txt").string(), truth, message), Status::kOk) << message;
    ASSERT_EQ(truth.size(), 3U);
    Frame a;
    Frame b;
    for (std::size_t i = 0; i < 3; ++i) {
        ASSERT_EQ(simulated.poll(a), Status::kOk);
        ASSERT_EQ(replay.poll(b), Status::kOk);
        EXPECT_EQ(a.time_ns, b.time_ns);
        const std::size_t pixels = static_cast<std::size_t>(a.colour.width) * a.colour.height;
        EXPECT_EQ(std::memcmp(a.colour.data, b.colour.data, pixels), 0);
        EXPECT_EQ(std::memcmp(a.depth.data, b.depth.data, 2 * pixels), 0);
        EXPECT_NEAR(truth[i].t[0], simulated.true_pose().t[0], 1e-8);
        EXPECT_NEAR(truth[i].q[3], simulated.true_pose().q[3], 1e-8);
        EXPECT_TRUE(std::filesystem::exists(folder_ / "masks" / (time_text(a.time_ns) + ".png")));
    }
    EXPECT_EQ(replay.poll(b), Status::kEnd);
}

// Promise: with --width and --every the folder is that of a smaller camera, each so many-th of its frames, at their
// times.
TEST_F(SimulateCommand, WritesASmallerFasterCamera) {
    ASSERT_EQ(simulate_command({.scene = {.name = "static_loop"},
                                .out = folder_.string(),
                                .frames = 8,
                                .width = 96,
                                .every = 3,
                                .is_json = true}),
              0);
    SimulatedCamera simulated({.scene = "static_loop", .frames = 8, .width = 96, .height = 72});
    ReplayOptions options;
    options.folder = folder_.string();
    ReplayCamera replay(options);
    ASSERT_EQ(simulated.open(), Status::kOk);
    ASSERT_EQ(replay.open(), Status::kOk) << replay.message();
    Frame a;
    Frame b;
    for (std::uint32_t i = 0; i < 8; ++i) {
        ASSERT_EQ(simulated.poll(a), Status::kOk);
        if (i % 3 != 0) continue;
        ASSERT_EQ(replay.poll(b), Status::kOk);
        ASSERT_EQ(b.colour.width, 96U);
        EXPECT_EQ(a.time_ns, b.time_ns);
        EXPECT_EQ(std::memcmp(a.depth.data, b.depth.data, 2 * std::size_t{96} * 72), 0);
    }
    EXPECT_EQ(replay.poll(b), Status::kEnd);
}

// Promise: a folder with anything in it is refused and left as it is; so is a scene that does not exist.
TEST_F(SimulateCommand, RefusesWhatItCannotUse) {
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "diary.txt") << "mine";
    EXPECT_EQ(simulate_command({.scene = {.name = "static_xyz"}, .out = folder_.string(), .frames = 1}), 2);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
    EXPECT_EQ(simulate_command({.scene = {.name = "no_such"}, .out = (folder_ / "new").string(), .frames = 1}), 2);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "new"));
    EXPECT_EQ(simulate_command({.scene = {.name = "static_xyz"}, .out = (folder_ / "diary.txt").string(), .frames = 1}),
              2);
    EXPECT_EQ(simulate_command({.scene = {.name = "static_xyz"}, .out = "/proc/nothing/here", .frames = 1}), 2);
}

}  // namespace
}  // namespace stillmesh::simulate_command_test
