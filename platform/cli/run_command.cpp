#include "platform/cli/run_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include "hal/faulty/faulty_camera.hpp"
#include "hal/live/reconnecting_camera.hpp"
#include "hal/realtime/realtime_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/destinations.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/motion_of_run.hpp"
#include "platform/cli/prepared_camera.hpp"
#include "platform/cli/recording_source.hpp"
#include "platform/cli/scene_name.hpp"
#include "platform/cli/summary.hpp"
#include "platform/cli/view_of_run.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/service.hpp"
#include "platform/poses/line_outputs.hpp"
#include "platform/report/report.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kImageSideMax = 4096;  // px, of images that may be halved
constexpr double kMapEvery_s = 60;             // of --map, where --map-every does not say

[[nodiscard]] std::int64_t nanoseconds(double seconds) {
    return static_cast<std::int64_t>(std::llround(seconds * 1e9));
}

// A simulated camera that writes down where it truly was. By the clock another thread polls it: what it wrote is taken
// when that has ended.
class TruthfulCamera final : public DepthCamera {
public:
    explicit TruthfulCamera(SimulatedCamera& camera) : camera_(camera) {}

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
    [[nodiscard]] Trajectory take_truth() { return std::move(truth_); }

private:
    SimulatedCamera& camera_;
    Trajectory truth_;
};

// A camera with what goes with it.
struct Source {
    DepthCamera& camera;
    std::function<std::string()> message;                         // why its last call failed
    std::uint64_t frames = 0;                                     // expected; 0: unknown
    FrameTimes* times = nullptr;                                  // frames come by the clock
    std::function<std::string()> news = {};                       // what happened to it
    std::function<std::string()> silence = {};                    // what is known of it
    std::function<std::string()> remark = {};                     // what the camera has to say otherwise, once each
    std::function<void(RunRecord&)> account = [](RunRecord&) {};  // once nobody polls it any more
    ViewOfRun* view = nullptr;                                    // its page, if it is served already
};

[[nodiscard]] int stopped_before_the_first_frame() {
    complain("stopped while waiting for a camera.");
    return 128 + stop_signal();
}

