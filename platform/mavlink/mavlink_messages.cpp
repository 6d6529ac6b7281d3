#include "platform/mavlink/mavlink_messages.hpp"

#include <bit>
#include <cstring>

namespace stillmesh {
namespace {

// Fields go out as they lie in memory.
static_assert(std::endian::native == std::endian::little);

constexpr std::uint8_t kStart = 0xFD;                  // of MAVLink 2
constexpr std::uint8_t kVisualOdometry = 197;          // MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
constexpr std::uint8_t kOnboardController = 18;        // MAV_TYPE
constexpr std::uint8_t kNoAutopilot = 8;               // MAV_AUTOPILOT_INVALID
constexpr std::uint8_t kActive = 4;                    // MAV_STATE
constexpr std::uint8_t kVersion = 3;                   // of the heartbeat
constexpr std::uint8_t kLocalFrd = 20, kBodyFrd = 12;  // MAV_FRAME
constexpr std::uint8_t kVision = 2;                    // MAV_ESTIMATOR_TYPE

// CRC-16/MCRF4XX, which MAVLink calls X.25.
[[nodiscard]] std::uint16_t checksum(std::uint16_t crc, std::uint8_t byte) {
    std::uint32_t bits = (crc ^ byte) & 0xFFU;
    for (int i = 0; i < 8; ++i) bits = (bits & 1U) != 0 ? bits >> 1U ^ 0x8408U : bits >> 1U;
    return static_cast<std::uint16_t>(crc >> 8U ^ bits);
}

}  // namespace

void MavlinkMessages::put(const void* value, std::size_t bytes) {
    std::memcpy(bytes_.data() + kHeadBytes + payload_bytes_, value, bytes);
    payload_bytes_ += bytes;
}

std::string_view MavlinkMessages::finished(std::uint32_t number, std::uint8_t seed) {
    // Zeros at the end stay at home; one byte goes out always.
    while (payload_bytes_ > 1 && bytes_[kHeadBytes + payload_bytes_ - 1] == 0) --payload_bytes_;
    const auto byte_of = [number](unsigned at) { return static_cast<std::uint8_t>(number >> 8U * at); };
    const std::array<std::uint8_t, kHeadBytes> head = {kStart,
                                                       static_cast<std::uint8_t>(payload_bytes_),
                                                       0,
                                                       0,
                                                       sequence_++,
                                                       system_,
                                                       kVisualOdometry,
                                                       byte_of(0),
                                                       byte_of(1),
                                                       byte_of(2)};
    std::memcpy(bytes_.data(), head.data(), head.size());
    std::uint16_t crc = 0xFFFF;
    for (std::size_t i = 1; i < kHeadBytes + payload_bytes_; ++i) crc = checksum(crc, bytes_[i]);
    crc = checksum(crc, seed);
    std::memcpy(bytes_.data() + kHeadBytes + payload_bytes_, &crc, sizeof crc);
    const std::size_t size = kHeadBytes + payload_bytes_ + kChecksumBytes;
    payload_bytes_ = 0;
    return {reinterpret_cast<const char*>(bytes_.data()), size};
}

std::string_view MavlinkMessages::heartbeat() {
    constexpr std::uint32_t kMode = 0;
    put(kMode);
    for (const std::uint8_t byte : {kOnboardController, kNoAutopilot, std::uint8_t{0}, kActive, kVersion}) put(byte);
    return finished(0, 50);
}

std::string_view MavlinkMessages::odometry(const MavlinkOdometry& of) {
    put(of.time_us);
    put(of.position_m);
    put(of.rotation_wxyz);
    put(of.velocity_m_s);
    put(of.turn_rad_s);
    put(of.pose_covariance);
    put(of.velocity_covariance);
    for (const std::uint8_t byte : {kLocalFrd, kBodyFrd, of.reset_counter, kVision}) put(byte);
    put(of.quality_percent);
    return finished(331, 91);
}

std::string_view MavlinkMessages::vision(const MavlinkVision& of) {
    put(of.time_us);
    put(of.position_m);
    put(of.roll_pitch_yaw_rad);
    put(of.covariance);
    put(of.reset_counter);
    return finished(102, 158);
}

}  // namespace stillmesh
