#include "engine/tracking/tracking.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"
#include "engine/map/map_readout.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/recognition/recovery.hpp"
#include "engine/recognition/relocalisation.hpp"
#include "engine/tracking/frame_hash.hpp"
#include "engine/tracking/gather_correspondences.hpp"

namespace stillmesh {
namespace {

// A camera found again has so many times the frames of its probation to show what counts.
constexpr std::uint32_t kPatience = 4;

// How far apart colour and depth were taken. A camera that does not know says the same time twice; one whose times are
// farther apart than images of one frame can be has two clocks. The frame was validated: its own time is not negative.
double lag_of(const Frame& frame, double unknown_s) noexcept {
    constexpr std::int64_t kLagMax_ns = 100'000'000;
    if (frame.depth_time_ns <= 0 || frame.depth_time_ns == frame.time_ns) return unknown_s;
    const std::int64_t lag_ns = frame.depth_time_ns - frame.time_ns;
    return lag_ns > kLagMax_ns || lag_ns < -kLagMax_ns ? unknown_s : std::abs(static_cast<double>(lag_ns)) / kSecond_ns;
}

}  // namespace

void Tracking::create(Arena& arena, World& world, const Kernels& kernels, FeatureExtractor* extractor) noexcept {
    world_ = &world;
    const Limits& limits = world.limits;
    const Configuration& configuration = world.configuration;
    const CameraModel& camera = world.camera;
    measured_.create(arena, limits, configuration, camera, kernels, extractor);
    matcher_.create(arena, limits, configuration.matching, camera, world.pixel_noise.scales());
    region_.create(arena, limits);
    keyframe_inserter_.create(configuration);
    keyframe_looks_.create(arena, limits, configuration);
    correspondences_.create(arena, limits.features_max);
    chosen_.create(arena, limits.features_max);
    noise_.create(arena, limits, configuration.noise);
    judge_.create(arena, limits, configuration);
    groups_ = arena.array<std::uint16_t>(limits.features_max);
    view_.create(arena, limits);
    shutter_.create(configuration, camera.height);
    confidence_.create(configuration);
    empty_places_.create(configuration);
    random_ = Random(configuration.seed);
    inlier_ratio_ = configuration.pose.inlier_ratio_start;
}

void Tracking::reset() noexcept {
    keyframe_inserter_.reset();
    keyframe_looks_.reset();
    noise_.reset();
    motion_.reset();
    shutter_.reset();
    odometry_.reset();
    confidence_.reset();
    empty_places_.reset();
    context_ = RegionContext{};
    random_ = Random(world_->configuration.seed);
    inlier_ratio_ = world_->configuration.pose.inlier_ratio_start;
    lost_frames_ = 0;
    has_map_ = false;
    is_placed_ = true;
    is_proving_ = false;
    probation_frames_ = 0;
    time_shift_ns_ = 0;
    has_time_shift_ = true;
    hash_ = StateHash{};
    frames_lost_ = 0;
    recoveries_ = 0;
    // What view() shows.
    measured_.clear();
    correspondences_.clear();
    chosen_.clear();
    frame_statistics_ = FrameStatistics{};
    region_.build({}, measured_.keypoints(), world_->configuration.region, context_);
}

void Tracking::begin_in_map(std::uint64_t frames, std::int64_t time_ns, bool is_frozen) noexcept {
    has_map_ = true;
    is_placed_ = false;
    world_->is_frozen = is_frozen;
    world_->clock = {frames, frames, time_ns};
    keyframe_inserter_.begin_after(frames);
    measured_time_ns_ = start_time_ns_ = time_ns;
    motion_.begin_after(time_ns);
    has_time_shift_ = false;
    is_choice_sure_ = true;
    // Nothing is carried on from any motion: only recovery may say where the camera is.
    lost_frames_ = world_->configuration.pose.lost_frames_max + 1;
    confidence_.begin_in_map();
    shutter_.begin_in(world_->map);
}

// The map moved under the camera since the last frame: the camera moves along. What was given out stays given out.
void Tracking::follow_map() noexcept {
    CameraMove& move = world_->camera_move;
    if (!move.is_any) return;
    motion_.follow(move.correction);
    reach_.follow(move.correction);
    if (move.has_jumped) odometry_.jump(move.jump);
    move = CameraMove{};
}

void Tracking::track(const Frame& frame) noexcept {
    follow_map();
    prepare(frame);
    if (!has_map_) {
        start_map();
    } else {
        predict(frame);
        bool is_found = false;
        is_proving_ = probation_frames_ > 0;
        if (is_proving_ && ++before_.looks > kPatience * world_->configuration.recovery.probation_frames) {
            end_probation(false);
            is_proving_ = false;
        }
        if (lost_frames_ <= world_->configuration.pose.lost_frames_max) {
            is_found = estimate(is_proving_ ? &frame : nullptr);
        }
        if (is_proving_) {
            is_found = is_found && !is_outweighed();
            is_proving_ = false;
            end_probation(is_found);
        }
        if (!is_found && lost_frames_ > 0) is_found = recover(frame);
        if (!is_found && lost_frames_ > 0) is_found = relocalise(frame);
        if (!is_found) lose();
    }
    if (world_->configuration.mapping.is_enabled && !keeps_map() && world_->pose.state == PoseState::kTracked) {
        empty_places_.look(frame, measured_, world_from_camera(), world_->clock.frame, noise_.factors().depth,
                           world_->local_map, world_->map);
    }
    end_frame();
}

void Tracking::prepare(const Frame& frame) noexcept {
    frame_statistics_ = FrameStatistics{};
    frame_statistics_.frame = world_->clock.frame - world_->clock.first_frame;
    if (!has_time_shift_) {  // the map goes on as if this came a second after its last frame
        constexpr std::int64_t kPause_ns = 1'000'000'000;
        time_shift_ns_ = motion_.time_ns() + kPause_ns - frame.time_ns;
        has_time_shift_ = true;
    }
    time_ns_ = frame.time_ns + time_shift_ns_;
    correspondences_.clear();
    chosen_.clear();

    observe(Stage::kPrepare, true);
    const GreyView grey = measured_.grey_of(frame);
    observe(Stage::kPrepare, false);

    observe(Stage::kFeatures, true);
    measured_.extract(grey);
    std::fill_n(groups_.begin(), measured_.size(), kNoGroup);
    measured_.measure(frame);
    frame_statistics_.features = static_cast<std::uint32_t>(measured_.size());
    frame_statistics_.features_with_depth = measured_.with_depth_count();
    matcher_.begin(measured_.features());
    observe(Stage::kFeatures, false);
}

void Tracking::start_map() noexcept {
    region_.build({}, measured_.keypoints(), world_->configuration.region, context_);
    const std::uint32_t usable = measured_.with_depth_count();
    if (usable < world_->configuration.pose.start_inliers_factor *
                     world_->configuration.pose.inliers_min) {  // nothing to start from: say so, try the next frame
        give_out(PoseState::kNone, Matrix6::Zero());
        return;
    }
    motion_.begin_at_origin();
    reach_.begin(SE3{}, time_ns_);
    has_map_ = true;
    world_->map.express_with_readout(shutter_.readout_s());
    start_time_ns_ = time_ns_;
    measured_time_ns_ = time_ns_;
    is_choice_sure_ = true;
    lost_frames_ = 0;
    judge_.clear(measured_.size());
    make_keyframe();
    keyframe_inserter_.set_tracked(usable);
    confidence_.begin_at_origin();
    give_out(PoseState::kTracked, Matrix6::Identity() * 1e10);  // where the odometry begins is no measurement
    confidence_.set_renewed_share(1);
}

void Tracking::predict(const Frame& frame) noexcept {
    const MotionModel::Prediction expected =
        motion_.predict(time_ns_, world_->configuration.prediction, lost_frames_, is_choice_sure_);
    context_ = RegionContext{};
    context_.world_from_camera_predicted = expected.world_from_camera;
    context_.prediction_sigma_m = expected.sigma_m;
    context_.prediction_sigma_rad = expected.sigma_rad;
    context_.rotation_speed_rad_s = expected.rotation_speed_rad_s;
    context_.colour_depth_lag_s = lag_of(frame, world_->configuration.region.colour_depth_lag_s);
    context_.inlier_ratio = inlier_ratio_;
    context_.has_prediction = true;
    context_.way_m = keeps_map() ? 0.0 : odometry_.way_m();  // a map that stays as it is does not drift
    apply_shutter(has_prior() ? world_from_camera().inverse() * expected.world_from_camera : SE3{});
}

bool Tracking::estimate(const Frame* unexpected) noexcept {
    noise_.begin_frame();
    if (measure(unexpected)) return true;
    noise_.undo();
    return false;
}

bool Tracking::measure(const Frame* unexpected) noexcept {
    match();
    const RegionChoice choice = choose_region();
    if (!choice.is_valid || region_.chosen().size() < world_->configuration.pose.inliers_min) return false;
    PoseFit fit = fit_pose(choice);
    if (!fit.is_valid || fit.inliers < world_->configuration.pose.inliers_min) return false;
    const bool is_choice_clear = choice.margin >= world_->configuration.region.margin_min &&
                                 choice.score >= world_->configuration.region.score_min;
    const std::uint32_t sure_inliers =
        world_->configuration.pose.sure_inliers_factor * world_->configuration.pose.inliers_min;
    const bool is_sure = is_choice_clear && fit.inliers >= sure_inliers;
    // What is not sure either and lies where the camera cannot be, or follows from nothing, is somebody else's motion.
    const bool is_found_elsewhere = unexpected != nullptr && lost_frames_ > 0;
    if (!is_sure && !is_found_elsewhere &&
        (is_out_of_touch() || !reach_.holds(fit.world_from_camera, time_ns_, world_->configuration))) {
        return false;
    }
    // Where nobody expects the camera a few that agree among many that do not are no evidence. On probation such looks
    // do not count, as long as the depth agrees.
    if (unexpected != nullptr) {
        const bool is_on_probation = lost_frames_ == 0;
        const bool is_evidence =
            is_choice_clear && fit.inliers >= kPlacedFactor * world_->configuration.pose.inliers_min;
        if ((!is_evidence && !is_on_probation) || looks_through(*unexpected, fit.world_from_camera)) return false;
        if (is_evidence && is_on_probation) --probation_frames_;
    }
    match_more(fit);
    accept(fit, is_choice_clear && fit.inliers >= sure_inliers, is_choice_clear);
    return true;
}

void Tracking::match() noexcept {
    observe(Stage::kMatching, true);
    const SE3& predicted = context_.world_from_camera_predicted;
    const LocalMap* const local = local_map_or_none();
    if (local != nullptr && world_->local_map.is_stale(world_->map, predicted))
        world_->local_map.build(world_->map, predicted);
    // Until the past can tell who stands still, and after a choice that was not sure, the motion expected may be that
    // of somebody who walks: what stands still has to be found beside it, or it never gets a say.
    const bool is_wide =
        !is_choice_sure_ || seconds_between(start_time_ns_, time_ns_) < world_->configuration.weights.proven_s;
    matcher_.by_projection(
        world_->map, local, predicted,
        is_wide ? world_->configuration.matching.radius_wide_px : world_->configuration.matching.radius_px);
    gather();
    choose_voters(correspondences_.span(), chosen_);
    if (chosen_.size() < world_->configuration.matching.matches_min) {
        matcher_.by_projection(world_->map, local, predicted, world_->configuration.matching.radius_wide_px);
        gather();
        context_.prediction_sigma_m *= world_->configuration.prediction.retry_sigma_factor;
        context_.prediction_sigma_rad *= world_->configuration.prediction.retry_sigma_factor;
    }
    observe(Stage::kMatching, false);
}

RegionChoice Tracking::choose_region() noexcept {
    observe(Stage::kMesh, true);
    region_.build(correspondences_.span(), measured_.keypoints(), world_->configuration.region, context_);
    observe(Stage::kMesh, false);
    observe(Stage::kRegion, true);
    RegionChoice choice = region_.choose(correspondences_.span(), world_->configuration, context_, random_);
    // How large residuals are is not known in the first frames, and changes at once when the camera is jerked: the
    // smallest noise at which the motions found explain most of what votes. Too large, and two motions look like one.
    for (std::uint32_t i = 0;
         i < noise_.tries_max() && choice.explained_share < world_->configuration.noise.explained_min; ++i) {
        noise_.raise();
        choose_again(choice);
    }
    if (noise_.is_young() && choice.is_valid) {
        noise_.adapt_by_group(correspondences_.span(), region_, choice.world_from_camera);
        choose_again(choice);
    }
    observe(Stage::kRegion, false);
    // Correspondences are gathered anew afterwards.
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        groups_[correspondences_[i].feature] = region_.group_of(i);
    }
    weigh_by_agreement();
    frame_statistics_.mesh_edges = static_cast<std::uint32_t>(region_.mesh().edges.size());
    frame_statistics_.mesh_edges_kept = region_.kept_count();
    frame_statistics_.groups = region_.groups_count();
    frame_statistics_.region_score = choice.score;
    frame_statistics_.region_margin = choice.margin;
    frame_statistics_.pose_iterations = choice.iterations;
    return choice;
}

