#include "engine/adjust/global_adjustment.hpp"

#include <cmath>

#include "engine/adjust/point_factor.hpp"
#include "engine/base/check.hpp"
#include "engine/base/numbers.hpp"
#include "engine/geometry/cholesky.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kKeyframesOfPiece = 8;
// The least of the diagonal that damping scales.
constexpr double kDiagonalMin = 1e-6;
// Fewer, and a keyframe holds still: six unknowns, two residuals each.
constexpr std::uint32_t kObservationsMin = 3;

// Derivatives of one observation's residuals, and what weighs them.
struct Derivatives {
    PoseRows pose;
    PointRows point;
    SightingResidual r;
    double a = 0, b = 0;  // weights of pixels and of depth
};
[[nodiscard]] Derivatives derivatives_of(const CameraRows& camera, const SightingResidual& r, const Sighting& s,
                                         double threshold) noexcept {
    const double weight = huber_weight(r.chi2, threshold);
    return {pose_rows(r), point_rows(camera, r), r, weight * s.info, weight * s.info_z};
}

}  // namespace

void GlobalAdjustment::create(Arena& arena, const GlobalSizes& sizes) noexcept {
    STILLMESH_CHECK(sizes.keyframes_max <= 0xffffU);
    keyframes_ = arena.array<Keyframe>(sizes.keyframes_max);
    points_ = arena.array<Point>(sizes.points_max);
    observations_ = arena.array<Observation>(sizes.observations_max);
    begin();
}

void GlobalAdjustment::begin() noexcept {
    state_ = State::kCollecting;
    keyframe_count_ = point_count_ = observation_count_ = fixed_count_ = 0;
    summary_ = GlobalSummary{};
}

Result<std::uint32_t> GlobalAdjustment::add_keyframe(const SE3& world_from_camera, bool is_fixed) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    if (keyframe_count_ == keyframes_.size()) return Status::kFull;
    Keyframe& keyframe = keyframes_[keyframe_count_];
    keyframe = Keyframe{};
    keyframe.is_fixed = is_fixed;
    keyframe.begin(world_from_camera);
    if (is_fixed) ++fixed_count_;
    return keyframe_count_++;
}

Result<std::uint32_t> GlobalAdjustment::add_point(const Vector3& world) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    if (point_count_ == points_.size()) return Status::kFull;
    Point& point = points_[point_count_];
    point = Point{};
    for (int k = 0; k < 3; ++k) point.world[0][k] = point.world[1][k] = world(k);
    return point_count_++;
}

Status GlobalAdjustment::reserve(std::uint32_t point) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting && point < point_count_);
    if (observation_count_ == observations_.size()) return Status::kFull;
    ++observation_count_;
    ++points_[point].reserved;
    return Status::kOk;
}

void GlobalAdjustment::fill() noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    std::uint32_t at = 0;
    for (std::uint32_t i = 0; i < point_count_; ++i) {
        points_[i].begin = points_[i].end = at;
        at += points_[i].reserved;
    }
    state_ = State::kFilling;
}

Status GlobalAdjustment::add_observation(const GlobalObservation& given) noexcept {
    STILLMESH_CHECK(state_ == State::kFilling && given.keyframe < keyframe_count_ && given.point < point_count_);
    Point& point = points_[given.point];
    if (point.end - point.begin == point.reserved) return Status::kFull;
    Observation o;
    o.x = static_cast<float>(given.x);
    o.y = static_cast<float>(given.y);
    o.info = static_cast<float>(1.0 / given.var_pixel);
    if (given.var_z > 0) {
        o.z_m = static_cast<float>(given.z_m);
        o.info_z = static_cast<float>(1.0 / given.var_z);
    }
    const double sum =
        given.x + given.y + static_cast<double>(o.info) + static_cast<double>(o.z_m) + static_cast<double>(o.info_z);
    if (!is_finite(sum) || !(given.var_pixel > 0)) return Status::kInvalid;
    o.keyframe = static_cast<std::uint16_t>(given.keyframe);
    observations_[point.end++] = o;
    ++keyframes_[given.keyframe].used;
    ++summary_.observations;
    return Status::kOk;
}