// Everything that is left once a camera is open. `record` says where the frames come from.
int track(const Source& source, const RunArguments& arguments, std::int64_t begin_ns, RunRecord& record) {
    std::unique_ptr<MotionSource> motion;
    std::string folder = arguments.replay;
    while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
    if (arguments.replay.empty() && is_mask_of_frames(arguments.mask))
        return refuse("--mask: a folder of masks is a recording's; give an image, or --replay.");
    std::string message, note;
    if (!open_motion(arguments, folder, motion, message)) return refuse(message);
    std::unique_ptr<AccelerationSource> accelerations;
    if (!open_accelerometer(arguments, folder, accelerations, message)) return refuse(message);
    PreparedCamera prepared(source.camera);
    if (prepared.prepare(arguments.mask, arguments.is_half, note, message) != Status::kOk) return refuse(message);
    if (!note.empty()) record.notes.push_back(note);
    DepthCamera& camera = prepared.camera();
    record.limits = arguments.session.limits;
    record.features = arguments.session.features;
    record.command = arguments.command;
    std::unique_ptr<TrackingSession> session;
    SessionOptions options = arguments.session;
    const bool is_live = source.times != nullptr;
    const bool is_realtime = arguments.is_realtime && !is_live;  // a live camera is
    options.motion = motion.get();
    options.accelerations = accelerations.get();
    options.can_wait = !is_realtime && !is_live;
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
    SessionSizes sizes;
    if (session_sizes(arguments.session, sizes, message) != Status::kOk) return refuse(message);
    catch_stop_signals();
    catch_reopen_signal();
    std::unique_ptr<RunFilm> film;
    if (!arguments.report.empty()) film = std::make_unique<RunFilm>(arguments.report_frames);
    ViewOfRun own_view;
    ViewOfRun& view = source.view != nullptr ? *source.view : own_view;
    // Before become_realtime(): its threads are ordinary ones.
    if (!view.open(arguments.view, message)) return refuse(message);
    if (film != nullptr) static_cast<void>(view.feed());
    record.start_up_ms = static_cast<double>(monotonic_ns() - begin_ns) * 1e-6;
    RunLoopOptions loop = arguments.loop;
    loop.depth_range = sizes.depth;
    loop.begins_in_map = !options.map_in.empty();
    loop.new_map_after_ns = nanoseconds(arguments.new_map_when_lost_s);
    const bool ends_earlier = loop.frames_max > 0 && (loop.frames_max < source.frames || source.frames == 0);
    loop.frames_expected = ends_earlier ? loop.frames_max : source.frames;
    // 64 bytes a frame, for the error only.
    loop.keep_trajectory = !record.truth.empty() || !arguments.simulate.empty();
    loop.film = film.get();
    loop.view = view.feed_if_any();
    const bool is_by_clock = is_live || is_realtime;
    const bool keeps_to_map = options.is_localising || !options.record.empty() || !options.map_store.empty();
    loop.controls = {!is_by_clock, !loop.trajectory.empty(), !keeps_to_map,
                     !options.map_out.empty() || options.grid.is_any(),
                     options.record.empty() && options.map_store.empty()};
    loop.is_localising = options.is_localising;
    loop.ros.has_grid = !arguments.session.grid.grid.empty();
    loop.camera = camera.info().model;
    loop.show_progress = !arguments.is_json;
    loop.frames = arguments.record_frames.empty() ? nullptr : &frames_writer;
    loop.frame_period_ns = static_cast<std::int64_t>(1e9 / camera.info().frames_per_s);
    RealtimeCamera realtime(camera, {monotonic_ns, sleep_until_ns});
    loop.times = source.times;
    loop.is_live = is_live;
    loop.news = source.news;
    loop.posed = [&prepared](const PoseEstimate& pose) { prepared.learn(pose); };
    if (is_realtime) {
        if (realtime.open() != Status::kOk) return refuse("the system has no thread or memory left for --realtime.");
        loop.times = &realtime;
    }
    if (arguments.is_realtime) {
        if (const std::string refused = become_realtime(); !refused.empty()) {
            complain(refused, LogLevel::kWarning);  // now, not in the summary alone: a service may run for weeks
            record.notes.push_back(refused);
        }
    }
    DepthCamera& served = is_realtime ? static_cast<DepthCamera&>(realtime) : camera;
    int code = kExitDone;
    try {
        code = run_loop(served, source.message, *session, loop, record);
    } catch (const std::bad_alloc&) {  // behind the reserve: not even a sentence can be made
        session->rescue();
        throw;
    }
    if (is_realtime) record.source_late_s = static_cast<double>(realtime.source_late_ns()) * 1e-9;
    realtime.close();
    source.account(record);
    session.reset();  // its memory is free for the evaluation

    if (!record.truth.empty()) record.evaluation = evaluate(record.truth, record.estimate);
    if (!record.truth.empty() && !record.final_estimate.empty()) {
        record.final_evaluation = evaluate(record.truth, record.final_estimate);
    }
    record.peak_resident_bytes = peak_resident_bytes();
    std::string corrected = "nothing to correct";
    if (!arguments.corrected.empty() && !record.corrected_calibration.empty()) {
        corrected = "written to " + arguments.corrected;
        if (!write_whole_file(arguments.corrected, record.corrected_calibration, message)) {
            record.problems.push_back(message);
            corrected = "could not be written";
            code = kExitFailed;
        }
    }
    std::string report;
    if (!arguments.report.empty()) {
        report = arguments.report + "/index.html";
        if (!write_report(record, *film, report, message)) {
            record.problems.push_back(message);
            report.clear();
            if (code == kExitDone) code = kExitFailed;
        }
    }
    release_stop_signals();  // all is written: whoever reads the summary slowly may end us
    if (arguments.is_camera_check && !arguments.is_json) {
        for (const std::string& line : record.camera_check) std::fputs((printable(line) + "\n").c_str(), stdout);
        if (!arguments.corrected.empty()) std::fputs(printable("calibration   " + corrected + "\n").c_str(), stdout);
        if (record.problems.empty()) std::fputs("verdict       no fault found\n", stdout);
        static_cast<void>(std::fflush(stdout));
        for (const std::string& problem : record.problems) complain(problem);
        return code;
    }
    // Where the poses went to standard output, nothing else does.
    const std::vector<std::string>& poses = arguments.loop.poses;
    const bool is_taken = arguments.loop.trajectory == "-" || std::find(poses.begin(), poses.end(), "-") != poses.end();
    std::FILE* const out = is_taken ? stderr : stdout;
    std::fputs(
        (arguments.is_json ? summary_json(record, report, code) : printable(summary_text(record, report))).c_str(),
        out);
    static_cast<void>(std::fflush(out));
    for (const std::string& problem : record.problems) complain(problem);
    return code;
}

