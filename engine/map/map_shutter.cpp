#include "engine/map/map.hpp"

#include <cmath>

namespace stillmesh {

void Map::express_with_readout(double readout_s) noexcept {
    const double change_s = readout_s - readout_s_;
    readout_s_ = readout_s;
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        if (points_.is_taken(slot)) shift_by_readout(points_.at(slot), change_s);
    }
    for (std::uint32_t slot = 0; slot < keyframes_.slots_count(); ++slot) {
        if (!keyframes_.is_taken(slot)) continue;
        Keyframe& keyframe = keyframes_.at(slot);
        keyframe.world_from_camera = keyframe.world_from_camera * se3_exp(keyframe.pose_by_readout * change_s);
        renormalise(keyframe.world_from_camera.rotation);
    }
    changes_.add(readout_s);
}

void Map::average(Handle<Keyframe> handle, std::uint32_t index, Handle<MapPoint> point,
                  const Vector3& measured) noexcept {
    Keyframe* const keyframe = keyframes_.find(handle);
    if (keyframe == nullptr || !(measured.z() > 0.0)) return;
    STILLMESH_CHECK(index < keyframe->observations);
    Observation& o = observations_of(handle.slot())[index];
    if (!(o.point == point) || o.var_z < 0) return;
    const double share = 1.0 / (1.0 + o.averaged);
    o.normalised_x += static_cast<float>(share * (measured.x() / measured.z() - static_cast<double>(o.normalised_x)));
    o.normalised_y += static_cast<float>(share * (measured.y() / measured.z() - static_cast<double>(o.normalised_y)));
    o.z_m += static_cast<float>(share * (measured.z() - static_cast<double>(o.z_m)));
    if (o.averaged < parameters_.averaged_max) ++o.averaged;
    ++keyframe->observations_changed;
}

bool Map::carry_observations(Handle<Keyframe> handle, std::uint32_t image_height) noexcept {
    Keyframe& keyframe = *keyframes_.find(handle);
    const double change_s = readout_s_ - keyframe.readout_s;
    if (std::abs(change_s) < 1e-9) return false;
    keyframe.readout_s = readout_s_;
    ++keyframe.observations_changed;
    Vector6 turning = keyframe.speed;
    for (int i = 0; i < 3; ++i) turning(i) = 0;
    for (Observation& o : observations_of(handle.slot())) {
        const double row = static_cast<double>(o.y) / static_cast<double>(image_height) - 0.5;
        // Without depth it is turned only.
        const bool has_depth = o.var_z >= 0;
        const double z = has_depth ? static_cast<double>(o.z_m) : 1.0;
        const Vector3 seen(static_cast<double>(o.normalised_x) * z, static_cast<double>(o.normalised_y) * z, z);
        const Vector3 p = moved_a_little((has_depth ? keyframe.speed : turning) * (row * change_s), seen);
        if (!(p.z() > 0.5 * z)) continue;
        o.normalised_x = static_cast<float>(p.x() / p.z());
        o.normalised_y = static_cast<float>(p.y() / p.z());
        if (has_depth) o.z_m = static_cast<float>(p.z());
    }
    return true;
}

}  // namespace stillmesh
