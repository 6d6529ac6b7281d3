// Google Benchmark of the feature stage, beside cv::ORB and cv::FAST.
//   bench_features [--benchmark_filter=...]
#include <benchmark/benchmark.h>

#include <opencv2/features2d.hpp>

#include "bench/features/frames.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/rig.hpp"

namespace {

using namespace stillmesh;

const std::vector<cv::Mat>& frames() {
    static const std::vector<cv::Mat> all = [] {
        cv::setNumThreads(1);
        std::vector<cv::Mat> real = bench::real_frames(10, 36);
        return real.empty() ? bench::synthetic_frames(5) : real;
    }();
    return all;
}

void extract(benchmark::State& state, const Kernels* kernels, Limits limits) {
    if (kernels == nullptr) return state.SkipWithError("these kernels are not in this build");
    testing::Rig rig(limits, *kernels);
    std::size_t i = 0;
    for (auto _ : state) {
        const Status status = rig.extractor.extract(bench::view_of(frames()[i++ % frames().size()]), rig.features);
        STILLMESH_CHECK(status == Status::kOk);
        benchmark::DoNotOptimize(rig.features.size());
    }
    state.counters["features"] = static_cast<double>(rig.features.size());
    state.counters["bytes"] = static_cast<double>(rig.used_bytes);
}

void extract_cv(benchmark::State& state, int features_max) {
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(features_max, 1.2f, 8);
    std::vector<cv::KeyPoint> keypoints;
    cv::Mat descriptors;
    std::size_t i = 0;
    for (auto _ : state) {
        orb->detectAndCompute(frames()[i++ % frames().size()], cv::noArray(), keypoints, descriptors);
        benchmark::DoNotOptimize(keypoints.size());
    }
    state.counters["features"] = static_cast<double>(keypoints.size());
}

void hamming(benchmark::State& state, const Kernels* kernels) {
    if (kernels == nullptr) return state.SkipWithError("these kernels are not in this build");
    std::vector<std::uint64_t> words(4 * 1000);
    Random random(1);
    for (std::uint64_t& word : words) word = random.next();
    std::vector<std::uint16_t> distances(1000);
    for (auto _ : state) {
        kernels->hamming_many(words.data(), words.data(), 1000, distances.data());
        benchmark::DoNotOptimize(distances.data());
    }
}

void grey(benchmark::State& state, const Kernels* kernels) {
    if (kernels == nullptr) return state.SkipWithError("these kernels are not in this build");
    std::vector<std::uint8_t> colour(3 * 640);
    std::vector<std::uint8_t> out(640 + kKernelSlackBytes);
    for (auto _ : state) {
        for (int y = 0; y < 480; ++y) kernels->grey_from_rgb(colour.data(), 640, out.data());
        benchmark::DoNotOptimize(out.data());
    }
}

BENCHMARK_CAPTURE(extract, room_best, &cpu_kernels(), Limits::room())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(extract, room_sse2, sse2_kernels(), Limits::room())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(extract, room_plain, &plain_kernels(), Limits::room())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(extract, pocket_best, &cpu_kernels(), Limits::pocket())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(extract_cv, orb_1000, 1000)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(extract_cv, orb_500, 500)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(hamming, one_to_1000_best, &cpu_kernels());
BENCHMARK_CAPTURE(hamming, one_to_1000_sse2, sse2_kernels());
BENCHMARK_CAPTURE(hamming, one_to_1000_plain, &plain_kernels());
BENCHMARK_CAPTURE(grey, vga_best, &cpu_kernels())->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(grey, vga_plain, &plain_kernels())->Unit(benchmark::kMicrosecond);

}  // namespace

BENCHMARK_MAIN();
