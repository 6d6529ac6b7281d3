#include "platform/cli/run_loop.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <thread>

#include "hal/replay/replay_camera.hpp"
#include "platform/cli/frame_diagnosis.hpp"
#include "platform/cli/prepared_camera.hpp"
#include "platform/cli/summary.hpp"
#include "platform/linux/process.hpp"
#include "tests/platform/story_session.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::run_loop_test {
namespace {

using test::StoryCamera;
using test::StorySession;

struct Outcome {
    int code = -1;
    RunRecord record;
    std::string trajectory;
    std::string hashes;
    std::string final_trajectory;
};

[[nodiscard]] Outcome play(StoryCamera& camera, StorySession& session, std::uint64_t frames_max = 0) {
    test::TemporaryFolder folder;
    RunLoopOptions options;
    options.trajectory = folder.path() + "/t.txt";
    options.trajectory_final = folder.path() + "/f.txt";
    options.state_hashes = folder.path() + "/h.txt";
    options.frames_max = frames_max;
    options.keep_trajectory = true;
    options.show_progress = false;
    Outcome outcome;
    outcome.code = run_loop(
        camera, [] { return std::string("the camera said why."); }, session, options, outcome.record);
    outcome.trajectory = test::read_text(options.trajectory);
    outcome.final_trajectory = test::read_text(options.trajectory_final);
    outcome.hashes = test::read_text(options.state_hashes);
    return outcome;
}

[[nodiscard]] std::size_t poses_in(const std::string& text) {
    Trajectory trajectory;
    std::string message;
    EXPECT_EQ(parse_trajectory(text, "f", trajectory, message), Status::kOk) << message;
    return trajectory.size();
}

// Promise: a good run writes one pose and one hash per frame, counts them, and ends with 0.
TEST(RunLoop, WritesEveryFrame) {
    StoryCamera camera;
    StorySession session;
    const Outcome outcome = play(camera, session);
    EXPECT_EQ(outcome.code, 0);
    EXPECT_TRUE(outcome.record.problems.empty());
    EXPECT_EQ(outcome.record.frames_total, 90U);
    EXPECT_EQ(outcome.record.coverage(), 1.0);
    EXPECT_EQ(poses_in(outcome.trajectory), 90U);
    EXPECT_EQ(outcome.trajectory, outcome.final_trajectory);
    EXPECT_EQ(outcome.hashes.substr(0, 29), "1.000000000 0000000000001000\n");
    EXPECT_EQ(std::count(outcome.hashes.begin(), outcome.hashes.end(), '\n'), 90);
    EXPECT_EQ(outcome.record.estimate.size(), 90U);
}

// Promise: what a frame takes beside the engine is counted, of every frame: what is given out, and not what the engine
// says it needed behind the pose.
TEST(RunLoop, TimesWhatIsGivenOut) {
    struct Slow final : TrackingSession {
        StorySession story;
        std::int64_t background_ns = 0;
        Status submit(const Frame& frame, SessionFrame& out, std::string& message) override {
            return story.submit(frame, out, message);
        }
        void work(std::optional<std::int64_t>, SessionFrame& out) override {
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
            out.background_ns = background_ns;
        }
        void account(RunRecord&) override {}
    };
    for (const std::int64_t background_ns : {0, 15'000'000}) {
        StoryCamera camera;
        camera.frames = 10;
        Slow session;
        session.background_ns = background_ns;
        RunLoopOptions options;
        options.show_progress = false;
        RunRecord record;
        EXPECT_EQ(run_loop(
                      camera, [] { return std::string(); }, session, options, record),
                  0);
        EXPECT_EQ(record.outputs_ms.count(), 10U);
        // Half a bucket of the histogram is 0.4 %.
        EXPECT_GE(record.outputs_ms.at(0), 0.99 * (20 - static_cast<double>(background_ns) * 1e-6));
    }
}

// Promise: --frames N stops after N.
TEST(RunLoop, StopsAfterFramesMax) {
    StoryCamera camera;
    StorySession session;
    EXPECT_EQ(play(camera, session, 7).record.frames_total, 7U);
}

// Promise: who wants to know hears what became of each frame before the next is asked for; depth that is older than its
// picture is then moved to it, at half the size as well, and other depth is left alone.
TEST(RunLoop, SaysWhatBecameOfAFrame) {
    class OlderDepth final : public DepthCamera {
    public:
        Status open() noexcept override { return Status::kOk; }
        const CameraInfo& info() const noexcept override { return info_; }
        Status poll(Frame& frame) noexcept override {
            EXPECT_EQ(heard, polled) << "the frame before was not told of";
            const Status status = story.poll(frame);
            if (status != Status::kOk) return status;
            ++polled;
            for (int i = 0; i < 40; ++i) {  // as a sensor's noise: what repeats is no new picture
                story.colour[static_cast<std::size_t>(i) * 7 + 1] = static_cast<std::uint8_t>(polled + 3 * i);
                story.depth[static_cast<std::size_t>(64 * 20 + i + 12)] = static_cast<std::uint16_t>(10000 + polled);
            }
            frame.depth_time_ns = frame.time_ns - 16'000'000;
            return status;
        }
        Status wait(std::uint32_t) noexcept override { return Status::kOk; }
        test::StoryCamera story;
        CameraInfo info_;
        int polled = 0, heard = 0;
    };
    struct Turning final : TrackingSession {
        int turned = 0;
        std::int64_t last_ns = 0;
        Status submit(const Frame& frame, SessionFrame& out, std::string&) override {
            // The story's depth is one everywhere: turned, it has left one side of the image.
            turned += frame.depth.at(0, frame.depth.height / 2) == 0 || frame.depth.at(frame.depth.width - 1, 0) == 0;
            out.state = out.estimate.state = PoseState::kTracked;
            out.estimate.time_ns = frame.time_ns;
            const double angle = 5 * static_cast<double>(frame.time_ns) * 1e-9;
            out.estimate.odom_from_camera = {{0, std::sin(angle / 2), 0, std::cos(angle / 2)}, {0, 0, 0}};
            return Status::kOk;
        }
        void account(RunRecord&) override {}
    };
    for (const bool is_older : {true, false}) {
        for (const bool is_half : {false, true}) {
            OlderDepth source;
            source.info_.model = {64, 48, 60, 60, 31.5, 23.5};
            source.info_.is_depth_older = is_older;
            source.story.frames = 20;
            PreparedCamera prepared(source);
            std::string note, message;
            ASSERT_EQ(prepared.prepare("", is_half, note, message), Status::kOk) << message;
            Turning session;
            RunLoopOptions options;
            options.show_progress = false;
            options.posed = [&](const PoseEstimate& pose) {
                ++source.heard;
                prepared.learn(pose);
            };
            RunRecord record;
            EXPECT_EQ(run_loop(
                          prepared.camera(), [] { return std::string(); }, session, options, record),
                      0);
            EXPECT_EQ(source.heard, 20);
            EXPECT_EQ(session.turned, is_older ? 18 : 0) << is_half;
        }
    }
}

// Promise: a predicted pose is given out, but no tool counts it: neither the file's readers nor our coverage.
TEST(RunLoop, PredictedIsNotCovered) {
    StoryCamera camera;
    StorySession session;
    session.state_of = [](std::uint64_t i) { return i % 10 == 5 ? PoseState::kPredicted : PoseState::kUnsure; };
    const Outcome outcome = play(camera, session);
    EXPECT_EQ(outcome.code, 0);
    EXPECT_EQ(poses_in(outcome.trajectory), 81U);
    EXPECT_NE(outcome.trajectory.find("# predicted 1.165000000 0.050000000"), std::string::npos);
    EXPECT_NEAR(outcome.record.coverage(), 0.9, 1e-12);
    EXPECT_EQ(outcome.record.estimate.size(), 81U);
}

// Promise: a frame without a pose is a comment with its time, which no reader takes for a pose.
TEST(RunLoop, NoneIsAComment) {
    StoryCamera camera;
    StorySession session;
    session.state_of = [](std::uint64_t i) { return i == 5 ? PoseState::kNone : PoseState::kTracked; };
    const Outcome outcome = play(camera, session);
    EXPECT_EQ(poses_in(outcome.trajectory), 89U);
    EXPECT_EQ(poses_in(outcome.final_trajectory), 89U);
    EXPECT_NE(outcome.trajectory.find("\n# none 1.165000000\n"), std::string::npos) << outcome.trajectory;
    EXPECT_EQ(outcome.final_trajectory.find("# none"), std::string::npos);
}

// Promise: a broken image is skipped, said and a failure; with many in a row the run ends. Whatever stops a run, every
// pose given out before is in the file.
TEST(RunLoop, NothingIsLostWhenItBreaks) {
    for (const Status status : {Status::kCorrupt, Status::kUnavailable}) {
        StoryCamera broken;
        broken.status_of = [status](std::uint64_t i) { return i == 40 || i == 50 ? status : Status::kOk; };
        StorySession onward;
        const Outcome skipped = play(broken, onward);
        EXPECT_EQ(skipped.code, 1);
        ASSERT_EQ(skipped.record.problems.size(), 1U);
        EXPECT_EQ(skipped.record.problems[0],
                  "the camera said why. It and 1 more like it were skipped, the others were tracked.");
        EXPECT_EQ(poses_in(skipped.trajectory), 88U);
        EXPECT_EQ(poses_in(skipped.final_trajectory), 88U);

        StoryCamera gone;
        gone.frames = 1'000'000;
        gone.status_of = [status](std::uint64_t i) { return i >= 40 ? status : Status::kOk; };
        StorySession stopped;
        const Outcome outcome = play(gone, stopped);
        EXPECT_EQ(outcome.code, 1);
        ASSERT_EQ(outcome.record.problems.size(), 1U);
        EXPECT_EQ(outcome.record.problems[0], "the camera said why. 30 images in a row could not be had: stopped.");
        EXPECT_EQ(poses_in(outcome.trajectory), 40U);
    }
    StoryCamera camera;
    StorySession session;
    session.status_of = [](std::uint64_t i) { return i == 12 ? Status::kInvalid : Status::kOk; };
    const Outcome outcome = play(camera, session);
    EXPECT_EQ(outcome.code, 1);
    EXPECT_EQ(outcome.record.problems.at(0), "frame 12 was refused (invalid): the story says so.");
    EXPECT_EQ(poses_in(outcome.trajectory), 12U);
}

// Promise: a camera lost for more than a second, a gap of seconds, and a run without poses end with 1 and say why.
TEST(RunLoop, LossAndGapsAreFailures) {
    {
        StoryCamera camera;
        StorySession session;
        session.state_of = [](std::uint64_t i) {
            return i >= 20 && i < 60 ? PoseState::kPredicted : PoseState::kTracked;
        };
        std::fill(camera.colour.begin(), camera.colour.end(), std::uint8_t{3});
        const Outcome outcome = play(camera, session);
        EXPECT_EQ(outcome.code, 1);
        EXPECT_NE(outcome.record.problems.at(0).find("no pose for 1.4 s (40 frames)"), std::string::npos)
            << outcome.record.problems[0];
        EXPECT_NE(outcome.record.problems[0].find("the images are black"), std::string::npos);
    }
    {
        StoryCamera camera;
        StorySession session;
        camera.time_of = [](std::uint64_t i) {
            return static_cast<std::int64_t>(i) * 33'000'000 + (i > 30 ? 3'000'000'000 : 0);
        };
        const Outcome outcome = play(camera, session);
        EXPECT_EQ(outcome.code, 1);
        EXPECT_NE(outcome.record.problems.at(0).find("no frames for 3.0 s from second 1.0 on"), std::string::npos)
            << outcome.record.problems[0];
    }
    {
        StoryCamera camera;
        camera.frames = 10;
        StorySession session;
        session.state_of = [](std::uint64_t) { return PoseState::kNone; };
        const Outcome outcome = play(camera, session);
        EXPECT_EQ(outcome.code, 1);
        EXPECT_EQ(poses_in(outcome.trajectory), 0U);
    }
    {
        StoryCamera camera;
        camera.frames = 0;
        StorySession session;
        EXPECT_EQ(play(camera, session).code, 1);
    }
}

// Promise: a short silence with tracking behind it is a note, and the run is good.
TEST(RunLoop, ShortGapsAreNoted) {
    StoryCamera camera;
    StorySession session;
    camera.time_of = [](std::uint64_t i) {
        return static_cast<std::int64_t>(i) * 33'000'000 + (i > 30 ? 500'000'000 : 0);
    };
    const Outcome outcome = play(camera, session);
    EXPECT_EQ(outcome.code, 0);
    ASSERT_EQ(outcome.record.notes.size(), 1U);
    EXPECT_NE(outcome.record.notes[0].find("no frames for 0.53 s from second 1.0 on"), std::string::npos)
        << outcome.record.notes[0];
}

// Promise: an output that cannot be opened is refused before the first frame; a disk that is full, or fills up, ends
// nothing: all frames are tracked, the loss is counted, and the run fails when it is over.
TEST(RunLoop, OutputsThatCannotBeWritten) {
    StoryCamera camera;
    StorySession session;
    RunLoopOptions options;
    options.show_progress = false;
    options.trajectory = "/nowhere/t.txt";
    RunRecord record;
    EXPECT_EQ(run_loop(
                  camera, [] { return std::string(); }, session, options, record),
              2);
    EXPECT_NE(record.problems.at(0).find("/nowhere/t.txt: cannot be written"), std::string::npos);
    EXPECT_EQ(record.frames_total, 0U);
    options.trajectory = options.state_hashes = "/dev/full";
    RunRecord full;
    EXPECT_EQ(run_loop(
                  camera, [] { return std::string(); }, session, options, full),
              1);
    EXPECT_GT(full.frames_total, 50U);
    ASSERT_EQ(full.problems.size(), 2U);
    const std::string lines = std::to_string(full.frames_total);
    EXPECT_NE(full.problems[1].find("No space left on device. " + lines + " of " + lines + " lines are missing"),
              std::string::npos)
        << full.problems[1];
}

// Promise: a signal ends the run after the frame at hand, with 128 + its number and every pose written. In a process of
// its own: what a signal leaves behind is no business of other tests.
TEST(RunLoopDeathTest, SignalsFinishTheFrame) {
    for (const int signal : {SIGINT, SIGTERM}) {
        test::TemporaryFolder folder;
        RunLoopOptions options;
        options.trajectory = folder.path() + "/t.txt";
        options.show_progress = false;
        EXPECT_EXIT(
            {
                catch_stop_signals();
                StoryCamera camera;
                StorySession session;
                session.status_of = [signal](std::uint64_t i) {
                    if (i == 30) static_cast<void>(std::raise(signal));
                    return Status::kOk;
                };
                RunRecord record;
                std::exit(run_loop(
                    camera, [] { return std::string(); }, session, options, record));
            },
            testing::ExitedWithCode(128 + signal), "");
        EXPECT_EQ(poses_in(test::read_text(options.trajectory)), 31U);
    }
}

// Promise: a stream that is stuck gives no pose while it lasts, is said within five frames with its name and its
// second, counted in both summaries, and tracked behind.
TEST(RunLoop, StuckStreamsHaveNoPose) {
    for (const bool is_colour : {true, false}) {
        StoryCamera camera;
        StorySession session;
        const std::vector<std::uint8_t> colour = camera.colour;
        camera.status_of = [&](std::uint64_t i) {
            const bool is_stuck = i > 30 && i < 60;
            for (std::size_t k = 0; k < colour.size(); ++k) {
                if (!is_stuck || !is_colour)
                    camera.colour[k] = static_cast<std::uint8_t>(colour[k] + (i * 37 + k * i) % 50);
                if (!is_stuck || is_colour)
                    camera.depth[k] = static_cast<std::uint16_t>(9000 + (i * 631 + k * 7) % 3000);
            }
            return Status::kOk;
        };
        const Outcome outcome = play(camera, session);
        const std::string name = is_colour ? "colour" : "depth";
        EXPECT_EQ(outcome.record.frames_total, 90U);
        EXPECT_EQ(poses_in(outcome.trajectory), 61U);
        EXPECT_EQ(outcome.record.state_counts[0], 29U);
        EXPECT_EQ(outcome.record.streams.times_stuck, 1U);
        EXPECT_NE(outcome.trajectory.find("# second 1.0: the " + name + " images repeat to the bit"),
                  std::string::npos);
        ASSERT_EQ(outcome.record.streams.stuck.size(), 1U);
        EXPECT_EQ(outcome.record.streams.stuck[0].stream, name);
        EXPECT_EQ(outcome.record.streams.stuck[0].frames, 29U);
        EXPECT_NE(summary_text(outcome.record, "").find("stuck once"), std::string::npos);
        EXPECT_NE(summary_json(outcome.record, "", 0).find("\"times_stuck\": 1"), std::string::npos);
    }
}

// Promise: without depth for a while is a note that says when and how long, and after a second a word at once.
TEST(RunLoop, MissingDepthIsNoted) {
    StoryCamera camera;
    StorySession session;
    camera.status_of = [&](std::uint64_t i) {
        std::fill(camera.depth.begin(), camera.depth.end(), std::uint16_t(i >= 30 && i < 75 ? 0 : 10000));
        return Status::kOk;
    };
    const Outcome outcome = play(camera, session);
    EXPECT_EQ(outcome.code, 0);
    ASSERT_EQ(outcome.record.notes.size(), 1U);
    EXPECT_EQ(outcome.record.notes[0], "no depth for 1.5 s from second 1.0 on.");
    EXPECT_NE(outcome.trajectory.find("# second 1.0: the depth images are empty.\n"), std::string::npos);
    EXPECT_EQ(poses_in(outcome.trajectory), 90U);
}

// Promise: why a camera stays lost is told apart: where it would find its way if it began anew, the map lacks the
// place, or is the map of another; else too little stands still. Where most of what was matched moved before, a body
// may hide the room, which alone a map could begin on as well. What the pictures say goes before.
TEST(RunLoop, TheLastSentenceIsRight) {
    const struct {
        bool is_black, would_begin, begins_in_map, is_moving;
        std::uint64_t first_lost;
        const char* sentence;
    } cases[] = {
        {false, false, false, false, 20, "too few features stood still"},
        {false, true, false, false, 20, "this place is not in the map; go back"},
        {false, true, true, false, 0, "nothing of it is in the map that was read"},
        {false, true, true, false, 20, "this place is not in the map; go back"},
        {false, false, true, false, 0, "too few features stood still"},
        {true, true, false, false, 20, "the images are black"},
        {false, true, false, true, 20, "most of what was seen when it was lost moved; wait"},
        {false, false, true, true, 20, "most of what was seen when it was lost moved; wait"},
        {false, true, true, true, 0, "nothing of it is in the map that was read"},
        {true, true, false, true, 20, "the images are black"},
    };
    for (const auto& c : cases) {
        StoryCamera camera;
        StorySession session;
        session.would_begin_here = c.would_begin;
        session.is_moving = c.is_moving;
        session.state_of = [&c](std::uint64_t i) { return i >= c.first_lost ? PoseState::kNone : PoseState::kTracked; };
        if (c.is_black) std::fill(camera.colour.begin(), camera.colour.end(), std::uint8_t{3});
        RunLoopOptions options;
        options.show_progress = false;
        options.begins_in_map = c.begins_in_map;
        RunRecord record;
        EXPECT_EQ(run_loop(
                      camera, [] { return std::string(); }, session, options, record),
                  1);
        EXPECT_NE(record.problems.at(0).find(c.sentence), std::string::npos) << record.problems[0];
    }
}

// Promise: lost for as long as it says, a run with --new-map-when-lost begins another map, once; what is given out
// behind is marked, the error is that of the map with most poses, and the run is good.
TEST(RunLoop, BeginsAnotherMap) {
    StoryCamera camera;
    camera.frames = 200;
    StorySession session;
    session.state_of = [&session](std::uint64_t i) {
        return i >= 50 && session.maps_begun == 0 ? PoseState::kNone : PoseState::kTracked;
    };
    test::TemporaryFolder folder;
    RunLoopOptions options;
    options.trajectory = folder.path() + "/t.txt";
    options.show_progress = false;
    options.keep_trajectory = true;
    options.new_map_after_ns = 1'000'000'000;
    RunRecord record;
    EXPECT_EQ(run_loop(
                  camera, [] { return std::string(); }, session, options, record),
              0)
        << record.problems.at(0);
    EXPECT_EQ(session.maps_begun, 1);
    ASSERT_EQ(record.new_maps.size(), 1U);
    EXPECT_NEAR(record.new_maps[0].second, 81 * 0.033, 0.05);
    const std::string text = test::read_text(options.trajectory);
    EXPECT_NE(text.find("# map 2: second 2.6: no pose for 1.0 s: the story begins anew."), std::string::npos) << text;
    EXPECT_NE(summary_json(record, "", 0).find("\"new_maps\": [\n    {"), std::string::npos);
    EXPECT_EQ(record.estimate.size(), 200U - 81) << "of the second map, which has more";
}

// Promise: black, saturated, empty, covered and plain pictures are told apart.
TEST(FrameDiagnosis, TellsWhy) {
    StoryCamera camera;
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    EXPECT_EQ(diagnose(frame), FrameFault::kNone);
    EXPECT_EQ(diagnose(frame, {.min_m = 0.3, .max_m = 1.9}), FrameFault::kOutOfRange);
    EXPECT_EQ(diagnose(frame, {.min_m = 2.1, .max_m = 6}), FrameFault::kOutOfRange);
    std::fill(camera.depth.begin(), camera.depth.end(), std::uint16_t{0});
    EXPECT_EQ(diagnose(frame), FrameFault::kNoDepth);
    std::fill(camera.colour.begin(), camera.colour.end(), std::uint8_t{0});
    EXPECT_EQ(diagnose(frame), FrameFault::kBlack);
    std::fill(camera.colour.begin(), camera.colour.end(), std::uint8_t{255});
    EXPECT_EQ(diagnose(frame), FrameFault::kSaturated);
    std::fill(camera.colour.begin(), camera.colour.end(), std::uint8_t{90});
    EXPECT_EQ(diagnose(frame), FrameFault::kCovered);
    std::fill(camera.depth.begin(), camera.depth.end(), std::uint16_t{10000});
    EXPECT_EQ(diagnose(frame), FrameFault::kPlain);
}

// Promise: percentiles of a histogram in fixed memory are within a bucket (0.8 %) of the sorted values.
TEST(Percentiles, AreWithinABucket) {
    Percentiles percentiles;
    for (int i = 1; i <= 1000; ++i) percentiles.add(0.01 * i);
    EXPECT_NEAR(percentiles.median(), 5.0, 0.05);
    EXPECT_NEAR(percentiles.p99(), 9.9, 0.1);
    EXPECT_EQ(percentiles.max(), 10.0);
    EXPECT_EQ(Percentiles().median(), 0.0);
}

// Promise: a record's memory stays bounded, evenly thinned, while its counts stay exact.
TEST(RunRecord, StaysBounded) {
    RunRecord record;
    constexpr std::uint64_t kFrames = 200'000;
    for (std::uint64_t i = 0; i < kFrames; ++i) {
        FrameRecord frame;
        frame.time_ns = static_cast<std::int64_t>(i);
        frame.state = PoseState::kTracked;
        record.add(frame);
    }
    EXPECT_EQ(record.frames_total, kFrames);
    EXPECT_EQ(record.coverage(), 1.0);
    EXPECT_LE(record.frames.size(), RunRecord::kFramesMax);
    for (std::size_t i = 0; i < record.frames.size(); ++i) {
        ASSERT_EQ(record.frames[i].time_ns, static_cast<std::int64_t>(i * record.frames_stride));
    }
}

// Promise: the machine's summary is the human's: same numbers, and a name of broken bytes does not break it.
TEST(Summary, JsonHoldsTheNumbers) {
    RunRecord record;
    record.input = "\xff\xfe";
    FrameRecord frame;
    frame.state = PoseState::kTracked;
    record.add(frame);
    EXPECT_EQ(summary_text(record, "").find("unsure  "), std::string::npos);
    frame.state = PoseState::kUnsure;
    frame.unsure = UnsureReason::kFewPoints;
    record.add(frame);
    frame.unsure = UnsureReason::kNone;  // by the engine, that is: the camera's fault made it unsure
    record.add(frame);
    EXPECT_NE(summary_text(record, "").find("unsure        1 camera fault, 1 few points\n"), std::string::npos);
    record.state_hash = 0xabc;
    const std::string json = summary_json(record, "", 1);
    EXPECT_NE(json.find("\"frames\": 3"), std::string::npos);
    EXPECT_NE(json.find("\"state_hash\": \"0000000000000abc\""), std::string::npos);
    EXPECT_NE(json.find("\"evaluation\": null"), std::string::npos);
    EXPECT_NE(json.find("\"few_points\": 1"), std::string::npos);
    EXPECT_NE(json.find("\"rival_motion\": 0"), std::string::npos);
    EXPECT_NE(summary_text(record, "").find("no ground truth"), std::string::npos);
}

}  // namespace
}  // namespace stillmesh::run_loop_test
