// The whole program in a process of its own, under the private OpenNI2, to be watched and signalled.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "tests/openni2/rig.hpp"

namespace stillmesh::test {

// A folder that goes with the test.
class Scratch {
public:
    Scratch() {
        char name[] = "/tmp/stillmesh_live_XXXXXX";
        path_ = ::mkdtemp(name);
    }
    ~Scratch() { static_cast<void>(std::system(("rm -rf " + path_).c_str())); }
    Scratch(const Scratch&) = delete;
    Scratch& operator=(const Scratch&) = delete;
    [[nodiscard]] std::string path(const std::string& name) const { return path_ + "/" + name; }

private:
    std::string path_;
};

[[nodiscard]] inline std::string text_of(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

class Program {
public:
    Program(const std::string& program, const std::string& openni2_folder, const std::string& arguments,
            const Scratch& scratch)
        : out_(scratch.path("out_" + std::to_string(next_number()))), err_(out_ + ".err") {
        std::istringstream words(program + " " + arguments);
        std::vector<std::string> list{std::istream_iterator<std::string>(words), std::istream_iterator<std::string>()};
        std::vector<char*> argv;
        for (std::string& word : list) argv.push_back(word.data());
        argv.push_back(nullptr);
        pid_ = ::fork();
        if (pid_ == 0) {
            ::setenv("LD_LIBRARY_PATH", openni2_folder.c_str(), 1);
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
