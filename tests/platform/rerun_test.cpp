// Recording and repeating runs, as a user does it, and as robots do it: killed in the middle.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/record/frame_folder_writer.hpp"
#include "platform/record/recording_reader.hpp"
#include "tests/replay/recording_folder.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh::rerun_test {
namespace {

using test::Answer;
using test::stillmesh_says;

// A small scene in a folder, rendered once for all tests; and a recording of a run over it.
class Rerun : public ::testing::Test {
protected:
    static constexpr std::uint32_t kFrames = 24;

    static void SetUpTestSuite() {
        folder_ = new test::TemporaryFolder();
        SimulatedCamera camera(
            {.scene = "walking_xyz", .seed = 2, .frames = kFrames, .width = 320, .height = 240, .exposure_ns = 0});
        ASSERT_EQ(camera.open(), Status::kOk);
        FrameFolderWriter writer;
        std::string message;
        ASSERT_TRUE(writer.open(path("frames"), camera.info(), message)) << message;
        for (Frame frame; camera.poll(frame) == Status::kOk;) {
            writer.wait_for_room(std::chrono::seconds(10));
            writer.add(frame);
        }
        ASSERT_EQ(writer.close(), "");
        const Answer answer = stillmesh_says("run --replay " + path("frames") + " --record " + path("good"));
        ASSERT_EQ(answer.code, 0) << answer.text;
    }
    static void TearDownTestSuite() {
        delete folder_;
        folder_ = nullptr;
    }
    [[nodiscard]] static std::string path(const std::string& name) { return folder_->path() + "/" + name; }
    [[nodiscard]] static Answer rerun(const std::string& file, const std::string& frames = "frames",
                                      const std::string& more = "") {
        return stillmesh_says("rerun " + path(file) + " --replay " + path(frames) + " " + more);
    }
    // The recording once more, with `edit` applied to one of its frames.
    static void rewrite(const std::string& to, std::uint64_t index, const std::function<void(RecordedFrame&)>& edit) {
        RecordingReader reader;
        ASSERT_EQ(reader.open(path("good")), Status::kOk);
        std::vector<std::byte> buffer(kRecordingHeaderBytesMax);
        std::string bytes;
        const auto append = [&](const Result<std::size_t>& size) {
            bytes.append(reinterpret_cast<const char*>(buffer.data()), size.value());
        };
        append(encode_header(reader.header(), buffer));
        RecordedFrame frame;
        std::uint64_t frames = 0;
        for (; reader.next(frame) == Status::kOk; ++frames) {
            if (frame.index == index) edit(frame);
            append(encode_frame(frame, buffer));
        }
        append(encode_end(RecordingEnd::kDone, frames, buffer));
        test::write_text(path(to), bytes);
    }

private:
    static inline test::TemporaryFolder* folder_ = nullptr;
};

// Promise: what odometry and gyroscope said is part of a recording: the run is repeated bit by bit without their files.
// A folder's own files are found and named, `none` leaves them out, and the run is another one then.
TEST_F(Rerun, HintsOfTheMotionAreRecorded) {
    const std::string moved = path("moved");
    ASSERT_EQ(stillmesh_says("simulate trolley_first --seed 5 --frames 12 --width 320 --motion --out " + moved).code,
              0);
    const auto hashes_of = [&](const std::string& name, const std::string& more) {
        const Answer answer = stillmesh_says("run --replay " + moved + " --state-hashes " + path(name) + " " + more);
        EXPECT_EQ(answer.code, 0) << answer.text;
        EXPECT_EQ(answer.says("odometry.txt and " + moved + "/gyro.txt: a motion for 11 of 12 frames"),
                  more.find("none") == std::string::npos)
            << answer.text;
        return test::read_text(path(name));
    };
    const std::string with = hashes_of("with", "--record " + path("hinted"));
    EXPECT_NE(hashes_of("without", "--odometry none --gyro none"), with);
    EXPECT_EQ(hashes_of("again", ""), with);
    for (const char* const name : {"/odometry.txt", "/gyro.txt"}) std::filesystem::remove(moved + name);
    const Answer repeated = stillmesh_says("rerun " + path("hinted") + " --replay " + moved);
    EXPECT_EQ(repeated.code, 0) << repeated.text;
}

// Promise: a bad file of the motion is named with its line and the way without it, before anything is written; a live
// camera has none.
TEST_F(Rerun, BadFilesOfTheMotionEndNoRunHalfway) {
    { std::ofstream(path("backwards.txt")) << "2.0 0 0 0\n1.0 0 0 0\n"; }
    const Answer bad = stillmesh_says("run --replay " + path("frames") + " --gyro " + path("backwards.txt") +
                                      " --trajectory " + path("never.txt"));
    EXPECT_EQ(bad.code, 2);
    EXPECT_TRUE(bad.says("backwards.txt, line 2: its time is not after")) << bad.text;
    EXPECT_TRUE(bad.says("--gyro none")) << bad.text;
    EXPECT_FALSE(std::filesystem::exists(path("never.txt")));
    const Answer gone = stillmesh_says("run --replay " + path("frames") + " --odometry " + path("nowhere.txt"));
    EXPECT_EQ(gone.code, 2);
    EXPECT_TRUE(gone.says("nowhere.txt")) << gone.text;
    EXPECT_EQ(stillmesh_says("run --camera auto --odometry " + path("backwards.txt")).code, 2);
    // Times of another clock: said, and the run is as without.
    { std::ofstream(path("far.txt")) << "9001.0 0 0 0\n9002.0 0 0 0\n"; }
    const Answer far = stillmesh_says("run --replay " + path("frames") + " --gyro " + path("far.txt"));
    EXPECT_EQ(far.code, 0);
    EXPECT_TRUE(far.says("a motion for 0 of 24 frames; are its times")) << far.text;
}

// Promise: a run is repeated bit for bit from its recording and its frames, and says how many frames that were.
TEST_F(Rerun, RepeatsARun) {
    const Answer answer = rerun("good");
    EXPECT_EQ(answer.code, 0) << answer.text;
    EXPECT_TRUE(answer.says("24 frames repeated bit for bit")) << answer.text;
    const auto json = nlohmann::json::parse(rerun("good", "frames", "--json").text);
    EXPECT_EQ(json["frames_repeated"], kFrames);
    EXPECT_EQ(json["is_identical"], true);
    EXPECT_EQ(json["is_whole"], true);
}

// Promise: options, configuration and seed of the run are in its recording: nothing has to be given again.
TEST_F(Rerun, HoldsTheConfiguration) {
    const Answer run = stillmesh_says("run --json --replay " + path("frames") + " --record " + path("other") +
                                      " --limits pocket --scene outdoor --set features.count=300 --set seed=77"
                                      " --set schedule.units_per_frame=777 --set schedule.slice_units=100");
    ASSERT_EQ(run.code, 0) << run.text;
    const auto json = nlohmann::json::parse(rerun("other", "frames", "--json").text);
    EXPECT_EQ(json["frames_repeated"], kFrames);
    EXPECT_EQ(json["is_identical"], true) << json.dump();
    EXPECT_EQ(json["state_hash"], nlohmann::json::parse(run.text)["state_hash"]);
}

// Promise: what a camera file tells of the rolling shutter is what the engine takes, unless the user says otherwise, be
// it that it is to be estimated; a camera that does not tell, the simulated one too, has it estimated.
TEST_F(Rerun, HoldsTheCamerasReadout) {
    test::write_text(path("told.toml"), test::read_text(path("frames") + "/camera.toml") + "readout_s = 0.02\n");
    test::write_text(path("set.toml"), "camera.readout_s = 0.01\n");
    const std::string frames = "--replay " + path("frames");
    const std::string told = frames + " --calibration " + path("told.toml");
    const std::vector<std::pair<std::string, double>> cases = {
        {frames, -1},
        {told, 0.02},
        {told + " --set camera.readout_s=0.03", 0.03},
        {told + " --set camera.readout_s=-1", -1},
        {told + " --config " + path("set.toml"), 0.01},
        {"--simulate static_xyz:1", -1},
    };
    for (const auto& [arguments, readout_s] : cases) {
        const Answer answer = stillmesh_says("run --frames 2 " + arguments + " --record " + path("readout"));
        ASSERT_EQ(answer.code, 0) << arguments << ": " << answer.text;
        RecordingReader reader;
        ASSERT_EQ(reader.open(path("readout")), Status::kOk) << reader.message();
        EXPECT_EQ(reader.header().configuration.camera.readout_s, readout_s) << arguments;
        std::filesystem::remove(path("readout"));
    }
}

// Promise: a simulated run is repeated from the frames it wrote beside its recording.
TEST_F(Rerun, RepeatsASimulation) {
    const Answer run = stillmesh_says("run --simulate sitting_xyz:3 --frames 5 --record " + path("simulated") +
                                      " --record-frames " + path("simulated_frames"));
    ASSERT_EQ(run.code, 0) << run.text;
    const Answer answer = rerun("simulated", "simulated_frames");
    EXPECT_EQ(answer.code, 0) << answer.text;
    EXPECT_TRUE(answer.says("5 frames repeated bit for bit")) << answer.text;
}

// Promise: when one picture is another, or missing, the frame is named, with its time, and the exit code is 1.
TEST_F(Rerun, NamesTheFrameWithOtherPixels) {
    std::filesystem::copy(path("frames"), path("spoiled"), std::filesystem::copy_options::recursive);
    RecordingReader reader;
    ASSERT_EQ(reader.open(path("good")), Status::kOk);
    RecordedFrame frame;
    for (int i = 0; i < 8; ++i) ASSERT_EQ(reader.next(frame), Status::kOk);
    const std::string name = "/rgb/" + time_text(frame.time_ns) + ".png";
    test::write_colour(path("spoiled") + name, 320, 240, false, 5);
    const Answer answer = rerun("good", "spoiled");
    EXPECT_EQ(answer.code, 1) << answer.text;
    EXPECT_TRUE(answer.says("7 frames repeated bit for bit")) << answer.text;
    EXPECT_TRUE(answer.says("frame 7 (time " + time_text(frame.time_ns) + ") differs: other input")) << answer.text;
    std::filesystem::remove(path("spoiled") + name);
    const Answer missing = rerun("good", "spoiled");
    EXPECT_EQ(missing.code, 1);
    EXPECT_TRUE(missing.says("frame 7 (time")) << missing.text;
    EXPECT_TRUE(missing.says("no usable frame")) << missing.text;
}

// Promise: when one grant was another, or a decision, or a hash, the first frame that differs is named with what
// differs.
TEST_F(Rerun, NamesWhatDiffers) {
    const struct {
        std::function<void(RecordedFrame&)> edit;
        const char* words;
    } cases[] = {
        {[](RecordedFrame& f) { ++f.grants[0].units; },
         "frame 9 (time 0.300000000) differs: other bits after its background"},
        {[](RecordedFrame& f) { f.grant_runs = 0; }, "differs: other bits after its background work"},
        {[](RecordedFrame& f) { ++f.hash; }, "differs: other bits after its background work"},
        {[](RecordedFrame& f) { ++f.hash_tracked; }, "differs: other bits after tracking"},
        {[](RecordedFrame& f) { ++f.digest; }, "differs: other input"},
        {[](RecordedFrame& f) { f.is_keyframe = !f.is_keyframe; }, "keyframe"},
        {[](RecordedFrame& f) { f.pose_state = 0; }, "the pose is tracked, recorded none"},
        {[](RecordedFrame& f) { ++f.static_matches; }, "static matches, recorded"},
        {[](RecordedFrame& f) { f.status = Status::kInvalid; }, "submit says 'ok', recorded 'invalid'"},
        {[](RecordedFrame& f) { f.time_ns += 1; }, "no usable frame of this time"},
    };
    for (const auto& one : cases) {
        rewrite("edited", 9, one.edit);
        const Answer answer = rerun("edited");
        EXPECT_EQ(answer.code, 1) << one.words;
        EXPECT_TRUE(answer.says("frame 9 (time ")) << answer.text;
        EXPECT_TRUE(answer.says(one.words) || std::string(one.words).find("0.3") != std::string::npos) << answer.text;
        EXPECT_TRUE(answer.says("9 frames repeated bit for bit")) << answer.text;
    }
}

// Promise: a cut recording is repeated up to its last whole frame, with a word about what is missing, and exit code 0.
TEST_F(Rerun, TornRecordings) {
    const std::string all = test::read_text(path("good"));
    for (const std::size_t cut :
         {std::size_t{1}, std::size_t{17}, std::size_t{18}, std::size_t{19}, std::size_t{500}}) {
        test::write_text(path("torn"), all.substr(0, all.size() - cut));
        const Answer answer = rerun("torn");
        EXPECT_EQ(answer.code, 0) << answer.text;
        EXPECT_TRUE(answer.says("torn") || answer.says("no end mark")) << answer.text;
        EXPECT_TRUE(answer.says("frames repeated bit for bit")) << answer.text;
    }
}

// Promise: a folder that ends before a whole recording does is a difference, named.
TEST_F(Rerun, AFolderThatEnds) {
    std::filesystem::copy(path("frames"), path("short"), std::filesystem::copy_options::recursive);
    std::string list = test::read_text(path("short/rgb.txt"));
    list.resize(list.rfind('\n', list.size() - 2) + 1);
    test::write_text(path("short/rgb.txt"), list);
    const Answer answer = rerun("good", "short");
    EXPECT_EQ(answer.code, 1) << answer.text;
    EXPECT_TRUE(answer.says("23 frames repeated bit for bit")) << answer.text;
    EXPECT_TRUE(answer.says("the folder ends before frame 23")) << answer.text;
}

// Promise: a recording knows its vocabulary: another one, or none, is refused with the remedy; one made without any is
// repeated whatever is named.
TEST_F(Rerun, KnowsItsVocabulary) {
    const Answer other = rerun("good", "frames", "--vocabulary none");
    EXPECT_EQ(other.code, 2) << other.text;
    EXPECT_TRUE(other.says("was made with another vocabulary than no vocabulary")) << other.text;
    EXPECT_TRUE(other.says("--vocabulary")) << other.text;
    const Answer made =
        stillmesh_says("run --replay " + path("frames") + " --vocabulary none --record " + path("wordless"));
    ASSERT_EQ(made.code, 0) << made.text;
    EXPECT_EQ(rerun("wordless").code, 0);
}

// Promise: bad recordings, folders and usage end with 2 and a sentence.
TEST_F(Rerun, BadInput) {
    test::write_text(path("text"), "no recording at all, but some text\n");
    test::write_text(path("empty"), "");
    test::write_text(path("header"), test::read_text(path("good")).substr(0, 300));
    std::string flipped = test::read_text(path("good"));
    flipped[200] = static_cast<char>(flipped[200] ^ 4);
    test::write_text(path("flipped"), flipped);
    for (const char* name : {"text", "empty", "header", "flipped", "none"}) {
        const Answer answer = rerun(name);
        EXPECT_EQ(answer.code, 2) << name;
        EXPECT_EQ(answer.text.find("stillmesh: "), 0U) << answer.text;
        EXPECT_TRUE(answer.says(path(name))) << answer.text;
    }
    EXPECT_EQ(rerun("good", "nowhere").code, 2);
    EXPECT_EQ(stillmesh_says("rerun").code, 2);
    EXPECT_EQ(stillmesh_says("rerun " + path("good")).code, 2);
    const std::string run = "run --replay " + path("frames");
    EXPECT_EQ(stillmesh_says(run + " --record /none/file").code, 2);
    const Answer taken = stillmesh_says(run + " --record-frames " + path("frames"));
    EXPECT_EQ(taken.code, 2);
    EXPECT_TRUE(taken.says("is not empty")) << taken.text;
}

// Promise: budgets of 0, limits that handles cannot name, and sizes that contradict each other name key, value and
// range.
TEST_F(Rerun, BadConfigurations) {
    const struct {
        const char* arguments;
        const char* words[3];
    } cases[] = {
        {"--set schedule.units_per_frame=0", {"'schedule.units_per_frame'", "0", "1 to 1000000000"}},
        {"--set schedule.slice_units=0", {"'schedule.slice_units'", "0", "1 to 1000000000"}},
        {"--set limits.keyframes_max=70000", {"'limits.keyframes_max'", "70000", "2 to 1024"}},
        {"--set limits.map_points_max=20000000", {"'limits.map_points_max'", "20000000", "50 to 16777215"}},
        {"--set limits.map_points_max=500",
         {"'limits.map_points_max' = 500", "below limits.features_max", "1000 to 16777215"}},
        {"--set limits.features_max=400", {"'features.count' = 1000", "limits.features_max", "50 to 400"}},
        {"--set limits.image_width_max=4000", {"'limits.image_width_max'", "4000", "64 to 2047"}},
        {"--set limits.keyframes_max=6",
         {"'mapping.window_keyframes' = 10", "more than limits.keyframes_max", "2 to 6"}},
        {"--set features.fast_threshold_low=30",
         {"'features.fast_threshold_low' = 30", "above features.fast_threshold", "1 to 20"}},
        {"--set mapping.window_keyframes=0", {"'mapping.window_keyframes'", "0", "2 to 12"}},
        {"--set weights.eligible=30", {"'weights.eligible' = 30", "above weights.max", "0 to 20"}},
    };
    for (const auto& one : cases) {
        const Answer answer = stillmesh_says("run --replay " + path("frames") + " " + one.arguments);
        EXPECT_EQ(answer.code, 2) << one.arguments;
        for (const char* words : one.words) EXPECT_TRUE(answer.says(words)) << one.arguments << ": " << answer.text;
    }
}

// Promise: a --realtime run, whatever it dropped and granted, is repeated bit for bit; its summary counts both.
TEST_F(Rerun, RepeatsARealTimeRun) {
    const Answer run = stillmesh_says("run --json --realtime --replay " + path("frames") + " --record " + path("live"));
    ASSERT_EQ(run.code, 0) << run.text;
    const auto json = nlohmann::json::parse(run.text);
    EXPECT_EQ(json["is_realtime"], true);
    const std::uint64_t served = json["frames"], dropped = json["frames_dropped"];
    EXPECT_EQ(served + dropped, kFrames);
    EXPECT_GE(json["wall_s"].get<double>(), (kFrames - 2) / 30.0) << "faster than it was recorded";
    const auto answer = nlohmann::json::parse(rerun("live", "frames", "--json").text);
    EXPECT_EQ(answer["is_identical"], true) << answer.dump();
    EXPECT_EQ(answer["frames_repeated"], served);
    EXPECT_EQ(answer["state_hash"], json["state_hash"]);
}

// Starts the program, kills it with SIGKILL once `frames_min` frames are in its recording.
void kill_after(const std::vector<std::string>& arguments, const std::string& file, std::uint64_t frames_min) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
        std::vector<char*> pointers;
        std::string program = STILLMESH_PROGRAM;
        pointers.push_back(program.data());
        std::vector<std::string> copies = arguments;
        for (std::string& argument : copies) pointers.push_back(argument.data());
        pointers.push_back(nullptr);
        if (std::freopen("/dev/null", "w", stdout) == nullptr || std::freopen("/dev/null", "w", stderr) == nullptr) {
            ::_exit(126);
        }
        ::execv(STILLMESH_PROGRAM, pointers.data());
        ::_exit(127);
    }
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    for (std::uint64_t frames = 0; frames < frames_min && std::chrono::steady_clock::now() < limit; frames = 0) {
        RecordingReader reader;
        RecordedFrame frame;
        if (reader.open(file) == Status::kOk) {
            while (reader.next(frame) == Status::kOk) ++frames;
        }
        if (frames >= frames_min) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ::kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "it was over before it could be killed";
}

