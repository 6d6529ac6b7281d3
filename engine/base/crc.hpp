// CRC-32 as in IEEE 802.3, zlib and PNG (polynomial 0x04c11db7 reflected): finds torn and flipped bytes in files.
// Eight bytes at a time over eight tables of 1 KiB, made by the compiler: a byte at a time would wait for one look-up
// per byte, six cycles or so, which a map of 20 MB feels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace stillmesh {

namespace crc_detail {

// kTables[k][i]: what byte i does to the rest when k more bytes follow it.
inline constexpr std::array<std::array<std::uint32_t, 256>, 8> kTables = [] {
    std::array<std::array<std::uint32_t, 256>, 8> tables{};
    for (std::uint32_t i = 0; i < 256; ++i) {
        std::uint32_t rest = i;
        for (int bit = 0; bit < 8; ++bit) rest = (rest >> 1) ^ ((rest & 1U) != 0 ? 0xedb88320U : 0U);
        tables[0][i] = rest;
    }
    for (std::uint32_t k = 1; k < 8; ++k) {
        for (std::uint32_t i = 0; i < 256; ++i) {
            const std::uint32_t before = tables[k - 1][i];
            tables[k][i] = (before >> 8) ^ tables[0][before & 0xffU];
        }
    }
    return tables;
}();

[[nodiscard]] constexpr std::uint32_t u32_at(std::span<const std::byte> bytes, std::size_t at) noexcept {
    return std::to_integer<std::uint32_t>(bytes[at]) | std::to_integer<std::uint32_t>(bytes[at + 1]) << 8 |
           std::to_integer<std::uint32_t>(bytes[at + 2]) << 16 | std::to_integer<std::uint32_t>(bytes[at + 3]) << 24;
}

}  // namespace crc_detail

class Crc32 {
public:
    constexpr void add(std::span<const std::byte> bytes) noexcept {
        const auto& t = crc_detail::kTables;
        std::size_t at = 0;
        for (; bytes.size() - at >= 8; at += 8) {
            const std::uint32_t a = crc_detail::u32_at(bytes, at) ^ rest_;
            const std::uint32_t b = crc_detail::u32_at(bytes, at + 4);
            rest_ = t[7][a & 0xffU] ^ t[6][a >> 8 & 0xffU] ^ t[5][a >> 16 & 0xffU] ^ t[4][a >> 24] ^ t[3][b & 0xffU] ^
                    t[2][b >> 8 & 0xffU] ^ t[1][b >> 16 & 0xffU] ^ t[0][b >> 24];
        }
        for (; at < bytes.size(); ++at) {
            rest_ = t[0][(rest_ ^ std::to_integer<std::uint32_t>(bytes[at])) & 0xffU] ^ (rest_ >> 8);
        }
    }
    [[nodiscard]] constexpr std::uint32_t value() const noexcept { return ~rest_; }

private:
    std::uint32_t rest_ = 0xffffffffU;
};

[[nodiscard]] constexpr std::uint32_t crc32(std::span<const std::byte> bytes) noexcept {
    Crc32 crc;
    crc.add(bytes);
    return crc.value();
}

}  // namespace stillmesh
