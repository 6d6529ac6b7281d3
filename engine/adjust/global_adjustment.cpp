#include "engine/adjust/global_adjustment.hpp"

#include "engine/base/check.hpp"
#include "engine/geometry/cholesky.hpp"

namespace stillmesh {

// Of one observation's residuals, and what weighs them.
struct GlobalAdjustment::Derivatives {
    PoseRows pose;
    PointRows point;
    double a = 0, b = 0;  // weights of pixels and of depth

    struct Residuals {
        double x = 0, y = 0, z = 0;
    };
    // How a step of the keyframe changes the residuals.
    [[nodiscard]] Residuals along(const Vector6& step) const noexcept {
        Residuals out;
        for (int k = 0; k < 6; ++k) {
            out.x += pose.x[k] * step[k];
            out.y += pose.y[k] * step[k];
            out.z += pose.z[k] * step[k];
        }
        return out;
    }
    // Adds J^T W residuals: for the keyframe, for the point.
    void pull_pose(double x, double y, double z, Vector6& sum) const noexcept {
        for (int k = 0; k < 6; ++k) sum[k] += a * (pose.x[k] * x + pose.y[k] * y) + b * pose.z[k] * z;
    }
    void pull_point(double x, double y, double z, double sum[3]) const noexcept {
        for (int k = 0; k < 3; ++k) sum[k] += a * (point.x[k] * x + point.y[k] * y) + b * point.z[k] * z;
    }
};

void GlobalAdjustment::create(Arena& arena, const GlobalSizes& sizes) noexcept {
    STILLMESH_CHECK(sizes.keyframes_max <= 0xffffU);
    keyframes_ = arena.array<Keyframe>(sizes.keyframes_max);
    points_ = arena.array<Point>(sizes.points_max);
    observations_ = arena.array<Observation>(sizes.observations_max);
    begin();
}

void GlobalAdjustment::begin() noexcept {
    forget();
    summary_ = GlobalSummary{};
}

Result<std::uint32_t> GlobalAdjustment::add_keyframe(const SE3& world_from_camera, bool is_fixed) noexcept {
    if (keyframe_count_ == keyframes_.size()) return Status::kFull;
    return take_keyframe(world_from_camera, is_fixed);
}

Status GlobalAdjustment::reserve(std::uint32_t point) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting && point < point_count_);
    if (observation_count_ == observations_.size()) return Status::kFull;
    ++observation_count_;
    ++points_[point].given;
    return Status::kOk;
}

void GlobalAdjustment::fill() noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    std::uint32_t at = 0;
    for (std::uint32_t i = 0; i < point_count_; ++i) {
        points_[i].begin = points_[i].end = at;
        at += points_[i].given;
    }
    state_ = State::kFilling;
}

Status GlobalAdjustment::add_observation(const AdjustmentObservation& given) noexcept {
    STILLMESH_CHECK(state_ == State::kFilling && given.keyframe < keyframe_count_ && given.point < point_count_);
    Point& point = points_[given.point];
    if (point.end - point.begin == point.given) return Status::kFull;
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
    const std::uint32_t observations = summary_.observations;
    run(options);
    summary_.observations = observations;
    fix_one();
    for (std::uint32_t i = 0; i < keyframe_count_; ++i) {
        keyframes_[i].moves = !keyframes_[i].is_fixed && keyframes_[i].used >= kKeyframeObservationsMin;
    }
    next_iteration();
}

std::uint32_t GlobalAdjustment::next_piece() noexcept {
    switch (phase_) {
        case Phase::kClear: summary_.points_used = 0; return clear_sums();
        case Phase::kLinearise: return linearise_terms();
        case Phase::kFactorise: return factorise();
        case Phase::kDirect: return direct();
        case Phase::kMultiply: return multiply_terms();
        case Phase::kMeasure: return measure();
        case Phase::kAdvance: return advance();
        case Phase::kCandidate: return make_candidate();
        case Phase::kEvaluate: return evaluate_terms(kBundleCostExact * summary_.observations);
    }
    STILLMESH_CHECK(false);
    return 0;
}

