#include "hal/calibration/key_names.hpp"

#include <charconv>

namespace stillmesh::camera_keys {

std::string_view without_data(std::string_view key) {
    return key.ends_with(".data") ? key.substr(0, key.size() - 5) : key;
}

std::optional<Number> number_named(std::string_view key) {
    for (std::size_t i = 0; i < kDepthUnits; ++i) {
        if (kNumbers[i].name == key) return static_cast<Number>(i);
    }
    for (const Alias& alias : kAliases) {
        if (alias.key == key) return alias.number;
    }
    if (key == kNumbers[kFps].name) return kFps;
    if (key == kNumbers[kReadout].name) return kReadout;
    return std::nullopt;
}

bool is_core(std::string_view key) {
    const std::string_view plain = without_data(key);
    const auto number = number_named(key);
    return (number && *number >= kFx && *number <= kCy) || holds(kMatrixKeys, plain) || holds(kIntrinsicsKeys, plain);
}

std::string number_text(double value) {
    std::array<char, 64> buffer{};
    const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
    return error == std::errc() ? std::string(buffer.data(), end) : std::string("?");
}

std::string quoted(std::string_view text) {
    return "'" + std::string(text.substr(0, 80)) + "'";
}

std::string lower(std::string_view text) {
    std::string out(text);
    for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    return out;
}

bool names_colour(std::string_view text) {
    const std::string name = lower(text);
    return name.find("color") != std::string::npos || name.find("colour") != std::string::npos ||
           name.find("rgb") != std::string::npos;
}

}  // namespace stillmesh::camera_keys