void GlobalAdjustment::start(const GlobalOptions& options) noexcept {
    STILLMESH_CHECK(state_ == State::kFilling || state_ == State::kCollecting);
    options_ = options;
    const std::uint32_t observations = summary_.observations;
    summary_ = GlobalSummary{};
    summary_.observations = observations;
    state_ = State::kRunning;
    current_ = 0;
    descent_.begin(options.damping_initial);
    descent_.cost = 0.0;
    if (fixed_count_ == 0 && keyframe_count_ > 0) keyframes_[0].is_fixed = true;
    for (std::uint32_t i = 0; i < keyframe_count_; ++i) {
        keyframes_[i].moves = !keyframes_[i].is_fixed && keyframes_[i].used >= kObservationsMin;
    }
    next_iteration();
}

const GlobalSummary& GlobalAdjustment::summary() const noexcept {
    STILLMESH_CHECK(is_done());
    return summary_;
}
const SE3& GlobalAdjustment::pose(std::uint32_t keyframe) const noexcept {
    STILLMESH_CHECK(is_done() && keyframe < keyframe_count_);
    return keyframes_[keyframe].pose[current_];
}
Vector3 GlobalAdjustment::point(std::uint32_t point) const noexcept {
    STILLMESH_CHECK(is_done() && point < point_count_);
    const double* const w = points_[point].world[current_];
    return {w[0], w[1], w[2]};
}
bool GlobalAdjustment::is_point_used(std::uint32_t point) const noexcept {
    STILLMESH_CHECK(is_done() && point < point_count_);
    return points_[point].is_used;
}

Progress GlobalAdjustment::step(WorkBudget& budget) noexcept {
    if (state_ != State::kRunning) return Progress::kIdle;
    return work_in_pieces(
        budget, summary_.units, [this] { return advance(); }, [this] { return is_done(); });
}

void GlobalAdjustment::enter(Phase phase) noexcept {
    phase_ = phase;
    cursor_ = 0;
}

std::uint32_t GlobalAdjustment::advance() noexcept {
    const auto each_keyframe = [this](auto&& visit) {
        for (std::uint32_t n = 0; n < kKeyframesOfPiece && cursor_ < keyframe_count_; ++n) visit(keyframes_[cursor_++]);
        return cursor_ < keyframe_count_;
    };
    std::uint32_t units = kKeyframesOfPiece;
    switch (phase_) {
        case Phase::kClear:
            if (each_keyframe([](Keyframe& keyframe) {
                    keyframe.diagonal.setZero();
                    for (int i = 0; i < 6; ++i) {
                        keyframe.hessian[i] = keyframe.gradient[i] = keyframe.reduced[i] = 0.0;
                        keyframe.damping[i] = keyframe.direction[i] = keyframe.step[i] = 0.0;
                    }
                })) {
                return units;
            }
            descent_.cost = 0.0;
            summary_.points_used = 0;
            enter(Phase::kLinearise);
            return units;
        case Phase::kLinearise:
            if (cursor_ < point_count_) units = linearise_point(points_[cursor_++]);
            if (cursor_ < point_count_) return units;
            if (summary_.iterations == 1) summary_.initial_cost = descent_.cost;
            is_singular_ = false;
            energy_ = 0.0;
            inner_ = 0;
            enter(Phase::kPrepare);
            return units;
        case Phase::kPrepare:
            if (each_keyframe([this](Keyframe& keyframe) {
                    if (keyframe.moves && !is_singular_) is_singular_ = !prepare(keyframe);
                })) {
                return units;
            }
            energy_first_ = energy_;
            if (is_singular_) {
                refuse();
            } else if (!(energy_ > 0.0)) {
                end_inner();
            } else {
                enter(Phase::kDirection);
            }
            return units;
        case Phase::kDirection: {
            const double share = inner_ == 0 ? 0.0 : energy_ / energy_before_;
            if (each_keyframe([share](Keyframe& keyframe) {
                    for (int i = 0; i < 6; ++i) {
                        keyframe.direction[i] =
                            keyframe.moves ? keyframe.preconditioned[i] + share * keyframe.direction[i] : 0.0;
                        keyframe.product[i] = keyframe.damping[i] * keyframe.direction[i];
                    }
                })) {
                return units;
            }
            ++inner_;
            ++summary_.inner_iterations;
            enter(Phase::kMultiply);
            return units;
        }
        case Phase::kMultiply:
            if (cursor_ < point_count_) units = multiply_point(points_[cursor_++]);
            if (cursor_ < point_count_) return units;
            curvature_ = 0.0;
            enter(Phase::kCurvature);
            return units;
        case Phase::kCurvature:
            if (each_keyframe([this](const Keyframe& keyframe) {
                    for (int i = 0; i < 6; ++i) {
                        if (keyframe.moves) curvature_ += keyframe.direction[i] * keyframe.product[i];
                    }
                })) {
                return units;
            }
            energy_before_ = energy_;
            if (!(curvature_ > 0.0)) {
                end_inner();
                return units;
            }
            curvature_ = energy_ / curvature_;  // from here on the step's length
            energy_ = 0.0;
            enter(Phase::kAdvance);
            return units;
        case Phase::kAdvance:
            if (each_keyframe([this](Keyframe& keyframe) {
                    if (!keyframe.moves) return;
                    for (int i = 0; i < 6; ++i) {
                        keyframe.step[i] += curvature_ * keyframe.direction[i];
                        keyframe.residual[i] -= curvature_ * keyframe.product[i];
                    }
                    precondition(keyframe);
                })) {
                return units;
            }
            if (!(energy_ > options_.inner_residual_max * options_.inner_residual_max * energy_first_) ||
                inner_ == options_.inner_iterations_max) {
                end_inner();
            } else {
                enter(Phase::kDirection);
            }
            return units;
        case Phase::kCandidate:
            if (each_keyframe([this](Keyframe& keyframe) {
                    if (!keyframe.moves) {
                        keyframe.stay(current_);
                        return;
                    }
                    Vector6 xi;
                    for (int i = 0; i < 6; ++i) {
                        const double x = keyframe.step[i];
                        xi(i) = x;
                        // Of the reduced model: -2 r x - x S x with S x = r - residual, damping included.
                        descent_.predicted +=
                            x * (keyframe.reduced[i] + keyframe.residual[i] + keyframe.damping[i] * x);
                    }
                    if (!is_sane_step(xi)) {
                        is_singular_ = true;
                        return;
                    }
                    keyframe.move(current_, xi);
                })) {
                return units;
            }
            descent_.candidate_cost = 0.0;
            if (is_singular_) {
                refuse();
            } else {
                enter(Phase::kEvaluate);
            }
            return units;
        case Phase::kEvaluate:
            if (cursor_ < point_count_) units = evaluate_point(points_[cursor_++]);
            if (cursor_ == point_count_) judge();
            return units;
    }
    STILLMESH_CHECK(false);
    return 0;
}

