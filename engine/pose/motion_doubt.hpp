// How far the motion over the last second can be trusted. A trajectory is asked where the camera went, not
// only whether the last frame fitted the map: when the map is renewed from few points, or a pose jumps from one
// explanation of the room to another, each frame looks fine and the path is not. Variances of what went into the pose
// during the window are summed, translation and rotation apart. Cost: one pass over at most kEntriesMax entries a
// frame.
#pragma once

#include <cstddef>
#include <cstdint>

namespace stillmesh {

class MotionDoubt {
public:
    static constexpr std::int64_t kWindow_ns = 1'000'000'000;
    static constexpr std::size_t kEntriesMax = 64;  // faster cameras: entries of the same bin are added up

    struct Variance {
        double translation_m2 = 0;  // traces
        double rotation_rad2 = 0;
    };

    void reset() noexcept { *this = MotionDoubt{}; }
    // Times do not go backwards.
    void add(std::int64_t time_ns, const Variance& variance) noexcept;
    // Of everything added during the window that ends at `time_ns`.
    [[nodiscard]] Variance over_window(std::int64_t time_ns) const noexcept;

private:
    struct Bin {
        std::int64_t index = -1;
        float translation_m2 = 0, rotation_rad2 = 0;  // single precision: enough to compare with a limit
    };
    static constexpr std::int64_t kBin_ns = kWindow_ns / (static_cast<std::int64_t>(kEntriesMax) - 1);

    Bin bins_[kEntriesMax];  // by index modulo kEntriesMax
};

}  // namespace stillmesh
