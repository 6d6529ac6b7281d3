// The library that holds ROS 2, as the program opens it: where there is none, where it is none, and another's.
#include "platform/ros2/ros2_module.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temporary_folder.hpp"

namespace stillmesh {
namespace {

// Promise: beside this program there is none, which is said with both places that were looked at and what to do.
TEST(Ros2Module, WhereThereIsNone) {
    std::string message;
    EXPECT_EQ(ros2_module(message), nullptr);
    EXPECT_TRUE(message.starts_with("needs Cyclone DDS, which is not in this build (neither /")) << message;
    for (const char* const word :
         {"/tests/ros2/libstillmesh_ros2.so nor /", "/stillmesh/libstillmesh_ros2.so is there)",
          "cyclonedds-dev cyclonedds-tools", "-DSTILLMESH_WITH_ROS2=ON"}) {
        EXPECT_NE(message.find(word), std::string::npos) << message;
    }
    EXPECT_EQ(message.find("/../"), std::string::npos) << message;
}

// Promise: what cannot be loaded is named, with the system's reason.
TEST(Ros2Module, AFileThatIsNoLibrary) {
    const test::TemporaryFolder scratch;
    const std::string file = scratch.path("libstillmesh_ros2.so");
    std::ofstream(file) << "no library\n";
    std::string message;
    EXPECT_EQ(ros2_module_in(file, message), nullptr);
    EXPECT_TRUE(message.starts_with("needs " + file + ", which cannot be loaded: ")) << message;
}

// Promise: a library of another version is refused, with both versions, and nothing of it is called but its version.
TEST(Ros2Module, OfAnotherVersion) {
    std::string message;
    EXPECT_EQ(ros2_module_in(STILLMESH_OTHER_MODULE, message), nullptr);
    EXPECT_NE(message.find("which is of version 0.0.0: install both from one build."), std::string::npos) << message;
}

}  // namespace
}  // namespace stillmesh
