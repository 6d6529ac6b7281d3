// Months in small: the engine under fixed limits over a scene that goes on and on. walking_loop goes round the desk in
// 19 s, again and again, and people walk differently each time. Prints a line per window of frames (error within the
// window, time, map, evictions, states) and what the last window is over the first; --latency adds what a frame waits
// for its pose when mapping runs on the same thread between frames.
//
// Exit 1 when memory was not flat, the heap was called, or (--gate) the last window is more than 1.5 times the first.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "bench/accuracy/runs.hpp"
#include "bench/accuracy/sources.hpp"
#include "bench/endurance/heap_count.hpp"
#include "bench/endurance/render_ahead.hpp"
#include "engine/tuned_engine.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "platform/evaluation/final_trajectory.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/linux/process.hpp"
#include "platform/store/store_service.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"

namespace stillmesh::endurance {
namespace {

struct Arguments {
    std::string scene = "walking_loop", limits = "pocket", json, vocabulary, map_store, cache;
    std::uint64_t seed = 1;
    std::uint32_t repeat_after = 1200, frames = 20'000, window = 1000, width = 640, threads = 2;
    std::int64_t units = -1;  // -1: as configured
    std::vector<std::string> set;
    bool is_gate = false, is_latency = false;
};

// The frames of a folder of rendered ones, again and again, at times that go on: the camera goes round as before,
// people walk the same ways again.
class RepeatedFrames {
public:
    [[nodiscard]] bool open(const std::string& scene, std::uint64_t seed, const std::string& folder,
                            std::uint32_t repeat_after, std::uint32_t frames, std::string& message) {
        input_.scene = scene;
        input_.seed = seed;
        options_.cache = folder;
        repeat_after_ = repeat_after;
        frames_ = frames;
        return rewind(message);
    }
    [[nodiscard]] const CameraModel& model() const { return source_->model(); }
    [[nodiscard]] const RenderedFrame* next() {
        std::string message;
        if (given_ == frames_) return nullptr;
        if (at_ == repeat_after_ && !rewind(message)) return nullptr;
        accuracy::TrueFrame frame;
        if (source_->next(frame, message) != Status::kOk) return nullptr;
        ++at_;
        out_.frame = frame.frame;
        out_.frame.time_ns = 1'000'000'000 + static_cast<std::int64_t>(given_++) * 33'333'333;
        out_.frame.depth_time_ns = out_.frame.time_ns;
        out_.truth.time_ns = out_.frame.time_ns;
        out_.truth.t = frame.truth.t;
        out_.truth.q = frame.truth.q;
        return &out_;
    }

private:
    [[nodiscard]] bool rewind(std::string& message) {
        source_ = accuracy::open_source(input_, options_, message);
        at_ = 0;
        return source_ != nullptr;
    }
    accuracy::Input input_;
    accuracy::RunOptions options_;
    std::unique_ptr<accuracy::Source> source_;
    std::uint32_t repeat_after_ = 0, frames_ = 0, at_ = 0, given_ = 0;
    RenderedFrame out_;
};

double ms_of(clockid_t clock) {
    timespec time{};
    clock_gettime(clock, &time);
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

TrajectoryPose pose_of(const RigidTransform& transform, std::int64_t time_ns = 0) {
    TrajectoryPose out;
    out.time_ns = time_ns;
    std::copy_n(transform.translation_m, 3, out.t.begin());
    std::copy_n(transform.rotation_xyzw, 4, out.q.begin());
    return out;
}

double resident_mib() {
    std::ifstream file("/proc/self/statm");
    double all = 0, resident = 0;
    file >> all >> resident;
    return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20U);
}

double at_share(std::vector<double> values, double share) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

struct Spread {
    double median = 0, p99 = 0, p999 = 0, max = 0;
};
Spread spread_of(const std::vector<double>& values) {
    return {at_share(values, 0.5), at_share(values, 0.99), at_share(values, 0.999), at_share(values, 1)};
}

struct Window {
    Trajectory truth, estimate;
    std::vector<double> track_ms, step_ms;  // processor time of this thread
    std::uint32_t states[4] = {};
};

struct Row {
    std::uint64_t frames_end = 0;
    double ate_m = 0, rpe_m = 0, rpe_deg = 0;
    Spread track;
    double step_mean_ms = 0;
    std::uint32_t keyframes = 0, points = 0;
    std::uint64_t keyframes_forgotten = 0, points_forgotten = 0;  // in this window
    std::uint32_t states[4] = {};
    double resident_mib = 0;
    std::size_t arena_bytes = 0;
};

void print_head() {
    fmt::print(
        "{:>7} {:>8} {:>8} {:>6} {:>7} {:>7} {:>8} {:>8} {:>4} {:>6} {:>7} {:>8} {:>6} {:>5} {:>5} {:>5} {:>7}\n",
        "frames", "ATE m", "RPE m", "deg", "median", "p99", "p99.9 ms", "step ms", "kf", "points", "kf out", "pts out",
        "track", "unsur", "pred", "none", "RSS MiB");
}
void print_row(const Row& r) {
    fmt::print(
        "{:>7} {:>8.4f} {:>8.4f} {:>6.2f} {:>7.2f} {:>7.2f} {:>8.2f} {:>8.2f} {:>4} {:>6} {:>7} {:>8} {:>6} {:>5} "
        "{:>5} {:>5} {:>7.1f}\n",
        r.frames_end, r.ate_m, r.rpe_m, r.rpe_deg, r.track.median, r.track.p99, r.track.p999, r.step_mean_ms,
        r.keyframes, r.points, r.keyframes_forgotten, r.points_forgotten, r.states[3], r.states[2], r.states[1],
        r.states[0], r.resident_mib);
    std::fflush(stdout);
}

Row close(const Window& window, const EngineStatistics& now, const EngineStatistics& before) {
    Row row;
    row.frames_end = now.frames;
    row.ate_m = row.rpe_m = row.rpe_deg = std::nan("");
    if (const auto evaluation = evaluate(window.truth, window.estimate)) {
        row.ate_m = evaluation->ate_rmse_m;
        row.rpe_m = evaluation->rpe_translation_rmse_m;
        row.rpe_deg = evaluation->rpe_rotation_rmse_deg;
    }
    row.track = spread_of(window.track_ms);
    for (const double ms : window.step_ms) row.step_mean_ms += ms / static_cast<double>(window.step_ms.size());
    row.keyframes = now.keyframes.size;
    row.points = now.map_points.size;
    row.keyframes_forgotten = now.keyframes_forgotten - before.keyframes_forgotten;
    row.points_forgotten = now.points_forgotten - before.points_forgotten;
    std::copy_n(window.states, 4, row.states);
    row.resident_mib = resident_mib();
    row.arena_bytes = now.arena_used_bytes;
    return row;
}

nlohmann::json json_of(const Spread& s) {
    return {{"median", s.median}, {"p99", s.p99}, {"p99.9", s.p999}, {"max", s.max}};
}

int complain(const std::string& sentence) {
    fmt::print(stderr, "bench_endurance: {}\n", sentence);
    return 2;
}

int run(const Arguments& arguments) {
    Limits limits = arguments.limits == "room"   ? Limits::room()
                    : arguments.limits == "tiny" ? Limits::tiny()
                                                 : Limits::pocket();
    Parameters configuration = Parameters();
    configuration.features.count = std::min(configuration.features.count, limits.features_max);
    configuration.features.levels = std::min(configuration.features.levels, limits.pyramid_levels_max);
    configuration.mapping.window_keyframes = std::min(configuration.mapping.window_keyframes, limits.keyframes_max);
    if (!arguments.map_store.empty()) limits.store_features_max = limits.features_max;
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
    RepeatedFrames repeated;
    const bool is_repeated = !arguments.cache.empty();
    if (is_repeated && !repeated.open(arguments.scene, arguments.seed, arguments.cache, arguments.repeat_after,
                                      arguments.frames, message)) {
        return complain(message);
    }
    if (!is_repeated && !source.start(options, arguments.threads, message)) return complain(message);
    const std::uint32_t frame_count = is_repeated ? arguments.frames : source.frame_count();
    const CameraModel model = is_repeated ? repeated.model() : source.model();
    MemoryBlock block;
    if (!block.allocate(bytes_needed(limits))) return complain("not enough memory.");
    VocabularyFile vocabulary;
    if (!arguments.vocabulary.empty() && !vocabulary.open(arguments.vocabulary == "default" ? "" : arguments.vocabulary,
                                                          limits.vocabulary_words_max, message))
        return complain(message);
    StoreService store;
    if (!arguments.map_store.empty()) {
        RegionStoreOptions where;
        where.folder = arguments.map_store;
        where.regions_max = configuration.store.regions_max;
        where.twin_m = configuration.store.twin_m;
        const std::size_t body_bytes_max = std::size_t{512} * limits.features_max;
        if (!store.open(where, StoreService::Mode::kAtOnce, body_bytes_max, message)) return complain(message);
    }
    const auto made =
        create_engine(block.bytes(), limits, configuration, model,
                      {cpu_kernels(), nullptr, vocabulary.bytes(), arguments.map_store.empty() ? nullptr : &store});
    if (!made.is_ok()) return complain("the engine refuses limits, configuration or the picture's size.");
    Engine& engine = *made.value();
    const std::uint32_t units =
        arguments.units < 0 ? configuration.schedule.units_per_frame : static_cast<std::uint32_t>(arguments.units);
    constexpr double kFrameMs = 1000.0 / 30.0;

    fmt::print("{} frames of {}:{}, {}x{}, limits {} ({:.2f} MiB); milliseconds are processor time of one thread\n",
               frame_count, arguments.scene, arguments.seed, options.width, options.height, arguments.limits,
               static_cast<double>(bytes_needed(limits)) / (1 << 20U));
    print_head();
    const bool is_terminal = isatty(STDERR_FILENO) != 0;
    std::vector<Row> rows;
    std::vector<double> latency_ms, track_ms;
    track_ms.reserve(frame_count);
    latency_ms.reserve(frame_count);
    Trajectory truth, estimate;  // of the whole run
    Window window;
    EngineStatistics before;
    double ready_ms = 0;  // when the engine's thread is done with all before, on the clock of the frames
    // The longest slices and the frames they came after: a slice that is long because of its work is long again at the
    // same frame of the next run, one that the machine interrupted is not.
    struct Slice {
        double ms;
        std::uint64_t frame;
    };
    std::array<Slice, 4> longest{};  // the longest first
    const std::int64_t begin_ns = monotonic_ns();
    std::uint64_t count = 0;
    std::uint64_t refused = 0;
    while (const RenderedFrame* const rendered = is_repeated ? repeated.next() : source.next()) {
        is_counting_heap_calls = true;
        const double wall_0 = ms_of(CLOCK_MONOTONIC), cpu_0 = ms_of(CLOCK_THREAD_CPUTIME_ID);
        const Status status = engine.submit(rendered->frame);
        const double cpu_1 = ms_of(CLOCK_THREAD_CPUTIME_ID), wall_1 = ms_of(CLOCK_MONOTONIC);
        // A frame that comes while a slice is at work waits for it; what is not done then waits for the frame.
        const double arrival_ms = static_cast<double>(count) * kFrameMs;
        const double start_ms = std::max(arrival_ms, ready_ms);
        const double used_ms = arguments.is_latency ? cpu_1 - cpu_0 : wall_1 - wall_0;
        ready_ms = start_ms + used_ms;
        latency_ms.push_back(ready_ms - arrival_ms);
        is_counting_heap_calls = false;  // the store's own work is the platform's
        static_cast<void>(store.begin_frame());
        is_counting_heap_calls = true;
        std::uint32_t left = units;
        const std::uint32_t slice = std::max(configuration.schedule.slice_units, 1U);
        while (left > 0) {
            const double a = ms_of(CLOCK_THREAD_CPUTIME_ID);
            const std::uint32_t part = std::min(left, slice);
            const Progress progress = engine.step(part);
            left -= part;
            const double spent = ms_of(CLOCK_THREAD_CPUTIME_ID) - a;
            if (spent > longest.back().ms) {
                longest.back() = {spent, count};
                std::sort(longest.begin(), longest.end(), [](const Slice& x, const Slice& y) { return x.ms > y.ms; });
            }
            ready_ms += spent;
            if (progress != Progress::kWorking) break;
        }
        const double cpu_2 = ms_of(CLOCK_THREAD_CPUTIME_ID);
        is_counting_heap_calls = false;
        ++count;
        if (status != Status::kOk) {
            ++refused;
            continue;
        }
        const PoseEstimate& pose = engine.pose();
        truth.push_back({rendered->truth.time_ns, rendered->truth.t, rendered->truth.q});
        window.truth.push_back({rendered->truth.time_ns, rendered->truth.t, rendered->truth.q});
        if (pose.state >= PoseState::kUnsure) {
            const TrajectoryPose given =
                compose(pose_of(pose.map_from_odom), pose_of(pose.odom_from_camera, pose.time_ns));
            window.estimate.push_back(given);
            window.estimate.back().time_ns = pose.time_ns;
            estimate.push_back(window.estimate.back());
        }
        window.track_ms.push_back(cpu_1 - cpu_0);
        window.step_ms.push_back(cpu_2 - cpu_1);
        track_ms.push_back(cpu_1 - cpu_0);
        ++window.states[static_cast<std::size_t>(pose.state)];
        if (is_terminal && count % 50 == 0) {
            const double seconds = static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
            fmt::print(stderr, "\r{} of {} frames, {:.1f} a second, {:.0f} s left ", count, frame_count,
                       static_cast<double>(count) / seconds,
                       seconds / static_cast<double>(count) * static_cast<double>(frame_count - count));
        }
        if (window.truth.size() == arguments.window || count == frame_count) {
            const EngineStatistics now = engine.statistics();
            // A short rest at the end is no window.
            if (window.truth.size() == arguments.window || rows.empty()) {
                rows.push_back(close(window, now, before));
                if (is_terminal) fmt::print(stderr, "\r{:60}\r", "");
                print_row(rows.back());
            }
            before = now;
            window = {};
        }
    }
    if (rows.empty()) return complain("not one frame was taken.");
    const double seconds = static_cast<double>(monotonic_ns() - begin_ns) * 1e-9;
    const Row& first = rows.front();
    const Row& last = rows.back();
    const EngineStatistics end = engine.statistics();
    const bool is_flat =
        std::all_of(rows.begin(), rows.end(), [&](const Row& r) { return r.arena_bytes == bytes_needed(limits); });
    const double ate_ratio = last.ate_m / first.ate_m, rpe_ratio = last.rpe_m / first.rpe_m,
                 time_ratio = last.track.median / first.track.median;
    fmt::print("last window over first: ATE {:.2f}  RPE {:.2f}  median ms {:.2f}\n", ate_ratio, rpe_ratio, time_ratio);
    const auto whole = evaluate(truth, estimate);
    const double whole_ate_m = whole ? whole->ate_rmse_m : std::nan("");
    fmt::print("whole run     ATE {:.4f} m; {} loops closed, {} confirmed; {} relocalisations\n", whole_ate_m,
               end.loop.closed, end.loop.confirmed, end.loop.relocalisations);
    fmt::print("memory        block {} bytes, {}; RSS {:.1f} MiB after the first window, {:.1f} after the last\n",
               end.arena_used_bytes, is_flat ? "the same in every window" : "NOT THE SAME", first.resident_mib,
               last.resident_mib);
    fmt::print("heap calls    {} in submit and step\n", heap_calls);
    fmt::print(
        "map           {} keyframes made, {} forgotten; {} points forgotten; high water {}/{} keyframes, {}/{} "
        "points\n",
        end.keyframes_made, end.keyframes_forgotten, end.points_forgotten, end.keyframes.high_water,
        end.keyframes.capacity, end.map_points.high_water, end.map_points.capacity);
    fmt::print("lost          {} frames lost, {} recoveries, {} refused\n", end.frames_lost, end.recoveries, refused);
    if (!arguments.map_store.empty()) {
        const StoreStatistics& s = end.store;
        const std::string problem = store.close();
        const RegionStoreCounts counts = store.counts();
        fmt::print(
            "store         {} regions kept, {} back, {} of them useful; {} asked, {} not found, {} late, {} damaged; "
            "{} "
            "known, {} poor, {} refused, {} without room; points {} made, {} known; {} corrections\n",
            s.kept, s.returned, s.useful, s.asked, s.not_found, s.late, s.damaged, s.known, s.poor, s.refused,
            s.no_room, s.points_made, s.points_known, s.corrections);
        fmt::print("on disk       {} regions, {:.1f} MB; {} written, {} known there, {} forgotten {}\n", counts.regions,
                   static_cast<double>(counts.bytes) * 1e-6, counts.written, counts.known, counts.forgotten, problem);
    }
    const Spread all = spread_of(track_ms);
    const Spread latency = spread_of(latency_ms);
    fmt::print("tracking ms   median {:.2f}  p99 {:.2f}  p99.9 {:.2f}  max {:.2f}\n", all.median, all.p99, all.p999,
               all.max);
    fmt::print("frame to pose median {:.2f}  p99 {:.2f}  p99.9 {:.2f}  max {:.2f} ms over {} frames ({})\n",
               latency.median, latency.p99, latency.p999, latency.max, latency_ms.size(),
               arguments.is_latency ? "processor time" : "wall clock for tracking");
    fmt::print("longest slice");
    for (const Slice& s : longest) fmt::print(" {:.2f} ms (frame {})", s.ms, s.frame);
    fmt::print("\n");
    fmt::print("took          {:.0f} s, {:.1f} frames a second\n", seconds, static_cast<double>(count) / seconds);

    if (!arguments.json.empty()) {
        nlohmann::json out;
        out["scene"] = arguments.scene;
        out["seed"] = arguments.seed;
        out["limits"] = arguments.limits;
        out["width"] = options.width;
        out["frames"] = count;
        out["block_bytes"] = end.arena_used_bytes;
        out["heap_calls"] = heap_calls;
        out["ratio"] = {{"ate", ate_ratio}, {"rpe", rpe_ratio}, {"median_ms", time_ratio}};
        out["tracking_ms"] = json_of(all);
        out["latency_ms"] = json_of(latency);
        out["slice_max_ms"] = longest.front().ms;
        out["ate_m"] = whole_ate_m;
        for (const Row& r : rows) {
            out["windows"].push_back({{"frames_end", r.frames_end},
                                      {"ate_m", r.ate_m},
                                      {"rpe_m", r.rpe_m},
                                      {"rpe_deg", r.rpe_deg},
                                      {"tracking_ms", json_of(r.track)},
                                      {"step_mean_ms", r.step_mean_ms},
                                      {"keyframes", r.keyframes},
                                      {"points", r.points},
                                      {"keyframes_forgotten", r.keyframes_forgotten},
                                      {"points_forgotten", r.points_forgotten},
                                      {"tracked", r.states[3]},
                                      {"unsure", r.states[2]},
                                      {"predicted", r.states[1]},
                                      {"none", r.states[0]},
                                      {"resident_mib", r.resident_mib},
                                      {"arena_bytes", r.arena_bytes}});
        }
        std::ofstream file(arguments.json);
        file << out.dump(1) << '\n';
        if (!file.good()) return complain(arguments.json + ": cannot be written.");
    }
    int code = 0;
    if (!is_flat || heap_calls != 0) code = 1;
    if (arguments.is_gate && !(ate_ratio <= 1.5 && rpe_ratio <= 1.5)) code = 1;
    return code;
}

}  // namespace
}  // namespace stillmesh::endurance

