#include "engine/tasks/tracking.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

constexpr double kSecond_ns = 1e9;

// So many times the inliers of a pose must agree before a camera is placed in a map that was loaded.
constexpr std::uint32_t kPlacedFactor = 3;

double seconds(std::int64_t from_ns, std::int64_t to_ns) noexcept {
    return static_cast<double>(to_ns - from_ns) / kSecond_ns;
}

// How far apart colour and depth were taken. A camera that does not know says the same time twice; one whose times are
// farther apart than images of one frame can be has two clocks. The frame was validated: its own time is not negative.
double lag_of(const Frame& frame, double unknown_s) noexcept {
    constexpr std::int64_t kLagMax_ns = 100'000'000;
    if (frame.depth_time_ns <= 0 || frame.depth_time_ns == frame.time_ns) return unknown_s;
    const std::int64_t lag_ns = frame.depth_time_ns - frame.time_ns;
    return lag_ns > kLagMax_ns || lag_ns < -kLagMax_ns ? unknown_s : std::abs(static_cast<double>(lag_ns)) / kSecond_ns;
}

// Of the angle between the axis and the farthest corner of the picture.
double view_cosine_of(const CameraModel& camera) noexcept {
    double cosine = 1.0;
    for (const double x : {0.0, static_cast<double>(camera.width)}) {
        for (const double y : {0.0, static_cast<double>(camera.height)}) {
            const Vector2 n = undistort_to_normalised(camera, {x, y});
            cosine = std::min(cosine, 1.0 / std::sqrt(1.0 + n.squaredNorm()));
        }
    }
    return cosine;
}

RigidTransform transform_of(const SE3& pose) noexcept {
    RigidTransform out;
    const Vector4 q = quaternion_from_rotation(pose.rotation);
    for (int i = 0; i < 4; ++i) out.rotation_xyzw[i] = q(i);
    for (int i = 0; i < 3; ++i) out.translation_m[i] = pose.translation(i);
    return out;
}

// What somebody else's extractor must keep to; without features a frame is lost, not the engine.
bool are_usable(const FeatureSet& features, const CameraModel& camera) noexcept {
    if (features.keypoints.size() != features.descriptors.size()) return false;
    const auto width = static_cast<float>(camera.width);
    const auto height = static_cast<float>(camera.height);
    for (std::size_t i = 0; i < features.size(); ++i) {
        const Keypoint& k = features.keypoints[i];
        // NaN compares false.
        if (!(k.x >= 0.0F && k.x < width && k.y >= 0.0F && k.y < height && k.level < kPyramidLevelsMax)) return false;
    }
    return true;
}

}  // namespace

void Tracking::create(Arena& arena, const Limits& limits, const Configuration& configuration, const CameraModel& camera,
                      const Kernels& kernels, FeatureExtractor* extractor) noexcept {
    configuration_ = configuration;
    camera_ = camera;
    kernels_ = &kernels;
    orb_.create(arena, limits, orb_options(configuration.features), kernels);
    extractor_ = extractor != nullptr ? extractor : &orb_;
    features_.create(arena, limits.features_max);
    double scale = 1.0;
    for (double& s : scale_) {
        s = scale;
        scale *= configuration.features.scale_factor;
    }
    matcher_.create(arena, limits, configuration.matching, camera,
                    std::span<const double>(scale_).first(configuration.features.levels));
    region_.create(arena, limits);
    map_.create(arena, limits, configuration.map);
    local_map_.create(arena, limits, configuration.local_map, view_cosine_of(camera));
    keyframe_queue_.create(arena, kQueueMax);
    grey_ = arena.array<std::uint8_t>(static_cast<std::size_t>(limits.image_width_max) * limits.image_height_max);
    measured_.create(arena, limits.features_max);
    correspondences_.create(arena, limits.features_max);
    chosen_.create(arena, limits.features_max);
    residuals_.create(arena, limits.features_max);
    verdicts_ = arena.array<std::uint8_t>(limits.features_max);
    groups_ = arena.array<std::uint16_t>(limits.features_max);
    view_features_.create(arena, limits.features_max);
    view_edges_.create(arena, mesh_edges_max(limits.features_max));
    noise_.sigma_z_per_m2 = configuration.depth.sigma_z_per_m2;
    noise_.sigma_pixel = configuration.depth.sigma_pixel;
    noise_.z_min_m = configuration.depth.z_min_m;
    noise_.z_max_m = configuration.depth.z_max_m;
    noise_.sigma_max_m = configuration.depth.sigma_max_m;
    shutter_.create(configuration.camera.readout_s, camera.height, configuration.shutter);
    random_ = Random(configuration.seed);
    inlier_ratio_ = configuration_.pose.inlier_ratio_start;
    noise_pixel_ = configuration_.noise.pixel_start;
    noise_depth_ = configuration_.noise.depth_start;
}

void Tracking::reset() noexcept {
    map_.reset();
    local_map_.reset();
    keyframe_queue_.clear();
    keyframes_refused_ = 0;
    empty_cursor_ = 0;
    keyframe_frame_ = 0;
    has_map_ = false;
    has_velocity_ = false;
    lost_frames_ = 0;
    inlier_ratio_ = configuration_.pose.inlier_ratio_start;
    noise_pixel_ = configuration_.noise.pixel_start;
    noise_depth_ = configuration_.noise.depth_start;
    noise_frames_ = 0;
    pose_ = PoseEstimate{};
    world_from_camera_ = SE3{};
    map_from_odom_ = SE3{};
    has_jumped_ = false;
    drift_m_ = 0;
    covariance_ = Matrix6::Zero();
    doubt_.reset();
    shutter_.reset();
    shutter_speed_ = Vector6::Zero();
    pose_by_readout_ = Vector6::Zero();
    pose_by_readout_previous_ = Vector6::Zero();
    context_ = RegionContext{};
    random_ = Random(configuration_.seed);
    hash_ = StateHash{};
    statistics_ = EngineStatistics{};
    frame_ = 0;
    first_frame_ = 0;
    time_shift_ns_ = 0;
    has_time_shift_ = true;
    is_frozen_ = false;
    is_placed_ = true;
    // What view() shows.
    features_.clear();
    correspondences_.clear();
    chosen_.clear();
    frame_statistics_ = FrameStatistics{};
    region_.build({}, features_.keypoints.span(), configuration_.region, context_);
}

GreyView Tracking::grey_of(const Frame& frame) noexcept {
    const ImageView<std::uint8_t>& colour = frame.colour;
    if (frame.format == PixelFormat::kGrey8) return colour;
    const auto convert = frame.format == PixelFormat::kRgb8 ? kernels_->grey_from_rgb : kernels_->grey_from_bgr;
    for (std::uint32_t y = 0; y < colour.height; ++y) {
        convert(colour.row(y), colour.width, grey_.data() + static_cast<std::size_t>(y) * colour.width);
    }
    return {grey_.data(), colour.width, colour.height, colour.width};
}

