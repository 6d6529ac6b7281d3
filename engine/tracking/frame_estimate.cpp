#include "engine/tracking/frame_estimate.hpp"

#include <algorithm>

#include "engine/base/time.hpp"
#include "engine/pose/agreeing.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/pose/residual.hpp"
#include "engine/tracking/gather_correspondences.hpp"

namespace stillmesh {
namespace {

MotionPrior prior_of(const RegionContext& expected) noexcept {
    return {expected.world_from_camera_predicted, expected.prediction_sigma_m, expected.prediction_sigma_rad};
}

}  // namespace

void FrameEstimator::create(Arena& arena, World& world, TrackedShutter& shutter) noexcept {
    world_ = &world;
    shutter_ = &shutter;
    const std::uint32_t features_max = world.limits.features_max;
    matcher_.create(arena, world.limits, world.parameters.matching, world.camera, world.pixel_noise.scales());
    region_.create(arena, world.limits);
    surfaces_.create(arena, world.limits, world.parameters);
    correspondences_.create(arena, features_max);
    chosen_.create(arena, features_max);
    groups_ = arena.array<std::uint16_t>(features_max);
    explained_by_ = arena.array<std::uint8_t>(features_max);
    random_ = Random(world.parameters.seed);
}

void FrameEstimator::reset() noexcept {
    random_ = Random(world_->parameters.seed);
    frame_ = nullptr;
    correspondences_.clear();
    chosen_.clear();
    region_.build({}, {}, world_->parameters.region, RegionContext{});
}

void FrameEstimator::begin(MeasuredFrame& frame, std::int64_t time_ns, FrameStatistics& statistics) noexcept {
    frame_ = &frame;
    time_ns_ = time_ns;
    statistics_ = &statistics;
    correspondences_.clear();
    chosen_.clear();
    std::fill_n(groups_.begin(), frame.size(), kNoGroup);
    std::fill_n(explained_by_.begin(), frame.size(), std::uint8_t{0});
    matcher_.begin(frame.features());
    shutter_->begin_frame();
    late_.begin_frame();
}

void FrameEstimator::forget() noexcept {
    correspondences_.clear();
    chosen_.clear();
    region_.build({}, frame_->keypoints(), world_->parameters.region, RegionContext{});
    std::fill_n(groups_.begin(), frame_->size(), kNoGroup);
    std::fill_n(explained_by_.begin(), frame_->size(), std::uint8_t{0});
    statistics_->chosen_share = statistics_->rival_share = 0;
    statistics_->mesh_edges = statistics_->mesh_edges_kept = statistics_->groups = 0;
}

Estimate FrameEstimator::estimate(const CameraState& camera, const RegionContext& expected) noexcept {
    const Parameters& c = world_->parameters;
    Estimate out;
    out.expected = expected;
    out.expected.image_width_px = world_->camera.width;
    out.expected.has_past = seconds_between(camera.start_time_ns, time_ns_) >= c.weights.proven_s;
    out.noise = camera.noise;
    out.noise.begin_frame();
    if (late_.expect(*frame_, shutter_->speed(), c)) carry();
    match(camera, out);
    if (shutter_->is_trembling() || late_.is_asked()) correct_coarsely(out);
    const RegionChoice choice = choose_region(out);
    if (!choice.is_valid || region_.chosen().size() < c.pose.inliers_min) return out;
    const std::uint32_t proven = count_proven();
    out.is_on_proven =
        !c.region.is_paper() && proven >= c.region.proven_share * static_cast<double>(region_.chosen().size());
    if (out.expected.has_past && leaves_proven(camera, proven)) return out;
    out.fit = fit_pose(camera, out, choice);
    out.is_valid = out.fit.is_valid && out.fit.inliers >= c.pose.inliers_min;
    // While hints decide, how far off them a choice is is asked beside how much it explains.
    const double score = expected.hint.is_young ? choice.score / choice.plausibility : choice.score;
    out.choice = !(choice.margin >= 0)            ? UnsureReason::kRival
                 : !(score >= c.region.score_min) ? UnsureReason::kUnclear
                                                  : UnsureReason::kNone;
    out.contest = choice.contest;
    out.unsure = doubt_of(out);
    return out;
}

// Of what is chosen, so many have stood still in a frame before. A body that fills the picture has points that were new
// a moment ago and have not: they follow from nothing, and agree with each other.
std::uint32_t FrameEstimator::count_proven() const noexcept {
    std::uint32_t proven = 0;
    for (const std::uint16_t i : region_.chosen()) {
        const MapPoint& point = world_->map.points().at(correspondences_[i].point_slot);
        proven += point.weight_tenths > world_->parameters.weights.eligible ? 1U : 0U;
    }
    return proven;
}

// What has stood still does not end from one frame to the next: more likely a body fills the picture. Where few points
// are left, a fifth of them is enough, but not behind a gap: of the poses so refused that were more than .1 m off 11 of
// 14 stood on no such point at all.
bool FrameEstimator::leaves_proven(const CameraState& camera, std::uint32_t proven) const noexcept {
    const Parameters& c = world_->parameters;
    const double left = c.region.proven_left * static_cast<double>(region_.chosen().size());
    return camera.is_on_proven && proven < c.pose.inliers_min && (camera.lost_frames > 0 || proven < left);
}

// Not without depth, however many points agree: what moves is told from what stands by lengths, which need it. Among
// people 2 s without gave 6 of 169 `tracked` poses that were wrong, by 0.2 m.
UnsureReason FrameEstimator::doubt_of(const Estimate& estimate) const noexcept {
    const std::uint32_t sure_inliers = world_->parameters.pose.sure_inliers();
    if (!estimate.is_clear()) return estimate.choice;
    if (estimate.fit.inliers < sure_inliers) return UnsureReason::kFewPoints;
    return frame_->with_depth_count() < sure_inliers ? UnsureReason::kNoDepth : UnsureReason::kNone;
}

void FrameEstimator::match(const CameraState& camera, Estimate& estimate) noexcept {
    observe(Stage::kMatching, true);
    const Parameters& c = world_->parameters;
    RegionContext& expected = estimate.expected;
    const SE3& predicted = expected.world_from_camera_predicted;
    const LocalMap* const local = local_map_or_none();
    if (local != nullptr && world_->local_map.is_stale(world_->map, predicted))
        world_->local_map.build(world_->map, predicted);
    // Until the past can tell what stands still, and after a choice that was not sure, the motion expected may be that
    // of a body that moves: what stands still has to be found beside it, or it never gets a say.
    const bool is_wide = !camera.is_choice_sure || !expected.has_past;
    matcher_.by_projection(world_->map, local, predicted, is_wide ? c.matching.radius_wide_px : c.matching.radius_px);
    take_matches(estimate.noise.factors(), expected);
    if (!is_wide && chosen_.size() < c.matching.matches_min) {
        matcher_.by_projection(world_->map, local, predicted, c.matching.radius_wide_px);
        gather(estimate.noise.factors(), expected);
        expected.prediction_sigma_m *= c.prediction.retry_sigma_factor;
        expected.prediction_sigma_rad *= c.prediction.retry_sigma_factor;
    }
    observe(Stage::kMatching, false);
}

RegionChoice FrameEstimator::choose_region(Estimate& estimate) noexcept {
    const Parameters& c = world_->parameters;
    NoiseScale& noise = estimate.noise;
    observe(Stage::kMesh, true);
    region_.build(correspondences_.span(), frame_->keypoints(), c.region, estimate.expected);
    observe(Stage::kMesh, false);
    observe(Stage::kRegion, true);
    RegionChoice choice = region_.choose(correspondences_.span(), c, estimate.expected, random_);
    // How large residuals are is not known in the first frames, and changes at once when the camera is jerked: the
    // smallest noise at which the motions found explain most of what has a weight. Too large, and two motions look like
    // one.
    for (std::uint32_t i = 0; i < noise.tries_max() && choice.explained_share < c.noise.explained_min; ++i) {
        noise.raise();
        choose_again(estimate, choice);
    }
    if (noise.is_young() && choice.is_valid) {
        noise.adapt(correspondences_.span(), region_.weighted(), choice.world_from_camera, &region_);
        choose_again(estimate, choice);
    }
    observe(Stage::kRegion, false);
    // Correspondences are gathered anew afterwards.
    std::fill_n(explained_by_.begin(), frame_->size(), std::uint8_t{0});
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        groups_[correspondences_[i].feature] = region_.group_of(i);
        explained_by_[correspondences_[i].feature] = region_.explained_by(choice, i);
    }
    weigh_by_agreement();
    statistics_->mesh_edges = static_cast<std::uint32_t>(region_.mesh().edges.size());
    statistics_->mesh_edges_kept = region_.kept_count();
    statistics_->groups = region_.groups_count();
    statistics_->region_score = choice.score;
    statistics_->region_margin = choice.rival.margin;
    statistics_->chosen_share = choice.rival.chosen_share;
    statistics_->rival_share = choice.rival.share;
    statistics_->pose_iterations = choice.iterations;
    return choice;
}

