// What happens to the colour picture on its way out: the exposure hunts, lamps flicker over the rows, the driver's JPEG
// takes away what is fine. All in source order: the same bytes on every processor.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/simulated/dirt.hpp"

namespace stillmesh::simulated {

class ColourDirt {
public:
    ColourDirt(const Dirt& dirt, std::uint64_t seed);

    // Factor on the light: of the automatic exposure at this time, and of the lamps at a row's.
    [[nodiscard]] double exposure(double time_s) const noexcept;
    [[nodiscard]] double lamps(double row_time_s) const noexcept;
    [[nodiscard]] bool has_flicker() const noexcept { return flicker_ > 0; }

private:
    double hunting_, flicker_;
    double phase_[4] = {};
};

// Grey as JPEG of this quality (1 to 100) leaves it: every 8 x 8 block through the cosine transform, quantised by the
// standard's table for luminance, and back. Cost: some 10 ms for 640x480.
void compress(std::vector<std::uint8_t>& grey, std::uint32_t width, std::uint32_t height, std::int32_t quality);

}  // namespace stillmesh::simulated