void Tracking::measure(const Frame& frame) noexcept {
    measured_.set_size(features_.size());
    const double metres_per_unit = 1.0 / frame.depth_units_per_m;
    const double var_base = noise_.sigma_pixel * noise_.sigma_pixel / (camera_.fx * camera_.fy);
    for (std::size_t i = 0; i < features_.size(); ++i) {
        const Keypoint& keypoint = features_.keypoints[i];
        MeasuredFeature& m = measured_[i];
        const auto x = static_cast<double>(keypoint.x);
        const auto y = static_cast<double>(keypoint.y);
        m.normalised = undistort_to_normalised(camera_, {x, y});
        const DepthSample sample =
            sample_depth(frame.depth, metres_per_unit, round_clamped(x), round_clamped(y), noise_);
        m.z_m = sample.mean_m;
        m.seen = m.normalised;
        m.seen_z_m = m.z_m;
        m.var_z = sample.variance_m2;
        const double scale = scale_[keypoint.level];
        m.var_pixel = var_base * scale * scale;
        frame_statistics_.features_with_depth += sample.is_valid() ? 1U : 0U;
    }
}

void Tracking::apply_shutter(const SE3& camera_motion) noexcept {
    shutter_speed_ = se3_log(camera_motion) / seconds(last_time_ns_, time_ns_);
    matcher_.set_shutter(shutter_.readout_s(), shutter_speed_);
    for (std::size_t i = 0; i < features_.size(); ++i) {
        MeasuredFeature& m = measured_[i];
        const double row_time_s = shutter_.row_time_s(static_cast<double>(features_.keypoints[i].y));
        if (m.var_z >= 0) {
            const Vector3 p =
                RollingShutter::at_middle_row(back_project(m.seen, m.seen_z_m), row_time_s, shutter_speed_);
            if (p.z() < kDepthMin_m) continue;
            m.normalised = Vector2(p.x() / p.z(), p.y() / p.z());
            m.z_m = p.z();
        } else {  // how far it is nobody knows: turned only
            Vector6 turning = shutter_speed_;
            for (int k = 0; k < 3; ++k) turning(k) = 0;
            const Vector3 p = RollingShutter::at_middle_row(back_project(m.seen, 1.0), row_time_s, turning);
            if (p.z() < kDepthMin_m) continue;
            m.normalised = Vector2(p.x() / p.z(), p.y() / p.z());
        }
    }
}

void Tracking::learn_shutter(const SE3& world_from_camera, bool counts) noexcept {
    if (!shutter_.is_estimated()) return;
    const SE3 camera_from_world = world_from_camera.inverse();
    shutter_.begin_frame();
    for (const std::uint16_t i : chosen_) {
        const Correspondence& c = correspondences_[i];
        const MapPoint& point = map_.points().at(c.point_slot);
        shutter_.add(c, camera_from_world * c.p_world, camera_from_world.rotation * vector_of(point.world_by_readout),
                     static_cast<double>(features_.keypoints[c.feature].y), shutter_speed_,
                     configuration_.region.point_chi2_max);
    }
    pose_by_readout_previous_ = pose_by_readout_;
    pose_by_readout_ = shutter_.end_frame(counts);
}

// How fast the camera was in the first frame shows in the second: as fast as then.
void Tracking::backdate_speed() noexcept {
    const Handle<Keyframe> first = map_.recent_keyframe(0);
    if (first.is_null() || map_.keyframes().find(first)->time_ns != start_time_ns_) return;
    Keyframe& keyframe = *map_.keyframes().find(first);
    keyframe.speed = shutter_speed_;
    keyframe.readout_s = shutter_.readout_s();
    for (const Observation& o : map_.observations(first)) {
        MapPoint* const point = map_.points().find(o.point);
        if (point == nullptr || point->created_ns != start_time_ns_) continue;
        const Vector3 moves = keyframe.world_from_camera.rotation *
                              shutter_.by_readout(keyframe.world_from_camera.inverse() * vector_of(point->world),
                                                  static_cast<double>(o.y), shutter_speed_);
        store(moves, point->world_by_readout);
        store(moves, point->anchor_by_readout);
    }
}

// How a point that this frame measures at p moves with the readout, in the world, m/s.
Vector3 Tracking::by_readout(const SE3& world_from_camera, const Vector3& p, std::size_t feature) const noexcept {
    const Vector3 turning(pose_by_readout_(3), pose_by_readout_(4), pose_by_readout_(5));
    const Vector3 in_camera =
        shutter_.by_readout(p, static_cast<double>(features_.keypoints[feature].y), shutter_speed_) + turning.cross(p) +
        Vector3(pose_by_readout_(0), pose_by_readout_(1), pose_by_readout_(2));
    return world_from_camera.rotation * in_camera;
}

// The map, and where the camera was, as they would be had the readout been known all along.
void Tracking::adopt_readout() noexcept {
    const double before_s = shutter_.readout_s();
    if (!shutter_.adopt()) return;
    const double change_s = shutter_.readout_s() - before_s;
    map_.express_with_readout(shutter_.readout_s());
    world_from_camera_ = world_from_camera_ * se3_exp(pose_by_readout_ * change_s);
    world_from_camera_previous_ = world_from_camera_previous_ * se3_exp(pose_by_readout_previous_ * change_s);
    renormalise(world_from_camera_.rotation);
    renormalise(world_from_camera_previous_.rotation);
}

// Constant velocity in the camera frame.
void Tracking::predict(const Frame& frame) noexcept {
    const PredictionParameters& p = configuration_.prediction;
    predicted_ = world_from_camera_;
    context_ = RegionContext{};
    context_.colour_depth_lag_s = lag_of(frame, configuration_.region.colour_depth_lag_s);
    const double dt = seconds(last_time_ns_, time_ns_);
    if (has_velocity_) {
        const double before = seconds(previous_time_ns_, last_time_ns_);
        Vector6 xi = se3_log(world_from_camera_previous_.inverse() * world_from_camera_);
        const double speed = std::sqrt(Vector3(xi.tail<3>()).squaredNorm()) / before;
        context_.rotation_speed_rad_s = std::min(speed, p.turn_max_rad_s);
        // What was not measured fades: nobody turns at the same speed for long.
        double factor = std::min(dt / before, p.gap_max);
        for (std::uint32_t i = 0; i < std::min(lost_frames_, p.fading_frames_max); ++i) factor *= p.fading_lost;
        xi *= factor;
        // Nobody slides on for long either; a turn goes on longer.
        if (!is_choice_sure_) {
            for (int i = 0; i < 3; ++i) xi(i) *= p.fading_unsure;
        }
        predicted_ = world_from_camera_ * se3_exp(xi);
    }
    context_.prediction_sigma_m =
        has_velocity_ ? p.sigma_m + p.sigma_m_s * dt : p.still_sigma_m + p.still_sigma_m_s * dt;
    context_.prediction_sigma_rad =
        has_velocity_ ? p.sigma_rad + p.sigma_rad_s * dt : p.still_sigma_rad + p.still_sigma_rad_s * dt;
    context_.world_from_camera_predicted = predicted_;
    context_.has_prediction = true;
    context_.inlier_ratio = inlier_ratio_;
}

