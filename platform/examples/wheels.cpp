// A robot drives along a wall that its camera looks at, and its wheels say how far: evidence for the engine, frame by
// frame.
#include <cstdio>

#include "engine/engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "wall.hpp"

int main() {
    using namespace stillmesh;
    constexpr double kTick_m = 0.0001;  // what a wheel rolls from one tick of its encoder to the next
    const Limits limits = Limits::pocket();
    MemoryBlock block;
    if (!block.allocate(bytes_needed(limits))) return 1;
    const auto made =
        Engine::create(block.bytes(), limits, Configuration::for_limits(limits), Wall::kCamera, cpu_kernels());
    if (!made.is_ok()) return 1;
    Engine& engine = *made.value();
    Wall wall;
    std::uint32_t ticks_then = 0;
    for (std::uint32_t i = 0; i < 5; ++i) {
        const std::uint32_t ticks = 228 * i;  // both wheels: it drives straight on
        const double driven_m = (ticks - ticks_then) * kTick_m;
        ticks_then = ticks;
        // The camera looks to the side: its x axis is where the robot drives. 2 % of slip, and half a millirad of turn.
        MotionHint hint;
        hint.last_from_camera.translation_m[0] = driven_m;
        hint.sigma_m = 0.02 * driven_m + 1e-4;
        hint.sigma_rad = 5e-4;
        if (engine.submit(wall.frame(i, 6 * i), i > 0 ? &hint : nullptr) != Status::kOk) return 1;
        engine.step(20000);
        const PoseEstimate& pose = engine.pose();
        std::printf("frame %u: %s, %.3f m, by the wheels %.3f m\n", i, pose_state_name(pose.state),
                    pose.odom_from_camera.translation_m[0], ticks * kTick_m);
    }
}