void Tracking::choose_again(RegionChoice& choice) noexcept {
    gather();
    region_.build(correspondences_.span(), measured_.keypoints(), world_->configuration.region, context_);
    choice = region_.choose(correspondences_.span(), world_->configuration, context_, random_);
}

// What many small residuals say together counts in the pose as it did in the choice: each point of a body that sways
// may pass by itself, and all of them take the camera along.
void Tracking::weigh_by_agreement() noexcept {
    for (Correspondence& c : correspondences_) c.vote *= region_.agreement_of(groups_[c.feature]);
}

PoseFit Tracking::fit_pose(const RegionChoice& choice) noexcept {
    observe(Stage::kPose, true);
    RansacOptions options = ransac_options(world_->configuration, world_->configuration.pose.final_factor);
    options.iterations_max = world_->configuration.pose.final_iterations_max;
    options.inlier_ratio_start = inlier_ratio_;
    const RansacResult final =
        ransac_pose(correspondences_.span(), region_.chosen(), &choice.world_from_camera, options, random_);
    frame_statistics_.pose_iterations += final.iterations;
    PoseFit fit = optimise(region_.chosen(), final.world_from_camera);
    observe(Stage::kPose, false);
    return fit;
}

PoseFit Tracking::optimise(std::span<const std::uint16_t> chosen, const SE3& world_from_camera) const noexcept {
    const MotionPrior expected = prior();
    return optimise_pose(correspondences_.span(), chosen, world_from_camera,
                         world_->configuration.region.point_chi2_max, world_->configuration.pose.final_passes_max,
                         has_prior() ? &expected : nullptr);
}

