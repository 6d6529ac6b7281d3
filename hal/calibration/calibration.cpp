#include "hal/calibration/calibration.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <exception>
#include <string>
#include <vector>

#include "hal/calibration/toml_document.hpp"

namespace stillmesh {
namespace {

constexpr std::array<std::string_view, 4> kNames = {"tum-fr1", "tum-fr2", "tum-fr3", "kinect"};

// One number of the camera model, under the name it has in the file at hand.
struct Field {
    std::string_view key;
    double* target;
    bool is_required;
    double min;
    double max;
    bool is_seen = false;
};

// The parsed numbers, before they become a CameraInfo; sizes are kept as doubles so that one table serves all.
struct Draft {
    double width = 0, height = 0;
    double fx = 0, fy = 0, cx = 0, cy = 0;
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
    double depth_units_per_m = 0;
    double frames_per_s = 30.0;
    double readout_s = -1;  // not given
};

constexpr double kSizeMax = 2047;        // the exact mesh predicates end there
constexpr double kFocalMax = 20000;      // px
constexpr double kReadoutMax_s = 0.1;    // three frames of a usual camera
constexpr double kDistortionMax = 1000;  // a real lens stays far below; the engine checks the shape itself

[[nodiscard]] std::string number_text(double value) {
    std::array<char, 64> buffer{};
    const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return error == std::errc() ? std::string(buffer.data(), end) : std::string("?");
}

Status fail(std::string& message, const std::string& file, const std::string& sentence) {
    message = file + ": " + sentence;
    return Status::kInvalid;
}

[[nodiscard]] std::string quoted(std::string_view text) {
    return "'" + std::string(text.substr(0, 80)) + "'";
}

Status set_field(Field& field, double value, const std::string& file, std::string& message) {
    if (field.is_seen) return fail(message, file, "key " + quoted(field.key) + " is given twice; keep one of them.");
    field.is_seen = true;
    if (!std::isfinite(value)) {
        return fail(message, file, "key " + quoted(field.key) + " is not a finite number; calibrate again.");
    }
    if (value < field.min || value > field.max) {
        return fail(message, file,
                    "key " + quoted(field.key) + " is " + number_text(value) + "; it must lie between " +
                        number_text(field.min) + " and " + number_text(field.max) + ".");
    }
    *field.target = value;
    return Status::kOk;
}

Status unknown_key(std::string_view key, std::span<const Field> fields, const std::string& file, std::string& message) {
    std::vector<std::string_view> known;
    known.reserve(fields.size());
    for (const Field& field : fields) known.push_back(field.key);
    const std::string_view nearest = nearest_name(key, known);
    std::string sentence = "key " + quoted(key) + " is unknown; ";
    if (!nearest.empty()) {
        sentence += "did you mean " + quoted(nearest) + "?";
    } else {
        sentence += "remove it (known:";
        for (const std::string_view name : known) sentence += " " + std::string(name);
        sentence += ").";
    }
    return fail(message, file, sentence);
}

Status require_all(std::span<const Field> fields, const std::string& file, std::string& message) {
    for (const Field& field : fields) {
        if (!field.is_required || field.is_seen) continue;
        std::string sentence = "key " + quoted(field.key) + " is missing; add it";
        if (field.max > kFocalMax) sentence += " (depth units per metre: 5000 in TUM recordings, 1000 for millimetres)";
        return fail(message, file, sentence + ".");
    }
    return Status::kOk;
}

using Fields = std::array<Field, 14>;

// Focal lengths have a lower bound above 0, the factor one that a 16-bit image can use at all.
Fields fields_of(Draft& draft, const std::array<std::string_view, 14>& keys, bool needs_size) {
    return {{{keys[0], &draft.width, needs_size, 1, kSizeMax},
             {keys[1], &draft.height, needs_size, 1, kSizeMax},
             {keys[2], &draft.fx, true, 1, kFocalMax},
             {keys[3], &draft.fy, true, 1, kFocalMax},
             {keys[4], &draft.cx, true, -kSizeMax, 2 * kSizeMax},
             {keys[5], &draft.cy, true, -kSizeMax, 2 * kSizeMax},
             {keys[6], &draft.k1, false, -kDistortionMax, kDistortionMax},
             {keys[7], &draft.k2, false, -kDistortionMax, kDistortionMax},
             {keys[8], &draft.p1, false, -kDistortionMax, kDistortionMax},
             {keys[9], &draft.p2, false, -kDistortionMax, kDistortionMax},
             {keys[10], &draft.k3, false, -kDistortionMax, kDistortionMax},
             {keys[11], &draft.depth_units_per_m, true, 100, 100000},
             {keys[12], &draft.frames_per_s, false, 0.1, 1000},
             {keys[13], &draft.readout_s, false, 0, kReadoutMax_s}}};
}

Status finish(const Draft& draft, const std::string& file, CameraInfo& info, std::string& message) {
    if (draft.width != std::floor(draft.width) || draft.height != std::floor(draft.height)) {
        return fail(message, file, "width and height must be whole numbers of pixels.");
    }
    if ((draft.width == 0) != (draft.height == 0)) {
        return fail(message, file, "width and height must be given together.");
    }
    if (draft.width > 0 && (draft.cx < -0.5 || draft.cx > draft.width || draft.cy < -0.5 || draft.cy > draft.height)) {
        return fail(message, file,
                    "the principal point (" + number_text(draft.cx) + ", " + number_text(draft.cy) +
                        ") lies outside the image; is this the file of another camera or image size?");
    }
    info.model = {static_cast<std::uint32_t>(draft.width),
                  static_cast<std::uint32_t>(draft.height),
                  draft.fx,
                  draft.fy,
                  draft.cx,
                  draft.cy,
                  draft.k1,
                  draft.k2,
                  draft.p1,
                  draft.p2,
                  draft.k3};
    // A zero has no sign: "-0" would be another camera after it was written and read.
    CameraModel& m = info.model;
    for (double* const value : {&m.cx, &m.cy, &m.k1, &m.k2, &m.p1, &m.p2, &m.k3}) *value += 0.0;
    info.depth_units_per_m = draft.depth_units_per_m;
    info.frames_per_s = draft.frames_per_s;
    info.readout_s = draft.readout_s + 0.0;
    return Status::kOk;
}

Status parse_toml(std::string_view text, const std::string& file, CameraInfo& info, std::string& message) {
    std::vector<TomlEntry> entries;
    STILLMESH_TRY(parse_toml_document(text, file, entries, message));
    Draft draft;
    auto fields = fields_of(draft,
                            {"width", "height", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3",
                             "depth_units_per_m", "frames_per_s", "readout_s"},
                            true);
    for (const auto& [key, value] : entries) {
        const auto field =
            std::find_if(fields.begin(), fields.end(), [&name = key](const Field& f) { return f.key == name; });
        if (field == fields.end()) return unknown_key(key, fields, file, message);
        if (const auto* const number = std::get_if<double>(&value)) {
            STILLMESH_TRY(set_field(*field, *number, file, message));
        } else if (const auto* const whole = std::get_if<std::int64_t>(&value)) {
            STILLMESH_TRY(set_field(*field, static_cast<double>(*whole), file, message));
        } else {
            return fail(message, file, "key " + quoted(key) + " must be a number.");
        }
    }
    STILLMESH_TRY(require_all(fields, file, message));
    return finish(draft, file, info, message);
}

Status yaml_number(const YAML::Node& node, std::string_view key, const std::string& file, double& value,
                   std::string& message) {
    bool is_number = false;
    if (node.IsScalar()) {
        std::string_view text = node.Scalar();
        if (text.starts_with('+')) text.remove_prefix(1);
        if (text == ".nan" || text == ".NaN" || text == ".NAN" || text.ends_with(".inf")) text = "nan";
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        is_number = error == std::errc() && end == text.data() + text.size();
    }
    if (!is_number) return fail(message, file, "key " + quoted(key) + " must be a number.");
    return Status::kOk;
}

// The keys of ORB-SLAM's settings that speak of other things than the camera: read over, knowingly.
[[nodiscard]] bool is_foreign_orb_slam_key(std::string_view key) {
    constexpr std::array<std::string_view, 9> kPrefixes = {"ORBextractor.", "Viewer.", "System.", "IMU.", "Stereo.",
                                                           "LEFT.",         "RIGHT.",  "File.",   "loop"};
    for (const std::string_view prefix : kPrefixes) {
        if (key.starts_with(prefix)) return true;
    }
    constexpr std::array<std::string_view, 7> kKeys = {
        "ThDepth", "Camera.bf", "Camera.RGB", "Camera1.RGB", "Camera2.fx", "Tbc", "PointCloudMapping.Resolution"};
    return std::find(kKeys.begin(), kKeys.end(), key) != kKeys.end();
}

// ORB-SLAM3's names for ORB-SLAM2's keys.
[[nodiscard]] std::string_view orb_slam2_name(std::string_view key) {
    constexpr std::array<std::array<std::string_view, 2>, 10> kRenamed = {{{"Camera1.fx", "Camera.fx"},
                                                                           {"Camera1.fy", "Camera.fy"},
                                                                           {"Camera1.cx", "Camera.cx"},
                                                                           {"Camera1.cy", "Camera.cy"},
                                                                           {"Camera1.k1", "Camera.k1"},
                                                                           {"Camera1.k2", "Camera.k2"},
                                                                           {"Camera1.p1", "Camera.p1"},
                                                                           {"Camera1.p2", "Camera.p2"},
                                                                           {"Camera1.k3", "Camera.k3"},
                                                                           {"RGBD.DepthMapFactor", "DepthMapFactor"}}};
    for (const auto& [from, to] : kRenamed) {
        if (key == from) return to;
    }
    return key;
}

Status parse_orb_slam(const YAML::Node& root, const std::string& file, CameraInfo& info, std::string& message) {
    Draft draft;
    auto fields = fields_of(
        draft,
        {"Camera.width", "Camera.height", "Camera.fx", "Camera.fy", "Camera.cx", "Camera.cy", "Camera.k1", "Camera.k2",
         "Camera.p1", "Camera.p2", "Camera.k3", "DepthMapFactor", "Camera.fps", "Camera.readout_s"},
        false);
    for (const auto& entry : root) {
        if (!entry.first.IsScalar()) return fail(message, file, "a key is not a plain name.");
        const std::string& written = entry.first.Scalar();
        const std::string_view key = orb_slam2_name(written);
        if (is_foreign_orb_slam_key(key)) continue;
        if (key == "Camera.type") {
            const std::string type = entry.second.IsScalar() ? entry.second.Scalar() : std::string();
            if (type != "PinHole" && type != "Pinhole") {
                return fail(message, file, "key 'Camera.type' is " + quoted(type) + "; only 'PinHole' is supported.");
            }
            continue;
        }
        const auto field = std::find_if(fields.begin(), fields.end(), [key](const Field& f) { return f.key == key; });
        if (field == fields.end()) return unknown_key(written, fields, file, message);
        double value = 0;
        STILLMESH_TRY(yaml_number(entry.second, key, file, value, message));
        STILLMESH_TRY(set_field(*field, value, file, message));
    }
    STILLMESH_TRY(require_all(fields, file, message));
    return finish(draft, file, info, message);
}

// The numbers of a matrix: `[...]` itself or a map with `data: [...]` as camera_calibration writes it.
Status yaml_numbers(const YAML::Node& node, const std::string& key, const std::string& file,
                    std::vector<double>& values, std::string& message) {
    YAML::Node list = node;
    if (node.IsMap()) list.reset(node["data"]);
    if (!list.IsDefined() || !list.IsSequence() || list.size() > 16) {
        return fail(message, file, "key " + quoted(key) + " must be a short list of numbers.");
    }
    for (const auto& item : list) {
        double value = 0;
        STILLMESH_TRY(yaml_number(item, key, file, value, message));
        values.push_back(value);
    }
    return Status::kOk;
}

Status parse_ros(const YAML::Node& root, const std::string& file, CameraInfo& info, std::string& message) {
    Draft draft;
    // The first names are what camera_calibration saves, the second what `rostopic echo` prints.
    auto fields = fields_of(draft,
                            {"image_width", "image_height", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3",
                             "depth_units_per_m", "frames_per_s", "readout_s"},
                            true);
    constexpr std::array<std::string_view, 16> kOther = {"camera_name",
                                                         "rectification_matrix",
                                                         "projection_matrix",
                                                         "header",
                                                         "R",
                                                         "r",
                                                         "P",
                                                         "p",
                                                         "binning_x",
                                                         "binning_y",
                                                         "roi",
                                                         "distortion_model",
                                                         "camera_matrix",
                                                         "distortion_coefficients",
                                                         "K",
                                                         "D"};
    for (const auto& entry : root) {
        if (!entry.first.IsScalar()) return fail(message, file, "a key is not a plain name.");
        std::string key = entry.first.Scalar();
        if (key == "width" || key == "height") key = "image_" + key;
        if (key == "camera_matrix" || key == "K" || key == "k") {
            std::vector<double> k;
            STILLMESH_TRY(yaml_numbers(entry.second, key, file, k, message));
            if (k.size() != 9) return fail(message, file, "key " + quoted(key) + " must have 9 numbers.");
            if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
                return fail(
                    message, file,
                    "key " + quoted(key) + " must be [fx 0 cx; 0 fy cy; 0 0 1]; a skewed camera is unknown here.");
            }
            STILLMESH_TRY(set_field(fields[2], k[0], file, message));
            STILLMESH_TRY(set_field(fields[3], k[4], file, message));
            STILLMESH_TRY(set_field(fields[4], k[2], file, message));
            STILLMESH_TRY(set_field(fields[5], k[5], file, message));
            continue;
        }
        if (key == "distortion_coefficients" || key == "D" || key == "d") {
            std::vector<double> d;
            STILLMESH_TRY(yaml_numbers(entry.second, key, file, d, message));
            if (!d.empty() && d.size() != 4 && d.size() != 5) {
                return fail(message, file, "key " + quoted(key) + " must have 4 or 5 numbers (k1 k2 p1 p2 k3).");
            }
            for (std::size_t i = 0; i < d.size(); ++i) STILLMESH_TRY(set_field(fields[6 + i], d[i], file, message));
            continue;
        }
        if (key == "distortion_model") {
            const std::string model = entry.second.IsScalar() ? entry.second.Scalar() : std::string();
            if (model != "plumb_bob") {
                return fail(message, file,
                            "key 'distortion_model' is " + quoted(model) + "; only 'plumb_bob' is supported.");
            }
            continue;
        }
        if (std::find(kOther.begin(), kOther.end(), key) != kOther.end()) continue;
        const auto field = std::find_if(fields.begin(), fields.end(), [&key](const Field& f) { return f.key == key; });
        const bool is_own_key = field != fields.end() && (field < fields.begin() + 2 || field >= fields.begin() + 11);
        if (!is_own_key) {
            std::vector<Field> known(fields.begin(), fields.begin() + 2);
            known.insert(known.end(), fields.begin() + 11, fields.end());
            for (const std::string_view name : kOther) known.push_back({name, nullptr, false, 0, 0});
            return unknown_key(entry.first.Scalar(), known, file, message);
        }
        double value = 0;
        STILLMESH_TRY(yaml_number(entry.second, key, file, value, message));
        STILLMESH_TRY(set_field(*field, value, file, message));
    }
    if (!fields[2].is_seen) return fail(message, file, "key 'camera_matrix' is missing; add it.");
    STILLMESH_TRY(require_all(fields, file, message));
    return finish(draft, file, info, message);
}

// yaml-cpp recurses as deep as the file nests (and has run out of stack on such files): refuse before it sees them.
[[nodiscard]] bool nests_deeply(std::string_view text) {
    int depth = 0;
    std::size_t line_begin = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        if (c == '\n') {
            line_begin = i + 1;
            continue;
        }
        if (c == '[' || c == '{') ++depth;
        if (c == ']' || c == '}') --depth;
        if (depth > 8) return true;
        // "- - - -" and "? ? ?" nest by a letter; no camera file has more than two on a line.
        if ((c == '-' || c == '?' || c == ':') && i + 1 < text.size() && (text[i + 1] == ' ' || text[i + 1] == '\t')) {
            std::size_t marks = 0;
            for (std::size_t j = line_begin; j <= i; ++j) {
                if ((text[j] == '-' || text[j] == '?' || text[j] == ':') &&
                    (text[j + 1] == ' ' || text[j + 1] == '\t')) {
                    ++marks;
                }
            }
            if (marks > 8) return true;
        }
        if (i - line_begin > 200 && text.substr(line_begin, 200).find_first_not_of(' ') == std::string_view::npos) {
            return true;
        }
    }
    return false;
}