void GlobalAdjustment::next_iteration() noexcept {
    if (summary_.iterations >= options_.iterations_max || point_count_ == 0 || keyframe_count_ == 0) return finish();
    ++summary_.iterations;
    enter(Phase::kClear);
}

void GlobalAdjustment::finish() noexcept {
    summary_.final_cost = descent_.cost;
    state_ = State::kDone;
}

// Sums of the point and of its keyframes, its factor, and what its elimination takes from the keyframes.
std::uint32_t GlobalAdjustment::linearise_point(Point& p) noexcept {
    p.is_used = p.can_move = false;
    std::uint32_t seen = 0, depths = 0;
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        ++seen;
        depths += observations_[i].info_z > 0 ? 1U : 0U;
    }
    if (seen < 2 && depths == 0) return 1;
    p.is_used = true;
    ++summary_.points_used;
    const double* const world = p.world[current_];
    double v[6] = {}, g[3] = {};
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        Keyframe& keyframe = keyframes_[o.keyframe];
        const Sighting s = sighting_of(o);
        const SightingResidual r = sighting_residual(keyframe.camera[current_], world, s);
        descent_.cost += huber_cost(r.chi2, threshold_of(o));
        if (r.is_far()) continue;
        const Derivatives d = derivatives_of(keyframe.camera[current_], r, s, threshold_of(o));
        int at = 0;
        for (int row = 0; row < 3; ++row) {
            g[row] += d.a * (d.point.x[row] * r.x + d.point.y[row] * r.y) + d.b * d.point.z[row] * r.z;
            for (int c = 0; c <= row; ++c, ++at) {
                v[at] += d.a * (d.point.x[row] * d.point.x[c] + d.point.y[row] * d.point.y[c]) +
                         d.b * d.point.z[row] * d.point.z[c];
            }
        }
        if (!keyframe.moves) continue;
        for (int row = 0; row < 6; ++row) {
            keyframe.gradient[row] += d.a * (d.pose.x[row] * r.x + d.pose.y[row] * r.y) + d.b * d.pose.z[row] * r.z;
            for (int c = 0; c <= row; ++c) {
                keyframe.diagonal(row, c) += d.a * (d.pose.x[row] * d.pose.x[c] + d.pose.y[row] * d.pose.y[c]) +
                                             d.b * d.pose.z[row] * d.pose.z[c];
            }
            keyframe.hessian[row] += d.a * (d.pose.x[row] * d.pose.x[row] + d.pose.y[row] * d.pose.y[row]) +
                                     d.b * d.pose.z[row] * d.pose.z[row];
        }
    }
    for (int k = 0; k < 3; ++k) {
        double& diagonal = v[kPointDiagonal[k]];
        p.damping[k] = descent_.damping_of(diagonal, kDiagonalMin);
        diagonal += p.damping[k];
        p.gradient[k] = g[k];
    }
    p.can_move = factor_point(v, p.factor);
    if (!p.can_move) return 1 + 2 * seen;
    double reached[3] = {g[0], g[1], g[2]};  // L^-1 g
    forward(p.factor, reached);
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        Keyframe& keyframe = keyframes_[o.keyframe];
        if (!keyframe.moves) continue;
        const Sighting s = sighting_of(o);
        const SightingResidual r = sighting_residual(keyframe.camera[current_], world, s);
        if (r.is_far()) continue;
        const Derivatives d = derivatives_of(keyframe.camera[current_], r, s, threshold_of(o));
        double coupled[6][3];  // rows: L^-1 Jpoint^T W Jpose, by column
        for (int c = 0; c < 6; ++c) {
            for (int k = 0; k < 3; ++k) {
                coupled[c][k] =
                    d.a * (d.point.x[k] * d.pose.x[c] + d.point.y[k] * d.pose.y[c]) + d.b * d.point.z[k] * d.pose.z[c];
            }
            forward(p.factor, coupled[c]);
        }
        for (int row = 0; row < 6; ++row) {
            keyframe.reduced[row] +=
                coupled[row][0] * reached[0] + coupled[row][1] * reached[1] + coupled[row][2] * reached[2];
            for (int c = 0; c <= row; ++c) {
                keyframe.diagonal(row, c) -=
                    coupled[row][0] * coupled[c][0] + coupled[row][1] * coupled[c][1] + coupled[row][2] * coupled[c][2];
            }
        }
    }
    return 1 + 4 * seen;
}

