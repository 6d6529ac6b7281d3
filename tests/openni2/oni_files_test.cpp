// Recordings as others may have made them: every size and rate, unregistered depth, lossy colour, streams missing. Each
// is played whole, or refused with the reason. Made here, through the real OpenNI2's recorder.
#include <OpenNI.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "hal/openni2/openni2_camera.hpp"
#include "hal/openni2/openni2_runtime.hpp"
#include "tests/openni2/rig.hpp"

namespace stillmesh::oni_files_test {
namespace {

using test::CameraRig;

using test::kDepthPixelsLost;

// What our own recording never asks for: streams alone, of different sizes, lossy. Width 0: not that stream.
struct Wanted {
    int colour_width = 640, depth_width = 640;
    bool is_lossy = false;
    int images = 8;  // of each stream
};

[[nodiscard]] bool record_streams(const std::string& file, const Wanted& wanted) {
    std::string message;
    const std::shared_ptr<openni2::Runtime> runtime = openni2::Runtime::get(message);
    openni::Device device;
    if (runtime == nullptr || device.open(test::uri_of(0).text) != openni::STATUS_OK) return false;
    static_cast<void>(device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR));
    openni::VideoStream colour, depth;
    openni::Recorder recorder;
    bool is_well = recorder.create(file.c_str()) == openni::STATUS_OK;
    std::vector<openni::VideoStream*> streams;
    const auto add = [&](openni::VideoStream& stream, openni::SensorType type, int width) {
        if (width == 0) return;
        is_well = is_well && stream.create(device, type) == openni::STATUS_OK;
        const openni::Array<openni::VideoMode>& modes = stream.getSensorInfo().getSupportedVideoModes();
        for (int i = 0; i < modes.getSize(); ++i) {
            if (modes[i].getResolutionX() == width)
                is_well = is_well && stream.setVideoMode(modes[i]) == openni::STATUS_OK;
        }
        stream.setMirroringEnabled(false);
        is_well = is_well && recorder.attach(stream, wanted.is_lossy) == openni::STATUS_OK;
        streams.push_back(&stream);
    };
    add(depth, openni::SENSOR_DEPTH, wanted.depth_width);
    add(colour, openni::SENSOR_COLOR, wanted.colour_width);
    is_well = is_well && recorder.start() == openni::STATUS_OK;
    for (openni::VideoStream* const stream : streams) is_well = is_well && stream->start() == openni::STATUS_OK;
    for (int i = 0; is_well && i < wanted.images * static_cast<int>(streams.size()); ++i) {
        int ready = -1;
        is_well = openni::OpenNI::waitForAnyStream(streams.data(), static_cast<int>(streams.size()), &ready, 2000) ==
                  openni::STATUS_OK;
        openni::VideoFrameRef image;
        is_well = is_well && streams[static_cast<std::size_t>(ready)]->readFrame(&image) == openni::STATUS_OK;
    }
    for (openni::VideoStream* const stream : streams) stream->stop();
    recorder.stop();
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // as OpenNi2Camera does, and for the same reason
    recorder.destroy();
    for (openni::VideoStream* const stream : streams) stream->destroy();
    device.close();
    return is_well;
}

// Records in a process of its own each time: OpenNI2 remembers threads that it wrote an error for, its recorder's too,
// which end, and asks glibc about them later. Forked by one that never had a thread, since what other threads hold at a
// fork stays held in the child, and qemu-user does not survive the child's first thread.
class RecorderProcess {
public:
    RecorderProcess() {
        EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
        child_ = ::fork();
        ::close(ends_[child_ == 0 ? 0 : 1]);
        if (child_ == 0) serve();
    }
    ~RecorderProcess() {
        ::close(ends_[0]);
        EXPECT_EQ(::waitpid(child_, nullptr, 0), child_);
    }
    RecorderProcess(const RecorderProcess&) = delete;
    RecorderProcess& operator=(const RecorderProcess&) = delete;

