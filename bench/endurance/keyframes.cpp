// Does tracking get slower the more the map holds? Engines that differ in keyframes_max alone see the same frames, in
// turn, in one run, on one thread; once the largest map is full, processor time per frame is compared. Keyframes are
// made as often as the configuration allows, so that maps fill within a run of some minutes.
//   bench_keyframes [--max SHARE]: exit 1 when a larger map's median is above SHARE times the smallest's.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <ctime>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bench/accuracy/runs.hpp"
#include "bench/endurance/render_ahead.hpp"
#include "engine/tuned_engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh::endurance {
namespace {

struct Arguments {
    std::string scene = "walking_loop";
    std::uint64_t seed = 1;
    std::uint32_t frames = 1800, measured = 600, width = 640, threads = 2, gap = 3;
    std::vector<std::uint32_t> keyframes = {16, 64, 256};
    std::vector<std::string> set;
    double share_max = 1e9;
};

struct Seat {
    Limits limits;
    MemoryBlock block;
    Engine* engine = nullptr;
    std::vector<double> ms;
    double stage_begin_ms = 0;
    std::vector<double> stage_ms = std::vector<double>(kStages);
    std::uint64_t keyframes_sum = 0, points_sum = 0, matches_sum = 0;
};

double cpu_ms() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double at_share(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

void on_stage(void* user, Stage stage, bool is_begin) noexcept {
    Seat& seat = *static_cast<Seat*>(user);
    const double now = cpu_ms();
    if (is_begin) {
        seat.stage_begin_ms = now;
    } else {
        seat.stage_ms[static_cast<std::size_t>(stage)] += now - seat.stage_begin_ms;
    }
}

int complain(const std::string& sentence) {
    fmt::print(stderr, "bench_keyframes: {}\n", sentence);
    return 2;
}

int run(const Arguments& arguments) {
    Parameters configuration = Parameters();
    configuration.keyframes.tracked_share_max = 1.0;
    configuration.keyframes.new_points_min = 1;
    configuration.keyframes.gap_min = arguments.gap;
    std::string message;
    for (const std::string& assignment : arguments.set) {
        if (!accuracy::set_parameter(configuration, assignment, message)) return complain(message);
    }
    SimulationOptions options;
    options.scene = arguments.scene;
    options.seed = arguments.seed;
    options.frames = arguments.frames;
    options.width = arguments.width;
    options.height = arguments.width * 3 / 4;
    RenderAhead source;
    if (!source.start(options, arguments.threads, message)) return complain(message);
    std::vector<std::unique_ptr<Seat>> seats;
    for (const std::uint32_t keyframes : arguments.keyframes) {
        auto seat = std::make_unique<Seat>();
        seat->limits = Limits::room();
        seat->limits.keyframes_max = keyframes;
        if (!seat->block.allocate(bytes_needed(seat->limits))) return complain("not enough memory.");
        const auto made =
            create_engine(seat->block.bytes(), seat->limits, configuration, source.model(), {cpu_kernels()});
        if (!made.is_ok()) return complain("the engine refuses limits or configuration.");
        seat->engine = made.value();
        seats.push_back(std::move(seat));
    }
    const std::uint32_t from = source.frame_count() - std::min(arguments.measured, source.frame_count());
    const bool is_terminal = isatty(STDERR_FILENO) != 0;
    std::uint32_t count = 0;
    while (const RenderedFrame* const rendered = source.next()) {
        for (std::size_t k = 0; k < seats.size(); ++k) {  // another one first each time: caches are warm for the second
            Seat& seat = *seats[(k + count) % seats.size()];
            if (count == from) seat.engine->set_stage_observer({on_stage, &seat});
            const double begin = cpu_ms();
            const Status status = seat.engine->submit(rendered->frame);
            const double spent = cpu_ms() - begin;
            seat.engine->step(configuration.schedule.units_per_frame);
            if (status != Status::kOk || count < from) continue;
            const EngineStatistics statistics = seat.engine->statistics();
            seat.ms.push_back(spent);
            seat.keyframes_sum += statistics.keyframes.size;
            seat.points_sum += statistics.map_points.size;
            seat.matches_sum += seat.engine->frame_statistics().matches;
        }
        ++count;
        if (is_terminal && count % 50 == 0) {
            fmt::print(stderr, "\r{} of {} frames ", count, source.frame_count());
        }
    }
    if (is_terminal) fmt::print(stderr, "\r{:40}\r", "");
    fmt::print("{} frames of {}:{}, the last {} measured; milliseconds of processor time in submit\n", count,
               arguments.scene, arguments.seed, arguments.measured);
    fmt::print("{:>13} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7} |", "keyframes_max", "keyframes", "points", "matches",
               "median", "mean", "p99", "share");
    for (std::uint32_t s = 0; s < kStages; ++s) fmt::print(" {:>10}", stage_name(static_cast<Stage>(s)));
    fmt::print("\n");
    double worst = 0;
    const double smallest = at_share(seats.front()->ms, 0.5);
    for (const auto& seat : seats) {
        const auto n = static_cast<double>(seat->ms.size());
        const double median = at_share(seat->ms, 0.5);
        double mean = 0;
        for (const double ms : seat->ms) mean += ms / n;
        worst = std::max(worst, median / smallest);
        fmt::print("{:>13} {:>9.1f} {:>8.0f} {:>8.0f} {:>8.3f} {:>8.3f} {:>8.3f} {:>7.3f} |",
                   seat->limits.keyframes_max, static_cast<double>(seat->keyframes_sum) / n,
                   static_cast<double>(seat->points_sum) / n, static_cast<double>(seat->matches_sum) / n, median, mean,
                   at_share(seat->ms, 0.99), median / smallest);
        for (const double ms : seat->stage_ms) fmt::print(" {:>10.3f}", ms / n);
        fmt::print("\n");
    }
    fmt::print("worst share of the medians {:.3f} (at most {:.2f})\n", worst, arguments.share_max);
    return worst <= arguments.share_max ? 0 : 1;
}

}  // namespace
}  // namespace stillmesh::endurance

int main(int argc, char** argv) {
    stillmesh::endurance::Arguments arguments;
    arguments.threads = std::max(1U, std::thread::hardware_concurrency());
    CLI::App app("Tracking time against the number of keyframes in the map.");
    app.add_option("--scene", arguments.scene, "a simulated scene")->capture_default_str();
    app.add_option("--seed", arguments.seed)->capture_default_str();
    app.add_option("--frames", arguments.frames)->check(CLI::Range(10U, 1'000'000U))->capture_default_str();
    app.add_option("--measured", arguments.measured, "of them, the last")
        ->check(CLI::Range(10U, 1'000'000U))
        ->capture_default_str();
    app.add_option("--keyframes", arguments.keyframes, "keyframes_max of each engine")
        ->delimiter(',')
        ->check(CLI::Range(2U, 1024U))
        ->capture_default_str();
    app.add_option("--gap", arguments.gap, "frames between keyframes, at least")->capture_default_str();
    app.add_option("--width", arguments.width)->check(CLI::Range(64U, 2044U))->capture_default_str();
    app.add_option("--threads", arguments.threads, "that render")->check(CLI::Range(1U, 256U))->capture_default_str();
    app.add_option("--set", arguments.set, "key=value of the engines' configuration");
    app.add_option("--max", arguments.share_max, "of a larger map's median over the smallest's");
    CLI11_PARSE(app, argc, argv);
    return stillmesh::endurance::run(arguments);
}
