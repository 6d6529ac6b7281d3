// bench_camera [SECONDS]: the whole program on the test driver at 640x480 and 30 frames/s for a minute, frames rendered
// beforehand: frames lost, latency from the driver's stamp (before it copies a pixel) to the pose, processor time of
// the camera layer, error of the path. The driver's own time, which copies and colours the images, is told apart.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "platform/evaluation/evaluation.hpp"
#include "tests/openni2/rig.hpp"

namespace stillmesh {
namespace {

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
    return code;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    return stillmesh::bench(argc > 1 ? std::atoi(argv[1]) : 60);
}