void account_life(const ReconnectingCamera& lasting, CameraRecord& record) {
    const LifeCounts& life = lasting.counts();
    const GuardCounts& guard = lasting.guard_counts();
    record.unplugs = life.unplugs;
    record.stalls = life.stalls;
    record.returns = life.returns;
    record.away_s = static_cast<double>(life.away_ns) * 1e-9;
    record.away_longest_s = static_cast<double>(life.away_longest_ns) * 1e-9;
    record.frames_refused = guard.wrong_form + guard.wrong_time + life.bad_polls;
    record.clock_restarts = guard.clock_restarts;
}

// The camera of `source` kept alive, with faults of a seed if there is one. `is_open`: it is already; else it is opened
// here, first of all.
template <typename Then>
int keep_alive(const Source& source, bool is_open, std::function<bool()> reset, const RunArguments& arguments,
               RunRecord& record, Then then) {
    FaultOptions fault_options;
    fault_options.now_ns = monotonic_ns;
    fault_options.sleep_until_ns = sleep_until_ns;
    fault_options.times = source.times;
    fault_options.is_recording = source.times == nullptr;
    if (!arguments.inject.empty()) {
        const char* const end = arguments.inject.data() + arguments.inject.size();
        const auto [stop, error] = std::from_chars(arguments.inject.data(), end, fault_options.seed);
        if (error != std::errc() || stop != end)
            return refuse("--inject " + arguments.inject + ": is no whole number.");
    }
    FaultyCamera faulty(source.camera, fault_options);
    ReconnectOptions options;
    options.now_ns = monotonic_ns;
    options.sleep_until_ns = sleep_until_ns;
    options.source_message = source.message;
    options.silence = source.silence;
    options.remark = source.remark;
    options.reset = std::move(reset);
    options.times = source.times;
    options.is_live = source.times != nullptr;
    const bool is_injected = !arguments.inject.empty();
    if (is_injected && is_open) source.camera.close();  // opened again behind the faults
    ReconnectingCamera lasting(is_injected ? static_cast<DepthCamera&>(faulty) : source.camera, options);
    std::string message;
    const Status opened = open_live_camera(lasting, source.message, arguments.does_wait, message);
    if (opened != Status::kOk) return stop_signal() != 0 ? stopped_before_the_first_frame() : refuse(message);
    Source alive{.camera = lasting,
                 .message = source.message,
                 .frames = source.frames,
                 .times = source.times != nullptr ? &lasting : nullptr,
                 .news = [&lasting] { return lasting.take_news(); },
                 .account =
                     [&](RunRecord& r) {
                         account_life(lasting, r.camera);
                         if (is_injected) r.camera.faults = faulty.summary();
                         source.account(r);
                     },
                 .view = source.view};
    const int code = then(alive, record);
    lasting.close();
    return code;
}

