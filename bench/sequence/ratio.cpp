// Time of a whole tracked frame as a share of cv::ORB's (1000 features, 8 levels), on the same frames, in the same run,
// on one thread. The engine decides the same on every pass, so each frame is measured on several passes by both in turn
// and the minimum of each is kept: what else the machine does falls out. Exit 1 when the share exceeds --max.
//   tracking_ratio [--max SHARE] [--passes N] [--frames N] [--recording DIR | --scene NAME]
// Without either: fr1_rpy_a_walking of STILLMESH_TEST_DATA, or a simulated scene.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"

namespace {

using namespace stillmesh;

double now_ms() {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// A frame with its own pixels.
struct KeptFrame {
    Frame frame;
    cv::Mat grey, depth;
};

bool keep_frames(DepthCamera& camera, std::size_t count, std::vector<KeptFrame>& frames) {
    if (camera.open() != Status::kOk) return false;
    for (Frame frame; frames.size() < count;) {
        const Status status = camera.poll(frame);
        if (status == Status::kEnd) break;
        if (status != Status::kOk) continue;
        if (frame.format != PixelFormat::kGrey8) return false;
        KeptFrame kept{frame,
                       cv::Mat(static_cast<int>(frame.colour.height), static_cast<int>(frame.colour.width), CV_8UC1),
                       cv::Mat(static_cast<int>(frame.depth.height), static_cast<int>(frame.depth.width), CV_16UC1)};
        for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
            std::copy_n(frame.colour.row(y), frame.colour.width, kept.grey.ptr<std::uint8_t>(static_cast<int>(y)));
            std::copy_n(frame.depth.row(y), frame.depth.width, kept.depth.ptr<std::uint16_t>(static_cast<int>(y)));
        }
        kept.frame.colour = {kept.grey.data, frame.colour.width, frame.colour.height, frame.colour.width};
        kept.frame.depth = {kept.depth.ptr<std::uint16_t>(), frame.depth.width, frame.depth.height, frame.depth.width};
        frames.push_back(kept);
    }
    return frames.size() >= 10;
}

struct StageClock {
    double begin[kStages] = {};
    double spent[kStages] = {};
    static void on_stage(void* user, Stage stage, bool is_begin) noexcept {
        auto& clock = *static_cast<StageClock*>(user);
        const auto i = static_cast<std::uint32_t>(stage);
        is_begin ? clock.begin[i] = now_ms() : clock.spent[i] += now_ms() - clock.begin[i];
    }
};

double at_share(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

}  // namespace

int main(int argc, char** argv) {
    double share_max = 1e9;
    int passes = 4;
    std::size_t count = 120;
    std::string recording, scene;
    for (int i = 1; i < argc; i += 2) {
        const std::string option = argv[i];
        if (i + 1 == argc) {
            std::fprintf(stderr, "tracking_ratio: %s needs a value\n", argv[i]);
            return 2;
        }
        if (option == "--max") {
            share_max = std::atof(argv[i + 1]);
        } else if (option == "--passes") {
            passes = std::max(1, std::atoi(argv[i + 1]));
        } else if (option == "--frames") {
            count = std::strtoull(argv[i + 1], nullptr, 10);
        } else if (option == "--recording") {
            recording = argv[i + 1];
        } else if (option == "--scene") {
            scene = argv[i + 1];
        } else {
            std::fprintf(stderr, "tracking_ratio: unknown option %s\n", argv[i]);
            return 2;
        }
    }
    const char* const data = std::getenv("STILLMESH_TEST_DATA");
    if (recording.empty() && scene.empty() && data != nullptr) recording = std::string(data) + "/fr1_rpy_a_walking";
    if (recording.empty() && scene.empty()) scene = "walking_xyz";
    cv::setNumThreads(1);
    std::vector<KeptFrame> frames;
    CameraModel model;
    {
        ReplayOptions replay;
        replay.folder = recording;
        ReplayCamera replayed(replay);
        SimulationOptions simulation;
        simulation.scene = scene;
        simulation.frames = static_cast<std::uint32_t>(count);
        SimulatedCamera simulated(simulation);
        DepthCamera& camera = recording.empty() ? static_cast<DepthCamera&>(simulated) : replayed;
        if (!keep_frames(camera, count, frames)) {
            std::fprintf(stderr, "tracking_ratio: no grey frames. %s%s\n", replayed.message().c_str(),
                         simulated.message().c_str());
            return 2;
        }
        model = camera.info().model;
    }

    const Limits limits = Limits::room();
    MemoryBlock block;
    if (!block.allocate(bytes_needed(limits))) return 2;
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2F, 8);
    std::vector<double> ours(frames.size(), 1e9);
    std::vector<double> theirs(frames.size(), 1e9);
    std::vector<std::vector<double>> stages(kStages, std::vector<double>(frames.size(), 1e9));
    for (int pass = 0; pass < passes; ++pass) {
        const auto engine = Engine::create(block.bytes(), limits, Configuration::indoor(), model, cpu_kernels());
        if (!engine.is_ok()) return 2;
        StageClock clock;
        engine.value()->set_stage_observer({StageClock::on_stage, &clock});
        for (std::size_t i = 0; i < frames.size(); ++i) {
            clock = {};
            const double a = now_ms();
            if (engine.value()->submit(frames[i].frame) != Status::kOk) return 2;
            const double b = now_ms();
            std::vector<cv::KeyPoint> keypoints;
            cv::Mat descriptors;
            orb->detectAndCompute(frames[i].grey, cv::noArray(), keypoints, descriptors);
            const double c = now_ms();
            ours[i] = std::min(ours[i], b - a);
            theirs[i] = std::min(theirs[i], c - b);
            for (std::size_t s = 0; s < kStages; ++s) stages[s][i] = std::min(stages[s][i], clock.spent[s]);
        }
    }
    const double share = at_share(ours, 0.5) / at_share(theirs, 0.5);
    std::printf("%zu frames of %s, best of %d passes\n", frames.size(),
                recording.empty() ? scene.c_str() : recording.c_str(), passes);
    std::printf("%-12s %8s %8s %8s ms\n", "", "median", "p99", "max");
    const auto line = [](const char* name, const std::vector<double>& ms) {
        std::printf("%-12s %8.3f %8.3f %8.3f\n", name, at_share(ms, 0.5), at_share(ms, 0.99), at_share(ms, 1));
    };
    line("stillmesh", ours);
    for (std::uint32_t s = 0; s < kStages; ++s) {
        line((std::string("  ") + stage_name(static_cast<Stage>(s))).c_str(), stages[s]);
    }
    line("cv::ORB", theirs);
    std::printf("share of the medians %.3f (at most %.2f)\n", share, share_max);
    return share <= share_max ? 0 : 1;
}