void FrameEstimator::choose_again(const Estimate& estimate, RegionChoice& choice) noexcept {
    gather(estimate.noise.factors(), estimate.expected);
    region_.build(correspondences_.span(), frame_->keypoints(), world_->parameters.region, estimate.expected);
    choice = region_.choose(correspondences_.span(), world_->parameters, estimate.expected, random_);
}

// What many small residuals say together counts in the pose as it did in the choice: each point of a body that sways
// may pass by itself, and all of them take the camera along.
void FrameEstimator::weigh_by_agreement() noexcept {
    for (Correspondence& c : correspondences_) c.weight *= region_.agreement_of(groups_[c.feature]);
}

PoseFit FrameEstimator::fit_pose(const CameraState& camera, const Estimate& estimate,
                                 const RegionChoice& choice) noexcept {
    observe(Stage::kPose, true);
    carry_by_rows(region_.chosen(), choice.world_from_camera);
    look_where_depth_was(region_.chosen(), choice.world_from_camera);
    const PoseParameters& p = world_->parameters.pose;
    const RansacOptions options = ransac_options(world_->parameters, p.final_factor, camera.inlier_ratio);
    const RansacResult final =
        ransac_pose(correspondences_.span(), region_.chosen(), &choice.world_from_camera, options, random_);
    statistics_->pose_iterations += final.iterations;
    const MotionPrior prior = prior_of(estimate.expected);
    const bool is_held = has_prior(camera, estimate.expected, final.world_from_camera);
    const PoseFit fit = optimise(region_.chosen(), final.world_from_camera, is_held ? &prior : nullptr);
    observe(Stage::kPose, false);
    return fit;
}

