// Writes a small recording of a simulated scene in the TUM layout, with its truth:
//   small_recording SCENE SEED DAY FRAMES WIDTH HEIGHT DIR
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/record/frame_folder_writer.hpp"

using namespace stillmesh;

int main(int argc, char** argv) {
    if (argc != 8) {
        std::fputs("usage: small_recording SCENE SEED DAY FRAMES WIDTH HEIGHT DIR\n", stderr);
        return 2;
    }
    const auto number = [&](int i) { return static_cast<std::uint32_t>(std::strtoul(argv[i], nullptr, 10)); };
    SimulationOptions options;
    options.scene = argv[1];
    options.seed = number(2);
    options.day = number(3);
    options.frames = number(4);
    options.width = number(5);
    options.height = number(6);
    SimulatedCamera camera(options);
    FrameFolderWriter writer;
    std::string message;
    if (camera.open() != Status::kOk || !writer.open(argv[7], camera.info(), message)) {
        std::fprintf(stderr, "%s%s\n", camera.message().c_str(), message.c_str());
        return 1;
    }
    std::string truth = "# timestamp tx ty tz qx qy qz qw (camera to world)\n";
    Frame frame;
    while (camera.poll(frame) == Status::kOk) {
        writer.wait_for_room(std::chrono::seconds(60));
        writer.add(frame);
        const SimulatedPose& pose = camera.true_pose();
        truth += pose_line({pose.time_ns, pose.t, pose.q});
    }
    message = writer.close();
    std::ofstream(std::string(argv[7]) + "/groundtruth.txt") << truth;
    if (!message.empty()) std::fprintf(stderr, "%s\n", message.c_str());
    return message.empty() ? 0 : 1;
}
