// The engine alone on frames that are ready in memory: what instructions are counted on (cost.py).
//   engine_workload FRAMES room|pocket auto|plain|sse2 [VOCABULARY|- [MAP]]      FRAMES: of workload_frames
// Markers say when the engine begins and ends each stage, and when a frame is done. A marker is a system call that does
// nothing: closing a file that cannot be open, whose number says which stage.
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/board/hostile_scenes.hpp"

namespace {

constexpr std::uint32_t kMarker = 0x57110000U;
constexpr std::uint32_t kOutside = 0;      // whatever is not the engine
constexpr std::uint32_t kBetween = 1;      // submit, outside of its stages
constexpr std::uint32_t kBackground = 2;   // step
constexpr std::uint32_t kFrameDone = 3;    // outside, and the counts are one frame's
constexpr std::uint32_t kFirstStage = 10;  // and the others in order

void mark(std::uint32_t what) noexcept {
    static_cast<void>(::syscall(SYS_close, static_cast<int>(kMarker + what)));
}

}  // namespace

int main(int argc, char** argv) {
    using namespace stillmesh;
    StoredScene scene;
    if (argc < 4 || !read_scene(argv[1], scene)) return 2;
    const bool is_pocket = std::string(argv[2]) == "pocket";
    const std::string kernels_name = argv[3];
    std::vector<std::byte> vocabulary, map;
    if (argc > 4 && std::string(argv[4]) != "-") vocabulary = bytes_of(argv[4]);
    if (argc > 5) map = bytes_of(argv[5]);
    const Kernels* kernels = &cpu_kernels();
    if (kernels_name == "plain") kernels = &plain_kernels();
    if (kernels_name == "sse2") kernels = sse2_kernels();
    if (kernels == nullptr) return 2;
    const Limits limits = is_pocket ? Limits::pocket() : Limits::room();
    Configuration configuration;
    if (configuration.features.count > limits.features_max) configuration.features.count = limits.features_max;
    const std::size_t size = bytes_needed(limits);
    void* const memory = std::aligned_alloc(4096, (size + 4095) / 4096 * 4096);
    const Result<Engine*> made = Engine::create({static_cast<std::byte*>(memory), size}, limits, configuration,
                                                scene.camera, *kernels, nullptr, vocabulary);
    if (!made.is_ok()) return 2;
    Engine& engine = *made.value();
    MapFileProblem problem;
    if (!map.empty() && engine.load_map(map, MapUse::kContinue, problem) != Status::kOk) return 2;
    const StageObserver observer{[](void*, Stage stage, bool is_begin) noexcept {
                                     mark(is_begin ? kFirstStage + static_cast<std::uint32_t>(stage) : kBetween);
                                 },
                                 nullptr};
    engine.set_stage_observer(observer);
    std::string states;
    for (std::size_t i = 0; i < scene.frames.size(); ++i) {
        const Frame frame = frame_of(scene.frames[i], scene.camera, static_cast<std::int64_t>(i) * kFrame_ns);
        mark(kBetween);
        const Status status = engine.submit(frame);
        mark(kBackground);
        static_cast<void>(engine.step(configuration.schedule.units_per_frame));
        mark(kFrameDone);
        if (status != Status::kOk) return 1;
        states += "npuT"[static_cast<std::uint32_t>(engine.pose().state)];
    }
    mark(kOutside);
    const EngineStatistics said = engine.statistics();
    std::printf("kernels %s\nkeyframes %llu\nhash %016llx\nblock %zu\nstates %s\n", kernels->name,
                static_cast<unsigned long long>(said.keyframes_made),
                static_cast<unsigned long long>(engine.state_hash()), size, states.c_str());
    std::free(memory);
    return 0;
}
