#include "engine/adjust/pose_graph.hpp"

#include <cmath>

#include "engine/base/check.hpp"
#include "engine/base/numbers.hpp"
#include "engine/geometry/cholesky.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kEdgesOfPiece = 32;
constexpr std::uint32_t kNodesOfPiece = 16;
constexpr std::uint32_t kNodeUnits = kNodesOfPiece / 2;

// The least of the diagonal that damping scales.
constexpr double kDiagonalMin = 1e-9;
// A graph whose edges agree this well is solved.
constexpr double kCostExact = 1e-18;

[[nodiscard]] bool is_finite(const SE3& pose) noexcept {
    double sum = 0;
    for (int i = 0; i < 3; ++i) sum += pose.translation(i) - pose.translation(i);
    for (int i = 0; i < 9; ++i) sum += pose.rotation(i / 3, i % 3) - pose.rotation(i / 3, i % 3);
    return sum == 0.0;
}

}  // namespace

void PoseGraph::create(Arena& arena, const PoseGraphSizes& sizes) noexcept {
    nodes_ = arena.array<Node>(sizes.nodes_max);
    edges_ = arena.array<Edge>(sizes.edges_max);
    begin();
}

void PoseGraph::begin() noexcept {
    state_ = State::kCollecting;
    node_count_ = edge_count_ = 0;
}

Result<std::uint32_t> PoseGraph::add_node(const SE3& world_from_camera, std::uint32_t parent) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    STILLMESH_CHECK(parent == kNoParent || parent < node_count_);
    if (node_count_ == nodes_.size()) return Status::kFull;
    if (!is_finite(world_from_camera)) return Status::kInvalid;
    Node& node = nodes_[node_count_];
    node.pose[0] = node.pose[1] = world_from_camera;
    node.parent = parent;
    return node_count_++;
}

Status PoseGraph::add_edge(const PoseGraphEdge& edge) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    STILLMESH_CHECK(edge.a < node_count_ && edge.b < node_count_);
    if (edge_count_ == edges_.size()) return Status::kFull;
    const bool is_good = edge.a != edge.b && is_finite(edge.a_from_b) && edge.info_translation > 0 &&
                         is_finite(edge.info_translation) && edge.info_rotation > 0 && is_finite(edge.info_rotation);
    if (!is_good) return Status::kInvalid;
    edges_[edge_count_++].given = edge;
    return Status::kOk;
}

void PoseGraph::start(const PoseGraphOptions& options) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    STILLMESH_CHECK(options.damping_initial > 0 && options.cost_change_min >= 0);
    options_ = options;
    summary_ = PoseGraphSummary{};
    state_ = State::kRunning;
    current_ = 0;
    descent_.begin(options.damping_initial);
    next_iteration();
}

const PoseGraphSummary& PoseGraph::summary() const noexcept {
    STILLMESH_CHECK(is_done());
    return summary_;
}

const SE3& PoseGraph::pose(std::uint32_t node) const noexcept {
    STILLMESH_CHECK(is_done() && node < node_count_);
    return nodes_[node].pose[current_];
}

Progress PoseGraph::step(WorkBudget& budget) noexcept {
    if (state_ != State::kRunning) return Progress::kIdle;
    return work_in_pieces(
        budget, summary_.units, [this] { return next_piece(); }, [this] { return is_done(); });
}

std::uint32_t PoseGraph::next_piece() noexcept {
    switch (phase_) {
        case Phase::kClear: return clear_sums();
        case Phase::kLinearise: return linearise();
        case Phase::kFactorise: return factorise();
        case Phase::kBegin: return begin_inner();
        case Phase::kForward: return precondition_forward();
        case Phase::kBackward: return precondition_backward();
        case Phase::kDirect: return direct();
        case Phase::kMultiply: return multiply();
        case Phase::kMeasure: return measure();
        case Phase::kAdvance: return advance();
        case Phase::kCandidate: return make_candidate();
        case Phase::kEvaluate: return evaluate();
    }
    STILLMESH_CHECK(false);
    return 0;
}

