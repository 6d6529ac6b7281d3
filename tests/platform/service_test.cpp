// The program as a service: what it tells systemd, what signals do, and what real time is refused.
#include "platform/linux/service.hpp"

#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
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
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "engine/record/map_file.hpp"

namespace stillmesh::service_test {
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

[[nodiscard]] std::size_t count_of(const std::string& text, const std::string& word) {
    std::size_t count = 0;
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++count;
    return count;
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

// stillmesh with these arguments, as a child; `log`: where its standard error goes. `is_journal`: that is systemd's
// journal, as far as it can know.
[[nodiscard]] pid_t start(std::vector<std::string> arguments, const std::string& log = "/dev/null",
                          bool is_journal = false) {
    arguments.insert(arguments.begin(), "stillmesh");
    std::vector<char*> words;
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
        if (std::freopen("/dev/null", "w", stdout) == nullptr) ::_exit(98);
        if (std::freopen(log.c_str(), "w", stderr) == nullptr) ::_exit(98);
        struct stat file {};
        static_cast<void>(::fstat(STDERR_FILENO, &file));
        const std::string stream = std::to_string(file.st_dev) + ":" + std::to_string(file.st_ino + !is_journal);
        static_cast<void>(::setenv("JOURNAL_STREAM", stream.c_str(), 1));
        ::execv(STILLMESH_PROGRAM, words.data());
        ::_exit(99);
    }
    return child;
}

// stillmesh run --simulate ... --trajectory FILE.
[[nodiscard]] pid_t start_run(const std::string& trajectory) {
    return start(
        {"run", "--simulate", "sitting_xyz:1", "--limits", "pocket", "--frames", "100000", "--trajectory", trajectory});
}

[[nodiscard]] int exit_code_of(pid_t child) {
    int status = 0;
    if (::waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
    return WEXITSTATUS(status);
}

// SIGTERM; what it then ends with, and how long that took.
[[nodiscard]] int stop(pid_t child, double& seconds) {
    const auto begin = std::chrono::steady_clock::now();
    if (::kill(child, SIGTERM) != 0) return -1;
    const int code = exit_code_of(child);
    seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return code;
}

// An emulated processor needs longer for the frame in hand than a board does.
#ifdef STILLMESH_IS_EMULATED
constexpr double kStopMax_s = 30;
#else
constexpr double kStopMax_s = 2;
#endif

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
    const pid_t child = start_run(name);
    ASSERT_GT(child, 0);
    ASSERT_TRUE(comes_true([&] { return poses_of(name) >= 2; }));
    std::filesystem::rename(name, moved);
    ASSERT_EQ(::kill(child, SIGHUP), 0);
    ASSERT_TRUE(comes_true([&] { return poses_of(name) >= 2; }));
    ASSERT_EQ(::kill(child, SIGHUP), 0);  // nobody moved it: it is added to
    const std::size_t before = poses_of(name);
    ASSERT_TRUE(comes_true([&] { return poses_of(name) >= before + 2; }));
    double seconds = 0;
    EXPECT_EQ(stop(child, seconds), 143);
    EXPECT_LT(seconds, kStopMax_s);
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

// The end of the line that systemd listens at.
class Manager {
public:
    explicit Manager(const std::filesystem::path& name) : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        const std::string text = name;
        if (text.size() >= sizeof address.sun_path) return;
        std::memcpy(address.sun_path, text.c_str(), text.size());
        const timeval patience{60, 0};
        is_good_ = ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                   ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) == 0 &&
                   ::setenv("NOTIFY_SOCKET", text.c_str(), 1) == 0 && ::setenv("WATCHDOG_USEC", "30000", 1) == 0;
    }
    ~Manager() {
        ::unsetenv("NOTIFY_SOCKET");
        ::unsetenv("WATCHDOG_USEC");
        ::close(socket_);
    }
    Manager(const Manager&) = delete;
    Manager& operator=(const Manager&) = delete;
    [[nodiscard]] bool is_good() const { return is_good_; }
    [[nodiscard]] std::string heard() {
        char text[64];
        const ssize_t size = ::recv(socket_, text, sizeof text, 0);
        return size > 0 ? std::string(text, static_cast<std::size_t>(size)) : std::string("nothing");
    }

private:
    int socket_;
    bool is_good_ = false;
};

// Promise: systemd hears READY, then WATCHDOG at least thrice a period, then STOPPING.
TEST(Service, TellsTheServiceManager) {
    const Folder folder;
    Manager manager(folder.path / "notify");
    ASSERT_TRUE(manager.is_good());
    const pid_t child = start_run(folder.path / "t.txt");
    ASSERT_GT(child, 0);
    EXPECT_EQ(manager.heard(), "READY=1");
    for (int i = 0; i < 3; ++i) EXPECT_EQ(manager.heard(), "WATCHDOG=1");
    ASSERT_EQ(::kill(child, SIGTERM), 0);
    std::string last;
    for (int i = 0; i < 1000 && last != "STOPPING=1" && last != "nothing"; ++i) last = manager.heard();
    EXPECT_EQ(last, "STOPPING=1");
    EXPECT_EQ(exit_code_of(child), 143);
}

