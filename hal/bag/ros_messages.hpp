// The messages of ROS that a camera's recording consists of, read in place: sensor_msgs Image, CompressedImage and
// CameraInfo, std_msgs Float32; transforms are read in frame_messages.hpp. ROS 1 and the CDR of ROS 2 have the same
// fields in the same order; what differs is how a number is aligned, whether texts end with a zero, and a header's
// number in front. Sources: the message definitions and wiki.ros.org/ROS/Technical%20Overview of ROS, OMG DDSI-RTPS 9.3
// and 10 for CDR. Nothing is copied: views last as long as the bytes. Any bytes are safe.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace stillmesh {

enum class MessageLayout : std::uint8_t { kRos1, kCdr };

inline constexpr std::string_view kImageType = "sensor_msgs/Image";
inline constexpr std::string_view kCompressedType = "sensor_msgs/CompressedImage";
inline constexpr std::string_view kCameraInfoType = "sensor_msgs/CameraInfo";
inline constexpr std::string_view kFloatType = "std_msgs/Float32";
inline constexpr std::string_view kTransformsType = "tf2_msgs/TFMessage";
inline constexpr std::string_view kOldTransformsType = "tf/tfMessage";
inline constexpr std::string_view kTransformType = "geometry_msgs/Transform";

[[nodiscard]] constexpr bool is_image_type(std::string_view type) noexcept {
    return type == kImageType || type == kCompressedType;
}
[[nodiscard]] constexpr bool is_read_type(std::string_view type) noexcept {
    return is_image_type(type) || type == kCameraInfoType || type == kFloatType || type == kTransformsType ||
           type == kOldTransformsType || type == kTransformType;
}

// Fields, one after the other. A reader that ran out stays failed and gives zeros.
class MessageReader {
public:
    MessageReader(std::span<const std::uint8_t> bytes, MessageLayout layout) noexcept;
    [[nodiscard]] bool is_ok() const noexcept { return is_ok_; }
    [[nodiscard]] std::uint8_t u8() noexcept { return static_cast<std::uint8_t>(number(1)); }
    [[nodiscard]] std::uint32_t u32() noexcept { return static_cast<std::uint32_t>(number(4)); }
    [[nodiscard]] float f32() noexcept;
    [[nodiscard]] double f64() noexcept;
    [[nodiscard]] std::string_view text() noexcept;
    [[nodiscard]] std::span<const std::uint8_t> bytes() noexcept;  // a list of bytes
    [[nodiscard]] bool is_ros1() const noexcept { return layout_ == MessageLayout::kRos1; }

private:
    [[nodiscard]] std::uint64_t number(std::size_t size) noexcept;
    [[nodiscard]] std::span<const std::uint8_t> take(std::size_t size) noexcept;

    std::span<const std::uint8_t> bytes_;  // behind the head of CDR, from which numbers are aligned
    std::size_t at_ = 0;
    MessageLayout layout_;
    bool is_little_ = true;
    bool is_ok_ = true;
};

struct MessageHeader {
    std::int64_t stamp_ns = 0;  // 0: not given
    std::string_view frame_id;
};

struct ImageMessage {
    MessageHeader header;
    std::uint32_t height = 0;  // px
    std::uint32_t width = 0;   // px
    std::string_view encoding;
    bool is_bigendian = false;
    std::uint32_t step = 0;  // bytes from row to row
    std::span<const std::uint8_t> data;
};

struct CompressedMessage {
    MessageHeader header;
    std::string_view format;
    std::span<const std::uint8_t> data;
};

// Kept longer than its bytes.
struct CameraInfoMessage {
    std::string frame_id;
    std::uint32_t height = 0;  // px
    std::uint32_t width = 0;   // px
    std::string distortion_model;
    std::vector<double> d;  // at most 16
    std::array<double, 9> k{};
    std::array<double, 12> p{};
    std::uint32_t binning_x = 0, binning_y = 0;
    std::uint32_t roi_x = 0, roi_y = 0, roi_height = 0, roi_width = 0;
};

[[nodiscard]] MessageHeader read_header(MessageReader& reader) noexcept;

// False: the bytes are no such message.
[[nodiscard]] bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, ImageMessage& out) noexcept;
[[nodiscard]] bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout,
                                CompressedMessage& out) noexcept;
[[nodiscard]] bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, CameraInfoMessage& out);
[[nodiscard]] bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, float& out) noexcept;
// What Image, CompressedImage and CameraInfo begin with.
[[nodiscard]] bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, MessageHeader& out) noexcept;

}  // namespace stillmesh
