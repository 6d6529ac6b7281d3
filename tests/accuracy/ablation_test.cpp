#include "bench/accuracy/ablation.hpp"

#include <gtest/gtest.h>

#include <set>

#include "engine/tuned_engine.hpp"

namespace stillmesh::accuracy::ablation_test {
namespace {

Result run_of(const std::string& variant, std::uint64_t seed, double ate_m) {
    Result out;
    out.scene = "room";
    out.seed = seed;
    out.variant = variant;
    out.measures.frames = 10;
    out.measures.tracked = 9;
    out.measures.wrong_tracked = 1;
    out.measures.ends_with_pose = true;
    out.measures.ate_m = ate_m;
    return out;
}

// Promise: every rule is switched off by numbers that exist and that the engine takes, and no two have one name.
TEST(Ablation, EveryRuleHasASwitch) {
    std::set<std::string> names;
    for (const Rule& rule : rules()) {
        EXPECT_TRUE(names.insert(rule.name).second) << rule.name;
        Parameters parameters;
        std::string message;
        for (const std::string& setting : split(rule.off)) {
            EXPECT_TRUE(set_parameter(parameters, setting, message)) << message;
        }
        EXPECT_EQ(validate(parameters, Limits::room()).key, nullptr) << rule.name;
    }
}

// Promise: the loss is the geometric mean of the ratios and its error theirs; the worst loss comes first; what was not
// run has no row; a run without an error counts as lost.
TEST(Ablation, TableByHand) {
    const char* const first = rules()[0].name;
    const char* const second = rules()[1].name;
    const std::vector<Result> results = {run_of("on", 1, 0.001),   run_of("on", 2, 0.002),  run_of("on", 3, 0.004),
                                         run_of(first, 1, 0.001),  run_of(first, 2, 0.002), run_of(first, 3, -1),
                                         run_of(second, 1, 0.002), run_of(second, 2, 0.001)};
    const std::string table = ablation_table(results, "on");
    EXPECT_NE(table.find("| 2 | 0.0015 | 0.0015 | +0.0 % | 0.0 % | 90.0 % | 3 | 1 |"), std::string::npos) << table;
    EXPECT_NE(table.find("| 2 | 0.0015 | 0.0015 | +0.0 % | 69.3 % | 90.0 % | 2 | 0 |"), std::string::npos) << table;
    EXPECT_EQ(table.find(rules()[2].name), std::string::npos);
    const std::vector<Result> worse = {run_of("on", 1, 0.001), run_of(first, 1, 0.002), run_of(second, 1, 0.003)};
    const std::string sorted = ablation_table(worse, "on");
    EXPECT_LT(sorted.find(second), sorted.find(first));
    EXPECT_NE(sorted.find("+100.0 %"), std::string::npos) << sorted;
}

}  // namespace
}  // namespace stillmesh::accuracy::ablation_test
