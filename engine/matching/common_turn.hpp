// A camera that rolls turns all descriptors alike: matches that turn otherwise are look-alikes. The turns of many
// matches are counted in bins of 12 degrees; those in the fullest bins agree. Cost: 30 counters.
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/base/numbers.hpp"

namespace stillmesh {

class CommonTurn {
public:
    static constexpr std::int32_t kBins = 30;

    // A feature at the angle `from_rad` matched one at `to_rad`; both in [-2 pi, 2 pi].
    void add(float from_rad, float to_rad) noexcept { ++counts_[bin_of(from_rad, to_rad)]; }
    // The `bins_max` fullest. Of equals the lower bin.
    void choose(std::uint32_t bins_max) noexcept {
        for (std::uint32_t rank = 0; rank < bins_max; ++rank) {
            std::int32_t best = -1;
            for (std::int32_t bin = 0; bin < kBins; ++bin) {
                if (!is_chosen_[bin] && counts_[bin] > 0 && (best < 0 || counts_[bin] > counts_[best])) best = bin;
            }
            if (best < 0) break;
            is_chosen_[best] = true;
        }
    }
    // Does a match turn as those in the chosen bins do?
    [[nodiscard]] bool has(float from_rad, float to_rad) const noexcept { return is_chosen_[bin_of(from_rad, to_rad)]; }
    // The most matches in three bins side by side.
    [[nodiscard]] std::uint32_t count_alike() const noexcept {
        std::uint32_t alike = 0;
        for (std::int32_t i = 0; i < kBins; ++i)
            alike = std::max(alike, counts_[i] + counts_[(i + 1) % kBins] + counts_[(i + 2) % kBins]);
        return alike;
    }

private:
    [[nodiscard]] static std::int32_t bin_of(float from_rad, float to_rad) noexcept {
        constexpr double kTwoPi = 6.283185307179586;
        const double turn = (static_cast<double>(to_rad) - static_cast<double>(from_rad)) / kTwoPi;
        return floor_clamped((turn + 2.0) * kBins + 0.5, 0, 4 * kBins) % kBins;
    }

    std::uint32_t counts_[kBins] = {};
    bool is_chosen_[kBins] = {};
};

}  // namespace stillmesh
