#include "bench/accuracy/gate.hpp"

#include <gtest/gtest.h>

#include "bench/accuracy/results.hpp"

namespace stillmesh::accuracy {
namespace {

Result good(const std::string& scene, const std::string& variant = "on") {
    Result result{scene, 1, false, variant, {}};
    Measures& m = result.measures;
    m.frames = m.tracked = m.judged_tracked = m.right = m.right_tracked = m.nees_frames = 1000;
    m.ends_with_pose = true;
    m.ate_m = variant == "off" ? 0.16 : 0.02;
    m.nees_first_sum = 6000;
    return result;
}

std::vector<Result> all_good() {
    return {good("static_xyz"),  good("sitting_rpy"),   good("walking_xyz"), good("walking_xyz", "off"),
            good("trolley_xyz"), good("trolley_first"), good("rearranged")};
}

// Promise: runs at the bars pass every gate.
TEST(Gate, PassesAtTheBars) {
    std::vector<Result> results = all_good();
    results[2].measures.ate_m = 0.04;
    results[4].measures.ate_m = 0.08;
    results[0].measures.tracked = 980;
    results[0].measures.none = 20;
    results[0].measures.hole_longest = 20;
    results[1].measures.wrong_tracked = 5;  // of 5000
    results[1].measures.right_tracked = 500;
    results[0].measures.nees_first_sum = 12000;
    results[5].measures.ate_m = 1;  // trolley_first has no bar
    results[5].measures.wrong_tracked = 1000;
    EXPECT_TRUE(failures_of(results, gate_names()).empty());
}

// Promise: each gate fails just beyond its bar, with its own name first.
TEST(Gate, FailsBeyondEachBar) {
    struct Story {
        const char* gate;
        std::size_t result;
        void (*spoil)(Measures&);
    };
    const Story stories[] = {
        {"static", 0, [](Measures& m) { m.ate_m = 0.0201; }},
        {"sitting", 1, [](Measures& m) { m.ate_m = 0.0201; }},
        {"walking", 2,
         [](Measures& m) {
             m.ate_m = 0.0401;
             m.wrong_tracked = 0;
         }},
        {"trolley", 4, [](Measures& m) { m.ate_m = 0.0801; }},
        {"rearranged", 6, [](Measures& m) { m.ate_m = 0.0201; }},
        {"static", 0,
         [](Measures& m) {
             m.tracked = 979;
             m.none = 21;
         }},
        {"sitting", 1, [](Measures& m) { m.hole_longest = 31; }},
        {"trolley", 4, [](Measures& m) { m.ate_m = -1; }},
        {"tracked", 1, [](Measures& m) { m.wrong_tracked = 6; }},
        {"right", 1, [](Measures& m) { m.right_tracked = 499; }},
        {"nees", 0, [](Measures& m) { m.nees_first_sum = 12001; }},
        {"nees", 0, [](Measures& m) { m.nees_first_sum = 2999; }},
        {"nees", 0, [](Measures& m) { m.covariance_bad = 1; }},
        {"region", 3, [](Measures& m) { m.ate_m = 0.0799; }},
    };
    for (const Story& story : stories) {
        std::vector<Result> results = all_good();
        story.spoil(results[story.result].measures);
        const auto failures = failures_of(results, gate_names());
        ASSERT_FALSE(failures.empty()) << story.gate;
        EXPECT_TRUE(failures.front().starts_with(std::string(story.gate) + ":")) << failures.front();
        EXPECT_FALSE(failures_of(results, {story.gate}).empty());
    }
}

// Promise: a gate that is asked for by name and has nothing to look at fails.
TEST(Gate, NothingToLookAtFails) {
    for (const std::string& name : gate_names()) EXPECT_EQ(failures_of({}, {name}).size(), 1U) << name;
}

// Promise: a real recording is held against its own bar, wherever its folder lies.
TEST(Gate, RecordingsHaveTheirOwnBars) {
    Result result = good("fr1_rpy_a_walking");
    result.is_recording = true;
    result.measures.ate_m = 0.08;
    EXPECT_TRUE(failures_of({result}, {"recordings"}).empty());
    result.scene = "fr1_rpy_a";
    EXPECT_EQ(failures_of({result}, {"recordings"}).size(), 1U);
}

// Promise: results written and read again are the same; other text is refused.
TEST(Gate, ResultsSurviveText) {
    std::vector<Result> results = all_good();
    results[1].measures.nees_fit_sum = 0.1 + 0.2;
    std::vector<Result> again;
    ASSERT_TRUE(from_text(to_text(results), again));
    ASSERT_EQ(again.size(), results.size());
    EXPECT_EQ(to_text(again), to_text(results));
    EXPECT_EQ(again[1].measures.nees_fit_sum, results[1].measures.nees_fit_sum);
    EXPECT_FALSE(from_text("[{}]", again));
    EXPECT_FALSE(from_text("", again));
}

}  // namespace
}  // namespace stillmesh::accuracy