Status parse_yaml(std::string_view text, const std::string& file, CameraInfo& info, std::string& message) {
    std::string body(text);
    // OpenCV writes "%YAML:1.0", which is not YAML; the line says nothing we need.
    if (body.starts_with("%YAML:")) body.erase(0, std::min(body.find('\n'), body.size()));
    if (nests_deeply(body)) return fail(message, file, "this is no camera file: it nests too deeply.");
    try {
        const YAML::Node root = YAML::Load(body);
        if (!root.IsMap()) return fail(message, file, "this is no camera file: expected lines like 'Camera.fx: 525'.");
        bool is_ros = false;
        for (const auto& entry : root) {
            if (!entry.first.IsScalar()) continue;
            const std::string& key = entry.first.Scalar();
            is_ros = is_ros || key == "camera_matrix" || key == "K" || key == "k" || key == "image_width" ||
                     key == "distortion_model";
        }
        return is_ros ? parse_ros(root, file, info, message) : parse_orb_slam(root, file, info, message);
    } catch (const YAML::Exception& error) {
        return fail(message, file, "line " + std::to_string(error.mark.line + 1) + " is not YAML: " + error.msg + ".");
    }
}

}  // namespace

std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known) {
    constexpr std::size_t kLengthMax = 64;
    if (name.empty() || name.size() > kLengthMax) return {};
    std::string_view best;
    std::size_t best_distance = std::max<std::size_t>(name.size() / 3, 1) + 1;
    for (const std::string_view candidate : known) {
        if (candidate.size() > kLengthMax) continue;
        // Levenshtein's distance, one row at a time; a capital letter is no difference.
        std::array<std::size_t, kLengthMax + 1> row{};
        for (std::size_t j = 0; j <= candidate.size(); ++j) row[j] = j;
        for (std::size_t i = 1; i <= name.size(); ++i) {
            std::size_t diagonal = row[0];
            row[0] = i;
            for (std::size_t j = 1; j <= candidate.size(); ++j) {
                const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
                const std::size_t change = diagonal + (lower(name[i - 1]) == lower(candidate[j - 1]) ? 0U : 1U);
                diagonal = row[j];
                row[j] = std::min({row[j] + 1, row[j - 1] + 1, change});
            }
        }
        if (row[candidate.size()] < best_distance) {
            best_distance = row[candidate.size()];
            best = candidate;
        }
    }
    return best;
}

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
    if (text.size() > kCalibrationBytesMax) {
        return fail(message, file, "this is no camera file: it is longer than 64 KiB.");
    }
    try {
        CameraInfo parsed;
        STILLMESH_TRY(format == CalibrationFormat::kToml ? parse_toml(text, file, parsed, message)
                                                         : parse_yaml(text, file, parsed, message));
        info = parsed;
        return Status::kOk;
    } catch (const std::exception& error) {  // a library's own: never through our door
        return fail(message, file, std::string("cannot be read: ") + error.what() + ".");
    }
}

