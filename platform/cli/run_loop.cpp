#include "platform/cli/run_loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <iterator>
#include <optional>
#include <vector>

#include "platform/cli/camera_watch.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/frame_diagnosis.hpp"
#include "platform/cli/live_view.hpp"
#include "platform/cli/loss_watch.hpp"
#include "platform/cli/maps_of_run.hpp"
#include "platform/cli/pose_outputs.hpp"
#include "platform/cli/progress.hpp"
#include "platform/cli/run_control.hpp"
#include "platform/cli/stream_log.hpp"
#include "platform/linux/memory_reserve.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/service.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh {
namespace {

// A broken image now and then is skipped; so many at once are a broken camera or disk.
constexpr std::uint32_t kBadImagesInARowMax = 30;

// A predicted pose is given out, but not measured: a comment, so that no tool counts it as covered. Of a frame without
// a pose the comment has the time alone.
void append_trajectory_line(PoseState state, const TrajectoryPose& pose, std::string& text) {
    if (state == PoseState::kNone) {
        text += "# none ";
        append_time(pose.time_ns, text);
        text += '\n';
        return;
    }
    if (state == PoseState::kPredicted) text += "# predicted ";
    append_pose_line(pose, text);
}

// The same poses as they are known at the end.
[[nodiscard]] std::string final_text(const char* header, const Trajectory& given, const std::vector<PoseState>& states,
                                     const std::optional<Trajectory>& known) {
    std::string text = header;
    const bool is_known = known && known->size() == given.size();
    for (std::size_t i = 0; i < given.size(); ++i)
        append_trajectory_line(states[i], is_known ? (*known)[i] : given[i], text);
    return text;
}

}  // namespace