// Promise: a run killed with SIGKILL in its middle is repeated up to the last whole frame: one in real time over a
// folder, and a simulated one that was writing its own frames.
TEST_F(Rerun, AfterKillNine) {
    const struct {
        std::vector<std::string> arguments;
        std::string frames;
        std::uint64_t frames_repeated_min;
    } cases[] = {
        {{"run", "--realtime", "--replay", path("frames"), "--record", path("killed")}, "frames", 6},
        {{"run", "--simulate", "walking_xyz:1", "--record", path("killed"), "--record-frames", path("own")}, "own", 1},
    };
    for (const auto& one : cases) {
        std::filesystem::remove(path("killed"));
        kill_after(one.arguments, path("killed"), 6);
        const Answer answer = rerun("killed", one.frames, "--json");
        EXPECT_EQ(answer.code, 0) << answer.text;
        const auto json = nlohmann::json::parse(answer.text.substr(0, answer.text.rfind('}') + 1));
        EXPECT_EQ(json["is_identical"], true) << json.dump();
        EXPECT_EQ(json["is_whole"], false);
        EXPECT_GE(json["frames_repeated"], one.frames_repeated_min);
        EXPECT_FALSE(json["ending"].get<std::string>().empty());
    }
}

}  // namespace
}  // namespace stillmesh::rerun_test
