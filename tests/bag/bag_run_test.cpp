// Bags through the whole program: what a bag is played as, and that every command takes one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "tests/bag/bag_maker.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh::bag_run_test {
namespace {

using test::Answer;
using test::Room;
using test::RoomOptions;
using test::stillmesh_says;

[[nodiscard]] std::string word_after(const std::string& text, const std::string& key) {
    const std::size_t at = text.find("\"" + key + "\"");
    if (at == std::string::npos) return "";
    const std::size_t begin = text.find_first_not_of(": \"", at + key.size() + 2);
    return text.substr(begin, text.find_first_of("\",\n}", begin) - begin);
}

struct Way {
    const char* name;
    const char* arguments;
    bool is_rgb;
    std::uint32_t units_per_m;
    bool is_depth_separate = false;
};

class SameState : public testing::TestWithParam<Way> {
protected:
    // One room a kind, and what its folder ends with.
    static const Room& room(const Way& way) {
        static std::map<std::tuple<bool, std::uint32_t, bool>, std::unique_ptr<Room>> rooms;
        std::unique_ptr<Room>& at = rooms[{way.is_rgb, way.units_per_m, way.is_depth_separate}];
        if (at == nullptr) {
            RoomOptions options;
            options.is_rgb = way.is_rgb;
            options.units_per_m = way.units_per_m;
            options.is_depth_separate = way.is_depth_separate;
            at = std::make_unique<Room>(options);
        }
        return *at;
    }
};

// Promise: a bag and the folder made from it give the same state hash, whatever the bag's format, packing, encoding,
// byte order, order of messages and number of files; also
// where depth is of a camera of its own.
TEST_P(SameState, AsTheFolder) {
    const Way& way = GetParam();
    const Room& from = room(way);
    const Answer folder = stillmesh_says("run --json --replay " + from.folder());
    ASSERT_EQ(folder.code, 0) << folder.text;
    ASSERT_EQ(word_after(folder.text, "frames"), "8") << folder.text;
    const std::string path = from.bag(std::string(way.name), way.arguments);
    const Answer bag = stillmesh_says("run --json --replay " + path);
    EXPECT_EQ(bag.code, 0) << bag.text;
    const std::string hash = word_after(folder.text, "state_hash");
    EXPECT_EQ(hash.size(), 16U) << folder.text;
    EXPECT_EQ(word_after(bag.text, "state_hash"), hash) << bag.text;
    EXPECT_EQ(word_after(bag.text, "frames"), "8") << bag.text;
}

INSTANTIATE_TEST_SUITE_P(
    All, SameState,
    testing::Values(
        Way{"ros1", "--format ros1", false, 1000}, Way{"ros1_bz2", "--format ros1 --packing bz2", false, 1000},
        Way{"ros1_lz4", "--format ros1 --packing lz4 --depth-first", false, 1000},
        Way{"ros1_metres", "--format ros1 --packing lz4 --depth 32FC1", false, 5000},
        Way{"ros1_small_chunks", "--format ros1 --chunk-bytes 1000 --colour bgr8", true, 1000},
        Way{"ros1_one_chunk", "--format ros1 --chunk-bytes 60000000 --packing lz4 --late-depth 2", false, 1000},
        Way{"ros1_packed_images", "--format ros1 --colour file --depth compressedDepth16", true, 1000},
        Way{"realsense", "--format ros1 --packing lz4 --realsense --depth-info --depth mono16", false, 1000},
        Way{"db3", "--format db3", false, 1000}, Way{"db3_zstd_messages", "--format db3 --packing zstd", false, 1000},
        Way{"db3_big_endian", "--format db3 --big-endian --depth 16UC1_big --colour bgra8", true, 1000},
        Way{"db3_parts", "--format db3 --parts 3 --colour rgba8", true, 1000},
        Way{"mcap", "--format mcap --colour rgb8 --padding 5", true, 1000},
        Way{"mcap_lz4", "--format mcap --packing lz4 --depth 32FC1", false, 5000},
        Way{"mcap_zstd", "--format mcap --packing zstd --late-depth 3", false, 1000},
        Way{"mcap_parts", "--format mcap --packing zstd --parts 4 --no-metadata", false, 1000},
        Way{"mcap_packed_images", "--format mcap --colour file --depth compressedDepth16", false, 1000},
        Way{"ros1_two_cameras", "--format ros1 --packing lz4 --depth-info --depth-frame-id camera_depth_optical_frame",
            false, 1000, true},
        Way{"db3_two_cameras", "--format db3 --depth-info --depth-frame-id /camera_depth_optical_frame", false, 1000,
            true},
        Way{"realsense_two_cameras", "--format ros1 --packing lz4 --realsense --depth-info --depth mono16", false, 1000,
            true}),
    [](const testing::TestParamInfo<Way>& way) { return way.param.name; });

// Promise: a run over a bag is repeated bit for bit from the bag, its recorded frames are the bag's, and check-camera
// takes it.
TEST(BagProgram, EveryCommandTakesABag) {
    const Room room;
    const std::string bag = room.bag("room.mcap", "--format mcap --packing zstd");
    const Answer run = stillmesh_says("run --json --replay " + bag + " --record " + room.path("run.rec") +
                                      " --record-frames " + room.path("frames"));
    ASSERT_EQ(run.code, 0) << run.text;
    const Answer again = stillmesh_says("rerun " + room.path("run.rec") + " --replay " + bag);
    EXPECT_EQ(again.code, 0) << again.text;
    const Answer written = stillmesh_says("run --json --replay " + room.path("frames"));
    EXPECT_EQ(word_after(written.text, "state_hash"), word_after(run.text, "state_hash")) << written.text;
    const Answer check = stillmesh_says("check-camera --replay " + bag);
    EXPECT_EQ(check.code, 0) << check.text;
    const Answer half = stillmesh_says("run --half --replay " + bag);
    EXPECT_NE(half.code, 2) << half.text;
}

// Promise: frames recorded into a bag play as the same frames in a folder do, grey and colour, in mm and in 1/5000 m; a
// bag whose writer was killed, cut off anywhere behind its first frame, plays the frames it has whole; one that is
// there already is left alone.
TEST(BagProgram, RecordsABag) {
    for (const auto& [is_rgb, units] : {std::pair(false, 1000U), std::pair(true, 5000U)}) {
        RoomOptions options;
        options.is_rgb = is_rgb;
        options.units_per_m = units;
        const Room room(options);
        const std::string bag = room.path("frames.mcap");
        const std::string play = "run --json --replay ";
        const Answer folder =
            stillmesh_says(play + room.folder() + " --record-frames " + room.path("frames"), "2>/dev/null");
        ASSERT_EQ(stillmesh_says(play + room.folder() + " --record-frames " + bag).code, 0);
        const std::string hash = word_after(folder.text, "state_hash");
        ASSERT_EQ(hash.size(), 16U) << folder.text;
        const Answer from_frames = stillmesh_says(play + room.path("frames"));
        EXPECT_EQ(word_after(from_frames.text, "state_hash"), hash) << from_frames.text;
        const Answer from_bag = stillmesh_says(play + bag);
        EXPECT_EQ(from_bag.code, 0) << from_bag.text;
        EXPECT_EQ(word_after(from_bag.text, "state_hash"), hash) << from_bag.text;
        EXPECT_EQ(word_after(from_bag.text, "frames"), "8");
        const Answer refused = stillmesh_says(play + room.folder() + " --record-frames " + bag);
        EXPECT_EQ(refused.code, 2) << refused.text;
        EXPECT_TRUE(refused.says("give another name")) << refused.text;
        const std::uintmax_t bytes = std::filesystem::file_size(bag);
        // In the seventh frame, in the fourth, and in the index.
        for (const auto& [left, whole] : {std::pair(bytes * 7 / 8 - 40'000, "6"), std::pair(bytes / 2 - 40'000, "3"),
                                          std::pair(bytes - 100, "8")}) {
            const std::string torn = room.path("torn.mcap");
            std::filesystem::copy_file(bag, torn, std::filesystem::copy_options::overwrite_existing);
            std::filesystem::resize_file(torn, left);
            const Answer answer = stillmesh_says(play + torn);
            EXPECT_EQ(word_after(answer.text, "frames"), whole) << left << " of " << bytes << answer.text;
        }
    }
}

// Promise: options of the other kind of recording are refused with 2 and a sentence, and so is a bag that is none.
TEST(BagProgram, RefusesWithASentence) {
    const Room room;
    const std::string bag = room.bag("room.db3", "--format db3");
    test::write_text(room.path("empty.bag"), "");
    test::write_text(room.path("old.bag"), "#ROSBAG V1.2\n");
    test::write_text(room.path("whole.db3.zstd"), "\x28\xb5\x2f\xfdwhatever");
    const struct {
        std::string arguments, sentence;
    } cases[] = {
        {"--replay " + room.folder() + " --topics /a,/b", "--topics: are a bag's"},
        {"--simulate walking_xyz --topics /a,/b", "--topics: are a bag's"},
        {"--replay " + bag + " --fps 30", "--fps: a bag has times"},
        {"--replay " + bag + " --topics /a", "give COLOUR,DEPTH"},
        {"--replay " + bag + " --topics /a,/camera/depth/image_raw",
         "'/a' is no topic with colour images that are read here; the bag has /camera/rgb/camera_info (CameraInfo "
         "320x240), /camera/rgb/image_raw (mono8 320x240), /camera/depth/image_raw (16UC1 320x240)."},
        {"--replay " + room.path("nowhere.bag"), "No such file"},
        {"--replay " + room.path("empty.bag"), "is no bag"},
        {"--replay " + room.path("old.bag"), "another version than 2.0"},
        {"--replay " + room.path("whole.db3.zstd"), "unpack it first: zstd -d"},
        {"--replay " + bag + " --calibration " + room.path("none.yaml"), "none.yaml"},
    };
    for (const auto& one : cases) {
        const Answer answer = stillmesh_says("run " + one.arguments);
        EXPECT_EQ(answer.code, 2) << one.arguments;
        EXPECT_TRUE(answer.says(one.sentence)) << one.arguments << ": " << answer.text;
    }
}

// Promise: a torn bag is played up to the tear, the run says where and ends with 1; what was guessed and what is
// missing stands in the summary.
TEST(BagProgram, SaysWhatWasLost) {
    const Room room;
    const std::string whole = test::read_text(room.bag("whole.mcap", "--format mcap"));
    test::write_text(room.path("torn.mcap"), whole.substr(0, whole.size() * 7 / 10));
    const Answer torn = stillmesh_says("run --replay " + room.path("torn.mcap"));
    EXPECT_EQ(torn.code, 1) << torn.text;
    EXPECT_TRUE(torn.says("torn.mcap: is torn at byte")) << torn.text;
    EXPECT_TRUE(torn.says("frames        5 ")) << torn.text;
    EXPECT_TRUE(torn.says("colour is /camera/rgb/image_raw, depth /camera/depth/image_raw.")) << torn.text;
    const Answer holes = stillmesh_says("run --replay " + room.bag("holes.db3", "--format db3 --skip-depth 4"));
    EXPECT_EQ(holes.code, 0) << holes.text;
    EXPECT_TRUE(holes.says("2 of 8 colour images have no depth image within 20 ms: skipped.")) << holes.text;
}

// Promise: a long bag needs no more memory than a short one, in every format: 20 times the bytes, a tenth of the memory
// more at most, of which the trajectory is a part. STILLMESH_BAG_ROUNDS=1500 makes it 1500 times, 10 GB of .db3; 4000
// 10 GB and more of each.
TEST(BagProgram, MemoryDoesNotGrowWithTheBag) {
    const Room room({.width = 640, .height = 480});
    const char* const given = std::getenv("STILLMESH_BAG_ROUNDS");
    const int rounds = std::max(given != nullptr ? std::atoi(given) : 0, 20);
    for (const std::string format : {"ros1 --packing lz4", "db3", "mcap --packing zstd"}) {
        double peak_bytes[2] = {};
        std::uintmax_t size_bytes[2] = {};
        for (const bool is_long : {false, true}) {
            const std::string bag = room.path("bag");
            std::filesystem::remove(bag);
            const int times = is_long ? rounds : 1;
            const std::string laps = " --rounds " + std::to_string(times) + " --lap-ns 266666664";
            size_bytes[is_long] = std::filesystem::file_size(room.bag("bag", "--format " + format + laps));
            const Answer answer = stillmesh_says("run --json --replay " + bag);
            EXPECT_EQ(word_after(answer.text, "frames"), std::to_string(8 * times)) << answer.text;
            peak_bytes[is_long] = std::atof(word_after(answer.text, "peak_resident_bytes").c_str());
        }
        EXPECT_GT(size_bytes[1], 18 * size_bytes[0]);
        EXPECT_GT(size_bytes[1], std::uintmax_t{format == "db3" ? 125U : 50U} << 20U);
        EXPECT_GT(peak_bytes[0], 1e6);
        EXPECT_LT(peak_bytes[1], 1.1 * peak_bytes[0]) << format;
        std::printf("%s: %.1f MiB and %.1f MiB of bag, peak %.1f and %.1f MiB\n", format.c_str(),
                    static_cast<double>(size_bytes[0]) / 1048576, static_cast<double>(size_bytes[1]) / 1048576,
                    peak_bytes[0] / 1048576, peak_bytes[1] / 1048576);
    }
}

}  // namespace
}  // namespace stillmesh::bag_run_test