void Tracking::gather_correspondences() noexcept {
    correspondences_.clear();
    const bool is_plain = !configuration_.region.is_enabled;
    const WeightParameters& weights = configuration_.weights;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        if (matcher_.claim(i).is_free()) continue;
        MapPoint& point = map_.points().at(matcher_.claim(i).point_slot());
        const MeasuredFeature& m = measured_[i];
        Correspondence c;
        c.feature = static_cast<std::uint32_t>(i);
        c.point_slot = matcher_.claim(i).point_slot();
        c.normalised = m.normalised;
        c.has_depth = m.var_z >= 0;
        if (c.has_depth) {
            c.p_camera = back_project(m.normalised, m.z_m);
            const double slip = context_.rotation_speed_rad_s * context_.colour_depth_lag_s *
                                configuration_.prediction.slip_share * m.z_m;
            c.var_z = m.var_z * noise_depth_ + slip * slip;
        }
        c.var_pixel = m.var_pixel * noise_pixel_;
        c.p_world = vector_of(point.world);
        c.p_anchor = vector_of(point.anchor);
        c.map_var_z = point.var_z * noise_depth_;
        c.map_var_lateral = point.var_lateral * noise_pixel_;
        const double drift =
            std::min(weights.drift_m + weights.drift_m_s * seconds(point.anchor_ns, time_ns_), weights.drift_max_m);
        c.anchor_var_z = point.anchor_var_z * noise_depth_ + drift * drift;
        c.anchor_var_lateral = point.anchor_var_lateral * noise_pixel_ + drift * drift;
        c.distance_bits = matcher_.claim(i).distance_bits;
        c.is_dynamic = !is_plain && point.is_suspect;
        if (is_plain) {
            c.vote = 1.0;
            c.p_anchor = c.p_world;
            c.anchor_var_z = c.map_var_z;
            c.anchor_var_lateral = c.map_var_lateral;
        } else if (c.is_dynamic) {
            c.vote = 0.0;
        } else {
            const double age = std::min(seconds(point.created_ns, time_ns_) / weights.proven_s, 1.0);
            const double weight = static_cast<double>(point.weight_tenths) / static_cast<double>(weights.max);
            c.vote = (weights.unproven + (1.0 - weights.unproven) * age * age) * weight;
        }
        STILLMESH_CHECK(correspondences_.push(c));
    }
}

void Tracking::track(const Frame& frame) noexcept {
    frame_statistics_ = FrameStatistics{};
    frame_statistics_.frame = frame_ - first_frame_;
    if (!has_time_shift_) {  // the map goes on as if this came a second after its last frame
        constexpr std::int64_t kPause_ns = 1'000'000'000;
        time_shift_ns_ = last_time_ns_ + kPause_ns - frame.time_ns;
        has_time_shift_ = true;
    }
    time_ns_ = frame.time_ns + time_shift_ns_;
    correspondences_.clear();
    chosen_.clear();
    static_count_ = 0;

    observe(Stage::kPrepare, true);
    const GreyView grey = grey_of(frame);
    observe(Stage::kPrepare, false);

    observe(Stage::kFeatures, true);
    if (extractor_->extract(grey, features_) != Status::kOk || !are_usable(features_, camera_)) features_.clear();
    std::fill_n(groups_.begin(), features_.size(), kNoGroup);
    frame_statistics_.features = static_cast<std::uint32_t>(features_.size());
    measure(frame);
    matcher_.begin(features_);
    observe(Stage::kFeatures, false);

    if (!has_map_) {
        start_map();
    } else {
        predict(frame);
        const bool is_moving = has_velocity_ && lost_frames_ == 0;
        apply_shutter(is_moving ? world_from_camera_.inverse() * predicted_ : SE3{});
        bool is_found = false;
        if (lost_frames_ <= configuration_.pose.lost_frames_max) is_found = estimate();
        if (!is_found && lost_frames_ > 0) is_found = recover();
        if (!is_found && lost_frames_ > 0) is_found = relocalise();
        if (!is_found) {
            ++lost_frames_;
            is_choice_sure_ = false;
            correspondences_.clear();
            chosen_.clear();
            static_count_ = 0;
            region_.build({}, features_.keypoints.span(), configuration_.region, context_);
            // Nothing was measured: what is shown of this frame says so.
            std::fill_n(groups_.begin(), features_.size(), kNoGroup);
            frame_statistics_.mesh_edges = 0;
            frame_statistics_.mesh_edges_kept = 0;
            frame_statistics_.groups = 0;
            const bool is_predicted = lost_frames_ <= configuration_.pose.lost_frames_max;
            if (!is_predicted && is_placed_) ++statistics_.frames_lost;
            world_from_camera_previous_ = world_from_camera_;
            if (is_predicted) world_from_camera_ = predicted_;
            give_out(is_predicted ? PoseState::kPredicted : PoseState::kNone, Matrix6::Zero());
        }
    }
    if (configuration_.mapping.is_enabled && !is_frozen_ && pose_.state == PoseState::kTracked) {
        notice_empty_places(frame);
    }
    if (!is_frozen_) adopt_readout();
    gather_drift(last_time_ns_);
    previous_time_ns_ = last_time_ns_;
    last_time_ns_ = time_ns_;
    hash_.add(static_cast<std::uint64_t>(time_ns_));
    for (int i = 0; i < 3; ++i) hash_.add(world_from_camera_.translation(i));
    for (int i = 0; i < 9; ++i) hash_.add(world_from_camera_.rotation(i / 3, i % 3));
    hash_.add(static_cast<std::uint32_t>(pose_.state));
    hash_.add(static_cast<std::uint32_t>(correspondences_.size()));
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        const Correspondence& c = correspondences_[i];
        hash_.add(static_cast<std::uint64_t>(c.feature) << 32U | c.point_slot);
        const bool is_there = map_.points().is_taken(c.point_slot);
        const std::uint64_t weight = is_there ? map_.points().at(c.point_slot).weight_tenths : 0U;
        hash_.add(static_cast<std::uint64_t>(c.distance_bits) << 40U | std::uint64_t{groups_[c.feature]} << 16U |
                  weight << 8U | verdicts_[c.feature]);
        if (is_there) hash_.add(map_.points().at(c.point_slot).world[2]);
    }
    for (const double number : pose_.covariance) hash_.add(number);
    hash_.add(frame_statistics_.is_keyframe ? 1U : 0U);
    hash_.add(map_.points_forgotten());
    hash_.add(map_.changes_hash());
    hash_.add(frame_statistics_.mesh_edges_kept);
    hash_.add(static_cast<std::uint32_t>(map_.points().size()));
    ++frame_;
}

