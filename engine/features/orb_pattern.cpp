#include "engine/features/orb_pattern.hpp"

#include "engine/base/numbers.hpp"

namespace stillmesh {
namespace {

constexpr std::int8_t kTests[kDescriptorTests][4] = {
#include "engine/features/orb_pattern_table.inc"
};

constexpr TurnedPattern turn_pattern() noexcept {
    // cos and sin of one turn, 2 pi / 64; the others by repeated rotation (the error stays below 1e-14).
    constexpr double kCos = 0.99518472667219688624;
    constexpr double kSin = 0.09801714032956060199;
    TurnedPattern turned{};
    double c = 1;
    double s = 0;
    for (std::uint32_t t = 0; t < kKeptTurns; ++t) {
        for (std::uint32_t i = 0; i < kDescriptorTests; ++i) {
            for (std::uint32_t k = 0; k < 2; ++k) {
                const double x = kTests[i][2 * k];
                const double y = kTests[i][2 * k + 1];
                const std::int32_t u = round_clamped(c * x - s * y);
                const std::int32_t v = round_clamped(s * x + c * y);
                turned.offsets[t][2 * i + k] = static_cast<std::int16_t>(v * kPatternPatchStride + u);
            }
        }
        const double next = c * kCos - s * kSin;
        s = s * kCos + c * kSin;
        c = next;
    }
    return turned;
}

constexpr TurnedPattern kTurned = turn_pattern();

}  // namespace

const TurnedPattern& turned_pattern() noexcept {
    return kTurned;
}

}  // namespace stillmesh