// Damping, the block's factor, the right-hand side: -(gradient - what the points explain of it).
bool GlobalAdjustment::prepare(Keyframe& keyframe) noexcept {
    for (int i = 0; i < 6; ++i) {
        keyframe.damping[i] = descent_.damping_of(keyframe.hessian[i], kDiagonalMin);
        keyframe.diagonal(i, i) += keyframe.damping[i];
        keyframe.reduced[i] -= keyframe.gradient[i];
        keyframe.residual[i] = keyframe.reduced[i];
    }
    if (!cholesky(keyframe.diagonal, is_good_pivot)) return false;
    precondition(keyframe);
    return true;
}

void GlobalAdjustment::precondition(Keyframe& keyframe) noexcept {
    double* const x = keyframe.preconditioned;
    for (int i = 0; i < 6; ++i) x[i] = keyframe.residual[i];
    solve_lower(keyframe.diagonal, x);
    solve_lower_transposed(keyframe.diagonal, x);
    for (int i = 0; i < 6; ++i) energy_ += keyframe.residual[i] * x[i];
}

// product += (Jpose^T W Jpose - Jpose^T W Jpoint V^-1 Jpoint^T W Jpose) direction, over the point's observations.
std::uint32_t GlobalAdjustment::multiply_point(const Point& p) noexcept {
    if (!p.is_used) return 1;
    const double* const world = p.world[current_];
    double pulled[3] = {};
    for (const bool is_second : {false, true}) {
        if (is_second) {
            if (p.can_move) {
                forward(p.factor, pulled);
                backward(p.factor, pulled);
            } else {
                pulled[0] = pulled[1] = pulled[2] = 0.0;
            }
        }
        for (std::uint32_t i = p.begin; i < p.end; ++i) {
            const Observation& o = observations_[i];
            Keyframe& keyframe = keyframes_[o.keyframe];
            if (!keyframe.moves) continue;
            const Sighting s = sighting_of(o);
            const SightingResidual r = sighting_residual(keyframe.camera[current_], world, s);
            if (r.is_far()) continue;
            const Derivatives d = derivatives_of(keyframe.camera[current_], r, s, threshold_of(o));
            double x = 0, y = 0, z = 0;
            for (int k = 0; k < 6; ++k) {
                x += d.pose.x[k] * keyframe.direction[k];
                y += d.pose.y[k] * keyframe.direction[k];
                z += d.pose.z[k] * keyframe.direction[k];
            }
            if (!is_second) {
                for (int k = 0; k < 3; ++k) {
                    pulled[k] += d.a * (d.point.x[k] * x + d.point.y[k] * y) + d.b * d.point.z[k] * z;
                }
                continue;
            }
            for (int k = 0; k < 3; ++k) {
                x -= d.point.x[k] * pulled[k];
                y -= d.point.y[k] * pulled[k];
                z -= d.point.z[k] * pulled[k];
            }
            for (int k = 0; k < 6; ++k) {
                keyframe.product[k] += d.a * (d.pose.x[k] * x + d.pose.y[k] * y) + d.b * d.pose.z[k] * z;
            }
        }
    }
    return 1 + 2 * (p.end - p.begin);
}

