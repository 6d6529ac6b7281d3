// The bytes of a RealSense D4xx as a test writes them: calibration tables with their checksums, details, depth unit,
// and answers around them. Written from the layout, not from the code that reads it.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <string>
#include <vector>

namespace stillmesh::test {

using Bytes = std::vector<std::uint8_t>;

// CRC-32 of IEEE 802.3, bit by bit.
[[nodiscard]] inline std::uint32_t slow_crc32(const std::uint8_t* bytes, std::size_t count) {
    std::uint32_t rest = 0xffffffffU;
    for (std::size_t i = 0; i < count; ++i) {
        rest ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit) rest = (rest & 1U) != 0 ? (rest >> 1) ^ 0xedb88320U : rest >> 1;
    }
    return ~rest;
}

inline void put_u32(Bytes& bytes, std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}
inline void put_float(Bytes& bytes, std::size_t at, float value) {
    put_u32(bytes, at, std::bit_cast<std::uint32_t>(value));
}

inline void seal(Bytes& table, std::uint16_t type) {
    table[0] = 1;
    table[2] = static_cast<std::uint8_t>(type);
    put_u32(table, 4, static_cast<std::uint32_t>(table.size() - 16));
    put_u32(table, 12, slow_crc32(table.data() + 16, table.size() - 16));
}

// Entry k (in the order of the format) has fx = 0.7 * width + k and so on, in numbers that a float holds exactly.
struct DepthEntry {
    std::uint32_t width, height;
};
inline constexpr std::array<DepthEntry, 16> kDepthEntries{{{1920, 1080},
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
                                                           {640, 400},
                                                           {576, 576},
                                                           {720, 720},
                                                           {1152, 1152}}};
[[nodiscard]] inline std::array<float, 4> depth_numbers(std::size_t entry) {
    const DepthEntry& size = kDepthEntries[entry];
    const auto k = static_cast<float>(entry);
    return {static_cast<float>(size.width) * 0.5F + k, static_cast<float>(size.width) * 0.5F + k + 0.25F,
            static_cast<float>(size.width) * 0.5F - 0.75F, static_cast<float>(size.height) * 0.5F + 0.125F};
}
[[nodiscard]] inline Bytes depth_table() {
    Bytes table(512, 0);
    put_float(table, 160, 50.0F);  // baseline, mm
    for (std::size_t k = 0; k < kDepthEntries.size(); ++k) {
        const auto numbers = depth_numbers(k);
        for (std::size_t i = 0; i < 4; ++i) put_float(table, 256 + 16 * k + 4 * i, numbers[i]);
    }
    seal(table, 25);
    return table;
}

struct ColourNumbers {
    float fx = 1.4375F, fy = 2.53125F, cx = 0.015625F, cy = -0.03125F;  // from -1 to 1, border to border
    std::array<float, 5> distortion{0.125F, -0.25F, 0.001953125F, -0.0009765625F, 0.0625F};
    std::array<float, 9> rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};  // by rows
    std::array<float, 3> translation_mm{14.75F, 0.25F, -0.5F};
    std::uint16_t width = 1920, height = 1080;
};
[[nodiscard]] inline Bytes colour_table(const ColourNumbers& numbers = {}) {
    Bytes table(256, 0);
    const float matrix[9] = {numbers.fx, 0, numbers.cx, 0, numbers.fy, numbers.cy, 0, 0, 1};
    for (std::size_t i = 0; i < 9; ++i) put_float(table, 16 + 4 * i, matrix[i]);
    for (std::size_t i = 0; i < 5; ++i) put_float(table, 52 + 4 * i, numbers.distortion[i]);
    put_u32(table, 144, numbers.width | static_cast<std::uint32_t>(numbers.height) << 16);
    for (std::size_t i = 0; i < 9; ++i) put_float(table, 184 + 4 * i, numbers.rotation[i]);
    for (std::size_t i = 0; i < 3; ++i) put_float(table, 220 + 4 * i, numbers.translation_mm[i]);
    seal(table, 32);
    return table;
}

[[nodiscard]] inline Bytes details() {
    Bytes body(240, 0);
    const std::uint8_t firmware[] = {1, 0, 16, 5};
    const std::uint8_t serial[] = {0x01, 0x23, 0x45, 0x67, 0x89, 0xab};
    std::memcpy(&body[12], firmware, 4);
    std::memcpy(&body[48], serial, 6);
    return body;
}
[[nodiscard]] inline Bytes depth_unit(std::uint32_t unit_um) {
    Bytes body(20, 0);
    put_u32(body, 0, unit_um);
    return body;
}

// A buffer of V4L2_META_FMT_D4XX: what the driver writes, the payload header, capture timing, depth control,
// configuration.
struct MetadataNumbers {
    std::uint32_t time_us = 0;  // in the header: the end of what was exposed
    std::uint32_t optical_us = 4000, exposure_us = 8000;
    bool is_laser_on = true;
    std::uint32_t version = 3;  // of depth control
};
[[nodiscard]] inline Bytes metadata(const MetadataNumbers& numbers) {
    Bytes bytes(10 + 12 + 40 + 60 + 40, 0);
    bytes[10] = static_cast<std::uint8_t>(bytes.size() - 10);
    bytes[11] = 0x8c;  // end of header, clock, time
    put_u32(bytes, 12, numbers.time_us);
    const auto put_all = [&bytes](std::size_t at, std::initializer_list<std::uint32_t> values) {
        for (const std::uint32_t value : values) {
            put_u32(bytes, at, value);
            at += 4;
        }
    };
    put_all(22, {0x80000001, 40, 1, 0x3f, 77, numbers.optical_us, 9000, numbers.exposure_us, 33'333, 20'000});
    put_all(62, {0x80000000, 60, numbers.version, numbers.version < 2 ? 0x7fU : 0x1ffU, 16, numbers.exposure_us, 150, 1,
                 0, 0, 847, 0, 479, 0, (numbers.version < 3 ? 0U : 0x01680000U) | (numbers.is_laser_on ? 1U : 0U)});
    put_all(122, {0x80000002, 40, 3, 0x7ff, 0x1c, 5});
    return bytes;
}

// 1024 bytes: the code of the command, the body, its length at the end.
[[nodiscard]] inline Bytes answer(std::uint32_t code, const Bytes& body) {
    Bytes message(1024, 0);
    put_u32(message, 0, code);
    if (!body.empty()) std::memcpy(&message[4], body.data(), body.size());
    put_u32(message, 1020, static_cast<std::uint32_t>(body.size()));
    return message;
}

}  // namespace stillmesh::test
