// MAVLink 2 read by another hand than platform/mavlink: lengths, checksums and fields by tables that are written as the
// public definitions are (name and type, in their order), from which the order on the wire and the checksum's seed
// follow by MAVLink's rules.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stillmesh::test {

struct MavlinkField {
    std::string type, name;
    std::size_t count = 1;
    bool is_extension = false;
    [[nodiscard]] std::size_t size() const {
        if (type == "uint64_t") return 8;
        return type == "float" || type == "uint32_t" ? 4 : 1;
    }
};
struct MavlinkDefinition {
    std::string name;
    std::vector<MavlinkField> fields;  // as the definitions list them
    [[nodiscard]] std::vector<MavlinkField> on_wire() const {
        std::vector<MavlinkField> out = fields;
        const auto extensions =
            std::stable_partition(out.begin(), out.end(), [](const MavlinkField& f) { return !f.is_extension; });
        std::stable_sort(out.begin(), extensions,
                         [](const MavlinkField& a, const MavlinkField& b) { return a.size() > b.size(); });
        return out;
    }
};

inline const std::map<std::uint32_t, MavlinkDefinition>& mavlink_definitions() {
    static const std::map<std::uint32_t, MavlinkDefinition> all = {{0,
                                                                    {"HEARTBEAT",
                                                                     {{"uint8_t", "type"},
                                                                      {"uint8_t", "autopilot"},
                                                                      {"uint8_t", "base_mode"},
                                                                      {"uint32_t", "custom_mode"},
                                                                      {"uint8_t", "system_status"},
                                                                      {"uint8_t", "mavlink_version"}}}},
                                                                   {102,
                                                                    {"VISION_POSITION_ESTIMATE",
                                                                     {{"uint64_t", "usec"},
                                                                      {"float", "x"},
                                                                      {"float", "y"},
                                                                      {"float", "z"},
                                                                      {"float", "roll"},
                                                                      {"float", "pitch"},
                                                                      {"float", "yaw"},
                                                                      {"float", "covariance", 21, true},
                                                                      {"uint8_t", "reset_counter", 1, true}}}},
                                                                   {331,
                                                                    {"ODOMETRY",
                                                                     {{"uint64_t", "time_usec"},
                                                                      {"uint8_t", "frame_id"},
                                                                      {"uint8_t", "child_frame_id"},
                                                                      {"float", "x"},
                                                                      {"float", "y"},
                                                                      {"float", "z"},
                                                                      {"float", "q", 4},
                                                                      {"float", "vx"},
                                                                      {"float", "vy"},
                                                                      {"float", "vz"},
                                                                      {"float", "rollspeed"},
                                                                      {"float", "pitchspeed"},
                                                                      {"float", "yawspeed"},
                                                                      {"float", "pose_covariance", 21},
                                                                      {"float", "velocity_covariance", 21},
                                                                      {"uint8_t", "reset_counter", 1, true},
                                                                      {"uint8_t", "estimator_type", 1, true},
                                                                      {"int8_t", "quality", 1, true}}}}};
    return all;
}

struct MavlinkRead {
    std::uint32_t number = 0;
    std::uint8_t sequence = 0, system = 0, component = 0;
    std::map<std::string, std::vector<double>> fields;
    [[nodiscard]] double at(const std::string& name, std::size_t i = 0) const { return fields.at(name).at(i); }
};

// By a table of 256, as the others do it bit by bit.
[[nodiscard]] inline std::uint16_t mavlink_crc(std::string_view bytes, std::uint16_t crc = 0xFFFF) {
    for (const char byte : bytes) {
        std::uint16_t entry = static_cast<std::uint16_t>((crc ^ static_cast<std::uint8_t>(byte)) & 0xFF);
        entry = static_cast<std::uint16_t>(entry ^ (entry << 4 & 0xFF));
        crc = static_cast<std::uint16_t>(crc >> 8 ^ entry << 8 ^ entry << 3 ^ entry >> 4);
    }
    return crc;
}
// What the checksum ends with: made of the names and types, so that both ends mean the same fields.
[[nodiscard]] inline std::uint8_t mavlink_seed(const MavlinkDefinition& definition) {
    std::uint16_t crc = mavlink_crc(definition.name + " ");
    for (const MavlinkField& field : definition.on_wire()) {
        if (field.is_extension) continue;
        crc = mavlink_crc(field.type + " " + field.name + " ", crc);
        if (field.count > 1) crc = mavlink_crc(std::string(1, static_cast<char>(field.count)), crc);
    }
    return static_cast<std::uint8_t>((crc & 0xFF) ^ (crc >> 8));
}

template <typename Value>
[[nodiscard]] double mavlink_value(const char* at) {
    Value value;
    std::memcpy(&value, at, sizeof value);
    return static_cast<double>(value);
}

// One message, the whole of `bytes`; nothing: it is none, with `why`.
[[nodiscard]] inline std::optional<MavlinkRead> read_mavlink(std::string_view bytes, std::string& why) {
    const auto byte = [&bytes](std::size_t i) { return static_cast<std::uint8_t>(bytes[i]); };
    if (bytes.size() < 12 || byte(0) != 0xFD) return why = "no MAVLink 2", std::nullopt;
    if (bytes.size() != 12U + byte(1)) return why = "another length", std::nullopt;
    if (byte(2) != 0 || byte(3) != 0) return why = "flags", std::nullopt;
    MavlinkRead out{
        byte(7) | std::uint32_t{byte(8)} << 8U | std::uint32_t{byte(9)} << 16U, byte(4), byte(5), byte(6), {}};
    const auto found = mavlink_definitions().find(out.number);
    if (found == mavlink_definitions().end()) return why = "an unknown message", std::nullopt;
    const char seed = static_cast<char>(mavlink_seed(found->second));
    const std::uint16_t crc = mavlink_crc({&seed, 1}, mavlink_crc(bytes.substr(1, 9U + byte(1))));
    if (crc != (byte(bytes.size() - 2) | byte(bytes.size() - 1) << 8)) return why = "the checksum", std::nullopt;
    if (byte(1) > 1 && byte(9U + byte(1)) == 0) return why = "a zero at the end", std::nullopt;
    std::string payload(bytes.substr(10, byte(1)));
    payload.resize(255);  // what was left out is zero
    std::size_t at = 0;
    for (const MavlinkField& field : found->second.on_wire()) {
        for (std::size_t i = 0; i < field.count; ++i, at += field.size()) {
            const char* const here = payload.data() + at;
            out.fields[field.name].push_back(field.type == "float"      ? mavlink_value<float>(here)
                                             : field.type == "uint64_t" ? mavlink_value<std::uint64_t>(here)
                                             : field.type == "uint32_t" ? mavlink_value<std::uint32_t>(here)
                                             : field.type == "int8_t"   ? mavlink_value<std::int8_t>(here)
                                                                        : mavlink_value<std::uint8_t>(here));
        }
    }
    return out;
}

}  // namespace stillmesh::test