void Tracking::start_map() noexcept {
    std::uint32_t usable = 0;
    for (const MeasuredFeature& m : measured_) usable += m.var_z >= 0 ? 1U : 0U;
    region_.build({}, features_.keypoints.span(), configuration_.region, context_);
    if (usable < configuration_.pose.start_inliers_factor *
                     configuration_.pose.inliers_min) {  // nothing to start from: say so, try the next frame
        give_out(PoseState::kNone, Matrix6::Zero());
        return;
    }
    world_from_camera_ = SE3{};
    world_from_camera_previous_ = SE3{};
    has_map_ = true;
    map_.express_with_readout(shutter_.readout_s());
    start_time_ns_ = time_ns_;
    measured_time_ns_ = time_ns_;
    has_velocity_ = false;
    is_choice_sure_ = true;
    lost_frames_ = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        verdicts_[i] = 0;
    }
    make_keyframe();
    keyframe_tracked_ = usable;
    map_covariance_ = Matrix6::Zero();
    covariance_ = Matrix6::Zero();
    doubt_.reset();
    renewed_share_ = 0;
    give_out(PoseState::kTracked, Matrix6::Identity() * 1e10);  // where the odometry begins is no measurement
    renewed_share_ = 1;
}

bool Tracking::estimate() noexcept {
    observe(Stage::kMatching, true);
    const LocalMap* const local = local_map_or_none();
    if (local != nullptr && local_map_.is_stale(map_, predicted_)) local_map_.build(map_, predicted_);
    // Until the past can tell who stands still, and after a choice that was not sure, the motion expected may be that
    // of somebody who walks: what stands still has to be found beside it, or it never gets a say.
    const bool is_wide = !is_choice_sure_ || seconds(start_time_ns_, time_ns_) < configuration_.weights.proven_s;
    matcher_.by_projection(map_, local, predicted_,
                           is_wide ? configuration_.matching.radius_wide_px : configuration_.matching.radius_px);
    gather_correspondences();
    std::uint32_t voters = 0;
    for (const Correspondence& c : correspondences_) voters += c.vote > 0 ? 1U : 0U;
    if (voters < configuration_.matching.matches_min) {
        matcher_.by_projection(map_, local, predicted_, configuration_.matching.radius_wide_px);
        gather_correspondences();
        context_.prediction_sigma_m *= configuration_.prediction.retry_sigma_factor;
        context_.prediction_sigma_rad *= configuration_.prediction.retry_sigma_factor;
    }
    observe(Stage::kMatching, false);
    observe(Stage::kMesh, true);
    region_.build(correspondences_.span(), features_.keypoints.span(), configuration_.region, context_);
    observe(Stage::kMesh, false);
    observe(Stage::kRegion, true);
    RegionChoice choice = region_.choose(correspondences_.span(), configuration_, context_, random_);
    // How large residuals are is not known in the first frames, and changes at once when the camera is jerked: the
    // smallest noise at which the motions found explain most of what votes. Too large, and two motions look like one.
    const NoiseParameters& noise = configuration_.noise;
    const double noise_pixel_before = noise_pixel_;
    const double noise_depth_before = noise_depth_;
    const bool is_young = noise_frames_ < noise.young_frames;
    const std::uint32_t tries = noise_frames_ == 0 ? noise.first_tries : noise.tries;
    for (std::uint32_t i = 0; i < tries && choice.explained_share < noise.explained_min; ++i) {
        noise_pixel_ = std::min(noise_pixel_ * noise.pixel_try_factor, noise.max);
        noise_depth_ = std::min(noise_depth_ * noise.depth_try_factor, noise.max);
        choose_again(choice);
    }
    if (is_young && choice.is_valid) {
        adapt_noise(choice.world_from_camera, region_.voters(), true);
        choose_again(choice);
    }
    observe(Stage::kRegion, false);
    note_groups();
    frame_statistics_.mesh_edges = static_cast<std::uint32_t>(region_.mesh().edges.size());
    frame_statistics_.mesh_edges_kept = region_.kept_count();
    frame_statistics_.groups = region_.groups_count();
    frame_statistics_.region_score = choice.score;
    frame_statistics_.region_margin = choice.margin;
    frame_statistics_.pose_iterations = choice.iterations;
    if (!choice.is_valid || region_.chosen().size() < configuration_.pose.inliers_min) {
        noise_pixel_ = noise_pixel_before;
        noise_depth_ = noise_depth_before;
        return false;
    }

    observe(Stage::kPose, true);
    // Weighs nothing beside a good frame, and keeps a poor one from inventing a jump.
    const MotionPrior prior{context_.world_from_camera_predicted, context_.prediction_sigma_m,
                            context_.prediction_sigma_rad};
    const MotionPrior* const prior_or_none = has_velocity_ && lost_frames_ == 0 ? &prior : nullptr;
    const double chi2_max = configuration_.region.point_chi2_max;
    const std::uint32_t passes = configuration_.pose.final_passes_max;
    RansacOptions options;
    options.confidence = configuration_.pose.confidence;
    options.factor = configuration_.pose.final_factor;
    options.inlier_ratio_min = configuration_.pose.inlier_ratio_min;
    options.sample_chi2_max = configuration_.pose.sample_chi2_max;
    options.iterations_max = configuration_.pose.final_iterations_max;
    options.inlier_ratio_start = inlier_ratio_;
    options.chi2_max = chi2_max;
    const RansacResult final =
        ransac_pose(correspondences_.span(), region_.chosen(), &choice.world_from_camera, options, random_);
    frame_statistics_.pose_iterations += final.iterations;
    PoseFit fit = optimise_pose(correspondences_.span(), region_.chosen(), final.world_from_camera, chi2_max, passes,
                                prior_or_none);
    observe(Stage::kPose, false);
    if (!fit.is_valid || fit.inliers < configuration_.pose.inliers_min) return false;

    // More of the map, where this pose says that it is.
    observe(Stage::kLocalMap, true);
    for (const Correspondence& c : correspondences_) map_.points().at(c.point_slot).last_seen_frame = frame_;
    matcher_.more_by_projection(map_, local, fit.world_from_camera,
                                configuration_.region.more_radius_share * configuration_.matching.radius_px, frame_);
    if (lost_frames_ == 0) apply_shutter(world_from_camera_.inverse() * fit.world_from_camera);
    gather_correspondences();
    chosen_.clear();
    const SE3 camera_from_world = fit.world_from_camera.inverse();
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        const Correspondence& c = correspondences_[i];
        if (!(c.vote > 0)) continue;
        if (chi2_of(c, camera_from_world) <= configuration_.region.more_factor * chi2_max &&
            chi2_of_anchor(c, camera_from_world) <= configuration_.region.more_anchor_factor * chi2_max) {
            STILLMESH_CHECK(chosen_.push(static_cast<std::uint16_t>(i)));
        }
    }
    const PoseFit refined =
        optimise_pose(correspondences_.span(), chosen_.span(), fit.world_from_camera, chi2_max, passes, prior_or_none);
    if (refined.is_valid && refined.inliers >= configuration_.pose.inliers_min) fit = refined;
    observe(Stage::kLocalMap, false);

    observe(Stage::kMapUpdate, true);
    const bool is_sure = choice.margin >= configuration_.region.margin_min &&
                         choice.score >= configuration_.region.score_min &&
                         fit.inliers >= configuration_.pose.sure_inliers_factor * configuration_.pose.inliers_min;
    if (lost_frames_ == 0 && last_time_ns_ == start_time_ns_) backdate_speed();
    learn_shutter(fit.world_from_camera, is_sure && lost_frames_ == 0);
    if (prior_or_none != nullptr) doubt_jump(fit.world_from_camera, is_sure);
    world_from_camera_previous_ = world_from_camera_;
    world_from_camera_ = fit.world_from_camera;
    has_velocity_ = lost_frames_ == 0;
    lost_frames_ = 0;
    measured_time_ns_ = time_ns_;
    if (is_sure) {
        if (!is_young) adapt_noise(fit.world_from_camera, chosen_.span(), false);
        ++noise_frames_;
    }
    is_choice_sure_ = is_sure;
    judge(fit.world_from_camera, is_sure);
    if (configuration_.mapping.is_enabled) count_observers();
    if (!is_frozen_ && wants_keyframe()) make_keyframe();
    give_out(is_sure ? PoseState::kTracked : PoseState::kUnsure, fit.information);
    observe(Stage::kMapUpdate, false);
    return true;
}

