#include "platform/cli/run_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <utility>

#include "hal/replay/replay_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/summary.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/service.hpp"
#include "platform/report/report.hpp"

namespace stillmesh {
namespace {

// A simulated camera that writes down where it truly was.
class TruthfulCamera final : public DepthCamera {
public:
    TruthfulCamera(SimulatedCamera& camera, Trajectory& truth) : camera_(camera), truth_(truth) {}

    Status open() noexcept override { return camera_.open(); }
    const CameraInfo& info() const noexcept override { return camera_.info(); }
    Status poll(Frame& frame) noexcept override {
        const Status status = camera_.poll(frame);
        if (status == Status::kOk) {
            const SimulatedPose& pose = camera_.true_pose();
            truth_.push_back({pose.time_ns, pose.t, pose.q});
        }
        return status;
    }
    Status wait(std::uint32_t timeout_ms) noexcept override { return camera_.wait(timeout_ms); }
    void close() noexcept override { camera_.close(); }

private:
    SimulatedCamera& camera_;
    Trajectory& truth_;
};

// Everything that is left once a camera is open. `record` says where the frames come from.
int track(DepthCamera& camera, const std::function<std::string()>& camera_message, std::uint64_t frames,
          const RunArguments& arguments, std::int64_t begin_ns, RunRecord& record) {
    std::string message;
    record.limits = arguments.session.limits;
    record.features = arguments.session.features;
    record.command = arguments.command;
    std::unique_ptr<TrackingSession> session;
    SessionOptions options = arguments.session;
    options.can_wait = !arguments.is_realtime;
    if (create_engine_session(options, camera.info(), session, message) != Status::kOk) return refuse(message);
    if (!arguments.report.empty()) {
        std::error_code error;
        std::filesystem::create_directories(arguments.report, error);
        if (error) return refuse(arguments.report + ": cannot be made: " + error.message() + ".");
    }
    FrameFolderWriter frames_writer;
    if (!arguments.record_frames.empty() && !frames_writer.open(arguments.record_frames, camera.info(), message)) {
        return refuse(message);
    }
    catch_stop_signals();
    catch_reopen_signal();
    record.start_up_ms = static_cast<double>(monotonic_ns() - begin_ns) * 1e-6;
    RunLoopOptions loop = arguments.loop;
    loop.frames_expected = loop.frames_max > 0 && loop.frames_max < frames ? loop.frames_max : frames;
    loop.snapshots_max = arguments.report.empty() ? 0 : 6;
    // 64 bytes a frame, for the error and the report only.
    loop.keep_trajectory = !arguments.report.empty() || !record.truth.empty() || !arguments.simulate.empty();
    loop.show_progress = !arguments.is_json;
    loop.frames = arguments.record_frames.empty() ? nullptr : &frames_writer;
    loop.frame_period_ns = static_cast<std::int64_t>(1e9 / camera.info().frames_per_s);
    RealtimeCamera realtime(camera, {monotonic_ns, sleep_until_ns});
    if (arguments.is_realtime) {
        if (realtime.open() != Status::kOk) return refuse("the system has no thread or memory left for --realtime.");
        loop.realtime = &realtime;
        if (const std::string refused = become_realtime(); !refused.empty()) record.notes.push_back(refused);
    }
    DepthCamera& served = arguments.is_realtime ? static_cast<DepthCamera&>(realtime) : camera;
    int code = run_loop(served, camera_message, *session, loop, record);
    realtime.close();
    session.reset();  // its memory is free for the evaluation

    if (!record.truth.empty()) record.evaluation = evaluate(record.truth, record.estimate);
    record.peak_resident_bytes = peak_resident_bytes();
    std::string report;
    if (!arguments.report.empty()) {
        report = arguments.report + "/index.html";
        if (!write_report(record, report, message)) {
            record.problems.push_back(message);
            report.clear();
            if (code == kExitDone) code = kExitFailed;
        }
    }
    std::fputs((arguments.is_json ? summary_json(record, report, code) : summary_text(record, report)).c_str(), stdout);
    static_cast<void>(std::fflush(stdout));
    for (const std::string& problem : record.problems) complain(problem);
    return code;
}

int replay(const RunArguments& arguments, std::int64_t begin_ns) {
    SessionSizes sizes;
    std::string message;
    if (session_sizes(arguments.session, sizes, message) != Status::kOk) return refuse(message);
    std::string folder = arguments.replay;
    while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
    ReplayCamera camera({.folder = folder,
                         .calibration = arguments.calibration,
                         .width_max = sizes.width_max,
                         .height_max = sizes.height_max});
    if (camera.open() != Status::kOk) return refuse(camera.message());
    RunRecord record;
    record.input = folder;
    record.calibration = camera.calibration_source();
    // The truth is read before anything is tracked: a broken file is bad input, not a failed run.
    const std::string truth_file = folder + "/groundtruth.txt";
    std::error_code error;
    if (std::filesystem::exists(truth_file, error) &&
        read_trajectory(truth_file, record.truth, message) != Status::kOk) {
        return refuse(message);
    }
    const ReplayCounts& counts = camera.counts();
    if (counts.colour_images > counts.frames) {
        record.notes.push_back(fmt::format("{} of {} colour images have no depth image within 20 ms: skipped.",
                                           counts.colour_images - counts.frames, counts.colour_images));
    }
    return track(
        camera, [&camera] { return camera.message(); }, counts.frames, arguments, begin_ns, record);
}

int simulate(const RunArguments& arguments, std::int64_t begin_ns) {
    if (!arguments.calibration.empty()) return refuse("--calibration: the simulated camera brings its own.");
    SimulationOptions options;
    const std::size_t colon = arguments.simulate.find(':');
    options.scene = arguments.simulate.substr(0, colon);
    if (colon != std::string::npos) {
        const std::string_view seeds = std::string_view(arguments.simulate).substr(colon + 1);
        const std::size_t plus = std::min(seeds.find('+'), seeds.size());
        const auto read = [](std::string_view text, std::uint64_t& number) {
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
            return error == std::errc() && end == text.data() + text.size();
        };
        if (!read(seeds.substr(0, plus), options.seed) ||
            (plus < seeds.size() && (!read(seeds.substr(plus + 1), options.day) || options.day == 0))) {
            return refuse(fmt::format(
                "--simulate {}: the seed is a whole number, as in walking_xyz:2; walking_xyz:2+7 is the same room on "
                "day 7, with other people, another camera's way and other light.",
                arguments.simulate));
        }
    }
    // As `stillmesh simulate --frames N`: the same frames.
    if (arguments.loop.frames_max > 1'000'000) return refuse("--frames: at most 1000000 simulated frames.");
    options.frames = static_cast<std::uint32_t>(arguments.loop.frames_max);
    RunRecord record;
    record.input = fmt::format("simulated {}, seed {}", options.scene, options.seed);
    if (options.day != 0) record.input += fmt::format(", day {}", options.day);
    record.calibration = "the simulated camera's own";
    SimulatedCamera simulated(std::move(options));
    TruthfulCamera camera(simulated, record.truth);
    const std::int64_t building_ns = monotonic_ns();
    if (camera.open() != Status::kOk) return refuse(simulated.message() + ".");
    // Building the simulated world is no part of the program's start-up.
    begin_ns += monotonic_ns() - building_ns;
    return track(
        camera, [&simulated] { return simulated.message(); }, simulated.frame_count(), arguments, begin_ns, record);
}

}  // namespace

int run_command(const RunArguments& arguments, std::int64_t begin_ns) {
    if (arguments.print_config) {
        std::string toml;
        std::string message;
        if (print_configuration(arguments.session, toml, message) != Status::kOk) return refuse(message);
        std::fputs(toml.c_str(), stdout);
        return kExitDone;
    }
    const SessionOptions& session = arguments.session;
    if (session.is_localising && session.map_in.empty()) {
        return refuse("--localize: needs the map to localise in: --map-in FILE.");
    }
    if (session.is_localising && !session.map_out.empty()) {
        return refuse("--localize leaves the map as it is: there is nothing to write to --map-out.");
    }
    if (session.map_every_s > 0 && session.map_out.empty()) {
        return refuse("--map-every: needs a file to write the map to: --map-out FILE.");
    }
    if (arguments.replay.empty() == arguments.simulate.empty()) {
        return refuse("give one camera: --replay DIR or --simulate SCENE[:SEED].");
    }
    return arguments.replay.empty() ? simulate(arguments, begin_ns) : replay(arguments, begin_ns);
}

}  // namespace stillmesh
