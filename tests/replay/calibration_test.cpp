#include "hal/calibration/calibration.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/base/random.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh {
namespace {

constexpr const char* kToml =
    "# a camera\nwidth = 640\nheight = 480\nfx = 517.306408\nfy = 516.469215\ncx = 318.643040\ncy = 255.313989\n"
    "k1 = 0.262383\nk2 = -0.953104\np1 = -0.005358\np2 = 0.002628\nk3 = 1.163314\ndepth_units_per_m = 5000\n"
    "frames_per_s = 30.0\n";
constexpr const char* kOrbSlam =
    "%YAML:1.0\n\n# Camera\nCamera.fx: 517.306408\nCamera.fy: 516.469215\nCamera.cx: 318.643040\n"
    "Camera.cy: 255.313989\nCamera.k1: 0.262383\nCamera.k2: -0.953104\nCamera.p1: -0.005358\nCamera.p2: 0.002628\n"
    "Camera.k3: 1.163314\nCamera.width: 640\nCamera.height: 480\nCamera.fps: 30.0\nCamera.bf: 40.0\nCamera.RGB: 1\n"
    "ThDepth: 40.0\nDepthMapFactor: 5000.0\nORBextractor.nFeatures: 1000\nViewer.ViewpointX: 0\n";
constexpr const char* kRos =
    "image_width: 640\nimage_height: 480\ncamera_name: kinect\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [517.306408, 0.0, 318.643040, 0.0, 516.469215, 255.313989, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.262383, -0.953104, -0.005358, 0.002628, 1.163314]\n"
    "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
    "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [517, 0, 318, 0, 0, 516, 255, 0, 0, 0, 1, 0]\n"
    "depth_units_per_m: 5000\n";

void expect_equal(const CameraInfo& a, const CameraInfo& b) {
    EXPECT_EQ(a.model.width, b.model.width);
    EXPECT_EQ(a.model.height, b.model.height);
    const auto numbers = [](const CameraInfo& i) {
        const CameraModel& m = i.model;
        return std::array<double, 12>{
            m.fx, m.fy, m.cx, m.cy, m.k1, m.k2, m.p1, m.p2, m.k3, i.depth_units_per_m, i.frames_per_s, i.readout_s};
    };
    EXPECT_EQ(numbers(a), numbers(b));
}

[[nodiscard]] std::string error_of(const std::string& text, CalibrationFormat format) {
    CameraInfo info;
    info.depth_units_per_m = -1;
    std::string message;
    EXPECT_EQ(parse_calibration(text, format, "my/camera.file", info, message), Status::kInvalid) << text;
    EXPECT_EQ(info.depth_units_per_m, -1) << "a refused file must change nothing";
    EXPECT_EQ(message.find("my/camera.file"), 0U) << message;
    return message;
}

[[nodiscard]] std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

// Promise: the same camera written in the three formats, and the built-in one, is the same camera to the bit.
TEST(Calibration, ThreeFormatsAgree) {
    CameraInfo expected = *built_in_calibration("tum-fr1");
    expected.readout_s = -1;  // which the files do not tell
    for (const auto& [text, format] : {std::pair{kToml, CalibrationFormat::kToml},
                                       {kOrbSlam, CalibrationFormat::kYaml},
                                       {kRos, CalibrationFormat::kYaml}}) {
        CameraInfo info;
        std::string message;
        ASSERT_EQ(parse_calibration(text, format, "file", info, message), Status::kOk) << message;
        expect_equal(info, expected);
    }
}

// Promise: ORB-SLAM3's names, a ROS message as printed, and a file without size are understood.
TEST(Calibration, ReadsTheirRelatives) {
    CameraInfo info;
    std::string message;
    ASSERT_EQ(
        parse_calibration("File.version: \"1.0\"\nCamera.type: \"PinHole\"\nCamera1.fx: 535.4\nCamera1.fy: 539.2\n"
                          "Camera1.cx: 320.1\nCamera1.cy: 247.6\nRGBD.DepthMapFactor: 5000.0\nStereo.b: 0.07\n",
                          CalibrationFormat::kYaml, "file", info, message),
        Status::kOk)
        << message;
    EXPECT_EQ(info.model.fx, 535.4);
    EXPECT_EQ(info.model.width, 0U) << "the first image will say";
    ASSERT_EQ(
        parse_calibration("header:\n  seq: 1\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\nD: [0, 0, 0, 0]\n"
                          "K: [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]\nR: [1]\nP: [1]\nbinning_x: 0\nroi:\n  x: 0\n"
                          "depth_units_per_m: 1000\n",
                          CalibrationFormat::kYaml, "file", info, message),
        Status::kOk)
        << message;
    EXPECT_EQ(info.model.cy, 239.5);
    EXPECT_EQ(info.depth_units_per_m, 1000);
}

// Promise: what we write, we read back to the same bits.
TEST(Calibration, TomlRoundTrip) {
    Random random(5);
    for (int i = 0; i < 200; ++i) {
        CameraInfo info;
        info.model = {1 + random.below(2047),
                      1 + random.below(2047),
                      random.uniform(1, 2000),
                      random.uniform(1, 2000),
                      0,
                      0,
                      random.normal(),
                      random.normal(),
                      random.normal() * 1e-9,
                      random.normal(),
                      random.normal()};
        info.model.cx = random.uniform(0, info.model.width);
        info.model.cy = random.uniform(0, info.model.height);
        info.depth_units_per_m = random.uniform(100, 100000);
        if (i % 3 != 0) info.readout_s = i % 3 == 1 ? 0.0 : random.uniform(0, 0.1);
        CameraInfo read;
        std::string message;
        ASSERT_EQ(parse_calibration(calibration_toml(info), CalibrationFormat::kToml, "f", read, message), Status::kOk)
            << message;
        expect_equal(read, info);
    }
}

// Promise: a camera may tell how long its rows take, 0 for a global shutter; who does not tell stays unknown, and that
// is written as nothing. The sensors that are known by name all take 26 ms.
TEST(Calibration, Readout) {
    const auto read_of = [](const std::string& text, CalibrationFormat format) {
        CameraInfo info;
        std::string message;
        EXPECT_EQ(parse_calibration(text, format, "f", info, message), Status::kOk) << message;
        return info;
    };
    EXPECT_LT(CameraInfo{}.readout_s, 0);
    EXPECT_EQ(read_of(kToml, CalibrationFormat::kToml).readout_s, -1);
    EXPECT_EQ(calibration_toml(read_of(kToml, CalibrationFormat::kToml)).find("readout_s"), std::string::npos);
    for (const auto& [text, value_s] : {std::pair{"0.026", 0.026}, {"0", 0.0}, {"-0.0", 0.0}, {"0.1", 0.1}}) {
        const CameraInfo toml = read_of(std::string(kToml) + "readout_s = " + text + "\n", CalibrationFormat::kToml);
        EXPECT_EQ(toml.readout_s, value_s);
        EXPECT_FALSE(std::signbit(toml.readout_s));
        expect_equal(read_of(calibration_toml(toml), CalibrationFormat::kToml), toml);
        const std::string line = std::string("readout_s: ") + text + "\n";
        EXPECT_EQ(read_of(kRos + line, CalibrationFormat::kYaml).readout_s, value_s);
        EXPECT_EQ(read_of(std::string(kOrbSlam) + "Camera." + line, CalibrationFormat::kYaml).readout_s, value_s);
    }
    for (const char* const text : {"-1", "-0.001", "0.101", "26"}) {
        const std::string message =
            error_of(std::string(kToml) + "readout_s = " + text + "\n", CalibrationFormat::kToml);
        EXPECT_NE(message.find("key 'readout_s' is " + std::string(text) + "; it must lie between 0 and 0.1."),
                  std::string::npos)
            << message;
    }
    const std::string nearly = error_of(std::string(kToml) + "readout = 0.026\n", CalibrationFormat::kToml);
    EXPECT_NE(nearly.find("did you mean 'readout_s'?"), std::string::npos) << nearly;
    for (const std::string_view name : calibration_names()) {
        EXPECT_EQ(built_in_calibration(name)->readout_s, 0.026) << name;
    }
}

// Promise: a misspelt key is an error that names file, key and the key that was probably meant.
TEST(Calibration, MisspeltKeysAreErrors) {
    const std::string toml = error_of(replaced(kToml, "\nfx =", "\nfxx ="), CalibrationFormat::kToml);
    EXPECT_NE(toml.find("key 'fxx' is unknown; did you mean 'fx'?"), std::string::npos) << toml;
    const std::string orb = error_of(replaced(kOrbSlam, "Camera.fx", "camera.fx"), CalibrationFormat::kYaml);
    EXPECT_NE(orb.find("key 'camera.fx' is unknown; did you mean 'Camera.fx'?"), std::string::npos) << orb;
    const std::string ros = error_of(replaced(kRos, "depth_units_per_m", "depth_unit_per_m"), CalibrationFormat::kYaml);
    EXPECT_NE(ros.find("did you mean 'depth_units_per_m'?"), std::string::npos) << ros;
    const std::string alien = error_of(std::string(kToml) + "colour = 3\n", CalibrationFormat::kToml);
    EXPECT_NE(alien.find("key 'colour' is unknown"), std::string::npos) << alien;
}

// Promise: every missing key, every NaN, every value outside its range is refused by name: nothing defaults to 0.
TEST(Calibration, MissingNanAndRange) {
    const std::array<const char*, 7> required = {"width", "height", "fx", "fy", "cx", "cy", "depth_units_per_m"};
    for (const char* key : required) {
        std::string text = kToml;
        const std::size_t begin = text.find("\n" + std::string(key) + " =") + 1;
        text.erase(begin, text.find('\n', begin) - begin);
        const std::string message = error_of(text, CalibrationFormat::kToml);
        EXPECT_NE(message.find("key '" + std::string(key) + "' is missing"), std::string::npos) << message;
    }
    EXPECT_NE(
        error_of(replaced(kToml, "517.306408", "nan"), CalibrationFormat::kToml).find("'fx' is not a finite number"),
        std::string::npos);
    EXPECT_NE(error_of(replaced(kOrbSlam, "517.306408", ".nan"), CalibrationFormat::kYaml)
                  .find("'Camera.fx' is not a finite"),
              std::string::npos);
    EXPECT_NE(error_of(replaced(kRos, "516.469215", "inf"), CalibrationFormat::kYaml).find("'fy' is not a finite"),
              std::string::npos);
    EXPECT_NE(error_of(replaced(kOrbSlam, "5000.0", "0"), CalibrationFormat::kYaml)
                  .find("key 'DepthMapFactor' is 0; it must lie between 100 and"),
              std::string::npos);
    EXPECT_NE(error_of(replaced(kToml, "517.306408", "-517"), CalibrationFormat::kToml).find("'fx' is -517"),
              std::string::npos);
    EXPECT_NE(
        error_of(replaced(kToml, "517.306408", "\"517\""), CalibrationFormat::kToml).find("'fx' must be a number"),
        std::string::npos);
    EXPECT_NE(error_of(replaced(kOrbSlam, "517.306408", "517,3"), CalibrationFormat::kYaml).find("must be a number"),
              std::string::npos);
    EXPECT_NE(error_of(replaced(kToml, "318.643040", "1318"), CalibrationFormat::kToml).find("outside the image"),
              std::string::npos);
    EXPECT_NE(error_of(replaced(kToml, "640", "640.5"), CalibrationFormat::kToml).find("whole"), std::string::npos);
    EXPECT_NE(error_of(replaced(kRos, "plumb_bob", "equidistant"), CalibrationFormat::kYaml).find("plumb_bob"),
              std::string::npos);
    EXPECT_NE(error_of(std::string(kOrbSlam) + "Camera.fx: 500\n", CalibrationFormat::kYaml).find("given twice"),
              std::string::npos);
    // ROS knows no depth factor, and it is not guessed.
    EXPECT_NE(error_of(replaced(kRos, "depth_units_per_m: 5000\n", ""), CalibrationFormat::kYaml)
                  .find("'depth_units_per_m' is missing"),
              std::string::npos);
}

// Promise: any bytes are refused with a sentence or accepted, and deep nesting does not exhaust the stack.
TEST(Calibration, AnyBytesAreSafe) {
    Random random(9);
    for (int i = 0; i < 3000; ++i) {
        const CalibrationFormat format = i % 2 == 0 ? CalibrationFormat::kToml : CalibrationFormat::kYaml;
        std::string text = i % 2 == 0 ? kToml : (i % 4 == 1 ? kOrbSlam : kRos);
        for (std::uint32_t k = 1 + random.below(6); k > 0; --k) {
            text[random.below(static_cast<std::uint32_t>(text.size()))] = static_cast<char>(random.below(256));
        }
        CameraInfo info;
        std::string message;
        const Status status = parse_calibration(text, format, "f", info, message);
        EXPECT_EQ(status == Status::kOk, message.empty());
    }
    static_cast<void>(error_of(std::string(60000, '['), CalibrationFormat::kYaml));
    static_cast<void>(error_of(std::string(60000, '['), CalibrationFormat::kToml));
    std::string nested;
    for (int i = 0; i < 300; ++i) nested += std::string(static_cast<std::size_t>(i), ' ') + "a:\n";
    static_cast<void>(error_of(nested, CalibrationFormat::kYaml));
    std::string dashes;
    for (int i = 0; i < 20000; ++i) dashes += "- ";
    static_cast<void>(error_of(dashes, CalibrationFormat::kYaml));
    static_cast<void>(error_of(std::string(100000, ' '), CalibrationFormat::kYaml));
    static_cast<void>(error_of("", CalibrationFormat::kYaml));
}

// Promise: load_calibration takes names and files, and says which names it knows.
TEST(Calibration, LoadsNamesAndFiles) {
    test::TemporaryFolder folder;
    CameraInfo info;
    std::string message;
    EXPECT_EQ(load_calibration("tum-fr2", info, message), Status::kOk);
    EXPECT_EQ(info.depth_units_per_m, 5208.0);
    EXPECT_EQ(load_calibration("tum-fr4", info, message), Status::kInvalid);
    EXPECT_NE(message.find("did you mean 'tum-fr"), std::string::npos) << message;
    test::write_text(folder.path() + "/c.yml", kOrbSlam);
    EXPECT_EQ(load_calibration(folder.path() + "/c.yml", info, message), Status::kOk) << message;
    EXPECT_EQ(load_calibration(folder.path() + "/missing.toml", info, message), Status::kUnavailable);
    EXPECT_NE(message.find("missing.toml: cannot be opened"), std::string::npos) << message;
}

}  // namespace
}  // namespace stillmesh
