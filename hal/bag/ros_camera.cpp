#include "hal/bag/ros_camera.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <span>
#include <string_view>

#include "hal/calibration/calibration.hpp"
#include "hal/replay/one_view.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] std::string number_text(double value) {
    std::array<char, 64> buffer{};
    const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return error == std::errc() && std::isfinite(value) ? std::string(buffer.data(), end) : std::string(".nan");
}
[[nodiscard]] std::string list_of(std::span<const double> values) {
    std::string out = "[";
    for (const double value : values) out += (out.size() > 1 ? ", " : "") + number_text(value);
    return out + "]";
}

// Letters that cannot end a text of YAML.
[[nodiscard]] std::string name_of(std::string_view text) {
    std::string out;
    for (const char c : text.substr(0, 64)) {
        const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
                              c == '-' || c == ' ';
        out += is_plain ? c : '?';
    }
    return out;
}

}  // namespace

Status camera_of_message(const CameraInfoMessage& from, const std::string& topic, bool is_rectified, CameraInfo& info,
                         std::string& message) {
    const std::string source = "topic " + topic;
    const bool is_whole = (from.roi_x == 0 && from.roi_y == 0) &&
                          (from.roi_width == 0 || from.roi_width == from.width) &&
                          (from.roi_height == 0 || from.roi_height == from.height);
    if (!is_whole || from.binning_x > 1 || from.binning_y > 1) {
        message = source + ": its images are binned or a part of the picture (binning " +
                  std::to_string(from.binning_x) + "x" + std::to_string(from.binning_y) + ", roi " +
                  std::to_string(from.roi_width) + "x" + std::to_string(from.roi_height) + " at " +
                  std::to_string(from.roi_x) + "," + std::to_string(from.roi_y) +
                  "); give the camera of the images as they are with --calibration.";
        return Status::kInvalid;
    }
    std::string text = "height: " + std::to_string(from.height) + "\nwidth: " + std::to_string(from.width) + "\n";
    const auto& p = from.p;
    if (is_rectified && p[0] != 0) {
        const double k[] = {p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]};
        text += "K: " + list_of(k) + "\n";
    } else {
        text += "K: " + list_of(from.k) + "\n";
        if (!from.distortion_model.empty()) text += "distortion_model: '" + name_of(from.distortion_model) + "'\n";
        const bool is_straight = std::all_of(from.d.begin(), from.d.end(), [](double d) { return d == 0; });
        if (!is_straight || !from.distortion_model.empty()) text += "D: " + list_of(from.d) + "\n";
    }
    return parse_calibration(text, CalibrationFormat::kYaml, source, info, message);
}

bool is_same_view(const CameraInfoMessage& one, const CameraInfoMessage& other) {
    const auto lens_of = [](const CameraInfoMessage& of) {
        CameraModel lens;
        lens.width = of.width;
        lens.height = of.height;
        lens.fx = of.k[0];
        lens.fy = of.k[4];
        lens.cx = of.k[2];
        lens.cy = of.k[5];
        return lens;
    };
    return is_same_view(lens_of(one), lens_of(other));
}

}  // namespace stillmesh
