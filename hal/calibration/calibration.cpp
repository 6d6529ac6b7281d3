#include "hal/calibration/calibration.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <exception>
#include <initializer_list>
#include <string>
#include <vector>

#include "hal/calibration/camera_entries.hpp"
#include "hal/calibration/camera_pair.hpp"
#include "hal/calibration/toml_document.hpp"

namespace stillmesh {
namespace {

constexpr std::array<std::string_view, 4> kNames = {"tum-fr1", "tum-fr2", "tum-fr3", "kinect"};

[[nodiscard]] std::string number_text(double value) {
    std::array<char, 64> buffer{};
    const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return error == std::errc() ? std::string(buffer.data(), end) : std::string("?");
}

[[nodiscard]] bool ends_with_any(std::string_view name, std::initializer_list<std::string_view> endings) {
    return std::any_of(endings.begin(), endings.end(),
                       [name](std::string_view ending) { return name.ends_with(ending); });
}

}  // namespace

std::span<const std::string_view> calibration_names() {
    return kNames;
}

std::optional<CameraInfo> built_in_calibration(std::string_view name) {
    CameraInfo info;
    info.depth_units_per_m = 5000.0;
    info.frames_per_s = 30.0;
    info.readout_s = 0.026;  // all are of one family of sensors
    if (name == "tum-fr1") {
        info.model = {640,      480,       517.306408, 516.469215, 318.643040, 255.313989,
                      0.262383, -0.953104, -0.005358,  0.002628,   1.163314};
    } else if (name == "tum-fr2") {
        info.model = {640,      480,       520.908620, 521.007327, 325.141442, 249.701764,
                      0.231222, -0.784899, -0.003257,  -0.000105,  0.917205};
        info.depth_units_per_m = 5208.0;
    } else if (name == "tum-fr3") {
        info.model = {640, 480, 535.4, 539.2, 320.1, 247.6};
    } else if (name == "kinect") {
        info.model = {640, 480, 525.0, 525.0, 319.5, 239.5};
    } else {
        return std::nullopt;
    }
    return info;
}

Status parse_calibration(std::string_view text, CalibrationFormat format, const std::string& file, CameraInfo& info,
                         std::string& message) {
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
    if (text.size() > kCalibrationBytesMax) {
        message = camera_file_message(file, 0, "this is no camera file: it is longer than 64 KiB.");
        return Status::kInvalid;
    }
    try {
        const bool is_own = format == CalibrationFormat::kToml;
        std::vector<CameraEntry> entries;
        STILLMESH_TRY(is_own ? read_toml_entries(text, file, entries, message)
                             : read_yaml_entries(text, file, entries, message));
        CameraInfo parsed;
        STILLMESH_TRY(cameras_of_entries(entries, is_own, file, parsed, message));
        info = parsed;
        return Status::kOk;
    } catch (const std::exception& error) {  // a library's own: never through our door
        message = camera_file_message(file, 0, std::string("cannot be read: ") + error.what() + ".");
        return Status::kInvalid;
    }
}

Status load_calibration(const std::string& name_or_file, CameraInfo& info, std::string& message) {
    if (const std::optional<CameraInfo> known = built_in_calibration(name_or_file)) {
        info = *known;
        return Status::kOk;
    }
    const bool is_toml = name_or_file.ends_with(".toml");
    if (!is_toml && !ends_with_any(name_or_file, {".yaml", ".yml", ".json", ".txt"})) {
        message = name_or_file + ": not a camera file (.toml, .yaml, .yml, .json, .txt) and not a known camera (";
        for (const std::string_view name : kNames) message += std::string(name) + (name == kNames.back() ? ")" : ", ");
        const std::string_view nearest = nearest_name(name_or_file, kNames);
        message += nearest.empty() ? "." : "; did you mean '" + std::string(nearest) + "'?";
        return Status::kInvalid;
    }
    std::string text;
    STILLMESH_TRY(read_small_file(name_or_file, kCalibrationBytesMax, text, message));
    return parse_calibration(text, is_toml ? CalibrationFormat::kToml : CalibrationFormat::kYaml, name_or_file, info,
                             message);
}

std::string calibration_toml(const CameraInfo& info) {
    // The shortest decimals that read back to the same bits; TOML wants a point in a floating number, and takes whole
    // ones.
    const auto line = [](const char* key, double value) {
        return std::string(key) + " = " + number_text(value) + "\n";
    };
    const auto lens = [&line](const CameraModel& m) {
        return line("width", m.width) + line("height", m.height) + line("fx", m.fx) + line("fy", m.fy) +
               line("cx", m.cx) + line("cy", m.cy) + line("k1", m.k1) + line("k2", m.k2) + line("p1", m.p1) +
               line("p2", m.p2) + line("k3", m.k3) +
               (m.is_plain_brown()
                    ? std::string()
                    : std::string("lens = ") + (m.lens == Lens::kFisheye ? "\"fisheye\"\n" : "\"rational\"\n") +
                          line("k4", m.k4) + line("k5", m.k5) + line("k6", m.k6));
    };
    std::string text = "# camera file of stillmesh: pixels, and depth units per metre\n" + lens(info.model) +
                       (info.depth_units_per_m > 0 ? line("depth_units_per_m", info.depth_units_per_m) : "") +
                       line("frames_per_s", info.frames_per_s) +
                       (info.readout_s < 0 ? std::string() : line("readout_s", info.readout_s));
    if (!info.separate_depth) return text;
    text +=
        "\n# depth images are those of this camera; the pose takes its points (m) into the camera above\n[depth]\n" +
        lens(info.separate_depth->model);
    const RigidTransform& pose = info.separate_depth->colour_from_depth;
    constexpr const char* kTranslation[] = {"tx", "ty", "tz"};
    constexpr const char* kRotation[] = {"qx", "qy", "qz", "qw"};
    for (std::size_t i = 0; i < 3; ++i) text += line(kTranslation[i], pose.translation_m[i]);
    for (std::size_t i = 0; i < 4; ++i) text += line(kRotation[i], pose.rotation_xyzw[i]);
    return text;
}

}  // namespace stillmesh
