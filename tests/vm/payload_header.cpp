#include "tests/vm/payload_header.hpp"

namespace vm {
namespace {

constexpr std::uint32_t kBareBytes = 6, kClockBytes = 12;
constexpr std::uint32_t kControlBytes = 60, kTimingBytes = 40, kConfigurationBytes = 40;
constexpr std::uint32_t kControl = 0x80000000, kTiming = 0x80000001, kConfiguration = 0x80000002;
constexpr std::uint8_t kEndOfFrame = 0x02, kHasTime = 0x04, kHasClock = 0x08, kEndOfHeader = 0x80;
constexpr std::uint32_t kReadout_us = 9'000, kLatency_us = 20'000;

void put_all(Bytes& bytes, std::initializer_list<std::uint32_t> values) {
    for (const std::uint32_t value : values) put32(bytes, value);
}

std::uint32_t optical_us(const PictureFacts& facts) {
    return facts.exposure_us / 2;
}

void put_timing(Bytes& bytes, const PictureFacts& facts) {
    constexpr std::uint32_t kAllValid = 0x3f;
    put_all(bytes, {kTiming, kTimingBytes, 1, kAllValid, facts.number, optical_us(facts), kReadout_us,
                    facts.exposure_us, facts.interval_us, kLatency_us});
}

// Version 3: the emitter has a byte, the light of an LED, which no D435 has, two.
void put_control(Bytes& bytes, const PictureFacts& facts) {
    constexpr std::uint32_t kAllButLed = 0xff, kGain = 16, kAutomatic = 1, kConstantRate = 0, kPreset = 0;
    put_all(bytes, {kControl, kControlBytes, 3, kAllButLed, kGain, facts.exposure_us, facts.laser_power, kAutomatic,
                    kConstantRate, 0, facts.size.width - 1, 0, facts.size.height - 1, kPreset});
    bytes.insert(bytes.end(), {static_cast<std::uint8_t>(facts.is_emitter_on ? 1 : 0), 0, 0, 0});
}

void put_configuration(Bytes& bytes, const PictureFacts& facts) {
    constexpr std::uint32_t kAllValid = 0x7ff, kCookie = 0;
    constexpr std::uint8_t kHardware = 0, kStandardDepth = 1, kActive = 4, kHasColour = 8;
    put_all(bytes, {kConfiguration, kConfigurationBytes, 3, kAllValid});
    bytes.insert(bytes.end(), {kHardware, kStandardDepth | kActive | kHasColour});
    put32(bytes, kCookie);
    const std::uint32_t format = 1, trigger = 0, calibrations = 0;
    for (const std::uint32_t value :
         {format, facts.size.width, facts.size.height, 1'000'000 / facts.interval_us, trigger, calibrations}) {
        put16(bytes, value);
    }
    bytes.push_back(0);  // pins
    put32(bytes, 0);     // presets within presets
    bytes.push_back(0);
}

}  // namespace

std::uint32_t header_bytes(HeaderKind kind, bool is_stereo) {
    switch (kind) {
        case HeaderKind::kBare: return kBareBytes;
        case HeaderKind::kClock: return kClockBytes;
        case HeaderKind::kBlocks: break;
    }
    return kClockBytes + kTimingBytes + kConfigurationBytes + (is_stereo ? kControlBytes : 0);
}

Bytes payload_header(HeaderKind kind, const PictureFacts& facts) {
    const bool has_clock = kind != HeaderKind::kBare;
    Bytes bytes = {static_cast<std::uint8_t>(header_bytes(kind, facts.is_stereo)),
                   static_cast<std::uint8_t>((facts.is_second ? 1U : 0U) | kEndOfFrame | kHasTime |
                                             (has_clock ? kHasClock : 0U) | kEndOfHeader)};
    put32(bytes, facts.middle_us + optical_us(facts));
    if (!has_clock) return bytes;
    put32(bytes, facts.now_us);
    put16(bytes, facts.now_us / 1000 & 0x7ffU);  // the bus counts milliseconds, in 11 bits
    if (kind != HeaderKind::kBlocks) return bytes;
    put_timing(bytes, facts);
    if (facts.is_stereo) put_control(bytes, facts);
    put_configuration(bytes, facts);
    return bytes;
}

}  // namespace vm
