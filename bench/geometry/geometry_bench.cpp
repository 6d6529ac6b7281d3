// What geometry costs a frame: each benchmark does the work of 1000 features.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/depth_noise.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/geometry/trig.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kFeatures = 1000;

// TUM's first camera: the strongest distortion we know of in this class.
CameraModel freiburg1() {
    return {640,      480,       517.306408, 516.469215, 318.643040, 255.313989,
            0.262383, -0.953104, -0.005358,  0.002628,   1.163314};
}

std::vector<Vector2> pixels() {
    Random random(1);
    std::vector<Vector2> out(kFeatures);
    for (Vector2& pixel : out) {
        pixel.x() = random.uniform(0, 639);
        pixel.y() = random.uniform(0, 479);
    }
    return out;
}

void undistort(benchmark::State& state) {
    const CameraModel model = freiburg1();
    const std::vector<Vector2> points = pixels();
    for (auto _ : state) {
        for (const Vector2& pixel : points) benchmark::DoNotOptimize(undistort_to_normalised(model, pixel));
    }
}
BENCHMARK(undistort)->Unit(benchmark::kMicrosecond);

void depth_samples(benchmark::State& state) {
    Random random(2);
    std::vector<std::uint16_t> depth(640 * 480);
    for (std::uint16_t& d : depth) d = static_cast<std::uint16_t>(7000 + random.below(60));
    const DepthView view{depth.data(), 640, 480, 640};
    const std::vector<Vector2> points = pixels();
    for (auto _ : state) {
        for (const Vector2& pixel : points) {
            benchmark::DoNotOptimize(sample_depth(view, 1.0 / 5000, static_cast<std::int32_t>(pixel.x()),
                                                  static_cast<std::int32_t>(pixel.y()), DepthParameters{}));
        }
    }
}
BENCHMARK(depth_samples)->Unit(benchmark::kMicrosecond);

void sines(benchmark::State& state) {
    const std::vector<Vector2> points = pixels();
    for (auto _ : state) {
        for (const Vector2& pixel : points) benchmark::DoNotOptimize(sin_cos(pixel.x()));
    }
}
BENCHMARK(sines)->Unit(benchmark::kMicrosecond);

void arc_tangents(benchmark::State& state) {
    const std::vector<Vector2> points = pixels();
    for (auto _ : state) {
        for (const Vector2& pixel : points) benchmark::DoNotOptimize(arc_tan2(pixel.y() - 240, pixel.x() - 320));
    }
}
BENCHMARK(arc_tangents)->Unit(benchmark::kMicrosecond);

void exponentials(benchmark::State& state) {
    const std::vector<Vector2> points = pixels();
    for (auto _ : state) {
        for (const Vector2& pixel : points) {
            Vector6 xi;
            xi << pixel.x(), pixel.y(), 1.0, 1e-3 * pixel.x(), 1e-3 * pixel.y(), 0.1;
            benchmark::DoNotOptimize(se3_exp(xi));
        }
    }
}
BENCHMARK(exponentials)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace stillmesh
