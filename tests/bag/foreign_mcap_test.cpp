// MCAP files of another hand: the format's own library, which npm installs into the build folder. Where npm or its
// registry cannot be reached this fails, and does not skip; CI leaves it to `./run test -L longest`.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "tests/bag/bag_maker.hpp"
#include "tests/support/answer.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] std::string hash_in(const std::string& text) {
    const std::size_t at = text.find("\"state_hash\"");
    return at == std::string::npos ? "" : text.substr(text.find('"', at + 12) + 1, 16);
}

// Promise: what the library of the format's makers writes plays as the folder it was made from.
TEST(ForeignMcap, PlaysAsTheFolder) {
    const std::string folder = STILLMESH_NPM_FOLDER;
    const std::string install = "cp " STILLMESH_FOREIGN "/* " + folder + " && cd " + folder +
                                " && timeout 300 npm install --no-audit --no-fund --silent";
    ASSERT_EQ(std::system(install.c_str()), 0) << install;
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

}  // namespace
}  // namespace stillmesh
