#include "bench/accuracy/runs.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "bench/accuracy/results.hpp"
#include "bench/accuracy/workers.hpp"

namespace stillmesh::accuracy::runs_test {
namespace {

namespace fs = std::filesystem;

std::string without_times(Result result) {
    result.measures.median_ms = result.measures.p99_ms = 0;
    return to_text(result);
}

// Promise: frames kept on disk give what rendered ones give, engines side by side do not disturb each other, and a
// trajectory holds every pose given out.
TEST(Runs, CachedFramesAndNeighboursChangeNothing) {
    const fs::path folder = fs::temp_directory_path() / ("stillmesh_runs_" + std::to_string(getpid()));
    fs::create_directories(folder);
    const Input input{"walking_xyz", 3, false, 12};
    Variant on{"on", Configuration::indoor()};
    Variant off = on;
    off.name = "off";
    off.configuration.region.is_enabled = false;
    std::string message;
    std::uint32_t frames = 0;
    const auto count = [&frames](std::uint32_t n) { frames += n; };
    std::vector<Result> alone, rendered, cached;
    ASSERT_TRUE(run(input, {on}, {}, count, alone, message)) << message;
    ASSERT_TRUE(run(input, {off, on}, {folder.string(), folder.string()}, count, rendered, message)) << message;
    std::size_t kept = 0;
    for (const auto& entry : fs::directory_iterator(folder)) kept += entry.path().extension() == ".frames";
    EXPECT_EQ(kept, 1U);
    ASSERT_TRUE(run(input, {off, on}, {"", folder.string()}, count, cached, message)) << message;
    EXPECT_EQ(frames, 36U);
    ASSERT_EQ(alone.size(), 1U);
    ASSERT_EQ(rendered.size(), 2U);
    ASSERT_EQ(cached.size(), 2U);
    EXPECT_EQ(without_times(alone[0]), without_times(rendered[1]));
    EXPECT_EQ(without_times(rendered[0]), without_times(cached[0]));
    EXPECT_EQ(without_times(rendered[1]), without_times(cached[1]));
    EXPECT_GT(alone[0].measures.still, 0U);
    EXPECT_GT(alone[0].measures.moving, 0U);
    Trajectory trajectory;
    ASSERT_EQ(read_trajectory((folder / "walking_xyz_3_on.txt").string(), trajectory, message), Status::kOk);
    EXPECT_EQ(trajectory.size(), alone[0].measures.tracked + alone[0].measures.unsure);
    fs::remove_all(folder);
}

// Promise: a run that cannot start is a named failure, and the others go on.
TEST(Runs, FailedRunIsNamed) {
    const std::vector<Input> inputs{{"/no/such/recording", 0, true, 0}, {"static_xyz", 1, false, 4}};
    const Outcome outcome = run_all(inputs, {{"on", Configuration::indoor()}}, {}, 2);
    ASSERT_EQ(outcome.failures.size(), 1U);
    EXPECT_TRUE(outcome.failures[0].starts_with("/no/such/recording: ")) << outcome.failures[0];
    ASSERT_EQ(outcome.results.size(), 1U);
    EXPECT_EQ(outcome.results[0].measures.frames, 4U);
}

// Promise: parameters are set by the names of the configuration; unknown keys, ranges and text are refused by name.
TEST(Runs, ParametersByName) {
    Parameters configuration;
    std::string message;
    EXPECT_TRUE(set_parameter(configuration, "keyframes.gap_min=5", message));
    EXPECT_EQ(configuration.keyframes.gap_min, 5U);
    EXPECT_TRUE(set_parameter(configuration, "region.is_enabled=false", message));
    EXPECT_FALSE(configuration.region.is_enabled);
    EXPECT_FALSE(set_parameter(configuration, "keyframes.gap_min=0", message));
    EXPECT_NE(message.find("keyframes.gap_min"), std::string::npos);
    EXPECT_FALSE(set_parameter(configuration, "no.such_key=1", message));
    EXPECT_NE(message.find("no.such_key"), std::string::npos);
    EXPECT_FALSE(set_parameter(configuration, "keyframes.gap_min", message));
    EXPECT_FALSE(set_parameter(configuration, "keyframes.gap_min=x", message));
}

}  // namespace
}  // namespace stillmesh::accuracy::runs_test
