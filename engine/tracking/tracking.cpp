#include "engine/tracking/tracking.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"
#include "engine/tracking/attention.hpp"
#include "engine/tracking/frame_hash.hpp"
#include "engine/tracking/late_depth.hpp"

namespace stillmesh {

void Tracking::create(Arena& arena, World& world, const Kernels& kernels, FeatureExtractor* extractor,
                      Relocalisation* relocalisation) noexcept {
    world_ = &world;
    const Limits& limits = world.limits;
    const Parameters& configuration = world.parameters;
    measured_.create(arena, limits, configuration, world.camera, kernels, extractor);
    shutter_.create(configuration, world.camera.height);
    estimator_.create(arena, world, shutter_);
    camera_.create(arena, limits, configuration);
    lost_.create(world, estimator_, empty_places_, relocalisation);
    keyframe_inserter_.create(arena, limits, configuration);
    keyframe_average_.create(arena, limits, configuration);
    judge_.create(arena, limits, configuration);
    view_.create(arena, limits);
    empty_places_.create(configuration);
}

void Tracking::reset() noexcept {
    camera_.reset(world_->parameters);
    lost_.reset();
    measured_.clear();
    estimator_.reset();
    shutter_.reset();
    keyframe_inserter_.reset();
    keyframe_average_.reset();
    empty_places_.reset();
    expected_ = RegionContext{};
    time_shift_ns_ = 0;
    has_time_shift_ = true;
    has_map_ = has_start_ = false;
    hash_ = StateHash{};
    statistics_ = FrameStatistics{};
}

bool Tracking::start_at(const SE3& world_from_camera) noexcept {
    if (has_map_) return false;
    start_ = world_from_camera;
    has_start_ = true;
    return true;
}

void Tracking::begin_in_map(std::uint64_t frames, std::int64_t time_ns, bool is_frozen) noexcept {
    world_->is_frozen = is_frozen;
    world_->clock = {frames, frames, time_ns};
    camera_.begin_in_map(time_ns, world_->parameters);
    keyframe_inserter_.begin_after(frames);
    shutter_.begin_in(world_->map);
    has_time_shift_ = false;
    has_map_ = true;
}

void Tracking::set_observer(StageObserver observer) noexcept {
    observer_ = observer;
    estimator_.set_observer(observer);
}

void Tracking::track(const Frame& frame, const MotionHint* hint) noexcept {
    follow_map();
    measure(frame);
    camera_.hints.take(world_->parameters.hint.is_used ? hint : nullptr, time_ns_, world_->parameters.hint);
    if (!has_map_) {
        start_map();
    } else {
        static_cast<void>(lost_.begin_frame(camera_));
        expect();
        if (follow_motion() || return_to_map()) {
            give_out(estimate_.is_sure() ? PoseState::kTracked : PoseState::kUnsure, estimate_.fit.information);
        } else {
            lose();
        }
    }
    if (world_->parameters.mapping.is_enabled && !lost_.keeps_map() && world_->pose.state == PoseState::kTracked)
        empty_places_.note_empty(measured_, world_from_camera(), camera_.noise.factors().depth, *world_);
    end_frame();
}

// The map moved under the camera since the last frame. What was given out stays given out.
void Tracking::follow_map() noexcept {
    camera_.follow(world_->camera_move);
    lost_.follow(world_->camera_move);
    world_->camera_move = CameraMove{};
}

// Features with their depth, and how unsure both are (paper 2.1.3).
void Tracking::measure(const Frame& frame) noexcept {
    statistics_ = FrameStatistics{};
    statistics_.frame = world_->clock.frame - world_->clock.first_frame;
    if (!has_time_shift_) {  // the map goes on as if this came a second after its last frame
        constexpr std::int64_t kPause_ns = 1'000'000'000;
        time_shift_ns_ = camera_.motion.time_ns() + kPause_ns - frame.time_ns;
        has_time_shift_ = true;
    }
    time_ns_ = frame.time_ns + time_shift_ns_;
    const double told_s = std::abs(depth_lag_s(frame));
    lag_s_ = told_s > 0 ? told_s : world_->parameters.region.colour_depth_lag_s;

    observe(Stage::kPrepare, true);
    const GreyView grey = measured_.grey_of(frame);
    observe(Stage::kPrepare, false);

    observe(Stage::kFeatures, true);
    measured_.extract(grey);
    measured_.measure(frame);
    statistics_.features = static_cast<std::uint32_t>(measured_.size());
    statistics_.features_with_depth = measured_.with_depth_count();
    estimator_.begin(measured_, time_ns_, statistics_);
    observe(Stage::kFeatures, false);
}

void Tracking::start_map() noexcept {
    estimator_.forget();
    const PoseParameters& p = world_->parameters.pose;
    const std::uint32_t usable = measured_.with_depth_count();
    if (usable < p.sure_inliers()) {  // nothing to start from: say so, try the next frame
        give_out(PoseState::kNone, Matrix6::Zero());
        return;
    }
    has_map_ = true;
    camera_.begin_at(has_start_ ? &start_ : nullptr, time_ns_);
    world_->map.express_with_readout(shutter_.readout_s());
    judge_.clear(measured_.size());
    make_keyframe();
    keyframe_inserter_.set_tracked(usable);
    camera_.confidence.reset();
    give_out(PoseState::kTracked, Matrix6::Identity() * 1e10);  // where the odometry begins is no measurement
    camera_.confidence.set_renewed_share(1);
}

void Tracking::expect() noexcept {
    expected_ = camera_.expect(time_ns_, lag_s_, world_->parameters.prediction);
    if (lost_.keeps_map()) expected_.travelled = 0;  // a map that stays as it is does not drift
    if (lost_.is_foretold(camera_)) camera_.hints.weigh_in(expected_, is_young(), world_->parameters);
    const bool is_known = camera_.has_prior() || expected_.hint.is_any;
    estimator_.carry_rows(camera_,
                          is_known ? world_from_camera().inverse() * expected_.world_from_camera_predicted : SE3{});
}

// Nothing has stood still for long enough to tell what moves.
bool Tracking::is_young() const noexcept {
    return seconds_between(camera_.start_time_ns, time_ns_) < world_->parameters.hint.young_s;
}

// Around what is expected. Hints are evidence among others: what the picture does not bear out with them is tried
// without, so that wheels that slip cost no pose. In the beginning nothing else tells a body from the room: there a
// pose that agrees with them is clear however little of the picture it explains (trolley_first:9, where 15 features of
// the room are left, .033 to .019), and one that contradicts them is not sure. Nor is a rival tenable that contradicts
// them where the choice agrees.
void Tracking::estimate() noexcept {
    const HintParameters& p = world_->parameters.hint;
    estimate_ = estimator_.estimate(camera_, expected_);
    if (!expected_.hint.is_any) return;
    const bool is_young_now = is_young();
    const bool is_valid_with_hints = estimate_.is_valid;
    if (is_young_now ? !estimate_.is_valid : !estimate_.is_sure()) {
        RegionContext own = camera_.expect(time_ns_, lag_s_, world_->parameters.prediction);
        own.travelled = expected_.travelled;
        estimate_ = estimator_.estimate(camera_, own);
        if (!estimate_.is_sure() && is_valid_with_hints) estimate_ = estimator_.estimate(camera_, expected_);
    }
    if (!estimate_.is_valid) return;
    const double off = camera_.hints.sigmas_off(estimate_.fit.world_from_camera, p);
    if (off <= p.agreement_sigmas &&
        camera_.hints.sigmas_off(estimate_.contest.world_from_camera, p) > p.contradiction_sigmas) {
        estimate_.contest.is_tenable = false;
    }
    if (!is_young_now) return;
    if (expected_.hint.is_whole && off <= p.agreement_sigmas) estimate_.choice = UnsureReason::kNone;
    if (off > p.contradiction_sigmas) estimate_.choice = estimate_.unsure = UnsureReason::kHint;
}

// Around where the motion leads; a camera on probation has to prove itself besides.
bool Tracking::follow_motion() noexcept {
    if (!lost_.is_foretold(camera_)) return false;
    const bool is_on_probation = lost_.state(camera_) == LostCamera::State::kProbation;
    estimate();
    const bool is_measured = lost_.accepts(estimate_, camera_);
    if (is_measured) learn();
    if (!is_on_probation) {
        expected_ = estimate_.expected;
        return is_measured;
    }
    if (lost_.prove(is_measured, camera_)) return true;
    expect();  // from where it was before
    return false;
}

// To a place that is recognised.
bool Tracking::return_to_map() noexcept {
    if (!lost_.find(expected_, camera_, estimate_)) return false;
    learn();
    lost_.settle(camera_);
    return true;
}

// What an accepted pose says of the camera and of the map.
void Tracking::learn() noexcept {
    estimator_.complete(camera_, estimate_);
    observe(Stage::kMapUpdate, true);
    learn_camera();
    learn_points();
    // Where it is not clear what stands still, the map learns nothing: a keyframe that follows a body would stay.
    if (!lost_.keeps_map() && estimate_.is_clear() &&
        keyframe_inserter_.wants(world_->clock.frame, statistics_.static_matches,
                                 KeyframeInserter::new_points_possible(measured_, estimator_.matcher()))) {
        make_keyframe();
    } else if (estimate_.is_sure() && lost_.state(camera_) != LostCamera::State::kProbation) {
        keyframe_inserter_.look(source(), *world_);
    }
    observe(Stage::kMapUpdate, false);
}

void Tracking::learn_camera() noexcept {
    const SE3& found = estimate_.fit.world_from_camera;
    const bool is_sure = estimate_.is_sure();
    const bool is_on_track = camera_.lost_frames == 0;
    if (is_on_track && camera_.motion.time_ns() == camera_.start_time_ns)
        shutter_.backdate(world_->map, camera_.start_time_ns);
    shutter_.learn(measured_, world_->map, estimator_.correspondences(), estimator_.chosen().span(), found,
                   world_->parameters.region.point_chi2_max,
                   is_sure && is_on_track && lost_.state(camera_) != LostCamera::State::kProbation);
    doubt_jump(found, is_sure);
    if (estimate_.contest.is_tenable)
        camera_.confidence.doubt_contest(time_ns_, found, estimate_.contest.world_from_camera);
    learn_hints();
    if (is_on_track) camera_.rival.learn(estimate_.contest, camera_.motion, time_ns_, world_->parameters.prediction);
    camera_.motion.move_to(found);
    if (is_sure) camera_.reach.note(camera_.motion, is_on_track, time_ns_);
    camera_.motion.set_has_velocity(is_on_track);  // the jump back of one that was lost is not a motion
    camera_.lost_frames = 0;
    camera_.measured_time_ns = time_ns_;
    camera_.is_choice_sure = is_sure;
    camera_.is_on_proven = estimate_.is_on_proven;
    NoiseScale& noise = camera_.noise;
    noise = estimate_.noise;
    if (is_sure) {
        if (!noise.is_young()) noise.adapt(estimator_.correspondences(), estimator_.chosen().span(), found);
        noise.count_frame();
    } else if (!noise.is_young()) {
        noise.undo();  // a guess that nothing confirmed: kept from frame to frame, all bodies would agree
    }
}

// An unsure pose away from where the motion led, and any pose behind a gap: what is in view then may be a body alone,
// whose points agree with each other (crowd_close:2, where one such pose made 11 tracked frames wrong). Before
// the first place in a map that was loaded there was no motion.
void Tracking::doubt_jump(const SE3& found, bool is_sure) noexcept {
    const PredictionParameters& p = world_->parameters.prediction;
    const bool is_gap = camera_.lost_frames > 0 && p.doubts_gaps && camera_.is_placed &&
                        time_ns_ - camera_.measured_time_ns <= MotionDoubt::kWindow_ns;
    if (!is_gap && (!camera_.has_prior() || is_sure)) return;
    const RegionContext& e = is_gap ? expected_ : estimate_.expected;
    MotionPrior prior{e.world_from_camera_predicted, e.prediction_sigma_m, e.prediction_sigma_rad};
    if (is_gap) {  // that of a motion that is known: one that is not leaves more to doubt, not less
        const double frames = 1.0 + camera_.lost_frames;
        const double gap_s = seconds_between(camera_.measured_time_ns, time_ns_);
        prior.sigma_m = frames * p.sigma_m + gap_s * p.sigma_m_s;
        prior.sigma_rad = frames * p.sigma_rad + gap_s * p.sigma_rad_s;
    }
    camera_.confidence.doubt_jump(time_ns_, prior, found);
}

// A sure pose is where hints count from, and says how far off they were; not so while a sure pose may follow a body.
void Tracking::learn_hints() noexcept {
    const bool is_on_track = camera_.lost_frames == 0;
    if (!estimate_.is_sure() || (is_on_track && is_young())) return;
    const SE3& found = estimate_.fit.world_from_camera;
    if (is_on_track) camera_.hints.learn(found, world_->parameters.hint);
    camera_.hints.begin(found, time_ns_);
}

void Tracking::learn_points() noexcept {
    const std::span<const Correspondence> matches = estimator_.correspondences();
    FixedVector<std::uint16_t>& still = estimator_.chosen();
    const SE3& found = estimate_.fit.world_from_camera;
    const bool is_sure = estimate_.is_sure();
    judge_.judge(matches, {posed(), is_sure, lost_.keeps_map()}, world_->map, still);
    const PoseParameters& p = world_->parameters.pose;
    const double share = matches.empty() ? p.inlier_ratio_start
                                         : static_cast<double>(still.size()) / static_cast<double>(matches.size());
    camera_.inlier_ratio = std::clamp(share, p.inlier_ratio_min, 1.0);
    statistics_.matches = static_cast<std::uint32_t>(matches.size());
    statistics_.static_matches = static_cast<std::uint32_t>(still.size());
    statistics_.dynamic_matches = estimator_.mark_moving(found);
    const AttentionParameters& attention = world_->parameters.attention;
    if (attention.is_used && is_sure && !is_young()) {
        measured_.set_moving(
            moving_cells(world_->camera, measured_.keypoints(), matches, still.span(), attention.moving_per_still));
    }
    if (!world_->parameters.mapping.is_enabled) return;
    // What the local map is chosen by: the keyframes that observe the points that the pose was estimated from.
    LocalMap& local_map = world_->local_map;
    local_map.begin_counting();
    for (const std::uint16_t i : still) local_map.count(world_->map, matches[i].point_slot);
    local_map.note_useful(world_->map, world_->clock.frame);
    if (is_sure && !lost_.keeps_map()) keyframe_average_.add(matches, still.span(), found, world_->map);
}

PosedFrame Tracking::posed() const noexcept {
    return {measured_, shutter_, world_from_camera(), world_->clock.frame, time_ns_, camera_.odometry.travelled()};
}

KeyframeInserter::Source Tracking::source() const noexcept {
    return {posed(),
            estimator_.matcher(),
            judge_,
            statistics_.static_matches,
            camera_.odometry.drift_m(),
            estimator_.correspondences()};
}

void Tracking::make_keyframe() noexcept {
    const double renewed_share = keyframe_inserter_.insert(source(), *world_);
    keyframe_average_.begin(world_->map, world_->map.recent_keyframe(0));
    camera_.confidence.set_renewed_share(renewed_share);
    statistics_.is_keyframe = true;
}

// Nothing was measured: what is shown of this frame says so, and for some frames the motion is carried on.
void Tracking::lose() noexcept {
    estimator_.forget();
    camera_.rival.reset();
    measured_.set_moving({});  // what is followed may be a body itself
    const bool is_predicted = lost_.lose(camera_);
    camera_.motion.move_to(is_predicted ? expected_.world_from_camera_predicted : world_from_camera());
    give_out(is_predicted ? PoseState::kPredicted : PoseState::kNone, Matrix6::Zero());
}

void Tracking::give_out(PoseState state, const Matrix6& information) noexcept {
    if (lost_.state(camera_) == LostCamera::State::kProbation) {
        state = PoseState::kNone;
        lost_.count_unproven();
    }
    PoseEstimate& pose = world_->pose;
    PoseConfidence& confidence = camera_.confidence;
    pose.time_ns = time_ns_ - time_shift_ns_;
    pose.state = state;
    camera_.odometry.split(world_from_camera(), pose);
    const double(&at)[3] = pose.odom_from_camera.translation_m;
    const std::int64_t since_ns = confidence.follow_path(time_ns_, Vector3(at[0], at[1], at[2]), state);
    if (since_ns != kNoTime) statistics_.strayed_since_ns = since_ns - time_shift_ns_;
    const bool is_measured = state == PoseState::kTracked || state == PoseState::kUnsure;
    if (state == PoseState::kUnsure) statistics_.unsure = estimate_.unsure;
    if (is_measured && confidence.measured(time_ns_, world_from_camera(), information)) {
        if (state == PoseState::kTracked) statistics_.unsure = confidence.motion_doubt();
        if (statistics_.unsure != UnsureReason::kNone) pose.state = PoseState::kUnsure;
    } else {
        confidence.predicted(camera_.lost_frames, expected_.prediction_sigma_m, expected_.prediction_sigma_rad);
    }
    for (int i = 0; i < 36; ++i) pose.covariance[i] = confidence.covariance()(i / 6, i % 6);
}

void Tracking::end_frame() noexcept {
    if (!lost_.keeps_map()) shutter_.adopt(world_->map, camera_.motion);
    if (has_map_ && world_->clock.frame > 0)
        camera_.odometry.gather_drift(world_->pose.state, camera_.motion, time_ns_, world_->parameters);
    camera_.motion.end_frame(time_ns_);
    camera_.rival.end_frame(time_ns_);
    world_->clock.time_ns = time_ns_;
    world_->noise = camera_.noise.factors();
    add_frame({time_ns_, world_from_camera(), world_->pose, statistics_, estimator_.correspondences(),
               estimator_.groups(), judge_},
              world_->map, hash_);
    ++world_->clock.frame;
}

std::uint64_t Tracking::reference_keyframe() const noexcept {
    const bool is_mapping = world_->parameters.mapping.is_enabled;
    Handle<Keyframe> reference = is_mapping ? world_->local_map.reference(world_->map) : Handle<Keyframe>{};
    if (reference.is_null()) reference = world_->map.recent_keyframe(0);
    const Keyframe* const keyframe = world_->map.keyframes().find(reference);
    return keyframe == nullptr ? kNoKeyframe : keyframe->frame;
}

TrackingView Tracking::view() noexcept {
    TrackingView view = view_.show(measured_.keypoints(), estimator_.groups(), estimator_.correspondences(),
                                   estimator_.chosen().span(), estimator_.region());
    view.explained_by = estimator_.explained_by().first(view.features.size());
    return view;
}

}  // namespace stillmesh
