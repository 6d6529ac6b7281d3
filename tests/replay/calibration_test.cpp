#include "hal/calibration/calibration.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/base/random.hpp"
#include "tests/replay/recording_folder.hpp"

namespace stillmesh::calibration_test {
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
    EXPECT_EQ(a.model, b.model);
    const auto numbers = [](const CameraInfo& i) {
        return std::array<double, 3>{i.depth_units_per_m, i.frames_per_s, i.readout_s};
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
        if (i % 4 == 1)
            info.model.k4 = random.normal(), info.model.k5 = random.normal(), info.model.k6 = random.normal();
        if (i % 4 == 2)
            info.model.lens = Lens::kFisheye, info.model.p1 = info.model.p2 = 0, info.model.k4 = random.normal();
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
    const std::array<const char*, 6> required = {"width", "height", "fx", "fy", "cx", "cy"};
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
    EXPECT_NE(
        error_of(replaced(kRos, "516.469215", "inf"), CalibrationFormat::kYaml).find("'camera_matrix.data' is not a"),
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
    EXPECT_NE(error_of(replaced(kRos, "plumb_bob", "omnidirectional"), CalibrationFormat::kYaml).find("plumb_bob"),
              std::string::npos);
    EXPECT_NE(error_of(std::string(kOrbSlam) + "Camera.fx: 500\n", CalibrationFormat::kYaml).find("given twice"),
              std::string::npos);
    // ROS knows no depth factor, and it is not guessed: 0, for whoever knows it.
    CameraInfo info;
    std::string message;
    ASSERT_EQ(parse_calibration(replaced(kRos, "depth_units_per_m: 5000\n", ""), CalibrationFormat::kYaml, "f", info,
                                message),
              Status::kOk)
        << message;
    EXPECT_EQ(info.depth_units_per_m, 0);
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
    // Aliases that make much of little: of a long word, of a long key, of lists of lists.
    std::string aliases = "a: &a " + std::string(30000, 'x') + "\nfx: [";
    for (int i = 0; i < 10000; ++i) aliases += "*a,";
    static_cast<void>(error_of(aliases + "*a]\n", CalibrationFormat::kYaml));
    std::string dashes;
    for (int i = 0; i < 20000; ++i) dashes += "- ";
    static_cast<void>(error_of(dashes, CalibrationFormat::kYaml));
    static_cast<void>(error_of(std::string(100000, ' '), CalibrationFormat::kYaml));
    static_cast<void>(error_of("", CalibrationFormat::kYaml));
}

[[nodiscard]] CameraInfo read_of(const std::string& text) {
    CameraInfo info;
    std::string message;
    EXPECT_EQ(parse_calibration(text, CalibrationFormat::kYaml, "f", info, message), Status::kOk) << message << text;
    return info;
}

// Promise: what OpenCV reads is read: keys and lists without a blank behind the colon, wherever they stand, and keys
// that are given twice with one value. With two values both are named with their lines.
TEST(Calibration, SpelledAsOpenCvReadsIt) {
    const CameraInfo expected = read_of(kOrbSlam);
    for (const std::string& text :
         {std::string(kOrbSlam) + "Viewer.PointSize:2\nViewer.ViewpointX: 0\n",
          replaced(replaced(kOrbSlam, "Camera.fy: ", "Camera.fy:"), "DepthMapFactor: ", "DepthMapFactor:"),
          std::string(kOrbSlam) + "LEFT.D: !!opencv-matrix\n   rows:1\n   cols: 2\n   dt:d\n   data:[0.1, -0.2]\n",
          std::string("\xef\xbb\xbf") + kOrbSlam,
          std::string(kOrbSlam) + "Camera.width: 640.0\nCamera.fx: 517.306408\n",
          replaced(replaced(kOrbSlam, "Camera.width", "Camera.cols"), "Camera.height", "Camera.rows")}) {
        expect_equal(read_of(text), expected);
    }
    const std::string twice = error_of(std::string(kOrbSlam) + "Camera.width: 848\n", CalibrationFormat::kYaml);
    EXPECT_NE(twice.find(", line 22: key 'Camera.width' is given twice: 640 in line 13 as 'Camera.width', then 848"),
              std::string::npos)
        << twice;
    const std::string comma = error_of(replaced(kOrbSlam, "517.306408", "517,306408"), CalibrationFormat::kYaml);
    EXPECT_NE(comma.find(", line 4: key 'Camera.fx' must be a number: with a point, as in 517.306408"),
              std::string::npos)
        << comma;
}

// Promise: a key that would change the lens or the picture, and cannot be followed, is named with what to do.
TEST(Calibration, KeysThatScale) {
    const auto error = [](const char* line) {
        return error_of(std::string(kOrbSlam) + line + "\n", CalibrationFormat::kYaml);
    };
    for (const char* const line : {"Camera.newWidth: 600", "Camera.newHeight: 450", "Camera.imageScale: 0.5"}) {
        EXPECT_NE(error(line).find("scales images, and they are not scaled here: remove it"), std::string::npos);
    }
    static_cast<void>(read_of(std::string(kOrbSlam) + "Camera.newWidth: 640\nCamera.imageScale: 1\n"));
    for (const char* const line : {"binning_x: 2", "roi:\n  x_offset: 8\n  width: 640"}) {
        const std::string message = error_of(std::string(kRos) + line + "\n", CalibrationFormat::kYaml);
        EXPECT_NE(message.find("K is of the whole picture"), std::string::npos) << message;
    }
    static_cast<void>(read_of(std::string(kRos) + "binning_x: 1\nroi:\n  x_offset: 0\n  do_rectify: false\n"));
    EXPECT_NE(error("Camera.k4: 0.1").find("'Camera.k4' is 0.1: a coefficient that this lens"), std::string::npos);
    static_cast<void>(read_of(std::string(kOrbSlam) + "Camera.k4: 0\n"));
    EXPECT_EQ(read_of(std::string(kOrbSlam) + "Camera.k4: 0.1\nCamera.k5: 0\nCamera.k6: -1\n").model.k6, -1);
}

// Promise: the lens is what its name says, in each program's spelling; coefficients beyond it must be 0 or are named.
TEST(Calibration, Lenses) {
    const auto ros = [](const std::string& model, const std::string& d) {
        return "height: 480\nwidth: 640\ndistortion_model: " + model + "\nD: [" + d +
               "]\nK: [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]\n";
    };
    const CameraInfo plain = read_of(ros("plumb_bob", "0.1, 0.2, 0.3, 0.4, 0.5"));
    EXPECT_EQ(plain.model.k3, 0.5);
    for (const auto& [model, d] : {std::pair{"rational_polynomial", "0.1, 0.2, 0.3, 0.4, 0.5"},
                                   {"rational_polynomial", "0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0"},
                                   {"plumb_bob", "0.1, 0.2, 0.3, 0.4, 0.5, 0.0, 0, 0"},
                                   {"radtan", "0.1, 0.2, 0.3, 0.4, 0.5"},
                                   {"\"Brown Conrady\"", "0.1, 0.2, 0.3, 0.4, 0.5"},
                                   {"''", "0.1, 0.2, 0.3, 0.4, 0.5"},
                                   {"&lens", "0.1, 0.2, 0.3, 0.4, 0.5"}}) {
        expect_equal(read_of(ros(model, d)), plain);
    }
    const CameraModel rational = read_of(ros("rational_polynomial", "1, 2, 3, 4, 5, 6, 7, 8")).model;
    EXPECT_EQ((std::array{rational.k3, rational.k4, rational.k5, rational.k6}), (std::array<double, 4>{5, 6, 7, 8}));
    for (const char* const name : {"equidistant", "equi", "fisheye", "KannalaBrandt8", "kannala_brandt4"}) {
        const CameraModel m = read_of(ros(name, "1, 2, 3, 4")).model;
        EXPECT_EQ(m.lens, Lens::kFisheye) << name;
        EXPECT_EQ((std::array{m.k1, m.k2, m.k3, m.k4, m.p1, m.p2}), (std::array<double, 6>{1, 2, 3, 4, 0, 0}));
    }
    const auto error = [&ros](const char* model, const char* d) {
        return error_of(ros(model, d), CalibrationFormat::kYaml);
    };
    EXPECT_NE(error("plumb_bob", "1, 2, 3, 4, 5, .6, 0, 0").find("number 6 is 0.6, but this lens (plumb_bob) has 5"),
              std::string::npos);
    EXPECT_NE(error("equidistant", "1, 2, 3, 4, 5").find("number 5 is 5"), std::string::npos);
    EXPECT_NE(error("plumb_bob", "1, 2").find("has 2 numbers"), std::string::npos);
    EXPECT_NE(error("&lens", "1, 2").find("has 2 numbers; this lens has"), std::string::npos);
    EXPECT_NE(error("[plumb_bob, radtan]", "1, 2, 3, 4").find("must be the name of a lens"), std::string::npos);
    EXPECT_NE(error("inverse_brown_conrady", "0, 0, 0, 0, 1").find("distorts otherwise than plumb_bob"),
              std::string::npos);
    EXPECT_EQ(read_of(ros("inverse_brown_conrady", "0, 0, 0, 0, 0")).model.k1, 0);
    EXPECT_NE(error("omni-radtan", "1, 2, 3, 4").find("'omni-radtan', a lens that is unknown here (known: plumb_bob"),
              std::string::npos);
    const std::string never = error_of(
        replaced(ros("plumb_bob", "0, 0, 0, 0"), "525, 0, 319.5, 0, 525, 239.5, 0, 0, 1", "0, 0, 0, 0, 0, 0, 0, 0, 0"),
        CalibrationFormat::kYaml);
    EXPECT_NE(never.find(", line 5: key 'K' is all zero: this camera was never calibrated"), std::string::npos)
        << never;
    // A separator of `rostopic echo`, with a key added behind it.
    EXPECT_EQ(read_of(ros("plumb_bob", "0, 0, 0, 0") + "---\ndepth_units_per_m: 1000\n").depth_units_per_m, 1000);
}

// Promise: the camera files of Kalibr, EuRoC, stella_vslam, OpenLORIS, ETH3D, ScanNet, Open3D, Replica and RealSense
// give one camera, whatever they call its numbers and in which order; a lens other than it would be is refused.
TEST(Calibration, CameraFilesOfOthers) {
    const std::string openloris =
        "   width: 640\n   height: 480\n   model: pinhole\n   intrinsics: !!opencv-matrix\n      rows: 1\n      cols: "
        "4\n"
        "      dt: d\n      data: ";
    const std::string realsense =
        "\"width\": 640, \"height\": 480, \"fx\": 528.0, \"fy\": 530, \"ppx\": 319.5, \"ppy\": 240, ";
    const std::string kalibr =
        "cam0:\n  camera_model: pinhole\n  intrinsics: [528.0, 530.0, 319.5, 240]\n  distortion_model: radtan\n"
        "  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  resolution: [640, 480]\n  rostopic: /rgb/image\n";
    const std::string texts[] = {
        kalibr,
        kalibr + "cam1:\n  camera_model: pinhole\n  intrinsics: [400, 400, 300, 200]\n  rostopic: /infra1/image\n",
        "sensor_type: camera\nrate_hz: 30\nresolution: [640, 480]\ncamera_model: pinhole\n"
        "intrinsics: [528, 530, 319.5, 240] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n"
        "distortion_coefficients: [0, 0, 0, 0]\n",
        "Camera:\n  name: kinect\n  setup: RGBD\n  model: perspective\n  fx: 528.0\n  fy: 530.0\n  cx: 319.5\n  cy: "
        "240\n"
        "  k1: 0.0\n  k2: 0.0\n  p1: 0.0\n  p2: 0.0\n  k3: 0.0\n  fps: 30.0\n  cols: 640\n  rows: 480\n"
        "  color_order: Gray\nFeature:\n  name: default\n  num_levels: 8\n",
        "%YAML:1.0\nd400_color_optical_frame:\n" + openloris + "[528, 319.5, 530, 240]\nd400_depth_optical_frame:\n" +
            openloris + "[580, 321, 581, 238]\n",
        "528.0 530 319.5 240\n",
        "# fx fy cx cy k1 k2 p1 p2, and k3\n528.0 530 319.5 240 0 0 0 0\n",
        "528.0, 530, 319.5, 240, 0, 0, 0, 0, 0\n",
        "%YAML:1.0\nCamera_Matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 528., 0., 3.195e+02, "
        "0.,\n       530., 240., 0., 0., 1. ]\nDistortion_Coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   "
        "dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n",
        "cameraMatrix: [528, 0, 319.5, 0, 530, 240, 0, 0, 1]\ndistCoeffs: [0, 0, 0, 0]\n",
        "# ScanNet\n528 0 319.5 0\n0 530 240 0\n0 0 1 0\n0 0 0 1\n",
        "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [528, 0, 0, 0, 530, 0, 319.5, 240, 1]}",
        "{\n\t\"intrinsic\": {\n\t\t\"width\": 640, \"height\": 480,\n\t\t\"intrinsic_matrix\": [[528, 0, 319.5], [0, "
        "530, "
        "240],\n\t\t [0, 0, 1]]\n\t},\n\t\"extrinsic\": [1, 0, 0, 0]\n}\n",
        "{" + realsense + "\"model\": \"Brown Conrady\", \"coeffs\": [0.0, 0, 0, 0, 0]}",
        "{\"color\": {" + realsense +
            "\"model\": 2, \"coeffs\": [0, 0, 0, 0, 0]}, \"depth\": {\"width\": 848, \"fx\": 425}}",
        "{\"camera\": {\"w\": 640, \"h\": 480, \"fx\": 528, \"fy\": 530, \"cx\": 319.5, \"cy\": 240}}"};
    for (const std::string& text : texts) {
        const CameraInfo info = read_of(text);
        CameraModel m = info.model;
        if (m.width == 0) m.width = 640, m.height = 480;  // files of nothing but numbers do not say it
        EXPECT_EQ(m, (CameraModel{640, 480, 528, 530, 319.5, 240})) << text;
        EXPECT_EQ(info.depth_units_per_m, 0) << text;
    }
    EXPECT_EQ(read_of("{" + realsense + "\"depth_scale\": 0.0010000000474974513}").depth_units_per_m, 1000);
    EXPECT_EQ(read_of("{" + realsense + "\"depth_scale\": 0.0002}").depth_units_per_m, 5000);
    EXPECT_EQ(read_of("{" + realsense + "\"depth_scale\": 1000.0}").depth_units_per_m, 1000);
    EXPECT_EQ(read_of(texts[3] + "depthmap_factor: 5000.0\n").depth_units_per_m, 5000);
    EXPECT_EQ(read_of(replaced(texts[0], "radtan", "equidistant")).model.lens, Lens::kFisheye);
    const auto error = [](const std::string& text) { return error_of(text, CalibrationFormat::kYaml); };
    EXPECT_NE(error(replaced(texts[1], "/rgb/image", "/infra0/image")).find("holds 2 cameras (cam0, cam1)"),
              std::string::npos);
    EXPECT_NE(
        error(replaced(kalibr, "528.0, 530.0, 319.5", "528.0, 319.5, 530.0")).find("read as fx fy cx cy; is that"),
        std::string::npos);
    EXPECT_NE(error(replaced(kalibr, "distortion_coeffs", "distortion_coefs")).find("did you mean"), std::string::npos);
    EXPECT_NE(error("1 2 3 4 5\n").find("it holds 5 numbers"), std::string::npos);
    const CameraModel bent = read_of("528 530 319.5 240 0.1 -0.2 0.001 -0.002 0.05").model;
    EXPECT_EQ((std::array{bent.k1, bent.k2, bent.p1, bent.p2, bent.k3}), (std::array{0.1, -0.2, 0.001, -0.002, 0.05}));
    EXPECT_EQ(read_of("Camera_Matrix: [528, 0, 319.5, 0, 530, 240, 0, 0, 1]\nDistortion_Coefficients: [0.1, 0, 0, 0]\n")
                  .model.k1,
              0.1);
    EXPECT_NE(error("528 0.5 319.5\n0 530 240\n0 0 1\n").find("skewed"), std::string::npos);
    EXPECT_NE(error("name: kinect\n").find("neither fx, fy, cx, cy nor"), std::string::npos);
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

// Promise: our own file names two cameras and how they stand to each other; written and read again they are the same to
// the bit, lens and all; and what is missing or cannot be is named.
TEST(CameraPair, OwnFile) {
    CameraInfo info = *built_in_calibration("tum-fr1");
    SeparateDepth depth;
    depth.model = {848, 480, 424.1, 424.2, 424.3, 238.4, 0.1, -0.2, 0.003, 0.004, 0.05};
    depth.colour_from_depth = {{0.6, 0, 0, 0.8}, {0.015, -0.001, 0.0002}};
    info.separate_depth = depth;
    const std::string text = calibration_toml(info);
    CameraInfo read;
    std::string message;
    ASSERT_EQ(parse_calibration(text, CalibrationFormat::kToml, "f", read, message), Status::kOk) << message;
    expect_equal(read, info);
    ASSERT_TRUE(read.separate_depth);
    EXPECT_EQ(read.separate_depth->model, depth.model);
    for (int i = 0; i < 4; ++i) {
        EXPECT_EQ(read.separate_depth->colour_from_depth.rotation_xyzw[i], depth.colour_from_depth.rotation_xyzw[i]);
    }
    for (int i = 0; i < 3; ++i) {
        EXPECT_EQ(read.separate_depth->colour_from_depth.translation_m[i], depth.colour_from_depth.translation_m[i]);
    }
    const auto error = [&text](const char* from, const char* to) {
        return error_of(replaced(text, from, to), CalibrationFormat::kToml);
    };
    EXPECT_NE(error("tx = 0.015", "").find("'depth.tx' is missing"), std::string::npos);
    EXPECT_NE(error("tx = 0.015", "tx = 15").find("in mm"), std::string::npos);
    EXPECT_NE(error("fx = 424.1", "").find("'depth.fx' is missing"), std::string::npos);
    EXPECT_NE(error("fx = 424.1", "fx = 424.1\nfocal = 3").find("'depth.focal' is unknown"), std::string::npos);
    EXPECT_NE(error("qw = 0.8", "qw = 0.9").find("length 1"), std::string::npos);
}

// Promise: Kalibr's chain and librealsense's numbers give the pose between the two cameras, whichever comes first: a
// point that the depth camera sees lies in the colour camera where the file's own matrices put it.
TEST(CameraPair, FilesOfOthers) {
    const std::string colour =
        ":\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n"
        "  intrinsics: [600, 601, 320, 240]\n  resolution: [640, 480]\n  rostopic: /camera/color/image_raw\n";
    const std::string infrared =
        ":\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n"
        "  intrinsics: [424, 425, 420, 240]\n  resolution: [848, 480]\n  rostopic: /camera/infra1/image_rect_raw\n";
    // A quarter turn about z, and (.01, .02, .03) m.
    const std::string forth = "  T_cn_cnm1: [[0, -1, 0, 0.01], [1, 0, 0, 0.02], [0, 0, 1, 0.03], [0, 0, 0, 1]]\n";
    const std::string realsense =
        R"({"color": {"width": 640, "height": 480, "fx": 600, "fy": 601, "ppx": 320, "ppy": 240, "model": "none"},
            "depth": {"width": 848, "height": 480, "fx": 424, "fy": 425, "ppx": 420, "ppy": 240, "model": "none"},
            "depth_scale": 0.001,
            "depth_to_color": {"rotation": [0, 1, 0, -1, 0, 0, 0, 0, 1], "translation": [0.01, 0.02, 0.03]}})";
    const auto seen_in_colour = [](const std::string& text) {
        CameraInfo info;
        std::string message;
        EXPECT_EQ(parse_calibration(text, CalibrationFormat::kYaml, "f", info, message), Status::kOk) << message;
        EXPECT_EQ(info.model.fx, 600);
        std::array<double, 3> out{};
        EXPECT_TRUE(info.separate_depth) << text;
        if (!info.separate_depth) return out;
        EXPECT_EQ(info.separate_depth->model.fx, 424);
        const auto [x, y, z, w] = info.separate_depth->colour_from_depth.rotation_xyzw;
        const double* const t = info.separate_depth->colour_from_depth.translation_m;
        const double p[3] = {0.1, 0.2, 1.0};
        out = {(1 - 2 * (y * y + z * z)) * p[0] + 2 * (x * y - z * w) * p[1] + 2 * (x * z + y * w) * p[2] + t[0],
               2 * (x * y + z * w) * p[0] + (1 - 2 * (x * x + z * z)) * p[1] + 2 * (y * z - x * w) * p[2] + t[1],
               2 * (x * z - y * w) * p[0] + 2 * (y * z + x * w) * p[1] + (1 - 2 * (x * x + y * y)) * p[2] + t[2]};
        return out;
    };
    const auto expect_at = [](const std::array<double, 3>& got, double x, double y, double z) {
        EXPECT_NEAR(got[0], x, 1e-12);
        EXPECT_NEAR(got[1], y, 1e-12);
        EXPECT_NEAR(got[2], z, 1e-12);
    };
    // Infrared first: colour_from_depth is the matrix itself.
    expect_at(seen_in_colour("cam0" + infrared + "cam1" + colour + forth), -0.19, 0.12, 1.03);
    expect_at(seen_in_colour(realsense), -0.19, 0.12, 1.03);
    // Colour first: its inverse.
    expect_at(seen_in_colour("cam0" + colour + "cam1" + infrared + forth), 0.18, -0.09, 0.97);

    // No place, no second camera; of one size, depth is taken for registered.
    CameraInfo info;
    std::string message;
    ASSERT_EQ(parse_calibration("cam0" + infrared + "cam1" + colour, CalibrationFormat::kYaml, "f", info, message),
              Status::kOk)
        << message;
    EXPECT_FALSE(info.separate_depth);
    const std::string same = "cam0" + replaced(infrared, "[848, 480]", "[640, 480]") + "cam1" + colour + forth;
    ASSERT_EQ(parse_calibration(same, CalibrationFormat::kYaml, "f", info, message), Status::kOk) << message;
    EXPECT_FALSE(info.separate_depth);
    const std::string skewed = "cam0" + infrared + "cam1" + colour + replaced(forth, "[1, 0,", "[1, 0.5,");
    EXPECT_NE(error_of(skewed, CalibrationFormat::kYaml).find("no rigid motion"), std::string::npos);
}

}  // namespace
}  // namespace stillmesh::calibration_test
