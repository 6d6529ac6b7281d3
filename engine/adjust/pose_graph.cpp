#include "engine/adjust/pose_graph.hpp"

#include <cmath>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kEdgesOfPiece = 32;
constexpr std::uint32_t kNodesOfPiece = 16;

constexpr double kDampingMin = 1e-12;
constexpr double kDampingMax = 1e10;
constexpr double kDiagonalMin = 1e-9;
constexpr double kRounding = 1e-14;
constexpr double kHuge = 1e150;
constexpr double kStepMax_m = 1e6;
constexpr double kStepMax_rad = 1.0;
// A graph whose edges agree this well is solved.
constexpr double kCostExact = 1e-18;

[[nodiscard]] bool is_finite(double x) noexcept {
    return x - x == 0.0;
}
[[nodiscard]] bool is_finite(const SE3& pose) noexcept {
    double sum = 0;
    for (int i = 0; i < 3; ++i) sum += pose.translation(i) - pose.translation(i);
    for (int i = 0; i < 9; ++i) sum += pose.rotation(i / 3, i % 3) - pose.rotation(i / 3, i % 3);
    return sum == 0.0;
}

// In place: the lower triangle becomes the Cholesky factor. False: not positive definite.
[[nodiscard]] bool factorise(Matrix6& a) noexcept {
    for (int i = 0; i < 6; ++i) {
        const double diagonal = a(i, i);
        for (int j = 0; j <= i; ++j) {
            double sum = a(i, j);
            for (int k = 0; k < j; ++k) sum -= a(i, k) * a(j, k);
            if (i == j) {
                if (!(sum > kRounding * diagonal && sum > 0.0 && sum < kHuge)) return false;
                a(i, i) = std::sqrt(sum);
            } else {
                a(i, j) = sum / a(j, j);
            }
        }
    }
    return true;
}

void solve_lower(const Matrix6& l, Vector6& x) noexcept {
    for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < i; ++k) x(i) -= l(i, k) * x(k);
        x(i) /= l(i, i);
    }
}

void solve_lower_transposed(const Matrix6& l, Vector6& x) noexcept {
    for (int i = 5; i >= 0; --i) {
        for (int k = i + 1; k < 6; ++k) x(i) -= l(k, i) * x(k);
        x(i) /= l(i, i);
    }
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
    damping_ = options.damping_initial;
    damping_growth_ = 2.0;
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
    while (!budget.is_spent()) {
        const std::uint32_t units = advance();
        budget.spend(units);
        summary_.units += units;
        if (state_ == State::kDone) return Progress::kDone;
    }
    return Progress::kWorking;
}

void PoseGraph::enter(Phase phase) noexcept {
    phase_ = phase;
    cursor_ = 0;
}

template <typename Visit>
bool PoseGraph::each_node(Visit&& visit) noexcept {
    for (std::uint32_t n = 0; n < kNodesOfPiece && cursor_ < node_count_; ++n, ++cursor_) visit(nodes_[cursor_]);
    return cursor_ < node_count_;
}
template <typename Visit>
bool PoseGraph::each_node_from_leaves(Visit&& visit) noexcept {
    for (std::uint32_t n = 0; n < kNodesOfPiece && cursor_ < node_count_; ++n, ++cursor_) {
        visit(nodes_[node_count_ - 1 - cursor_]);
    }
    return cursor_ < node_count_;
}
template <typename Visit>
bool PoseGraph::each_edge(Visit&& visit) noexcept {
    for (std::uint32_t n = 0; n < kEdgesOfPiece && cursor_ < edge_count_; ++n, ++cursor_) visit(edges_[cursor_]);
    return cursor_ < edge_count_;
}

