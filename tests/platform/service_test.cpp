// The program as a service: what it tells systemd, what signals do, and what real time is refused.
#include "platform/linux/service.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>

namespace stillmesh {
namespace {

[[nodiscard]] std::string text_of(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

[[nodiscard]] std::size_t poses_of(const std::filesystem::path& file) {
    std::ifstream in(file);
    std::size_t poses = 0;
    for (std::string line; std::getline(in, line);) poses += !line.empty() && line[0] != '#';
    return poses;
}

struct Folder {
    std::filesystem::path path;
    Folder() {
        std::string name = (std::filesystem::temp_directory_path() / "stillmesh_service_XXXXXX").string();
        path = ::mkdtemp(name.data());
    }
    ~Folder() {
        std::error_code error;
        std::filesystem::remove_all(path, error);
    }
};

// stillmesh run --simulate ... --trajectory FILE, as a child.
[[nodiscard]] pid_t start(const std::string& trajectory, const std::string& frames) {
    const pid_t child = ::fork();
    if (child == 0) {
        static_cast<void>(std::freopen("/dev/null", "w", stdout));
        static_cast<void>(std::freopen("/dev/null", "w", stderr));
        ::execl(STILLMESH_PROGRAM, "stillmesh", "run", "--simulate", "sitting_xyz:1", "--limits", "pocket", "--frames",
                frames.c_str(), "--trajectory", trajectory.c_str(), static_cast<char*>(nullptr));
        ::_exit(99);
    }
    return child;
}

template <typename Condition>
[[nodiscard]] bool comes_true(Condition condition) {
    for (int i = 0; i < 12'000; ++i) {
        if (condition()) return true;
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
}

// Promise: after SIGHUP a trajectory that was moved away is begun anew under its name, and no pose is lost on the way;
// SIGTERM then ends the run in less than two seconds (on a processor, not an emulator) with 143.
TEST(Service, ReopensTheTrajectory) {
    const Folder folder;
    const std::string name = folder.path / "t.txt";
    const std::string moved = folder.path / "t.txt.1";
    const pid_t child = start(name, "100000");
    ASSERT_GT(child, 0);
    ASSERT_TRUE(comes_true([&] { return poses_of(name) >= 2; }));
    std::filesystem::rename(name, moved);
    ASSERT_EQ(::kill(child, SIGHUP), 0);
    ASSERT_TRUE(comes_true([&] { return poses_of(name) >= 2; }));
    ASSERT_EQ(::kill(child, SIGHUP), 0);  // nobody moved it: it is added to
    const std::size_t before = poses_of(name);
    ASSERT_TRUE(comes_true([&] { return poses_of(name) >= before + 2; }));
    ASSERT_EQ(::kill(child, SIGTERM), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 143);
    // Every line ends, and the second file goes on where the first one ended: 30 frames a second, none missing.
    const std::string all = text_of(moved) + text_of(name);
    double last = -1;
    std::size_t begin = 0;
    while (begin < all.size()) {
        const std::size_t end = all.find('\n', begin);
        ASSERT_NE(end, std::string::npos);
        const std::string line = all.substr(begin, end - begin);
        begin = end + 1;
        if (line.empty() || (line[0] == '#' && line.rfind("# predicted ", 0) != 0)) continue;
        const double time = std::stod(line[0] == '#' ? line.substr(12) : line);
        if (last >= 0) {
            EXPECT_NEAR(time - last, 1.0 / 30, 0.001);
        }
        last = time;
    }
}

// Promise: systemd hears READY, then WATCHDOG at least thrice a period, then STOPPING.
TEST(Service, TellsTheServiceManager) {
    const Folder folder;
    const std::string address_name = folder.path / "notify";
    const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ASSERT_GE(socket, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    ASSERT_LT(address_name.size(), sizeof address.sun_path);
    std::memcpy(address.sun_path, address_name.c_str(), address_name.size());
    ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const timeval patience{60, 0};
    ASSERT_EQ(::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience), 0);
    ASSERT_EQ(::setenv("NOTIFY_SOCKET", address_name.c_str(), 1), 0);
    ASSERT_EQ(::setenv("WATCHDOG_USEC", "30000", 1), 0);
    const pid_t child = start(folder.path / "t.txt", "100000");
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
    ASSERT_GT(child, 0);
    const auto heard = [&] {
        char text[64];
        const ssize_t size = ::recv(socket, text, sizeof text, 0);
        return size > 0 ? std::string(text, static_cast<std::size_t>(size)) : std::string("nothing");
    };
    EXPECT_EQ(heard(), "READY=1");
    for (int i = 0; i < 3; ++i) EXPECT_EQ(heard(), "WATCHDOG=1");
    ASSERT_EQ(::kill(child, SIGTERM), 0);
    std::string last;
    for (int i = 0; i < 1000 && last != "STOPPING=1" && last != "nothing"; ++i) last = heard();
    EXPECT_EQ(last, "STOPPING=1");
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ::close(socket);
}

// Promise: the watchdog is told three times a period and no more, and nobody is told anything where nobody asked.
TEST(Service, SaysNothingUnasked) {
    ServiceNotifier notifier;
    notifier.ready();
    notifier.alive(1);
    notifier.stopping();
    ASSERT_EQ(::setenv("NOTIFY_SOCKET", "relative", 1), 0);
    ServiceNotifier wrong;
    wrong.ready();
    ASSERT_EQ(::setenv("NOTIFY_SOCKET", "/no/such/socket", 1), 0);
    ServiceNotifier gone;
    gone.ready();
    ::unsetenv("NOTIFY_SOCKET");
}

// Promise: without the right to it, real time says what it did not get and how to get it.
TEST(Service, SaysWhatRealTimeLacks) {
    int fds[2];
    ASSERT_EQ(::pipe(fds), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        const rlimit none{0, 0};
        static_cast<void>(::setrlimit(RLIMIT_MEMLOCK, &none));
        static_cast<void>(::setrlimit(RLIMIT_RTPRIO, &none));
        if (::getuid() == 0 && ::setuid(65534) != 0) ::_exit(99);
        const std::string sentence = become_realtime();
        static_cast<void>(::write(fds[1], sentence.data(), sentence.size()));
        ::_exit(0);
    }
    ASSERT_GT(child, 0);
    ::close(fds[1]);
    std::string sentence;
    char text[256];
    for (ssize_t size = 0; (size = ::read(fds[0], text, sizeof text)) > 0;)
        sentence.append(text, static_cast<std::size_t>(size));
    ::close(fds[0]);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_EQ(WEXITSTATUS(status), 0);
    EXPECT_NE(sentence.find("LimitRTPRIO=20"), std::string::npos) << sentence;
    EXPECT_NE(sentence.find("LimitMEMLOCK=infinity"), std::string::npos) << sentence;
}

}  // namespace
}  // namespace stillmesh