int main(int argc, char** argv) {
    stillmesh::endurance::Arguments arguments;
    arguments.threads = std::max(1U, std::thread::hardware_concurrency());
    CLI::App app("The engine under fixed limits over a scene that goes on and on.");
    app.add_option("--scene", arguments.scene, "a simulated scene")->capture_default_str();
    app.add_option("--seed", arguments.seed)->capture_default_str();
    app.add_option("--frames", arguments.frames)->check(CLI::Range(3U, 1'000'000U))->capture_default_str();
    app.add_option("--window", arguments.window, "frames a line stands for")
        ->check(CLI::Range(40U, 1'000'000U))
        ->capture_default_str();
    app.add_option("--limits", arguments.limits)
        ->check(CLI::IsMember({"pocket", "room", "tiny"}))
        ->capture_default_str();
    app.add_option("--width", arguments.width, "px; the height is three quarters of it")
        ->check(CLI::Range(64U, 2044U))
        ->capture_default_str();
    app.add_option("--threads", arguments.threads, "that render")->check(CLI::Range(1U, 256U))->capture_default_str();
    app.add_option("--units", arguments.units, "of background work after each frame; -1: as configured")
        ->check(CLI::Range(std::int64_t{-1}, std::int64_t{1'000'000'000}))
        ->capture_default_str();
    app.add_option("--set", arguments.set, "key=value of the engine's configuration");
    app.add_option("--vocabulary", arguments.vocabulary, "file, or default; loops and lost cameras are found with it");
    app.add_option("--map-store", arguments.map_store, "folder for places that memory has no room for");
    app.add_option("--cache", arguments.cache, "folder of rendered frames (accuracy --cache): those, again and again");
    app.add_option("--repeat-after", arguments.repeat_after, "so many of them; where the camera is as it was at first")
        ->capture_default_str();
    app.add_option("--json", arguments.json, "file for all figures");
    app.add_flag("--latency", arguments.is_latency,
                 "frame to pose by processor time, so that rendering beside it does not count");
    app.add_flag("--gate", arguments.is_gate, "exit 1 when the last window's error is more than 1.5 times the first's");
    CLI11_PARSE(app, argc, argv);
    return stillmesh::endurance::run(arguments);
}