// More of the map, where this pose says that it is.
void Tracking::match_more(PoseFit& fit) noexcept {
    observe(Stage::kLocalMap, true);
    const RegionParameters& region = world_->configuration.region;
    for (const Correspondence& c : correspondences_)
        world_->map.points().at(c.point_slot).last_seen_frame = world_->clock.frame;
    matcher_.more_by_projection(world_->map, local_map_or_none(), fit.world_from_camera,
                                region.more_radius_share * world_->configuration.matching.radius_px,
                                world_->clock.frame);
    if (lost_frames_ == 0) apply_shutter(world_from_camera().inverse() * fit.world_from_camera);
    gather();
    weigh_by_agreement();
    choose_agreeing(correspondences_.span(), fit.world_from_camera, region.more_factor * region.point_chi2_max,
                    region.more_anchor_factor * region.point_chi2_max, chosen_);
    const PoseFit refined = optimise(chosen_.span(), fit.world_from_camera);
    if (refined.is_valid && refined.inliers >= world_->configuration.pose.inliers_min) fit = refined;
    observe(Stage::kLocalMap, false);
}

void Tracking::accept(const PoseFit& fit, bool is_sure, bool is_choice_clear) noexcept {
    observe(Stage::kMapUpdate, true);
    const bool is_on_track = lost_frames_ == 0;
    if (is_on_track && motion_.time_ns() == start_time_ns_) shutter_.backdate(world_->map, start_time_ns_);
    shutter_.learn(measured_, world_->map, correspondences_.span(), chosen_.span(), fit.world_from_camera,
                   world_->configuration.region.point_chi2_max, is_sure && is_on_track && probation_frames_ == 0);
    if (has_prior() && !is_sure) confidence_.doubt_jump(time_ns_, prior(), fit.world_from_camera);
    motion_.move_to(fit.world_from_camera);
    if (is_sure) reach_.note(motion_, is_on_track, time_ns_);
    motion_.set_has_velocity(is_on_track);  // the jump back of one that was lost is not a motion
    lost_frames_ = 0;
    measured_time_ns_ = time_ns_;
    if (is_sure) {
        if (!noise_.is_young()) noise_.adapt(correspondences_.span(), chosen_.span(), fit.world_from_camera);
        noise_.count_frame();
    } else if (!noise_.is_young()) {
        noise_.undo();  // a guess that nothing confirmed: kept from frame to frame, it would make everybody agree
    }
    is_choice_sure_ = is_sure;

    const std::uint32_t moving = judge_.judge(correspondences_.span(),
                                              {measured_, shutter_, fit.world_from_camera, world_->clock.frame,
                                               time_ns_, odometry_.way_m(), is_sure, keeps_map()},
                                              world_->map, chosen_);
    const auto still = static_cast<std::uint32_t>(chosen_.size());
    const double share = correspondences_.is_empty()
                             ? world_->configuration.pose.inlier_ratio_start
                             : static_cast<double>(still) / static_cast<double>(correspondences_.size());
    inlier_ratio_ = std::clamp(share, world_->configuration.pose.inlier_ratio_min, 1.0);
    frame_statistics_.matches = static_cast<std::uint32_t>(correspondences_.size());
    frame_statistics_.static_matches = still;
    frame_statistics_.dynamic_matches = moving;

    if (world_->configuration.mapping
            .is_enabled) {  // what the local map is chosen by: who observes the points that voted
        world_->local_map.begin_counting();
        for (const std::uint16_t i : chosen_) world_->local_map.count(world_->map, correspondences_[i].point_slot);
        world_->local_map.note_useful(world_->map, world_->clock.frame);
        if (is_sure && !keeps_map()) {
            keyframe_looks_.look(correspondences_.span(), chosen_.span(), fit.world_from_camera, world_->map);
        }
    }
    // Where it is not clear who stands still, the map learns nothing: a keyframe that follows somebody would stay.
    if (!keeps_map() && is_choice_clear &&
        keyframe_inserter_.wants(world_->clock.frame, still,
                                 KeyframeInserter::new_points_possible(measured_, matcher_))) {
        make_keyframe();
    }
    give_out(is_sure ? PoseState::kTracked : PoseState::kUnsure, fit.information);
    observe(Stage::kMapUpdate, false);
}

