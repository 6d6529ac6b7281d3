#include "engine/tracking/gather_correspondences.hpp"

#include <algorithm>

#include "engine/base/time.hpp"

namespace stillmesh {

void gather_correspondences(const MapMatcher& matcher, const MeasuredFrame& frame, const Map& map,
                            const NoiseFactors& noise, const RegionContext& context, std::int64_t time_ns,
                            const Parameters& configuration, FixedVector<Correspondence>& out) noexcept {
    out.clear();
    // The paper knows one place of a point and no weight; without the region's extraction neither is asked for.
    const bool is_plain = !configuration.region.is_enabled || configuration.region.is_paper();
    const WeightParameters& weights = configuration.weights;
    for (std::size_t i = 0; i < frame.size(); ++i) {
        if (matcher.claim(i).is_free()) continue;
        const MapPoint& point = map.points().at(matcher.claim(i).point_slot());
        const MeasuredFeature& m = frame[i];
        Correspondence c;
        c.feature = static_cast<std::uint32_t>(i);
        c.point_slot = matcher.claim(i).point_slot();
        c.row = frame.row_of(i);
        c.normalised = m.normalised;
        c.has_depth = m.has_depth();
        if (c.has_depth) {
            c.p_camera = m.point();
            const double slip =
                context.rotation_speed_rad_s * context.colour_depth_lag_s * configuration.prediction.slip_share * m.z_m;
            c.var_z = m.var_z * noise.depth + slip * slip;
        }
        c.var_pixel = m.var_pixel * noise.pixel;
        c.p_world = vector_of(point.world);
        c.p_anchor = vector_of(point.anchor);
        c.map_var_z = point.var_z * noise.depth;
        c.map_var_lateral = point.var_lateral * noise.pixel;
        const double unseen_m = context.travelled - static_cast<double>(point.agreed_travelled);
        const double unseen_drift = std::clamp(weights.drift_share * unseen_m, 0.0, weights.drift_max_m);
        c.drift_var = unseen_drift * unseen_drift;
        const double drift = std::min(weights.drift_m + weights.drift_m_s * seconds_between(point.anchor_ns, time_ns),
                                      weights.drift_max_m);
        c.anchor_var_z = point.anchor_var_z * noise.depth + drift * drift;
        c.anchor_var_lateral = point.anchor_var_lateral * noise.pixel + drift * drift;
        c.distance_bits = static_cast<std::uint16_t>(matcher.claim(i).distance_bits);
        c.is_dynamic = !is_plain && point.is_suspect;
        if (is_plain) {
            c.weight = 1.0;
            c.drift_var = 0;
            c.p_anchor = c.p_world;
            c.anchor_var_z = c.map_var_z;
            c.anchor_var_lateral = c.map_var_lateral;
        } else if (c.is_dynamic) {
            c.weight = 0.0;
        } else {
            const double stood_s = seconds_between(point.created_ns, time_ns);
            c.stood_tenths = static_cast<std::uint16_t>(std::clamp(10.0 * stood_s, 0.0, Correspondence::kStoodMax));
            const double age = std::min(stood_s / weights.proven_s, 1.0);
            const double weight = static_cast<double>(point.weight_tenths) / static_cast<double>(weights.max);
            c.weight = (weights.unproven + (1.0 - weights.unproven) * age * age) * weight;
        }
        STILLMESH_CHECK(out.push(c));
    }
}

}  // namespace stillmesh
