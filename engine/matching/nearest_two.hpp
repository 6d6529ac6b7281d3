// Of candidates for a match the nearest descriptor and the next, and whether the first is clearly nearer: Lowe's ratio
// test (2004). Candidates that are farther than a match may be count as one bit farther than that; and a lone candidate
// is measured against such a one. Of equals the first offered is the nearest. Cost: two comparisons a candidate.
#pragma once

#include <cstdint>

namespace stillmesh {

// `What`: which candidate it is.
template <typename What>
struct NearestTwo {
    std::uint32_t distance_max;  // bits
    std::uint32_t best = distance_max + 1, second = distance_max + 1;
    What nearest{}, next{};

    void offer(std::uint32_t distance_bits, const What& what) noexcept {
        if (distance_bits < best) {
            second = best;
            next = nearest;
            best = distance_bits;
            nearest = what;
        } else if (distance_bits < second) {
            second = distance_bits;
            next = what;
        }
    }
    [[nodiscard]] bool is_any() const noexcept { return best <= distance_max; }
    [[nodiscard]] bool is_clear(double ratio_max) const noexcept {
        return static_cast<double>(best) <= ratio_max * static_cast<double>(second);
    }
};

}  // namespace stillmesh