void Tracking::make_keyframe() noexcept {
    const double renewed_share = keyframe_inserter_.insert(
        {measured_, matcher_, judge_, shutter_, world_from_camera(), world_->clock.frame, time_ns_,
         static_cast<std::uint32_t>(chosen_.size()), odometry_.drift_m(), odometry_.way_m()},
        *world_);
    keyframe_looks_.begin(world_->map, world_->map.recent_keyframe(0));
    confidence_.set_renewed_share(renewed_share);
    frame_statistics_.is_keyframe = true;
}

// A lost camera, near where it was lost: by the descriptors of a keyframe (recovery.hpp).
bool Tracking::recover(const Frame& frame) noexcept {
    if (world_->map.keyframes().size() == 0) return false;
    const Handle<Keyframe> candidate = recovery_candidate(
        world_->map, is_placed_, is_placed_ ? lost_frames_ : world_->clock.frame - world_->clock.first_frame,
        world_->configuration.recovery.keyframes_max);
    if (relocalisation_ == nullptr ||
        !relocalisation_->match(world_->map, candidate, measured_.features().descriptors.span(), matcher_)) {
        matcher_.by_descriptor(world_->map, candidate);
    }
    gather();
    choose_voters(correspondences_.span(), chosen_);
    const LastSeen last_seen{world_from_camera(), seconds_between(measured_time_ns_, time_ns_)};
    SE3 proposed;
    return propose_recovery(correspondences_.span(), chosen_.span(), is_placed_ ? &last_seen : nullptr,
                            world_->configuration, random_, proposed) &&
           estimate_at(frame, proposed, false);
}

