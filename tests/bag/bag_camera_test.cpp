// BagCamera: pixels, times and camera of every encoding, what is refused, and bags that are torn or damaged.
#include "hal/bag/bag_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "tests/bag/bag_maker.hpp"

namespace stillmesh::bag_camera_test {
namespace {

using test::KeptFrame;
using test::Room;

constexpr test::RoomOptions kSmall{.frames = 6, .width = 64, .height = 48};

[[nodiscard]] const Room& small_room(bool is_rgb = false) {
    static const Room grey(kSmall);
    static const Room rgb({.frames = 6, .width = 64, .height = 48, .is_rgb = true});
    return is_rgb ? rgb : grey;
}

struct Played {
    std::vector<KeptFrame> frames;
    std::vector<std::string> complaints;  // of polls that gave kCorrupt
    BagCounts counts;
    std::vector<std::string> notes;
    std::size_t timeouts = 0;
};

// Every frame until the end, which comes within a bound.
[[nodiscard]] Played play(BagCamera& camera) {
    Played out;
    Frame frame;
    for (std::size_t polls = 0; polls < 10'000; ++polls) {
        const Status status = camera.poll(frame);
        if (status == Status::kEnd) break;
        if (status == Status::kTimedOut) {
            ++out.timeouts;
            continue;
        }
        if (status != Status::kOk) {
            EXPECT_EQ(status, Status::kCorrupt) << camera.message();
            EXPECT_FALSE(camera.message().empty());
            out.complaints.push_back(camera.message());
            continue;
        }
        KeptFrame kept;
        kept.width = frame.colour.width;
        kept.height = frame.colour.height;
        kept.time_ns = frame.time_ns;
        kept.format = frame.format;
        const std::size_t row_bytes = std::size_t{kept.width} * channels_of(frame.format);
        for (std::uint32_t y = 0; y < kept.height; ++y) {
            kept.colour.insert(kept.colour.end(), frame.colour.row(y), frame.colour.row(y) + row_bytes);
            kept.depth.insert(kept.depth.end(), frame.depth.row(y), frame.depth.row(y) + kept.width);
        }
        out.frames.push_back(std::move(kept));
    }
    EXPECT_EQ(camera.poll(frame), Status::kEnd);
    out.counts = camera.counts();
    out.notes = camera.closing_notes();
    return out;
}

[[nodiscard]] Played play(const std::string& path) {
    BagCamera camera({.path = path, .topics = "", .calibration = ""});
    EXPECT_EQ(camera.open(), Status::kOk) << camera.message();
    return play(camera);
}

void expect_frames(const Played& played, const Room& room) {
    ASSERT_EQ(played.frames.size(), room.frames().size());
    for (std::size_t i = 0; i < played.frames.size(); ++i) {
        EXPECT_EQ(played.frames[i].time_ns, room.frames()[i].time_ns);
        EXPECT_EQ(played.frames[i].format, room.frames()[i].format);
        EXPECT_EQ(played.frames[i].colour, room.frames()[i].colour) << "frame " << i;
        EXPECT_EQ(played.frames[i].depth, room.frames()[i].depth) << "frame " << i;
    }
}

// Promise: pixels, times and the camera are those that were recorded, of every encoding and both kinds of messages.
TEST(BagCamera, PlaysWhatWasRecorded) {
    for (const std::string format : {"ros1", "db3", "mcap"}) {
        for (const std::string encoding : {"mono8", "rgb8", "bgr8", "rgba8", "bgra8", "yuv422", "yuv422_yuy2"}) {
            SCOPED_TRACE(format + " " + encoding);
            const Room& room = small_room(encoding.find('8') != std::string::npos && encoding != "mono8");
            const std::string path =
                room.bag(format + "_" + encoding, "--format " + format + " --padding 6 --colour " + encoding);
            BagCamera camera({.path = path, .topics = "", .calibration = ""});
            ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
            EXPECT_EQ(camera.info().model.fx, room.camera().fx);
            EXPECT_EQ(camera.info().model.cy, room.camera().cy);
            EXPECT_EQ(camera.info().depth_units_per_m, 1000);
            EXPECT_EQ(camera.calibration_source(), "topic /camera/rgb/camera_info");
            const Played played = play(camera);
            expect_frames(played, room);
            EXPECT_TRUE(played.complaints.empty()) << played.complaints[0];
            EXPECT_TRUE(played.notes.empty()) << played.notes[0];
            EXPECT_EQ(camera.open(), Status::kOk);  // once more from the beginning
            EXPECT_EQ(play(camera).frames.size(), room.frames().size());
        }
    }
}

// Promise: depth in metres that compressedDepth quantised comes out within half a step of its inverse depth, and
// nothing out of nothing.
TEST(BagCamera, ReadsQuantisedDepth) {
    const Room room({.frames = 2, .width = 64, .height = 48, .units_per_m = 5000});
    const Played played = play(room.bag("q.bag", "--format ros1 --depth compressedDepth32"));
    ASSERT_EQ(played.frames.size(), 2U);
    std::size_t measured = 0;
    for (std::size_t i = 0; i < played.frames[1].depth.size(); ++i) {
        const double truth = room.frames()[1].depth[i], got = played.frames[1].depth[i];
        const double step = truth / 5000 * (truth / 5000) / (100.0 * 101) * 5000;  // z^2 / a, in units
        EXPECT_LE(std::abs(truth - got), step + 1) << i;
        if (truth > 0) ++measured;
    }
    EXPECT_GT(measured, played.frames[1].depth.size() / 2);
}

// Promise: smaller depth is brought to colour's size, and said.
TEST(BagCamera, ResizesDepth) {
    const Room& room = small_room();
    BagCamera camera({.path = room.bag("s.mcap", "--format mcap --small-depth"), .topics = "", .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_NE(camera.notes().at(1).find("depth is 32x24, colour 64x48"), std::string::npos) << camera.notes().at(1);
    const Played played = play(camera);
    ASSERT_EQ(played.frames.size(), 6U);
    for (std::uint32_t y = 0; y < 48; ++y) {
        for (std::uint32_t x = 0; x < 64; ++x) {
            ASSERT_EQ(played.frames[3].depth[y * 64 + x], room.frames()[3].depth[(y / 2 * 2) * 64 + x / 2 * 2]);
        }
    }
}

// Promise: units come from what the bag says: metres as in TUM recordings, RealSense's own unit, or what is asked for.
TEST(BagCamera, KnowsItsUnits) {
    const Room& room = small_room();
    const struct {
        const char* arguments;
        double asked, expected;
    } cases[] = {{"--depth 16UC1", 0, 1000},
                 {"--depth 16UC1", 2000, 2000},
                 {"--depth 32FC1", 0, 5000},
                 {"--depth 32FC1", 1000, 1000},
                 {"--depth mono16 --realsense --depth-info --unit-m 0.00025", 0, 4000}};
    int number = 0;
    for (const auto& one : cases) {
        const std::string path =
            room.bag("u" + std::to_string(++number), "--format ros1 " + std::string(one.arguments));
        BagCamera camera({.path = path, .topics = "", .calibration = "", .depth_units_per_m = one.asked});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        EXPECT_EQ(camera.info().depth_units_per_m, one.expected) << one.arguments;
    }
}

// Promise: a rectified image has the camera P without distortion, another one K with it.
TEST(BagCamera, RectifiedImagesHaveAnotherCamera) {
    const Room& room = small_room();
    const std::string lens = R"( --camera '{"d":[0.1,-0.2,0.001,0.002,0.05],"p":[44,0,30,0,0,45,20,0,0,0,1,0]}')";
    BagCamera raw({.path = room.bag("raw", "--format db3" + lens), .topics = "", .calibration = ""});
    ASSERT_EQ(raw.open(), Status::kOk) << raw.message();
    EXPECT_EQ(raw.info().model.fx, room.camera().fx);
    EXPECT_EQ(raw.info().model.k2, -0.2);
    EXPECT_EQ(raw.info().model.k3, 0.05);
    const std::string names = R"( --names '{"colour":"/camera/rgb/image_rect_color"}')";
    BagCamera flat({.path = room.bag("flat", "--format db3" + lens + names), .topics = "", .calibration = ""});
    ASSERT_EQ(flat.open(), Status::kOk) << flat.message();
    EXPECT_EQ(flat.info().model.fx, 44);
    EXPECT_EQ(flat.info().model.cy, 20);
    EXPECT_EQ(flat.info().model.k1, 0);
}

// Promise: what cannot be played is refused when it is opened, with a sentence that says what to do.
TEST(BagCamera, RefusesWithASentence) {
    const Room& room = small_room();
    const struct {
        const char* arguments;
        const char* sentence;
    } cases[] = {
        {"--depth-info --other-depth-camera --depth-frame-id camera_depth_optical_frame",
         "is not registered to colour (/camera/rgb/image_raw): another frame and another camera, and no transform "
         "between them in the bag; record /tf_static"},
        {"--realsense --depth mono16 --depth-info --other-depth-camera", "no transform between them in the bag"},
        {"--no-info", "no CameraInfo beside /camera/rgb/image_raw; name one with --topics"},
        {R"(--camera '{"binning":2}')", "binned or a part of the picture (binning 2x0"},
        {R"(--camera '{"model":"fov"}')", "fov"},
        {R"(--camera '{"fx":0}')", "topic /camera/rgb/camera_info, line 3: key 'K' is 0"},
        {R"(--camera '{"width":640,"height":480}')", "is for 640x480 pixels, the images are 64x48"},
        {"--skip-depth 1", "no topic with depth images that are read here; name them with --topics"},
    };
    int number = 0;
    for (const auto& one : cases) {
        const std::string path =
            room.bag("r" + std::to_string(++number), "--format ros1 " + std::string(one.arguments));
        BagCamera camera({.path = path, .topics = "", .calibration = ""});
        const Status status = camera.open();
        EXPECT_EQ(status, Status::kInvalid) << one.arguments;
        EXPECT_NE(camera.message().find(one.sentence), std::string::npos) << one.arguments << ": " << camera.message();
    }
    const Room late({.frames = 6, .width = 64, .height = 48, .depth_lag_ns = 5'000'000'000});
    BagCamera camera({.path = late.bag("late", "--format mcap"), .topics = "", .calibration = ""});
    EXPECT_EQ(camera.open(), Status::kInvalid);
    EXPECT_NE(camera.message().find("--depth-offset=5.000"), std::string::npos) << camera.message();
    BagCamera shifted({.path = late.path("late"), .topics = "", .calibration = "", .depth_offset_ns = 5'000'000'000});
    ASSERT_EQ(shifted.open(), Status::kOk) << shifted.message();
    EXPECT_EQ(play(shifted).frames.size(), 6U);
}

// Promise: missing depth and times that repeat are counted and said; what is left plays.
TEST(BagCamera, CountsWhatIsMissing) {
    const Room& room = small_room();
    const Played holes = play(room.bag("holes", "--format mcap --skip-depth 3"));
    EXPECT_EQ(holes.frames.size(), 4U);
    EXPECT_EQ(holes.counts.lonely_colour, 2U);
    ASSERT_EQ(holes.notes.size(), 1U);
    EXPECT_EQ(holes.notes[0], "2 of 6 colour images have no depth image within 20 ms: skipped.");
    const Played twice = play(room.bag("twice", "--format db3 --rounds 2"));
    EXPECT_EQ(twice.frames.size(), 6U);
    EXPECT_EQ(twice.counts.times_back, 12U);
    ASSERT_EQ(twice.notes.size(), 1U);
    EXPECT_EQ(twice.notes[0], "12 images have a time that repeats or goes backwards: skipped.");
}

// Promise: a poll reads so many messages and no more, so that whoever polls can stop in a bag without pairs.
TEST(BagCamera, PollsAreBounded) {
    const Room& room = small_room();
    const Played played = play(room.bag("long", "--format mcap --rounds 100"));  // from the second round on: repeated
    EXPECT_EQ(played.frames.size(), 6U);
    EXPECT_EQ(played.counts.times_back, 12U * 99);
    EXPECT_EQ(played.timeouts, 5U);  // 1188 messages, 200 a poll
}

// Promise: a recording whose recorder was killed plays whole and says so, without an index.
TEST(BagCamera, PlaysWhatAKilledRecorderLeft) {
    const Room& room = small_room();
    for (const std::string format : {"ros1", "mcap"}) {
        const std::string path = room.bag("killed_" + format, "--format " + format + " --killed --chunk-bytes 1");
        const Played played = play(path);
        EXPECT_EQ(played.frames.size(), room.frames().size()) << format;
        ASSERT_EQ(played.notes.size(), 1U) << format;
        EXPECT_NE(played.notes[0].find("was never closed"), std::string::npos) << played.notes[0];
    }
    // Within a chunk, which then has no length yet.
    const Played within = play(room.bag("killed_within", "--format ros1 --killed"));
    EXPECT_EQ(within.frames.size(), room.frames().size());
    const Played rows = play(room.bag("killed_db3", "--format db3 --killed"));
    EXPECT_EQ(rows.frames.size(), room.frames().size());
}

// Promise: wherever a bag is torn it plays up to there, bit for bit what the whole one gives, and says so; with what is
// before the first pair it is refused.
TEST(BagCamera, PlaysUpToTheTear) {
    const Room& room = small_room();
    int number = 0;
    for (const std::string kind :
         {"ros1 --packing none", "ros1 --packing lz4", "mcap --packing none", "mcap --packing zstd", "db3"}) {
        const std::string name = "whole" + std::to_string(++number);
        const std::string bytes = test::read_text(room.bag(name, "--format " + kind + " --chunk-bytes 9000"));
        std::size_t most = 0, said = 0, opened = 0;
        for (int cut = 1; cut < 40; ++cut) {
            test::write_text(room.path("torn"), bytes.substr(0, bytes.size() * static_cast<std::size_t>(cut) / 40));
            BagCamera camera({.path = room.path("torn"), .topics = "", .calibration = ""});
            if (camera.open() != Status::kOk) {
                EXPECT_FALSE(camera.message().empty());
                continue;
            }
            ++opened;
            const Played played = play(camera);
            EXPECT_GE(played.frames.size(), most) << kind << " " << cut;
            most = played.frames.size();
            for (std::size_t i = 0; i < most; ++i) EXPECT_EQ(played.frames[i].colour, room.frames()[i].colour);
            if (!played.complaints.empty() || !played.notes.empty()) ++said;
        }
        EXPECT_GE(most, 4U) << kind;
        EXPECT_GE(opened, 15U) << kind;
        EXPECT_EQ(said, opened) << kind;
    }
}

// Promise: whatever bytes are wrong, opening gives a sentence or a camera, polling ends, and every frame has all its
// pixels.
TEST(BagCamera, AnyDamageIsSurvived) {
    const Room& room = small_room();
    std::uint32_t random = 12345;
    const auto next = [&random] { return random = random * 1664525U + 1013904223U; };
    int number = 0;
    for (const std::string kind : {"ros1 --packing none", "ros1 --packing bz2", "mcap --packing none",
                                   "mcap --packing lz4", "db3", "db3 --packing zstd"}) {
        const std::string name = "good" + std::to_string(++number);
        const std::string good = test::read_text(room.bag(name, "--format " + kind + " --chunk-bytes 9000"));
        std::size_t frames = 0, complaints = 0;
        for (int round = 0; round < 60; ++round) {
            std::string bytes = good;
            for (std::uint32_t changes = 1 + (next() >> 30U); changes > 0; --changes) {
                // Now and then where names and headers are.
                const std::size_t at = (next() >> 8U) % (round % 4 != 0 ? bytes.size() : bytes.size() / 20);
                bytes[at] = static_cast<char>(next() >> 24U);
            }
            test::write_text(room.path("bad"), bytes);
            BagCamera camera({.path = room.path("bad"), .topics = "", .calibration = ""});
            if (camera.open() != Status::kOk) {
                EXPECT_FALSE(camera.message().empty());
                continue;
            }
            const Played played = play(camera);
            frames += played.frames.size();
            complaints += played.complaints.size();
            for (const KeptFrame& frame : played.frames) EXPECT_EQ(frame.depth.size(), 64U * 48);
        }
        EXPECT_GT(frames, 60U) << kind;
        EXPECT_GT(complaints, 0U) << kind;
    }
}

}  // namespace
}  // namespace stillmesh::bag_camera_test