int run_loop(DepthCamera& camera, const std::function<std::string()>& camera_message, TrackingSession& session,
             const RunLoopOptions& options, RunRecord& record) {
    CountedLines trajectory;
    CountedLines hashes;
    std::string message;
    const auto give_up = [&](int code) {
        record.problems.push_back(message);
        return code;
    };
    constexpr const char* kHeader = "# timestamp tx ty tz qx qy qz qw (camera to world, s, m)\n";
    if (has_memory_run_out()) {
        message = std::string(kNoMemory) + " for a run; nothing was changed.";
        return give_up(kExitUsage);
    }
    if (options.adds_to_trajectory) trajectory.add_to_it();
    trajectory.limit_to(options.trajectory_bytes_max);
    constexpr int kReaderPatience_ms = 5000;  // a recording waits for whoever reads its path, a camera does not
    const int patience_ms = options.times == nullptr ? kReaderPatience_ms : 0;
    if (options.trajectory == "-") trajectory.wait_for_reader(patience_ms);
    PoseOutputs poses;
    const LineOutputOptions pose_options{options.adds_to_trajectory, options.trajectory_bytes_max, patience_ms};
    if (!poses.publish(options.ros, options.mavlink, message) || !poses.open(options.poses, pose_options, message) ||
        !session.show_points(poses.points(), message)) {
        return give_up(kExitUsage);
    }
    session.show_grid(poses.grid());
    if (!options.trajectory.empty() && !trajectory.open(options.trajectory, message)) return give_up(kExitUsage);
    if (!options.state_hashes.empty() && !hashes.open(options.state_hashes, message)) return give_up(kExitUsage);
    if (!session.begin(message)) return give_up(kExitUsage);

    ServiceNotifier service;
    service.ready();
    ProgressLine progress(options.show_progress, options.frames_expected);
    LiveView view(options.view, options.film, options.camera, options.frame_period_ns);
    // What cannot be written ends nothing: it is said once, counted, and the run fails when it is over.
    const auto say = [&progress, &view](const std::string& sentence) {
        if (sentence.empty()) return;
        progress.say(sentence);
        view.event(sentence);
    };
    const auto put = [&say](CountedLines& lines, std::string_view text) {
        if (lines.is_open()) say(lines.write(text));
    };
    // Poses stop here, or mean another thing from here on: whoever reads the path later sees why.
    const auto tell = [&](const std::string& sentence) {
        progress.say(sentence);
        put(trajectory, "# " + sentence + "\n");
        say(poses.event(sentence));
        view.event(sentence);
    };
    put(trajectory, kHeader);
    if (options.view != nullptr) options.view->downloads().set(session.files());
    RunControl control(options.view, options.controls, poses.wishes(), options.is_localising);
    bool was_saving = true;
    std::string line;  // keeps its memory from frame to frame
    LossWatch loss(options, session);
    MapsOfRun maps;
    StreamLog streams;
    CameraWatch watch(options.checks_camera);
    Trajectory given;  // for the poses as they are known at the end
    std::vector<PoseState> given_states;
    if (!options.trajectory_final.empty()) session.keep_final_trajectory();
    int code = kExitDone;
    std::int64_t last_frame_ns = -1;
    std::int64_t first_frame_ns = -1;
    std::int64_t gap_longest_ns = 0;
    std::int64_t gap_begin_ns = 0;
    std::uint32_t bad_images = 0;
    std::uint32_t bad_images_in_a_row = 0;
    std::string bad_image_message;  // of the first
    const std::int64_t wall_begin_ns = monotonic_ns();
    const double cpu_begin = cpu_seconds();

    while (options.frames_max == 0 || record.frames_total < options.frames_max) {
        if (take_reopen_signal() && !((!trajectory.is_open() || trajectory.reopen(message)) && poses.reopen(message))) {
            record.problems.push_back(message);  // the old file is still there
            code = kExitFailed;
        }
        service.alive(monotonic_ns());
        if (stop_signal() != 0) {
            service.stopping();
            code = 128 + stop_signal();
            record.problems.push_back("stopped by a signal; everything up to the last frame was written.");
            break;
        }
        if (has_memory_run_out()) {
            message = fmt::format("{}: stopped after {} frames; everything up to the last one was written.", kNoMemory,
                                  record.frames_total);
            code = give_up(kExitFailed);
            break;
        }
        if (control.holds()) continue;
        Frame frame;
        const Status polled = camera.poll(frame);
        if (options.news) {
            for (std::string sentence = options.news(); !sentence.empty(); sentence = options.news()) {
                const double second = static_cast<double>(monotonic_ns() - wall_begin_ns) * 1e-9;
                tell(sentence);
                if (record.camera.events.size() < CameraRecord::kEventsMax) {
                    record.camera.events.push_back(fmt::format("second {:.1f}: {}", second, sentence));
                }
            }
        }
        if (polled == Status::kEnd) break;
        if (polled == Status::kTimedOut) {
            static_cast<void>(camera.wait(100));
            continue;
        }
        if (polled != Status::kOk) {
            message = camera_message();
            if (message.empty()) message = fmt::format("the camera is {}.", status_name(polled));
            if (bad_images++ == 0) bad_image_message = message;
            if (++bad_images_in_a_row == kBadImagesInARowMax) {
                message += fmt::format(" {} images in a row could not be had: stopped.", kBadImagesInARowMax);
                code = give_up(kExitFailed);
                break;
            }
            static_cast<void>(camera.wait(100));
            continue;
        }
        bad_images_in_a_row = 0;
        while (stop_signal() == 0 && control.is_early(frame.time_ns)) service.alive(monotonic_ns());
        if (last_frame_ns >= 0 && frame.time_ns - last_frame_ns > gap_longest_ns) {
            gap_longest_ns = frame.time_ns - last_frame_ns;
            gap_begin_ns = last_frame_ns;
        }
        if (first_frame_ns < 0) first_frame_ns = frame.time_ns;
        last_frame_ns = frame.time_ns;

        if (options.frames != nullptr) {
            if (options.times == nullptr) options.frames->wait_for_room(std::chrono::seconds(10));
            options.frames->add(frame);
        }
        streams.frame(frame);
        if (const std::string sentence = streams.take_news(); !sentence.empty()) tell(sentence);
        SessionFrame out;
        const std::int64_t begin_ns = monotonic_ns();
        if (streams.fault() != FrameFault::kNone) {  // old pictures: a pose of them would be of another time
            line.clear();
            append_trajectory_line(PoseState::kNone, {.time_ns = frame.time_ns}, line);
            put(trajectory, line);
            say(poses.no_pose(record.frames_total, frame.time_ns, "old pictures"));
            view.no_pose({record.frames_total, maps.count(), begin_ns, 0}, frame, "old pictures");
            record.add({frame.time_ns, 0, 0, 0, 0, PoseState::kNone}, false);
            loss.frame(frame, out, streams.fault());
            progress.frame(record.frames_total, PoseState::kNone, begin_ns);
            continue;
        }
        const Status submitted = session.submit(frame, out, message);
        const std::int64_t end_ns = monotonic_ns();
        if (submitted != Status::kOk) {
            message =
                fmt::format("frame {} was refused ({}): {}", record.frames_total, status_name(submitted), message);
            code = give_up(kExitFailed);
            break;
        }
        if (options.posed) options.posed(out.estimate);
        out.world_from_camera.time_ns = frame.time_ns;
        watch.judge(out);
        line.clear();
        append_trajectory_line(out.state, out.world_from_camera, line);
        if (control.is_saving() != was_saving) {
            was_saving = control.is_saving();
            put(trajectory,
                was_saving ? "# saved again from here on\n" : "# not saved from here on, as was wished on the page\n");
        }
        if (was_saving) put(trajectory, line);
        say(poses.pose(record.frames_total, maps.count(), out));
        watch.frame(camera, frame, session);
        for (std::string sentence = watch.news(); !sentence.empty(); sentence = watch.news()) tell(sentence);
        view.frame({record.frames_total, maps.count(), end_ns, static_cast<float>(end_ns - begin_ns) * 1e-6F}, frame,
                   out, session);
        session.work(options.times != nullptr ? std::optional(options.times->next_due_ns()) : std::nullopt, out);
        if (hashes.is_open()) {
            line.clear();
            append_time(frame.time_ns, line);
            fmt::format_to(std::back_inserter(line), " {:016x}\n", out.state_hash);
            put(hashes, line);
        }
        say(session.news());
        if (!options.trajectory_final.empty() && out.state != PoseState::kNone) {
            given.push_back(out.world_from_camera);
            given_states.push_back(out.state);
        }
        if (options.keep_trajectory && out.state >= PoseState::kUnsure) {
            record.estimate.push_back(out.world_from_camera);
        }
        record.state_hash = out.state_hash;
        record.add({frame.time_ns, static_cast<float>(end_ns - begin_ns) * 1e-6F, out.features, out.static_features,
                    out.dynamic_features, out.state, out.unsure});
        loss.frame(frame, out, watch.fault());
        if (const std::string done = control.carry_out(session); !done.empty()) tell(done);
        const bool is_wished = control.takes_reset();
        const bool is_lost_long = options.new_map_after_ns > 0 && loss.lost_ns() >= options.new_map_after_ns;
        if (is_wished || (is_lost_long && loss.is_good_picture())) {
            if (const std::string begun = session.begin_new_map(); !begun.empty()) {
                const std::string lost = loss.begin_anew();
                const std::string wished =
                    fmt::format("second {:.1f}: wished {}", loss.second(frame.time_ns), control.wisher());
                const std::string sentence = (is_wished ? wished : lost) + ": " + begun + ".";
                tell(fmt::format("map {}: {}", maps.count() + 1, sentence));
                maps.begin_another(record, given.size());
                view.begin_map();
                if (options.view != nullptr) options.view->downloads().set(session.files());
                control.map_is_new();
                record.new_maps.push_back({loss.second(frame.time_ns), sentence});
            }
        }
        control.frame_is_done();
        record.outputs_ms.add(static_cast<double>(monotonic_ns() - end_ns - out.background_ns) * 1e-6);
        const std::int64_t latency_ns = end_ns - (options.times != nullptr ? options.times->due_ns() : begin_ns);
        record.latency_ms.add(static_cast<double>(latency_ns) * 1e-6);
        if (options.frame_period_ns > 0 && latency_ns > options.frame_period_ns) ++record.deadline_misses;
        progress.frame(record.frames_total, out.state, end_ns);
    }
    progress.finish();
    record.wall_seconds = static_cast<double>(monotonic_ns() - wall_begin_ns) * 1e-9;
    record.cpu_seconds = cpu_seconds() - cpu_begin;
    view.finish(session);
    maps.finish(record, given.size());
    const std::size_t problems = record.problems.size();
    for (const CountedLines* const lines : {&trajectory, &hashes}) {
        if (std::string problem = lines->problem(); !problem.empty()) record.problems.push_back(std::move(problem));
    }
    poses.account(record);
    session.account(record);
    streams.account(record);
    if (options.frames != nullptr) {
        if (const std::string problem = options.frames->close(); !problem.empty()) record.problems.push_back(problem);
    }
    watch.account(record);
    if (record.problems.size() > problems && code == kExitDone) code = kExitFailed;
    record.frame_period_ms = static_cast<double>(options.frame_period_ns) * 1e-6;
    if (options.times != nullptr) {
        record.is_realtime = true;
        record.frames_dropped = options.times->dropped();
    }

    if (!options.trajectory_final.empty()) {
        const std::optional<Trajectory> known = session.final_trajectory();
        if (known && known->size() == given.size()) {
            for (std::size_t i = maps.final_begin(); i < std::min(known->size(), maps.final_end()); ++i) {
                if (given_states[i] >= PoseState::kUnsure) record.final_estimate.push_back((*known)[i]);
            }
        }
        if (!write_whole_file(options.trajectory_final, final_text(kHeader, given, given_states, known), message)) {
            code = give_up(kExitFailed);
        }
    }
    if (bad_images > 0 && code == kExitDone) {
        record.problems.push_back(bad_images == 1 ? bad_image_message + " It was skipped, the others were tracked."
                                                  : bad_image_message +
                                                        fmt::format(" It and {} more like it were skipped, the others "
                                                                    "were tracked.",
                                                                    bad_images - 1));
        code = kExitFailed;
    }
    if (record.frames_total == 0 && code == kExitDone) {
        message = "the camera gave no frame.";
        code = give_up(kExitFailed);
    }
    loss.finish();
    if (const std::string sentence = loss.sentence(); !sentence.empty()) {
        record.problems.push_back(sentence);
        if (code == kExitDone) code = kExitFailed;
    } else if (record.frames_total > 0 && record.coverage() < 0.5) {
        record.problems.push_back(fmt::format("only {:.0f} % of the frames have a measured pose: {}.",
                                              100.0 * record.coverage(), loss.fault()));
        if (code == kExitDone) code = kExitFailed;
    }
    if (gap_longest_ns > options.lost_ns && !options.is_live) {
        record.problems.push_back(fmt::format(
            "no frames for {:.1f} s from second {:.1f} on; where the camera went meanwhile is unknown.",
            static_cast<double>(gap_longest_ns) * 1e-9, static_cast<double>(gap_begin_ns - first_frame_ns) * 1e-9));
        if (code == kExitDone) code = kExitFailed;
    } else if (gap_longest_ns > kGapNoted_ns) {
        record.notes.push_back(fmt::format("no frames for {:.2f} s from second {:.1f} on; tracking went on behind it.",
                                           static_cast<double>(gap_longest_ns) * 1e-9,
                                           static_cast<double>(gap_begin_ns - first_frame_ns) * 1e-9));
    }
    return code;
}

}  // namespace stillmesh