void PoseGraph::enter(Phase phase) noexcept {
    phase_ = phase;
    cursor_ = 0;
}

template <typename Visit>
bool PoseGraph::each_node(Visit&& visit) noexcept {
    for (std::uint32_t n = 0; n < kNodesOfPiece && cursor_ < node_count_; ++n, ++cursor_) visit(nodes_[cursor_]);
    return cursor_ == node_count_;
}
template <typename Visit>
bool PoseGraph::each_node_from_leaves(Visit&& visit) noexcept {
    for (std::uint32_t n = 0; n < kNodesOfPiece && cursor_ < node_count_; ++n, ++cursor_) {
        visit(nodes_[node_count_ - 1 - cursor_]);
    }
    return cursor_ == node_count_;
}
template <typename Visit>
bool PoseGraph::each_edge(Visit&& visit) noexcept {
    for (std::uint32_t n = 0; n < kEdgesOfPiece && cursor_ < edge_count_; ++n, ++cursor_) visit(edges_[cursor_]);
    return cursor_ == edge_count_;
}

void PoseGraph::next_iteration() noexcept {
    if (descent_.is_over() || summary_.iterations >= options_.iterations_max || node_count_ == 0 || edge_count_ == 0) {
        summary_.has_converged = descent_.has_converged();
        summary_.final_cost = descent_.cost;
        state_ = State::kDone;
        return;
    }
    ++summary_.iterations;
    enter(Phase::kClear);
}

std::uint32_t PoseGraph::clear_sums() noexcept {
    if (each_node([](Node& node) {
            node.diagonal.setZero();
            node.to_parent.setZero();
            node.gradient.setZero();
            node.damping.setZero();
        })) {
        descent_.cost = 0.0;
        enter(Phase::kLinearise);
    }
    return kNodeUnits;
}

std::uint32_t PoseGraph::linearise() noexcept {
    if (each_edge([this](Edge& edge) { linearise_edge(edge); })) {
        if (summary_.iterations == 1) summary_.initial_cost = descent_.cost;
        is_singular_ = false;
        enter(Phase::kFactorise);
    }
    return 2 * kEdgesOfPiece;
}

std::uint32_t PoseGraph::factorise() noexcept {
    if (each_node_from_leaves([this](Node& node) {
            if (!node.is_fixed() && !is_singular_) is_singular_ = !factorise_node(node);
        })) {
        if (is_singular_) {
            refuse();
        } else {
            inner_.begin(options_.inner_iterations_max, options_.inner_residual_max);
            enter(Phase::kBegin);
        }
    }
    return 2 * kNodesOfPiece;
}

std::uint32_t PoseGraph::begin_inner() noexcept {
    if (each_node([](Node& node) {
            node.begin_at_zero(-node.gradient);
            node.preconditioned = node.residual;
        })) {
        enter(Phase::kForward);
    }
    return kNodeUnits;
}

// y = L^-1 r: children have given theirs to the node before its turn.
std::uint32_t PoseGraph::precondition_forward() noexcept {
    if (each_node_from_leaves([this](Node& node) {
            if (node.is_fixed()) return;
            solve_lower(node.diagonal, node.preconditioned);
            nodes_[node.parent].preconditioned.noalias() -= node.to_parent.transpose() * node.preconditioned;
        })) {
        enter(Phase::kBackward);
    }
    return kNodeUnits;
}

std::uint32_t PoseGraph::precondition_backward() noexcept {
    if (each_node([this](Node& node) {
            if (node.is_fixed()) {
                node.preconditioned.setZero();
                return;
            }
            node.preconditioned.noalias() -= node.to_parent * nodes_[node.parent].preconditioned;
            solve_lower_transposed(node.diagonal, node.preconditioned);
            inner_.add_energy(node);
        })) {
        if (inner_.continues()) {
            enter(Phase::kDirect);
        } else {
            end_inner();
        }
    }
    return kNodeUnits;
}

