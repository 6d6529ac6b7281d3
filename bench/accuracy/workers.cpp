#include "bench/accuracy/workers.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "bench/accuracy/results.hpp"
#include "engine/base/check.hpp"
#include "platform/linux/process.hpp"

namespace stillmesh::accuracy {
namespace {

// What a worker tells, a line each: "f N" frames passed, "r JSON" a result, "e SENTENCE" an error.
struct Worker {
    pid_t pid = 0;
    int pipe = -1;
    std::size_t input = 0;
    std::string unread;
    std::string error;
    std::vector<Result> results;
};

int told_to = -1;  // the pipe of this worker, for a failed check

void tell(int pipe, std::string_view line) {
    while (!line.empty()) {
        const ssize_t written = ::write(pipe, line.data(), line.size());
        if (written <= 0) return;  // nobody listens any more
        line.remove_prefix(static_cast<std::size_t>(written));
    }
}

[[noreturn]] void work(int pipe, const Input& input, const std::vector<Variant>& variants, const RunOptions& options) {
    std::signal(SIGINT, SIG_DFL);
    std::signal(SIGTERM, SIG_DFL);
    told_to = pipe;
    std::vector<Result> results;
    std::string message;
    std::uint32_t passed = 0;
    const auto on_frames = [&](std::uint32_t frames) {
        passed += frames;
        if (passed < 10) return;
        tell(pipe, fmt::format("f {}\n", passed));
        passed = 0;
    };
    bool is_good = false;
    try {
        is_good = run(input, variants, options, on_frames, results, message);
    } catch (const std::exception& error) {
        message = error.what();
    }
    tell(pipe, fmt::format("f {}\n", passed));
    for (const Result& result : results) tell(pipe, "r " + to_text(result) + "\n");
    if (!is_good) tell(pipe, "e " + message + "\n");
    ::_exit(is_good ? 0 : 1);
}

class ProgressLine {
public:
    explicit ProgressLine(std::size_t runs) : runs_(runs), is_terminal_(isatty(STDERR_FILENO) == 1) {}
    void show(std::size_t done, std::uint64_t frames) {
        const std::int64_t now_ns = monotonic_ns();
        if (!is_terminal_ || now_ns - shown_ns_ < 200'000'000) return;
        shown_ns_ = now_ns;
        const double seconds = static_cast<double>(now_ns - begin_ns_) * 1e-9;
        fmt::print(stderr, "\r\x1b[K{} of {} runs, {} frames, {:.0f} s, {:.0f} frames/s", done, runs_, frames, seconds,
                   static_cast<double>(frames) / seconds);
        std::fflush(stderr);
    }
    void end() const {
        if (is_terminal_) fmt::print(stderr, "\r\x1b[K");
    }

private:
    std::size_t runs_;
    bool is_terminal_;
    std::int64_t begin_ns_ = monotonic_ns();
    std::int64_t shown_ns_ = 0;
};

std::string name_of(const Input& input) {
    const std::string name = input.is_recording ? input.scene : fmt::format("{}:{}", input.scene, input.seed);
    return input.dirt_name.empty() ? name : fmt::format("{} ({})", name, input.dirt_name);
}

}  // namespace

Outcome run_all(const std::vector<Input>& inputs, const std::vector<Variant>& variants, const RunOptions& options,
                std::uint32_t jobs) {
    catch_stop_signals();
    Outcome out;
    std::map<std::size_t, std::vector<Result>> results;
    std::vector<Worker> workers;
    std::size_t next = 0;
    std::size_t done = 0;
    std::uint64_t frames = 0;
    ProgressLine progress(inputs.size());
    while ((next < inputs.size() || !workers.empty()) && stop_signal() == 0) {
        while (workers.size() < jobs && next < inputs.size()) {
            int ends[2];
            if (::pipe(ends) != 0) std::abort();
            std::fflush(nullptr);
            const pid_t pid = ::fork();
            if (pid < 0) std::abort();
            if (pid == 0) {
                ::close(ends[0]);
                work(ends[1], inputs[next], variants, options);
            }
            ::close(ends[1]);
            Worker worker;
            worker.pid = pid;
            worker.pipe = ends[0];
            worker.input = next++;
            workers.push_back(std::move(worker));
        }
        std::vector<pollfd> waits;
        for (const Worker& worker : workers) waits.push_back({worker.pipe, POLLIN, 0});
        if (::poll(waits.data(), waits.size(), 500) < 0) continue;  // a signal
        for (std::size_t i = workers.size(); i-- > 0;) {
            if (waits[i].revents == 0) continue;
            Worker& worker = workers[i];
            char buffer[65536];
            const ssize_t size = ::read(worker.pipe, buffer, sizeof buffer);
            if (size > 0) worker.unread.append(buffer, static_cast<std::size_t>(size));
            for (std::size_t end; (end = worker.unread.find('\n')) != std::string::npos;) {
                const std::string line = worker.unread.substr(0, end);
                worker.unread.erase(0, end + 1);
                if (line.starts_with("f ")) frames += std::strtoull(line.c_str() + 2, nullptr, 10);
                if (line.starts_with("e ")) worker.error = line.substr(2);
                Result result;
                if (line.starts_with("r ") && from_text(std::string_view(line).substr(2), result)) {
                    worker.results.push_back(std::move(result));
                }
            }
            if (size > 0) continue;
            int status = 0;
            ::waitpid(worker.pid, &status, 0);
            ::close(worker.pipe);
            if (stop_signal() == 0 && (status != 0 || worker.results.size() != variants.size())) {
                if (worker.error.empty()) worker.error = fmt::format("the run ended with status {:#x}", status);
                out.failures.push_back(name_of(inputs[worker.input]) + ": " + worker.error);
            }
            results[worker.input] = std::move(worker.results);
            workers.erase(workers.begin() + static_cast<std::ptrdiff_t>(i));
            ++done;
        }
        progress.show(done, frames);
    }
    for (const Worker& worker : workers) {  // only after a signal
        ::kill(worker.pid, SIGTERM);
        ::waitpid(worker.pid, nullptr, 0);
        ::close(worker.pipe);
    }
    progress.end();
    out.is_stopped = stop_signal() != 0;
    for (auto& [input, of_input] : results) {
        for (Result& result : of_input) out.results.push_back(std::move(result));
    }
    return out;
}

}  // namespace stillmesh::accuracy

// Links into whatever runs workers; outside of one, standard error hears it.
void stillmesh_check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    char text[512];
    const int size = std::snprintf(text, sizeof text, "e check failed: %s (%s:%d)\n", expression, file, line);
    if (size <= 0) return;
    const int pipe = stillmesh::accuracy::told_to;
    stillmesh::accuracy::tell(pipe < 0 ? STDERR_FILENO : pipe,
                              {text, std::min(static_cast<std::size_t>(size), sizeof text - 1)});
}
