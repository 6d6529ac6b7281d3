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
#include "platform/cli/progress.hpp"
#include "platform/cli/stream_log.hpp"
#include "platform/linux/memory_reserve.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/service.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/report/png_writer.hpp"

namespace stillmesh {
namespace {

// A broken image now and then is skipped; so many at once are a broken camera or disk.
constexpr std::uint32_t kBadImagesInARowMax = 30;
// A silence that is worth a word, and no failure.
constexpr std::int64_t kGapNoted_ns = 250'000'000;

// Keeps a few meshes spread over a run of unknown length, and the one with the most moving features.
class SnapshotKeeper {
public:
    explicit SnapshotKeeper(std::uint32_t count_max) : count_max_(count_max) {}

    void frame(std::uint64_t index, const Frame& frame, const SessionFrame& out, TrackingSession& session) {
        if (count_max_ == 0) return;
        const float matched = static_cast<float>(out.static_features) + static_cast<float>(out.dynamic_features);
        const float dynamic_share = matched > 0 ? static_cast<float>(out.dynamic_features) / matched : 0.0F;
        if (out.state >= PoseState::kUnsure && matched > 50 && dynamic_share > busiest_.dynamic_share + 0.03F) {
            busiest_ = take(index, frame, out, session, dynamic_share);
        }
        if (index % stride_ != stride_ / 2) return;
        if (kept_.size() == std::size_t{2} * count_max_) {
            std::vector<MeshSnapshot> half;
            for (std::size_t i = 0; i < kept_.size(); i += 2) half.push_back(std::move(kept_[i]));
            kept_ = std::move(half);
            stride_ *= 2;
            if (index % stride_ != stride_ / 2) return;
        }
        kept_.push_back(take(index, frame, out, session, dynamic_share));
    }

    [[nodiscard]] std::vector<MeshSnapshot> finish() {
        std::vector<MeshSnapshot> chosen;
        const std::size_t wanted = std::min<std::size_t>(kept_.size(), count_max_);
        for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(std::move(kept_[i * kept_.size() / wanted]));
        const auto distance = [this](const MeshSnapshot& s) {
            return s.frame > busiest_.frame ? s.frame - busiest_.frame : busiest_.frame - s.frame;
        };
        const auto nearest =
            std::min_element(chosen.begin(), chosen.end(),
                             [&](const MeshSnapshot& a, const MeshSnapshot& b) { return distance(a) < distance(b); });
        if (busiest_.width > 0) {  // in place of the one nearest to it
            if (nearest == chosen.end()) {
                chosen.push_back(std::move(busiest_));
            } else {
                *nearest = std::move(busiest_);
            }
        }
        std::sort(chosen.begin(), chosen.end(),
                  [](const MeshSnapshot& a, const MeshSnapshot& b) { return a.frame < b.frame; });
        return chosen;
    }

private:
    [[nodiscard]] static MeshSnapshot take(std::uint64_t index, const Frame& frame, const SessionFrame& out,
                                           TrackingSession& session, float dynamic_share) {
        MeshSnapshot snapshot;
        snapshot.frame = index;
        snapshot.time_ns = frame.time_ns;
        snapshot.state = out.state;
        snapshot.width = frame.colour.width;
        snapshot.height = frame.colour.height;
        snapshot.dynamic_share = dynamic_share;
        snapshot.grey_png = encode_grey_png(frame);
        session.draw(snapshot);
        return snapshot;
    }

    std::uint32_t count_max_;
    std::uint64_t stride_ = 8;
    std::vector<MeshSnapshot> kept_;
    MeshSnapshot busiest_;
};

// The longest time without a measured pose, and what the pixels said meanwhile.
class LossWatch {
public:
    LossWatch(const RunLoopOptions& options, TrackingSession& session) : options_(options), session_(session) {}