Status load_calibration(const std::string& name_or_file, CameraInfo& info, std::string& message) {
    if (const std::optional<CameraInfo> known = built_in_calibration(name_or_file)) {
        info = *known;
        return Status::kOk;
    }
    const bool is_toml = name_or_file.ends_with(".toml");
    const bool is_yaml = name_or_file.ends_with(".yaml") || name_or_file.ends_with(".yml");
    if (!is_toml && !is_yaml) {
        message = name_or_file + ": not a camera file (.toml, .yaml, .yml) and not a known camera (";
        for (const std::string_view name : kNames) message += std::string(name) + (name == kNames.back() ? ")" : ", ");
        const std::string_view nearest = nearest_name(name_or_file, kNames);
        message += nearest.empty() ? "." : "; did you mean " + quoted(nearest) + "?";
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
    const CameraModel& m = info.model;
    return "# camera file of stillmesh: pixels, and depth units per metre\n" + line("width", m.width) +
           line("height", m.height) + line("fx", m.fx) + line("fy", m.fy) + line("cx", m.cx) + line("cy", m.cy) +
           line("k1", m.k1) + line("k2", m.k2) + line("p1", m.p1) + line("p2", m.p2) + line("k3", m.k3) +
           line("depth_units_per_m", info.depth_units_per_m) + line("frames_per_s", info.frames_per_s) +
           (info.readout_s < 0 ? std::string() : line("readout_s", info.readout_s));
}

}  // namespace stillmesh
