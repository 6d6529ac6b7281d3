// A domain of ROS 2 for one test program: on the loopback alone, and with a number that another test program that runs
// at the same time hardly has. To be made before anything of DDS is.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <string>

namespace stillmesh::test {

inline void enter_own_ros_domain() {
    // Domains to 101 have ports below those that the system gives away.
    const std::string domain = std::to_string(1 + ::getpid() % 100);
    ::setenv("ROS_DOMAIN_ID", domain.c_str(), 1);
    ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
    ::unsetenv("CYCLONEDDS_URI");
}

}  // namespace stillmesh::test