std::uint32_t PoseGraph::direct() noexcept {
    if (each_node([this](Node& node) {
            inner_.update_direction(node);
            for (int i = 0; i < 6; ++i) node.product(i) = node.damping(i) * node.direction(i);
        })) {
        enter(Phase::kMultiply);
    }
    return kNodeUnits;
}

std::uint32_t PoseGraph::multiply() noexcept {
    if (each_edge([this](const Edge& edge) { multiply_edge(edge); })) enter(Phase::kMeasure);
    return kEdgesOfPiece;
}

std::uint32_t PoseGraph::measure() noexcept {
    if (each_node([this](const Node& node) {
            if (!node.is_fixed()) inner_.add_curvature(node);
        })) {
        if (inner_.has_step()) {
            enter(Phase::kAdvance);
        } else {
            end_inner();
        }
    }
    return kNodeUnits;
}

std::uint32_t PoseGraph::advance() noexcept {
    if (each_node([this](Node& node) {
            if (node.is_fixed()) return;
            inner_.update_solution(node);
            node.preconditioned = node.residual;
        })) {
        enter(Phase::kForward);
    }
    return kNodeUnits;
}

void PoseGraph::end_inner() noexcept {
    summary_.inner_iterations += inner_.iterations();
    descent_.predicted = 0.0;
    is_singular_ = false;
    enter(Phase::kCandidate);
}

std::uint32_t PoseGraph::make_candidate() noexcept {
    if (each_node([this](Node& node) {
            if (node.is_fixed()) return;
            if (!is_sane_step(node.solution)) {
                is_singular_ = true;
                return;
            }
            SE3 candidate = node.pose[current_];
            candidate.translation += candidate.rotation * Vector3(node.solution.head<3>());
            candidate.rotation = candidate.rotation * so3_exp(node.solution.tail<3>());
            renormalise(candidate.rotation);
            node.pose[1 - current_] = candidate;
            // The cost is not halved: the model's decrease is -2 g x - x H x, and H x = -g - damping x - r.
            for (int i = 0; i < 6; ++i) {
                const double x = node.solution(i);
                descent_.predicted += x * (node.damping(i) * x - node.gradient(i) + node.residual(i));
            }
        })) {
        descent_.candidate_cost = 0.0;
        if (is_singular_) {
            refuse();
        } else {
            enter(Phase::kEvaluate);
        }
    }
    return kNodeUnits;
}

std::uint32_t PoseGraph::evaluate() noexcept {
    if (each_edge([this](const Edge& edge) { descent_.candidate_cost += cost_of(edge, 1 - current_); })) {
        if (descent_.judge(options_.cost_change_min, kCostExact * edge_count_)) {
            current_ = 1 - current_;
            ++summary_.steps_accepted;
        }
        next_iteration();
    }
    return kEdgesOfPiece;
}

void PoseGraph::refuse() noexcept {
    descent_.refuse();
    next_iteration();
}

double PoseGraph::cost_of(const Edge& edge, std::uint32_t which) const noexcept {
    const SE3& a = nodes_[edge.given.a].pose[which];
    const SE3& b = nodes_[edge.given.b].pose[which];
    const SE3 a_from_b = a.inverse() * b;
    const Vector3 off = a_from_b.translation - edge.given.a_from_b.translation;
    const Vector3 turn = so3_log(edge.given.a_from_b.rotation.transpose() * a_from_b.rotation);
    return edge.given.info_translation * off.squaredNorm() + edge.given.info_rotation * turn.squaredNorm();
}

