#include "engine/adjust/pose_graph.hpp"

#include "engine/base/check.hpp"
#include "engine/base/numbers.hpp"
#include "engine/geometry/cholesky.hpp"

namespace stillmesh {
namespace {

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
    node.moves = parent != kNoParent;
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
    run(options);
    next_iteration();
}

const SE3& PoseGraph::pose(std::uint32_t node) const noexcept {
    STILLMESH_CHECK(is_done() && node < node_count_);
    return nodes_[node].pose[current_];
}

std::uint32_t PoseGraph::next_piece() noexcept {
    switch (phase_) {
        case Phase::kClear: return clear_sums();
        case Phase::kLinearise: return linearise_terms();
        case Phase::kFactorise: return factorise();
        case Phase::kBegin: return begin_inner();
        case Phase::kForward: return precondition_forward();
        case Phase::kBackward: return precondition_backward();
        case Phase::kDirect: return direct();
        case Phase::kMultiply: return multiply_terms();
        case Phase::kMeasure: return measure();
        case Phase::kAdvance: return advance();
        case Phase::kCandidate: return make_candidate();
        case Phase::kEvaluate: return evaluate_terms(kCostExact * edge_count_);
    }
    STILLMESH_CHECK(false);
    return 0;
}

void PoseGraph::clear(Node& node) noexcept {
    node.diagonal.setZero();
    node.to_parent.setZero();
    node.gradient.setZero();
    node.damping.setZero();
}

// From the leaves to the root: a node's children have given it theirs before its turn.
std::uint32_t PoseGraph::factorise() noexcept {
    each_block(
        [this](Node& place) {
            Node& node = mirrored(place);
            if (node.moves && !is_singular_) is_singular_ = !factorise_node(node);
        },
        [this] { is_singular_ ? refuse() : enter(Phase::kBegin); });
    return 2 * kBlocksOfPiece;
}

std::uint32_t PoseGraph::begin_inner() noexcept {
    return each_block(
        [](Node& node) {
            node.begin_at_zero(-node.gradient);
            node.preconditioned = node.residual;
        },
        [this] { enter(Phase::kForward); });
}

// y = L^-1 r, again from the leaves.
std::uint32_t PoseGraph::precondition_forward() noexcept {
    return each_block(
        [this](Node& place) {
            Node& node = mirrored(place);
            if (!node.moves) return;
            solve_lower(node.diagonal, node.preconditioned);
            nodes_[node.parent].preconditioned.noalias() -= node.to_parent.transpose() * node.preconditioned;
        },
        [this] { enter(Phase::kBackward); });
}

std::uint32_t PoseGraph::precondition_backward() noexcept {
    return each_block(
        [this](Node& node) {
            if (!node.moves) {
                node.preconditioned.setZero();
                return;
            }
            node.preconditioned.noalias() -= node.to_parent * nodes_[node.parent].preconditioned;
            solve_lower_transposed(node.diagonal, node.preconditioned);
            inner_.add_energy(node);
        },
        [this] { go_on(); });
}

std::uint32_t PoseGraph::advance() noexcept {
    return each_moving_block(
        [this](Node& node) {
            inner_.update_solution(node);
            node.preconditioned = node.residual;
        },
        [this] { enter(Phase::kForward); });
}

void PoseGraph::move(Node& node) noexcept {
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
}

std::uint32_t PoseGraph::evaluate(const Edge& edge) noexcept {
    const SE3& a = nodes_[edge.given.a].pose[1 - current_];
    const SE3& b = nodes_[edge.given.b].pose[1 - current_];
    const SE3 a_from_b = a.inverse() * b;
    const Vector3 off = a_from_b.translation - edge.given.a_from_b.translation;
    const Vector3 turn = so3_log(edge.given.a_from_b.rotation.transpose() * a_from_b.rotation);
    descent_.candidate_cost +=
        edge.given.info_translation * off.squaredNorm() + edge.given.info_rotation * turn.squaredNorm();
    return 1;
}

std::uint32_t PoseGraph::linearise(Edge& edge) noexcept {
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
    return 2;
}

std::uint32_t PoseGraph::multiply(const Edge& edge) noexcept {
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
    return 1;
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
    if (parent.moves) parent.diagonal.noalias() -= node.to_parent.transpose() * node.to_parent;
    return true;
}

}  // namespace stillmesh
