#include "engine/pose/unsure_stretch.hpp"

#include "engine/base/time.hpp"

namespace stillmesh {

void UnsureStretch::add(std::int64_t time_ns, const Vector3& position) noexcept {
    const Vector3 off = position - sure_position_;
    Pose pose{static_cast<float>(seconds_between(sure_ns_, time_ns)), {}};
    for (int i = 0; i < 3; ++i) pose.off_m[i] = static_cast<float>(off(i));
    if (!poses_.push(pose)) is_long_ = true;
}

UnsureStretch::Verdict UnsureStretch::end(std::int64_t time_ns, const Vector3& position, double stray_m) noexcept {
    Verdict out;
    out.has_strayed = has_sure_ && (is_long_ || strays(time_ns, position, stray_m));
    if (out.has_strayed && is_whole_ && !is_long_) out.since_ns = sure_ns_;
    reset();
    sure_ns_ = time_ns;
    sure_position_ = position;
    has_sure_ = true;
    return out;
}

bool UnsureStretch::strays(std::int64_t time_ns, const Vector3& position, double stray_m) const noexcept {
    const Vector3 way = position - sure_position_;
    const double all_s = seconds_between(sure_ns_, time_ns);
    for (const Pose& pose : poses_.span()) {
        const double share = static_cast<double>(pose.after_s) / all_s;
        double off2 = 0;
        for (int i = 0; i < 3; ++i) {
            const double off = static_cast<double>(pose.off_m[i]) - share * way(i);
            off2 += off * off;
        }
        if (off2 > stray_m * stray_m) return true;
    }
    return false;
}

}  // namespace stillmesh
