// Names of ROS 2.
#include "hal/ros2/ros_name.hpp"

#include <gtest/gtest.h>

#include "hal/calibration/ros_topics.hpp"

namespace stillmesh::ros_name_test {
namespace {

// Promise: names are those that ROS 2 allows.
TEST(RosNames, AreThoseOfRos) {
    for (const char* const good : {"/odom", "odom", "robot1", "a/b_c/d2", "/camera/color/image_raw", "_x"})
        EXPECT_TRUE(is_ros_name(good)) << good;
    for (const char* const wrong : {"", "/", "//a", "a//b", "a/", "1a", "a/2b", "a b", "a-b", "a.b"})
        EXPECT_FALSE(is_ros_name(wrong)) << wrong;
}

// Promise: CameraInfo is looked for where image_transport puts it.
TEST(RosNames, CameraInfoLiesBesideItsImages) {
    EXPECT_EQ(info_beside("/camera/depth/image_rect_raw"), "/camera/depth/camera_info");
    EXPECT_EQ(info_beside("/camera/depth/image_raw/compressedDepth"), "/camera/depth/camera_info");
    EXPECT_EQ(info_beside("/a/image/compressed"), "/a/camera_info");
    EXPECT_EQ(info_beside("/image"), "/camera_info");
}

}  // namespace
}  // namespace stillmesh::ros_name_test
