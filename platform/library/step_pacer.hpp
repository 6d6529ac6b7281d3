// Turns time into work units: the engine counts units and knows no clock; this measures what a unit costs here and now
// and says how many may be granted before the next frame is due. A margin stays free, because a slice may overdraw and
// the measure lags. However late it is, a frame is followed by one small grant: background work goes on under any load.
#pragma once

#include <algorithm>
#include <cstdint>

namespace stillmesh {

class StepPacer {
public:
    static constexpr std::uint32_t kCallsMax = 1000;       // per frame
    static constexpr std::int64_t kMargin_ns = 2'000'000;  // kept free before the next frame
    static constexpr std::uint32_t kParts = 8;             // the smallest grant is 1/8 of a slice
    static constexpr double kStart_ns_per_unit = 200;      // until it is measured

    explicit StepPacer(std::uint32_t slice_units) : slice_units_(std::max(slice_units, 1U)) {}

    // Units of the next call of Engine::step, the `calls`-th behind this frame; 0: no more.
    [[nodiscard]] std::uint32_t next_grant(std::int64_t now_ns, std::int64_t until_ns, std::uint32_t calls) const {
        if (calls >= kCallsMax) return 0;
        const double left_ns = static_cast<double>(until_ns - now_ns - kMargin_ns);
        // Few sizes: equal grants are one line of a recording.
        for (std::uint32_t part = 1; part <= kParts; part *= 2) {
            const std::uint32_t units = std::max(slice_units_ / part, 1U);
            if (static_cast<double>(units) * ns_per_unit_ <= left_ns) return units;
        }
        return calls == 0 ? std::max(slice_units_ / kParts, 1U) : 0;
    }
    // What a call spent and how long it took. Dearer counts at once, cheaper slowly.
    void measured(std::uint64_t units, std::int64_t ns) {
        if (units == 0 || ns < 0) return;
        const double measured = static_cast<double>(ns) / static_cast<double>(units);
        ns_per_unit_ += (measured > ns_per_unit_ ? 0.5 : 0.05) * (measured - ns_per_unit_);
    }
    [[nodiscard]] double ns_per_unit() const { return ns_per_unit_; }

private:
    std::uint32_t slice_units_;
    double ns_per_unit_ = kStart_ns_per_unit;
};

}  // namespace stillmesh
