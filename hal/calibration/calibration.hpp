// Camera files: what turns pixels into rays and depth units into metres. Reads our own TOML, the YAML, JSON and text
// files of others (camera_keys.hpp names them), and knows the cameras of the TUM benchmark by name. A key that is
// misspelt, missing, not a number or out of its range is an error that names file and key: nothing silently becomes 0.
// Limits: files of at most kCalibrationBytesMax. Cost: some hundred microseconds, once.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "engine/base/status.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh {

inline constexpr std::size_t kCalibrationBytesMax = 64 * 1024;

// kYaml: JSON and files of nothing but numbers, too; which of them is told by the content.
enum class CalibrationFormat { kToml, kYaml };

// `name_or_file` is one of calibration_names() or a file (.toml, .yaml, .yml, .json, .txt). Width and height are 0 when
// the file does not give them: whoever sees the first image fills them in. So are the depth units: whoever plays knows
// them, or asks.
//   kOk    kUnavailable: no such file    kInvalid: its content; `message` is a sentence for the user
[[nodiscard]] Status load_calibration(const std::string& name_or_file, CameraInfo& info, std::string& message);

// The same for bytes in memory; `file` is only used in messages. Any bytes are safe.
[[nodiscard]] Status parse_calibration(std::string_view text, CalibrationFormat format, const std::string& file,
                                       CameraInfo& info, std::string& message);

// tum-fr1, tum-fr2, tum-fr3: the colour cameras of the TUM RGB-D benchmark with the depth factor of their PNGs (5000
// per metre; fr2's depth is 4 % too long with that, so 5208). kinect: ROS's factory default, 5000 per metre. All
// of them read their rows in 26 ms (Ringaby and Forssen, ICCV 2011, of the Kinect's colour camera).
[[nodiscard]] std::optional<CameraInfo> built_in_calibration(std::string_view name);
[[nodiscard]] std::span<const std::string_view> calibration_names();

// The text of a camera.toml that load_calibration reads back to the same bits. The size must be known by then.
[[nodiscard]] std::string calibration_toml(const CameraInfo& info);

// The name a user probably meant, or an empty view: at most a third of the letters may differ.
[[nodiscard]] std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known);

}  // namespace stillmesh
