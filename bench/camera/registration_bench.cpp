// bench_registration [ROUNDS]: what DepthRegistration takes for a frame of a rendered room with people, ms: the fastest
// and the median of so many rounds (300), in which all of them take turns, so that a busy machine is busy for all.
// Depth of the size of colour 25 mm beside it (PrimeSense), that of a RealSense, and that before a lens that distorts.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "hal/live/depth_registration.hpp"
#include "hal/simulated/simulated_camera.hpp"

namespace stillmesh {
namespace {

struct Case {
    const char* name;
    CameraModel depth, colour;
    std::vector<std::uint16_t> source, target{};
    std::vector<double> times_ms{};
};

[[nodiscard]] CameraModel camera(std::uint32_t width, std::uint32_t height, double focal) {
    CameraModel model;
    model.width = width, model.height = height, model.fx = model.fy = focal;
    model.cx = 0.5 * (width - 1.0), model.cy = 0.5 * (height - 1.0);
    return model;
}

// The simulation's depth of 640x480; wider: the nearest of its pixels.
[[nodiscard]] bool render(std::vector<Case>& cases) {
    SimulationOptions options;
    options.scene = "walking_xyz";
    options.frames = 30;
    SimulatedCamera room(options);
    if (room.open() != Status::kOk) return false;
    Frame frame;
    for (std::uint32_t i = 0; i < options.frames; ++i) {
        if (room.poll(frame) != Status::kOk) return false;
    }
    for (Case& one : cases) {
        for (std::uint32_t y = 0; y < one.depth.height; ++y) {
            for (std::uint32_t x = 0; x < one.depth.width; ++x) {
                one.source.push_back(frame.depth.at(x * 640 / one.depth.width, y * 480 / one.depth.height));
            }
        }
        one.target.resize(std::size_t{one.colour.width} * one.colour.height);
    }
    return true;
}

int run(int rounds) {
    const CameraModel colour = camera(640, 480, 528);
    CameraModel bent = colour;
    bent.k1 = 0.15, bent.k2 = -0.4, bent.p1 = 0.001;
    std::vector<Case> cases{{"640x480 into 640x480", colour, colour, {}},
                            {"848x480 into 640x480", camera(848, 480, 424), colour, {}},
                            {"848x480 into 640x480, a lens", camera(848, 480, 424), bent, {}}};
    if (!render(cases)) return 1;
    std::vector<DepthRegistration> registrations;
    for (const Case& one : cases) registrations.emplace_back(one.depth, one.colour, 0.025, 5000.0);
    for (int round = 0; round < rounds; ++round) {
        for (std::size_t i = 0; i < cases.size(); ++i) {
            Case& one = cases[i];
            const auto begin = std::chrono::steady_clock::now();
            registrations[i].reproject({one.source.data(), one.depth.width, one.depth.height, one.depth.width},
                                       one.target.data());
            const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
            one.times_ms.push_back(took.count());
        }
    }
    for (Case& one : cases) {
        std::sort(one.times_ms.begin(), one.times_ms.end());
        std::printf("%-30s %.3f ms at best, %.3f in the median\n", one.name, one.times_ms.front(),
                    one.times_ms[one.times_ms.size() / 2]);
    }
    return 0;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    return stillmesh::run(argc > 1 ? std::max(std::atoi(argv[1]), 1) : 300);
}
