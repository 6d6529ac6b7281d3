// Global bundle adjustment (method.md 9): all keyframes and the static points they see, the same residuals and robust
// cost as the local one (local_adjustment.hpp), without any matrix: Levenberg-Marquardt, the points eliminated point by
// point, each step by conjugate gradients on what is left, preconditioned by its diagonal blocks. A product is two
// passes over the observations, whose derivatives are computed anew each time. Memory is a few MiB where the blocks
// would take 35.
//
// A machine that can stop anywhere: begin(), add_keyframe(), add_point(); reserve() for each observation to come;
// fill(); add_observation(); start(); step() until kDone; then the results. However it is cut into slices, the results
// have the same bits. Limits: GlobalSizes; full says kFull. Cost: one unit is one residual evaluated; step() overdraws
// its budget by less than piece_units_max(): the observations of one point, four times, and a few.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/bundle.hpp"
#include "engine/base/arena.hpp"

namespace stillmesh {

struct GlobalSizes {
    std::uint32_t keyframes_max = 0;  // at most 65535
    std::uint32_t points_max = 0;
    std::uint32_t observations_max = 0;
};

struct GlobalOptions {
    std::uint32_t iterations_max = 8;  // refused steps included
    std::uint32_t inner_iterations_max = 25;
    double inner_residual_max = 0.01;  // of the right-hand side, in the preconditioner's norm
    double chi2_max_pixel = 5.991;     // Huber's threshold without depth
    double chi2_max_depth = 7.815;     // and with
    double cost_change_min = 1e-3;     // converged when an iteration lowers the cost by less than this share
    double damping_initial = 1e-4;     // of the diagonal
};

struct GlobalSummary {
    std::uint32_t iterations = 0, steps_accepted = 0, inner_iterations = 0;
    std::uint32_t observations = 0, points_used = 0;
    double initial_cost = 0, final_cost = 0;
    bool has_converged = false;
    std::uint64_t units = 0;
};

// The pieces of a job, in order. The inner iterations are kDirect to kAdvance.
enum class GlobalPhase : std::uint8_t {
    kClear,      // keyframe by keyframe: zero sums
    kLinearise,  // point by point: derivatives, elimination, diagonal blocks
    kFactorise,  // keyframe by keyframe: damping, the preconditioner's factor, the first residual
    kDirect,     // keyframe by keyframe: the next direction
    kMultiply,   // point by point: the reduced system times the direction
    kMeasure,    // keyframe by keyframe: direction times that
    kAdvance,    // keyframe by keyframe: step and residual
    kCandidate,  // keyframe by keyframe: candidate poses
    kEvaluate,   // point by point: the point's step, cost there
};

// `diagonal`: of the reduced system.
struct GlobalKeyframe : DescentBlock, BundleKeyframe {
    Vector6 hessian;  // diagonal of the poses' own Hessian: what damping scales with
    Vector6 reduced;  // right-hand side of the reduced system
};

class GlobalAdjustment : public BundleJob<MatrixFreeJob<GlobalAdjustment, GlobalPhase, GlobalOptions, GlobalSummary>,
                                          GlobalKeyframe, BundlePoint> {
public:
    static constexpr void plan(ArenaPlan& arena, const GlobalSizes& sizes) noexcept {
        arena.array<Keyframe>(sizes.keyframes_max);
        arena.array<Point>(sizes.points_max);
        arena.array<Observation>(sizes.observations_max);
    }
    void create(Arena& arena, const GlobalSizes& sizes) noexcept;

    // Forgets everything, a running job too.
    void begin() noexcept;
    // kFull. kInvalid: not finite, or not a rotation.
    [[nodiscard]] Result<std::uint32_t> add_keyframe(const SE3& world_from_camera, bool is_fixed) noexcept;
    // One more observation of the point will come. kFull: there is no room for it.
    [[nodiscard]] Status reserve(std::uint32_t point) noexcept;
    void fill() noexcept;
    // kFull: more than were reserved for the point. kInvalid: a number that is not finite, or no variance.
    [[nodiscard]] Status add_observation(const AdjustmentObservation& given) noexcept;
    void start(const GlobalOptions& options) noexcept;

    [[nodiscard]] std::uint32_t piece_units_max() const noexcept {
        return 4 * static_cast<std::uint32_t>(keyframes_.size()) + 32;
    }

private:
    friend MatrixFreeJob;
    friend AdjustmentJob;
    using Phase = GlobalPhase;
    static constexpr std::uint32_t kBlocksOfPiece = 8;
    static constexpr std::uint32_t kBlockUnits = 8;
    static constexpr std::uint32_t kTermsOfPiece = 1;

    using Keyframe = GlobalKeyframe;
    using Point = BundlePoint;
    struct Observation {
        float x = 0, y = 0, z_m = 0, info = 0, info_z = 0;
        std::uint16_t keyframe = 0;

        [[nodiscard]] Sighting seen() const noexcept {
            return {static_cast<double>(x), static_cast<double>(y), static_cast<double>(z_m), static_cast<double>(info),
                    static_cast<double>(info_z)};
        }
    };

    struct Derivatives;

    [[nodiscard]] std::span<Keyframe> blocks() noexcept { return keyframes_.first(keyframe_count_); }
    [[nodiscard]] std::span<Point> terms() noexcept { return points_.first(point_count_); }
    std::uint32_t next_piece() noexcept;
    // One piece each; they return the units it took.
    std::uint32_t factorise() noexcept;
    std::uint32_t advance() noexcept;

    // Calls visit(keyframe, derivatives) for each observation of the point by a keyframe that moves.
    template <typename Visit>
    void each_moving(const Point& p, Visit&& visit) noexcept;
    [[nodiscard]] Derivatives derivatives_of(const CameraRows& camera, const Sighting& seen,
                                             const SightingResidual& r) const noexcept;
    void clear(Keyframe& keyframe) noexcept;
    std::uint32_t linearise(Point& p) noexcept;
    void sum_up(Point& p) noexcept;
    void eliminate(const Point& p) noexcept;
    [[nodiscard]] bool factorise_keyframe(Keyframe& keyframe) noexcept;
    void precondition(Keyframe& keyframe) noexcept;
    std::uint32_t multiply(const Point& p) noexcept;
    void move(Keyframe& keyframe) noexcept;
    std::uint32_t evaluate(Point& p) noexcept;
    void move_point(Point& p) noexcept;

    std::span<Observation> observations_;
};

}  // namespace stillmesh
