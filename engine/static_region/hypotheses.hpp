// Where the camera may be (paper 2.1.2, coarse to fine): the prediction, RANSAC over all with a weight, each group's
// own motion and RANSAC over what none of these explains; each refined on what agrees with it and scored by Eq. 1 with
// weights. Limits: kHypothesesMax, the iteration caps of the configuration. Cost: some passes over the correspondences
// and one over the triangles for each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/static_region/group_motions.hpp"
#include "engine/static_region/region_input.hpp"

namespace stillmesh {

struct Hypothesis {
    SE3 world_from_camera;
    double score = 0;         // Eq. 1 with weights, [0, 1]
    double plausibility = 1;  // of the motion, beside the expected one
    double surface = 0;       // share that it explains, before points have a past
};

// What a feature stands for in square metres, up to a factor, times its weight.
[[nodiscard]] inline double area_of(const Correspondence& c) noexcept {
    return c.has_depth ? c.weight * c.p_camera.z() * c.p_camera.z() : 0.0;
}
// And the same of the surface around it.
[[nodiscard]] inline double surface_of(const Correspondence& c) noexcept {
    return c.extent * area_of(c);
}

// No camera on a robot or in a hand jumps: a motion far off the one expected needs so many times the support.
[[nodiscard]] double support_needed(const RegionInput& input, const SE3& expected,
                                    const SE3& world_from_camera) noexcept;

class Hypotheses {
public:
    static constexpr std::size_t kHypothesesMax = 14;
    static constexpr std::size_t kNone = kHypothesesMax + 1;  // explains nothing

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        const std::uint32_t n = limits.features_max;
        arena.array<std::uint8_t>(n);
        arena.array<std::uint16_t>(n);
    }
    void create(Arena& arena, const Limits& limits) noexcept;

    // A new frame: none, and no motions.
    void clear() noexcept;
    // All of them anew.
    void propose(const RegionInput& input, Random& random) noexcept;
    // How well a pose explains the frame; the agreement of each group is with this pose afterwards.
    [[nodiscard]] Hypothesis score(const RegionInput& input, const SE3& world_from_camera) noexcept;

    // One of them is chosen.
    [[nodiscard]] std::span<const Hypothesis> all() const noexcept { return hypotheses_.span().first(proposed_); }
    // Behind them the motion of the rival of the frames before, if there is one: it is held against the choice.
    [[nodiscard]] std::span<const Hypothesis> with_rival() const noexcept { return hypotheses_.span(); }
    [[nodiscard]] bool explains(std::size_t hypothesis, std::size_t correspondence) const noexcept {
        return (explained_by_[correspondence] >> hypothesis & 1U) != 0;  // the bit of kNone is never set
    }
    // Share of the weighted that any hypothesis explains.
    [[nodiscard]] double explained_share(std::span<const std::uint16_t> weighted) const noexcept;
    [[nodiscard]] const GroupMotions& motions() const noexcept { return motions_; }
    [[nodiscard]] std::uint32_t iterations() const noexcept { return iterations_; }  // of RANSAC

private:
    void propose_expected(const RegionInput& input) noexcept;
    void propose_over_all(const RegionInput& input, Random& random) noexcept;
    void propose_groups(const RegionInput& input) noexcept;
    void add_rival(const RegionInput& input) noexcept;
    void propose_left_over(const RegionInput& input, Random& random) noexcept;
    void add(const RegionInput& input, const SE3& world_from_camera, double reach) noexcept;
    void judge(const RegionInput& input, const SE3& world_from_camera) noexcept;
    [[nodiscard]] double surface_share(const RegionInput& input, const SE3& world_from_camera) const noexcept;
    struct Share {
        double agreeing = 0;
        double all = 0;
    };
    [[nodiscard]] Share points_of(const RegionInput& input) const noexcept;
    [[nodiscard]] Share triangles_of(const RegionInput& input) const noexcept;

    GroupMotions motions_;
    InlineVector<Hypothesis, kHypothesesMax + 1> hypotheses_;
    std::size_t proposed_ = 0;
    std::span<std::uint8_t> is_inlier_;      // scratch, by correspondence
    std::span<std::uint16_t> explained_by_;  // by correspondence: a bit for each hypothesis it agrees with
    std::uint32_t iterations_ = 0;
};

}  // namespace stillmesh
