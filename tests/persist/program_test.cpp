// Maps as a user meets them: switches, sentences, exit codes, and what is on the disk afterwards.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/record/map_file.hpp"
#include "tests/support/answer.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::program_test {
namespace {

using test::Answer;
using test::stillmesh_says;

std::string text_of(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}
void write_text(const std::string& file, const std::string& text) {
    std::ofstream(file, std::ios::binary) << text;
}

// A folder with a map of a room in it, made by the program once.
struct ProgramMaps : testing::Test {
    static void SetUpTestSuite() {
        folder = std::make_unique<test::TemporaryFolder>();
        made = stillmesh_says("run --simulate static_xyz:1 --frames 16 --json --map-out " + at("room.map"));
    }
    static void TearDownTestSuite() { folder.reset(); }
    static std::string at(const std::string& name) { return folder->path(name); }
    static inline std::unique_ptr<test::TemporaryFolder> folder;
    static inline Answer made;
};

// Whether a header and the length of the file agree.
bool is_map(const std::string& file) {
    const std::string text = text_of(file);
    MapFileInfo info;
    MapFileProblem problem;
    return read_map_header(std::as_bytes(std::span(text)), info, problem) == Status::kOk &&
           info.size_bytes == text.size();
}

// Promise: `map info` and `map export` agree with the summary of the run that wrote the map, in every format; what is
// no map, or nothing to write, is refused with a sentence and nothing is written.
TEST_F(ProgramMaps, LeavesForOtherPrograms) {
    const auto number_behind = [](const std::string& text, const std::string& words) {
        const std::size_t begin = text.find(words);
        return begin == std::string::npos ? -1L : std::atol(text.c_str() + begin + words.size());
    };
    const Answer info = stillmesh_says("map info --json " + at("room.map"));
    ASSERT_EQ(info.code, 0) << info.text;
    const long points = number_behind(info.text, "\"points\": "),
               moving = number_behind(info.text, "\"points_moving\": ");
    const long keyframes = number_behind(info.text, "\"keyframes\": ");
    EXPECT_GT(points, 500) << info.text;
    EXPECT_GT(keyframes, 0);
    EXPECT_EQ(stillmesh_says("map info " + at("room.map")).code, 0);
    const Answer out = stillmesh_says("map export " + at("room.map") + " --ply " + at("m.ply") + " --pcd " +
                                      at("m.pcd") + " --tum " + at("m.txt") + " --json " + at("m.json"));
    ASSERT_EQ(out.code, 0) << out.text;
    const auto lines = [](const std::string& text) { return std::count(text.begin(), text.end(), '\n'); };
    const std::string ply = text_of(at("m.ply")), pcd = text_of(at("m.pcd")), tum = text_of(at("m.txt"));
    EXPECT_EQ(number_behind(ply, "element vertex "), points - moving);
    EXPECT_EQ(lines(ply.substr(ply.find("end_header\n") + 11)), points - moving);
    EXPECT_EQ(number_behind(pcd, "POINTS "), points - moving);
    EXPECT_EQ(lines(pcd.substr(pcd.find("DATA ascii\n") + 11)), points - moving);
    EXPECT_EQ(lines(tum), keyframes + 1);
    const std::string json = text_of(at("m.json"));
    long listed = 0;
    for (std::size_t i = json.find("\"static_weight\""); i != std::string::npos;
         i = json.find("\"static_weight\"", i + 1)) {
        ++listed;
    }
    EXPECT_EQ(listed, points - moving);
    EXPECT_NE(json.find("\"shared_points\"", json.find("\"covisible_list\"")), std::string::npos);
    ASSERT_EQ(stillmesh_says("map export " + at("room.map") + " --moving --ply " + at("all.ply")).code, 0);
    EXPECT_EQ(number_behind(text_of(at("all.ply")), "element vertex "), points);

    write_text(at("no.map"), "no map at all");
    EXPECT_EQ(stillmesh_says("map info " + at("no.map")).code, 2);
    EXPECT_EQ(stillmesh_says("map export " + at("no.map") + " --ply " + at("x.ply")).code, 2);
    EXPECT_FALSE(std::filesystem::exists(at("x.ply")));
    EXPECT_EQ(stillmesh_says("map export " + at("room.map")).code, 2);
    EXPECT_EQ(stillmesh_says("map export " + at("room.map") + " --ply " + at("room.map")).code, 2);
    EXPECT_TRUE(is_map(at("room.map")));
    EXPECT_EQ(stillmesh_says("map export " + at("room.map") + " --ply /dev/full").code, 1);
}

// Promise: `map merge` makes a map of two of one room, in which a camera is found, and says by its exit code and in a
// sentence why two others are none; then, and where it would write over what it reads, nothing is written.
TEST_F(ProgramMaps, TwoBecomeOne) {
    const auto make = [](const std::string& scene, const std::string& name) {
        return stillmesh_says("run --simulate " + scene + " --frames 20 --json --map-out " + at(name)).code;
    };
    ASSERT_EQ(make("walking_xyz:1+7", "day.map"), 0);
    ASSERT_EQ(make("static_xyz:2", "other.map"), 0);
    const auto merge = [](const std::string& second, const std::string& more) {
        return stillmesh_says("map merge " + at("room.map") + " " + at(second) + " --out " + more);
    };
    const Answer joined = merge("day.map", at("both.map") + " --json");
    ASSERT_EQ(joined.code, 0) << joined.text;
    EXPECT_NE(joined.text.find("\"keyframes_left_out\": 0"), std::string::npos) << joined.text;
    ASSERT_TRUE(is_map(at("both.map")));
    const Answer found =
        stillmesh_says("run --simulate static_xyz:1+5 --frames 40 --localize --map-in " + at("both.map"));
    EXPECT_EQ(found.code, 0) << found.text;
    const Answer pocket = merge("day.map", at("small.map") + " --limits pocket");
    EXPECT_EQ(pocket.code, 2) << pocket.text;  // room's features do not fit
    EXPECT_NE(pocket.text.find("limits.features_max"), std::string::npos) << pocket.text;
    const Answer refused = merge("other.map", at("none.map"));
    EXPECT_EQ(refused.code, 1) << refused.text;
    EXPECT_NE(refused.text.find("cannot be joined"), std::string::npos) << refused.text;
    EXPECT_FALSE(std::filesystem::exists(at("none.map")));
    const std::string before = text_of(at("room.map"));
    EXPECT_EQ(merge("day.map", at("room.map")).code, 2);
    EXPECT_EQ(text_of(at("room.map")), before);
    write_text(at("no.map"), "no map at all");
    EXPECT_EQ(merge("no.map", at("none.map")).code, 2);
}

// Promise: a map is written, read, localised in and gone on with; the summary says so.
TEST_F(ProgramMaps, ThereAndBack) {
    ASSERT_EQ(made.code, 0) << made.text;
    EXPECT_NE(made.text.find("\"what\": \"written\""), std::string::npos) << made.text;
    ASSERT_TRUE(is_map(at("room.map")));
    const std::string before = text_of(at("room.map"));
    const Answer localised =
        stillmesh_says("run --simulate static_xyz:1+5 --frames 20 --localize --map-in " + at("room.map"));
    EXPECT_EQ(localised.code, 0) << localised.text;
    EXPECT_NE(localised.text.find("map localised in " + at("room.map")), std::string::npos) << localised.text;
    EXPECT_TRUE(text_of(at("room.map")) == before);
    // On in the same file: what was read is replaced by what has become of it.
    const Answer gone_on = stillmesh_says("run --simulate static_xyz:1+5 --frames 20 --map-in " + at("room.map") +
                                          " --map-out " + at("more.map"));
    EXPECT_EQ(gone_on.code, 0) << gone_on.text;
    EXPECT_TRUE(is_map(at("more.map")));
    EXPECT_FALSE(text_of(at("more.map")) == before);
}

// Promise: a recording of a run that began in a map repeats with the map, and not without.
TEST_F(ProgramMaps, RecordingsRepeatWithTheirMap) {
    const Answer run = stillmesh_says("run --simulate static_xyz:1+5 --frames 16 --map-in " + at("room.map") +
                                      " --record " + at("run.rec") + " --record-frames " + at("frames") +
                                      " --map-every 0.1 --map-out " + at("x.map"));
    EXPECT_EQ(run.code, 0) << run.text;
    const std::string rerun = "rerun " + at("run.rec") + " --replay " + at("frames");
    const Answer with = stillmesh_says(rerun + " --map-in " + at("room.map"));
    EXPECT_EQ(with.code, 0) << with.text;
    EXPECT_NE(with.text.find("16 frames repeated"), std::string::npos) << with.text;
    EXPECT_EQ(stillmesh_says(rerun).code, 1);
    EXPECT_EQ(stillmesh_says(rerun + " --map-in " + at("none.map")).code, 2);
}

// Promise: whatever is wrong with a map or with what is asked of it is said in one sentence, with exit 2, and nothing
// is overwritten.
TEST_F(ProgramMaps, BadMaps) {
    const std::string good = text_of(at("room.map"));
    ASSERT_GT(good.size(), 1000U);
    const auto variant = [&](const std::string& name, std::string text) {
        write_text(at(name), text);
        return at(name);
    };
    const auto flipped = [&](std::size_t place) {
        std::string text = good;
        text[place] = static_cast<char>(text[place] ^ 4);
        return text;
    };
    std::filesystem::create_directories(at("folder"));
    write_text(at("kept.map"), "the map of yesterday");
    const std::string in = "--map-in ";
    const struct {
        std::string arguments, sentence;
    } cases[] = {
        {in + at("none.map"), "none.map: cannot be read: No such file"},
        {in + at("folder"), "folder: cannot be read: it is no regular file"},
        {in + "/dev/zero", "/dev/zero: cannot be read: it is no regular file"},
        {in + variant("empty.map", ""), "empty.map: is no map of Stillmesh"},
        {in + variant("text.map", "hello, world"), "text.map: is no map of Stillmesh"},
        {in + variant("short.map", good.substr(0, 50)), "short.map: is cut off: 50 bytes of 96"},
        {in + variant("cut.map", good.substr(0, good.size() - 1)), "cut.map: is cut off: "},
        {in + variant("long.map", good + "x"), "long.map: is damaged: "},
        {in + variant("version.map", flipped(8)),
         "version.map: is a map of version 6; this program reads versions 2 to 3"},
        {in + variant("header.map", flipped(24)), "header.map: is damaged: the checksum of its header"},
        {in + variant("points.map", flipped(good.size() / 20)), "points.map: is damaged: the checksum of its "},
        {in + at("room.map") + " --limits pocket", "room.map: is larger than the limits: it needs limits.features_max"},
        {in + at("room.map") + " --set features.levels=6", "room.map: was made with features.levels = 8"},
        {in + at("room.map") + " --localize", "--localize leaves the map as it is"},
        {"--localize", "--localize: needs the map"},
        {"--map-out " + at("none/a.map"), "none/a.map: the folder "},
        {"--map-out " + at("folder"), "folder: is a folder; give a file in it."},
    };
    for (const auto& c : cases) {
        const bool has_out = c.arguments.find("--map-out") != std::string::npos;
        const Answer answer =
            stillmesh_says("run --simulate static_xyz:1 --frames 2 " + c.arguments +
                           (has_out || c.arguments == "--localize" ? "" : " --map-out " + at("kept.map")));
        EXPECT_EQ(answer.code, 2) << c.arguments << ": " << answer.text;
        EXPECT_NE(answer.text.find(c.sentence), std::string::npos) << c.arguments << ": " << answer.text;
        EXPECT_EQ(answer.text.find('\n'), answer.text.size() - 1) << "one sentence: " << answer.text;
        EXPECT_EQ(text_of(at("kept.map")), "the map of yesterday") << c.arguments;
    }
    EXPECT_EQ(stillmesh_says("run --simulate static_xyz:1 --map-every 3").code, 2);
    EXPECT_FALSE(std::filesystem::exists(at("kept.map.part")));
}

// Promise: SIGTERM ends a run with its map on the disk; kill -9 leaves the map that was saved last.
TEST_F(ProgramMaps, SignalsLeaveAMap) {
    for (const int signal : {SIGTERM, SIGKILL}) {
        const std::string file = at("signal" + std::to_string(signal) + ".map");
        const std::string path = file + ".txt";
        const pid_t child = ::fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            if (std::freopen("/dev/null", "w", stdout) == nullptr) ::_exit(98);
            if (std::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(98);
            ::execl(STILLMESH_PROGRAM, STILLMESH_PROGRAM, "run", "--simulate", "static_xyz:1", "--frames", "100000",
                    "--map-every", signal == SIGKILL ? "0.2" : "1000", "--map-out", file.c_str(), "--trajectory",
                    path.c_str(), nullptr);
            ::_exit(127);
        }
        // Until frames have come; for the kill, until a map has been saved.
        for (int i = 0; i < 600; ++i) {
            if (signal == SIGKILL ? std::filesystem::exists(file) : text_of(path).size() > 500) break;
            ::usleep(100'000);
        }
        ::usleep(50'000);
        ASSERT_EQ(::kill(child, signal), 0);
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        if (signal == SIGTERM) {
            EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 128 + SIGTERM) << status;
        }
        EXPECT_TRUE(is_map(file)) << signal;
        const Answer answer = stillmesh_says("run --simulate static_xyz:1 --frames 16 --localize --map-in " + file);
        EXPECT_EQ(answer.code, 0) << answer.text;
    }
}

}  // namespace
}  // namespace stillmesh::program_test
