// The windows of window.hpp for the global adjustment.
#pragma once

#include "engine/adjust/global_adjustment.hpp"
#include "tests/adjust/window.hpp"

namespace stillmesh::test {

inline GlobalSizes global_sizes(const Window& window) {
    return {static_cast<std::uint32_t>(window.poses.size()), static_cast<std::uint32_t>(window.points.size()),
            static_cast<std::uint32_t>(window.observations.size())};
}

// Until nothing moves any more.
inline GlobalOptions exact_global_options() {
    GlobalOptions options;
    options.iterations_max = 300;
    options.inner_iterations_max = 500;
    options.inner_residual_max = 1e-9;
    options.cost_change_min = 1e-13;
    return options;
}

// False: something was refused.
inline bool load(const Window& window, GlobalAdjustment& adjustment) {
    adjustment.begin();
    bool is_ok = true;
    for (std::size_t i = 0; i < window.poses.size(); ++i) {
        is_ok &= adjustment.add_keyframe(window.poses[i], window.is_fixed[i]).is_ok();
    }
    for (const Vector3& point : window.points) is_ok &= adjustment.add_point(point).is_ok();
    for (const AdjustmentObservation& o : window.observations) is_ok &= adjustment.reserve(o.point) == Status::kOk;
    adjustment.fill();
    for (const AdjustmentObservation& o : window.observations) {
        is_ok &=
            adjustment.add_observation({o.keyframe, o.point, o.x, o.y, o.var_pixel, o.z_m, o.var_z}) == Status::kOk;
    }
    return is_ok;
}

}  // namespace stillmesh::test