// An unsure choice farther than expected from where the motion led: that motion was wrong, or this choice is. (A sure
// one that far off is a jerk.)
void Tracking::doubt_jump(const SE3& world_from_camera, bool is_sure) noexcept {
    if (is_sure) return;
    const SE3 off = context_.world_from_camera_predicted.inverse() * world_from_camera;
    const double sigmas = configuration_.prediction.jump_sigmas;
    const double beyond_m =
        std::max(std::sqrt(off.translation.squaredNorm()) - sigmas * context_.prediction_sigma_m, 0.0);
    const double beyond_rad = std::max(rotation_angle(off.rotation) - sigmas * context_.prediction_sigma_rad, 0.0);
    doubt_.add(time_ns_, {beyond_m * beyond_m, beyond_rad * beyond_rad});
}

void Tracking::note_groups() noexcept {
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        groups_[correspondences_[i].feature] = region_.group_of(i);
    }
}

void Tracking::choose_again(RegionChoice& choice) noexcept {
    gather_correspondences();
    region_.build(correspondences_.span(), features_.keypoints.span(), configuration_.region, context_);
    choice = region_.choose(correspondences_.span(), configuration_, context_, random_);
}

bool Tracking::recover() noexcept {
    const RecoveryParameters& r = configuration_.recovery;
    if (map_.keyframes().size() == 0) return false;
    matcher_.by_descriptor(map_, candidate());
    gather_correspondences();
    chosen_.clear();
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        if (correspondences_[i].vote > 0) STILLMESH_CHECK(chosen_.push(static_cast<std::uint16_t>(i)));
    }
    if (chosen_.size() < r.matches_min) return false;
    RansacOptions options;
    options.confidence = configuration_.pose.confidence;
    options.factor = configuration_.pose.final_factor;
    options.inlier_ratio_min = configuration_.pose.inlier_ratio_min;
    options.sample_chi2_max = configuration_.pose.sample_chi2_max;
    options.iterations_max = configuration_.pose.coarse_iterations_max;
    options.inlier_ratio_start = r.inliers_start;
    options.chi2_max = configuration_.region.point_chi2_max;
    const RansacResult result = ransac_pose(correspondences_.span(), chosen_.span(), nullptr, options, random_);
    // Descriptors alone found these, so that many which agree are no accident; estimate() has the last word.
    if (!result.is_valid || result.inliers < configuration_.pose.inliers_min) return false;
    if (result.inliers < r.inlier_share_min * static_cast<double>(chosen_.size())) return false;
    // Look-alikes are everywhere: nobody gets farther in the time than a camera on a robot or in a hand can. In a map
    // from before nobody knows where it was: more must agree.
    if (is_placed_) {
        const SE3 off = world_from_camera_.inverse() * result.world_from_camera;
        const double away_s = seconds(measured_time_ns_, time_ns_);
        const double reach_m = r.reach_m + r.reach_m_s * away_s;
        if (off.translation.squaredNorm() > reach_m * reach_m) return false;
        if (rotation_angle(off.rotation) > r.reach_rad + r.reach_rad_s * away_s) return false;
    } else if (result.inliers < kPlacedFactor * configuration_.pose.inliers_min) {
        return false;
    }
    predicted_ = result.world_from_camera;
    context_.world_from_camera_predicted = predicted_;
    const std::uint32_t lost_before = lost_frames_;
    const std::int64_t start_before_ns = start_time_ns_;
    if (!is_placed_) start_time_ns_ = time_ns_;  // nothing is known yet of who moves
    if (!estimate()) {
        lost_frames_ = lost_before;
        start_time_ns_ = start_before_ns;
        return false;
    }
    has_velocity_ = false;  // the jump back is not a motion
    if (is_placed_) ++statistics_.recoveries;
    is_placed_ = true;
    return true;
}