// What is expected weighs in the pose, unless a hint has a part in it and the choice contradicts it: a wheel that slips
// would pull the pose along with it.
bool FrameEstimator::has_prior(const CameraState& camera, const RegionContext& expected,
                               const SE3& world_from_camera) const noexcept {
    if (!expected.hint.is_any) return camera.has_prior();
    const HintParameters& p = world_->parameters.hint;
    return camera.lost_frames == 0 && camera.hints.sigmas_off(world_from_camera, p) <= p.contradiction_sigmas;
}

PoseFit FrameEstimator::optimise(std::span<const std::uint16_t> chosen, const SE3& world_from_camera,
                                 const MotionPrior* prior) const noexcept {
    const Parameters& c = world_->parameters;
    return optimise_pose(correspondences_.span(), chosen, world_from_camera, c.region.point_chi2_max,
                         c.pose.final_passes_max, prior);
}

void FrameEstimator::carry_rows(const CameraState& camera, const SE3& camera_motion) noexcept {
    shutter_->set_motion(camera_motion, seconds_between(camera.motion.time_ns(), time_ns_));
    carry();
}

void FrameEstimator::carry() noexcept {
    matcher_.set_sweep(shutter_->sweep());
    frame_->carry_to_middle_row(shutter_->sweep());
}

// Before the choice, by all that have a weight, since the mesh's edges suffer too.
void FrameEstimator::correct_coarsely(const Estimate& estimate) noexcept {
    const Parameters& c = world_->parameters;
    choose_weighted(correspondences_.span(), chosen_);
    const PoseFit all =
        optimise_pose(correspondences_.span(), chosen_.span(), estimate.expected.world_from_camera_predicted,
                      c.region.point_chi2_max, c.pose.coarse_passes_max);
    if (!all.is_valid) return;
    if (shutter_->is_trembling()) carry_by_rows(chosen_.span(), all.world_from_camera);
    look_where_depth_was(chosen_.span(), all.world_from_camera);
}

