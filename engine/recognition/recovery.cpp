#include "engine/recognition/recovery.hpp"

#include <algorithm>
#include <numeric>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"

namespace stillmesh {
namespace {

bool is_within_reach(const LastSeen& last_seen, const SE3& world_from_camera, const RecoveryParameters& r) noexcept {
    const SE3 off = last_seen.world_from_camera.inverse() * world_from_camera;
    const double reach_m = r.reach_m + r.reach_m_s * last_seen.away_s;
    if (off.translation.squaredNorm() > reach_m * reach_m) return false;
    return !(rotation_angle(off.rotation) > r.reach_rad + r.reach_rad_s * last_seen.away_s);
}

}  // namespace

Handle<Keyframe> recovery_candidate(const Map& map, bool is_placed, std::uint64_t turn,
                                    std::uint32_t keyframes_max) noexcept {
    const auto count = static_cast<std::uint32_t>(map.keyframes().size());
    if (is_placed) {
        // One keyframe a frame beside the newest, in turn: bounded work, and the whole sliding set within some frames.
        return map.recent_keyframe(static_cast<std::uint32_t>(turn % std::min(count, keyframes_max)));
    }
    // All of them in turn, in steps of about 0.6 of their number: keyframes that follow each other see much the same.
    std::uint32_t step = static_cast<std::uint32_t>(std::uint64_t{count} * 618 / 1000) | 1U;
    while (std::gcd(step, count) != 1) step += 2;
    return map.recent_keyframe(static_cast<std::uint32_t>(turn % count * step % count));
}

Result<SE3> propose_recovery(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                             const LastSeen* last_seen, const Parameters& configuration, Random& random) noexcept {
    const RecoveryParameters& r = configuration.recovery;
    if (chosen.size() < configuration.pose.inliers_min) return Status::kNotFound;
    const PoseParameters& p = configuration.pose;
    RansacOptions options = ransac_options(configuration, p.final_factor, p.inlier_ratio_min);
    options.iterations_max = ransac_options(configuration, p.coarse_factor, p.inlier_ratio_min).iterations_max;
    const RansacResult result = ransac_pose(correspondences, chosen, nullptr, options, random);
    // Descriptors alone found these, so that many which agree are no accident.
    if (!result.is_valid || result.inliers < configuration.pose.inliers_min) return Status::kNotFound;
    if (result.inliers < r.inlier_share_min * static_cast<double>(chosen.size())) return Status::kNotFound;
    if (last_seen == nullptr) {
        if (result.inliers < kPlacedFactor * configuration.pose.inliers_min) return Status::kNotFound;
    } else if (!is_within_reach(*last_seen, result.world_from_camera, r)) {
        return Status::kNotFound;
    }
    const PoseFit fit = optimise_pose(correspondences, chosen, result.world_from_camera,
                                      configuration.region.point_chi2_max, configuration.pose.coarse_passes_max);
    return fit.is_valid ? fit.world_from_camera : result.world_from_camera;
}

}  // namespace stillmesh
