#include "engine/pose/motion_doubt.hpp"

namespace stillmesh {

void MotionDoubt::add(std::int64_t time_ns, const Variance& variance) noexcept {
    const std::int64_t index = time_ns / kBin_ns;
    Bin& bin = bins_[static_cast<std::size_t>(index) % kEntriesMax];
    if (bin.index != index) bin = Bin{index};
    bin.translation_m2 += static_cast<float>(variance.translation_m2);
    bin.rotation_rad2 += static_cast<float>(variance.rotation_rad2);
}

MotionDoubt::Variance MotionDoubt::over_window(std::int64_t time_ns) const noexcept {
    const std::int64_t last = time_ns / kBin_ns;
    Variance sum;
    for (const Bin& bin : bins_) {
        if (bin.index < 0 || bin.index + static_cast<std::int64_t>(kEntriesMax) <= last) continue;
        sum.translation_m2 += static_cast<double>(bin.translation_m2);
        sum.rotation_rad2 += static_cast<double>(bin.rotation_rad2);
    }
    return sum;
}

}  // namespace stillmesh
