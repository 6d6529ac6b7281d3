// The engine alone on frames that are ready in memory: what instructions are counted on (cost.py).
//   engine_workload SCENE FRAMES room|pocket auto|plain|sse2
// The frames are rendered first; then markers say when the engine begins and ends each stage. A marker is a system call
// that does nothing: closing a file that cannot be open, whose number says which stage.
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/cpu_kernels.hpp"

namespace {

constexpr std::uint32_t kMarker = 0x57110000U;
constexpr std::uint32_t kOutside = 0;      // whatever is not the engine
constexpr std::uint32_t kBetween = 1;      // submit, outside of its stages
constexpr std::uint32_t kBackground = 2;   // step
constexpr std::uint32_t kFirstStage = 10;  // and the others in order

void mark(std::uint32_t what) noexcept {
    static_cast<void>(::syscall(SYS_close, static_cast<int>(kMarker + what)));
}

struct Held {
    stillmesh::Frame frame;
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
};

}  // namespace

int main(int argc, char** argv) {
    using namespace stillmesh;
    if (argc < 5) return 2;
    const std::uint32_t count = static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10));
    const bool is_pocket = std::string(argv[3]) == "pocket";
    const std::string kernels_name = argv[4];
    SimulationOptions options;
    options.scene = argv[1];
    options.frames = count;
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) return 2;
    std::vector<Held> frames(count);
    for (Held& held : frames) {
        if (camera.poll(held.frame) != Status::kOk) return 2;
        const auto& colour = held.frame.colour;
        const auto& depth = held.frame.depth;
        for (std::uint32_t y = 0; y < colour.height; ++y)
            held.colour.insert(held.colour.end(), colour.row(y), colour.row(y) + colour.width);
        for (std::uint32_t y = 0; y < depth.height; ++y)
            held.depth.insert(held.depth.end(), depth.row(y), depth.row(y) + depth.width);
        held.frame.colour = {held.colour.data(), colour.width, colour.height, colour.width};
        held.frame.depth = {held.depth.data(), depth.width, depth.height, depth.width};
    }
    const Kernels* kernels = &cpu_kernels();
    if (kernels_name == "plain") kernels = &plain_kernels();
    if (kernels_name == "sse2") kernels = sse2_kernels();
    if (kernels == nullptr) return 2;
    const Limits limits = is_pocket ? Limits::pocket() : Limits::room();
    Configuration configuration;
    if (configuration.features.count > limits.features_max) configuration.features.count = limits.features_max;
    const std::size_t size = bytes_needed(limits);
    void* const memory = std::aligned_alloc(4096, (size + 4095) / 4096 * 4096);
    const Result<Engine*> made =
        Engine::create({static_cast<std::byte*>(memory), size}, limits, configuration, camera.info().model, *kernels);
    if (!made.is_ok()) return 2;
    Engine& engine = *made.value();
    const StageObserver observer{[](void*, Stage stage, bool is_begin) noexcept {
                                     mark(is_begin ? kFirstStage + static_cast<std::uint32_t>(stage) : kBetween);
                                 },
                                 nullptr};
    engine.set_stage_observer(observer);
    for (const Held& held : frames) {
        mark(kBetween);
        const Status status = engine.submit(held.frame);
        mark(kBackground);
        static_cast<void>(engine.step(configuration.schedule.units_per_frame));
        mark(kOutside);
        if (status != Status::kOk) return 1;
    }
    std::printf("kernels %s\nkeyframes %llu\nhash %016llx\nblock %zu\n", kernels->name,
                static_cast<unsigned long long>(engine.statistics().keyframes_made),
                static_cast<unsigned long long>(engine.state_hash()), size);
    std::free(memory);
    return 0;
}
