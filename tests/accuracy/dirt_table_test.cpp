#include "bench/accuracy/dirt_table.hpp"

#include <gtest/gtest.h>

#include <set>

#include "bench/accuracy/gate.hpp"
#include "bench/accuracy/results.hpp"

namespace stillmesh::accuracy::dirt_table_test {
namespace {

Result run_of(const std::string& dirt, std::uint64_t seed, double ate_m) {
    Result out;
    out.scene = "walking_xyz";
    out.seed = seed;
    out.variant = "on";
    out.measures.frames = 10;
    out.measures.tracked = 6;
    out.measures.unsure = 3;
    out.measures.ends_with_pose = true;
    out.measures.ate_m = ate_m;
    out.dirt = dirt;
    return out;
}

// Promise: every effect is run alone and left out, clean and all are there, and no two runs are alike.
TEST(DirtTable, RunsEveryEffect) {
    std::set<std::string> names, texts;
    for (const DirtRun& run : dirt_runs()) {
        EXPECT_TRUE(names.insert(run.name).second) << run.name;
        EXPECT_TRUE(texts.insert(dirt_text(run.dirt)).second) << run.name;
    }
    EXPECT_EQ(names.size(), 2 * kDirtCount + 2);
    EXPECT_TRUE(names.contains("clean") && names.contains("all but shake") && names.contains("jpeg"));
    EXPECT_TRUE(is_clean(dirt_runs()[0].dirt));
}

// Promise: rows are means over the runs that have an error, the worst of them, shares of frames, and lost runs.
TEST(DirtTable, TableByHand) {
    const std::vector<Result> results = {run_of("clean", 1, 0.001), run_of("clean", 2, 0.003), run_of("all", 1, 0.02),
                                         run_of("shake", 1, 0.004), run_of("shake", 2, -1)};
    const std::string table = dirt_table(results);
    EXPECT_NE(
        table.find("| none; all | 0.0020 | 0.0030 | 60.0 % | 90.0 % | 0 | 0.0200 | 0.0200 | 60.0 % | 90.0 % | 0 |"),
        std::string::npos)
        << table;
    EXPECT_NE(table.find("| shake | 0.0040 | 0.0040 | 60.0 % | 90.0 % | 1 | | | | | |"), std::string::npos) << table;
}

// Promise: a run with dirt is no run of its scene's group, so that no bar holds for it; what it had is in its text, and
// text without it is clean.
TEST(DirtTable, DirtyRunsHaveNoBars) {
    const Result dirty = run_of("shake=1", 1, 0.5);
    EXPECT_EQ(group_of(dirty), Group::kDirty);
    EXPECT_EQ(ate_bar(dirty), 0.0);
    Result read;
    ASSERT_TRUE(from_text(to_text(dirty), read));
    EXPECT_EQ(read.dirt, "shake=1");
    std::string text = to_text(run_of("", 1, 0.5));
    text.erase(text.find("\"dirt\":\"\","), std::string("\"dirt\":\"\",").size());
    ASSERT_TRUE(from_text(text, read)) << text;
    EXPECT_EQ(read.dirt, "");
    EXPECT_EQ(group_of(read), Group::kWalking);
    read.scene = "real_walking_xyz";
    EXPECT_EQ(group_of(read), Group::kDirty);
}

}  // namespace
}  // namespace stillmesh::accuracy::dirt_table_test
