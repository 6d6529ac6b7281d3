// Where a robot says that its camera is.
#include "platform/ros2/ros_base.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>

#include "tests/ros2/fast_dds.hpp"

namespace stillmesh::base_test {
namespace {

namespace fast = test::fast;

// A robot of Fast DDS: its camera's lens ten times a second, and where the camera is if it says so.
class Robot {
public:
    Robot(const std::string& name, bool has_description)
        : info_(node_, name + "/camera/color/camera_info", {.depth = 2}),
          frames_(node_, name + "/tf_static", {.is_latched = true, .depth = 1}) {
        if (has_description) {
            fast::TransformStamped one;
            one.header.frame_id = "base_link";
            one.child_frame_id = "lens";
            one.transform.p = {0.1, 0.2, 0.3};
            one.transform.q = {-0.5, 0.5, -0.5, 0.5};  // an optical frame that looks ahead
            EXPECT_TRUE(frames_.write({{one}}));
        }
        thread_ = std::jthread([this](const std::stop_token& stop) {
            while (!stop.stop_requested()) {
                fast::CameraInfo lens;
                lens.header.frame_id = "lens";
                static_cast<void>(info_.write(lens));
                std::this_thread::sleep_for(std::chrono::milliseconds(100));
            }
        });
    }

private:
    fast::Node node_;
    fast::Node::Writer<fast::CameraInfo> info_;
    fast::Node::Writer<fast::Tf> frames_;
    std::jthread thread_;
};

[[nodiscard]] RosBaseQuestion question_of(const std::string& name) {
    return {.topics = name + "/camera/color/image_raw," + name + "/camera/depth/image_raw," + name +
                      "/camera/color/camera_info"};
}

// Promise: the camera is where the robot says, on /tf_static or on that of the camera's namespace, as camera_link (x
// ahead, y left, z up).
TEST(RosBase, IsWhereTheRobotSays) {
    for (const std::string name : {"", "/robot1"}) {
        const Robot robot(name, true);
        std::string message;
        const auto base_from_camera = base_from_camera_by_tf(question_of(name), message);
        ASSERT_TRUE(base_from_camera.has_value()) << name << ": " << message;
        EXPECT_NEAR(base_from_camera->translation_m[0], 0.1, 1e-12);
        EXPECT_NEAR(base_from_camera->translation_m[1], 0.2, 1e-12);
        EXPECT_NEAR(base_from_camera->translation_m[2], 0.3, 1e-12);
        EXPECT_NEAR(base_from_camera->rotation_xyzw[3], 1, 1e-12);
    }
}

// Promise: without a description, or without a lens, nothing is waited for beyond kRosBaseWait_ms, and a sentence names
// both frames, or the topic, and the remedy.
TEST(RosBase, MissingPartsAreNamed) {
    std::string message;
    {
        const Robot robot("", false);
        EXPECT_FALSE(base_from_camera_by_tf(question_of(""), message).has_value());
        EXPECT_EQ(message,
                  "/tf_static does not say how 'lens' lies to 'base_link': is the robot's description published "
                  "(robot_state_publisher)? Else give X,Y,Z.");
    }
    EXPECT_FALSE(base_from_camera_by_tf(question_of("/elsewhere"), message).has_value());
    EXPECT_TRUE(message.starts_with("no message on /elsewhere/camera/color/camera_info names the camera's frame"))
        << message;
}

}  // namespace
}  // namespace stillmesh::base_test