#ifdef STILLMESH_OPENNI2_FOLDER
// Promise: a service whose camera is not there yet has started, is alive, says what it waits for, and stops when told;
// every line of that is a warning in its journal.
TEST(Service, WaitsForItsCamera) {
    const Folder folder;
    Manager manager(folder.path / "notify");
    ASSERT_TRUE(manager.is_good());
    const std::string log = folder.path / "log";
#ifdef STILLMESH_IS_EMULATED
    // qemu-user looks into the sysroot for what is opened, not for folders that are changed into: OpenNI2 finds its
    // drivers only beside where it was really loaded from.
    ASSERT_EQ(::setenv("QEMU_SET_ENV", "LD_LIBRARY_PATH=" STILLMESH_OPENNI2_FOLDER, 1), 0);
#endif
    const pid_t child = start({"run", "--camera", "auto", "--wait"}, log, true);
    static_cast<void>(::unsetenv("QEMU_SET_ENV"));
    ASSERT_GT(child, 0);
    EXPECT_EQ(manager.heard(), "READY=1");
    for (int i = 0; i < 3; ++i) EXPECT_EQ(manager.heard(), "WATCHDOG=1");
    double seconds = 0;
    EXPECT_EQ(stop(child, seconds), 143);
    EXPECT_LT(seconds, kStopMax_s);
    const std::string said = text_of(log);
    const std::string wait = said.substr(0, said.find("Waiting for one"));
    EXPECT_EQ(wait.rfind("<4>stillmesh: ", 0), 0U) << said;
    const auto lines = std::count(wait.begin(), wait.end(), '\n') + 1;
    EXPECT_GE(lines, 2) << "one for each driver" << said;
    EXPECT_EQ(static_cast<std::ptrdiff_t>(count_of(wait, "<4>")), lines) << said;
}
#endif

// Promise: SIGTERM leaves the whole map on the disk, in less than two seconds.
TEST(Service, SavesTheMapInTime) {
    const Folder folder;
    const std::string map = folder.path / "room.map";
    const std::string path = folder.path / "t.txt";
    const pid_t child = start({"run", "--simulate", "static_loop:1", "--frames", "100000", "--map-every", "1000",
                               "--map-out", map, "--trajectory", path});
    ASSERT_GT(child, 0);
    ASSERT_TRUE(comes_true([&] { return poses_of(path) >= 30; }));
    EXPECT_FALSE(std::filesystem::exists(map));
    double seconds = 0;
    EXPECT_EQ(stop(child, seconds), 143);
    EXPECT_LT(seconds, kStopMax_s);
    const std::string bytes = text_of(map);
    MapFileInfo info;
    MapFileProblem problem;
    ASSERT_EQ(read_map_header(std::as_bytes(std::span(bytes)), info, problem), Status::kOk);
    EXPECT_EQ(info.size_bytes, bytes.size());
}

// Promise: in a journal every line says how grave it is, so that `journalctl -p` finds it; elsewhere, nothing is added.
TEST(Service, LinesAJournalCanFilter) {
    const Folder folder;
    const std::string log = folder.path / "log";
    EXPECT_EQ(exit_code_of(start({"run", "--replay", folder.path / "nowhere"}, log, true)), 2);
    EXPECT_EQ(text_of(log).rfind("<3>stillmesh: ", 0), 0U) << text_of(log);
    EXPECT_EQ(exit_code_of(start({"run", "--replay", folder.path / "nowhere"}, log, false)), 2);
    EXPECT_EQ(text_of(log).rfind("stillmesh: ", 0), 0U) << text_of(log);
    // What real time was refused is said when it begins, as a warning.
    const pid_t child = ::fork();
    if (child == 0) {
        const rlimit none{0, 0};
        static_cast<void>(::setrlimit(RLIMIT_MEMLOCK, &none));
        static_cast<void>(::setrlimit(RLIMIT_RTPRIO, &none));
        // What root's programs may begin with; nobody else has it anyway.
        static_cast<void>(::prctl(PR_CAPBSET_DROP, CAP_IPC_LOCK));
        static_cast<void>(::prctl(PR_CAPBSET_DROP, CAP_SYS_NICE));
        ::_exit(exit_code_of(start(
            {"run", "--simulate", "sitting_xyz:1", "--limits", "pocket", "--realtime", "--frames", "5"}, log, true)));
    }
    static_cast<void>(exit_code_of(child));
    const std::string said = text_of(log);
    EXPECT_NE(said.find("<4>stillmesh: real time without the kernel's help"), std::string::npos) << said;
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
        if (::write(fds[1], sentence.data(), sentence.size()) != static_cast<ssize_t>(sentence.size())) ::_exit(98);
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

// Promise: what real time does not name as refused, it has: locked memory, and a thread that ordinary ones wait for.
TEST(Service, HasWhatRealTimeWasGranted) {
    int fds[2];
    ASSERT_EQ(::pipe(fds), 0);
    const pid_t child = ::fork();
    if (child == 0) {
        const std::string sentence = become_realtime();
        const bool is_fifo = (::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO;
        std::ifstream file("/proc/self/status");
        unsigned long locked_kib = 0;
        for (std::string line; std::getline(file, line);) {
            if (line.rfind("VmLck:", 0) == 0) locked_kib = std::stoul(line.substr(6));
        }
        const bool says_memory = sentence.find("LimitMEMLOCK") != std::string::npos;
        const bool says_thread = sentence.find("LimitRTPRIO") != std::string::npos;
        const std::string found = std::to_string(locked_kib) + " KiB locked, " + (is_fifo ? "FIFO" : "ordinary") +
                                  ", said: '" + sentence + "'";
        if (::write(fds[1], found.data(), found.size()) != static_cast<ssize_t>(found.size())) ::_exit(98);
        ::_exit(says_memory == (locked_kib == 0) && says_thread == !is_fifo ? 0 : 1);
    }
    ASSERT_GT(child, 0);
    ::close(fds[1]);
    char text[512];
    const ssize_t size = ::read(fds[0], text, sizeof text);
    ::close(fds[0]);
    EXPECT_EQ(exit_code_of(child), 0) << std::string(text, static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
}

}  // namespace
}  // namespace stillmesh::service_test
