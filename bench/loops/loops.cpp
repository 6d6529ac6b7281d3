// Does coming home work? Scenes through two engines side by side, one with a vocabulary and one without:
//   bench_loops --vocabulary FILE --scenes static_loop,walking_loop --seeds 1-10 [--cache DIR] [--set key=value]
// A line per run: ATE of the poses as given out and as known at the end, loops closed and confirmed, candidates refused
// and why, the largest correction, latency and the longest slice. `home`: frames whose reference keyframe is at least
// loop.gap_frames older, so that tracking is on the old part of the map, whoever brought it there. A loop is false when
// the pose jumps away from the truth: the error of the motion over the jump exceeds 0.1 m (`worse`).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "bench/accuracy/sources.hpp"
#include "engine/tuned_engine.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "platform/evaluation/final_trajectory.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/linux/process.hpp"
#include "platform/report/percentiles.hpp"

namespace stillmesh {
namespace {

TrajectoryPose pose_of(const RigidTransform& transform, std::int64_t time_ns) {
    TrajectoryPose out;
    out.time_ns = time_ns;
    std::copy_n(transform.translation_m, 3, out.t.begin());
    std::copy_n(transform.rotation_xyzw, 4, out.q.begin());
    return out;
}

double distance(const TrajectoryPose& a, const TrajectoryPose& b) {
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) sum += (a.t[i] - b.t[i]) * (a.t[i] - b.t[i]);
    return std::sqrt(sum);
}

struct Seat {
    const char* name = "";
    MemoryBlock block;
    Engine* engine = nullptr;
    Parameters configuration;
    Trajectory given;
    FinalTrajectory last;
    std::vector<KeyframePose> keyframes;
    Percentiles latency_ms, slice_ms, all_ms;
    std::uint64_t closed = 0;
    std::uint32_t lost = 0;
    std::uint32_t home = 0;
    std::uint64_t frames = 0;
    TrajectoryPose map_from_odom;  // of the last frame
    double worse_m = 0;            // a jump of map_from_odom took the camera so much farther from the truth, at most
    std::uint32_t jumps = 0;

