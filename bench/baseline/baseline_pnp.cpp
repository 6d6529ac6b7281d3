// bench_baseline_pnp SCENE[:SEED] ... | DIR ...   [--frames N] [--seeds N]
// ATE of plain ORB + RANSAC PnP odometry on simulated scenes or TUM folders, with the share of moving pixels.
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "bench/baseline/pnp_odometry.hpp"
#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/evaluation.hpp"

namespace {

using namespace stillmesh;

TrajectoryPose to_pose(const cv::Matx44d& m, std::int64_t time_ns) {
    // Rotation to quaternion by way of the rotation vector.
    cv::Vec3d r;
    cv::Rodrigues(m.get_minor<3, 3>(0, 0), r);
    const double angle = cv::norm(r);
    const double s = angle > 1e-12 ? std::sin(angle / 2) / angle : 0.5;
    return {time_ns, {m(0, 3), m(1, 3), m(2, 3)}, {r[0] * s, r[1] * s, r[2] * s, std::cos(angle / 2)}};
}

bool run(DepthCamera& camera, SimulatedCamera* simulated, Trajectory truth, std::uint32_t frames_max,
         const std::string& name) {
    baseline::PnpOdometry odometry(camera.info());
    Trajectory estimate;
    Frame frame;
    double share_sum = 0;
    std::size_t over = 0;
    while (estimate.size() < frames_max) {
        const Status status = camera.poll(frame);
        if (status == Status::kEnd) break;
        if (status != Status::kOk) continue;
        estimate.push_back(to_pose(odometry.track(frame), frame.time_ns));
        if (simulated != nullptr) {
            const SimulatedPose& pose = simulated->true_pose();
            truth.push_back({pose.time_ns, pose.t, pose.q});
            share_sum += simulated->dynamic_share();
            over += simulated->dynamic_share() > 0.3;
        }
    }
    const auto result = evaluate(truth, estimate);
    if (!result) {
        std::fprintf(stderr, "%s: fewer than three poses with a truth\n", name.c_str());
        return false;
    }
    const double n = static_cast<double>(estimate.size());
    std::printf("%-26s %5zu frames  ATE %.4f m  max %.3f  RPE %.3f m/s  keyframes %3d  failures %3d", name.c_str(),
                estimate.size(), result->ate_rmse_m, result->ate_max_m, result->rpe_translation_rmse_m,
                odometry.keyframes(), odometry.failures());
    if (simulated != nullptr)
        std::printf("  moving %4.1f %%  above 30 %%: %3.0f %%", 100 * share_sum / n,
                    100 * static_cast<double>(over) / n);
    std::printf("\n");
    std::fflush(stdout);
    return true;
}

}  // namespace

int main(int argc, char** argv) {
    std::vector<std::string> inputs;
    std::uint32_t frames = 0;
    std::uint64_t seeds = 1;
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i];
        if ((word == "--frames" || word == "--seeds") && i + 1 < argc) {
            const std::uint64_t value = std::strtoull(argv[++i], nullptr, 10);
            (word == "--frames" ? static_cast<void>(frames = static_cast<std::uint32_t>(value))
                                : static_cast<void>(seeds = value));
        } else {
            inputs.push_back(word);
        }
    }
    if (inputs.empty()) {
        std::fprintf(stderr, "usage: bench_baseline_pnp (all | SCENE[:SEED] | DIR) ... [--frames N] [--seeds N]\n");
        return 2;
    }
    if (inputs.size() == 1 && inputs[0] == "all") {
        inputs.clear();
        for (const SimulatedScene& scene : simulated_scenes()) inputs.emplace_back(scene.name);
    }
    bool is_good = true;
    for (const std::string& input : inputs) {
        if (input.find('/') != std::string::npos) {
            ReplayOptions options;
            options.folder = input;
            ReplayCamera camera(options);
            std::string message;
            Trajectory truth;
            if (camera.open() != Status::kOk ||
                read_trajectory(input + "/groundtruth.txt", truth, message) != Status::kOk) {
                std::fprintf(stderr, "%s %s\n", camera.message().c_str(), message.c_str());
                return 2;
            }
            is_good = run(camera, nullptr, truth, frames == 0 ? UINT32_MAX : frames, input) && is_good;
            continue;
        }
        const std::size_t colon = input.find(':');
        const std::uint64_t first =
            colon == std::string::npos ? 1 : std::strtoull(input.c_str() + colon + 1, nullptr, 10);
        const std::uint64_t last = colon == std::string::npos ? seeds : first;
        for (std::uint64_t seed = first; seed <= last; ++seed) {
            SimulationOptions options;
            options.scene = input.substr(0, colon);
            options.seed = seed;
            options.frames = frames;
            SimulatedCamera camera(options);
            if (camera.open() != Status::kOk) {
                std::fprintf(stderr, "%s\n", camera.message().c_str());
                return 2;
            }
            is_good = run(camera, &camera, {}, UINT32_MAX, options.scene + ":" + std::to_string(seed)) && is_good;
        }
    }
    return is_good ? 0 : 1;
}
