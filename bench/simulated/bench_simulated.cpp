// Time to render one 640x480 frame, colour, depth, mask and truth, on one core: at most 60 ms is the promise.
#include <benchmark/benchmark.h>

#include "hal/simulated/simulated_camera.hpp"

namespace {

using namespace stillmesh;

void render(benchmark::State& state, const char* scene) {
    SimulatedCamera camera({.scene = scene});
    Frame frame;
    if (camera.open() != Status::kOk) {
        state.SkipWithError("cannot open the scene");
        return;
    }
    for (auto _ : state) {
        if (camera.poll(frame) != Status::kOk) {  // the end: once more from the start
            state.PauseTiming();
            const bool is_good = camera.open() == Status::kOk && camera.poll(frame) == Status::kOk;
            state.ResumeTiming();
            if (!is_good) {
                state.SkipWithError("cannot reopen the scene");
                break;
            }
        }
        benchmark::DoNotOptimize(frame.colour.data[0]);
    }
}

}  // namespace

int main(int argc, char** argv) {
    for (const SimulatedScene& scene : simulated_scenes()) {
        benchmark::RegisterBenchmark(scene.name, render, scene.name)->Unit(benchmark::kMillisecond);
    }
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
}
