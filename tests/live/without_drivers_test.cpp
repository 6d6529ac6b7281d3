// A build without OpenNI2, libfreenect, libusb, V4L2 and Cyclone DDS: what the command line then says. Its sources are
// compiled here once more, without any of them, whatever is installed.
#include <gtest/gtest.h>

#include "platform/cli/cameras_command.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/live_camera.hpp"

#if defined(STILLMESH_HAS_OPENNI2) || defined(STILLMESH_HAS_FREENECT) || defined(STILLMESH_HAS_USB) || \
    defined(STILLMESH_HAS_V4L2)
#error "this test is about a build without them"
#endif

namespace stillmesh::without_drivers_test {
namespace {

// Promise: --camera says which library is missing, what installs it, and how to build with it; a name that is none gets
// the names there are.
TEST(WithoutDrivers, CameraSaysWhatIsMissing) {
    struct Case {
        const char* camera;
        const char* words[3];
    };
    for (const Case& c :
         {Case{"auto", {"needs OpenNI2, which is not in this build", "libopenni2-dev", "-DSTILLMESH_WITH_OPENNI2=ON"}},
          Case{"openni2", {"needs OpenNI2", "libopenni2-dev", "-DSTILLMESH_WITH_OPENNI2=ON"}},
          Case{"openni2:desk.oni", {"needs OpenNI2", "libopenni2-dev", "-DSTILLMESH_WITH_OPENNI2=ON"}},
          Case{"freenect", {"needs libfreenect", "libfreenect-dev", "-DSTILLMESH_WITH_FREENECT=ON"}},
          Case{"freenect:1", {"needs libfreenect", "libfreenect-dev", "-DSTILLMESH_WITH_FREENECT=ON"}},
          Case{"ros2", {"needs Cyclone DDS", "cyclonedds-dev cyclonedds-tools", "-DSTILLMESH_WITH_ROS2=ON"}},
          Case{"ros2:/a,/b,/c", {"needs Cyclone DDS", "cyclonedds-dev", "-DSTILLMESH_WITH_ROS2=ON"}},
          Case{"v4l2", {"needs the kernel's headers", "linux-libc-dev", "-DSTILLMESH_WITH_V4L2=ON"}},
          Case{"v4l2:/dev/video0,/dev/video4", {"needs the kernel's headers", "linux-libc-dev", "STILLMESH_WITH_V4L2"}},
          Case{"webcam", {"give auto, openni2", "openni2:FILE.oni", "freenect"}}}) {
        LiveCameraOptions options;
        options.camera = c.camera;
        std::string message;
        EXPECT_EQ(make_live_camera(options, message), nullptr);
        for (const char* const word : c.words) EXPECT_NE(message.find(word), std::string::npos) << message;
    }
}

// Promise: `stillmesh cameras` says the same of libusb; the rules it can still print.
TEST(WithoutDrivers, CamerasSaysWhatIsMissing) {
    testing::internal::CaptureStderr();
    EXPECT_EQ(cameras_command({}), kExitUsage);
    const std::string text = testing::internal::GetCapturedStderr();
    for (const char* const word : {"libusb", "libusb-1.0-0-dev", "-DSTILLMESH_WITH_USB=ON"}) {
        EXPECT_NE(text.find(word), std::string::npos) << text;
    }
    testing::internal::CaptureStdout();
    CamerasOptions rules;
    rules.is_udev_rules = true;
    EXPECT_EQ(cameras_command(rules), kExitDone);
    EXPECT_NE(testing::internal::GetCapturedStdout().find("ATTR{idVendor}"), std::string::npos);
}

}  // namespace
}  // namespace stillmesh::without_drivers_test
