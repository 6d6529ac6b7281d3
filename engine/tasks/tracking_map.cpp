// How tracking and the map it works in meet between frames.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/base/numbers.hpp"
#include "engine/tasks/relocalisation.hpp"
#include "engine/tasks/tracking.hpp"

namespace stillmesh {
void Tracking::follow(const SE3& correction) noexcept {
    for (SE3* const pose : {&world_from_camera_, &world_from_camera_previous_}) {
        *pose = correction * *pose;
        renormalise(pose->rotation);
    }
    // What tracking gave out stays given out; the next frame starts from here.
}

void Tracking::begin_in_map(std::uint64_t frames, std::int64_t time_ns, bool is_frozen) noexcept {
    has_map_ = true;
    is_placed_ = false;
    is_frozen_ = is_frozen;
    frame_ = first_frame_ = keyframe_frame_ = frames;
    last_time_ns_ = previous_time_ns_ = measured_time_ns_ = start_time_ns_ = time_ns;
    has_time_shift_ = false;
    has_velocity_ = false;
    is_choice_sure_ = true;
    // Nothing is carried on from any motion: only recover() may say where the camera is.
    lost_frames_ = configuration_.pose.lost_frames_max + 1;
    map_covariance_ = Matrix6::Zero();
    renewed_share_ = 0;
    keyframe_tracked_ = 0;
    shutter_.start_from(map_.readout_s());
    if (shutter_.readout_s() != map_.readout_s()) map_.express_with_readout(shutter_.readout_s());  // it is given
}

Handle<Keyframe> Tracking::candidate() const noexcept {
    const auto count = static_cast<std::uint32_t>(map_.keyframes().size());
    if (is_placed_) {
        // One keyframe a frame beside the newest, in turn: bounded work, and the whole sliding set within some frames.
        return map_.recent_keyframe(lost_frames_ % std::min(count, configuration_.recovery.keyframes_max));
    }
    // All of them in turn, in steps of about 0.6 of their number: keyframes that follow each other see much the same.
    std::uint32_t step = static_cast<std::uint32_t>(std::uint64_t{count} * 618 / 1000) | 1U;
    while (std::gcd(step, count) != 1) step += 2;
    return map_.recent_keyframe(static_cast<std::uint32_t>((frame_ - first_frame_) % count * step % count));
}

void Tracking::jump(const SE3& correction) noexcept {
    follow(correction);
    map_from_odom_ = correction * map_from_odom_;
    renormalise(map_from_odom_.rotation);
    has_jumped_ = true;
    local_map_.invalidate();
}

Observation Tracking::observation_of(std::size_t feature) const noexcept {
    const Keypoint& keypoint = features_.keypoints[feature];
    const MeasuredFeature& m = measured_[feature];
    Observation observation;
    observation.x = keypoint.x;
    observation.y = keypoint.y;
    observation.normalised_x = static_cast<float>(m.normalised.x());
    observation.normalised_y = static_cast<float>(m.normalised.y());
    observation.z_m = static_cast<float>(m.z_m);
    observation.var_z = static_cast<float>(m.var_z);
    observation.angle_rad = keypoint.angle_rad;
    observation.level = keypoint.level;
    return observation;
}

// A lost camera, anywhere in the map: by the words of its picture (relocalisation.hpp). estimate() has the last word.
bool Tracking::relocalise() noexcept {
    if (relocalisation_ == nullptr || !relocalisation_->is_on()) return false;
    relocalisation_->begin(features_.descriptors.span());
    for (std::size_t i = 0; i < features_.size(); ++i) {
        relocalisation_->add_feature(observation_of(i));
    }
    const PlaceVerifier::Noise noise{std::max(1.0, noise_pixel_), std::max(1.0, noise_depth_)};
    if (!relocalisation_->find(map_, features_.descriptors.span(), noise)) return false;
    predicted_ = relocalisation_->world_from_camera();
    context_.world_from_camera_predicted = predicted_;
    local_map_.begin_counting();
    for (const PlaceMatch& match : relocalisation_->matches()) local_map_.count(map_, match.point.slot());
    local_map_.invalidate();
    // The camera did not move from where odometry lost it, as far as odometry knows: the map takes the jump.
    const SE3 map_from_odom_before = map_from_odom_;
    const bool has_jumped_before = has_jumped_;
    const std::uint32_t lost_before = lost_frames_;
    const std::int64_t start_before_ns = start_time_ns_;
    if (!is_placed_) start_time_ns_ = time_ns_;  // nothing is known yet of who moves
    map_from_odom_ = predicted_ * (map_from_odom_.inverse() * world_from_camera_).inverse();
    renormalise(map_from_odom_.rotation);
    has_jumped_ = true;
    if (!estimate()) {
        lost_frames_ = lost_before;
        start_time_ns_ = start_before_ns;
        map_from_odom_ = map_from_odom_before;
        has_jumped_ = has_jumped_before;
        local_map_.invalidate();
        return false;
    }
    has_velocity_ = false;  // the jump is not a motion
    if (is_placed_) ++statistics_.recoveries;
    is_placed_ = true;
    relocalisation_->note_success();
    return true;
}

// How far odometry can be off by now, beside what it was before: a share of the way, more when unsure, and as far as a
// camera gets while nothing is measured.
void Tracking::gather_drift(std::int64_t since_ns) noexcept {
    if (!has_map_) return;
    const LoopParameters& p = configuration_.loop;
    if (pose_.state >= PoseState::kUnsure) {
        const Vector3 step = world_from_camera_.translation - world_from_camera_previous_.translation;
        const double share = pose_.state == PoseState::kTracked ? 1.0 : 3.0;
        if (frame_ > 0) drift_m_ += share * p.drift_share * std::sqrt(step.squaredNorm());
    } else if (frame_ > 0) {
        drift_m_ += p.drift_lost_m_s * static_cast<double>(time_ns_ - since_ns) * 1e-9;
    }
}

void Tracking::count_observers() noexcept {
    local_map_.begin_counting();
    for (const std::uint16_t i : chosen_) local_map_.count(map_, correspondences_[i].point_slot);
    local_map_.note_useful(map_, frame_);
}

void Tracking::notice_empty_places(const Frame& frame) noexcept {
    const std::span<const std::uint32_t> slots = local_map_.points();
    if (slots.empty()) return;
    const EmptinessParameters& p = configuration_.emptiness;
    const auto reach_px = static_cast<std::int32_t>(p.reach_px);
    const SE3 camera_from_world = world_from_camera_.inverse();
    const double metres_per_unit = 1.0 / frame.depth_units_per_m;
    const auto width = static_cast<std::int32_t>(camera_.width);
    const auto height = static_cast<std::int32_t>(camera_.height);
    const auto looks = static_cast<std::uint32_t>(std::min<std::size_t>(p.places_per_frame, slots.size()));
    for (std::uint32_t i = 0; i < looks; ++i) {
        empty_cursor_ = empty_cursor_ + 1 < slots.size() ? empty_cursor_ + 1 : 0;
        const std::uint32_t slot = slots[empty_cursor_];
        if (!map_.points().is_taken(slot)) continue;
        MapPoint& point = map_.points().at(slot);
        if (point.last_seen_frame == frame_) {
            if (!point.is_suspect) point.empty_views = 0;
            continue;
        }
        const Vector3 q = camera_from_world * vector_of(point.world);
        if (q.z() < configuration_.depth.z_min_m || q.z() > configuration_.depth.z_max_m) continue;
        const Vector2 n(q.x() / q.z(), q.y() / q.z());
        if (n.squaredNorm() > 4.0) continue;  // before distortion is computed
        const Vector2 pixel = distort_to_pixel(camera_, n);
        const std::int32_t x = round_clamped(pixel.x(), -100, width + 100);
        const std::int32_t y = round_clamped(pixel.y(), -100, height + 100);
        if (x < reach_px || y < reach_px || x >= width - reach_px || y >= height - reach_px) {
            continue;
        }
        const double sigma = noise_.sigma_z_per_m2 * q.z() * q.z();
        const double beyond = q.z() + p.margin_m + p.sigmas * std::sqrt(sigma * sigma * noise_depth_ + point.var_z);
        bool is_empty = true;
        bool is_there = false;
        for (std::int32_t dy = -reach_px; dy <= reach_px; dy += reach_px) {
            for (std::int32_t dx = -reach_px; dx <= reach_px; dx += reach_px) {
                const std::uint16_t raw =
                    frame.depth.row(static_cast<std::uint32_t>(y + dy))[static_cast<std::uint32_t>(x + dx)];
                const double z = raw * metres_per_unit;
                if (raw == 0 || z <= beyond) is_empty = false;
                if (raw != 0 && z <= beyond && z >= q.z() - (beyond - q.z())) is_there = true;
            }
        }
        if (is_empty) {
            if (++point.empty_views < p.views) continue;
            map_.release_point(map_.points().handle_of(slot));
            map_.count_emptied();
        } else if (is_there && point.empty_views > 0) {
            --point.empty_views;
        }
    }
}

}  // namespace stillmesh
