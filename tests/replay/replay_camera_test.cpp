#include "hal/replay/replay_camera.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <functional>

#include "engine/base/random.hpp"
#include "hal/replay/png_reader.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::replay_camera_test {
namespace {

using test::kCameraToml;
using test::TemporaryFolder;
using test::write_depth;
using test::write_recording;
using test::write_text;

// Promise: times and every pixel arrive as they were written, grey and colour, also when a recording is played twice.
TEST(ReplayCamera, PlaysWhatWasRecorded) {
    for (const bool is_rgb : {false, true}) {
        TemporaryFolder folder;
        write_recording(folder.path(), is_rgb);
        ReplayCamera camera({.folder = folder.path(), .calibration = ""});
        for (int round = 0; round < 2; ++round) {
            ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
            EXPECT_EQ(camera.counts().frames, 3U);
            EXPECT_EQ(camera.info().model.fx, 52.5);
            for (std::uint32_t i = 0; i < 3; ++i) {
                Frame frame;
                EXPECT_EQ(camera.wait(0), Status::kOk);
                ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
                EXPECT_EQ(frame.time_ns, 100100000000 + 33000000 * i);
                EXPECT_EQ(frame.depth_time_ns, frame.time_ns + 2000000);
                EXPECT_EQ(frame.depth_units_per_m, 5000.0);
                ASSERT_EQ(frame.format, is_rgb ? PixelFormat::kRgb8 : PixelFormat::kGrey8);
                ASSERT_EQ(frame.colour.width, 64U);
                ASSERT_EQ(frame.depth.height, 48U);
                for (std::uint32_t y = 0; y < 48; ++y) {
                    for (std::uint32_t x = 0; x < frame.colour.stride; ++x) {
                        ASSERT_EQ(frame.colour.at(x, y), test::colour_byte(i, y * frame.colour.stride + x));
                    }
                    for (std::uint32_t x = 0; x < 64; ++x) {
                        ASSERT_EQ(frame.depth.at(x, y), test::depth_value(i, y * 64 + x));
                    }
                }
            }
            Frame frame;
            EXPECT_EQ(camera.wait(0), Status::kEnd);
            EXPECT_EQ(camera.poll(frame), Status::kEnd);
        }
    }
}

// Promise: depth of a camera of its own, named in the camera file, comes out registered, as DepthRegistration makes it
// of the images in the folder, and info() speaks of no second camera; of another size than that camera's it is refused
// with both sizes, and without that camera the sentence says that it could be given.
TEST(ReplayCamera, RegistersDepthOfASecondCamera) {
    const std::string second =
        "[depth]\nwidth = 52\nheight = 40\nfx = 30\nfy = 30\ncx = 25.5\ncy = 19.5\ntx = 0.02\nty = 0\ntz = 0\n";
    TemporaryFolder folder;
    write_recording(folder.path());
    for (std::uint32_t i = 0; i < 3; ++i)
        write_depth(folder.path() + "/depth/" + std::to_string(i) + ".png", 52, 40, i);
    ReplayCamera camera({.folder = folder.path(), .calibration = ""});
    EXPECT_EQ(camera.open(), Status::kInvalid);
    EXPECT_NE(camera.message().find("52x40 but colour is 64x48"), std::string::npos) << camera.message();
    EXPECT_NE(camera.message().find("give the depth camera in camera.toml"), std::string::npos) << camera.message();

    write_text(folder.path() + "/camera.toml", kCameraToml + second);
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_TRUE(camera.counts().is_registered_here);
    EXPECT_FALSE(camera.info().separate_depth);
    CameraModel depth;
    depth.width = 52, depth.height = 40, depth.fx = depth.fy = 30, depth.cx = 25.5, depth.cy = 19.5;
    RigidTransform pose;
    pose.translation_m[0] = 0.02;
    DepthRegistration registration(depth, camera.info().model, pose, 5000);
    std::vector<std::uint16_t> source(52 * 40), expected(64 * 48);
    for (std::uint32_t i = 0; i < 3; ++i) {
        Frame frame;
        ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
        for (std::size_t at = 0; at < source.size(); ++at) source[at] = test::depth_value(i, at);
        registration.reproject({source.data(), 52, 40, 52}, expected.data());
        ASSERT_EQ(frame.depth.width, 64U);
        ASSERT_TRUE(std::equal(expected.begin(), expected.end(), frame.depth.data));
    }

    write_text(folder.path() + "/camera.toml", kCameraToml + second.substr(0, 8) + "width = 53" + second.substr(18));
    EXPECT_EQ(camera.open(), Status::kInvalid);
    EXPECT_NE(camera.message().find("has 53x40"), std::string::npos) << camera.message();
}

// Promise: colour without depth within 20 ms is skipped and counted; gaps are counted with their place.
TEST(ReplayCamera, SkipsAndCounts) {
    TemporaryFolder folder;
    write_recording(folder.path());
    write_text(folder.path() + "/depth.txt", "100.102 depth/0.png\n100.154 depth/1.png\n103.166 depth/2.png\n");
    write_text(folder.path() + "/rgb.txt", "100.100 rgb/0.png\n100.133 rgb/1.png\n103.166 rgb/2.png\n");
    ReplayCamera camera({.folder = folder.path(), .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_EQ(camera.counts().colour_images, 3U);
    EXPECT_EQ(camera.counts().frames, 2U);
    EXPECT_EQ(camera.counts().gaps, 1U);
    EXPECT_EQ(camera.counts().gap_longest_ns, 3066000000);
    EXPECT_EQ(camera.counts().gap_longest_after_ns, 100100000000);
}

struct Fault {
    const char* name;
    std::function<void(const std::string&)> inflict;
    Status status;
    const char* sentence;
    const char* calibration = "";
};

// The recording's only one.
void keep_first_image(const std::string& folder) {
    write_text(folder + "/rgb.txt", "100.100 rgb/0.png\n");
}

class ReplayFaults : public testing::TestWithParam<Fault> {};

// Promise: every way a recording can be broken at the door is its own status and a sentence with file and remedy.
TEST_P(ReplayFaults, AreRefusedWithASentence) {
    TemporaryFolder folder;
    write_recording(folder.path());
    GetParam().inflict(folder.path());
    ReplayCamera camera({.folder = folder.path(), .calibration = GetParam().calibration});
    EXPECT_EQ(camera.open(), GetParam().status) << camera.message();
    EXPECT_NE(camera.message().find(GetParam().sentence), std::string::npos) << camera.message();
    EXPECT_TRUE(camera.message().ends_with('.') || camera.message().ends_with('?')) << camera.message();
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
}

INSTANTIATE_TEST_SUITE_P(
    All, ReplayFaults,
    testing::Values(
        Fault{"no_folder", [](const std::string& f) { std::filesystem::remove_all(f); }, Status::kUnavailable,
              "no such folder"},
        Fault{"a_file",
              [](const std::string& f) {
                  std::filesystem::remove_all(f);
                  write_text(f, "x");
              },
              Status::kUnavailable, "is not a folder"},
        Fault{"empty_folder",
              [](const std::string& f) {
                  std::filesystem::remove_all(f);
                  std::filesystem::create_directory(f);
              },
              Status::kUnavailable, "/rgb.txt: No such file"},
        Fault{"no_depth_list", [](const std::string& f) { std::filesystem::remove(f + "/depth.txt"); },
              Status::kUnavailable, "/depth.txt: No such file"},
        Fault{"list_is_folder",
              [](const std::string& f) {
                  std::filesystem::remove(f + "/rgb.txt");
                  std::filesystem::create_directory(f + "/rgb.txt");
              },
              Status::kUnavailable, "/rgb.txt: not a file"},
        Fault{"list_is_a_pipe",
              [](const std::string& f) {
                  std::filesystem::remove(f + "/depth.txt");
                  ASSERT_EQ(::mkfifo((f + "/depth.txt").c_str(), 0600), 0);
              },
              Status::kUnavailable, "/depth.txt: not a file"},
        Fault{"list_of_gigabytes",
              [](const std::string& f) { std::filesystem::resize_file(f + "/rgb.txt", std::uintmax_t{3} << 30U); },
              Status::kInvalid, "/rgb.txt: is larger than a list of images can be (256 MiB)"},
        Fault{"calibration_is_a_pipe",
              [](const std::string& f) {
                  std::filesystem::remove(f + "/camera.toml");
                  ASSERT_EQ(::mkfifo((f + "/camera.toml").c_str(), 0600), 0);
              },
              Status::kUnavailable, "/camera.toml: cannot be read: it is no regular file"},
        Fault{"empty_list", [](const std::string& f) { write_text(f + "/rgb.txt", "# nothing\n"); }, Status::kInvalid,
              "/rgb.txt: the list is empty"},
        Fault{"time_repeats",
              [](const std::string& f) { write_text(f + "/rgb.txt", "100.1 rgb/0.png\n100.1 rgb/1.png\n"); },
              Status::kInvalid, "rgb.txt, line 2: time 100.1 repeats"},
        Fault{"time_backwards",
              [](const std::string& f) { write_text(f + "/depth.txt", "100.1 depth/0.png\n100.0 depth/1.png\n"); },
              Status::kInvalid, "depth.txt, line 2: time 100.0 goes backwards"},
        Fault{"two_clocks", [](const std::string& f) { write_text(f + "/depth.txt", "5.0 depth/0.png\n"); },
              Status::kInvalid,
              "two clocks, 95.100 s apart throughout? If images of one moment are, give --depth-offset=-95.100."},
        Fault{"depth_late",
              [](const std::string& f) {
                  write_text(f + "/depth.txt", "100.140 depth/0.png\n100.173 depth/1.png\n100.206 depth/2.png\n");
                  write_text(f + "/rgb.txt", "100.100 rgb/0.png\n");
              },
              Status::kInvalid, "depth is 40.0 ms away: --pair-gap 0.041"},
        Fault{"frame_numbers",
              [](const std::string& f) { write_text(f + "/rgb.txt", "0 rgb/0.png\n1 rgb/1.png\n2 rgb/2.png\n"); },
              Status::kInvalid, "/rgb.txt: times go up by 1: frame numbers?"},
        Fault{"empty_associations",
              [](const std::string& f) {
                  std::filesystem::remove(f + "/rgb.txt");
                  write_text(f + "/associations.txt", "# nothing\n");
              },
              Status::kInvalid, "/associations.txt: the list is empty"},
        Fault{"no_calibration", [](const std::string& f) { std::filesystem::remove(f + "/camera.toml"); },
              Status::kInvalid, "a camera is not guessed; name one with --calibration"},
        Fault{"depth_factor_0",
              [](const std::string& f) {
                  std::filesystem::remove(f + "/camera.toml");
                  write_text(f + "/camera.yaml",
                             "Camera.fx: 52\nCamera.fy: 52\nCamera.cx: 31\nCamera.cy: 23\nDepthMapFactor: 0\n");
              },
              Status::kInvalid, "key 'DepthMapFactor' is 0"},
        Fault{"calibration_of_another_size", [](const std::string&) {}, Status::kInvalid,
              "tum-fr1: is for 640x480 pixels, the images are 64x48", "tum-fr1"},
        Fault{"images_missing", [](const std::string& f) { std::filesystem::remove_all(f + "/rgb"); },
              Status::kUnavailable, "/rgb/0.png: cannot be opened"},
        Fault{"image_is_a_pipe",
              [](const std::string& f) {
                  keep_first_image(f);
                  std::filesystem::remove(f + "/depth/0.png");
                  ASSERT_EQ(::mkfifo((f + "/depth/0.png").c_str(), 0600), 0);
              },
              Status::kUnavailable, "/depth/0.png: is no regular file"},
        Fault{"image_is_text",
              [](const std::string& f) {
                  keep_first_image(f);
                  write_text(f + "/rgb/0.png", "a letter, not a PNG at all, and long enough to have had a header");
              },
              Status::kCorrupt, "/rgb/0.png: cannot be read as PNG"},
        Fault{"image_is_empty",
              [](const std::string& f) {
                  keep_first_image(f);
                  write_text(f + "/depth/0.png", "");
              },
              Status::kCorrupt, "/depth/0.png: the PNG is truncated"},
        Fault{"depth_of_another_size", [](const std::string& f) { test::write_depth(f + "/depth/0.png", 48, 36, 0); },
              Status::kInvalid, "depth is 48x36 but colour is 64x48"},
        Fault{"beyond_the_limits",
              [](const std::string& f) {
                  test::write_colour(f + "/rgb/0.png", 641, 480, false, 0);
                  test::write_depth(f + "/depth/0.png", 641, 480, 0);
              },
              Status::kInvalid, "the images are 641x480, at most 640x480 are taken"},
        Fault{"lists_swapped",
              [](const std::string& f) {
                  std::filesystem::rename(f + "/rgb.txt", f + "/x");
                  std::filesystem::rename(f + "/depth.txt", f + "/rgb.txt");
                  std::filesystem::rename(f + "/x", f + "/depth.txt");
              },
              Status::kInvalid, "are rgb.txt and depth.txt swapped?"},
        Fault{"depth_8_bit", [](const std::string& f) { test::write_colour(f + "/depth/0.png", 64, 48, false, 0); },
              Status::kInvalid, "depth must be 16-bit grey, this is 8-bit grey"},
        Fault{"colour_is_tiff",
              [](const std::string& f) { write_text(f + "/rgb/0.png", "II*, and what else there is in a TIFF"); },
              Status::kInvalid, "/rgb/0.png: is TIFF, which is not read; convert: mogrify"}),
    [](const testing::TestParamInfo<Fault>& fault) { return fault.param.name; });

// Promise: a first image that is missing or broken is skipped like any other; the others are played.
TEST(ReplayCamera, TheFirstImageIsNoDoor) {
    for (const char* const name : {"/rgb/0.png", "/depth/0.png"}) {
        for (const bool is_there : {false, true}) {
            TemporaryFolder folder;
            write_recording(folder.path());
            std::filesystem::remove(folder.path() + name);
            if (is_there) write_text(folder.path() + name, "no picture at all, but long enough to have a header");
            ReplayCamera camera({.folder = folder.path(), .calibration = ""});
            ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
            Frame frame;
            EXPECT_EQ(camera.poll(frame), is_there ? Status::kCorrupt : Status::kUnavailable);
            EXPECT_NE(camera.message().find(name), std::string::npos) << camera.message();
            EXPECT_EQ(camera.poll(frame), Status::kOk) << camera.message();
            EXPECT_EQ(camera.poll(frame), Status::kOk) << camera.message();
            EXPECT_EQ(camera.poll(frame), Status::kEnd);
        }
    }
}

// Promise: a folder with one list of both plays like one with two, and options take what two clocks differ by and what
// lies between the images of a frame.
TEST(ReplayCamera, OtherListsPlayTheSame) {
    const struct {
        const char *name, *rgb, *depth, *associations;
        std::int64_t gap_ns = 20'000'000, offset_ns = 0, lag_ns = 2'000'000;
    } cases[] = {
        {"associations", nullptr, nullptr,
         "100.1 rgb/0.png 100.102 depth/0.png\n100.133 rgb/1.png 100.135 depth/1.png\n100.166 rgb/2.png 100.168 "
         "depth/2.png\n"},
        {"clocks apart", "100.1 rgb/0.png\n100.133 rgb/1.png\n100.166 rgb/2.png\n",
         "5.102 depth/0.png\n5.135 depth/1.png\n5.168 depth/2.png\n", nullptr, 20'000'000, -95'000'000'000},
        {"late", "100.1 rgb/0.png\n100.2 rgb/1.png\n100.3 rgb/2.png\n",
         "100.125 depth/0.png\n100.225 depth/1.png\n100.325 depth/2.png\n", nullptr, 25'000'000, 0, 25'000'000},
    };
    for (const auto& c : cases) {
        TemporaryFolder folder;
        write_recording(folder.path());
        for (const auto& [name, text] : {std::pair{"/rgb.txt", c.rgb}, std::pair{"/depth.txt", c.depth},
                                         std::pair{"/associations.txt", c.associations}}) {
            std::filesystem::remove(folder.path() + name);
            if (text != nullptr) write_text(folder.path() + name, text);
        }
        ReplayCamera camera({.folder = folder.path(),
                             .calibration = "",
                             .association_gap_max_ns = c.gap_ns,
                             .depth_offset_ns = c.offset_ns});
        ASSERT_EQ(camera.open(), Status::kOk) << c.name << ": " << camera.message();
        Frame frame;
        ASSERT_EQ(camera.poll(frame), Status::kOk) << c.name << ": " << camera.message();
        EXPECT_EQ(frame.depth_time_ns - frame.time_ns, c.lag_ns) << c.name;
        EXPECT_EQ(frame.colour.at(3, 3), test::colour_byte(0, 3 * 64 + 3)) << c.name;
        EXPECT_EQ(frame.depth.at(3, 3), test::depth_value(0, 3 * 64 + 3)) << c.name;
    }
}

// Promise: a folder without lists plays when there is one text file that names both images in a line, whatever it is
// called, or two folders of images whose names are times or numbers: those that are times as they are, numbers with a
// rate. Names with backslashes are those of folders.
TEST(ReplayCamera, PlaysWithoutLists) {
    const struct {
        const char *name, *colour, *depth, *list;
        double fps = 0;
        std::int64_t period_ns = 33'000'000;
    } cases[] = {
        {"a list by another name", "rgb/%d.png", "depth/%d.png",
         "100.1 rgb/0.png depth/0.png\n100.133 rgb/1.png depth/1.png\n100.166 rgb/2.png depth/2.png\n"},
        {"of Windows", "rgb/%d.png", "depth/%d.png",
         "100.1 rgb\\0.png 100.1 depth\\0.png\r\n100.133 rgb\\1.png 100.133 depth\\1.png\r\n100.166 rgb\\2.png 100.166 "
         "depth\\2.png\r\n"},
        {"times", "rgb/100.1%d3.png", "depth/100.1%d2.png", nullptr, 0, 10'000'000},
        {"numbers", "color/frame-00%d.color.png", "depth/frame-00%d.depth.png", nullptr, 20, 50'000'000},
        {"in one folder", "frame-00%d.color.png", "frame-00%d.depth.png", nullptr, 20, 50'000'000},
        {"in one folder, by begins", "results/frame00%d.png", "results/depth00%d.png", nullptr, 20, 50'000'000},
        {"counted without zeros", "image/9%d.png", "depth/9%d.png", nullptr, 10, 100'000'000},
    };
    const auto name_of = [](const char* form, int i) {
        std::string name(form);
        return name.replace(name.find("%d"), 2, std::to_string(i));
    };
    for (const auto& c : cases) {
        SCOPED_TRACE(c.name);
        TemporaryFolder folder;
        write_recording(folder.path());
        std::filesystem::rename(folder.path() + "/rgb", folder.path() + "/images_a");
        std::filesystem::rename(folder.path() + "/depth", folder.path() + "/images_b");
        for (const char* const list : {"/rgb.txt", "/depth.txt"}) std::filesystem::remove(folder.path() + list);
        for (int i = 0; i < 3; ++i) {
            const std::string file = "/" + std::to_string(i) + ".png";
            write_text(folder.path() + "/" + name_of(c.colour, i), test::read_text(folder.path() + "/images_a" + file));
            write_text(folder.path() + "/" + name_of(c.depth, i), test::read_text(folder.path() + "/images_b" + file));
        }
        if (c.list != nullptr) write_text(folder.path() + "/fr1_desk.txt", c.list);
        write_text(folder.path() + "/groundtruth.txt", "100.1 0 0 0 0 0 0 1\n");
        write_text(folder.path() + "/rgb_notes.md", "no list");
        ReplayCamera camera({.folder = folder.path(), .calibration = "", .frames_per_s = c.fps});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        std::int64_t before_ns = 0;
        for (std::uint32_t i = 0; i < 3; ++i) {
            Frame frame;
            ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
            EXPECT_EQ(frame.colour.at(3, 3), test::colour_byte(i, 3 * 64 + 3));
            EXPECT_EQ(frame.depth.at(3, 3), test::depth_value(i, 3 * 64 + 3));
            EXPECT_EQ(i == 0 ? c.period_ns : frame.time_ns - before_ns, c.period_ns);
            before_ns = frame.time_ns;
        }
        if (c.fps == 0) continue;
        ReplayCamera without({.folder = folder.path(), .calibration = ""});
        EXPECT_EQ(without.open(), Status::kInvalid);
        EXPECT_NE(without.message().find(": times go up by 1: frame numbers?"), std::string::npos) << without.message();
    }
}

// Promise: a broken image in the middle says so, leaves the caller's frame alone, and the rest can still be played.
TEST(ReplayCamera, GoesOnAfterABrokenImage) {
    TemporaryFolder folder;
    write_recording(folder.path());
    const std::string whole = test::read_text(folder.path() + "/depth/1.png");
    write_text(folder.path() + "/depth/1.png", whole.substr(0, whole.size() / 2));
    ReplayCamera camera({.folder = folder.path(), .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    const std::int64_t time_ns = frame.time_ns;
    EXPECT_EQ(camera.poll(frame), Status::kCorrupt);
    EXPECT_NE(camera.message().find("/depth/1.png: the PNG is truncated"), std::string::npos) << camera.message();
    EXPECT_EQ(frame.time_ns, time_ns);
    EXPECT_EQ(camera.poll(frame), Status::kOk) << camera.message();
    EXPECT_EQ(camera.poll(frame), Status::kEnd);
}

// Promise: an image of another size or kind in the middle is refused before anything is written behind a buffer.
TEST(ReplayCamera, RefusesAChangeOfSize) {
    TemporaryFolder folder;
    write_recording(folder.path());
    test::write_colour(folder.path() + "/rgb/1.png", 320, 240, false, 1);
    test::write_colour(folder.path() + "/rgb/2.png", 64, 48, true, 2);
    ReplayCamera camera({.folder = folder.path(), .calibration = ""});
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    EXPECT_EQ(camera.poll(frame), Status::kCorrupt);
    EXPECT_NE(camera.message().find("the image is 320x240 pixels, expected 64x48"), std::string::npos);
    EXPECT_EQ(camera.poll(frame), Status::kCorrupt);
    EXPECT_NE(camera.message().find("8-bit RGB, expected 8-bit grey"), std::string::npos) << camera.message();
}

// Promise: a PNG cut anywhere before its last pixel, or with any byte of its pixels flipped, is never taken for good.
TEST(PngReader, EveryCutAndFlipIsNoticed) {
    std::vector<std::uint8_t> pixels(16 * 16 * 2);
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i * i);
    const std::vector<std::uint8_t> png = test::encode_png(16, 16, SPNG_COLOR_TYPE_GRAYSCALE, 16, pixels);
    const ImageHeader expected{16, 16, ImageKind::kGrey16};
    std::vector<std::uint8_t> decoded(pixels.size());
    std::string message;
    ASSERT_EQ(decode_png(png, "x", expected, decoded, message), Status::kOk) << message;
    ASSERT_EQ(decoded, pixels);
    constexpr std::size_t kEndChunk = 12;
    for (std::size_t size = 0; size < png.size() - kEndChunk - 4; ++size) {
        const std::vector<std::uint8_t> cut(png.begin(), png.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_NE(decode_png(cut, "x", expected, decoded, message), Status::kOk) << size;
    }
    for (std::size_t i = 0; i < png.size() - kEndChunk; ++i) {
        std::vector<std::uint8_t> flipped = png;
        flipped[i] ^= 0x10;
        if (decode_png(flipped, "x", expected, decoded, message) == Status::kOk) {
            EXPECT_EQ(decoded, pixels) << "byte " << i << " changed the image unnoticed";
        }
    }
}

// Promise: the real recordings open with their own camera file, all pairs decode, and the counts are those of their
// README.
TEST(ReplayCamera, RealRecordings) {
    const char* const data = std::getenv("STILLMESH_TEST_DATA");
    const char* const ci = std::getenv("CI");
    if (data == nullptr || !std::filesystem::exists(data)) {
        if (ci != nullptr && std::string(ci) == "true") FAIL() << "STILLMESH_TEST_DATA must name the recordings in CI";
        GTEST_SKIP() << "SKIPPED: no real recordings here; set STILLMESH_TEST_DATA to their folder";
    }
    for (const char* name : {"fr1_rpy_a", "fr1_rpy_a_walking"}) {
        ReplayCamera camera({.folder = std::string(data) + "/" + name, .calibration = ""});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        EXPECT_EQ(camera.counts().colour_images, 360U);
        EXPECT_EQ(camera.counts().depth_images, 359U);
        EXPECT_GE(camera.counts().frames, 350U);
        EXPECT_EQ(camera.info().model.k3, 1.163314);
        std::uint32_t frames = 0;
        std::uint64_t depth_sum = 0;
        Frame frame;
        for (std::uint32_t i = 0; i < 40; ++i) {
            ASSERT_EQ(camera.poll(frame), Status::kOk) << camera.message();
            depth_sum += frame.depth.at(320, 240);
            ++frames;
        }
        EXPECT_EQ(frames, 40U);
        EXPECT_GT(depth_sum, 0U);
    }
}

}  // namespace
}  // namespace stillmesh::replay_camera_test