// A lost camera, anywhere in the map: by the words of its picture (relocalisation.hpp).
bool Tracking::relocalise(const Frame& frame) noexcept {
    if (relocalisation_ == nullptr || !relocalisation_->is_on()) return false;
    begin_relocalisation();
    if (!relocalisation_->find(world_->map)) return false;
    world_->local_map.begin_counting();
    for (const PlaceMatch& match : relocalisation_->matches()) world_->local_map.count(world_->map, match.point.slot());
    world_->local_map.invalidate();
    return estimate_at(frame, relocalisation_->world_from_camera(), true);
}

void Tracking::begin_relocalisation() noexcept {
    relocalisation_->begin(measured_.features().descriptors.span(),
                           {std::max(1.0, noise_.factors().pixel), std::max(1.0, noise_.factors().depth)});
    for (std::size_t i = 0; i < measured_.size(); ++i) relocalisation_->add_feature(measured_.observation_of(i));
}

// On probation: whether its frames together look more like another place. Before the end clearly so; in the end the
// other way round they must look clearly more like this one.
bool Tracking::is_outweighed() noexcept {
    if (relocalisation_ == nullptr || !relocalisation_->is_on()) return false;
    begin_relocalisation();
    const Relocalisation::Evidence evidence = relocalisation_->weigh(world_->map, world_from_camera());
    before_.here += evidence.here;
    before_.elsewhere += evidence.elsewhere;
    const auto here = static_cast<double>(before_.here);
    const auto elsewhere = static_cast<double>(before_.elsewhere);
    const double share_max = world_->configuration.recovery.rival_share_max;
    return probation_frames_ == 0 ? elsewhere > share_max * here : here < share_max * elsewhere;
}