// A recording or a simulation: as it is, unless there are faults to inject.
int track_maybe_faulty(const Source& source, bool is_open, const RunArguments& arguments, std::int64_t begin_ns,
                       RunRecord& record) {
    if (arguments.inject.empty()) return track(source, arguments, begin_ns, record);
    return keep_alive(source, is_open, {}, arguments, record,
                      [&](const Source& alive, RunRecord& r) { return track(alive, arguments, begin_ns, r); });
}

int replay(const RunArguments& arguments, std::int64_t begin_ns) {
    std::string message;
    std::string folder = arguments.replay;
    while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
    RecordingSource source({.folder = folder,
                            .calibration = arguments.calibration,
                            .depth_units_per_m = arguments.depth_units_per_m,
                            .width_max = kImageSideMax,  // the limits follow the camera, or say what is too large
                            .height_max = kImageSideMax,
                            .association_gap_max_ns = nanoseconds(arguments.replay_pair_gap_s),
                            .depth_offset_ns = nanoseconds(arguments.replay_depth_offset_s),
                            .frames_per_s = arguments.replay_frames_per_s,
                            .masks = is_mask_of_frames(arguments.mask) ? arguments.mask : ""},
                           arguments.replay_topics);
    if (!source.problem().empty()) return refuse(source.problem());
    if (source.camera().open() != Status::kOk) return refuse(source.message());
    RunRecord record;
    record.input = folder;
    record.calibration = source.calibration_source();
    // The truth is read before anything is tracked: a broken file is bad input, not a failed run.
    const std::string truth_file = folder + "/groundtruth.txt";
    std::error_code error;
    if (std::filesystem::exists(truth_file, error) &&
        read_trajectory(truth_file, record.truth, message, arguments.replay_frames_per_s) != Status::kOk) {
        return refuse(message);
    }
    record.notes = source.notes();
    return track_maybe_faulty({.camera = source.camera(),
                               .message = [&source] { return source.message(); },
                               .frames = source.frames(),
                               .account =
                                   [&source](RunRecord& r) {
                                       for (const std::string& note : source.closing_notes()) r.notes.push_back(note);
                                   }},
                              true, arguments, begin_ns, record);
}

int simulate(const RunArguments& arguments, std::int64_t begin_ns) {
    if (!arguments.calibration.empty()) return refuse("--calibration: the simulated camera brings its own.");
    SceneName scene;
    std::string wrong;
    if (!parse_scene_name(arguments.simulate, scene, wrong)) return refuse("--simulate " + wrong + ".");
    SimulationOptions options{.scene = scene.name, .seed = scene.seed, .day = scene.day};
    if (!parse_dirt(arguments.dirt, options.dirt, wrong)) return refuse("--dirt: " + wrong + ".");
    // As `stillmesh simulate --frames N`: the same frames.
    if (arguments.loop.frames_max > 1'000'000) return refuse("--frames: at most 1000000 simulated frames.");
    options.frames = static_cast<std::uint32_t>(arguments.loop.frames_max);
    RunRecord record;
    record.input = fmt::format("simulated {}, seed {}", options.scene, options.seed);
    if (options.day != 0) record.input += fmt::format(", day {}", options.day);
    if (!arguments.dirt.empty()) record.input += fmt::format(", {}", arguments.dirt);
    record.calibration = "the simulated camera's own";
    SimulatedCamera simulated(std::move(options));
    TruthfulCamera camera(simulated);
    const std::int64_t building_ns = monotonic_ns();
    if (camera.open() != Status::kOk) return refuse(simulated.message() + ".");
    // Building the simulated world is no part of the program's start-up.
    begin_ns += monotonic_ns() - building_ns;
    return track_maybe_faulty({.camera = camera,
                               .message = [&simulated] { return simulated.message(); },
                               .frames = simulated.frame_count(),
                               .account = [&camera](RunRecord& r) { r.truth = camera.take_truth(); }},
                              true, arguments, begin_ns, record);
}

