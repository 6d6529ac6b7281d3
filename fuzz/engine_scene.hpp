// What the camera of fuzz_engine sees: a textured world that it moves along, with a body that moves otherwise.
#pragma once

#include <cstddef>
#include <cstdint>

#include "fuzz/fuzz.hpp"
#include "fuzz/pictures.hpp"

namespace stillmesh::fuzz {

struct Scene {
    std::int32_t x = 1000, y = 1000, body_x = 40;
    std::uint32_t depth = 8000;
    bool has_body = false;

    void move(Bytes& bytes) {
        const std::uint8_t by = bytes.u8();
        x += (by & 7) - 3;
        y += (by >> 3 & 3) - 1;
        body_x += (by >> 5) - 3;
        depth += bytes.u8() % 16U;
    }
    void draw(Picture<std::uint8_t>& colour, Picture<std::uint16_t>& depths, std::uint32_t channels) const {
        const auto width = static_cast<std::int32_t>(depths.view.width);
        const auto height = static_cast<std::int32_t>(depths.view.height);
        for (std::int32_t v = 0; v < height; ++v) {
            std::uint8_t* shown = colour.pixels.data() + static_cast<std::size_t>(v) * colour.view.stride;
            std::uint16_t* far = depths.pixels.data() + static_cast<std::size_t>(v) * depths.view.stride;
            const std::uint32_t world_row = row_of(v + y), body_row = row_of(v);
            for (std::int32_t u = 0; u < width; ++u) {
                const bool is_body = has_body && u >= body_x && u < body_x + width / 4 && v > height / 2;
                std::uint32_t cell = static_cast<std::uint32_t>((is_body ? u - body_x + 5000 : u + x) / kCell_px);
                cell = cell * 2654435761U ^ (is_body ? body_row : world_row);
                cell ^= cell >> 15;
                for (std::uint32_t c = 0; c < channels; ++c) *shown++ = static_cast<std::uint8_t>(cell * 97);
                *far++ = static_cast<std::uint16_t>(is_body ? depth / 2 : depth + 3U * static_cast<std::uint32_t>(u));
            }
        }
    }

private:
    static constexpr std::int32_t kCell_px = 4;
    static std::uint32_t row_of(std::int32_t v) { return static_cast<std::uint32_t>(v / kCell_px) * 2246822519U; }
};

}  // namespace stillmesh::fuzz
