// A domain of ROS 2 for one test program: on the loopback alone, and no other test program's while this one runs. To be
// made before anything of DDS is.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace stillmesh::test {

// The number is held by a lock on a file, until this process ends. Of the process's number it was taken before: two
// that ran at the same time had numbers a hundred apart often enough, for each thread takes one.
inline void enter_own_ros_domain() {
    // Domains to 101 have ports below those that the system gives away.
    constexpr int kDomains = 101;
    int domain = 1 + ::getpid() % kDomains;
    for (int tried = 0; tried < kDomains; ++tried, domain = 1 + domain % kDomains) {
        const std::string name = "stillmesh_test_domain_" + std::to_string(domain);
        const std::string path = std::filesystem::temp_directory_path() / name;
        const int lock = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
        if (lock >= 0 && ::flock(lock, LOCK_EX | LOCK_NB) == 0) break;
        if (lock >= 0) ::close(lock);
    }
    ::setenv("ROS_DOMAIN_ID", std::to_string(domain).c_str(), 1);
    ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
    ::unsetenv("CYCLONEDDS_URI");
}

}  // namespace stillmesh::test