std::uint32_t PoseGraph::advance() noexcept {
    constexpr std::uint32_t kNodeUnits = kNodesOfPiece / 2;
    switch (phase_) {
        case Phase::kClear:
            if (each_node([](Node& node) {
                    node.diagonal.setZero();
                    node.to_parent.setZero();
                    node.gradient.setZero();
                    node.damping.setZero();
                })) {
                return kNodeUnits;
            }
            cost_ = 0.0;
            enter(Phase::kLinearise);
            return kNodeUnits;
        case Phase::kLinearise:
            if (each_edge([this](Edge& edge) { linearise_edge(edge); })) return 2 * kEdgesOfPiece;
            if (summary_.iterations == 1) summary_.initial_cost = cost_;
            is_singular_ = false;
            enter(Phase::kFactorise);
            return 2 * kEdgesOfPiece;
        case Phase::kFactorise:
            if (each_node_from_leaves([this](Node& node) {
                    if (node.parent != kNoParent && !is_singular_) is_singular_ = !factorise_node(node);
                })) {
                return 2 * kNodesOfPiece;
            }
            if (is_singular_) {
                refuse();
            } else {
                inner_ = 0;
                enter(Phase::kBeginInner);
            }
            return 2 * kNodesOfPiece;
        case Phase::kBeginInner:
            if (each_node([](Node& node) {
                    node.step.setZero();
                    node.direction.setZero();
                    node.residual = -node.gradient;
                    node.preconditioned = node.residual;
                })) {
                return kNodeUnits;
            }
            enter(Phase::kForward);
            return kNodeUnits;
        case Phase::kForward:
            // y = L^-1 r: children have given theirs to the node before its turn.
            if (each_node_from_leaves([this](Node& node) {
                    if (node.parent == kNoParent) return;
                    solve_lower(node.diagonal, node.preconditioned);
                    Node& parent = nodes_[node.parent];
                    parent.preconditioned.noalias() -= node.to_parent.transpose() * node.preconditioned;
                })) {
                return kNodeUnits;
            }
            energy_before_ = energy_;
            energy_ = 0.0;
            enter(Phase::kBackward);
            return kNodeUnits;
        case Phase::kBackward:
            if (each_node([this](Node& node) {
                    if (node.parent == kNoParent) {
                        node.preconditioned.setZero();
                        return;
                    }
                    node.preconditioned.noalias() -= node.to_parent * nodes_[node.parent].preconditioned;
                    solve_lower_transposed(node.diagonal, node.preconditioned);
                    for (int i = 0; i < 6; ++i) energy_ += node.residual(i) * node.preconditioned(i);
                })) {
                return kNodeUnits;
            }
            if (inner_ == 0) energy_first_ = energy_;
            if (!(energy_ > options_.inner_residual_max * options_.inner_residual_max * energy_first_) ||
                inner_ == options_.inner_iterations_max) {
                end_inner();
            } else {
                enter(Phase::kDirection);
            }
            return kNodeUnits;
        case Phase::kDirection: {
            const double share = inner_ == 0 ? 0.0 : energy_ / energy_before_;
            if (each_node([share](Node& node) {
                    for (int i = 0; i < 6; ++i) {
                        node.direction(i) = node.preconditioned(i) + share * node.direction(i);
                        node.product(i) = node.damping(i) * node.direction(i);
                    }
                })) {
                return kNodeUnits;
            }
            ++inner_;
            ++summary_.inner_iterations;
            enter(Phase::kMultiply);
            return kNodeUnits;
        }
        case Phase::kMultiply:
            if (each_edge([this](const Edge& edge) { multiply_edge(edge); })) return kEdgesOfPiece;
            curvature_ = 0.0;
            enter(Phase::kCurvature);
            return kEdgesOfPiece;
        case Phase::kCurvature:
            if (each_node([this](const Node& node) {
                    if (node.parent == kNoParent) return;
                    for (int i = 0; i < 6; ++i) curvature_ += node.direction(i) * node.product(i);
                })) {
                return kNodeUnits;
            }
            if (curvature_ > 0.0) {
                enter(Phase::kAdvance);
            } else {
                end_inner();
            }
            return kNodeUnits;
        case Phase::kAdvance: {
            const double length = energy_ / curvature_;
            if (each_node([length](Node& node) {
                    if (node.parent == kNoParent) {
                        node.preconditioned.setZero();
                        return;
                    }
                    for (int i = 0; i < 6; ++i) {
                        node.step(i) += length * node.direction(i);
                        node.residual(i) -= length * node.product(i);
                        node.preconditioned(i) = node.residual(i);
                    }
                })) {
                return kNodeUnits;
            }
            enter(Phase::kForward);
            return kNodeUnits;
        }
        case Phase::kCandidate:
            if (each_node([this](Node& node) {
                    if (node.parent == kNoParent) return;
                    const double metres2 = node.step.head<3>().squaredNorm();
                    const double radians2 = node.step.tail<3>().squaredNorm();
                    if (!(metres2 <= kStepMax_m * kStepMax_m && radians2 <= kStepMax_rad * kStepMax_rad)) {
                        is_singular_ = true;  // NaN too
                        return;
                    }
                    SE3 candidate = node.pose[current_];
                    candidate.translation += candidate.rotation * Vector3(node.step.head<3>());
                    candidate.rotation = candidate.rotation * so3_exp(node.step.tail<3>());
                    renormalise(candidate.rotation);
                    node.pose[1 - current_] = candidate;
                    // The cost is not halved: the model's decrease is -2 g x - x H x, and H x = -g - damping x - r.
                    for (int i = 0; i < 6; ++i) {
                        const double x = node.step(i);
                        predicted_ += x * (node.damping(i) * x - node.gradient(i) + node.residual(i));
                    }
                })) {
                return kNodeUnits;
            }
            candidate_cost_ = 0.0;
            if (is_singular_) {
                refuse();
            } else {
                enter(Phase::kEvaluate);
            }
            return kNodeUnits;
        case Phase::kEvaluate:
            if (each_edge([this](const Edge& edge) { candidate_cost_ += cost_of(edge, 1 - current_); })) {
                return kEdgesOfPiece;
            }
            judge();
            return kEdgesOfPiece;
    }
    STILLMESH_CHECK(false);
    return 0;
}