    // `known`: what is wrong with the frame, if it is known. What was lost while a live camera itself was away does not
    // count.
    void frame(const Frame& frame, PoseState state, FrameFault known) {
        if (first_ns_ < 0) first_ns_ = last_measured_ns_ = last_ns_ = frame.time_ns;
        if (options_.is_live && frame.time_ns - last_ns_ > kGapNoted_ns) last_measured_ns_ += frame.time_ns - last_ns_;
        last_ns_ = frame.time_ns;
        fault_ = FrameFault::kNone;
        if (state >= PoseState::kUnsure) {
            end_of_loss(frame.time_ns);
            last_measured_ns_ = frame.time_ns;
            was_measured_ = true;
            return;
        }
        ++lost_frames_;
        fault_ = known != FrameFault::kNone ? known : diagnose(frame, options_.depth_range);
        // Lost for so long among good pictures: is it the place, or what moves in it?
        if (fault_ == FrameFault::kNone && lost_ns() > kProbed_ns && options_.new_map_after_ns == 0 &&
            session_.could_begin_here(frame).value_or(false)) {
            is_elsewhere_ = was_elsewhere_ = true;
        }
        ++faults_[static_cast<std::size_t>(fault_)];
        ++all_faults_[static_cast<std::size_t>(fault_)];
        ++all_lost_frames_;
    }
    void finish() { end_of_loss(last_ns_); }
    [[nodiscard]] std::int64_t lost_ns() const { return lost_frames_ > 0 ? last_ns_ - last_measured_ns_ : 0; }
    // The last frame shows something that a map could begin with.
    [[nodiscard]] bool is_good_picture() const { return fault_ == FrameFault::kNone; }
    // Another map begins: what was lost is known, and is no failure.
    [[nodiscard]] std::string begin_anew() {
        const std::string sentence =
            fmt::format("second {:.1f}: no pose for {:.1f} s", second(last_ns_), static_cast<double>(lost_ns()) * 1e-9);
        last_measured_ns_ = last_ns_;
        lost_frames_ = 0;
        faults_ = {};
        was_measured_ = true;
        return sentence;
    }
    [[nodiscard]] double second(std::int64_t time_ns) const { return static_cast<double>(time_ns - first_ns_) * 1e-9; }
    [[nodiscard]] std::string sentence() const {
        if (longest_ns_ <= options_.lost_ns) return {};
        return fmt::format("no pose for {:.1f} s ({} frames) from second {:.1f} on: {}.",
                           static_cast<double>(longest_ns_) * 1e-9, longest_frames_, second(longest_begin_ns_),
                           fault_sentence(longest_fault_));
    }
    // What most of the frames without a measured pose say, of the whole run.
    [[nodiscard]] const char* fault() const {
        return fault_sentence(with_place(most_say(all_faults_, all_lost_frames_), was_elsewhere_));
    }

private:
    static constexpr std::int64_t kProbed_ns = 500'000'000;  // half of what is a failure
    using Counts = std::array<std::uint64_t, kFrameFaults>;
    // What more than half of the frames say; else the general sentence.
    [[nodiscard]] static FrameFault most_say(const Counts& faults, std::uint64_t frames) {
        FrameFault fault = FrameFault::kNone;
        for (std::size_t i = 0; i < faults.size(); ++i) {
            if (faults[i] * 2 > frames) fault = static_cast<FrameFault>(i);
        }
        return fault;
    }
    [[nodiscard]] FrameFault with_place(FrameFault fault, bool is_elsewhere) const {
        if (fault != FrameFault::kNone || !is_elsewhere) return fault;
        return options_.begins_in_map && !was_measured_ ? FrameFault::kOtherMap : FrameFault::kElsewhere;
    }
    void end_of_loss(std::int64_t now_ns) {
        if (lost_frames_ > 0 && now_ns - last_measured_ns_ > longest_ns_) {
            longest_ns_ = now_ns - last_measured_ns_;
            longest_begin_ns_ = last_measured_ns_;
            longest_frames_ = lost_frames_;
            longest_fault_ = with_place(most_say(faults_, lost_frames_), is_elsewhere_);
        }
        if (lost_frames_ > 0) session_.is_found_again();
        lost_frames_ = 0;
        faults_ = {};
        is_elsewhere_ = false;
    }

