// cv::Mat in, pose out: BGR and depth in float metres, as OpenCV and ROS have them.
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "engine/engine.hpp"
#include "platform/library/opencv_frame.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "wall.hpp"

int main() {
    using namespace stillmesh;
    const Limits limits = Limits::pocket();
    MemoryBlock block;
    if (!block.allocate(bytes_needed(limits))) return 1;
    const auto made =
        Engine::create(block.bytes(), limits, Configuration::for_limits(limits), Wall::kCamera, cpu_kernels());
    if (!made.is_ok()) return 1;
    Engine& engine = *made.value();
    Wall wall;
    CvFrame frames;  // keeps what has to be converted
    for (std::uint32_t i = 0; i < 5; ++i) {
        const Frame seen = wall.frame(i, 6 * i);
        cv::Mat bgr(480, 640, CV_8UC3), metres(480, 640, CV_32FC1, cv::Scalar(2));
        for (int at = 0; at < 480 * 640; ++at) bgr.at<cv::Vec3b>(at) = cv::Vec3b::all(seen.colour.data[at]);

        Frame frame;
        if (frames.from(bgr, metres, seen.time_ns, frame) != Status::kOk) return 1;
        if (engine.submit(frame) != Status::kOk) return 1;
        engine.step(20000);
        const PoseEstimate& pose = engine.pose();
        std::printf("frame %u: %s, %.3f m along the wall\n", i, pose_state_name(pose.state),
                    pose.odom_from_camera.translation_m[0]);
    }
}