int live(const RunArguments& arguments) {
    SessionSizes sizes;
    std::string message;
    if (session_sizes(arguments.session, sizes, message) != Status::kOk) return refuse(message);
    LiveCameraOptions options = arguments.live;
    options.calibration = arguments.calibration;
    options.width_max = sizes.width_max;
    options.height_max = sizes.height_max;
    options.is_realtime = arguments.is_realtime;
    const std::unique_ptr<LiveCamera> camera = make_live_camera(options, message);
    if (camera == nullptr) return refuse(message);
    catch_stop_signals();
    ViewOfRun view;  // while a camera is waited for, it says so
    if (arguments.does_wait && !view.open(arguments.view, message)) return refuse(message);
    RunRecord record;
    Source source{.camera = *camera,
                  .message = [&camera] { return camera->message(); },
                  .frames = 0,
                  .times = camera->is_file() ? nullptr : camera.get(),
                  .news = {},
                  .silence = [&camera] { return camera->silence(); },
                  .remark = [&camera] { return camera->remark(); },
                  .account = [&camera](RunRecord& r) { account_live_camera(camera->counts(), r.camera); },
                  .view = &view};
    const auto tracked = [&](const Source& open_source, RunRecord& r) {
        r.input = camera->is_file() ? camera->device() : "live: " + camera->device();
        r.camera.device = camera->device();
        r.calibration = camera->calibration_source();
        for (const std::string& note : camera->notes()) r.notes.push_back(note);
        Source counted = open_source;
        counted.frames = camera->frames_expected();
        std::string problem;
        std::optional<RunArguments> on_robot;
        if (arguments.loop.ros.is_base_from_tf && !place_on_robot(arguments, on_robot, problem)) return refuse(problem);
        // Waiting for a camera and opening it is no part of the program's start-up.
        return track(counted, on_robot ? *on_robot : arguments, monotonic_ns(), r);
    };
    if (!camera->is_file() || !arguments.inject.empty()) {
        return keep_alive(
            source, false, [&camera] { return reset_live_camera(*camera); }, arguments, record, tracked);
    }
    if (camera->open() != Status::kOk) return refuse(camera->message());
    return tracked(source, record);
}

// What is wrong with where the run writes to, before anything is opened; empty: nothing.
[[nodiscard]] std::string destinations_problem(const RunArguments& arguments) {
    using enum DestinationKind;
    const SessionOptions& session = arguments.session;
    const Destination all[] = {
        {"--trajectory", arguments.loop.trajectory, kLines, true},
        {"--trajectory-final", arguments.loop.trajectory_final, kWhole},
        {"--state-hashes", arguments.loop.state_hashes, kLines},
        {"--record", session.record, kLines},
        {"--record-frames", arguments.record_frames, kNewFolder},
        {"--map-out", session.map_out, kFile},
        {"--map-store", session.map_store, kFolder},
        {"--grid", session.grid.grid.empty() ? "" : session.grid.grid + ".yaml", kWhole},
        {"--grid", session.grid.grid.empty() ? "" : session.grid.grid + ".pgm", kWhole},
        {"--cloud", session.grid.cloud, kWhole},
        {"--report", arguments.report, kFolder},
        {"--out", arguments.corrected, kWhole},
    };
    std::vector<Destination> given;
    for (const Destination& to : all) {
        if (!to.path.empty()) given.push_back(to);
    }
    for (const std::string& to : arguments.loop.poses) {
        if (is_file_destination(to)) given.push_back({"--poses", to, kLines, true});
    }
    std::vector<Origin> origins = {
        {"--config", session.configuration},          {"--calibration", arguments.calibration},
        {"--vocabulary", session.vocabulary},         {"--mask", arguments.mask},
        {"--accelerometer", arguments.accelerometer}, {"--replay", arguments.replay}};
    for (const auto& [option, file] : {std::pair{"--odometry", arguments.odometry}, {"--gyro", arguments.gyroscope}}) {
        if (file != "none" && !is_ros_motion(file)) origins.push_back({option, file});
    }
    for (const char* const name : {"rgb.txt", "depth.txt", "groundtruth.txt", "camera.yaml", "camera.toml",
                                   "odometry.txt", "gyro.txt", "accelerometer.txt"}) {
        if (!arguments.replay.empty()) origins.push_back({"--replay", arguments.replay + "/" + name});
    }
    origins.push_back({"--map-in", session.map_in, "--map-out"});  // a run may go on in its own map
    return check_destinations(given, origins);
}

}  // namespace

