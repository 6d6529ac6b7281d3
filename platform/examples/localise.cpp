// Yesterday a map was made and saved; today the camera is found in it, and its poses are those of the map.
//   localise VOCABULARY        the file that is installed: by its words a place is found again
#include <cstdio>
#include <fstream>
#include <iterator>
#include <vector>

#include "engine/engine.hpp"
#include "platform/library/transform.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "wall.hpp"

using namespace stillmesh;

// A map as the bytes of a file.
static std::vector<char> saved_map(Engine& engine, const Limits& limits) {
    MemoryBlock workspace;
    if (!workspace.allocate(map_copy_bytes(limits)) || engine.begin_map_copy(workspace.bytes()) != Status::kOk)
        return {};
    while (engine.step_map_copy(20000) == Progress::kWorking) continue;  // in slices between frames, if it has to be
    std::vector<char> file, piece(65536);
    MapFileWriter writer(workspace.bytes());
    while (const std::size_t size = writer.next(std::as_writable_bytes(std::span(piece))))
        file.insert(file.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(size));
    return file;
}

int main(int count, char** words) {
    std::ifstream source(count > 1 ? words[1] : "", std::ios::binary);
    const std::vector<char> vocabulary{std::istreambuf_iterator<char>(source), {}};
    const Limits limits = Limits::pocket();
    MemoryBlock block;  // today's engine takes the place of yesterday's
    if (!block.allocate(bytes_needed(limits))) return 1;
    const auto made = Engine::create(block.bytes(), limits, Configuration::for_limits(limits), Wall::kCamera,
                                     cpu_kernels(), nullptr, std::as_bytes(std::span(vocabulary)));
    if (!made.is_ok()) return 1;
    Engine& engine = *made.value();
    Wall wall;
    for (std::uint32_t i = 0; i < 40; ++i) {
        if (engine.submit(wall.frame(i, 6 * i)) != Status::kOk) return 1;
        engine.step(20000);
    }
    const std::vector<char> map = saved_map(engine, limits);
    MapFileProblem problem;
    if (engine.load_map(std::as_bytes(std::span(map)), MapUse::kLocalise, problem) != Status::kOk) return 1;
    for (std::uint32_t i = 0; i < 20; ++i) {
        Frame frame = wall.frame(i, 100 + 6 * i);
        frame.time_ns += 1'000'000'000'000;
        if (engine.submit(frame) != Status::kOk) return 1;
        engine.step(20000);
        if (engine.pose().state == PoseState::kNone || i % 4 != 0) continue;
        std::printf("frame %u: %s, %.3f m along the wall of the map\n", i, pose_state_name(engine.pose().state),
                    map_from_camera(engine.pose()).translation_m[0]);
    }
}