    void update() {
        keyframes.resize(1024);
        const std::uint32_t count = engine->keyframes(keyframes);
        std::vector<KeyframeNow> now(count);
        for (std::uint32_t i = 0; i < count; ++i) {
            now[i] = {keyframes[i].id, keyframes[i].parent_id, pose_of(keyframes[i].map_from_camera, 0)};
        }
        last.update(now);
    }
    bool frame(const Frame& frame, const TrajectoryPose& start_from_camera) {
        const std::int64_t begin_ns = monotonic_ns();
        if (engine->submit(frame) != Status::kOk) return false;
        const std::int64_t out_ns = monotonic_ns();
        latency_ms.add(static_cast<double>(out_ns - begin_ns) * 1e-6);
        const PoseEstimate& pose = engine->pose();
        const TrajectoryPose jumped = pose_of(pose.map_from_odom, frame.time_ns);
        if (distance(jumped, map_from_odom) > 1e-9) {
            const TrajectoryPose odom = pose_of(pose.odom_from_camera, frame.time_ns);
            const double before = distance(compose(map_from_odom, odom), start_from_camera);
            const double after = distance(compose(jumped, odom), start_from_camera);
            worse_m = std::max(worse_m, after - before);
            ++jumps;
        }
        map_from_odom = jumped;
        ++frames;
        if (pose.state >= PoseState::kUnsure) {
            update();
            const TrajectoryPose map_from_camera =
                compose(pose_of(pose.map_from_odom, frame.time_ns), pose_of(pose.odom_from_camera, frame.time_ns));
            given.push_back(map_from_camera);
            last.add(map_from_camera, engine->reference_keyframe());
            home += engine->reference_keyframe() + configuration.loop.gap_frames <= frames ? 1U : 0U;
        } else {
            ++lost;
        }
        std::uint32_t left = configuration.schedule.units_per_frame;
        const std::int64_t work_ns = monotonic_ns();
        while (left > 0) {
            const std::uint32_t units = std::min(left, configuration.schedule.slice_units);
            const std::int64_t slice_ns = monotonic_ns();
            const Progress progress = engine->step(units);
            slice_ms.add(static_cast<double>(monotonic_ns() - slice_ns) * 1e-6);
            left -= units;
            if (progress == Progress::kIdle) break;
        }
        all_ms.add(static_cast<double>(monotonic_ns() - work_ns + out_ns - begin_ns) * 1e-6);
        return true;
    }
};

struct Arguments {
    std::string vocabulary, cache, limits = "room";
    std::vector<std::string> scenes{"static_loop", "walking_loop"}, settings;
    std::string seeds = "1";
    std::uint32_t frames = 0;
    bool is_alone = false;
    std::string trajectories;
};

bool run(const Arguments& arguments, const std::string& scene, std::uint64_t seed,
         const std::vector<std::byte>& vocabulary) {
    std::string message;
    accuracy::RunOptions options;
    options.cache = arguments.cache;
    const auto source =
        accuracy::open_source({scene, seed, scene.find('/') != std::string::npos, arguments.frames}, options, message);
    if (source == nullptr) {
        fmt::print(stderr, "bench_loops: {}\n", message);
        return false;
    }
    const Limits limits = arguments.limits == "pocket" ? Limits::pocket() : Limits::room();
    std::vector<std::unique_ptr<Seat>> seats;
    for (const bool has_words : {true, false}) {
        if (!has_words && arguments.is_alone) continue;
        auto seat = std::make_unique<Seat>();
        seat->name = has_words ? "loops" : "none";
        seat->configuration.camera.readout_s = source->readout_s();
        seat->configuration.features.count = std::min(seat->configuration.features.count, limits.features_max);
        for (const std::string& setting : arguments.settings) {
            if (accuracy::set_parameter(seat->configuration, setting, message)) continue;
            fmt::print(stderr, "bench_loops: {}\n", message);
            return false;
        }
        if (!seat->block.allocate(bytes_needed(limits))) return false;
        const auto engine =
            create_engine(seat->block.bytes(), limits, seat->configuration, source->model(),
                          {cpu_kernels(), nullptr,
                           has_words ? std::span<const std::byte>(vocabulary) : std::span<const std::byte>{}});
        if (!engine.is_ok()) {
            fmt::print(stderr, "bench_loops: the engine says {}\n", status_name(engine.status()));
            return false;
        }
        seat->engine = engine.value();
        seats.push_back(std::move(seat));
    }
    Trajectory truth;
    for (;;) {
        accuracy::TrueFrame in;
        const Status status = source->next(in, message);
        if (status == Status::kEnd) break;
        if (status != Status::kOk) return false;
        if (in.has_truth) truth.push_back(in.truth);
        const TrajectoryPose start_from_camera =
            truth.empty() ? TrajectoryPose{} : compose(inverse_of(truth.front()), truth.back());
        for (const auto& seat : seats) {
            if (!seat->frame(in.frame, start_from_camera)) return false;
        }
    }
    for (const auto& seat : seats) {
        seat->update();
        const Trajectory final_poses = seat->last.finish();
        const auto given = evaluate(truth, seat->given);
        const auto last = evaluate(truth, final_poses);
        if (!arguments.trajectories.empty()) {
            for (const bool is_final : {false, true}) {
                std::ofstream file(fmt::format("{}/{}_{}_{}{}.txt", arguments.trajectories, scene, seed, seat->name,
                                               is_final ? "_final" : ""));
                for (const TrajectoryPose& pose : is_final ? final_poses : seat->given) file << pose_line(pose);
            }
        }
        const EngineStatistics s = seat->engine->statistics();
        const LoopStatistics& l = s.loop;
        double drift_end = 0;
        if (given && !given->pairs.empty()) drift_end = given->pairs.back().error_m;
        fmt::print(
            "{:<14} {:>2} {:<5} ATE {:.4f} final {:.4f} end {:.3f} lost {} home {} | kf {} queries {} verified {} "
            "closed {} "
            "confirmed {} jumps {} worse {:.3f} largest {:.3f} m | refused: matches {} pose {} inliers {} spread {} "
            "far {} unlikely {} gone "
            "{}; "
            "dropped {} | fused {} found {} graph it {} gba {}/{} reloc {}/{} | latency p99.9 {:.1f} slice max {:.2f} "
            "p99 {:.2f} all {:.2f} ms | units/frame {:.0f}\n",
            scene, seed, seat->name, given ? given->ate_rmse_m : -1.0, last ? last->ate_rmse_m : -1.0, drift_end,
            seat->lost, seat->home, s.keyframes_made, l.queries, l.candidates, l.closed, l.confirmed, seat->jumps,
            seat->worse_m, l.largest_correction_m, l.refused_matches, l.refused_pose, l.refused_inliers,
            l.refused_spread, l.refused_far, l.refused_unlikely, l.refused_gone, l.dropped, l.points_fused,
            l.observations_found, l.graph_iterations, l.adjustments, l.adjustments_dropped, l.relocalisations,
            l.relocalisation_queries, seat->latency_ms.at(0.999), seat->slice_ms.max(), seat->slice_ms.p99(),
            seat->all_ms.mean(),
            static_cast<double>(s.schedule.units_spent) / static_cast<double>(std::max<std::uint64_t>(s.frames, 1)));
        std::fflush(stdout);
    }
    return true;
}

int program(int argc, char** argv) {
    Arguments arguments;
    CLI::App app("Loops and places: with a vocabulary and without.", "bench_loops");
    app.add_option("--vocabulary", arguments.vocabulary, "file")->required();
    app.add_option("--scenes", arguments.scenes, "scenes, or folders of recordings")->delimiter(',');
    app.add_option("--seeds", arguments.seeds, "as 1-10 or 1,3");
    app.add_option("--frames", arguments.frames, "of each");
    app.add_option("--cache", arguments.cache, "folder of rendered frames");
    app.add_option("--set", arguments.settings, "key=value");
    app.add_option("--limits", arguments.limits, "room or pocket");
    app.add_option("--trajectories", arguments.trajectories, "folder to write them to");
    app.add_flag("--alone", arguments.is_alone, "only the engine with a vocabulary");
    CLI11_PARSE(app, argc, argv);
    std::ifstream file(arguments.vocabulary, std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    std::vector<std::byte> vocabulary(text.size());
    std::transform(text.begin(), text.end(), vocabulary.begin(), [](char c) { return static_cast<std::byte>(c); });
    if (vocabulary.empty()) {
        fmt::print(stderr, "bench_loops: {} cannot be read.\n", arguments.vocabulary);
        return 2;
    }
    std::vector<std::uint64_t> seeds;
    if (!accuracy::parse_seeds(arguments.seeds, seeds)) {
        fmt::print(stderr, "bench_loops: --seeds: give numbers or ranges, as 1-10 or 1,3.\n");
        return 2;
    }
    for (const std::string& scene : arguments.scenes) {
        for (const std::uint64_t seed : seeds) {
            if (!run(arguments, scene, seed, vocabulary)) return 1;
        }
    }
    return 0;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    return stillmesh::program(argc, argv);
}
