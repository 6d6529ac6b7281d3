#include "hal/v4l2/realsense_metadata.hpp"

namespace stillmesh::v4l2 {
namespace {

// What the driver writes before a header: the host's time and the frame number on the bus.
constexpr std::size_t kDriverBytes = 10;
constexpr std::size_t kHeaderBytes = 2;  // its length, its flags
constexpr std::uint8_t kHasTime = 0x04, kHasClock = 0x08, kHasError = 0x40;
constexpr std::size_t kTimeBytes = 4, kClockBytes = 6;

// The blocks that are read, and where in them: a number (4 bytes each) counts from the block's id on.
constexpr std::uint32_t kDepthControl = 0x80000000, kCaptureTiming = 0x80000001;
constexpr std::size_t kDepthControlBytes = 60, kCaptureTimingBytes = 40;
constexpr std::size_t kVersion = 2, kFlags = 3, kControlExposure = 5, kEmitter = 14, kOptical = 5, kExposure = 7;
constexpr std::uint32_t kControlHasExposure = 0x02, kControlHasPower = 0x04, kControlHasEmitter = 0x80;
constexpr std::uint32_t kTimingHasOptical = 0x02, kTimingHasExposure = 0x08;

constexpr std::uint32_t kTimeMax_us = 1'000'000;  // of an exposure: the slowest rate is six images a second

[[nodiscard]] std::uint32_t number_at(std::span<const std::uint8_t> bytes, std::size_t index) noexcept {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value |= std::uint32_t{bytes[4 * index + i]} << (8 * i);
    return value;
}

// False: a time that no image has.
[[nodiscard]] bool read_timing(std::span<const std::uint8_t> block, ImageFacts& facts) noexcept {
    const std::uint32_t flags = number_at(block, kFlags);
    if ((flags & kTimingHasExposure) != 0) facts.exposure_us = number_at(block, kExposure);
    if ((flags & kTimingHasOptical) == 0) return true;
    const std::uint32_t optical_us = number_at(block, kOptical);
    facts.device_us = *facts.device_us - optical_us;
    return optical_us <= kTimeMax_us;
}

void read_control(std::span<const std::uint8_t> block, ImageFacts& facts) noexcept {
    const std::uint32_t version = number_at(block, kVersion), flags = number_at(block, kFlags);
    if ((flags & kControlHasExposure) != 0 && !facts.exposure_us) {
        facts.exposure_us = number_at(block, kControlExposure);
    }
    // The first version has no flag of its own for the emitter, which goes with its power; the third has it in a byte.
    const bool has_emitter = (flags & (version < 2 ? kControlHasPower : kControlHasEmitter)) != 0;
    const std::uint32_t emitter = number_at(block, kEmitter) & (version < 3 ? 0xffffffffU : 0xffU);
    if (has_emitter) facts.is_laser_on = emitter != 0;
}

}  // namespace

Status parse_metadata(std::span<const std::uint8_t> bytes, ImageFacts& facts) noexcept {
    if (bytes.size() < kDriverBytes + kHeaderBytes + kTimeBytes) return Status::kCorrupt;
    const std::span<const std::uint8_t> header = bytes.subspan(kDriverBytes);
    const std::size_t length = header[0];
    const std::uint8_t flags = header[1];
    if ((flags & kHasTime) == 0 || (flags & kHasError) != 0) return Status::kCorrupt;
    const std::size_t standard = kHeaderBytes + kTimeBytes + ((flags & kHasClock) != 0 ? kClockBytes : 0);
    // Of V4L2_META_FMT_UVC the driver keeps the standard header alone, and the camera's length in it.
    const bool is_cut = header.size() == standard && length >= standard;
    if (!is_cut && (length < standard || length > header.size())) return Status::kCorrupt;
    ImageFacts found;
    found.device_us = number_at(header.subspan(kHeaderBytes), 0);
    std::span<const std::uint8_t> rest = header.subspan(standard, is_cut ? 0 : length - standard);
    while (rest.size() >= 8 && number_at(rest, 0) != 0) {
        const std::uint32_t id = number_at(rest, 0), size = number_at(rest, 1);
        if (size < 8 || size > rest.size()) return Status::kCorrupt;
        const std::span<const std::uint8_t> block = rest.first(size);
        if (id == kCaptureTiming) {
            if (size < kCaptureTimingBytes || !read_timing(block, found)) return Status::kCorrupt;
        } else if (id == kDepthControl) {
            if (size < kDepthControlBytes) return Status::kCorrupt;
            read_control(block, found);
        }
        rest = rest.subspan(size);
    }
    if (found.exposure_us.value_or(0) > kTimeMax_us) return Status::kCorrupt;
    facts = found;
    return Status::kOk;
}

}  // namespace stillmesh::v4l2
