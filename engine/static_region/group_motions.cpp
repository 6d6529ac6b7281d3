#include "engine/static_region/group_motions.hpp"

#include <algorithm>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {

double chi2_over_time(const Correspondence& c, const SE3& camera_from_world, const Parameters& configuration) noexcept {
    const double at_anchor = configuration.region.anchor_chi2_share * chi2_of_anchor(c, camera_from_world);
    return std::min(std::max(chi2_of(c, camera_from_world), at_anchor), configuration.pose.sample_chi2_max);
}

std::uint32_t GroupMotions::fit(const RegionInput& input, Random& random) noexcept {
    const PoseParameters& pose = input.configuration.pose;
    const std::uint32_t groups = std::min(input.groups.count(), kGroupsMax);
    std::uint32_t iterations = 0;
    for (count_ = 0; count_ < groups && iterations < pose.coarse_total_max; ++count_) {
        motions_[count_] = Motion{};
        input.scratch.clear();
        for (const std::uint16_t i : input.weighted) {
            if (input.groups.group_of(i) == count_) STILLMESH_CHECK(input.scratch.push(i));
        }
        if (input.scratch.size() < input.configuration.region.group_points_min) continue;
        const std::uint32_t left = pose.coarse_total_max - iterations;
        iterations += fit_one(input, left, random, motions_[count_]);
    }
    return iterations;
}

std::uint32_t GroupMotions::fit_one(const RegionInput& input, std::uint32_t iterations_max, Random& random,
                                    Motion& motion) noexcept {
    const std::span<const std::uint16_t> members = input.scratch.span();
    const RegionParameters& region = input.configuration.region;
    const PoseParameters& pose = input.configuration.pose;
    RansacOptions options = ransac_options(input.configuration, pose.coarse_factor, pose.inlier_ratio_start);
    options.iterations_max = std::min(options.iterations_max, iterations_max);
    const RansacResult result = ransac_pose(input.correspondences, members, nullptr, options, random);
    if (!result.is_valid) return result.iterations;
    const PoseFit fit = optimise_pose(input.correspondences, members, result.world_from_camera, region.point_chi2_max,
                                      input.configuration.pose.coarse_passes_max);
    motion.world_from_camera = fit.is_valid ? fit.world_from_camera : result.world_from_camera;
    motion.is_fitted = true;
    motion.weighted = static_cast<std::uint32_t>(members.size());
    const SE3 camera_from_world = motion.world_from_camera.inverse();
    double sum = 0;
    for (const std::uint16_t i : members)
        sum += chi2_over_time(input.correspondences[i], camera_from_world, input.configuration);
    motion.chi2_mean = sum / motion.weighted;
    return result.iterations;
}

void GroupMotions::begin_agreement() noexcept {
    for (std::uint32_t g = 0; g < count_; ++g) motions_[g].chi2_sum = 0;
}

void GroupMotions::add_residual(std::uint16_t group, double chi2) noexcept {
    if (group < count_) motions_[group].chi2_sum += chi2;
}

// A body agrees with a motion that explains it about as well as its own best motion does. What fitting six unknowns
// gains does not grow with the points, so a large body may bear less for each of them than a small one.
void GroupMotions::end_agreement(const RegionParameters& region) noexcept {
    for (std::uint32_t g = 0; g < count_; ++g) {
        Motion& m = motions_[g];
        if (m.weighted == 0) continue;
        const double excess = m.chi2_sum - m.weighted * m.chi2_mean;
        const double bearable = region.agreement_base + region.agreement_share * m.weighted;
        m.agreement = std::clamp(1.0 - excess / (bearable * (m.chi2_mean + region.agreement_floor)), 0.0, 1.0);
    }
}

}  // namespace stillmesh
