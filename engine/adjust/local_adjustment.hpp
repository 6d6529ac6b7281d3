// Local bundle adjustment (paper 2.1, method.md 6): the poses of a window of keyframes and the points they see, so that
// the robust (Huber) sum of reprojection and depth residuals over all observations is smallest; keyframes at the rim of
// the window hold still. Levenberg-Marquardt with a gain ratio; the points are eliminated (Schur complement), the
// keyframes' dense system is factorised by blocks. After the first round observations that fit nowhere are dropped, and
// a shorter second round runs without them.
//
// A machine that can stop anywhere: begin(), add_...(), start(), step() until kDone, then the results. The problem is a
// copy, so the map may change meanwhile. However it is cut into slices, the results have the same bits.
//
// Limits: AdjustmentSizes; full says kFull. Cost: one unit is one residual evaluated (or one product of two 6x6
// blocks); step() overdraws its budget by less than kPieceUnitsMax. An iteration takes two units per observation, half
// a unit per pair of free keyframes that share a point, and n^3 / 6 for n free keyframes.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/bundle.hpp"
#include "engine/adjust/reduced_system.hpp"
#include "engine/base/arena.hpp"

namespace stillmesh {

struct AdjustmentSizes {
    std::uint32_t free_keyframes_max = 0;   // at most LocalAdjustment::kFreeKeyframesMax
    std::uint32_t fixed_keyframes_max = 0;  // free and fixed together at most kKeyframesMax
    std::uint32_t points_max = 0;
    std::uint32_t observations_max = 0;
};

struct AdjustmentOptions {
    std::uint32_t iterations_max[2] = {6, 4};  // of the two rounds, refused steps included; second 0: one round
    // Squared sigmas beyond which an observation counts by Huber's cost, and as an outlier after the first round:
    // chi2 of 95 % with 2 and 3 degrees of freedom.
    double chi2_max_pixel = 5.991;  // without depth
    double chi2_max_depth = 7.815;  // with depth
    double cost_change_min = 1e-4;  // a round has converged when an iteration lowers the cost by less than this share
    double damping_initial = 1e-4;  // of the diagonal
};

enum class AdjustmentOutcome : std::uint8_t {
    kConverged = 0,    // the cost stopped falling
    kIterationsEnded,  // the last round was stopped by its limit, or by damping; the results are better than the input
    kUnchanged,        // nothing to solve, or no step lowered the cost (singular): results are the input, bit for bit
};

struct AdjustmentSummary {
    AdjustmentOutcome outcome = AdjustmentOutcome::kUnchanged;
    std::uint32_t iterations = 0;  // of both rounds, refused steps included
    std::uint32_t steps_accepted = 0;
    std::uint32_t observations_used = 0;  // in the last round
    std::uint32_t residuals_used = 0;     // two or three for each of them
    std::uint32_t outliers = 0;           // of all observations, at the end
    std::uint32_t points_used = 0;        // in the last round; the others are as they were before it
    std::uint32_t keyframes_used = 0;     // free ones with enough observations to move, in the last round
    double initial_cost = 0;              // of the first round, at the input
    double first_round_cost = 0;          // of the same observations at its end
    double final_cost = 0;                // of the observations of the last round
    std::uint64_t units = 0;              // spent on the whole job
};

// The pieces of a job, in order. Sorting happens once; a round is kSelect and iterations of kLinearise to
// kEvaluate.
enum class LocalPhase : std::uint8_t {
    kSortByKeyframe,  // order_ lists the observations by keyframe
    kPlacePoints,     // where each point's observations will begin
    kSortByPoint,     // position_ says where each observation goes
    kPermute,         // they go there
    kSelect,          // which points and keyframes take part in the round
    kClear,           // zero sums
    kLinearise,       // point by point: derivatives, elimination of the point
    kFactorise,       // column by column
    kSolve,           // keyframes' steps, candidate poses
    kEvaluate,        // point by point: the point's step, cost at the candidate
    kClassify,        // chi2 of every observation at the result of the round
};

struct LocalKeyframe : BundleKeyframe {
    std::uint32_t observations = 0;  // given; later where they go in order_
    std::int32_t column = -1;        // in the reduced system; -1: holds still
};
// From `end` to the next point's `begin` lie duplicates.
struct LocalPoint : BundlePoint {
    std::int32_t last_keyframe = -1;  // sorted in so far
};

class LocalAdjustment
    : public BundleJob<AdjustmentJob<LocalAdjustment, LocalPhase, AdjustmentOptions, AdjustmentSummary>, LocalKeyframe,
                       LocalPoint> {
    // All arrays, for the plan and for the arena. Above plan(): clang evaluates no template that it has not seen.
    template <typename A>
    constexpr void take_arrays(A& arena, const AdjustmentSizes& sizes) noexcept {
        arena.take(keyframes_, sizes.free_keyframes_max + sizes.fixed_keyframes_max);
        arena.take(columns_, sizes.free_keyframes_max);
        arena.take(points_, sizes.points_max);
        arena.take(observations_, sizes.observations_max);
        arena.take(order_, sizes.observations_max);
        arena.take(position_, sizes.observations_max);
    }

public:
    static constexpr std::uint32_t kFreeKeyframesMax = ReducedSystem::kBlocksMax;
    static constexpr std::uint32_t kKeyframesMax = 96;
    // A point has at most one observation in each keyframe: kKeyframesMax + 24 * 25 / 4 is the largest piece.
    static constexpr std::uint32_t kPieceUnitsMax = 256;

    static constexpr void plan(ArenaPlan& arena, const AdjustmentSizes& sizes) noexcept {
        LocalAdjustment().take_arrays(arena, sizes);
        ReducedSystem::plan(arena, sizes.free_keyframes_max);
    }
    void create(Arena& arena, const AdjustmentSizes& sizes) noexcept;

    // Forgets everything, a running job too.
    void begin() noexcept;
    // kFull: no room for one more of its kind. kInvalid: not finite, or not a rotation.
    [[nodiscard]] Result<std::uint32_t> add_keyframe(const SE3& world_from_camera, bool is_fixed) noexcept;
    // kFull. kInvalid: not finite, or a variance that is not positive. A second observation of a point by the same
    // keyframe is taken, counts as an outlier, and has no say. Observations are numbered 0, 1, ... in this order.
    [[nodiscard]] Status add_observation(const AdjustmentObservation& given) noexcept;
    void start(const AdjustmentOptions& options) noexcept;

    [[nodiscard]] std::uint32_t observations() const noexcept { return observation_count_; }

    // Results: only when is_done() (CHECK).
    // Squared sigmas at the result; kAdjustChi2Far: behind the camera, beyond all measure, or a duplicate.
    [[nodiscard]] double chi2(std::uint32_t observation) const noexcept;
    [[nodiscard]] bool is_outlier(std::uint32_t observation) const noexcept;

private:
    friend AdjustmentJob;
    using Phase = LocalPhase;
    using Keyframe = LocalKeyframe;
    using Point = LocalPoint;
    // Sums over the observations of a free keyframe.
    struct Column {
        double hessian[ReducedSystem::kBlockSize];  // lower triangle
        double gradient[6];
        std::uint32_t keyframe;
    };
    struct Observation {
        Sighting seen;
        double chi2 = 0;
        std::uint32_t point = 0;
        std::uint32_t input = 0;  // its number
        std::uint16_t keyframe = 0;
        bool is_dropped = false;
        bool is_outlier = false;
    };

    // One piece each; they return the units they took.
    std::uint32_t sort_by_keyframe() noexcept;
    std::uint32_t place_points() noexcept;
    std::uint32_t sort_by_point() noexcept;
    std::uint32_t permute() noexcept;
    std::uint32_t select() noexcept;
    std::uint32_t clear_sums() noexcept;
    std::uint32_t linearise() noexcept;
    std::uint32_t factorise() noexcept;
    std::uint32_t solve() noexcept;
    std::uint32_t evaluate() noexcept;
    std::uint32_t classify() noexcept;
    std::uint32_t next_piece() noexcept;

    void begin_round() noexcept;
    void assign_columns() noexcept;
    void assemble() noexcept;
    void next_iteration() noexcept;
    void end_round() noexcept;
    void finish() noexcept;
    [[nodiscard]] std::uint32_t linearise_point(Point& p) noexcept;
    [[nodiscard]] std::uint32_t evaluate_point(Point& p) noexcept;

    AdjustmentSizes sizes_;
    std::span<Column> columns_;
    std::span<Observation> observations_;
    std::span<std::uint32_t> order_;
    std::span<std::uint32_t> position_;
    ReducedSystem system_;

    std::uint32_t column_count_ = 0;
    std::uint32_t round_ = 0;
    std::uint32_t iteration_ = 0;  // in the round
};

}  // namespace stillmesh
