// A camera passes a patterned wall 2 m away, 6 pixels a frame: all that it takes to follow it.
#include <cstdio>
#include <vector>

#include "engine/engine.hpp"

alignas(stillmesh::kArenaAlignment) static std::byte block[8 << 20];  // Limits::pocket() takes at most 8 MiB

static void draw_wall(std::vector<std::uint8_t>& grey, std::uint32_t width, std::uint32_t passed_px) {
    for (std::uint32_t i = 0; i < grey.size(); ++i) {
        const std::uint32_t column = (i % width + passed_px) / 8, row = i / width / 8;
        const std::uint32_t cell = column * 2654435761U ^ row * 2246822519U;
        grey[i] = static_cast<std::uint8_t>((cell ^ cell >> 15U) * 97U);
    }
}

int main() {
    using namespace stillmesh;
    const CameraModel camera{.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
    const Configuration configuration = Configuration::for_limits(Limits::pocket());
    const auto made = Engine::create(block, Limits::pocket(), configuration, camera, plain_kernels());
    if (!made.is_ok()) return 1;
    Engine& engine = *made.value();
    std::vector<std::uint8_t> grey(640 * 480);
    const std::vector<std::uint16_t> depth(640 * 480, 2000);
    for (std::uint32_t i = 0; i < 5; ++i) {
        draw_wall(grey, 640, 6 * i);
        Frame frame;
        frame.time_ns = std::int64_t{i} * 33'333'333;
        frame.colour = {grey.data(), 640, 480, 640};
        frame.depth = {depth.data(), 640, 480, 640};
        frame.depth_units_per_m = 1000;
        if (engine.submit(frame) != Status::kOk) return 1;
        engine.step(configuration.schedule.units_per_frame);  // background work, until the next frame comes
        const PoseEstimate& pose = engine.pose();
        const double x_m = pose.odom_from_camera.translation_m[0];
        std::printf("frame %u: %s, %.3f m along the wall\n", i, pose_state_name(pose.state), x_m);
    }
}