template <typename Visit>
void GlobalAdjustment::each_moving(const Point& p, Visit&& visit) noexcept {
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        Keyframe& keyframe = keyframes_[o.keyframe];
        if (!keyframe.moves) continue;
        const CameraRows& camera = keyframe.camera[current_];
        const Sighting seen = o.seen();
        const SightingResidual r = sighting_residual(camera, p.world[current_], seen);
        if (!r.is_far()) visit(keyframe, derivatives_of(camera, seen, r));
    }
}

GlobalAdjustment::Derivatives GlobalAdjustment::derivatives_of(const CameraRows& camera, const Sighting& seen,
                                                               const SightingResidual& r) const noexcept {
    const double weight = huber_weight(r.chi2, threshold_of(seen));
    return {pose_rows(r), point_rows(camera, r), weight * seen.info, weight * seen.info_z};
}

void GlobalAdjustment::clear(Keyframe& keyframe) noexcept {
    keyframe.diagonal.setZero();
    keyframe.hessian.setZero();
    keyframe.gradient.setZero();
    keyframe.reduced.setZero();
}

// Sums of the point and of its keyframes, its factor, and what its elimination takes from the keyframes.
std::uint32_t GlobalAdjustment::linearise(Point& p) noexcept {
    p.is_used = p.can_move = false;
    const std::uint32_t seen = p.end - p.begin;
    bool has_depth = false;
    for (std::uint32_t i = p.begin; i < p.end; ++i) has_depth = has_depth || observations_[i].info_z > 0;
    if (seen < 2 && !has_depth) return 1;
    p.is_used = true;
    ++summary_.points_used;
    sum_up(p);
    if (!p.can_move) return 1 + 2 * seen;
    eliminate(p);
    return 1 + 4 * seen;
}

void GlobalAdjustment::sum_up(Point& p) noexcept {
    double v[6] = {}, g[3] = {};
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        Keyframe& keyframe = keyframes_[o.keyframe];
        const CameraRows& camera = keyframe.camera[current_];
        const Sighting seen = o.seen();
        const SightingResidual r = sighting_residual(camera, p.world[current_], seen);
        descent_.cost += huber_cost(r.chi2, threshold_of(seen));
        if (r.is_far()) continue;
        const Derivatives d = derivatives_of(camera, seen, r);
        d.pull_point(r.x, r.y, r.z, g);
        int at = 0;
        for (int row = 0; row < 3; ++row) {
            for (int c = 0; c <= row; ++c, ++at) {
                v[at] += d.a * (d.point.x[row] * d.point.x[c] + d.point.y[row] * d.point.y[c]) +
                         d.b * d.point.z[row] * d.point.z[c];
            }
        }
        if (!keyframe.moves) continue;
        d.pull_pose(r.x, r.y, r.z, keyframe.gradient);
        for (int row = 0; row < 6; ++row) {
            double h = 0;
            for (int c = 0; c <= row; ++c) {
                h = d.a * (d.pose.x[row] * d.pose.x[c] + d.pose.y[row] * d.pose.y[c]) +
                    d.b * d.pose.z[row] * d.pose.z[c];
                keyframe.diagonal(row, c) += h;
            }
            keyframe.hessian[row] += h;
        }
    }
    p.factorise(v, g, descent_);
}

void GlobalAdjustment::eliminate(const Point& p) noexcept {
    double reached[3] = {p.gradient[0], p.gradient[1], p.gradient[2]};  // L^-1 g
    forward(p.factor, reached);
    each_moving(p, [&](Keyframe& keyframe, const Derivatives& d) {
        double coupled[6][3] = {};  // by column: L^-1 Jpoint^T W Jpose
        for (int c = 0; c < 6; ++c) {
            d.pull_point(d.pose.x[c], d.pose.y[c], d.pose.z[c], coupled[c]);
            forward(p.factor, coupled[c]);
        }
        for (int row = 0; row < 6; ++row) {
            const double* const l = coupled[row];
            keyframe.reduced[row] += l[0] * reached[0] + l[1] * reached[1] + l[2] * reached[2];
            for (int c = 0; c <= row; ++c) {
                keyframe.diagonal(row, c) -= l[0] * coupled[c][0] + l[1] * coupled[c][1] + l[2] * coupled[c][2];
            }
        }
    });
}

std::uint32_t GlobalAdjustment::factorise() noexcept {
    return each_moving_block(
        [this](Keyframe& keyframe) {
            if (!is_singular_) is_singular_ = !factorise_keyframe(keyframe);
        },
        [this] { is_singular_ ? refuse() : go_on(); });
}

