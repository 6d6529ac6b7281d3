// Three messages of MAVLink 2, byte by byte: HEARTBEAT (0), VISION_POSITION_ESTIMATE (102), ODOMETRY (331). Numbers,
// fields and their order on the wire, the checksum and its seeds are those of the public definitions (mavlink.io:
// minimal.xml, common.xml, "Packet Serialization"). Not signed.
//
// Each call writes into the object's own bytes, which the next one replaces. Memory: 300 bytes; no heap. Some 2 us a
// message, most of it the checksum.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace stillmesh {

// The upper triangle of a 6x6 matrix, row by row: x, y, z, roll, pitch, yaw, or their speeds.
using MavlinkCovariance = std::array<float, 21>;

// ODOMETRY: a pose in MAV_FRAME_LOCAL_FRD, speeds in MAV_FRAME_BODY_FRD.
struct MavlinkOdometry {
    std::uint64_t time_us = 0;
    std::array<float, 3> position_m{};
    std::array<float, 4> rotation_wxyz{1, 0, 0, 0};
    std::array<float, 3> velocity_m_s{}, turn_rad_s{};
    MavlinkCovariance pose_covariance{}, velocity_covariance{};
    std::uint8_t reset_counter = 0;
    std::int8_t quality_percent = 0;
};

// VISION_POSITION_ESTIMATE: the same pose, as roll, pitch and yaw.
struct MavlinkVision {
    std::uint64_t time_us = 0;
    std::array<float, 3> position_m{}, roll_pitch_yaw_rad{};
    MavlinkCovariance covariance{};
    std::uint8_t reset_counter = 0;
};

class MavlinkMessages {
public:
    // As which vehicle's part we speak: MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY of it.
    explicit MavlinkMessages(std::uint8_t system) : system_(system) {}

    // A companion computer that works.
    [[nodiscard]] std::string_view heartbeat();
    [[nodiscard]] std::string_view odometry(const MavlinkOdometry& of);
    [[nodiscard]] std::string_view vision(const MavlinkVision& of);

private:
    static constexpr std::size_t kHeadBytes = 10, kPayloadMax = 255, kChecksumBytes = 2;

    void put(const void* value, std::size_t bytes);
    template <typename Value>
    void put(const Value& value) {
        put(&value, sizeof value);
    }
    [[nodiscard]] std::string_view finished(std::uint32_t number, std::uint8_t seed);

    std::uint8_t system_;
    std::uint8_t sequence_ = 0;
    std::size_t payload_bytes_ = 0;
    std::array<std::uint8_t, kHeadBytes + kPayloadMax + kChecksumBytes> bytes_{};
};

}  // namespace stillmesh