// Whether too much of the map would have to be in front of what the depth image shows, or nothing of it is seen there.
bool Tracking::looks_through(const Frame& frame, const SE3& world_from_camera) noexcept {
    if (!world_->configuration.mapping.is_enabled) return false;
    world_->local_map.build(world_->map, world_from_camera);
    const EmptyPlaces::Agreement seen = empty_places_.agreement(frame, measured_, world_from_camera,
                                                                noise_.factors().depth, world_->local_map, world_->map);
    const RecoveryParameters& p = world_->configuration.recovery;
    return seen.there < p.there_min ||
           static_cast<double>(seen.empty) > p.empty_share_max * static_cast<double>(seen.there + seen.empty);
}

// A lost camera may be here, unless its depth looks through the map there; estimate() has the last word.
bool Tracking::estimate_at(const Frame& frame, const SE3& world_from_camera, bool is_by_words) noexcept {
    if (looks_through(frame, world_from_camera)) {
        world_->local_map.invalidate();
        return false;
    }
    context_.world_from_camera_predicted = world_from_camera;
    context_.prediction_sigma_m = world_->configuration.recovery.sigma_m;
    context_.prediction_sigma_rad = world_->configuration.recovery.sigma_rad;
    const bool is_unexpected = is_by_words || is_out_of_touch();
    before_.world_from_camera = this->world_from_camera();
    before_.odometry = odometry_;
    before_.reach = reach_;
    before_.noise = noise_.factors();
    before_.measured_time_ns = measured_time_ns_;
    before_.start_time_ns = start_time_ns_;
    before_.lost_frames = lost_frames_;
    before_.here = before_.elsewhere = 0;
    before_.looks = 0;
    before_.is_placed = is_placed_;
    before_.is_by_words = is_by_words;
    if (is_by_words) odometry_.jump_to(world_from_camera, this->world_from_camera());
    if (is_unexpected) context_.way_m = 0;  // found in the map as it is: odometry has no say
    if (is_unexpected) probation_frames_ = world_->configuration.recovery.probation_frames;
    if (!is_placed_) start_time_ns_ = time_ns_;  // nothing is known yet of who moves
    if (!estimate(is_unexpected ? &frame : nullptr)) {
        probation_frames_ = 0;
        odometry_ = before_.odometry;
        start_time_ns_ = before_.start_time_ns;
        world_->local_map.invalidate();
        return false;
    }
    is_placed_ = true;
    if (is_unexpected) reach_.begin(this->world_from_camera(), time_ns_);
    if (probation_frames_ == 0) believe();
    return true;
}

// Found again, and all that came since agrees.
void Tracking::believe() noexcept {
    if (before_.is_placed) ++recoveries_;
    if (before_.is_by_words) relocalisation_->note_success();
    const Handle<Keyframe> there = world_->local_map.reference(world_->map);
    if (!there.is_null()) odometry_.set_drift(static_cast<double>(world_->map.keyframes().find(there)->drift_m));
}

// A camera found again is not believed at once: a person who stands like one that the map still holds is a place, too,
// for a frame or two. Meanwhile the map stays as it is and no pose is given out; what fails is undone.
void Tracking::end_probation(bool is_found) noexcept {
    if (is_found) {
        if (probation_frames_ == 0) believe();
        return;
    }
    probation_frames_ = 0;
    odometry_ = before_.odometry;
    reach_ = before_.reach;
    noise_.restore(before_.noise);
    measured_time_ns_ = before_.measured_time_ns;
    start_time_ns_ = before_.start_time_ns;
    lost_frames_ = before_.lost_frames;
    is_placed_ = before_.is_placed;
    motion_.move_to(before_.world_from_camera);
    motion_.set_has_velocity(false);
    world_->local_map.invalidate();
}

