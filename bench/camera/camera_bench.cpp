// bench_camera [SECONDS]: the whole program on the test driver at 640x480 and 30 frames/s for a minute, frames rendered
// beforehand: frames lost, latency from the driver's stamp (before it copies a pixel) to the pose, processor time of
// the camera layer, error of the path. The driver's own time, which copies and colours the images, is told apart.
// Then another run whose camera is unplugged and plugged in again, stalls and speaks again: how long until it has
// poses.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "platform/evaluation/evaluation.hpp"
#include "tests/openni2/rig.hpp"

namespace stillmesh {
namespace {

// Lines of a trajectory that are poses.
[[nodiscard]] std::size_t poses_in(const std::string& file) {
    std::istringstream lines(test::text_of(file));
    std::size_t count = 0;
    for (std::string line; std::getline(lines, line);) count += !line.empty() && line[0] != '#' ? 1U : 0U;
    return count;
}

// How long after each return of the camera there is a pose. False: there was none.
[[nodiscard]] bool bench_returns(test::CameraRig& rig) {
    constexpr int kReturns = 10;
    const test::TemporaryFolder scratch;
    const std::string path = scratch.path("path.txt");
    test::Program run(STILLMESH_PROGRAM, STILLMESH_PRIVATE_OPENNI2, "run --camera auto --json --trajectory " + path,
                      scratch);
    for (const bool is_unplug : {true, false}) {
        std::vector<double> seconds;
        for (int i = 0; i < kReturns; ++i) {
            const std::size_t before = poses_in(path);
            if (!test::within(30'000, [&] { return poses_in(path) >= before + 30; })) return false;
            std::atomic<std::uint32_t>& cause = is_unplug ? rig.camera().is_plugged : rig.camera().is_stalled;
            cause = is_unplug ? 0 : 1;
            // Of any length: what the program does just then differs.
            std::this_thread::sleep_for(std::chrono::milliseconds(400 + 370 * i));
            const std::size_t without = poses_in(path);
            cause = is_unplug ? 1 : 0;
            const std::int64_t back_ns = test::now_ns();
            if (!test::within(30'000, [&] { return poses_in(path) > without; })) return false;
            seconds.push_back(static_cast<double>(test::now_ns() - back_ns) * 1e-9);
        }
        std::sort(seconds.begin(), seconds.end());
        std::printf("%s %d times, for 0.4 to %.1f s: a pose %.2f s after its return at the median, %.2f s at most\n",
                    is_unplug ? "unplugged" : "stalled", kReturns, 0.4 + 0.37 * (kReturns - 1),
                    seconds[seconds.size() / 2], seconds.back());
    }
    run.signal(SIGINT);
    return run.wait(20'000) == 130;
}

int bench(int seconds) {
    const std::string frames_file = STILLMESH_BENCH_FRAMES;
    std::printf("rendering frames, once per build folder\n");
    const std::string render = std::string(STILLMESH_RENDER_FRAMES) + " walking_xyz 1 640 480 240 0 " + frames_file;
    if (std::system(render.c_str()) != 0) return 1;
    test::CameraRig rig(frames_file);
    rig.camera().is_plugged = 1;
    const test::TemporaryFolder scratch;
    const int frames = 30 * seconds;
    test::Program run(
        STILLMESH_PROGRAM, STILLMESH_PRIVATE_OPENNI2,
        "run --camera auto --json --frames " + std::to_string(frames) + " --trajectory " + scratch.path("path.txt"),
        scratch);
    const int code = run.wait((seconds + 120) * 1000);
    const nlohmann::json json = nlohmann::json::parse(run.out(), nullptr, false);
    if (json.is_discarded()) {
        std::fprintf(stderr, "exit %d: %s\n", code, run.err().c_str());
        return 1;
    }
    const std::int64_t to_unix_ns = test::now_ns(CLOCK_REALTIME) - test::now_ns();
    Trajectory truth;
    Trajectory estimate;
    for (std::uint32_t i = 0; i < rig.camera().log_count; ++i) {
        const test::EmittedFrame& frame = rig.camera().log[i];
        TrajectoryPose pose;
        pose.time_ns = frame.stamp_us * 1000 + to_unix_ns;
        std::copy_n(rig.pose(frame.index).t, 3, pose.t.begin());
        std::copy_n(rig.pose(frame.index).q, 4, pose.q.begin());
        truth.push_back(pose);
    }
    std::string message;
    static_cast<void>(read_trajectory(scratch.path("path.txt"), estimate, message));
    const auto evaluation = evaluate(truth, estimate);
    const double wall_s = json["wall_s"];
    const double count = json["frames"];
    const auto number = [&json](const char* a, const char* b) { return json[a][b].get<double>(); };
    std::printf("exit %d; %.0f frames tracked in %.1f s: %.2f frames/s, coverage %.3f\n", code, count, wall_s,
                count / wall_s, json["coverage"].get<double>());
    std::printf("lost: %llu overtaken in our slot, %llu never came from the driver, %llu + %llu without a partner\n",
                json["frames_dropped"].get<unsigned long long>(),
                json["camera"]["images_missing"].get<unsigned long long>(),
                json["camera"]["colour_alone"].get<unsigned long long>(),
                json["camera"]["depth_alone"].get<unsigned long long>());
    std::printf("latency, driver's stamp to pose: %.2f ms median, %.2f ms p99, %.2f ms p99.9, %.2f ms max\n",
                number("latency", "ms_median"), number("latency", "ms_p99"), number("latency", "ms_p999"),
                number("latency", "ms_max"));
    std::printf("tracking alone: %.2f ms median, %.2f ms p99\n", json["ms_median"].get<double>(),
                json["ms_p99"].get<double>());
    std::printf("CPU: camera layer %.3f ms per frame; the driver's own thread %.3f ms; all of the process %.2f ms\n",
                number("camera", "layer_cpu_ms"),
                static_cast<double>(rig.camera().driver_cpu_ns) * 1e-6 / rig.camera().log_count,
                1e3 * json["cpu_s"].get<double>() / count);
    if (evaluation) std::printf("ATE %.4f m over %zu poses\n", evaluation->ate_rmse_m, evaluation->pairs.size());
    if (code != 0) return code;
    static_cast<void>(std::fflush(stdout));
    return bench_returns(rig) ? 0 : 1;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    return stillmesh::bench(argc > 1 ? std::atoi(argv[1]) : 60);
}