void PoseGraph::next_iteration() noexcept {
    if (summary_.iterations >= options_.iterations_max || node_count_ == 0 || edge_count_ == 0) {
        summary_.final_cost = cost_;
        state_ = State::kDone;
        return;
    }
    ++summary_.iterations;
    enter(Phase::kClear);
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
    cost_ += edge.given.info_translation * off.squaredNorm() + edge.given.info_rotation * turn.squaredNorm();
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
        node.damping(i) = damping_ * (diagonal > kDiagonalMin ? diagonal : kDiagonalMin);
        node.diagonal(i, i) += node.damping(i);
    }
    if (!factorise(node.diagonal)) return false;
    for (int c = 0; c < 6; ++c) {
        Vector6 column = node.to_parent.col(c);
        solve_lower(node.diagonal, column);
        node.to_parent.col(c) = column;
    }
    Node& parent = nodes_[node.parent];
    if (parent.parent != kNoParent) parent.diagonal.noalias() -= node.to_parent.transpose() * node.to_parent;
    return true;
}

void PoseGraph::end_inner() noexcept {
    predicted_ = 0.0;
    is_singular_ = false;
    enter(Phase::kCandidate);
}

void PoseGraph::judge() noexcept {
    const double gain = cost_ - candidate_cost_;
    const double negligible = options_.cost_change_min * cost_;
    if (!(gain > 0.0) || !(predicted_ > 0.0)) {
        if (predicted_ <= negligible) summary_.has_converged = true;
        refuse();
        return;
    }
    current_ = 1 - current_;
    ++summary_.steps_accepted;
    cost_ = candidate_cost_;
    const double surprise = 2.0 * (gain / predicted_) - 1.0;
    const double factor = 1.0 - surprise * surprise * surprise;
    damping_ *= factor > 0.1 ? (factor < 2.0 ? factor : 2.0) : 0.1;
    if (damping_ < kDampingMin) damping_ = kDampingMin;
    damping_growth_ = 2.0;
    summary_.has_converged = gain <= negligible || cost_ <= kCostExact * edge_count_;
    if (summary_.has_converged) {
        summary_.final_cost = cost_;
        state_ = State::kDone;
    } else {
        next_iteration();
    }
}

void PoseGraph::refuse() noexcept {
    damping_ *= damping_growth_;
    damping_growth_ *= 2.0;
    if (summary_.has_converged || damping_ > kDampingMax) {
        summary_.final_cost = cost_;
        state_ = State::kDone;
    } else {
        next_iteration();
    }
}

}  // namespace stillmesh
