// A domain of ROS 2 for one test program: on the loopback alone, and no other test program's while this one runs. To be
// made before anything of DDS is.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace stillmesh::test {

// The number is held by a lock on a file, until this process ends. The process's own number, modulo 100, is not enough:
// each thread takes one, so that two tests that run side by side have numbers a hundred apart often enough.
inline void enter_own_ros_domain() {
    // Domains to 101 have ports below those that the system gives away.
    constexpr int kDomains = 101;
    for (int i = 0; i < kDomains; ++i) {
        const std::string domain = std::to_string(1 + (::getpid() + i) % kDomains);
        const std::string path = std::filesystem::temp_directory_path() / ("stillmesh_test_domain_" + domain);
        const int lock = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
        if (lock >= 0 && ::flock(lock, LOCK_EX | LOCK_NB) == 0) {
            ::setenv("ROS_DOMAIN_ID", domain.c_str(), 1);
            ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
            ::unsetenv("CYCLONEDDS_URI");
            return;
        }
        if (lock >= 0) ::close(lock);
    }
    std::fputs("101 tests have a domain of ROS 2 each, or no file can be made for the lock\n", stderr);
    std::exit(1);
}

}  // namespace stillmesh::test