// Nothing was measured: what is shown of this frame says so, and for some frames the motion is carried on.
void Tracking::lose() noexcept {
    ++lost_frames_;
    is_choice_sure_ = false;
    correspondences_.clear();
    chosen_.clear();
    region_.build({}, measured_.keypoints(), world_->configuration.region, context_);
    std::fill_n(groups_.begin(), measured_.size(), kNoGroup);
    frame_statistics_.mesh_edges = 0;
    frame_statistics_.mesh_edges_kept = 0;
    frame_statistics_.groups = 0;
    const bool is_predicted = lost_frames_ <= world_->configuration.pose.lost_frames_max;
    if (!is_predicted && is_placed_) ++frames_lost_;
    motion_.move_to(is_predicted ? context_.world_from_camera_predicted : world_from_camera());
    give_out(is_predicted ? PoseState::kPredicted : PoseState::kNone, Matrix6::Zero());
}

void Tracking::give_out(PoseState state, const Matrix6& information) noexcept {
    if (probation_frames_ > 0) {
        state = PoseState::kNone;
        if (before_.is_placed) ++frames_lost_;
    }
    world_->pose.time_ns = time_ns_ - time_shift_ns_;
    world_->pose.state = state;
    odometry_.split(world_from_camera(), world_->pose);
    const bool is_measured = state == PoseState::kTracked || state == PoseState::kUnsure;
    if (is_measured && confidence_.measured(time_ns_, world_from_camera(), information)) {
        if (!confidence_.is_motion_sure()) world_->pose.state = PoseState::kUnsure;
    } else {
        confidence_.predicted(lost_frames_, context_.prediction_sigma_m, context_.prediction_sigma_rad);
    }
    for (int i = 0; i < 36; ++i) world_->pose.covariance[i] = confidence_.covariance()(i / 6, i % 6);
}

void Tracking::end_frame() noexcept {
    if (!keeps_map()) shutter_.adopt(world_->map, motion_);
    if (has_map_ && world_->clock.frame > 0)
        odometry_.gather_drift(world_->pose.state, motion_, time_ns_, world_->configuration.loop);
    motion_.end_frame(time_ns_);
    world_->clock.time_ns = time_ns_;
    world_->noise = noise_.factors();
    add_frame({time_ns_, world_from_camera(), world_->pose, frame_statistics_}, correspondences_.span(), groups_,
              judge_, world_->map, hash_);
    ++world_->clock.frame;
}

void Tracking::gather() noexcept {
    gather_correspondences(matcher_, measured_, world_->map, noise_.factors(), context_, time_ns_,
                           world_->configuration, correspondences_);
}

void Tracking::apply_shutter(const SE3& camera_motion) noexcept {
    shutter_.set_motion(camera_motion, seconds_between(motion_.time_ns(), time_ns_));
    matcher_.set_shutter(shutter_.readout_s(), shutter_.speed());
    measured_.carry_to_middle_row(shutter_.shutter(), shutter_.speed());
}

void Tracking::fill(EngineStatistics& statistics) const noexcept {
    statistics.frames = world_->clock.frame - world_->clock.first_frame;
    statistics.frames_lost = frames_lost_;
    statistics.recoveries = recoveries_;
    keyframe_inserter_.fill(statistics);
    statistics.keyframe_queue = {static_cast<std::uint32_t>(world_->keyframe_queue.size()), 0,
                                 World::kKeyframeQueueMax};
    fill_map_statistics(world_->map, statistics);
}

std::uint64_t Tracking::reference_keyframe() const noexcept {
    Handle<Keyframe> reference =
        world_->configuration.mapping.is_enabled ? world_->local_map.reference(world_->map) : Handle<Keyframe>{};
    if (reference.is_null()) reference = world_->map.recent_keyframe(0);
    const Keyframe* const keyframe = world_->map.keyframes().find(reference);
    return keyframe == nullptr ? kNoKeyframe : keyframe->frame;
}

TrackingView Tracking::view() noexcept {
    return view_.show(measured_.keypoints(), groups_, correspondences_.span(), chosen_.span(), region_);
}

}  // namespace stillmesh
