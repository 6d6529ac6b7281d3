#include "hal/bag/ros_messages.hpp"

#include <bit>
#include <cstring>

namespace stillmesh {
namespace {

constexpr std::size_t kCdrHeadBytes = 4;
constexpr std::uint32_t kCoefficientsMax = 16;
constexpr std::int64_t kRosSecond_ns = 1'000'000'000;

}  // namespace

MessageHeader read_header(MessageReader& reader) noexcept {
    MessageHeader out;
    if (reader.is_ros1()) static_cast<void>(reader.u32());  // the number of the message
    const std::int64_t seconds = reader.u32();
    out.stamp_ns = seconds * kRosSecond_ns + reader.u32();
    out.frame_id = reader.text();
    return out;
}

MessageReader::MessageReader(std::span<const std::uint8_t> bytes, MessageLayout layout) noexcept
    : bytes_(bytes), layout_(layout) {
    if (layout_ != MessageLayout::kCdr) return;
    // Kinds 0 and 1: plain CDR, big and little endian.
    is_ok_ = bytes.size() >= kCdrHeadBytes && bytes[0] == 0 && bytes[1] <= 1;
    is_little_ = is_ok_ && bytes[1] == 1;
    bytes_ = is_ok_ ? bytes.subspan(kCdrHeadBytes) : std::span<const std::uint8_t>{};
}

std::span<const std::uint8_t> MessageReader::take(std::size_t size) noexcept {
    if (!is_ok_ || size > bytes_.size() - at_) {
        is_ok_ = false;
        return {};
    }
    at_ += size;
    return bytes_.subspan(at_ - size, size);
}

std::uint64_t MessageReader::number(std::size_t size) noexcept {
    if (layout_ == MessageLayout::kCdr) static_cast<void>(take((size - at_ % size) % size));
    const std::span<const std::uint8_t> bytes = take(size);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        value |= std::uint64_t{bytes[is_little_ ? i : size - 1 - i]} << (8 * i);
    }
    return value;
}

float MessageReader::f32() noexcept {
    return std::bit_cast<float>(u32());
}

double MessageReader::f64() noexcept {
    return std::bit_cast<double>(number(8));
}

std::string_view MessageReader::text() noexcept {
    const std::span<const std::uint8_t> letters = take(u32());
    std::string_view out(reinterpret_cast<const char*>(letters.data()), letters.size());
    if (layout_ == MessageLayout::kCdr && out.ends_with('\0')) out.remove_suffix(1);
    return out;
}

std::span<const std::uint8_t> MessageReader::bytes() noexcept {
    return take(u32());
}

bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, MessageHeader& out) noexcept {
    MessageReader reader(bytes, layout);
    out = read_header(reader);
    return reader.is_ok();
}

bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, ImageMessage& out) noexcept {
    MessageReader reader(bytes, layout);
    out.header = read_header(reader);
    out.height = reader.u32();
    out.width = reader.u32();
    out.encoding = reader.text();
    out.is_bigendian = reader.u8() != 0;
    out.step = reader.u32();
    out.data = reader.bytes();
    return reader.is_ok();
}

bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, CompressedMessage& out) noexcept {
    MessageReader reader(bytes, layout);
    out.header = read_header(reader);
    out.format = reader.text();
    out.data = reader.bytes();
    return reader.is_ok();
}

bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, CameraInfoMessage& out) {
    MessageReader reader(bytes, layout);
    out.frame_id = read_header(reader).frame_id;
    out.height = reader.u32();
    out.width = reader.u32();
    out.distortion_model = reader.text();
    const std::uint32_t coefficients = reader.u32();
    if (coefficients > kCoefficientsMax) return false;
    out.d.clear();
    for (std::uint32_t i = 0; i < coefficients; ++i) out.d.push_back(reader.f64());
    for (double& value : out.k) value = reader.f64();
    for (int i = 0; i < 9; ++i) static_cast<void>(reader.f64());  // R, of a stereo pair
    for (double& value : out.p) value = reader.f64();
    out.binning_x = reader.u32();
    out.binning_y = reader.u32();
    out.roi_x = reader.u32();
    out.roi_y = reader.u32();
    out.roi_height = reader.u32();
    out.roi_width = reader.u32();
    static_cast<void>(reader.u8());
    return reader.is_ok();
}

bool read_message(std::span<const std::uint8_t> bytes, MessageLayout layout, float& out) noexcept {
    MessageReader reader(bytes, layout);
    out = reader.f32();
    return reader.is_ok();
}

}  // namespace stillmesh