void Tracking::adapt_noise(const SE3& world_from_camera, std::span<const std::uint16_t> chosen,
                           bool by_group) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    // Medians of squared normalised residuals over those of chi-square with two degrees of freedom and with one.
    constexpr double kMedian2 = 1.386;
    constexpr double kMedian1 = 0.455;
    const NoiseParameters& p = configuration_.noise;
    const bool is_young = noise_frames_ < p.young_frames;
    const double fall = is_young ? p.fall_young : p.fall;
    const double rise = is_young ? p.rise_young : p.rise;
    for (const bool is_depth : {false, true}) {
        residuals_.clear();
        for (const std::uint16_t i : chosen) {
            const Correspondence& c = correspondences_[i];
            const SE3* const own = by_group ? region_.own_motion(i) : nullptr;
            const Vector3 q = own != nullptr ? own->inverse() * c.p_world : camera_from_world * c.p_world;
            if (!c.has_depth || q.z() < kDepthMin_m) continue;
            const Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
            const double chi2 = is_depth ? r.z * r.z * r.info_z : r.x * r.x * r.info_x + r.y * r.y * r.info_y;
            STILLMESH_CHECK(residuals_.push(static_cast<float>(chi2)));
        }
        if (residuals_.size() < p.residuals_min) return;
        auto* const middle = residuals_.begin() + residuals_.size() / 2;
        std::nth_element(residuals_.begin(), middle, residuals_.end());
        const double ratio = static_cast<double>(*middle) / (is_depth ? kMedian1 : kMedian2);
        double& noise = is_depth ? noise_depth_ : noise_pixel_;
        const double floor = is_depth ? p.depth_min : p.pixel_min;
        noise = std::clamp(noise * std::clamp(ratio, fall, rise), floor, p.max);
    }
}

// Static weights (Algorithm 2, method.md 7), where each point is, and what tracking view and statistics show.
void Tracking::judge(const SE3& world_from_camera, bool is_sure) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    const double chi2_max = configuration_.region.point_chi2_max;
    const WeightParameters& weights = configuration_.weights;
    std::uint32_t dynamic = 0;
    chosen_.clear();
    for (std::size_t i = 0; i < features_.size(); ++i) verdicts_[i] = 0;
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        Correspondence& c = correspondences_[i];
        MapPoint& point = map_.points().at(c.point_slot);
        point.last_seen_frame = frame_;
        if (point.seen < 0xffffU && !is_frozen_) ++point.seen;
        const double chi2_anchor = chi2_of_anchor(c, camera_from_world);
        const bool is_still = c.is_dynamic
                                  ? chi2_anchor <= chi2_max && seconds(point.anchor_ns, time_ns_) >
                                                                   weights.anchor_proven_share * weights.anchor_age_s
                                  : chi2_of(c, camera_from_world) <= chi2_max &&
                                        chi2_anchor <= configuration_.region.anchor_inlier_factor * chi2_max;
        const bool is_moving = c.is_dynamic ? chi2_anchor > chi2_max : !is_still;
        if (c.has_depth && is_sure && configuration_.region.is_enabled && !is_frozen_) {
            if (is_still) {
                if (c.is_dynamic && point.weight_tenths + weights.step >= weights.eligible) {
                    // Votes again, like a new point: it has stood still since its anchor.
                    point.created_ns = time_ns_;
                    point.is_suspect = false;
                }
                point.weight_tenths =
                    static_cast<std::uint8_t>(std::min(point.weight_tenths + weights.step, weights.max));
            } else if (is_moving) {
                point.weight_tenths = static_cast<std::uint8_t>(
                    point.weight_tenths > weights.step ? point.weight_tenths - weights.step : 0U);
                // One bad frame is blur, some are motion.
                if (point.weight_tenths + weights.suspect_steps * weights.step <= weights.eligible) {
                    point.is_suspect = true;
                }
            }
        }
        if (!c.is_dynamic && is_still) {
            STILLMESH_CHECK(chosen_.push(static_cast<std::uint16_t>(i)));
            if (c.has_depth && !is_frozen_) {
                // Kalman update along and across the ray; never surer than a third of one measurement.
                const Vector3 q = camera_from_world * c.p_world;
                // Variances in the map are those of the model: how large they really are changes from frame to frame.
                const double var_z = measured_[c.feature].var_z;
                const double lateral = measured_[c.feature].var_pixel * c.p_camera.z() * c.p_camera.z();
                const double gain_z = std::max(point.var_z / (point.var_z + var_z), weights.gain_min);
                const double gain_lateral =
                    std::max(point.var_lateral / (point.var_lateral + lateral), weights.gain_min);
                Vector3 moved = q;
                const double dz = c.p_camera.z() - q.z();
                moved.z() += gain_z * dz;
                // Across the ray: the difference at the same depth.
                moved.x() = moved.z() * (q.x() / q.z() + gain_lateral * (c.normalised.x() - q.x() / q.z()));
                moved.y() = moved.z() * (q.y() / q.z() + gain_lateral * (c.normalised.y() - q.y() / q.z()));
                store(world_from_camera * moved, point.world);
                const Vector3 learnt =
                    camera_from_world.rotation *
                    (by_readout(world_from_camera, c.p_camera, c.feature) - vector_of(point.world_by_readout));
                store(vector_of(point.world_by_readout) +
                          world_from_camera.rotation *
                              Vector3(learnt.x() * gain_lateral, learnt.y() * gain_lateral, learnt.z() * gain_z),
                      point.world_by_readout);
                point.var_z = std::max(point.var_z * (1.0 - gain_z), weights.variance_min * var_z);
                point.var_lateral = std::max(point.var_lateral * (1.0 - gain_lateral), weights.variance_min * lateral);
            }
            verdicts_[c.feature] = 1;
        } else {
            ++dynamic;
            verdicts_[c.feature] = 2;
        }
        if (point.is_suspect && c.has_depth && !is_frozen_) {
            // Without a vote: followed, so that it does not breed new points, and given a new anchor now and then.
            store(world_from_camera * c.p_camera, point.world);
            store(by_readout(world_from_camera, c.p_camera, c.feature), point.world_by_readout);
            point.var_z = measured_[c.feature].var_z;
            point.var_lateral = measured_[c.feature].var_pixel * c.p_camera.z() * c.p_camera.z();
            point.descriptor = features_.descriptors[c.feature];
            point.angle_rad = features_.keypoints[c.feature].angle_rad;
            point.distance_m = static_cast<float>(c.p_camera.z());
            point.level = features_.keypoints[c.feature].level;
            if (!c.is_dynamic || seconds(point.anchor_ns, time_ns_) > weights.anchor_age_s) {
                store(world_from_camera * c.p_camera, point.anchor);
                store(vector_of(point.world_by_readout), point.anchor_by_readout);
                point.anchor_var_z = point.var_z;
                point.anchor_var_lateral = point.var_lateral;
                point.anchor_ns = time_ns_;
            }
        }
    }
    static_count_ = static_cast<std::uint32_t>(chosen_.size());
    const double share = correspondences_.is_empty()
                             ? configuration_.pose.inlier_ratio_start
                             : static_cast<double>(static_count_) / static_cast<double>(correspondences_.size());
    inlier_ratio_ = std::clamp(share, configuration_.pose.inlier_ratio_min, 1.0);
    new_points_possible_ = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        if (matcher_.claim(i).is_free() && measured_[i].var_z >= 0) ++new_points_possible_;
    }
    frame_statistics_.matches = static_cast<std::uint32_t>(correspondences_.size());
    frame_statistics_.static_matches = static_count_;
    frame_statistics_.dynamic_matches = dynamic;
}

