// Depth as ROS's compressed_depth_image_transport packs it: twelve bytes, then a PNG of 16 bits. What it was of 16UC1
// are millimetres; of 32FC1 metres are a / (value - b), and 0 nothing. Headers alone; any bytes are safe.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

namespace stillmesh {

struct PackedDepth {
    bool is_in_metres = false;
    float a = 0, b = 0;
    std::span<const std::uint8_t> png;
};

[[nodiscard]] inline bool is_png(std::span<const std::uint8_t> bytes) {
    return bytes.size() >= 4 && std::memcmp(bytes.data(), "\x89PNG", 4) == 0;
}
// `format` as the message has it: "16UC1; compressedDepth png". False: it is packed in another way (RVL).
[[nodiscard]] inline bool open_packed_depth(std::string_view format, std::span<const std::uint8_t> bytes,
                                            PackedDepth& out) {
    constexpr std::size_t kHeadBytes = 12;  // a number, a and b, little-endian
    if (bytes.size() < kHeadBytes || !is_png(bytes.subspan(kHeadBytes))) return false;
    const auto number_at = [bytes](std::size_t at) {
        return std::bit_cast<float>(bytes[at] | std::uint32_t{bytes[at + 1]} << 8U |
                                    std::uint32_t{bytes[at + 2]} << 16U | std::uint32_t{bytes[at + 3]} << 24U);
    };
    out = {format.starts_with("32FC1"), number_at(4), number_at(8), bytes.subspan(kHeadBytes)};
    return true;
}
// A value of its PNG, in units. Nearer than half a unit, farther than 65535 or no number: 0.
[[nodiscard]] inline std::uint16_t units_of_packed(float a, float b, std::uint16_t value, double units_per_m) {
    const double metres = value == 0 ? 0 : double{a} / (static_cast<double>(value) - double{b});
    const double units = metres * units_per_m + 0.5;
    return units >= 1 && units < 65536 ? static_cast<std::uint16_t>(units) : std::uint16_t{0};
}

}  // namespace stillmesh