    const RunLoopOptions& options_;
    TrackingSession& session_;
    std::int64_t first_ns_ = -1, last_ns_ = 0, last_measured_ns_ = 0;
    std::uint64_t lost_frames_ = 0;
    Counts faults_{}, all_faults_{};
    std::uint64_t all_lost_frames_ = 0;
    FrameFault fault_ = FrameFault::kNone;  // of the last frame
    bool was_measured_ = false;             // ever
    bool is_elsewhere_ = false, was_elsewhere_ = false;
    std::int64_t longest_ns_ = 0, longest_begin_ns_ = 0;
    std::uint64_t longest_frames_ = 0;
    FrameFault longest_fault_ = FrameFault::kNone;
};

// The maps of a run: no pose of one says where it lies in another, so that the error is that of the one with most
// poses.
class MapsOfRun {
public:
    [[nodiscard]] std::size_t count() const { return count_; }
    void begin_another(RunRecord& record, std::size_t given) {
        keep(record, given);
        ++count_;
        begin_ = given;
        record.estimate.clear();
    }
    void finish(RunRecord& record, std::size_t given) {
        keep(record, given);
        record.estimate = std::move(most_);
        if (count_ > 1 && !record.estimate.empty()) {
            record.notes.push_back(
                fmt::format("{} maps; the error and the path shown are those of map {} alone.", count_, chosen_));
        }
    }
    // Of the poses given out, those in that map.
    [[nodiscard]] std::size_t final_begin() const { return chosen_begin_; }
    [[nodiscard]] std::size_t final_end() const { return chosen_end_; }

private:
    // Where there is a truth, what lies in its time counts.
    [[nodiscard]] static std::size_t worth_of(const RunRecord& record) {
        if (record.truth.empty()) return record.estimate.size();
        return static_cast<std::size_t>(
            std::count_if(record.estimate.begin(), record.estimate.end(), [&record](const TrajectoryPose& pose) {
                return pose.time_ns >= record.truth.front().time_ns && pose.time_ns <= record.truth.back().time_ns;
            }));
    }
    void keep(RunRecord& record, std::size_t given) {
        const std::size_t worth = worth_of(record);
        if (count_ > 1 && worth <= most_worth_) return;
        most_worth_ = worth;
        most_ = std::move(record.estimate);
        chosen_ = count_;
        chosen_begin_ = begin_;
        chosen_end_ = given;
    }