void GlobalAdjustment::end_inner() noexcept {
    descent_.predicted = 0.0;
    is_singular_ = false;
    enter(Phase::kCandidate);
}

std::uint32_t GlobalAdjustment::evaluate_point(Point& p) noexcept {
    const double* const world = p.world[current_];
    double* const candidate = p.world[1 - current_];
    for (int k = 0; k < 3; ++k) candidate[k] = world[k];
    if (!p.is_used) return 1;
    if (p.can_move) {
        double g[3] = {p.gradient[0], p.gradient[1], p.gradient[2]};
        // What the point would gain alone, -g V^-1 g, is in the reduced model's constant.
        double alone[3] = {g[0], g[1], g[2]};
        forward(p.factor, alone);
        descent_.predicted += alone[0] * alone[0] + alone[1] * alone[1] + alone[2] * alone[2];
        for (std::uint32_t i = p.begin; i < p.end; ++i) {
            const Observation& o = observations_[i];
            const Keyframe& keyframe = keyframes_[o.keyframe];
            if (!keyframe.moves) continue;
            const Sighting s = sighting_of(o);
            const SightingResidual r = sighting_residual(keyframe.camera[current_], world, s);
            if (r.is_far()) continue;
            const Derivatives d = derivatives_of(keyframe.camera[current_], r, s, threshold_of(o));
            double x = 0, y = 0, z = 0;
            for (int k = 0; k < 6; ++k) {
                x += d.pose.x[k] * keyframe.step[k];
                y += d.pose.y[k] * keyframe.step[k];
                z += d.pose.z[k] * keyframe.step[k];
            }
            for (int k = 0; k < 3; ++k) {
                g[k] += d.a * (d.point.x[k] * x + d.point.y[k] * y) + d.b * d.point.z[k] * z;
            }
        }
        forward(p.factor, g);
        backward(p.factor, g);
        if (is_sane_step(g[0] * g[0] + g[1] * g[1] + g[2] * g[2])) {
            for (int k = 0; k < 3; ++k) {
                candidate[k] = world[k] - g[k];
                descent_.predicted += p.damping[k] * g[k] * g[k];
            }
        }
    }
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        const SightingResidual r =
            sighting_residual(keyframes_[o.keyframe].camera[1 - current_], candidate, sighting_of(o));
        descent_.candidate_cost += huber_cost(r.chi2, threshold_of(o));
    }
    return 1 + 2 * (p.end - p.begin);
}

void GlobalAdjustment::judge() noexcept {
    const double negligible = options_.cost_change_min * descent_.cost;
    if (!descent_.is_better()) {
        if (descent_.predicted <= negligible) summary_.has_converged = true;
        refuse();
        return;
    }
    const double gain = descent_.accept();
    current_ = 1 - current_;
    ++summary_.steps_accepted;
    summary_.has_converged = gain <= negligible;
    if (summary_.has_converged) {
        finish();
    } else {
        next_iteration();
    }
}

void GlobalAdjustment::refuse() noexcept {
    if (descent_.refuse() && !summary_.has_converged) {
        next_iteration();
    } else {
        finish();
    }
}

}  // namespace stillmesh