bool Tracking::wants_keyframe() const noexcept {
    const KeyframeParameters& k = configuration_.keyframes;
    const double share =
        keyframe_tracked_ > 0 ? static_cast<double>(static_count_) / static_cast<double>(keyframe_tracked_) : 0.0;
    if (new_points_possible_ < k.new_points_min) return false;
    if (share < k.tracked_share_urgent || static_count_ < k.tracked_urgent)
        return frame_ - keyframe_frame_ >= k.gap_urgent;
    return share < k.tracked_share_max && frame_ - keyframe_frame_ >= k.gap_min;
}

void Tracking::make_keyframe() noexcept {
    // Room for every feature that becomes a point, and no more: what need not go stays. With mapping the room has been
    // made ahead, as a rule; where it has not, the local map goes last.
    const bool is_mapping = configuration_.mapping.is_enabled;
    if (!is_mapping) map_.cull_points(frame_);
    Pool<MapPoint>& points = map_.points();
    std::size_t wanted = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        if (matcher_.claim(i).is_free() && measured_[i].var_z >= 0) ++wanted;
    }
    for (const bool is_local_spared : {true, false}) {
        const std::size_t free = points.capacity() - points.size();
        if (free >= wanted || (is_local_spared && !is_mapping)) continue;
        static_cast<void>(map_.make_room_for_points(static_cast<std::uint32_t>(wanted - free), frame_,
                                                    is_local_spared ? local_map_.spared() : SparedPoints{}));
    }
    if (map_.keyframes().is_full()) {
        if (!is_mapping) {
            map_.evict_oldest();
        } else if (!map_.evict_keyframe(local_map_.keyframes())) {
            STILLMESH_CHECK(map_.evict_keyframe({}));
        }
    }
    const Handle<Keyframe> handle = map_.add_keyframe();
    Keyframe& keyframe = *map_.keyframes().find(handle);
    keyframe.world_from_camera = world_from_camera_;
    keyframe.pose_by_readout = pose_by_readout_;
    keyframe.speed = shutter_speed_;
    keyframe.readout_s = shutter_.readout_s();
    keyframe.time_ns = time_ns_;
    keyframe.frame = frame_;
    keyframe.last_useful_frame = frame_;
    keyframe.drift_m = static_cast<float>(drift_m_);
    for (std::size_t i = 0; i < features_.size(); ++i) {
        Observation observation = observation_of(i);
        // What this frame says does not fit is no observation; a moving point is followed.
        if (!matcher_.claim(i).is_free()) {
            const std::uint32_t slot = matcher_.claim(i).point_slot();
            if (points.is_taken(slot) && (verdicts_[i] == 1 || points.at(slot).is_suspect)) {
                observation.point = points.handle_of(slot);
            }
        }
        map_.add_observation(handle, observation, features_.descriptors[i]);
    }
    map_.attach(handle);
    std::uint32_t added = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        if (!matcher_.claim(i).is_free() || measured_[i].var_z < 0) continue;
        const bool is_suspicious = lies_among_moving(i);
        add_point(i, handle, is_suspicious ? configuration_.weights.suspicious : configuration_.weights.start);
        added += is_suspicious ? 0U : 1U;
    }
    keyframe_frame_ = frame_;
    keyframe_tracked_ = static_count_ + added / configuration_.keyframes.new_per_tracked;
    renewed_share_ = static_cast<double>(added) / static_cast<double>(std::max(static_count_ + added, 1U));
    frame_statistics_.is_keyframe = true;
    ++statistics_.keyframes_made;
    if (is_mapping && !keyframe_queue_.push(handle)) ++keyframes_refused_;
}

// A new feature beside moving ones at the same depth belongs to the same body more likely than not (method.md 7).
bool Tracking::lies_among_moving(std::size_t feature) const noexcept {
    if (!configuration_.region.is_enabled) return false;
    const Keypoint& keypoint = features_.keypoints[feature];
    const double z = measured_[feature].z_m;
    const WeightParameters& weights = configuration_.weights;
    std::uint32_t moving = 0;
    std::uint32_t still = 0;
    matcher_.grid().visit_near(static_cast<double>(keypoint.x), static_cast<double>(keypoint.y), weights.near_px,
                               [&](std::uint32_t i) {
                                   if (verdicts_[i] == 0 || measured_[i].var_z < 0) return;
                                   const double dz = measured_[i].z_m - z;
                                   const double noise = measured_[i].var_z + measured_[feature].var_z;
                                   const double body = weights.near_m * weights.near_m;
                                   if (dz * dz > body + weights.near_sigmas * weights.near_sigmas * noise) return;
                                   ++(verdicts_[i] == 1 ? still : moving);
                               });
    return moving > still;
}

void Tracking::add_point(std::size_t feature, Handle<Keyframe> keyframe, std::uint32_t weight_tenths) noexcept {
    const Result<Handle<MapPoint>> taken = map_.add_point();
    if (!taken.is_ok()) return;  // all others were seen in this very frame; the pool counts the refusal
    MapPoint& point = *map_.points().find(taken.value());
    const MeasuredFeature& m = measured_[feature];
    const Vector3 p = back_project(m.normalised, m.z_m);
    store(world_from_camera_ * p, point.world);
    store(vector_of(point.world), point.anchor);
    store(by_readout(world_from_camera_, p, feature), point.world_by_readout);
    store(vector_of(point.world_by_readout), point.anchor_by_readout);
    point.var_z = m.var_z;
    point.var_lateral = m.var_pixel * m.z_m * m.z_m;
    point.anchor_var_z = point.var_z;
    point.anchor_var_lateral = point.var_lateral;
    point.descriptor = features_.descriptors[feature];
    point.angle_rad = features_.keypoints[feature].angle_rad;
    point.created_ns = time_ns_;
    point.anchor_ns = time_ns_;
    point.last_seen_frame = frame_;
    point.distance_m = static_cast<float>(m.z_m);
    point.level = features_.keypoints[feature].level;
    point.weight_tenths = static_cast<std::uint8_t>(weight_tenths);
    point.is_suspect = weight_tenths < configuration_.weights.eligible;
    point.seen = 1;
    static_cast<void>(map_.link(keyframe, static_cast<std::uint32_t>(feature), taken.value()));
    local_map_.add(taken.value().slot());
}