    std::size_t count_ = 1, begin_ = 0;
    std::size_t chosen_ = 1, chosen_begin_ = 0, chosen_end_ = 0, most_worth_ = 0;
    Trajectory most_;
};

// A predicted pose is given out, but not measured: a comment, so that no tool counts it as covered.
void append_trajectory_line(PoseState state, const TrajectoryPose& pose, std::string& text) {
    if (state == PoseState::kNone) return;
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
    if (options.trajectory == "-" && options.times == nullptr) trajectory.wait_for_reader(kReaderPatience_ms);
    if (!options.trajectory.empty() && !trajectory.open(options.trajectory, message)) return give_up(kExitUsage);
    if (!options.state_hashes.empty() && !hashes.open(options.state_hashes, message)) return give_up(kExitUsage);
    if (!session.begin(message)) return give_up(kExitUsage);

    ServiceNotifier service;
    service.ready();
    ProgressLine progress(options.show_progress, options.frames_expected);
    // What cannot be written ends nothing: it is said once, counted, and the run fails when it is over.
    const auto put = [&progress](CountedLines& lines, std::string_view text) {
        if (!lines.is_open()) return;
        if (const std::string sentence = lines.write(text); !sentence.empty()) progress.say(sentence);
    };
    put(trajectory, kHeader);
    std::string line;  // keeps its memory from frame to frame
    SnapshotKeeper snapshots(options.snapshots_max);
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
        if (take_reopen_signal() && trajectory.is_open() && !trajectory.reopen(message)) {
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
        Frame frame;
        const Status polled = camera.poll(frame);
        if (options.news) {
            for (std::string sentence = options.news(); !sentence.empty(); sentence = options.news()) {
                const double second = static_cast<double>(monotonic_ns() - wall_begin_ns) * 1e-9;
                progress.say(sentence);
                // Poses stop here: whoever reads the path later sees why.
                put(trajectory, "# " + sentence + "\n");
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
        if (const std::string sentence = streams.take_news(); !sentence.empty()) {
            progress.say(sentence);
            put(trajectory, "# " + sentence + "\n");
        }
        SessionFrame out;
        const std::int64_t begin_ns = monotonic_ns();
        if (streams.fault() != FrameFault::kNone) {  // old pictures: a pose of them would be of another time
            record.add({frame.time_ns, 0, 0, 0, 0, PoseState::kNone}, false);
            loss.frame(frame, PoseState::kNone, streams.fault());
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
        out.world_from_camera.time_ns = frame.time_ns;
        watch.judge(out);
        line.clear();
        append_trajectory_line(out.state, out.world_from_camera, line);
        put(trajectory, line);
        watch.frame(camera, frame, session);
        for (std::string sentence = watch.news(); !sentence.empty(); sentence = watch.news()) {
            progress.say(sentence);
            put(trajectory, "# " + sentence + "\n");
        }
        snapshots.frame(record.frames_total, frame, out, session);
        session.work(options.times != nullptr ? std::optional(options.times->next_due_ns()) : std::nullopt, out);
        if (hashes.is_open()) {
            line.clear();
            append_time(frame.time_ns, line);
            fmt::format_to(std::back_inserter(line), " {:016x}\n", out.state_hash);
            put(hashes, line);
        }
        if (std::string sentence = session.news(); !sentence.empty()) progress.say(sentence);
        if (!options.trajectory_final.empty() && out.state != PoseState::kNone) {
            given.push_back(out.world_from_camera);
            given_states.push_back(out.state);
        }
        if (options.keep_trajectory && out.state >= PoseState::kUnsure) {
            record.estimate.push_back(out.world_from_camera);
        }
        record.state_hash = out.state_hash;
        record.add({frame.time_ns, static_cast<float>(end_ns - begin_ns) * 1e-6F, out.features, out.static_features,
                    out.dynamic_features, out.state});
        loss.frame(frame, out.state, FrameFault::kNone);
        if (options.new_map_after_ns > 0 && loss.lost_ns() >= options.new_map_after_ns && loss.is_good_picture()) {
            if (const std::string begun = session.begin_new_map(); !begun.empty()) {
                const std::string sentence = loss.begin_anew() + ": " + begun + ".";
                progress.say(sentence);
                put(trajectory, fmt::format("# map {}: {}\n", maps.count() + 1, sentence));
                maps.begin_another(record, given.size());
                record.new_maps.push_back({loss.second(frame.time_ns), sentence});
            }
        }
        const std::int64_t latency_ns = end_ns - (options.times != nullptr ? options.times->due_ns() : begin_ns);
        record.latency_ms.add(static_cast<double>(latency_ns) * 1e-6);
        if (options.frame_period_ns > 0 && latency_ns > options.frame_period_ns) ++record.deadline_misses;
        progress.frame(record.frames_total, out.state, end_ns);
    }
    progress.finish();
    record.wall_seconds = static_cast<double>(monotonic_ns() - wall_begin_ns) * 1e-9;
    record.cpu_seconds = cpu_seconds() - cpu_begin;
    record.snapshots = snapshots.finish();
    maps.finish(record, given.size());
    const std::size_t problems = record.problems.size();
    for (const CountedLines* const lines : {&trajectory, &hashes}) {
        if (std::string problem = lines->problem(); !problem.empty()) record.problems.push_back(std::move(problem));
    }
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
