// MCAP files of another hand: the format's own library, which npm installs into the build folder. Where npm or its
// registry cannot be reached this fails, and does not skip; CI leaves it to `./run test -L longest`.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/bag/bag_maker.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh::foreign_mcap_test {
namespace {

[[nodiscard]] std::string hash_in(const std::string& text) {
    const std::size_t at = text.find("\"state_hash\"");
    return at == std::string::npos ? "" : text.substr(text.find('"', at + 12) + 1, 16);
}

void install() {
    const std::string folder = STILLMESH_NPM_FOLDER;
    const std::string command = "cp " STILLMESH_FOREIGN "/* " + folder + " && cd " + folder +
                                " && timeout 300 npm install --no-audit --no-fund --silent";
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
}

// Promise: what the library of the format's makers writes plays as the folder it was made from.
TEST(ForeignMcap, PlaysAsTheFolder) {
    const std::string folder = STILLMESH_NPM_FOLDER;
    ASSERT_NO_FATAL_FAILURE(install());
    const test::Room room;
    const test::Answer from_folder = test::stillmesh_says("run --json --replay " + room.folder());
    ASSERT_EQ(from_folder.code, 0) << from_folder.text;
    const std::string dump = room.bag("dump", "--format dump");
    for (const char* const packing : {"none", "lz4", "zstd"}) {
        const std::string bag = room.path(std::string(packing) + ".mcap");
        const std::string write = "cd " + folder + " && timeout 300 node write_mcap.mjs " + dump + " " + bag + " " +
                                  packing + " " STILLMESH_BAG_PYTHON;
        ASSERT_EQ(std::system(write.c_str()), 0) << write;
        const test::Answer answer = test::stillmesh_says("run --json --replay " + bag);
        EXPECT_EQ(answer.code, 0) << answer.text;
        EXPECT_EQ(hash_in(answer.text).size(), 16U);
        EXPECT_EQ(hash_in(answer.text), hash_in(from_folder.text)) << packing << ": " << answer.text;
    }
}

// Promise: that library finds every message of a bag that was recorded here by its index, with its topic, type, time
// and length.
TEST(ForeignMcap, ReadsWhatIsRecorded) {
    ASSERT_NO_FATAL_FAILURE(install());
    const test::Room room;
    const std::string bag = room.path("frames.mcap");
    ASSERT_EQ(test::stillmesh_says("run --json --replay " + room.folder() + " --record-frames " + bag).code, 0);
    const std::string said = room.path("said.txt");
    const std::string read =
        std::string("cd ") + STILLMESH_NPM_FOLDER + " && timeout 300 node read_mcap.mjs " + bag + " >" + said;
    ASSERT_EQ(std::system(read.c_str()), 0) << read;
    std::ifstream stream(said);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const std::size_t pixels = 320 * 240;
    for (const test::KeptFrame& frame : room.frames()) {
        const std::string time = " " + std::to_string(frame.time_ns) + " ";
        EXPECT_NE(text.find("/camera/color/camera_info sensor_msgs/msg/CameraInfo" + time), std::string::npos) << text;
        EXPECT_NE(text.find("/camera/color/image_raw sensor_msgs/msg/Image" + time + std::to_string(pixels + 72)),
                  std::string::npos)
            << text;
        EXPECT_NE(text.find("/camera/aligned_depth_to_color/image_raw sensor_msgs/msg/Image" + time +
                            std::to_string(2 * pixels + 72)),
                  std::string::npos)
            << text;
    }
    EXPECT_NE(text.find("messages 24"), std::string::npos) << text;
}

}  // namespace
}  // namespace stillmesh::foreign_mcap_test