    [[nodiscard]] bool record(const std::string& file, const Wanted& wanted) {
        Request request{{}, wanted};
        if (file.size() >= sizeof(request.file)) return false;
        file.copy(request.file, file.size());
        bool is_well = false;
        return ::write(ends_[0], &request, sizeof(request)) == sizeof(request) &&
               ::read(ends_[0], &is_well, sizeof(is_well)) == sizeof(is_well) && is_well;
    }

private:
    struct Request {
        char file[512];
        Wanted wanted;
    };
    [[noreturn]] void serve() {
        Request request;
        while (::read(ends_[1], &request, sizeof(request)) == sizeof(request)) {
            const pid_t child = ::fork();
            if (child == 0) ::_exit(record_streams(request.file, request.wanted) ? 0 : 1);
            int status = 0;
            const bool is_well = child > 0 && ::waitpid(child, &status, 0) == child && status == 0;
            if (::write(ends_[1], &is_well, sizeof(is_well)) != sizeof(is_well)) break;
        }
        ::_exit(0);
    }

    int ends_[2] = {-1, -1};
    pid_t child_ = -1;
};

// With `stillmesh capture`'s means. The recorder begins somewhat after the streams, later still on a busy machine.
[[nodiscard]] bool record(const std::string& file, int frames) {
    OpenNi2Options options;
    options.record = file;
    OpenNi2Camera camera(options);
    if (camera.open() != Status::kOk) return false;
    int got = 0;
    Frame frame;
    return test::within(20'000, [&] { return (got += camera.poll(frame) == Status::kOk) >= frames; });
}

struct Played {
    // All frames as rendered.
    [[nodiscard]] bool is_right() const {
        return std::all_of(depth_wrong.begin(), depth_wrong.end(),
                           [](long wrong) { return wrong <= kDepthPixelsLost; });
    }

    Status opened = Status::kInvalid, ended = Status::kInvalid;
    std::string message, notes;
    CameraInfo info;
    std::uint64_t expected = 0;  // pairs at most
    std::vector<std::int64_t> times_ns;
    std::vector<long> depth_wrong, colour_error;  // of each frame: pixels; summed grey values
};

class OniFiles : public testing::Test {
protected:
    OniFiles() : rig(STILLMESH_LARGE_FRAMES), file(folder.path("unknown.oni")) { rig.camera().is_plugged = 1; }

    // How many depth pixels are wrong, and how far grey is off, against rendered frame i.
    void compare(const Frame& frame, std::uint32_t i, bool is_raw, long& depth_wrong, long& colour_error) const {
        const std::uint32_t units = static_cast<std::uint32_t>(frame.depth_units_per_m) / 1000;
        const std::uint32_t step = rig.head().width / frame.colour.width;
        depth_wrong = colour_error = 0;
        for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
            for (std::uint32_t x = 0; x < frame.colour.width; ++x) {
                const std::size_t at = std::size_t{y} * step * rig.head().width + std::size_t{x} * step;
                const std::uint32_t mm = (is_raw ? rig.raw_depth_mm(i) : rig.depth_mm(i))[at];
                depth_wrong += frame.depth.at(x, y) != (mm * units <= test::kDepthMax ? mm * units : 0);
                if (step == 1) colour_error += std::abs(frame.colour.row(y)[3 * x] - rig.grey(i)[at]);
            }
        }
    }
    // Both images of every frame are compared with the rendered ones that they are nearest to.
    [[nodiscard]] Played play(const OpenNi2Options& options, bool is_raw = false) const {
        Played played;
        OpenNi2Camera camera(options);
        played.opened = camera.open();
        played.message = camera.message();
        if (played.opened != Status::kOk) return played;
        played.info = camera.info();
        played.expected = camera.frames_expected();
        for (const std::string& note : camera.notes()) played.notes += note + "\n";
        Frame frame;
        while ((played.ended = camera.poll(frame)) == Status::kOk && played.times_ns.size() < 100) {
            played.times_ns.push_back(frame.time_ns);
            long best = -1, best_colour = -1;
            for (std::uint32_t i = 0; i < rig.head().count; ++i) {
                long depth_wrong = 0, colour_error = 0;
                compare(frame, i, is_raw, depth_wrong, colour_error);
                if (best < 0 || depth_wrong < best) best = depth_wrong;
                if (best_colour < 0 || colour_error < best_colour) best_colour = colour_error;
            }
            played.depth_wrong.push_back(best);
            played.colour_error.push_back(best_colour);
        }
        return played;
    }
    [[nodiscard]] Played play(const std::string& name) const { return play(OpenNi2Options{.device = name}); }
    // Recorded and played, once more where a busy machine lost images that were to be recorded.
    template <typename Record>
    [[nodiscard]] Played play_recorded(const Record& record, std::size_t frames) {
        constexpr int kAttempts = 30;
        Played played;
        for (int i = 0; i < kAttempts; ++i) {
            if (!record()) continue;
            played = play(file);
            const std::size_t count = played.times_ns.size();
            if (played.opened != Status::kOk || (count >= frames && count + 2 >= played.expected)) return played;
        }
        ADD_FAILURE() << "never " << frames << " frames, all but two of the recorded";
        return played;
    }
    [[nodiscard]] Played play_recorded(const Wanted& wanted, std::size_t frames) {
        return play_recorded([&] { return raw_recorder.record(file, wanted); }, frames);
    }
    [[nodiscard]] test::Program start(const std::string& arguments) {
        return {STILLMESH_PROGRAM, STILLMESH_PRIVATE_OPENNI2, arguments, folder};
    }

    CameraRig rig;
    RecorderProcess raw_recorder;
    const test::TemporaryFolder folder;
    const std::string file;
};

// Promise: recordings of 640x480 and 320x240 at any rate are played whole, pixel by pixel, with their own size, rate
// and times.
TEST_F(OniFiles, AnySizeAndRate) {
    struct Case {
        std::uint32_t modes, fps;
    };
    for (const Case& c : {Case{1, 30}, Case{2, 30}, Case{1, 25}, Case{2, 60}, Case{2, 15}, Case{1, 10}, Case{2, 5}}) {
        SCOPED_TRACE(std::to_string(c.modes) + " at " + std::to_string(c.fps));
        rig.camera().modes = c.modes;
        rig.camera().colour_fps = rig.camera().depth_fps = c.fps;
        rig.camera().period_us = 1'000'000 / c.fps;
        const Played played = play_recorded([&] { return record(file, 8); }, 3);
        ASSERT_EQ(played.opened, Status::kOk) << played.message;
        EXPECT_EQ(played.ended, Status::kEnd);
        EXPECT_EQ(played.info.model.width, c.modes == 1 ? 640U : 320U);
        EXPECT_EQ(played.info.frames_per_s, c.fps);
        EXPECT_NEAR(played.info.model.fx, rig.head().fx / (c.modes == 1 ? 1 : 2), 0.01);
        EXPECT_TRUE(played.is_right());
        EXPECT_EQ(std::count(played.colour_error.begin(), played.colour_error.end(), 0),
                  static_cast<long>(played.times_ns.size()));
        for (std::size_t i = 1; i < played.times_ns.size(); ++i) {
            // Images that a busy machine lost leave gaps of whole periods.
            const double periods = static_cast<double>(played.times_ns[i] - played.times_ns[i - 1]) * 1e-9 * c.fps;
            EXPECT_NEAR(periods, std::round(periods), 0.01);
            EXPECT_GE(periods, 0.9);
        }
    }
}

// Promise: rates that no camera has, as a file may claim them, do not keep its images from each other.
TEST_F(OniFiles, ImpossibleRates) {
    rig.camera().modes = 2;
    for (const std::uint32_t fps : {1U, 240U, 10'000U}) {
        rig.camera().colour_fps = rig.camera().depth_fps = fps;
        SCOPED_TRACE(fps);
        const Played played = play_recorded({.colour_width = 320, .depth_width = 320}, 3);
        ASSERT_EQ(played.opened, Status::kOk) << played.message;
        EXPECT_TRUE(played.is_right());
    }
}

// Promise: where colour comes half as often as depth, every colour image finds its partner, and the user is told.
TEST_F(OniFiles, ColourAtHalfTheRate) {
    rig.camera().modes = 2;
    rig.camera().colour_fps = 15;
    rig.camera().depth_fps = 30;
    rig.camera().drop_colour_every = 2;
    const Played played = play_recorded([&] { return record(file, 8); }, 4);
    ASSERT_EQ(played.opened, Status::kOk) << played.message;
    EXPECT_TRUE(played.is_right());
    EXPECT_NE(played.notes.find("colour comes at 15 and depth at 30 images/s"), std::string::npos) << played.notes;
}

// Promise: an unregistered recording, which does not say that it is one, is played as it is, with a word of warning;
// with --registration here its depth is brought to colour.
TEST_F(OniFiles, RegistrationIsNotRecorded) {
    rig.camera().modes = 1;
    rig.camera().can_register = 0;
    static_cast<void>(play_recorded([&] { return record(file, 6); }, 2));
    const Played as_it_is = play({.device = file}, true);
    ASSERT_EQ(as_it_is.opened, Status::kOk) << as_it_is.message;
    ASSERT_GE(as_it_is.times_ns.size(), 2U);
    EXPECT_TRUE(as_it_is.is_right()) << "raw depth, as recorded";
    EXPECT_NE(as_it_is.notes.find("use --registration here"), std::string::npos) << as_it_is.notes;

    OpenNi2Camera camera({.device = file, .registration = Registration::kHere});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_NE(camera.device().find("registered here"), std::string::npos) << camera.device();
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    double best = 0;
    for (std::uint32_t i = 0; i < rig.head().count; ++i) {
        long both = 0, right = 0;
        for (std::size_t k = 0; k < rig.pixels(); ++k) {
            const int truth = rig.depth_mm(i)[k], here = frame.depth.data[k];
            if (truth == 0 || here == 0) continue;
            ++both;
            right += std::abs(here - truth) <= 20 + truth / 40;
        }
        best = std::max(best, static_cast<double>(right) / static_cast<double>(std::max(both, 1L)));
    }
    EXPECT_GT(best, 0.95);
}

// Promise: a recording of a camera that mirrored, as most recording programs leave it, is turned round; one that knows
// no field of view gets that of its kind, and says so.
TEST_F(OniFiles, MirroredAndWithoutFieldOfView) {
    rig.camera().modes = 1;
    rig.camera().can_unmirror = 0;
    rig.camera().has_no_fov = 1;
    const Played played = play_recorded(Wanted{}, 3);
    OpenNi2Camera camera({.device = file});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_EQ(camera.info().model.fx, 525.0);
    EXPECT_NE(camera.calibration_source().find("no field of view given"), std::string::npos)
        << camera.calibration_source();
    camera.close();
    EXPECT_TRUE(played.is_right());
    EXPECT_EQ(std::count(played.colour_error.begin(), played.colour_error.end(), 0),
              static_cast<long>(played.times_ns.size()));
}

// Promise: a recording that OpenNI2's player shows no image of, as of a camera whose driver knows no cropping, is
// refused with the reason, by the program too.
TEST_F(OniFiles, NothingComes) {
    rig.camera().modes = 2;
    rig.camera().has_no_cropping = 1;
    ASSERT_TRUE(raw_recorder.record(file, {.colour_width = 320, .depth_width = 320}));
    const std::string reason = file + ": OpenNI2's player gives 0 colour and 0 depth images of it";
    const Played played = play(file);
    EXPECT_EQ(played.opened, Status::kInvalid);
    EXPECT_NE(played.message.find(reason), std::string::npos) << played.message;
    test::Program run = start("run --camera openni2:" + file);
    EXPECT_EQ(run.wait(60'000), 2);
    EXPECT_NE(run.err().find(reason), std::string::npos) << run.err();
}

// Promise: lossy colour, depth in tenths of millimetres, and depth of another size than colour are played.
TEST_F(OniFiles, LossyFineAndMixed) {
    rig.camera().modes = 1;
    const Played lossy = play_recorded({.is_lossy = true}, 3);
    ASSERT_EQ(lossy.opened, Status::kOk) << lossy.message;
    for (std::size_t i = 0; i < lossy.times_ns.size(); ++i) {
        EXPECT_LE(lossy.depth_wrong[i], kDepthPixelsLost);
        EXPECT_LT(lossy.colour_error[i], 4L * 640 * 480) << "4 grey values a pixel";
    }
    rig.camera().modes = 1 | 16;
    const Played fine = play_recorded([&] { return record(file, 6); }, 2);
    ASSERT_EQ(fine.opened, Status::kOk) << fine.message;
    EXPECT_EQ(fine.info.depth_units_per_m, 10'000.0);
    EXPECT_TRUE(fine.is_right());

    rig.camera().modes = 3;
    for (const int depth_width : {320, 640}) {
        const Played mixed = play_recorded({.colour_width = 960 - depth_width, .depth_width = depth_width}, 3);
        ASSERT_EQ(mixed.opened, Status::kOk) << mixed.message;
        EXPECT_EQ(mixed.info.model.width, 960U - static_cast<std::uint32_t>(depth_width));
        // Scaled: nearly all pixels are the right ones, edges apart.
        EXPECT_LT(mixed.depth_wrong[0], static_cast<long>(mixed.info.model.width) * mixed.info.model.height * 2 / 3);
    }
}

// Promise: a recording is one by its name or because there is such a file, whatever it is called; what is none is
// refused with the reason, before OpenNI2 sees it.
TEST_F(OniFiles, AnyNameAndNoFile) {
    rig.camera().modes = 2;
    static_cast<void>(play_recorded([&] { return record(file, 6); }, 2));
    for (const char* const name : {"DESK.ONI", "desk.bin"}) {
        std::filesystem::copy_file(file, folder.path(name));
        const Played played = play(folder.path(name));
        EXPECT_EQ(played.opened, Status::kOk) << played.message;
        EXPECT_GE(played.times_ns.size(), 2U) << name;
        EXPECT_EQ(played.ended, Status::kEnd);
    }
    std::filesystem::create_directory(folder.path("folder.oni"));
    std::ofstream(folder.path("empty.oni"));
    std::ofstream(folder.path("text.oni")) << "not a recording";
    std::ofstream(folder.path("text.txt")) << "not a recording";
    struct Case {
        const char *name, *reason;
    };
    for (const Case& c : {Case{"missing.oni", "there is no such file."}, Case{"missing.ONI", "there is no such file."},
                          Case{"folder.oni", "is no regular file."}, Case{"empty.oni", "is empty."},
                          Case{"text.oni", "is no .oni recording"}, Case{"text.txt", "is no .oni recording"}}) {
        const Played played = play(folder.path(c.name));
        EXPECT_EQ(played.opened, Status::kInvalid) << c.name;
        EXPECT_NE(played.message.find(folder.path(c.name) + ": " + c.reason), std::string::npos) << played.message;
    }
}

// Promise: what cannot be used is refused with the reason and the file's name, by the camera and by the program; what
// can be is tracked by the program.
TEST_F(OniFiles, TheProgramRunsOrRefuses) {
    rig.camera().modes = 1;
    ASSERT_TRUE(record(file, 20));
    test::Program run = start("run --json --camera openni2:" + file);
    ASSERT_EQ(run.wait(60'000), 0) << run.err();
    const nlohmann::json json = nlohmann::json::parse(run.out(), nullptr, false);
    ASSERT_FALSE(json.is_discarded()) << run.out();
    EXPECT_GE(json["frames"], 12) << "20, on a machine that is not busy";
    EXPECT_EQ(json["coverage"], 1.0);

    struct Case {
        std::uint32_t modes;
        Wanted wanted;
        const char* reason;
    };
    for (const Case& c : {Case{1, {.colour_width = 0}, "has no colour images; both are needed"},
                          Case{1, {.depth_width = 0}, "has no depth images; both are needed"},
                          Case{9, {.colour_width = 1280}, "1280x1024@30 is larger than the limits (640x480)"}}) {
        rig.camera().modes = c.modes;
        ASSERT_TRUE(raw_recorder.record(file, c.wanted)) << c.reason;
        const Played played = play(file);
        EXPECT_EQ(played.opened, Status::kInvalid);
        EXPECT_NE(played.message.find(c.reason), std::string::npos) << played.message;
        EXPECT_NE(played.message.find(file), std::string::npos) << played.message;
        test::Program refused = start("run --camera openni2:" + file);
        EXPECT_EQ(refused.wait(20'000), 2);
        EXPECT_NE(refused.err().find(c.reason), std::string::npos) << refused.err();
    }
}

}  // namespace
}  // namespace stillmesh::oni_files_test
