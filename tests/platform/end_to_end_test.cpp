// The whole program from recording to trajectory: what it promises about results, memory and bad input.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <tuple>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::end_to_end_test {
namespace {

struct Answer {
    int code = -1;
    std::string out, error;
    [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(out, nullptr, false); }
};

[[nodiscard]] Answer stillmesh_says(const std::string& arguments) {
    const test::TemporaryFolder folder;
    const std::string out = folder.path() + "/out";
    const std::string error = folder.path() + "/error";
    Answer answer;
    const int status =
        std::system((std::string(STILLMESH_PROGRAM) + " " + arguments + " >" + out + " 2>" + error).c_str());
    if (WIFEXITED(status)) answer.code = WEXITSTATUS(status);
    answer.out = test::read_text(out);
    answer.error = test::read_text(error);
    return answer;
}

[[nodiscard]] std::size_t poses_in(const std::string& file) {
    Trajectory trajectory;
    std::string message;
    EXPECT_EQ(read_trajectory(file, trajectory, message), Status::kOk) << message;
    return trajectory.size();
}

// One image pair on its way to the disk.
struct Picture {
    std::uint32_t index = 0;
    std::uint32_t width = 0, height = 0;
    std::vector<std::uint8_t> grey;
    std::vector<std::uint16_t> depth;
    double time_s = 0;
    std::string truth;  // a line of groundtruth.txt
};

// A simulated recording in a folder of its own; tests spoil it.
class Recording {
public:
    // `edit` may change pixels and times; `rounds` lists the images again and again, to and fro, for long recordings.
    explicit Recording(std::uint32_t frames, const std::function<void(Picture&)>& edit = nullptr,
                       std::uint32_t width = 320, std::uint32_t height = 240, std::uint32_t rounds = 1) {
        std::string truth;
        std::vector<Picture> pictures = rendered(frames, width, height);
        for (Picture& p : pictures) {
            if (rounds == 1) truth += p.truth;
            if (edit != nullptr) edit(p);
            write_pair(p);
        }
        std::string rgb, depth;
        double time_s = pictures.front().time_s;
        for (std::uint32_t round = 0; round < rounds; ++round) {
            for (std::uint32_t i = 0; i < pictures.size(); ++i) {
                const std::size_t which = round % 2 == 0 ? i : pictures.size() - 1 - i;
                if (rounds == 1) time_s = pictures[which].time_s;
                char line[64];
                std::snprintf(line, sizeof(line), "%.6f ", time_s);
                rgb += line + ("rgb/" + std::to_string(which) + ".png\n");
                depth += line + ("depth/" + std::to_string(which) + ".png\n");
                time_s += 1.0 / 30;
            }
        }
        test::write_text(path("rgb.txt"), rgb);
        test::write_text(path("depth.txt"), depth);
        if (!truth.empty()) test::write_text(path("groundtruth.txt"), truth);
        char text[256];  // the simulated camera's
        std::snprintf(text, sizeof(text),
                      "width = %u\nheight = %u\nfx = %.3f\nfy = %.3f\ncx = %.1f\ncy = %.1f\ndepth_units_per_m = 5000\n",
                      width, height, 0.825 * width, 0.825 * width, (width - 1) / 2.0, (height - 1) / 2.0);
        test::write_text(path("camera.toml"), text);
    }
    [[nodiscard]] std::string path(const std::string& name = "") const { return folder_.path() + "/rec/" + name; }
    // Beside the recording.
    [[nodiscard]] std::string output(const std::string& name) const { return folder_.path() + "/" + name; }
    void write_pair(const Picture& p) const {
        const std::string number = std::to_string(p.index);
        test::write_bytes(path("rgb/" + number + ".png"),
                          test::encode_png(p.width, p.height, SPNG_COLOR_TYPE_GRAYSCALE, 8, p.grey));
        std::vector<std::uint8_t> bytes(2 * p.depth.size());
        std::copy_n(reinterpret_cast<const std::uint8_t*>(p.depth.data()), bytes.size(), bytes.begin());
        test::write_bytes(path("depth/" + number + ".png"),
                          test::encode_png(p.width, p.height, SPNG_COLOR_TYPE_GRAYSCALE, 16, bytes));
    }
    void replace(const std::string& name, const std::string& what, const std::string& by) const {
        std::string text = test::read_text(path(name));
        const std::size_t at = text.find(what);
        ASSERT_NE(at, std::string::npos) << what << " in " << name;
        test::write_text(path(name), text.replace(at, what.size(), by));
    }
    [[nodiscard]] Answer run(const std::string& more = "") const {
        return stillmesh_says("run --json --replay " + path() + " --trajectory " + output("t.txt") + " " + more);
    }

private:
    // Rendered once, however many recordings a test spoils.
    [[nodiscard]] static const std::vector<Picture>& rendered(std::uint32_t frames, std::uint32_t width,
                                                              std::uint32_t height) {
        static std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>, std::vector<Picture>> all;
        std::vector<Picture>& pictures = all[{frames, width, height}];
        if (!pictures.empty()) return pictures;
        SimulatedCamera camera(
            {.scene = "static_xyz", .seed = 3, .frames = frames, .width = width, .height = height, .exposure_ns = 0});
        EXPECT_EQ(camera.open(), Status::kOk) << camera.message();
        for (Frame frame; camera.poll(frame) == Status::kOk;) {
            Picture p;
            p.index = static_cast<std::uint32_t>(pictures.size());
            p.width = width;
            p.height = height;
            p.grey.assign(frame.colour.data, frame.colour.data + std::size_t{width} * height);
            p.depth.assign(frame.depth.data, frame.depth.data + std::size_t{width} * height);
            p.time_s = static_cast<double>(frame.time_ns) * 1e-9;
            p.truth = pose_line({frame.time_ns, camera.true_pose().t, camera.true_pose().q});
            pictures.push_back(std::move(p));
        }
        return pictures;
    }

