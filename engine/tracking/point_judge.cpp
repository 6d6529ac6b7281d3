#include "engine/tracking/point_judge.hpp"

#include <algorithm>

#include "engine/base/time.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

// A moving point gets a new anchor when the old one is so many times proven_s old: later than it could have earned its
// weight back there.
constexpr double kAnchorAge = 1.5;

}  // namespace

void PosedFrame::place(std::size_t feature, MapPoint& point) const noexcept {
    const MeasuredFeature& m = frame[feature];
    const Keypoint& keypoint = frame.keypoint(feature);
    const Vector3 p = m.point();
    store(world_from_camera * p, point.world);
    store(shutter.by_readout(world_from_camera, p, keypoint.y), point.world_by_readout);
    point.var_z = m.var_z;
    point.var_lateral = m.var_pixel * m.z_m * m.z_m;
    point.descriptor = frame.descriptor(feature);
    point.angle_rad = keypoint.angle_rad;
    point.agreed_travelled = static_cast<float>(travelled);
    point.distance_m = static_cast<float>(m.z_m);
    point.level = keypoint.level;
}

void PosedFrame::anchor(MapPoint& point) const noexcept {
    store(vector_of(point.world), point.anchor);
    store(vector_of(point.world_by_readout), point.anchor_by_readout);
    point.anchor_var_z = point.var_z;
    point.anchor_var_lateral = point.var_lateral;
    point.anchor_ns = time_ns;
}

void PointJudge::create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept {
    parameters_ = &configuration;
    verdicts_ = arena.array<Verdict>(limits.features_max);
}

void PointJudge::clear(std::size_t features) noexcept {
    std::fill_n(verdicts_.begin(), features, Verdict::kNone);
}

void PointJudge::judge(std::span<const Correspondence> correspondences, const Witness& witness, Map& map,
                       FixedVector<std::uint16_t>& still) noexcept {
    const PosedFrame& posed = witness.posed;
    const SE3 camera_from_world = posed.world_from_camera.inverse();
    const RegionParameters& region = parameters_->region;
    const double chi2_max = region.point_chi2_max;
    still.clear();
    clear(posed.frame.size());
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        const Correspondence& c = correspondences[i];
        MapPoint& point = map.points().at(c.point_slot);
        point.last_seen_frame = posed.number;
        if (point.seen < 0xffffU && !witness.is_frozen) ++point.seen;
        const bool is_member = !region.is_paper() || c.weight > 0;  // Algorithm 2: of the chosen group
        const double chi2_anchor = chi2_of_anchor(c, camera_from_world);
        const bool is_still = c.is_dynamic
                                  ? chi2_anchor <= chi2_max &&
                                        seconds_between(point.anchor_ns, posed.time_ns) > parameters_->weights.proven_s
                                  : is_member && chi2_with_drift(c, camera_from_world) <= chi2_max &&
                                        chi2_anchor <= region.wide_factor * chi2_max;
        const bool is_moving = c.is_dynamic ? chi2_anchor > chi2_max : !is_still;
        const bool may_learn = c.has_depth && !witness.is_frozen;
        if (may_learn && witness.is_sure && region.is_enabled)
            move_weight(c, is_still, is_moving, posed.time_ns, point);
        if (!c.is_dynamic && is_still) {
            STILLMESH_CHECK(still.push(static_cast<std::uint16_t>(i)));
            // What only drift explains is back in view, and neither moves nor is moved: keyframes that see it beside
            // what is new let the adjustment bring both together.
            if (chi2_of(c, camera_from_world) <= chi2_max) {
                if (!witness.is_frozen) point.agreed_travelled = static_cast<float>(posed.travelled);
                if (may_learn) refine(c, posed, camera_from_world, point);
            }
            verdicts_[c.feature] = Verdict::kStill;
        } else {
            const bool is_seen_to_move = !c.is_dynamic || chi2_anchor > region.far_chi2();
            verdicts_[c.feature] = is_seen_to_move ? Verdict::kMoving : Verdict::kUnclear;
        }
        if (may_learn && point.is_suspect) follow(c, posed, point);
    }
}

void PointJudge::move_weight(const Correspondence& c, bool is_still, bool is_moving, std::int64_t time_ns,
                             MapPoint& point) const noexcept {
    const WeightParameters& weights = parameters_->weights;
    if (is_still) {
        if (c.is_dynamic && point.weight_tenths + 1U >= weights.eligible) {
            // Votes again, like a new point: it has stood still since its anchor.
            point.created_ns = time_ns;
            point.is_suspect = false;
        }
        point.weight_tenths = static_cast<std::uint8_t>(std::min(point.weight_tenths + 1U, weights.max));
    } else if (is_moving) {
        if (point.weight_tenths > 0) --point.weight_tenths;
        // One bad frame is blur, some are motion.
        if (point.weight_tenths + weights.suspect_steps <= weights.eligible) point.is_suspect = true;
    }
}

// Kalman update along and across the ray; never surer than a third of one measurement.
void PointJudge::refine(const Correspondence& c, const PosedFrame& posed, const SE3& camera_from_world,
                        MapPoint& point) const noexcept {
    const MeasuredFeature& m = posed.frame[c.feature];
    const SE3& world_from_camera = posed.world_from_camera;
    const Vector3 q = camera_from_world * c.p_world;
    // Variances in the map are those of the model: how large they really are changes from frame to frame.
    const double var_z = m.var_z;
    const double lateral = m.var_pixel * c.p_camera.z() * c.p_camera.z();
    const double gain_z = point.var_z / (point.var_z + var_z);
    const double gain_lateral = point.var_lateral / (point.var_lateral + lateral);
    Vector3 moved = q;
    const double dz = c.p_camera.z() - q.z();
    moved.z() += gain_z * dz;
    // Across the ray: the difference at the same depth.
    moved.x() = moved.z() * (q.x() / q.z() + gain_lateral * (c.normalised.x() - q.x() / q.z()));
    moved.y() = moved.z() * (q.y() / q.z() + gain_lateral * (c.normalised.y() - q.y() / q.z()));
    store(world_from_camera * moved, point.world);
    const Vector3 learnt = camera_from_world.rotation *
                           (posed.shutter.by_readout(world_from_camera, c.p_camera, posed.frame.keypoint(c.feature).y) -
                            vector_of(point.world_by_readout));
    store(vector_of(point.world_by_readout) + world_from_camera.rotation * Vector3(learnt.x() * gain_lateral,
                                                                                   learnt.y() * gain_lateral,
                                                                                   learnt.z() * gain_z),
          point.world_by_readout);
    const double variance_min = parameters_->weights.variance_min;
    point.var_z = std::max(point.var_z * (1.0 - gain_z), variance_min * var_z);
    point.var_lateral = std::max(point.var_lateral * (1.0 - gain_lateral), variance_min * lateral);
}

// Without a weight: followed, so that it does not breed new points, and given a new anchor now and then.
void PointJudge::follow(const Correspondence& c, const PosedFrame& posed, MapPoint& point) const noexcept {
    posed.place(c.feature, point);
    const double age_s = seconds_between(point.anchor_ns, posed.time_ns);
    if (!c.is_dynamic || age_s > kAnchorAge * parameters_->weights.proven_s) posed.anchor(point);
}

}  // namespace stillmesh