// Rows are carried with the turn that they show; the correspondences follow.
void FrameEstimator::carry_by_rows(std::span<const std::uint16_t> chosen, const SE3& world_from_camera) noexcept {
    if (shutter_->measure_turn(correspondences_.span(), chosen, world_from_camera,
                               world_->parameters.region.point_chi2_max)) {
        follow_frame();
    }
}

// Depth is looked up where the camera had turned to when it was taken; the correspondences follow.
void FrameEstimator::look_where_depth_was(std::span<const std::uint16_t> chosen,
                                          const SE3& world_from_camera) noexcept {
    if (late_.measure(correspondences_.span(), chosen, world_from_camera, world_->parameters.region.point_chi2_max,
                      *frame_)) {
        follow_frame();
    }
}

void FrameEstimator::follow_frame() noexcept {
    carry();
    for (Correspondence& c : correspondences_) {
        const MeasuredFeature& m = (*frame_)[c.feature];
        c.normalised = m.normalised;
        c.has_depth = c.has_depth && m.has_depth();
        if (c.has_depth) c.p_camera = m.point();
    }
}

void FrameEstimator::complete(const CameraState& camera, Estimate& estimate) noexcept {
    observe(Stage::kLocalMap, true);
    const Parameters& c = world_->parameters;
    const SE3& found = estimate.fit.world_from_camera;
    for (const Correspondence& match : correspondences_)
        world_->map.points().at(match.point_slot).last_seen_frame = world_->clock.frame;
    if (!c.region.is_paper()) {  // which matches features once
        matcher_.by_projection(world_->map, local_map_or_none(), found, c.matching.radius_posed_px,
                               &world_->clock.frame);
    }
    if (camera.lost_frames == 0) carry_rows(camera, camera.world_from_camera().inverse() * found);
    gather(estimate.noise.factors(), estimate.expected);
    weigh_by_agreement();
    choose_agreeing(correspondences_.span(), found, c.region.wide_factor * c.region.point_chi2_max, c.region.far_chi2(),
                    chosen_);
    const MotionPrior prior = prior_of(estimate.expected);
    const bool is_held = has_prior(camera, estimate.expected, found);
    const PoseFit refined = optimise(chosen_.span(), found, is_held ? &prior : nullptr);
    if (refined.is_valid && refined.inliers >= c.pose.inliers_min) estimate.fit = refined;
    estimate.unsure = doubt_of(estimate);
    observe(Stage::kLocalMap, false);
}

void FrameEstimator::take_matches(const NoiseFactors& noise, const RegionContext& expected) noexcept {
    gather(noise, expected);
    choose_weighted(correspondences_.span(), chosen_);
}

std::uint32_t FrameEstimator::mark_moving(const SE3& world_from_camera) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    const double far_chi2 = world_->parameters.region.far_chi2();
    for (Correspondence& c : correspondences_) {
        c.is_moving = (c.is_dynamic && chi2_of_anchor(c, camera_from_world) > far_chi2) ||
                      region_.agreement_of(groups_[c.feature]) < 0.5;
    }
    for (const std::uint16_t i : chosen_) correspondences_[i].is_moving = false;
    std::uint32_t count = 0;
    for (const Correspondence& c : correspondences_) count += c.is_moving ? 1U : 0U;
    return count;
}

void FrameEstimator::gather(const NoiseFactors& noise, const RegionContext& expected) noexcept {
    gather_correspondences(matcher_, *frame_, world_->map, noise, expected, time_ns_, world_->parameters,
                           correspondences_);
    const RegionParameters& region = world_->parameters.region;
    if (!region.is_enabled || region.is_paper()) return;
    if (!expected.has_past && region.reach > 0)
        surfaces_.share_out(frame_->frame(), frame_->keypoints(), correspondences_.span());
    frame_->mask().weigh(frame_->keypoints(), correspondences_.span());
}

}  // namespace stillmesh
