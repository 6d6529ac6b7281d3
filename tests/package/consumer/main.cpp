// A program of somebody who installed libstillmesh-dev: a camera moves along a patterned wall, ten frames, a pose each.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "engine/engine.hpp"
#include "platform/library/transform.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"

int main() {
    using namespace stillmesh;
    const Limits limits = Limits::tiny();
    CameraModel camera{};
    camera.width = limits.image_width_max;
    camera.height = limits.image_height_max;
    camera.fx = camera.fy = 130;
    camera.cx = camera.width / 2.0;
    camera.cy = camera.height / 2.0;
    MemoryBlock block;
    if (!block.allocate(bytes_needed(limits))) return 1;
#ifdef VOCABULARY
    if (std::FILE* const file = std::fopen(VOCABULARY, "rb"); file == nullptr || std::fclose(file) != 0) {
        std::printf("no vocabulary: %s\n", VOCABULARY);
        return 1;
    }
#endif
    const Result<Engine*> made =
        Engine::create(block.bytes(), limits, Configuration::for_limits(limits), camera, cpu_kernels());
    if (!made.is_ok()) {
        std::printf("not created: %s\n", status_name(made.status()));
        return 1;
    }
    Engine& engine = *made.value();
    std::vector<std::uint8_t> grey(std::size_t{camera.width} * camera.height);
    const std::vector<std::uint16_t> depth(grey.size(), 10000);
    for (std::uint32_t i = 0; i < 10; ++i) {
        for (std::uint32_t y = 0; y < camera.height; ++y) {
            for (std::uint32_t x = 0; x < camera.width; ++x) {
                std::uint32_t cell = (x + 2 * i) / 8 * 2654435761U ^ y / 8 * 2246822519U;
                cell ^= cell >> 15U;
                grey[std::size_t{y} * camera.width + x] = static_cast<std::uint8_t>(cell * 97U);
            }
        }
        Frame frame;
        frame.time_ns = std::int64_t{i} * 33'000'000;
        frame.depth_time_ns = frame.time_ns;
        frame.format = PixelFormat::kGrey8;
        frame.colour = {grey.data(), camera.width, camera.height, camera.width};
        frame.depth = {depth.data(), camera.width, camera.height, camera.width};
        frame.depth_units_per_m = 5000;
        if (engine.submit(frame) != Status::kOk) return 1;
    }
    // Two pixels a frame, 2 m away, 130 pixels of focal length.
    const double x = map_from_camera(engine.pose()).translation_m[0];
    std::printf("%s kernels, %.4f m along the wall\n", cpu_kernels().name, x);
    return std::abs(x - 9 * 4.0 / 130) < 0.01 ? 0 : 1;
}
