// Each group's own best motion, as if it stood still (paper 2.1.2, coarse to fine: 3k RANSAC iterations, then an
// adjustment), and how far the group agrees with another motion: many small residuals that each pass say "moves"
// together long before one of them does. Limit: the kGroupsMax largest groups, pose.coarse_total_max iterations.
#pragma once

#include <cstdint>

#include "engine/base/random.hpp"
#include "engine/static_region/region_input.hpp"

namespace stillmesh {

// The squared Mahalanobis residual of a correspondence under a pose: the larger one of that at the map's estimate and
// anchor_chi2_share of that where the point was first seen, at most sample_chi2_max: beyond, a match is just wrong.
[[nodiscard]] double chi2_over_time(const Correspondence& c, const SE3& camera_from_world,
                                    const Parameters& configuration) noexcept;

class GroupMotions {
public:
    static constexpr std::uint32_t kGroupsMax = 10;

    void clear() noexcept { count_ = 0; }
    // From the weighted, group by group, the largest first; how many RANSAC iterations that took.
    std::uint32_t fit(const RegionInput& input, Random& random) noexcept;

    // Groups that were asked for a motion; of the others nothing is known.
    [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
    // World from camera; null where a group has none.
    [[nodiscard]] const SE3* motion_of(std::uint16_t group) const noexcept {
        return group < count_ && motions_[group].is_fitted ? &motions_[group].world_from_camera : nullptr;
    }

    // Agreement with a motion: the residuals of the weighted under it, one by one, then what they say together.
    void begin_agreement() noexcept;
    void add_residual(std::uint16_t group, double chi2) noexcept;
    void end_agreement(const RegionParameters& region) noexcept;
    // In [0, 1]; 1 where there is no group, or none with a motion of its own.
    [[nodiscard]] double agreement_of(std::uint16_t group) const noexcept {
        return group < count_ ? motions_[group].agreement : 1.0;
    }

private:
    struct Motion {
        SE3 world_from_camera;
        double chi2_mean = 0;  // of the weighted under it
        double chi2_sum = 0;   // under the motion looked at
        double agreement = 1;  // with the motion looked at
        std::uint32_t weighted = 0;
        bool is_fitted = false;
    };
    // From the members in the scratch.
    static std::uint32_t fit_one(const RegionInput& input, std::uint32_t iterations_max, Random& random,
                                 Motion& motion) noexcept;

    Motion motions_[kGroupsMax];  // by group
    std::uint32_t count_ = 0;
};

}  // namespace stillmesh