// How sure the pose is: what this frame measured, and what the map that it was measured against has drifted by.
void Tracking::give_out(PoseState state, const Matrix6& information) noexcept {
    pose_.time_ns = time_ns_ - time_shift_ns_;
    pose_.state = state;
    if (has_jumped_) {
        pose_.odom_from_camera = transform_of(map_from_odom_.inverse() * world_from_camera_);
        pose_.map_from_odom = transform_of(map_from_odom_);
    } else {
        pose_.odom_from_camera = transform_of(world_from_camera_);
    }
    Matrix6 measured = Matrix6::Zero();
    if ((state == PoseState::kTracked || state == PoseState::kUnsure) && invert_spd(information, measured)) {
        // Points that a keyframe adds carry the error of its pose for good: the local map drifts by as much as it is
        // renewed.
        const Matrix6 to_world = se3_adjoint(world_from_camera_);
        Matrix6 half;
        half.noalias() = to_world * measured;
        Matrix6 added;
        added.noalias() = half * to_world.transpose();
        map_covariance_ += added * renewed_share_;
        const MotionDoubt::Variance now{measured(0, 0) + measured(1, 1) + measured(2, 2),
                                        measured(3, 3) + measured(4, 4) + measured(5, 5)};
        doubt_.add(time_ns_, {now.translation_m2 * renewed_share_, now.rotation_rad2 * renewed_share_});
        renewed_share_ = 0;
        MotionDoubt::Variance motion = doubt_.over_window(time_ns_);
        motion.translation_m2 += now.translation_m2;
        motion.rotation_rad2 += now.rotation_rad2;
        const PoseParameters& sure = configuration_.pose;
        if (!(motion.translation_m2 <= sure.sure_sigma_m * sure.sure_sigma_m &&
              motion.rotation_rad2 <= sure.sure_sigma_rad * sure.sure_sigma_rad)) {
            pose_.state = PoseState::kUnsure;
        }
        const Matrix6 to_camera = se3_adjoint(world_from_camera_.inverse());
        half.noalias() = to_camera * map_covariance_;
        covariance_.noalias() = half * to_camera.transpose();
        covariance_ += measured;
    } else {
        for (int i = 0; i < 6; ++i) {
            const double sigma = i < 3 ? context_.prediction_sigma_m : context_.prediction_sigma_rad;
            covariance_(i, i) += sigma * sigma * std::max(lost_frames_, 1U);
        }
    }
    for (int i = 0; i < 36; ++i) pose_.covariance[i] = covariance_(i / 6, i % 6);
}

void Tracking::fill(EngineStatistics& statistics) const noexcept {
    statistics.frames = frame_ - first_frame_;
    statistics.keyframes_made = statistics_.keyframes_made;
    statistics.keyframes_forgotten = map_.keyframes_forgotten();
    statistics.points_forgotten = map_.points_forgotten();
    statistics.frames_lost = statistics_.frames_lost;
    statistics.recoveries = statistics_.recoveries;
    statistics.keyframes_refused = keyframes_refused_;
    statistics.keyframes_evicted = map_.statistics().keyframes_evicted;
    statistics.keyframes_redundant = map_.statistics().keyframes_redundant;
    statistics.points_culled = map_.statistics().points_culled;
    statistics.points_emptied = map_.statistics().points_emptied;
    statistics.points_fused = map_.statistics().points_fused;
    statistics.points_evicted = map_.statistics().points_evicted;
    statistics.keyframe_queue = {static_cast<std::uint32_t>(keyframe_queue_.size()), 0, kQueueMax};
    const auto pool_statistics = [](const auto& pool) {
        return PoolStatistics{static_cast<std::uint32_t>(pool.size()), static_cast<std::uint32_t>(pool.high_water()),
                              static_cast<std::uint32_t>(pool.capacity())};
    };
    statistics.keyframes = pool_statistics(map_.keyframes());
    statistics.map_points = pool_statistics(map_.points());
}

std::uint32_t Tracking::keyframes(std::span<KeyframePose> out) const noexcept {
    std::uint32_t count = 0;
    for (std::uint32_t slot = 0; slot < map_.keyframes().slots_count() && count < out.size(); ++slot) {
        if (!map_.keyframes().is_taken(slot)) continue;
        const Keyframe& keyframe = map_.keyframes().at(slot);
        const Keyframe* const parent = map_.keyframes().find(keyframe.parent);
        out[count++] = {keyframe.frame, parent != nullptr ? parent->frame : kNoKeyframe,
                        transform_of(keyframe.world_from_camera)};
    }
    return count;
}

std::uint64_t Tracking::reference_keyframe() const noexcept {
    Handle<Keyframe> reference = configuration_.mapping.is_enabled ? local_map_.reference(map_) : Handle<Keyframe>{};
    if (reference.is_null()) reference = map_.recent_keyframe(0);
    return reference.is_null() ? kNoKeyframe : map_.keyframes().find(reference)->frame;
}

TrackingView Tracking::view() noexcept {
    view_features_.clear();
    view_edges_.clear();
    for (std::size_t i = 0; i < features_.size(); ++i) {
        TrackedFeature f;
        f.x = features_.keypoints[i].x;
        f.y = features_.keypoints[i].y;
        if (groups_[i] != kNoGroup) f.group = groups_[i];
        STILLMESH_CHECK(view_features_.push(f));
    }
    for (std::size_t i = 0; i < correspondences_.size(); ++i) {
        TrackedFeature& f = view_features_[correspondences_[i].feature];
        f.is_matched = true;
        f.is_dynamic = true;
    }
    for (const std::uint16_t i : chosen_) {
        TrackedFeature& f = view_features_[correspondences_[i].feature];
        f.is_static = true;
        f.is_dynamic = false;
    }
    const Mesh& mesh = region_.mesh();
    for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
        const PixelPoint a = mesh.vertices[mesh.edges[i].a];
        const PixelPoint b = mesh.vertices[mesh.edges[i].b];
        constexpr float kScale = 1.0F / kMeshUnitsPerPixel;
        STILLMESH_CHECK(
            view_edges_.push({static_cast<float>(a.x) * kScale, static_cast<float>(a.y) * kScale,
                              static_cast<float>(b.x) * kScale, static_cast<float>(b.y) * kScale, region_.is_kept(i)}));
    }
    return {view_features_.span(), view_edges_.span()};
}

}  // namespace stillmesh