void PoseGraph::linearise_edge(Edge& edge) noexcept {
    Node& a = nodes_[edge.given.a];
    Node& b = nodes_[edge.given.b];
    const SE3 relative = a.pose[current_].inverse() * b.pose[current_];
    const Vector3 off = relative.translation - edge.given.a_from_b.translation;
    const Vector3 turn = so3_log(edge.given.a_from_b.rotation.transpose() * relative.rotation);
    edge.log_change = so3_log_derivative(turn);
    descent_.cost += edge.given.info_translation * off.squaredNorm() + edge.given.info_rotation * turn.squaredNorm();
    Matrix6 by_a = Matrix6::Zero();
    Matrix6 by_b = Matrix6::Zero();
    by_a.topLeftCorner<3, 3>() = -Matrix3::Identity();
    by_a.topRightCorner<3, 3>() = skew(relative.translation);
    by_a.bottomRightCorner<3, 3>().noalias() = -(edge.log_change * relative.rotation.transpose());
    by_b.topLeftCorner<3, 3>() = relative.rotation;
    by_b.bottomRightCorner<3, 3>() = edge.log_change;
    Matrix6 weighted_a = by_a;
    Matrix6 weighted_b = by_b;
    Vector6 residual;
    for (int i = 0; i < 3; ++i) {
        residual(i) = off(i);
        residual(3 + i) = turn(i);
    }
    for (int r = 0; r < 6; ++r) {
        const double info = r < 3 ? edge.given.info_translation : edge.given.info_rotation;
        for (int c = 0; c < 6; ++c) {
            weighted_a(r, c) *= info;
            weighted_b(r, c) *= info;
        }
    }
    a.diagonal.noalias() += by_a.transpose() * weighted_a;
    b.diagonal.noalias() += by_b.transpose() * weighted_b;
    a.gradient.noalias() += weighted_a.transpose() * residual;
    b.gradient.noalias() += weighted_b.transpose() * residual;
    if (b.parent == edge.given.a) b.to_parent.noalias() += by_b.transpose() * weighted_a;
    if (a.parent == edge.given.b) a.to_parent.noalias() += by_a.transpose() * weighted_b;
}

void PoseGraph::multiply_edge(const Edge& edge) noexcept {
    Node& a = nodes_[edge.given.a];
    Node& b = nodes_[edge.given.b];
    // Computed again: storing it would take more memory than time.
    const SE3 relative = a.pose[current_].inverse() * b.pose[current_];
    const Matrix3& a_from_b = relative.rotation;
    const Vector3& q = relative.translation;
    const Vector3 va = a.direction.head<3>();
    const Vector3 wa = a.direction.tail<3>();
    const Vector3 vb = b.direction.head<3>();
    const Vector3 wb = b.direction.tail<3>();
    Vector3 off;
    off.noalias() = a_from_b * vb;
    off += q.cross(wa);
    off -= va;
    Vector3 wa_in_b;
    wa_in_b.noalias() = a_from_b.transpose() * wa;
    const Vector3 turning = wb - wa_in_b;
    Vector3 turn;
    turn.noalias() = edge.log_change * turning;
    off *= edge.given.info_translation;
    turn *= edge.given.info_rotation;
    Vector3 pulled;
    pulled.noalias() = edge.log_change.transpose() * turn;
    Vector3 pulled_in_a;
    pulled_in_a.noalias() = a_from_b * pulled;
    Vector3 off_in_b;
    off_in_b.noalias() = a_from_b.transpose() * off;
    const Vector3 moment = q.cross(off);
    for (int i = 0; i < 3; ++i) {
        a.product(i) -= off(i);
        a.product(3 + i) -= moment(i) + pulled_in_a(i);
        b.product(i) += off_in_b(i);
        b.product(3 + i) += pulled(i);
    }
}

// Adds the damping, factorises what is left of the node, and takes its share from the parent.
bool PoseGraph::factorise_node(Node& node) noexcept {
    for (int i = 0; i < 6; ++i) {
        // The diagonal has lost what the children explain; damping scales with what it was at least.
        const double diagonal = node.diagonal(i, i);
        node.damping(i) = descent_.damping_of(diagonal, kDiagonalMin);
        node.diagonal(i, i) += node.damping(i);
    }
    if (!cholesky(node.diagonal, is_good_pivot)) return false;
    for (int c = 0; c < 6; ++c) {
        Vector6 column = node.to_parent.col(c);
        solve_lower(node.diagonal, column);
        node.to_parent.col(c) = column;
    }
    Node& parent = nodes_[node.parent];
    if (parent.parent != kNoParent) parent.diagonal.noalias() -= node.to_parent.transpose() * node.to_parent;
    return true;
}

}  // namespace stillmesh
