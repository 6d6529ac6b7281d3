// What whole recordings cost: milliseconds per frame and stage, processor seconds, peak memory, heap calls after
// create, and the error of the path; beside it cv::ORB (1000 features, 8 levels, one thread) on the same frames, after
// the engine is gone. `bench_sequence DIR...`; each folder is tracked once, in the same process.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <string>

#include "hal/replay/replay_camera.hpp"
#include "platform/cli/engine_session.hpp"
#include "platform/cli/summary.hpp"
#include "platform/linux/process.hpp"
#ifdef STILLMESH_HAS_OPENCV
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#endif

// Every heap call of the program comes by here (operator new too); they are counted only while the engine has the word.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
}

namespace {
bool is_counting = false;
unsigned long long heap_calls = 0;
void count_heap_call() {
    if (is_counting) ++heap_calls;
}
}  // namespace

extern "C" {
void* malloc(std::size_t size) noexcept {
    count_heap_call();
    return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
    count_heap_call();
    return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
    count_heap_call();
    return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
    count_heap_call();
    return __libc_memalign(alignment, size);
}
}

namespace stillmesh {
namespace {

int complain(const std::string& sentence) {
    std::fprintf(stderr, "bench_sequence: %s\n", sentence.c_str());
    return 1;
}

#ifdef STILLMESH_HAS_OPENCV
// The peer's time for the folder's frames; empty when they cannot be read again.
Percentiles orb_ms(const std::string& folder) {
    Percentiles out;
    ReplayOptions options;
    options.folder = folder;
    ReplayCamera camera(options);
    if (camera.open() != Status::kOk) return out;
    cv::setNumThreads(1);
    const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2F, 8);
    for (Frame frame;;) {
        const Status polled = camera.poll(frame);
        if (polled == Status::kEnd) return out;
        if (polled != Status::kOk) continue;
        cv::Mat grey(static_cast<int>(frame.colour.height), static_cast<int>(frame.colour.width), CV_8UC1);
        const std::uint32_t channels = channels_of(frame.format);
        for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
            const std::uint8_t* const from = frame.colour.row(y) + channels / 2;  // green stands for grey
            for (std::uint32_t x = 0; x < frame.colour.width; ++x) {
                grey.at<std::uint8_t>(static_cast<int>(y), static_cast<int>(x)) = from[x * channels];
            }
        }
        std::vector<cv::KeyPoint> keypoints;
        cv::Mat descriptors;
        const std::int64_t begin_ns = monotonic_ns();
        orb->detectAndCompute(grey, cv::noArray(), keypoints, descriptors);
        out.add(static_cast<float>(monotonic_ns() - begin_ns) * 1e-6F);
    }
}
#endif

int measure(const std::string& folder, const SessionOptions& options) {
    std::string message;
    SessionSizes sizes;
    if (session_sizes(options, sizes, message) != Status::kOk) return complain(message);
    ReplayCamera camera(
        {.folder = folder, .calibration = "", .width_max = sizes.width_max, .height_max = sizes.height_max});
    if (camera.open() != Status::kOk) return complain(camera.message());
    RunRecord record;
    const std::string truth_file = folder + "/groundtruth.txt";
    std::error_code error;
    if (std::filesystem::exists(truth_file, error) &&
        read_trajectory(truth_file, record.truth, message) != Status::kOk) {
        return complain(message);
    }
    std::unique_ptr<TrackingSession> session;
    if (create_engine_session(options, camera.info(), session, message) != Status::kOk) return complain(message);
    heap_calls = 0;
    double engine_cpu_seconds = 0;
    for (;;) {
        Frame frame;
        const Status polled = camera.poll(frame);
        if (polled == Status::kEnd) break;
        if (polled != Status::kOk) return complain(camera.message());
        SessionFrame out;
        const double cpu_begin = cpu_seconds();
        const std::int64_t begin_ns = monotonic_ns();
        is_counting = true;
        const Status submitted = session->submit(frame, out, message);
        const std::int64_t end_ns = monotonic_ns();
        if (submitted == Status::kOk) session->work(std::nullopt, out);
        is_counting = false;
        engine_cpu_seconds += cpu_seconds() - cpu_begin;
        if (submitted != Status::kOk) return complain(message);
        out.world_from_camera.time_ns = frame.time_ns;
        if (out.state >= PoseState::kUnsure) record.estimate.push_back(out.world_from_camera);
        record.state_hash = out.state_hash;
        record.add({frame.time_ns, static_cast<float>(end_ns - begin_ns) * 1e-6F, out.features, out.static_features,
                    out.dynamic_features, out.state, out.unsure});
    }
    session->account(record);
    session.reset();
    record.evaluation = evaluate(record.truth, record.estimate);
    record.peak_resident_bytes = peak_resident_bytes();

    fmt::print("\n{}\n{}", folder, summary_text(record, ""));
    fmt::print("processor     {:.2f} s inside the engine, {:.2f} ms per frame\n", engine_cpu_seconds,
               1000 * engine_cpu_seconds / static_cast<double>(std::max<std::uint64_t>(record.frames_total, 1)));
    fmt::print("heap calls    {} inside the engine after create\n", heap_calls);
    fmt::print("{:<24} {:>10} {:>10} {:>10}\n", "stage", "median ms", "p99 ms", "max ms");
    for (const StageRecord& stage : record.stages) {
        fmt::print("{:<24} {:>10.3f} {:>10.3f} {:>10.3f}\n", stage.name, stage.ms.median(), stage.ms.p99(),
                   stage.ms.max());
    }
#ifdef STILLMESH_HAS_OPENCV
    const Percentiles orb = orb_ms(folder);
    if (orb.median() > 0) {
        fmt::print("{:<24} {:>10.3f} {:>10.3f} {:>10.3f}\n", "cv::ORB", orb.median(), orb.p99(), orb.max());
        fmt::print("a whole frame takes {:.2f} times cv::ORB (medians)\n", record.frame_ms.median() / orb.median());
    }
#endif
    // cv::ORB calls the heap on every image; the engine never does.
    const bool is_good = heap_calls == 0 || options.features != "native";
    return is_good ? 0 : complain(folder + ": the engine called the heap.");
}

}  // namespace
}  // namespace stillmesh

void stillmesh_check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    std::fprintf(stderr, "bench_sequence: check failed: %s (%s:%d)\n", expression, file, line);
}

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fprintf(stderr, "usage: bench_sequence [--limits room|pocket] [--features native|opencv] DIR...\n");
        return 2;
    }
    int code = 0;
    stillmesh::SessionOptions options;
    try {
        for (int i = 1; i < argc; ++i) {
            const std::string argument = argv[i];
            if (argument == "--limits" && i + 1 < argc) {
                options.limits = argv[++i];
            } else if (argument == "--features" && i + 1 < argc) {
                options.features = argv[++i];
            } else {
                code |= stillmesh::measure(argument, options);
            }
        }
    } catch (const std::exception& error) {
        return stillmesh::complain(error.what());
    }
    return code;
}
