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

#include "engine/adjust/adjustment_job.hpp"
#include "engine/base/arena.hpp"
#include "engine/base/status.hpp"
#include "engine/geometry/se3.hpp"

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

// The pieces of a job, in order. The inner iterations are kForward to kAdvance.
enum class PoseGraphPhase : std::uint8_t {
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

class PoseGraph : public MatrixFreeJob<PoseGraph, PoseGraphPhase, PoseGraphOptions, PoseGraphSummary> {
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

    [[nodiscard]] std::uint32_t nodes() const noexcept { return node_count_; }
    [[nodiscard]] std::uint32_t edges() const noexcept { return edge_count_; }
    // Only when is_done() (CHECK).
    [[nodiscard]] const SE3& pose(std::uint32_t node) const noexcept;  // world_from_camera

private:
    friend MatrixFreeJob;
    friend AdjustmentJob;
    using Phase = PoseGraphPhase;
    static constexpr std::uint32_t kBlocksOfPiece = 16;
    static constexpr std::uint32_t kBlockUnits = kBlocksOfPiece / 2;
    static constexpr std::uint32_t kTermsOfPiece = 32;

    // `diagonal`: of the Hessian; later the tree's Cholesky factor of this node, L.
    struct Node : DescentBlock {
        SE3 pose[2];        // current and candidate, by current_
        Matrix6 to_parent;  // Hessian block (node, parent); later L^-1 times it
        std::uint32_t parent = kNoParent;
    };
    struct Edge {
        PoseGraphEdge given;
        Matrix3 log_change;  // so3_log_derivative at the residual
    };

    [[nodiscard]] std::span<Node> blocks() noexcept { return nodes_.first(node_count_); }
    [[nodiscard]] std::span<Edge> terms() noexcept { return edges_.first(edge_count_); }
    // The node in its place when they are visited from the other end.
    [[nodiscard]] Node& mirrored(const Node& node) noexcept {
        return nodes_[node_count_ - 1 - static_cast<std::size_t>(&node - nodes_.data())];
    }
    std::uint32_t next_piece() noexcept;
    // Pieces of the preconditioner; they return the units they took.
    std::uint32_t factorise() noexcept;
    std::uint32_t begin_inner() noexcept;
    std::uint32_t precondition_forward() noexcept;
    std::uint32_t precondition_backward() noexcept;
    std::uint32_t advance() noexcept;

    void clear(Node& node) noexcept;
    std::uint32_t linearise(Edge& edge) noexcept;
    [[nodiscard]] bool factorise_node(Node& node) noexcept;
    std::uint32_t multiply(const Edge& edge) noexcept;
    void move(Node& node) noexcept;
    std::uint32_t evaluate(const Edge& edge) noexcept;

    std::span<Node> nodes_;
    std::span<Edge> edges_;
    std::uint32_t node_count_ = 0, edge_count_ = 0;
};

}  // namespace stillmesh