// Damping, the block's factor, the right-hand side: -(gradient - what the points explain of it).
bool GlobalAdjustment::factorise_keyframe(Keyframe& keyframe) noexcept {
    for (int i = 0; i < 6; ++i) {
        keyframe.damping[i] = descent_.damping_of(keyframe.hessian[i], kBundleDiagonalMin);
        keyframe.diagonal(i, i) += keyframe.damping[i];
        keyframe.reduced[i] -= keyframe.gradient[i];
    }
    if (!cholesky(keyframe.diagonal, is_good_pivot)) return false;
    keyframe.begin_at_zero(keyframe.reduced);
    precondition(keyframe);
    return true;
}

void GlobalAdjustment::precondition(Keyframe& keyframe) noexcept {
    keyframe.preconditioned = keyframe.residual;
    solve_lower(keyframe.diagonal, keyframe.preconditioned);
    solve_lower_transposed(keyframe.diagonal, keyframe.preconditioned);
    inner_.add_energy(keyframe);
}

// product += (Jpose^T W Jpose - Jpose^T W Jpoint V^-1 Jpoint^T W Jpose) direction, over the point's observations.
std::uint32_t GlobalAdjustment::multiply(const Point& p) noexcept {
    if (!p.is_used) return 1;
    double pulled[3] = {};
    if (p.can_move) {
        each_moving(p, [&](const Keyframe& keyframe, const Derivatives& d) {
            const auto change = d.along(keyframe.direction);
            d.pull_point(change.x, change.y, change.z, pulled);
        });
        forward(p.factor, pulled);
        backward(p.factor, pulled);
    }
    each_moving(p, [&](Keyframe& keyframe, const Derivatives& d) {
        auto change = d.along(keyframe.direction);
        for (int k = 0; k < 3; ++k) {
            change.x -= d.point.x[k] * pulled[k];
            change.y -= d.point.y[k] * pulled[k];
            change.z -= d.point.z[k] * pulled[k];
        }
        d.pull_pose(change.x, change.y, change.z, keyframe.product);
    });
    return 1 + 2 * (p.end - p.begin);
}

std::uint32_t GlobalAdjustment::advance() noexcept {
    return each_moving_block(
        [this](Keyframe& keyframe) {
            inner_.update_solution(keyframe);
            precondition(keyframe);
        },
        [this] { go_on(); });
}

void GlobalAdjustment::move(Keyframe& keyframe) noexcept {
    keyframe.TwinPose::move(current_, keyframe.solution);
    for (int i = 0; i < 6; ++i) {
        const double x = keyframe.solution[i];
        // Of the reduced model: -2 r x - x S x with S x = r - residual, damping included.
        descent_.predicted += x * (keyframe.reduced[i] + keyframe.residual[i] + keyframe.damping[i] * x);
    }
}

std::uint32_t GlobalAdjustment::evaluate(Point& p) noexcept {
    p.stay(current_);
    if (!p.is_used) return 1;
    if (p.can_move) move_point(p);
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        const Sighting seen = o.seen();
        const CameraRows& camera = keyframes_[o.keyframe].camera[1 - current_];
        descent_.candidate_cost +=
            huber_cost(sighting_residual(camera, p.world[1 - current_], seen).chi2, threshold_of(seen));
    }
    return 1 + 2 * (p.end - p.begin);
}

// To where the keyframes' steps pull it.
void GlobalAdjustment::move_point(Point& p) noexcept {
    double g[3] = {p.gradient[0], p.gradient[1], p.gradient[2]};
    // What the point would gain alone, -g V^-1 g, is in the reduced model's constant.
    double alone[3] = {g[0], g[1], g[2]};
    forward(p.factor, alone);
    descent_.predicted += squared_norm(alone);
    each_moving(p, [&](const Keyframe& keyframe, const Derivatives& d) {
        const auto change = d.along(keyframe.solution);
        d.pull_point(change.x, change.y, change.z, g);
    });
    forward(p.factor, g);
    backward(p.factor, g);
    if (!is_sane_step(squared_norm(g))) return;
    for (int k = 0; k < 3; ++k) {
        p.world[1 - current_][k] -= g[k];
        descent_.predicted += p.damping[k] * g[k] * g[k];
    }
}

}  // namespace stillmesh
