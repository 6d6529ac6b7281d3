// What local adjustment costs: whole jobs, one iteration, and the largest slice at a budget of one unit.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <vector>

#include "engine/adjust/local_adjustment.hpp"
#include "tests/adjust/window.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

test::WindowOptions options_of(const benchmark::State& state) {
    test::WindowOptions options;
    options.free = static_cast<std::uint32_t>(state.range(0));
    options.fixed = static_cast<std::uint32_t>(state.range(1));
    options.points = static_cast<std::uint32_t>(state.range(2));
    options.observations = static_cast<std::uint32_t>(state.range(3));
    options.outlier_share = 0.02;
    return options;
}

void sizes(benchmark::internal::Benchmark* bench) {
    bench->ArgNames({"free", "fixed", "points", "observations"});
    bench->Args({4, 4, 400, 1600});
    bench->Args({10, 10, 1500, 8000});
    bench->Args({10, 10, 1500, 16000});
    bench->Args({20, 0, 1500, 8000});
    bench->Args({24, 24, 3000, 24000});
    bench->Unit(benchmark::kMillisecond);
}

// Two rounds with the defaults, from load to results.
void job(benchmark::State& state) {
    const test::Window window = make_window(options_of(state));
    test::InMemory<LocalAdjustment> adjustment(window.sizes());
    for (auto _ : state) {
        if (!window.load(*adjustment)) state.SkipWithError("refused");
        adjustment->start(AdjustmentOptions{});
        test::run_to_end(*adjustment);
    }
    state.counters["iterations"] = adjustment->summary().iterations;
    state.counters["units"] = static_cast<double>(adjustment->summary().units);
    state.counters["bytes"] = static_cast<double>(adjustment.used_bytes());
}
BENCHMARK(job)->Apply(sizes);

// One round that cannot converge: the time of eight iterations, divided.
void iteration(benchmark::State& state) {
    const test::Window window = make_window(options_of(state));
    test::InMemory<LocalAdjustment> adjustment(window.sizes());
    AdjustmentOptions options;
    options.iterations_max[0] = 8;
    options.iterations_max[1] = 0;
    options.cost_change_min = 0;
    double seconds = 0, iterations = 0, units = 0;
    for (auto _ : state) {
        if (!window.load(*adjustment)) state.SkipWithError("refused");
        adjustment->start(options);
        const std::clock_t begin = std::clock();  // of this process: others do not count
        test::run_to_end(*adjustment);
        seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
        iterations += adjustment->summary().iterations;
        units += static_cast<double>(adjustment->summary().units);
    }
    state.counters["ms_per_iteration"] = 1e3 * seconds / iterations;
    state.counters["ns_per_unit"] = 1e9 * seconds / units;
}
BENCHMARK(iteration)->Apply(sizes);

// The longest single piece. Every run has the same pieces, so the least time of each over the runs is the piece's own,
// without what the machine did meanwhile.
void longest_piece(benchmark::State& state) {
    const test::Window window = make_window(options_of(state));
    test::InMemory<LocalAdjustment> adjustment(window.sizes());
    std::vector<double> least_us;
    for (auto _ : state) {
        if (!window.load(*adjustment)) state.SkipWithError("refused");
        adjustment->start(AdjustmentOptions{});
        std::size_t piece = 0;
        Progress progress = Progress::kWorking;
        while (progress == Progress::kWorking) {
            WorkBudget budget(1);
            const auto begin = std::chrono::steady_clock::now();
            progress = adjustment->step(budget);
            const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
            if (piece == least_us.size()) least_us.push_back(took.count());
            least_us[piece] = std::min(least_us[piece], took.count());
            ++piece;
        }
    }
    state.counters["us"] = *std::max_element(least_us.begin(), least_us.end());
}
BENCHMARK(longest_piece)->Apply(sizes);

}  // namespace
}  // namespace stillmesh
