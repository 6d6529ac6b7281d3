// A camera file of any kind as a flat list of keys and words, with their lines: YAML as OpenCV, ROS and Kalibr write it
// (several documents, "%YAML:1.0", no blank behind a colon), JSON, our own TOML, and text files of nothing but numbers.
// One place knows the YAML library, and none of its types or exceptions leaves it. Any bytes are safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"

namespace stillmesh {

struct CameraEntry {
    std::string key;                 // maps joined with points: "cam0.intrinsics"; a list's place is a number
    std::vector<std::string> words;  // one, or those of a list; lists of lists one behind the other
    std::size_t line = 0;            // from 1; 0: not known
};

// "file, line 3: sentence"; line 0: "file: sentence".
[[nodiscard]] std::string camera_file_message(const std::string& file, std::size_t line, const std::string& sentence);

// In the order of the file. kInvalid: neither YAML nor JSON nor numbers; `message` names file, line and problem.
[[nodiscard]] Status read_yaml_entries(std::string_view text, const std::string& file,
                                       std::vector<CameraEntry>& entries, std::string& message);
// Sorted by key, without lines.
[[nodiscard]] Status read_toml_entries(std::string_view text, const std::string& file,
                                       std::vector<CameraEntry>& entries, std::string& message);

}  // namespace stillmesh
