// The heap of the whole program, all threads, in the steady state: recordings and simulated cameras.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/heap_trace.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::heap_test {
namespace {

constexpr long kFrom = 40, kTo = 100;

[[nodiscard]] test::HeapTrace::Calls calls_of(const std::string& arguments) {
    const test::TemporaryFolder scratch;
    const test::HeapTrace trace(STILLMESH_HEAP_TRACE_MODULE, scratch.path("heap"), kFrom, kTo);
    test::Program run(STILLMESH_PROGRAM, "",
                      "run " + arguments + " --frames 105 --limits pocket --json --trajectory " +
                          scratch.path("path.txt") + " --poses " + scratch.path("poses.jsonl") + " --poses unix:" +
                          scratch.path("poses.sock") + " --mavlink udp:127.0.0.1:9",  // nobody listens
                      scratch);
    EXPECT_GE(run.wait(120'000), 0) << run.err();
    return trace.calls();
}

// Records of a run grow by doubling until they are full: of 60 frames, three such vectors take memory once each.
constexpr std::uint64_t kGrowthMax = 3;

// Promise: from a simulated camera and from a recording the program calls the heap at no frame, in no thread: not for
// images, not for what it writes, not while it records what rerun needs and saves its map.
TEST(Heap, NoCallAFrame) {
    const char* const data = std::getenv("STILLMESH_TEST_DATA");
    std::vector<std::string> inputs{"--simulate sitting_xyz:1"};
#ifdef STILLMESH_HAS_VIEW
    inputs.emplace_back("--simulate sitting_xyz:1 --view 0");  // nobody looks
#endif
    if (data != nullptr) {
        const std::string replay = std::string("--replay ") + data + "/fr1_rpy_a";
        inputs.push_back(replay);
        inputs.push_back(replay + " --realtime");
    }
    for (const std::string& input : inputs) {
        const test::HeapTrace::Calls calls = calls_of(input);
        ASSERT_TRUE(calls.is_complete) << input;
        std::uint64_t all = 0;
        for (const auto& [module, count] : calls.by_module) all += count;
        EXPECT_LE(all, kGrowthMax) << input << ", calls and stacks:\n" << calls.stacks;
    }
}

}  // namespace
}  // namespace stillmesh::heap_test
