// A map store as a user meets it: switches, sentences, exit codes, a second run in the first one's places, repetition.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/record/frame_folder_writer.hpp"
#include "tests/support/answer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::program_test {
namespace {

using test::Answer;
using test::stillmesh_says;

// Small pools, so that places leave within a few frames.
constexpr const char* kSmall =
    " --limits pocket --set limits.keyframes_max=8 --set keyframes.gap_min=2 --set store.gap_frames=10 --set "
    "mapping.window_keyframes=4 --set loop.inliers_min=25 --json ";

// A scene in a folder, rendered once, and a run over it with a store.
struct ProgramStore : testing::Test {
    static void SetUpTestSuite() {
        folder = std::make_unique<test::TemporaryFolder>();
        SimulatedCamera camera(
            {.scene = "static_loop", .seed = 1, .frames = 40, .width = 320, .height = 240, .exposure_ns = 0});
        ASSERT_EQ(camera.open(), Status::kOk);
        FrameFolderWriter writer;
        std::string message;
        ASSERT_TRUE(writer.open(at("frames"), camera.info(), message)) << message;
        for (Frame frame; camera.poll(frame) == Status::kOk;) {
            writer.wait_for_room(std::chrono::seconds(10));
            writer.add(frame);
        }
        ASSERT_EQ(writer.close(), "");
        made = run("store", "--record " + at("first.rec"));
    }
    static void TearDownTestSuite() { folder.reset(); }
    static std::string at(const std::string& name) { return folder->path(name); }
    static Answer run(const std::string& store, const std::string& more = "") {
        return stillmesh_says("run --replay " + at("frames") + kSmall + "--map-store " + at(store) + " " + more,
                              "2>/dev/null");
    }
    static inline std::unique_ptr<test::TemporaryFolder> folder;
    static inline Answer made;
};

// Promise: a run leaves its places in the store and says so; the next one begins in them. Each is repeated bit for bit
// by its recording, which finds the store as it was, and leaves it as it is.
TEST_F(ProgramStore, ThereAndBackAndRepeated) {
    ASSERT_EQ(made.code, 0) << made.text;
    const auto first = nlohmann::json::parse(made.text);
    EXPECT_GT(first["map_store"]["regions"].get<int>(), 0) << made.text;
    EXPECT_EQ(first["map_store"]["refused"].get<int>(), 0);
    const Answer second = run("store", "--record " + at("second.rec"));
    ASSERT_TRUE(second.code == 0) << second.text;
    const auto json = nlohmann::json::parse(second.text);
    EXPECT_GT(json["map_store"]["returned"].get<int>(), 0) << second.text;
    const auto segment = std::filesystem::file_size(at("store/00000001.seg"));
    const Answer first_again = stillmesh_says("rerun " + at("first.rec") + " --replay " + at("frames"));
    EXPECT_EQ(first_again.code, 0) << first_again.text;
    const Answer second_again =
        stillmesh_says("rerun " + at("second.rec") + " --replay " + at("frames") + " --map-store " + at("store"));
    EXPECT_EQ(second_again.code, 0) << second_again.text;
    EXPECT_EQ(std::filesystem::file_size(at("store/00000001.seg")), segment);
    const Answer without = stillmesh_says("rerun " + at("second.rec") + " --replay " + at("frames"));
    EXPECT_EQ(without.code, 2);
    EXPECT_TRUE(without.says("--map-store")) << without.text;
    std::filesystem::create_directory(at("other"));
    ASSERT_EQ(run("other").code, 0);
    std::filesystem::resize_file(at("other/00000001.seg"), 64);
    const Answer other =
        stillmesh_says("rerun " + at("second.rec") + " --replay " + at("frames") + " --map-store " + at("other"));
    EXPECT_EQ(other.code, 2);
    EXPECT_TRUE(other.says("another map store")) << other.text;
}

// Promise: two runs over equal stores give the same state hash; one without a store another.
TEST_F(ProgramStore, TwoRunsSameBits) {
    ASSERT_EQ(made.code, 0) << made.text;
    const Answer again = run("store2");
    ASSERT_EQ(again.code, 0) << again.text;
    EXPECT_EQ(nlohmann::json::parse(again.text)["state_hash"], nlohmann::json::parse(made.text)["state_hash"]);
}

// Promise: a store that cannot be used is refused with exit 2 and one sentence that names it, before anything starts.
TEST_F(ProgramStore, RefusedBeforeAnythingStarts) {
    const auto refused = [](const std::string& arguments, const std::string& words) {
        const Answer answer = stillmesh_says("run --replay " + at("frames") + " " + arguments);
        EXPECT_EQ(answer.code, 2) << arguments << ": " << answer.text;
        EXPECT_TRUE(answer.says(words)) << arguments << ": " << answer.text;
    };
    std::fclose(std::fopen(at("file").c_str(), "w"));
    refused("--map-store " + at("file"), "no folder");
    refused("--map-store " + at("no/where"), "cannot be made");
    refused("--map-store " + at("new") + " --vocabulary none", "vocabulary");
    refused("--localize --map-in x --map-store " + at("new"), "--localize");
    EXPECT_FALSE(std::filesystem::exists(at("new")));
    refused("--set features.levels=4 --limits pocket --map-store " + at("store"), "other features");
    const int lock = ::open(at("store/lock").c_str(), O_RDWR);
    ASSERT_EQ(::flock(lock, LOCK_EX), 0);
    refused("--limits pocket --map-store " + at("store"), "another program");
    ::close(lock);
}

}  // namespace
}  // namespace stillmesh::program_test
