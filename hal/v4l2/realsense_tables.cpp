#include "hal/v4l2/realsense_tables.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <optional>

#include "engine/base/crc.hpp"

namespace stillmesh::v4l2 {
namespace {

constexpr double kRotationOff = 1e-3;  // of a table of floats
constexpr std::uint16_t kMagic = 0xcdab;
constexpr std::uint16_t kCommandBytes = 24;           // the whole command: two words of head, a code, four parameters
constexpr std::size_t kLengthAt = kMessageBytes - 4;  // the answer's last word: bytes behind the echo
constexpr std::size_t kHeadBytes = 16;                // of a table; its size stands at 4, its checksum at 12

using Bytes = std::span<const std::uint8_t>;

[[nodiscard]] std::uint32_t word_at(Bytes bytes, std::size_t at) noexcept {
    std::uint32_t word = 0;
    for (std::size_t i = 0; i < 4; ++i) word |= std::uint32_t{bytes[at + i]} << (8 * i);
    return word;
}
[[nodiscard]] std::uint32_t half_at(Bytes bytes, std::size_t at) noexcept {
    return static_cast<std::uint32_t>(bytes[at] | bytes[at + 1] << 8);
}
[[nodiscard]] double float_at(Bytes bytes, std::size_t at) noexcept {
    return static_cast<double>(std::bit_cast<float>(word_at(bytes, at)));
}

void put_word(Message& message, std::size_t at, std::uint32_t word) noexcept {
    for (std::size_t i = 0; i < 4; ++i) message[at + i] = static_cast<std::uint8_t>(word >> (8 * i));
}

// The table without what follows it, if its checksum is right: over all behind the head. How long it is, firmwares say
// in three ways: by the answer's length, or in the head, with the head or without.
[[nodiscard]] std::optional<Bytes> checked(Bytes table) noexcept {
    if (table.size() < kHeadBytes) return std::nullopt;
    const std::uint32_t size = word_at(table, 4);
    const std::uint32_t sum = word_at(table, 12);
    for (const std::size_t length : {table.size(), std::size_t{size}, size + kHeadBytes}) {
        if (length <= kHeadBytes || length > table.size()) continue;
        const Bytes whole = table.first(length);
        if (crc32(std::as_bytes(whole.subspan(kHeadBytes))) == sum) return whole;
    }
    return std::nullopt;
}

Status refuse(std::string& message, const char* why) {
    message = why;
    return Status::kCorrupt;
}

[[nodiscard]] bool is_plausible(const CameraModel& model) noexcept {
    const auto within = [](double value, double least, double most) { return value >= least && value <= most; };
    for (const double k : {model.k1, model.k2, model.p1, model.p2, model.k3}) {
        if (!within(k, -10, 10)) return false;
    }
    return within(model.fx, 0.2 * model.width, 5.0 * model.width) &&
           within(model.fy, 0.2 * model.height, 5.0 * model.height) && within(model.cx, 0, model.width) &&
           within(model.cy, 0, model.height);
}

// Sizes in the order of the depth table's entries; 0: reserved.
struct Size {
    std::uint32_t width, height;
};
constexpr std::array<Size, 13> kRectified{{{1920, 1080},
                                           {1280, 720},
                                           {640, 480},
                                           {848, 480},
                                           {640, 360},
                                           {424, 240},
                                           {320, 240},
                                           {480, 270},
                                           {1280, 800},
                                           {960, 540},
                                           {0, 0},
                                           {0, 0},
                                           {640, 400}}};
constexpr std::size_t kRectifiedAt = 256;  // four floats each: fx, fy, cx, cy

constexpr std::size_t kIntrinsicAt = 16;        // 3x3 floats by rows, -1 to 1 from border to border
constexpr std::size_t kDistortionAt = 52;       // k1, k2, p1, p2, k3
constexpr std::size_t kCalibratedSizeAt = 144;  // two half words
constexpr std::size_t kRotationAt = 184;        // 3x3 floats by rows: colour from depth
constexpr std::size_t kTranslationAt = 220;     // mm, of the depth camera's frame
constexpr std::size_t kColourBytes = kTranslationAt + 12;

// Focal lengths and centre in px of normalised ones, for an image of that size.
void in_pixels(double width, double height, CameraModel& k) noexcept {
    k.fx *= width / 2;
    k.fy *= height / 2;
    k.cx = (k.cx + 1) * width / 2;
    k.cy = (k.cy + 1) * height / 2;
}

// An image that is scaled until it covers the other size, then cut on both sides.
void scale_and_cut(double from_width, double from_height, double to_width, double to_height, CameraModel& k) noexcept {
    const double scale = std::max(to_width / from_width, to_height / from_height);
    k.fx *= scale;
    k.fy *= scale;
    k.cx = k.cx * scale - (from_width * scale - to_width) / 2;
    k.cy = k.cy * scale - (from_height * scale - to_height) / 2;
}

// The D405 takes colour from its left depth sensor, and its processor scales and cuts in its own way.
void fit_d405(double calibrated_width, double calibrated_height, CameraModel& k) noexcept {
    if (k.width == 1280 && k.height == 720) {
        in_pixels(1280, 720, k);
    } else if (k.width == 640 && k.height == 480) {
        k.fy *= calibrated_height / 800;
        k.cy *= calibrated_height / 800;
        in_pixels(1280, 800, k);
        scale_and_cut(1280, 800, 770, 480, k);
        k.cx -= 65;
    } else {
        in_pixels(calibrated_width, calibrated_height, k);
        scale_and_cut(calibrated_width, calibrated_height, k.width, k.height, k);
    }
}

// The others cut the image of the calibration's shape at its sides, or above and below.
void fit_shape(double calibrated_width, double calibrated_height, CameraModel& k) noexcept {
    const double shape = calibrated_height / calibrated_width;
    const double wanted = static_cast<double>(k.height) / k.width;
    if (wanted < shape) {
        k.fy *= shape / wanted;
        k.cy *= shape / wanted;
    } else {
        k.fx *= wanted / shape;
        k.cx *= wanted / shape;
    }
    in_pixels(k.width, k.height, k);
}

}  // namespace

const char* realsense_name(std::uint16_t vendor_id, std::uint16_t product_id) noexcept {
    if (vendor_id != kRealSenseVendor) return nullptr;
    switch (product_id) {
        case kD405: return "RealSense D405";
        case kD415: return "RealSense D415";
        case kD435: return "RealSense D435";
        case kD435i: return "RealSense D435i";
        case kD455: return "RealSense D455";
        default: return nullptr;
    }
}

Message command_message(Command command, std::uint32_t parameter) noexcept {
    Message message{};
    put_word(message, 0, std::uint32_t{kMagic} << 16 | (kCommandBytes - 4U));
    put_word(message, 4, static_cast<std::uint32_t>(command));
    put_word(message, 8, parameter);
    return message;
}

Status answer_body(Command command, std::span<const std::uint8_t, kMessageBytes> answer, Bytes& body,
                   std::string& message) {
    const std::uint32_t echo = word_at(answer, 0);
    if (echo != static_cast<std::uint32_t>(command)) {
        char text[96];
        std::snprintf(text, sizeof(text), "command 0x%02x is answered with %d", static_cast<unsigned>(command),
                      static_cast<int>(echo));
        message = text;
        return Status::kCorrupt;
    }
    const std::uint32_t length = word_at(answer, kLengthAt);
    body = Bytes(answer).subspan(4, length > 0 && length <= kLengthAt - 4 ? length : kLengthAt - 4);
    return Status::kOk;
}

Status parse_details(Bytes body, DeviceDetails& details, std::string& message) {
    constexpr std::size_t kFirmwareAt = 12, kSerialAt = 48, kSerialBytes = 6;
    if (body.size() < kSerialAt + kSerialBytes) return refuse(message, "the camera's details are cut off");
    details = {};
    for (std::size_t i = 4; i-- > 0;) {
        details.firmware += std::to_string(body[kFirmwareAt + i]) + (i > 0 ? "." : "");
    }
    for (std::size_t i = 0; i < kSerialBytes; ++i) {
        char text[4];
        std::snprintf(text, sizeof(text), "%02x", static_cast<unsigned>(body[kSerialAt + i]));
        details.serial += text;
    }
    return Status::kOk;
}

Status parse_depth_units(Bytes body, double& depth_units_per_m, std::string& message) {
    const std::uint32_t unit_um = body.size() >= 4 ? word_at(body, 0) : 0;
    if (unit_um < 1 || unit_um > 10'000) return refuse(message, "the camera's depth unit makes no sense");
    depth_units_per_m = 1e6 / unit_um;
    return Status::kOk;
}

Status parse_depth_table(Bytes table, CameraModel& model, std::string& message) {
    const std::optional<Bytes> whole = checked(table);
    if (!whole) return refuse(message, "the depth calibration has another checksum than its bytes");
    const auto same = std::find_if(kRectified.begin(), kRectified.end(), [&model](const Size& size) {
        return size.width == model.width && size.height == model.height;
    });
    // Sizes that have no entry are the largest one's, scaled.
    const auto entry = same == kRectified.end() ? std::size_t{0} : static_cast<std::size_t>(same - kRectified.begin());
    const std::size_t at = kRectifiedAt + 16 * entry;
    if (whole->size() < at + 16) return refuse(message, "the depth calibration is cut off");
    const double right = static_cast<double>(model.width) / kRectified[entry].width;
    const double down = static_cast<double>(model.height) / kRectified[entry].height;
    CameraModel read;
    read.width = model.width;
    read.height = model.height;
    read.fx = float_at(*whole, at) * right;
    read.fy = float_at(*whole, at + 4) * down;
    read.cx = float_at(*whole, at + 8) * right;
    read.cy = float_at(*whole, at + 12) * down;
    if (!is_plausible(read)) return refuse(message, "the depth calibration holds numbers that no camera has");
    model = read;
    return Status::kOk;
}

Status parse_colour_table(Bytes table, std::uint16_t product_id, CameraModel& model, RigidTransform& colour_from_depth,
                          std::string& message) {
    const std::optional<Bytes> whole = checked(table);
    if (!whole) return refuse(message, "the colour calibration has another checksum than its bytes");
    if (whole->size() < kColourBytes) return refuse(message, "the colour calibration is cut off");
    CameraModel read;
    read.width = model.width;
    read.height = model.height;
    read.fx = float_at(*whole, kIntrinsicAt);
    read.cx = float_at(*whole, kIntrinsicAt + 8);
    read.fy = float_at(*whole, kIntrinsicAt + 16);
    read.cy = float_at(*whole, kIntrinsicAt + 20);
    double* const distortion[] = {&read.k1, &read.k2, &read.p1, &read.p2, &read.k3};
    for (std::size_t i = 0; i < 5; ++i) *distortion[i] = float_at(*whole, kDistortionAt + 4 * i);
    std::uint32_t width = half_at(*whole, kCalibratedSizeAt), height = half_at(*whole, kCalibratedSizeAt + 2);
    if (width == 0 || height == 0) width = 1280, height = 720;  // old ones do not say
    if (product_id == kD405) {
        fit_d405(width, height, read);
    } else {
        fit_shape(width, height, read);
    }
    if (!is_plausible(read)) return refuse(message, "the colour calibration holds numbers that no camera has");
    RotationMatrix r{};
    double t_m[3] = {};
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) r[3 * i + j] = float_at(*whole, kRotationAt + 4 * (3 * i + j));
        t_m[i] = 1e-3 * float_at(*whole, kTranslationAt + 4 * i);
    }
    if (!is_rotation(r, kRotationOff) || !(std::abs(t_m[0]) + std::abs(t_m[1]) + std::abs(t_m[2]) < 1)) {
        return refuse(message, "the colour calibration places the colour camera where none is");
    }
    RigidTransform pose;
    write_quaternion(r, pose.rotation_xyzw);
    const std::array<double, 3> place = rotated(pose, {t_m[0], t_m[1], t_m[2]});
    std::copy_n(place.begin(), 3, pose.translation_m);
    model = read;
    colour_from_depth = pose;
    return Status::kOk;
}

void nominal_depth(std::uint16_t product_id, CameraModel& model, RigidTransform& colour_from_depth) noexcept {
    const double degrees = product_id == kD415 ? 65 : product_id == kD405 ? 84 : 87;
    // That of the widest image, 16:9; a higher one is cut at its sides.
    const double width = std::max(static_cast<double>(model.width), model.height * 16.0 / 9);
    model.fx = model.fy = width / 2 / std::tan(degrees / 2 * 3.14159265358979 / 180);
    model.cx = (model.width - 1) / 2.0;
    model.cy = (model.height - 1) / 2.0;
    colour_from_depth = {};
    colour_from_depth.translation_m[0] = product_id == kD405 ? 0 : product_id == kD455 ? -0.059 : 0.015;
}

}  // namespace stillmesh::v4l2
