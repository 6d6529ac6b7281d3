// Writes what engine_workload reads, on this machine: rendering under an emulator would take longer than the engine.
//   workload_frames SCENE FRAMES FILE                     a scene of the simulated camera, or a hostile one
//   workload_frames --map WORLD room|pocket VOCABULARY FILE   the map of a world that hostile scenes begin in, full
//   workload_frames                                       the hostile scenes: name, world, sentence
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>

#include "engine/engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/board/hostile_scenes.hpp"

namespace stillmesh {
namespace {

// Memory as an engine wants it.
class Block {
public:
    explicit Block(std::size_t size) : size_(size), memory_(std::aligned_alloc(4096, (size + 4095) / 4096 * 4096)) {}
    [[nodiscard]] std::span<std::byte> span() const { return {static_cast<std::byte*>(memory_.get()), size_}; }

private:
    std::size_t size_;
    struct Free {
        void operator()(void* memory) const noexcept { std::free(memory); }
    };
    std::unique_ptr<void, Free> memory_;
};

bool save_map(Engine& engine, const Limits& limits, const char* file) {
    const Block workspace(map_copy_bytes(limits));
    if (engine.begin_map_copy(workspace.span()) != Status::kOk) return false;
    while (engine.step_map_copy(100'000) == Progress::kWorking) {
    }
    std::FILE* const out = std::fopen(file, "wb");
    if (out == nullptr) return false;
    MapFileWriter writer(workspace.span());
    std::byte piece[4096];
    while (const std::size_t size = writer.next(piece)) static_cast<void>(std::fwrite(piece, 1, size, out));
    const bool is_whole = std::ferror(out) == 0;
    return std::fclose(out) == 0 && is_whole;
}

bool write_map(const std::string& world, const Limits& limits, const char* vocabulary_file, const char* file) {
    const std::vector<std::byte> vocabulary = bytes_of(vocabulary_file);
    const Block block(bytes_needed(limits));
    Configuration configuration;
    if (configuration.features.count > limits.features_max) configuration.features.count = limits.features_max;
    Engine* engine = nullptr;
    const bool is_known =
        visit_world(world, 640, 480, [&](const CameraModel& camera, const StoredFrame& frame, std::int64_t time_ns) {
            if (engine == nullptr) {
                const Result<Engine*> made =
                    Engine::create(block.span(), limits, configuration, camera, cpu_kernels(), nullptr, vocabulary);
                if (!made.is_ok()) return false;
                engine = made.value();
            }
            if (engine->submit(frame_of(frame, camera, time_ns)) != Status::kOk) return false;
            static_cast<void>(engine->step(configuration.schedule.units_per_frame));
            return engine->statistics().keyframes_forgotten == 0;
        });
    if (!is_known || engine == nullptr) return false;
    const EngineStatistics said = engine->statistics();
    std::printf("%s: %llu frames, %u keyframes, %u points\n", world.c_str(),
                static_cast<unsigned long long>(said.frames), said.keyframes.size, said.map_points.size);
    return save_map(*engine, limits, file);
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    using namespace stillmesh;
    if (argc == 1) {
        for (const HostileScene& scene : hostile_scenes())
            std::printf("%s\t%s\t%s\n", scene.name, scene.world, scene.sentence);
        return 0;
    }
    if (argc == 6 && std::string(argv[1]) == "--map")
        return write_map(argv[2], std::string(argv[3]) == "pocket" ? Limits::pocket() : Limits::room(), argv[4],
                         argv[5])
                   ? 0
                   : 1;
    StoredScene scene;
    if (argc != 4 ||
        !make_scene(argv[1], static_cast<std::uint32_t>(std::strtoul(argv[2], nullptr, 10)), 640, 480, scene))
        return 2;
    return write_scene(scene, argv[3]) ? 0 : 1;
}
