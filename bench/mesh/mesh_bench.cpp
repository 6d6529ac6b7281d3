// Google Benchmark: the mesh beside CGAL and cv::Subdiv2D, on even random points and on features.
#include <benchmark/benchmark.h>

#include "bench/mesh/baselines.hpp"
#include "tests/mesh/rig.hpp"

namespace stillmesh::bench {
namespace {

void ours(benchmark::State& state, const std::vector<Points>& sets) {
    testing::MeshRig rig(100000);
    std::size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(rig.delaunay.triangulate(sets[i]));
        i = (i + 1) % sets.size();
    }
}

template <typename Baseline>
void theirs(benchmark::State& state, const std::vector<Points>& sets) {
    std::vector<Baseline> prepared;
    for (const Points& points : sets) prepared.emplace_back(points);
    std::size_t i = 0;
    for (auto _ : state) {
        benchmark::DoNotOptimize(prepared[i].triangulate());
        i = (i + 1) % sets.size();
    }
}

void add(const std::string& name, const std::vector<Points>& sets) {
    benchmark::RegisterBenchmark(("stillmesh/" + name).c_str(), [sets](benchmark::State& s) {
        ours(s, sets);
    })->Unit(benchmark::kMicrosecond);
    benchmark::RegisterBenchmark(("cgal/" + name).c_str(), [sets](benchmark::State& s) {
        theirs<Cgal>(s, sets);
    })->Unit(benchmark::kMicrosecond);
    benchmark::RegisterBenchmark(("subdiv2d/" + name).c_str(), [sets](benchmark::State& s) {
        theirs<Subdiv2D>(s, sets);
    })->Unit(benchmark::kMicrosecond);
}

std::vector<Points> several(Points (*make)(std::uint32_t, std::uint64_t), std::uint32_t count) {
    std::vector<Points> sets;
    for (std::uint64_t seed = 0; seed < 16; ++seed) sets.push_back(make(count, seed));
    return sets;
}

}  // namespace
}  // namespace stillmesh::bench

int main(int argc, char** argv) {
    using namespace stillmesh::bench;
    benchmark::Initialize(&argc, argv);
    for (const std::uint32_t count : {100U, 500U, 1000U, 2000U, 10000U}) {
        add("even/" + std::to_string(count), several(even_points, count));
    }
    add("clustered/1000", several(clustered_points, 1000));
    add("features/1000", feature_points(16));
    benchmark::RunSpecifiedBenchmarks();
}