int run_command(const RunArguments& given, std::int64_t begin_ns) {
    RunArguments arguments = given;
    if (!arguments.map.empty()) {
        SessionOptions& session = arguments.session;
        if (!session.map_in.empty() || !session.map_out.empty()) {
            return refuse("--map: goes on in the map and writes it; leave out --map-in and --map-out.");
        }
        std::error_code error;
        session.is_map_own = true;
        session.map_out = arguments.map;
        if (std::filesystem::exists(arguments.map, error)) session.map_in = arguments.map;
        if (session.map_every_s == 0) session.map_every_s = kMapEvery_s;
    }
    if (arguments.print_config) {
        std::string toml;
        std::string message;
        if (print_configuration(arguments.session, toml, message) != Status::kOk) return refuse(message);
        return answer(toml);
    }
    const SessionOptions& session = arguments.session;
    if (session.is_localising && session.map_in.empty()) {
        return refuse("--localize: needs the map to localise in: --map-in FILE.");
    }
    if (session.is_localising && !session.map_out.empty()) {
        return refuse("--localize leaves the map as it is: there is nothing to write to --map-out.");
    }
    if (session.is_localising && !session.map_store.empty()) {
        return refuse("--localize leaves the map as it is: nothing goes to --map-store, and nothing comes back.");
    }
    if (session.start && !session.map_in.empty())
        return refuse("--start-pose: is for a new map; in that of --map-in the camera is found by what it sees.");
    if (arguments.new_map_when_lost_s > 0 &&
        (session.is_localising || !session.record.empty() || !session.map_store.empty())) {
        const char* const other = session.is_localising    ? "--localize: it leaves the map as it is"
                                  : session.record.empty() ? "--map-store: its places are of one map"
                                                           : "--record: it repeats a run in one map";
        return refuse(fmt::format("--new-map-when-lost: does not go with {}; leave one of them out.", other));
    }
    if (arguments.loop.adds_to_trajectory && arguments.loop.trajectory.empty() && arguments.loop.poses.empty()) {
        return refuse("--append: needs a file to add to: --trajectory FILE or --poses FILE.");
    }
    if (!std::isfinite(session.map_every_s)) return refuse("--map-every: give a number of seconds.");
    if (arguments.loop.ros.is_base_from_tf && !arguments.live.camera.starts_with("ros2")) {
        return refuse("--base-from-camera tf_static: is for --camera ros2; else give X,Y,Z[,QX,QY,QZ,QW].");
    }
    if (session.map_every_s > 0 && session.map_out.empty() && session.grid.grid.empty()) {
        return refuse("--map-every: needs a file to write the map to: --map-out FILE, or --grid NAME.");
    }
    if (!arguments.replay_topics.empty() && arguments.replay.empty()) {
        return refuse("--topics: are a bag's; give it with --replay.");
    }
    if (const std::string problem = motion_problem(arguments); !problem.empty()) return refuse(problem);
    const int cameras = (arguments.replay.empty() ? 0 : 1) + (arguments.simulate.empty() ? 0 : 1) +
                        (arguments.live.camera.empty() ? 0 : 1);
    if (cameras != 1) return refuse("give one camera: --camera auto, --replay DIR or --simulate SCENE[:SEED].");
    if (const std::string problem = destinations_problem(arguments); !problem.empty()) return refuse(problem);
    if (!arguments.live.camera.empty()) return live(arguments);
    return arguments.replay.empty() ? simulate(arguments, begin_ns) : replay(arguments, begin_ns);
}

}  // namespace stillmesh
