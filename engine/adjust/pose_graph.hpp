// Pose graph (method.md 9): keyframe poses so that the weighted squares of all edges, each a measured relative pose,
// are smallest. Of an edge a to b, with a_from_b measured as M: the translation R_a^T (t_b - t_a) - t_M and the
// rotation log(R_M^T R_a^T R_b), each with one inverse variance. Levenberg-Marquardt; each step by conjugate gradients
// without a matrix, preconditioned by the spanning tree: the Hessian's blocks of the diagonal and between every node
// and its parent are factorised from the leaves to the root, which fills in nothing. A loop of any length closes in
// about as many inner iterations as there are independent loops, where block-Jacobi would take as many as the loop has
// nodes.
//
// A machine that can stop anywhere: begin(), add_...(), start(), step() until kDone, then pose(). The problem is a
// copy. However it is cut into slices, the results have the same bits.
//
// Limits: PoseGraphSizes; full says kFull. Cost: one unit is one edge (linearised, multiplied or evaluated), a node
// takes a quarter to two; step() overdraws its budget by less than kPieceUnitsMax.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/conjugate_gradients.hpp"
#include "engine/adjust/descent.hpp"
#include "engine/base/arena.hpp"
#include "engine/base/status.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

struct PoseGraphSizes {
    std::uint32_t nodes_max = 0;
    std::uint32_t edges_max = 0;
};

struct PoseGraphEdge {
    std::uint32_t a = 0, b = 0;
    SE3 a_from_b;
    double info_translation = 1;  // 1/m^2, > 0
    double info_rotation = 1;     // 1/rad^2, > 0
};

struct PoseGraphOptions {
    std::uint32_t iterations_max = 20;  // refused steps included
    std::uint32_t inner_iterations_max = 60;
    double inner_residual_max = 1e-6;  // of the right-hand side, in the preconditioner's norm
    double cost_change_min = 1e-6;     // converged when an iteration lowers the cost by less than this share
    double damping_initial = 1e-9;     // of the diagonal
};

struct PoseGraphSummary {
    std::uint32_t iterations = 0;
    std::uint32_t steps_accepted = 0;
    std::uint32_t inner_iterations = 0;
    double initial_cost = 0, final_cost = 0;
    bool has_converged = false;
    std::uint64_t units = 0;
};

class PoseGraph {
public:
    static constexpr std::uint32_t kNoParent = 0xffffffffU;
    static constexpr std::uint32_t kPieceUnitsMax = 64;

    static constexpr void plan(ArenaPlan& arena, const PoseGraphSizes& sizes) noexcept {
        arena.array<Node>(sizes.nodes_max);
        arena.array<Edge>(sizes.edges_max);
    }
    void create(Arena& arena, const PoseGraphSizes& sizes) noexcept;

    void begin() noexcept;
    // Nodes are numbered 0, 1, ...; a node's parent comes before it. One without a parent holds still.
    // kFull. kInvalid: the pose is not finite.
    [[nodiscard]] Result<std::uint32_t> add_node(const SE3& world_from_camera, std::uint32_t parent) noexcept;
    // kFull. kInvalid: not finite, not positive, or from a node to itself.
    [[nodiscard]] Status add_edge(const PoseGraphEdge& edge) noexcept;
    void start(const PoseGraphOptions& options) noexcept;

    // kDone: this call finished the job. kIdle: no job is running.
    [[nodiscard]] Progress step(WorkBudget& budget) noexcept;

    [[nodiscard]] bool is_done() const noexcept { return state_ == State::kDone; }
    [[nodiscard]] std::uint32_t nodes() const noexcept { return node_count_; }
    [[nodiscard]] std::uint32_t edges() const noexcept { return edge_count_; }
    // Only when is_done() (CHECK).
    [[nodiscard]] const PoseGraphSummary& summary() const noexcept;
    [[nodiscard]] const SE3& pose(std::uint32_t node) const noexcept;  // world_from_camera

private:
    enum class State : std::uint8_t { kCollecting, kRunning, kDone };
    // The pieces of a job, in order. The inner iterations are kForward to kAdvance.
    enum class Phase : std::uint8_t {
        kClear,      // node by node: zero sums
        kLinearise,  // edge by edge: residuals, derivatives, sums
        kFactorise,  // leaves to root: the preconditioner
        kBegin,      // node by node: the right-hand side
        kForward,    // leaves to root: the preconditioner applied
        kBackward,   // root to leaves
        kDirect,     // node by node: the next direction
        kMultiply,   // edge by edge: Hessian times direction
        kMeasure,    // node by node: direction times that
        kAdvance,    // node by node: the step grows along the direction
        kCandidate,  // node by node: candidate poses
        kEvaluate,   // edge by edge: cost there
    };
    // `solution`: the step.
    struct Node : ConjugateBlock {
        SE3 pose[2];        // current and candidate, by current_
        Matrix6 diagonal;   // of the Hessian; later the tree's Cholesky factor of this node, L
        Matrix6 to_parent;  // Hessian block (node, parent); later L^-1 times it
        Vector6 damping;    // added to the diagonal
        Vector6 gradient;
        std::uint32_t parent = kNoParent;
        [[nodiscard]] bool is_fixed() const noexcept { return parent == kNoParent; }
    };
    struct Edge {
        PoseGraphEdge given;
        Matrix3 log_change;  // so3_log_derivative at the residual
    };

    // One piece each; they return the units it took.
    std::uint32_t clear_sums() noexcept;
    std::uint32_t linearise() noexcept;
    std::uint32_t factorise() noexcept;
    std::uint32_t begin_inner() noexcept;
    std::uint32_t precondition_forward() noexcept;
    std::uint32_t precondition_backward() noexcept;
    std::uint32_t direct() noexcept;
    std::uint32_t multiply() noexcept;
    std::uint32_t measure() noexcept;
    std::uint32_t advance() noexcept;
    std::uint32_t make_candidate() noexcept;
    std::uint32_t evaluate() noexcept;
    std::uint32_t next_piece() noexcept;

    void enter(Phase phase) noexcept;
    // A piece of a phase over nodes or edges. True: the phase is through.
    template <typename Visit>
    [[nodiscard]] bool each_node(Visit&& visit) noexcept;
    template <typename Visit>
    [[nodiscard]] bool each_node_from_leaves(Visit&& visit) noexcept;
    template <typename Visit>
    [[nodiscard]] bool each_edge(Visit&& visit) noexcept;
    [[nodiscard]] double cost_of(const Edge& edge, std::uint32_t which) const noexcept;
    void linearise_edge(Edge& edge) noexcept;
    void multiply_edge(const Edge& edge) noexcept;
    [[nodiscard]] bool factorise_node(Node& node) noexcept;
    void end_inner() noexcept;
    void refuse() noexcept;
    void next_iteration() noexcept;

    std::span<Node> nodes_;
    std::span<Edge> edges_;
    PoseGraphOptions options_;
    PoseGraphSummary summary_;
    State state_ = State::kCollecting;
    Phase phase_ = Phase::kClear;
    std::uint32_t cursor_ = 0;
    std::uint32_t node_count_ = 0, edge_count_ = 0;
    std::uint32_t current_ = 0;
    Descent descent_;
    ConjugateGradients inner_;
    bool is_singular_ = false;
};

}  // namespace stillmesh