    test::TemporaryFolder folder_;
};

// Promise: a recording is tracked, two runs write the same bytes, and the error told is the error eval finds.
TEST(EndToEnd, TracksTwiceTheSame) {
    const Recording recording(40);
    const Answer first = recording.run("--state-hashes " + recording.output("h1.txt") + " --trajectory-final " +
                                       recording.output("f.txt"));
    ASSERT_EQ(first.code, 0) << first.error;
    const std::string trajectory = test::read_text(recording.output("t.txt"));
    EXPECT_EQ(poses_in(recording.output("t.txt")), 40U);
    // What was learnt later moves poses known at the end, by millimetres here; none is lost.
    EXPECT_EQ(poses_in(recording.output("f.txt")), 40U);
    const Answer final = stillmesh_says("eval --json --groundtruth " + recording.path("groundtruth.txt") +
                                        " --trajectory " + recording.output("f.txt"));
    ASSERT_EQ(final.code, 0) << final.error;
    EXPECT_LT(final.json()["ate_rmse_m"].get<double>(), 0.02) << final.out;
    EXPECT_LT(first.json()["evaluation"]["ate_rmse_m"].get<double>(), 0.02) << first.out;
    EXPECT_EQ(first.json()["coverage"].get<double>(), 1.0);
    const Answer eval = stillmesh_says("eval --json --groundtruth " + recording.path("groundtruth.txt") +
                                       " --trajectory " + recording.output("t.txt"));
    ASSERT_EQ(eval.code, 0) << eval.error;
    EXPECT_NEAR(eval.json()["ate_rmse_m"].get<double>(), first.json()["evaluation"]["ate_rmse_m"].get<double>(), 1e-8);

    const Answer second = recording.run("--state-hashes " + recording.output("h2.txt"));
    ASSERT_EQ(second.code, 0) << second.error;
    EXPECT_EQ(test::read_text(recording.output("t.txt")), trajectory);
    EXPECT_EQ(test::read_text(recording.output("h1.txt")), test::read_text(recording.output("h2.txt")));
    EXPECT_EQ(first.json()["state_hash"], second.json()["state_hash"]);
}

// Promise: colour pictures whose three channels are one grey are tracked to the same bits as the grey ones.
TEST(EndToEnd, ColourIsGrey) {
    const Recording grey(12);
    const Recording colour(12);
    const Recording again(12, [&colour](Picture& p) {
        std::vector<std::uint8_t> rgb;
        for (const std::uint8_t value : p.grey) rgb.insert(rgb.end(), 3, value);
        test::write_bytes(colour.path("rgb/" + std::to_string(p.index) + ".png"),
                          test::encode_png(p.width, p.height, SPNG_COLOR_TYPE_TRUECOLOR, 8, rgb));
    });
    const Answer expected = grey.run();
    const Answer answer = colour.run();
    ASSERT_EQ(answer.code, 0) << answer.error;
    EXPECT_EQ(answer.json()["state_hash"], expected.json()["state_hash"]);
}

// Promise: a scene tracked as it is rendered is the scene written to disk and replayed, bit for bit; the error against
// the simulation's truth is told, and the report is written.
TEST(EndToEnd, SimulatedIsReplayed) {
    const test::TemporaryFolder folder;
    const std::string out = folder.path() + "/rec";
    ASSERT_EQ(stillmesh_says("simulate walking_xyz --seed 2 --frames 12 --out " + out).code, 0);
    const Answer replayed = stillmesh_says("run --json --replay " + out);
    const Answer simulated =
        stillmesh_says("run --json --simulate walking_xyz:2 --frames 12 --report " + folder.path() + "/report");
    ASSERT_EQ(replayed.code, 0) << replayed.error;
    ASSERT_EQ(simulated.code, 0) << simulated.error;
    EXPECT_EQ(replayed.json()["state_hash"], simulated.json()["state_hash"]);
    EXPECT_NEAR(replayed.json()["evaluation"]["ate_rmse_m"].get<double>(),
                simulated.json()["evaluation"]["ate_rmse_m"].get<double>(), 1e-8);
    EXPECT_EQ(simulated.json()["report"], folder.path() + "/report/index.html");
    const std::string html = test::read_text(folder.path() + "/report/index.html");
    EXPECT_NE(html.find("id=\"slider\""), std::string::npos);
    EXPECT_NE(html.find("{\"map\":1,\"pictures\":[{\"frame\":0,\"image\":[640,480]"), std::string::npos);
    // For people: the summary ends with the report's path.
    const Answer text = stillmesh_says("run --simulate walking_xyz:2 --frames 3 --report " + folder.path() + "/report");
    EXPECT_NE(text.out.find("ATE           0.0"), std::string::npos) << text.out;
    EXPECT_NE(text.out.find("report        " + folder.path() + "/report/index.html\n"), std::string::npos) << text.out;
}

// Promise: real recordings are tracked through the same door, within 80 MiB, with every frame's pose measured or
// nearly.
TEST(EndToEnd, RealRecordings) {
    const char* const data = std::getenv("STILLMESH_TEST_DATA");
    const char* const ci = std::getenv("CI");
    if (data == nullptr || !std::filesystem::exists(data)) {
        if (ci != nullptr && std::string(ci) == "true") FAIL() << "STILLMESH_TEST_DATA must name the recordings in CI";
        GTEST_SKIP() << "SKIPPED: no real recordings here; set STILLMESH_TEST_DATA to their folder";
    }
    for (const char* name : {"fr1_rpy_a", "fr1_rpy_a_walking"}) {
        const test::TemporaryFolder folder;
        const std::string replay = std::string(data) + "/" + name;
        const Answer answer =
            stillmesh_says("run --json --replay " + replay + " --trajectory " + folder.path() + "/t.txt");
        ASSERT_EQ(answer.code, 0) << name << ": " << answer.error;
        EXPECT_GE(answer.json()["coverage"].get<double>(), 0.98) << name;
#ifndef STILLMESH_IS_SANITIZED
        EXPECT_LE(answer.json()["peak_resident_bytes"].get<double>(), 80.0 * 1024 * 1024) << name;
#endif
        const Answer eval = stillmesh_says("eval --json --groundtruth " + replay + "/groundtruth.txt --trajectory " +
                                           folder.path() + "/t.txt");
        EXPECT_NEAR(eval.json()["ate_rmse_m"].get<double>(), answer.json()["evaluation"]["ate_rmse_m"].get<double>(),
                    1e-8);
        EXPECT_NE(answer.out.find("4 of 360 colour images have no depth image"), std::string::npos) << answer.out;
    }
}

// Promise: at most 80 MiB for 640x480, and a longer recording takes no more.
TEST(EndToEnd, MemoryStaysBounded) {
#ifdef STILLMESH_IS_SANITIZED
    GTEST_SKIP() << "SKIPPED: sanitizers take memory of their own";
#endif
    const Recording recording(20, nullptr, 640, 480, 10);
    const Answer part = recording.run("--frames 60");
    ASSERT_EQ(part.code, 0) << part.error;
    const Answer all = recording.run("--report " + recording.output("report"));
    ASSERT_EQ(all.code, 0) << all.error;
    EXPECT_EQ(all.json()["frames"], 200);
    EXPECT_LE(all.json()["peak_resident_bytes"].get<double>(), 80.0 * 1024 * 1024);
    const Answer whole = recording.run();
    ASSERT_EQ(whole.code, 0) << whole.error;
    EXPECT_LE(whole.json()["peak_resident_bytes"].get<double>(),
              part.json()["peak_resident_bytes"].get<double>() + 2.0 * 1024 * 1024);
    EXPECT_EQ(all.json()["arena_used_bytes"], all.json()["block_bytes"]);
}

struct Bad {
    const char* name;
    std::function<void(const Recording&)> spoil;
    const char* sentence;
};

// Promise: input that is wrong from the start is refused with 2 and a sentence that names it; yesterday's trajectory
// stays.
TEST(EndToEnd, RefusesBadInput) {
    const std::vector<Bad> bads = {
        {"no rgb.txt", [](const Recording& r) { std::filesystem::remove(r.path("rgb.txt")); }, "rgb.txt: No such file"},
        {"no depth.txt", [](const Recording& r) { std::filesystem::remove(r.path("depth.txt")); }, "depth.txt"},
        {"empty list", [](const Recording& r) { test::write_text(r.path("rgb.txt"), "# nothing\n"); }, "is empty"},
        {"no camera file", [](const Recording& r) { std::filesystem::remove(r.path("camera.toml")); },
         "a camera is not guessed"},
        {"no PNGs",
         [](const Recording& r) {
             for (const char* const name : {"rgb/0.png", "rgb/1.png"}) test::write_text(r.path(name), "GIF89a");
         },
         "rgb/0.png"},
        {"missing PNGs", [](const Recording& r) { std::filesystem::remove_all(r.path("depth")); }, "depth/0.png"},
        {"depth of another size", [](const Recording& r) { test::write_depth(r.path("depth/0.png"), 60, 48, 0); },
         "depth is 60x48 but colour is 320x240"},
        {"larger than the camera",
         [](const Recording& r) {
             test::write_colour(r.path("rgb/0.png"), 700, 500, false, 0);
             test::write_depth(r.path("depth/0.png"), 700, 500, 0);
         },
         "is for 320x240 pixels, the images are 700x500"},
        {"smaller than the engine takes",
         [](const Recording& r) {
             test::write_colour(r.path("rgb/0.png"), 32, 32, false, 0);
             test::write_depth(r.path("depth/0.png"), 32, 32, 0);
             test::write_text(
                 r.path("camera.toml"),
                 "width = 32\nheight = 32\nfx = 32\nfy = 32\ncx = 16\ncy = 16\ndepth_units_per_m = 5000\n");
         },
         "at least 33x33"},
        {"depth factor 0", [](const Recording& r) { r.replace("camera.toml", "= 5000", "= 0"); }, "depth_units_per_m"},
        {"NaN", [](const Recording& r) { r.replace("camera.toml", "fx = 264.000", "fx = nan"); }, "'fx'"},
        {"unknown key", [](const Recording& r) { r.replace("camera.toml", "cx =", "ccx ="); }, "did you mean 'cx'"},
        {"another size in the camera file",
         [](const Recording& r) { r.replace("camera.toml", "width = 320", "width = 640"); }, "is for 640x240 pixels"},
        {"time goes backwards",
         [](const Recording& r) {
             std::string text = test::read_text(r.path("rgb.txt"));
             test::write_text(r.path("rgb.txt"), text + "1.0 rgb/0.png\n");
         },
         "goes backwards"},
        {"time repeats",
         [](const Recording& r) {
             std::string text = test::read_text(r.path("depth.txt"));
             test::write_text(r.path("depth.txt"), text.substr(0, text.find('\n') + 1) + text);
         },
         "repeats the line before"},
        {"broken truth", [](const Recording& r) { test::write_text(r.path("groundtruth.txt"), "1 2 3\n"); },
         "groundtruth.txt"},
    };
    for (const Bad& bad : bads) {
        const Recording recording(2);
        test::write_text(recording.output("t.txt"), "poses of yesterday\n");
        bad.spoil(recording);
        const Answer answer = recording.run();
        EXPECT_EQ(answer.code, 2) << bad.name << ": " << answer.error;
        EXPECT_EQ(answer.error.find("stillmesh: "), 0U) << bad.name << ": " << answer.error;
        EXPECT_NE(answer.error.find(bad.sentence), std::string::npos) << bad.name << ": " << answer.error;
        EXPECT_EQ(test::read_text(recording.output("t.txt")), "poses of yesterday\n") << bad.name;
    }
}

// Promise: images that break in the middle are named, skipped and make the run a failure; every other frame is tracked.
TEST(EndToEnd, SkipsBrokenImages) {
    const std::vector<Bad> bads = {
        {"truncated",
         [](const Recording& r) {
             const std::string png = test::read_text(r.path("rgb/20.png"));
             test::write_text(r.path("rgb/20.png"), png.substr(0, png.size() / 2));
         },
         "rgb/20.png"},
        {"not a PNG", [](const Recording& r) { test::write_text(r.path("depth/20.png"), "no picture"); },
         "depth/20.png"},
        {"missing", [](const Recording& r) { std::filesystem::remove(r.path("depth/20.png")); }, "depth/20.png"},
        {"of another size", [](const Recording& r) { test::write_colour(r.path("rgb/20.png"), 64, 48, false, 0); },
         "rgb/20.png"},
    };
    for (const Bad& bad : bads) {
        const Recording recording(30);
        bad.spoil(recording);
        const Answer answer = recording.run();
        EXPECT_EQ(answer.code, 1) << bad.name << ": " << answer.error;
        EXPECT_NE(answer.error.find(bad.sentence), std::string::npos) << bad.name << ": " << answer.error;
        EXPECT_NE(answer.error.find("skipped"), std::string::npos) << bad.name << ": " << answer.error;
        EXPECT_EQ(poses_in(recording.output("t.txt")), 29U) << bad.name;
    }
}

// Promise: pictures that show nothing end with 1 and say what is wrong with them; no pose is invented.
TEST(EndToEnd, SaysWhyThereIsNoPose) {
    const auto fill = [](int grey, int depth) {
        return [grey, depth](Picture& p) {
            if (grey >= 0) std::fill(p.grey.begin(), p.grey.end(), static_cast<std::uint8_t>(grey));
            if (depth >= 0) std::fill(p.depth.begin(), p.depth.end(), static_cast<std::uint16_t>(depth));
        };
    };
    const struct {
        const char* name;
        std::function<void(Picture&)> edit;
        const char* sentence;
    } bads[] = {
        {"black", fill(0, -1), "the images are black"},
        {"saturated", fill(255, -1), "the images are saturated"},
        {"no depth", fill(-1, 0), "the depth images are nearly empty"},
        {"lens against a wall", fill(120, 0), "something covers the camera"},
        {"lens close to a wall", fill(120, 1500), "something covers the camera"},
        {"plain wall", fill(120, 10000), "hardly any texture"},
    };
    for (const auto& bad : bads) {
        for (const std::uint32_t frames : {10U, 40U}) {  // shorter and longer than a second
            const Recording recording(frames, bad.edit, 160, 120);
            const Answer answer = recording.run();
            EXPECT_EQ(answer.code, 1) << bad.name << ": " << answer.error;
            EXPECT_NE(answer.error.find(bad.sentence), std::string::npos) << bad.name << ": " << answer.error;
            EXPECT_EQ(poses_in(recording.output("t.txt")), 0U) << bad.name;
        }
    }
}

// Promise: after a blink of darkness tracking goes on, and the run is good; dark for more than a second is a failure
// that says when (the eight frames included until a camera found again is believed), and the poses before and after
// stay.
TEST(EndToEnd, GoesOnAfterDarkness) {
    const auto dark = [](std::uint32_t first, std::uint32_t end) {
        return [first, end](Picture& p) {
            if (p.index >= first && p.index < end) std::fill(p.grey.begin(), p.grey.end(), std::uint8_t{2});
        };
    };
    const Recording blink(50, dark(20, 26));
    const Answer good = blink.run();
    EXPECT_EQ(good.code, 0) << good.error;
    EXPECT_GE(poses_in(blink.output("t.txt")), 42U);
    EXPECT_LT(good.json()["evaluation"]["ate_rmse_m"].get<double>(), 0.03);

    const Recording night(90, dark(20, 60));
    const Answer lost = night.run();
    EXPECT_EQ(lost.code, 1);
    EXPECT_NE(lost.error.find("no pose for 1.6 s"), std::string::npos) << lost.error;
    EXPECT_NE(lost.error.find("from second 0.6 on: the images are black"), std::string::npos) << lost.error;
    EXPECT_GE(poses_in(night.output("t.txt")), 40U);
    EXPECT_LT(lost.json()["evaluation"]["ate_rmse_m"].get<double>(), 0.03);
}

// Promise: a depth unit that cannot be is named with the one that fits, fails check-camera and a run that checks, in
// which nothing is tracked from then on, and what is written as found passes; a right recording passes both, and what
// passes is tracked to the same bits.
TEST(EndToEnd, ChecksTheCamera) {
    const Recording recording(20, nullptr, 640, 480);
    const std::string check = "check-camera --replay " + recording.path();
    const Answer right = stillmesh_says(check);
    EXPECT_EQ(right.code, 0) << right.error;
    EXPECT_NE(right.out.find("no fault found"), std::string::npos) << right.out;
    const Answer plain = recording.run("--no-check-camera");
    const Answer checked = recording.run();
    EXPECT_EQ(checked.code, 0) << checked.error;
    EXPECT_EQ(checked.json()["share_tracked"].get<double>(), plain.json()["share_tracked"].get<double>());
    EXPECT_EQ(checked.json()["state_hash"], plain.json()["state_hash"]);

    recording.replace("camera.toml", "= 5000", "= 2500");
    const Answer wrong = stillmesh_says(check);
    EXPECT_EQ(wrong.code, 1);
    EXPECT_NE(wrong.error.find("2500"), std::string::npos) << wrong.error;
    EXPECT_NE((wrong.out + wrong.error).find("depth unit"), std::string::npos) << wrong.out << wrong.error;
    const Answer found = stillmesh_says(check + " --out " + recording.output("found.toml"));
    EXPECT_NE(found.out.find("found.toml"), std::string::npos) << found.out;
    const Answer again = stillmesh_says(check + " --calibration " + recording.output("found.toml"));
    EXPECT_EQ(again.code, 0) << again.error;
    const Answer run = recording.run();
    EXPECT_EQ(run.code, 1);
    EXPECT_LE(run.json()["share_tracked"].get<double>(), 0.1) << "but for the frames before the first check";
}

// Promise: a camera lost in a place that the map does not hold is told apart from one around which nothing stands
// still, and from one in a map of another place; --new-map-when-lost tracks on in a map of its own, and keeps the one
// before.
TEST(EndToEnd, SaysThatAPlaceIsNotInTheMap) {
    constexpr std::uint32_t kFrames = 90, kAway = 30;
    SimulatedCamera corridor({.scene = "corridor", .seed = 3, .frames = kFrames, .width = 320, .height = 240});
    ASSERT_EQ(corridor.open(), Status::kOk) << corridor.message();
    const auto elsewhere = [&corridor](Picture& p) {
        Frame frame;
        if (p.index < kAway || corridor.poll(frame) != Status::kOk) return;
        std::copy_n(frame.colour.data, p.grey.size(), p.grey.begin());
        std::copy_n(frame.depth.data, p.depth.size(), p.depth.begin());
    };
    std::uint32_t dice = 1;
    const auto chaos = [&dice](Picture& p) {  // corners everywhere, in every frame others
        if (p.index < kAway) return;
        for (std::size_t y = 0; y < 240; y += 5) {
            for (std::size_t x = 0; x < 320; x += 5) {
                const auto grey = static_cast<std::uint8_t>((dice = dice * 1664525 + 1013904223) >> 24U);
                for (std::size_t i = 0; i < 25; ++i) p.grey[(y + i / 5) * 320 + x + i % 5] = grey;
            }
        }
    };
    const Recording walled(kFrames, chaos);
    const Answer nothing_stands = walled.run();
    EXPECT_EQ(nothing_stands.code, 1);
    EXPECT_NE(nothing_stands.error.find("too few features stood still"), std::string::npos) << nothing_stands.error;

    const Recording recording(kFrames, elsewhere);
    const std::string map = recording.output("m.map");
    const Answer lost = recording.run("--frames 30 --map-out " + map);
    ASSERT_EQ(lost.code, 0) << lost.error;
    const Answer away = recording.run();
    EXPECT_EQ(away.code, 1);
    EXPECT_NE(away.error.find("enough stands still here, but this place is not in the map"), std::string::npos)
        << away.error;

    const Answer anew = recording.run("--new-map-when-lost 0.7 --map-out " + map);
    EXPECT_EQ(anew.code, 0) << anew.error;
    EXPECT_GE(poses_in(recording.output("t.txt")), 65U);
    EXPECT_NE(test::read_text(recording.output("t.txt")).find("\n# map 2: second 1."), std::string::npos);
    ASSERT_EQ(anew.json()["new_maps"].size(), 1U) << anew.out;
    ASSERT_EQ(anew.json()["maps"].size(), 2U) << anew.out;
    EXPECT_EQ(anew.json()["maps"][0]["file"], map);
    EXPECT_EQ(anew.json()["maps"][1]["file"], map + ".1");

    const std::string rgb = test::read_text(recording.path("rgb.txt"));
    test::write_text(recording.path("rgb.txt"), rgb.substr(rgb.rfind('\n', rgb.find("rgb/30.png")) + 1));
    const Answer other = recording.run("--map-in " + map);
    EXPECT_EQ(other.code, 1);
    EXPECT_NE(other.error.find("nothing of it is in the map that was read"), std::string::npos) << other.error;
    for (const char* const option : {"--record x.rec", "--map-store x.store", "--map-in m --localize"}) {
        EXPECT_EQ(recording.run(std::string("--new-map-when-lost 1 ") + option).code, 2) << option;
    }
}

// Promise: a stream that is stuck gives no pose, is named, and tracking is found again behind it; a recording without
// noise may stand still.
TEST(EndToEnd, StreamsThatAreStuck) {
    std::vector<Picture> seen;
    const auto stuck = [&seen](bool is_colour, bool is_depth) {
        return [&seen, is_colour, is_depth](Picture& p) {
            seen.resize(std::max<std::size_t>(seen.size(), p.index + 1));
            seen[p.index] = p;
            if (p.index <= 20 || p.index >= 60) return;
            if (is_colour) p.grey = seen[20].grey;
            if (is_depth) p.depth = seen[20].depth;
        };
    };
    for (const auto& [is_colour, is_depth, name] :
         {std::tuple{true, false, "the colour images repeat"}, std::tuple{false, true, "the depth images repeat"},
          std::tuple{true, true, "the images repeat"}}) {
        const Recording recording(80, stuck(is_colour, is_depth), 160, 120);
        const Answer answer = recording.run();
        EXPECT_EQ(answer.code, 1);
        EXPECT_NE(answer.error.find(name), std::string::npos) << answer.error;
        EXPECT_EQ(answer.json()["streams"]["times_stuck"], 1) << answer.out;
        EXPECT_GE(poses_in(recording.output("t.txt")), 21U + 8U) << "found again behind it";
        EXPECT_LE(poses_in(recording.output("t.txt")), 80U - 38U);
    }
    const Recording still(
        60,
        [&seen](Picture& p) {
            p.grey = seen[0].grey;
            p.depth = seen[0].depth;
        },
        160, 120);
    const Answer answer = still.run();
    EXPECT_EQ(answer.code, 0) << answer.error;
    EXPECT_EQ(answer.json()["share_none"], 0.0) << answer.out;
}

// Promise: a gap of seconds is a failure that says when; a short one is a note. What comes after it is tracked.
TEST(EndToEnd, SaysWhereFramesAreMissing) {
    const auto gap = [](double seconds) { return [seconds](Picture& p) { p.time_s += p.index >= 20 ? seconds : 0; }; };
    const Recording wide(40, gap(3));
    const Answer failed = wide.run();
    EXPECT_EQ(failed.code, 1);
    EXPECT_NE(failed.error.find("no frames for 3.0 s from second 0.6 on"), std::string::npos) << failed.error;
    EXPECT_EQ(poses_in(wide.output("t.txt")), 40U);

    const Recording narrow(40, gap(0.5));
    const Answer good = narrow.run();
    EXPECT_EQ(good.code, 0) << good.error;
    EXPECT_NE(good.out.find("no frames for 0.53 s from second 0.6 on"), std::string::npos) << good.out;
    EXPECT_EQ(poses_in(narrow.output("t.txt")), 40U);
}

// Promise: Ctrl-C and SIGTERM finish the frame at hand, write everything, summary and report too, and end with 128 +
// the signal; after kill -9 every pose given out before is in the file.
TEST(EndToEnd, StopsInOrder) {
    const Recording recording(10, nullptr, 320, 240, 2000);
    for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
        const std::string trajectory = recording.output("t" + std::to_string(signal) + ".txt");
        const std::string report = recording.output("report" + std::to_string(signal));
        const std::string replay = recording.path();
        const pid_t child = ::fork();
        if (child == 0) {
            if (std::freopen("/dev/null", "w", stdout) == nullptr) ::_exit(98);
            if (std::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(98);
            ::execl(STILLMESH_PROGRAM, "stillmesh", "run", "--replay", replay.c_str(), "--trajectory",
                    trajectory.c_str(), "--report", report.c_str(), static_cast<char*>(nullptr));
            ::_exit(99);
        }
        ASSERT_GT(child, 0);
        std::size_t lines = 0;
        for (int i = 0; i < 2000 && lines < 12; ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            const std::string text = test::read_text(trajectory);
            lines = static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
        }
        ASSERT_GE(lines, 12U);
        ASSERT_EQ(::kill(child, signal), 0);
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        if (signal == SIGKILL) {
            EXPECT_TRUE(WIFSIGNALED(status));
        } else {
            ASSERT_TRUE(WIFEXITED(status));
            EXPECT_EQ(WEXITSTATUS(status), 128 + signal);
            EXPECT_TRUE(std::filesystem::exists(report + "/index.html"));
        }
        EXPECT_GE(poses_in(trajectory), lines - 1);
        EXPECT_EQ(test::read_text(trajectory).back(), '\n');
    }
}

// Promise: parameters come from a file and from --set, switching the region off among them; what is wrong is refused
// with its key.
TEST(EndToEnd, TakesParameters) {
    const Recording recording(6);
    const auto hash = [&](const std::string& more) {
        const Answer answer = recording.run(more);
        EXPECT_EQ(answer.code, 0) << more << ": " << answer.error;
        return answer.json()["state_hash"].get<std::string>();
    };
    const std::string usual = hash("");
    EXPECT_EQ(hash("--set region.is_enabled=true"), usual);
    const std::string off = hash("--set region.is_enabled=false");
    EXPECT_NE(off, usual);
    test::write_text(recording.output("off.toml"), "region.is_enabled = false\n");
    EXPECT_EQ(hash("--config " + recording.output("off.toml")), off);
    const std::string paper = hash("--method paper");
    EXPECT_NE(paper, usual);
    EXPECT_NE(paper, off);
    EXPECT_EQ(hash("--set region.method=1"), paper);
    EXPECT_EQ(hash("--method ours"), usual);
    // What --print-config prints is what is used, and reads back.
    const Answer printed = stillmesh_says("run --print-config --set region.is_enabled=false");
    ASSERT_EQ(printed.code, 0);
    test::write_text(recording.output("all.toml"), printed.out);
    EXPECT_EQ(hash("--config " + recording.output("all.toml")), off);

    const struct {
        const char* arguments;
        const char* sentence;
    } bads[] = {
        {"--set region.enabled=true", "did you mean 'region.is_enabled'"},
        {"--set pose.inliers_min=2", "4 to 1000"},
        {"--set pose.inliers_min", "key=value"},
        {"--set features.count=2000",
         "'features.count' = 2000 is more than limits.features_max; allowed beside the others: 50 to 1000"},
        {"--set depth.z_min_m=4 --set depth.z_max_m=2", "'depth.z_min_m' = 4 is not below depth.z_max_m"},
        {"--config /none.toml", "/none.toml: cannot be opened"},
        {"--config .", "cannot be read"},
    };
    for (const auto& bad : bads) {
        const Answer answer = recording.run(bad.arguments);
        EXPECT_EQ(answer.code, 2) << bad.arguments;
        EXPECT_NE(answer.error.find(bad.sentence), std::string::npos) << bad.arguments << ": " << answer.error;
    }
}

// Promise: pocket limits take fewer features and say so; asking for more by name is refused.
TEST(EndToEnd, PocketLimits) {
    const Recording recording(10);
    const Answer answer = recording.run("--limits pocket");
    EXPECT_EQ(answer.code, 0) << answer.error;
    EXPECT_LE(answer.json()["block_bytes"].get<double>(), 8.0 * 1024 * 1024);
    EXPECT_NE(answer.out.find("features.count is 500 instead of 1000"), std::string::npos) << answer.out;
    EXPECT_EQ(recording.run("--limits pocket --set features.count=300").json()["notes"].size(), 0U);
    EXPECT_EQ(recording.run("--limits pocket --set features.count=1000").code, 2);
}

// Promise: cv::ORB tracks too where it is built in, and is refused with a sentence where it is not.
TEST(EndToEnd, FeaturesOfOpenCv) {
    const Recording recording(20);
    const Answer answer = recording.run("--features opencv");
#ifdef STILLMESH_HAS_OPENCV
    ASSERT_EQ(answer.code, 0) << answer.error;
    EXPECT_NE(answer.json()["state_hash"], recording.run().json()["state_hash"]);
    EXPECT_LT(answer.json()["evaluation"]["ate_rmse_m"].get<double>(), 0.03);
#else
    EXPECT_EQ(answer.code, 2);
    EXPECT_NE(answer.error.find("not in this build"), std::string::npos) << answer.error;
#endif
}

// Promise: a scene or seed that is not there is refused, and the scenes there are get listed.
TEST(EndToEnd, SimulatedScenesByName) {
    const struct {
        const char* arguments;
        const char* sentence;
    } bads[] = {
        {"--simulate walking", "walking_xyz"},
        {"--simulate walking_xyz:", "the seed is a whole number"},
        {"--simulate walking_xyz:1x", "the seed is a whole number"},
        {"--simulate walking_xyz:-1", "the seed is a whole number"},
        {"--simulate walking_xyz:1+", "the seed is a whole number"},
        {"--simulate walking_xyz:1+0", "the seed is a whole number"},
        {"--simulate walking_xyz --calibration tum-fr1", "brings its own"},
        {"--simulate walking_xyz --replay x", "give one camera"},
    };
    for (const auto& bad : bads) {
        const Answer answer = stillmesh_says(std::string("run ") + bad.arguments);
        EXPECT_EQ(answer.code, 2) << bad.arguments;
        EXPECT_NE(answer.error.find(bad.sentence), std::string::npos) << bad.arguments << ": " << answer.error;
    }
    EXPECT_EQ(stillmesh_says("simulate walking_xyz:1x --out never").code, 2);
}

// Promise: `simulate` takes a scene as `run` does, SCENE:SEED+DAY, and that says the same as --seed and --day.
TEST(EndToEnd, SimulatesASceneByItsWholeName) {
    const test::TemporaryFolder folder;
    const std::string whole = folder.path() + "/whole";
    const std::string parts = folder.path() + "/parts";
    const std::string rest = " --frames 1 --width 64 --out ";
    ASSERT_EQ(stillmesh_says("simulate static_xyz:2+7" + rest + whole).code, 0);
    ASSERT_EQ(stillmesh_says("simulate static_xyz --seed 2 --day 7" + rest + parts).code, 0);
    for (const char* const file : {"groundtruth.txt", "rgb.txt"})
        EXPECT_EQ(test::read_text(whole + "/" + file), test::read_text(parts + "/" + file)) << file;
}

}  // namespace
}  // namespace stillmesh::end_to_end_test
