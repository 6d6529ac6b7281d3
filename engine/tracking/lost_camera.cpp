#include "engine/tracking/lost_camera.hpp"

#include <algorithm>

#include "engine/base/time.hpp"
#include "engine/recognition/recovery.hpp"

namespace stillmesh {
namespace {

// A camera found again has so many times the frames of its probation to show what counts.
constexpr std::uint32_t kPatience = 4;

}  // namespace

void LostCamera::create(World& world, FrameEstimator& estimator, const EmptyPlaces& empty_places,
                        Relocalisation* relocalisation) noexcept {
    world_ = &world;
    estimator_ = &estimator;
    empty_places_ = &empty_places;
    relocalisation_ = relocalisation;
}

void LostCamera::reset() noexcept {
    is_on_probation_ = false;  // a place that is tried brings all else
}

LostCamera::State LostCamera::state(const CameraState& camera) const noexcept {
    if (is_on_probation_) return State::kProbation;
    if (camera.lost_frames == 0) return State::kTracked;
    return camera.lost_frames <= world_->parameters.pose.lost_frames_max ? State::kPredicted : State::kLost;
}

// Lost for so long that nothing foretells this frame's pose.
bool LostCamera::is_out_of_touch(const CameraState& camera) const noexcept {
    return state(camera) == State::kLost ||
           (camera.lost_frames > 0 &&
            seconds_between(camera.measured_time_ns, estimator_->time_ns()) > world_->parameters.prediction.goes_on_s);
}

bool LostCamera::begin_frame(CameraState& camera) noexcept {
    if (relocalisation_ != nullptr) relocalisation_->begin_frame();
    if (!is_on_probation_ || ++frames_ <= kPatience * world_->parameters.recovery.probation_frames) return false;
    put_back(camera);
    return true;
}

bool LostCamera::accepts(const Estimate& estimate, const CameraState& camera) noexcept {
    if (!estimate.is_valid) return false;
    const SE3& found = estimate.fit.world_from_camera;
    if (!estimate.is_sure() &&
        (is_out_of_touch(camera) || !camera.reach.holds(found, estimator_->time_ns(), world_->parameters))) {
        return false;
    }
    if (!is_on_probation_) return true;
    // Once it is foretold a sure pose is evidence, as long as the depth agrees; any other may pass and does not count.
    if (sees_through(found, estimate.noise.factors().depth)) return false;
    if (estimate.is_sure()) --frames_left_;
    return true;
}

// A relocalised frame needs more than an ordinary pose: a clear choice, and kPlacedFactor times inliers_min must agree.
// A few that agree among many that do not are no evidence where nothing foretells the camera.
bool LostCamera::is_place(const Estimate& estimate) const noexcept {
    return estimate.is_clear() && estimate.fit.inliers >= kPlacedFactor * world_->parameters.pose.inliers_min;
}

bool LostCamera::prove(bool is_measured, CameraState& camera) noexcept {
    if (!is_measured || is_outweighed(camera)) {
        put_back(camera);
        return false;
    }
    if (frames_left_ == 0) confirm(camera);
    return true;
}

bool LostCamera::find(const RegionContext& expected, CameraState& camera, Estimate& estimate) noexcept {
    return camera.lost_frames > 0 && (recover(expected, camera, estimate) || relocalise(expected, camera, estimate));
}

// Near where the camera was lost: by the descriptors of a keyframe.
bool LostCamera::recover(const RegionContext& expected, CameraState& camera, Estimate& estimate) noexcept {
    const Map& map = world_->map;
    if (map.keyframes().size() == 0) return false;
    const std::uint64_t turn = camera.is_placed ? camera.lost_frames : world_->clock.frame - world_->clock.first_frame;
    const Handle<Keyframe> candidate =
        recovery_candidate(map, camera.is_placed, turn, world_->parameters.recovery.keyframes_max);
    MapMatcher& matcher = estimator_->matcher();
    const std::span<const Descriptor> descriptors = estimator_->frame().features().descriptors.span();
    if (relocalisation_ == nullptr || !relocalisation_->match(map, candidate, descriptors, matcher))
        matcher.by_descriptor(map, candidate);
    estimator_->take_matches(camera.noise.factors(), expected);
    const LastSeen last_seen{camera.world_from_camera(),
                             seconds_between(camera.measured_time_ns, estimator_->time_ns())};
    is_by_words_ = false;
    const Result<SE3> place =
        propose_recovery(estimator_->correspondences(), estimator_->chosen().span(),
                         camera.is_placed ? &last_seen : nullptr, world_->parameters, estimator_->random());
    return place.is_ok() && try_place(place.value(), expected, camera, estimate);
}

// Anywhere in the map: by the words of the picture.
bool LostCamera::relocalise(const RegionContext& expected, CameraState& camera, Estimate& estimate) noexcept {
    if (relocalisation_ == nullptr || !relocalisation_->is_on()) return false;
    query_places(camera.noise.factors());
    if (!relocalisation_->find(world_->map)) return false;
    is_by_words_ = true;
    return try_place(relocalisation_->world_from_camera(), expected, camera, estimate);
}

void LostCamera::query_places(const NoiseFactors& noise) noexcept {
    const MeasuredFrame& frame = estimator_->frame();
    relocalisation_->begin(frame.features().descriptors.span(),
                           {std::max(1.0, noise.pixel), std::max(1.0, noise.depth)});
    for (std::size_t i = 0; i < frame.size(); ++i) relocalisation_->add_feature(frame.observation_of(i));
}

// The camera may be here, unless its depth looks through the map there; the estimate has the last word.
bool LostCamera::try_place(const SE3& place, RegionContext expected, CameraState& camera, Estimate& estimate) noexcept {
    LocalMap& local_map = world_->local_map;
    const RecoveryParameters& p = world_->parameters.recovery;
    before_ = camera;
    local_map.keep_counts();
    is_unexpected_ = is_by_words_ || is_out_of_touch(camera);
    if (is_by_words_) {
        camera.odometry.jump_to(place, camera.world_from_camera());
        local_map.begin_counting();
        for (const PlaceMatch& match : relocalisation_->matches()) local_map.count(world_->map, match.point.slot());
        local_map.invalidate();
    }
    if (!camera.is_placed) camera.start_time_ns = estimator_->time_ns();  // nothing is known yet of what moves
    expected.world_from_camera_predicted = place;
    expected.prediction_sigma_m = world_->parameters.pose.sure_sigma_m;
    expected.prediction_sigma_rad = world_->parameters.pose.sure_sigma_m;
    expected.hint = HintWeight{};
    expected.rival_frames = 0;
    if (is_unexpected_) expected.travelled = 0;  // found in the map as it is: odometry has no say
    bool is_found = !sees_through(place, camera.noise.factors().depth);
    if (is_found) {
        estimate = estimator_->estimate(camera, expected);
        is_found = is_unexpected_ ? is_place(estimate) &&
                                        !sees_through(estimate.fit.world_from_camera, estimate.noise.factors().depth)
                                  : accepts(estimate, camera);
    }
    if (!is_found) {
        put_back(camera);
        return false;
    }
    frames_ = 0;
    here_ = elsewhere_ = 0;
    frames_left_ = is_unexpected_ ? p.probation_frames : 0;
    is_on_probation_ = frames_left_ > 0;
    return true;
}

void LostCamera::settle(CameraState& camera) noexcept {
    camera.is_placed = true;
    if (is_unexpected_) camera.reach.begin(camera.world_from_camera(), estimator_->time_ns());
    if (!is_on_probation_) confirm(camera);
}

// Found again, and all that came since agrees.
void LostCamera::confirm(CameraState& camera) noexcept {
    is_on_probation_ = false;
    if (before_.is_placed) ++world_->statistics.recoveries;
    if (is_by_words_) relocalisation_->note_success();
    const Handle<Keyframe> there = world_->local_map.reference(world_->map);
    if (!there.is_null()) camera.odometry.set_drift(static_cast<double>(world_->map.keyframes().find(there)->drift_m));
}

void LostCamera::put_back(CameraState& camera) noexcept {
    is_on_probation_ = false;
    camera = before_;
    world_->local_map.restore_counts();
}

bool LostCamera::lose(CameraState& camera) noexcept {
    ++camera.lost_frames;
    camera.is_choice_sure = false;
    const bool is_predicted = state(camera) == State::kPredicted;
    if (!is_predicted && camera.is_placed) ++world_->statistics.frames_lost;
    return is_predicted;
}

// Whether the frames of the probation together look more like another place. Before the end clearly so; in the end the
// other way round they must look clearly more like this one.
bool LostCamera::is_outweighed(const CameraState& camera) noexcept {
    if (relocalisation_ == nullptr || !relocalisation_->is_on()) return false;
    query_places(camera.noise.factors());
    const Relocalisation::Evidence evidence = relocalisation_->weigh(world_->map, camera.world_from_camera());
    here_ += evidence.here;
    elsewhere_ += evidence.elsewhere;
    const auto here = static_cast<double>(here_);
    const auto elsewhere = static_cast<double>(elsewhere_);
    const double share_max = world_->parameters.loop.score_share;
    return frames_left_ == 0 ? elsewhere > share_max * here : here < share_max * elsewhere;
}

// Whether too much of the map would have to be in front of what the depth image shows, or nothing of it is seen there.
bool LostCamera::sees_through(const SE3& world_from_camera, double noise_depth) noexcept {
    if (!world_->parameters.mapping.is_enabled) return false;
    world_->local_map.build(world_->map, world_from_camera);
    const EmptyPlaces::Agreement seen =
        empty_places_->agreement(estimator_->frame(), world_from_camera, noise_depth, *world_);
    const double share_max = world_->parameters.recovery.empty_share_max;
    return seen.points_there < world_->parameters.pose.inliers_min ||
           static_cast<double>(seen.empty) > share_max * static_cast<double>(seen.there + seen.empty);
}

}  // namespace stillmesh
