// A program in a process of its own, with a folder of libraries before the system's, to be watched and signalled.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/temporary_folder.hpp"

namespace stillmesh::test {

[[nodiscard]] inline std::int64_t now_ns(clockid_t clock = CLOCK_MONOTONIC) {
    timespec now{};
    ::clock_gettime(clock, &now);
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// Whether `what` becomes true in time. For hangs, not for measuring: where other programs have the processor, and this
// one is woken late, what it overslept does not count, since whoever it watches has waited as well; twenty times as
// long is the end all the same.
inline bool within(std::int64_t timeout_ms, const std::function<bool()>& what) {
    constexpr std::int64_t kCounted_ns = 5'000'000;  // of one sleep of 2 ms
    const std::int64_t begin_ns = now_ns();
    std::int64_t left_ns = timeout_ms * 1'000'000;
    for (std::int64_t last_ns = begin_ns; !what();) {
        const std::int64_t time_ns = now_ns();
        left_ns -= std::min(time_ns - last_ns, kCounted_ns);
        last_ns = time_ns;
        if (left_ns < 0 || time_ns - begin_ns > 20 * timeout_ms * 1'000'000) return false;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return true;
}

[[nodiscard]] inline std::string text_of(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

class Program {
public:
    Program(const std::string& program, const std::string& library_folder, const std::string& arguments,
            const TemporaryFolder& scratch)
        : out_(scratch.path("out_" + std::to_string(next_number()))), err_(out_ + ".err") {
        std::istringstream words(program + " " + arguments);
        std::vector<std::string> list{std::istream_iterator<std::string>(words), std::istream_iterator<std::string>()};
        std::vector<char*> argv;
        for (std::string& word : list) argv.push_back(word.data());
        argv.push_back(nullptr);
        pid_ = ::fork();
        if (pid_ == 0) {
            ::setenv("LD_LIBRARY_PATH", library_folder.c_str(), 1);
            const int out = ::open(out_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            const int err = ::open(err_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
            ::dup2(out, 1);
            ::dup2(err, 2);
            ::execv(argv[0], argv.data());
            ::_exit(127);
        }
    }
    ~Program() {
        if (!has_ended_) {
            ::kill(pid_, SIGKILL);
            static_cast<void>(wait(10'000));
        }
    }
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

    [[nodiscard]] pid_t pid() const { return pid_; }
    void signal(int number) const { ::kill(pid_, number); }
    // Its exit code; -1: still running after so long; -2: it crashed.
    [[nodiscard]] int wait(std::int64_t timeout_ms) {
        int status = 0;
        if (!has_ended_ && !within(timeout_ms, [&] { return ::waitpid(pid_, &status, WNOHANG) == pid_; })) return -1;
        if (!has_ended_) code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -2;
        has_ended_ = true;
        return code_;
    }
    [[nodiscard]] std::string out() const { return text_of(out_); }
    [[nodiscard]] std::string err() const { return text_of(err_); }

private:
    static int next_number() {
        static int number = 0;
        return number++;
    }
    std::string out_, err_;
    pid_t pid_ = 0;
    bool has_ended_ = false;
    int code_ = -1;
};

}  // namespace stillmesh::test
