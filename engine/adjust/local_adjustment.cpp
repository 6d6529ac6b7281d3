#include "engine/adjust/local_adjustment.hpp"

#include <utility>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kChunk = 64;        // elements sorted in one piece
constexpr std::uint32_t kUnitsOfChunk = 8;  // moving an element costs about an eighth of a residual

// Adds J^T W J of one observation to the lower triangle; the rows' zeros are known (linearisation.hpp).
void add_hessian(const PoseRows& j, double a, double b, double h[36]) noexcept {
    const double ax0 = a * j.x[0], ax2 = a * j.x[2], ax3 = a * j.x[3], ax4 = a * j.x[4], ax5 = a * j.x[5];
    const double ay1 = a * j.y[1], ay2 = a * j.y[2], ay3 = a * j.y[3], ay4 = a * j.y[4], ay5 = a * j.y[5];
    const double bz2 = b * j.z[2], bz3 = b * j.z[3], bz4 = b * j.z[4];
    h[0] += ax0 * j.x[0];
    h[7] += ay1 * j.y[1];
    h[12] += ax2 * j.x[0];
    h[13] += ay2 * j.y[1];
    h[14] += ax2 * j.x[2] + ay2 * j.y[2] + bz2 * j.z[2];
    h[18] += ax3 * j.x[0];
    h[19] += ay3 * j.y[1];
    h[20] += ax3 * j.x[2] + ay3 * j.y[2] + bz3 * j.z[2];
    h[21] += ax3 * j.x[3] + ay3 * j.y[3] + bz3 * j.z[3];
    h[24] += ax4 * j.x[0];
    h[25] += ay4 * j.y[1];
    h[26] += ax4 * j.x[2] + ay4 * j.y[2] + bz4 * j.z[2];
    h[27] += ax4 * j.x[3] + ay4 * j.y[3] + bz4 * j.z[3];
    h[28] += ax4 * j.x[4] + ay4 * j.y[4] + bz4 * j.z[4];
    h[30] += ax5 * j.x[0];
    h[31] += ay5 * j.y[1];
    h[32] += ax5 * j.x[2] + ay5 * j.y[2];
    h[33] += ax5 * j.x[3] + ay5 * j.y[3];
    h[34] += ax5 * j.x[4] + ay5 * j.y[4];
    h[35] += ax5 * j.x[5] + ay5 * j.y[5];
}

// The eliminated point's share of one observation: L^-1 (Jpoint^T W Jpose), three rows of six.
struct Coupling {
    double row[3][6];
    std::uint32_t column;
};

// s -= z_i^T z_j
void subtract_outer(const Coupling& z_i, const Coupling& z_j, double* __restrict s) noexcept {
    for (std::uint32_t r = 0; r < 6; ++r) {
        const double a0 = z_i.row[0][r], a1 = z_i.row[1][r], a2 = z_i.row[2][r];
        for (std::uint32_t c = 0; c < 6; ++c) {
            s[6 * r + c] -= a0 * z_j.row[0][c] + a1 * z_j.row[1][c] + a2 * z_j.row[2][c];
        }
    }
}

}  // namespace

void LocalAdjustment::create(Arena& arena, const AdjustmentSizes& sizes) noexcept {
    STILLMESH_CHECK(sizes.free_keyframes_max <= kFreeKeyframesMax);
    STILLMESH_CHECK(sizes.fixed_keyframes_max <= kKeyframesMax - sizes.free_keyframes_max);
    sizes_ = sizes;
    take_arrays(arena, sizes);
    system_.create(arena, sizes.free_keyframes_max);
    begin();
}

void LocalAdjustment::begin() noexcept {
    forget();
}

Result<std::uint32_t> LocalAdjustment::add_keyframe(const SE3& world_from_camera, bool is_fixed) noexcept {
    const std::uint32_t of_kind = is_fixed ? fixed_count_ : keyframe_count_ - fixed_count_;
    if (of_kind == (is_fixed ? sizes_.fixed_keyframes_max : sizes_.free_keyframes_max)) return Status::kFull;
    const Result<std::uint32_t> taken = take_keyframe(world_from_camera, is_fixed);
    if (taken.is_ok()) keyframes_[taken.value()].observations = 0;
    return taken;
}

Status LocalAdjustment::add_observation(const AdjustmentObservation& given) noexcept {
    STILLMESH_CHECK(state_ == State::kCollecting);
    STILLMESH_CHECK(given.keyframe < keyframe_count_ && given.point < point_count_);
    if (observation_count_ == observations_.size()) return Status::kFull;
    if (!is_finite(given.x) || !is_finite(given.y)) return Status::kInvalid;
    Observation o;
    o.seen.x = given.x;
    o.seen.y = given.y;
    o.seen.info = 1.0 / given.var_pixel;
    if (!(o.seen.info > 0.0) || !is_finite(o.seen.info)) return Status::kInvalid;
    if (given.var_z != 0.0) {
        o.seen.z_m = given.z_m;
        o.seen.info_z = 1.0 / given.var_z;
        if (!is_finite(given.z_m) || !(o.seen.info_z > 0.0) || !is_finite(o.seen.info_z)) return Status::kInvalid;
    }
    o.keyframe = static_cast<std::uint16_t>(given.keyframe);
    o.point = given.point;
    o.input = observation_count_;
    observations_[observation_count_++] = o;
    ++keyframes_[given.keyframe].observations;
    ++points_[given.point].given;
    return Status::kOk;
}

void LocalAdjustment::start(const AdjustmentOptions& options) noexcept {
    STILLMESH_CHECK(options.chi2_max_pixel > 0 && options.chi2_max_depth > 0);
    run(options);
    fix_one();
    std::uint32_t at = 0;
    for (std::uint32_t i = 0; i < keyframe_count_; ++i) {
        const std::uint32_t count = keyframes_[i].observations;
        keyframes_[i].observations = at;
        at += count;
    }
    round_ = 0;
    enter(Phase::kSortByKeyframe);
}

std::uint32_t LocalAdjustment::next_piece() noexcept {
    switch (phase_) {
        case Phase::kSortByKeyframe: return sort_by_keyframe();
        case Phase::kPlacePoints: return place_points();
        case Phase::kSortByPoint: return sort_by_point();
        case Phase::kPermute: return permute();
        case Phase::kSelect: return select();
        case Phase::kClear: return clear_sums();
        case Phase::kLinearise: return linearise();
        case Phase::kFactorise: return factorise();
        case Phase::kSolve: return solve();
        case Phase::kEvaluate: return evaluate();
        case Phase::kClassify: return classify();
    }
    STILLMESH_CHECK(false);
    return 0;
}

// Two stable counting sorts, by keyframe and then by point: the observations of a point lie together, by keyframe.
std::uint32_t LocalAdjustment::sort_by_keyframe() noexcept {
    for (std::uint32_t n = 0; n < kChunk && cursor_ < observation_count_; ++n, ++cursor_) {
        order_[keyframes_[observations_[cursor_].keyframe].observations++] = cursor_;
    }
    if (cursor_ == observation_count_) enter(Phase::kPlacePoints);
    return kUnitsOfChunk;
}

std::uint32_t LocalAdjustment::place_points() noexcept {
    for (std::uint32_t n = 0; n < kChunk && cursor_ < point_count_; ++n, ++cursor_) {
        Point& p = points_[cursor_];
        p.begin = cursor_ == 0 ? 0 : points_[cursor_ - 1].begin + points_[cursor_ - 1].given;
        p.end = p.begin;
    }
    if (cursor_ == point_count_) enter(Phase::kSortByPoint);
    return kUnitsOfChunk;
}

std::uint32_t LocalAdjustment::sort_by_point() noexcept {
    for (std::uint32_t n = 0; n < kChunk && cursor_ < observation_count_; ++n, ++cursor_) {
        Observation& o = observations_[order_[cursor_]];
        Point& p = points_[o.point];
        if (p.last_keyframe == o.keyframe) {  // a duplicate: to the back of the point's range, out of every loop
            o.is_dropped = o.is_outlier = true;
            o.chi2 = kAdjustChi2Far;
            --p.given;
            position_[o.input] = p.begin + p.given;
        } else {
            p.last_keyframe = o.keyframe;
            position_[o.input] = p.end++;
        }
    }
    if (cursor_ == observation_count_) enter(Phase::kPermute);
    return kUnitsOfChunk;
}

// In place, along the cycles: every swap brings one observation home.
std::uint32_t LocalAdjustment::permute() noexcept {
    for (std::uint32_t n = 0; n < kChunk && cursor_ < observation_count_; ++n) {
        const std::uint32_t home = position_[observations_[cursor_].input];
        if (home == cursor_) {
            ++cursor_;
        } else {
            std::swap(observations_[cursor_], observations_[home]);
        }
    }
    if (cursor_ == observation_count_) begin_round();
    return kUnitsOfChunk;
}

void LocalAdjustment::begin_round() noexcept {
    for (std::uint32_t i = 0; i < keyframe_count_; ++i) {
        Keyframe& keyframe = keyframes_[i];
        keyframe.used = 0;
        keyframe.stay(current_);
    }
    summary_.observations_used = summary_.residuals_used = summary_.points_used = summary_.keyframes_used = 0;
    iteration_ = 0;
    descent_.begin(options_.damping_initial);
    enter(Phase::kSelect);
}

// A point takes part with two observations, or one with depth.
std::uint32_t LocalAdjustment::select() noexcept {
    std::uint32_t looked_at = 0;
    for (; looked_at < kChunk && cursor_ < point_count_; ++cursor_) {
        Point& p = points_[cursor_];
        looked_at += 1 + p.end - p.begin;
        std::uint32_t seen = 0, depths = 0;
        for (std::uint32_t i = p.begin; i < p.end; ++i) {
            Observation& o = observations_[i];
            o.is_dropped = round_ > 0 && o.is_outlier;
            if (o.is_dropped) continue;
            ++seen;
            if (o.seen.info_z > 0) ++depths;
        }
        p.is_used = seen >= 2 || depths >= 1;
        p.stay(current_);
        if (!p.is_used) continue;
        ++summary_.points_used;
        summary_.observations_used += seen;
        summary_.residuals_used += 2 * seen + depths;
        for (std::uint32_t i = p.begin; i < p.end; ++i) {
            if (!observations_[i].is_dropped) ++keyframes_[observations_[i].keyframe].used;
        }
    }
    if (cursor_ == point_count_) {
        assign_columns();
        next_iteration();
    }
    return 1 + looked_at / 8;
}

void LocalAdjustment::assign_columns() noexcept {
    column_count_ = 0;
    for (std::uint32_t i = 0; i < keyframe_count_; ++i) {
        Keyframe& keyframe = keyframes_[i];
        keyframe.column = -1;
        if (keyframe.is_fixed || keyframe.used < kKeyframeObservationsMin) continue;
        columns_[column_count_].keyframe = i;
        keyframe.column = static_cast<std::int32_t>(column_count_++);
    }
    summary_.keyframes_used = column_count_;
}

void LocalAdjustment::next_iteration() noexcept {
    if (descent_.is_over() || iteration_ >= options_.iterations_max[round_] || summary_.points_used == 0) {
        return end_round();
    }
    ++iteration_;
    ++summary_.iterations;
    enter(Phase::kClear);
}

std::uint32_t LocalAdjustment::clear_sums() noexcept {
    system_.clear(column_count_);
    for (std::uint32_t i = 0; i < column_count_; ++i) {
        for (double& h : columns_[i].hessian) h = 0.0;
        for (double& g : columns_[i].gradient) g = 0.0;
    }
    descent_.cost = 0.0;
    enter(Phase::kLinearise);
    return 1 + column_count_ * (column_count_ + 1) / 8;
}

std::uint32_t LocalAdjustment::linearise() noexcept {
    const std::uint32_t units = linearise_point(points_[cursor_]);
    if (++cursor_ == point_count_) {
        if (summary_.iterations == 1) summary_.initial_cost = descent_.cost;
        assemble();
        enter(column_count_ > 0 ? Phase::kFactorise : Phase::kSolve);
    }
    return units;
}

std::uint32_t LocalAdjustment::linearise_point(Point& p) noexcept {
    if (!p.is_used) return 1;
    const double* const world = p.world[current_];
    Coupling couplings[kFreeKeyframesMax];
    std::uint32_t coupled = 0;
    double v[6] = {};
    double g[3] = {};
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        if (o.is_dropped) continue;
        const Keyframe& keyframe = keyframes_[o.keyframe];
        const CameraRows& camera = keyframe.camera[current_];
        const SightingResidual r = sighting_residual(camera, world, o.seen);
        const double threshold = threshold_of(o.seen);
        descent_.cost += huber_cost(r.chi2, threshold);
        if (r.is_far()) continue;
        const double weight = huber_weight(r.chi2, threshold);
        const double a = weight * o.seen.info;
        const double b = weight * o.seen.info_z;
        const PointRows d = point_rows(camera, r);
        double ax[3], ay[3], bz[3];
        for (int k = 0; k < 3; ++k) {
            ax[k] = a * d.x[k];
            ay[k] = a * d.y[k];
            bz[k] = b * d.z[k];
            g[k] += ax[k] * r.x + ay[k] * r.y + bz[k] * r.z;
        }
        v[0] += ax[0] * d.x[0] + ay[0] * d.y[0] + bz[0] * d.z[0];
        v[1] += ax[1] * d.x[0] + ay[1] * d.y[0] + bz[1] * d.z[0];
        v[2] += ax[1] * d.x[1] + ay[1] * d.y[1] + bz[1] * d.z[1];
        v[3] += ax[2] * d.x[0] + ay[2] * d.y[0] + bz[2] * d.z[0];
        v[4] += ax[2] * d.x[1] + ay[2] * d.y[1] + bz[2] * d.z[1];
        v[5] += ax[2] * d.x[2] + ay[2] * d.y[2] + bz[2] * d.z[2];
        if (keyframe.column < 0) continue;
        const PoseRows j = pose_rows(r);
        Column& column = columns_[static_cast<std::uint32_t>(keyframe.column)];
        add_hessian(j, a, b, column.hessian);
        const double arx = a * r.x, ary = a * r.y, brz = b * r.z;
        for (int k = 0; k < 6; ++k) column.gradient[k] += j.x[k] * arx + j.y[k] * ary + j.z[k] * brz;
        Coupling& w = couplings[coupled++];
        w.column = static_cast<std::uint32_t>(keyframe.column);
        for (int k = 0; k < 3; ++k) {
            for (int c = 0; c < 6; ++c) w.row[k][c] = ax[k] * j.x[c] + ay[k] * j.y[c] + bz[k] * j.z[c];
        }
    }
    p.factorise(v, g, descent_);
    const std::uint32_t units = 1 + (p.end - p.begin) + coupled * (coupled + 1) / 4;
    if (!p.can_move) return units;  // it counts as known in this iteration
    // Schur complement: S -= Z^T Z, right side += Z^T L^-1 g, with Z = L^-1 W.
    const double* const l = p.factor;
    double lg[3] = {g[0], g[1], g[2]};
    forward(l, lg);
    for (std::uint32_t i = 0; i < coupled; ++i) {
        Coupling& z = couplings[i];
        double* const right = system_.vector(z.column);
        for (int c = 0; c < 6; ++c) {
            z.row[0][c] = z.row[0][c] * l[0];
            z.row[1][c] = (z.row[1][c] - l[1] * z.row[0][c]) * l[2];
            z.row[2][c] = (z.row[2][c] - l[3] * z.row[0][c] - l[4] * z.row[1][c]) * l[5];
            right[c] += z.row[0][c] * lg[0] + z.row[1][c] * lg[1] + z.row[2][c] * lg[2];
        }
        // Columns ascend with the keyframes, so this is the lower triangle.
        for (std::uint32_t k = 0; k <= i; ++k) {
            subtract_outer(z, couplings[k], system_.block(z.column, couplings[k].column));
        }
    }
    return units;
}

void LocalAdjustment::assemble() noexcept {
    for (std::uint32_t i = 0; i < column_count_; ++i) {
        const Column& column = columns_[i];
        double* const block = system_.block(i, i);
        double* const right = system_.vector(i);
        for (std::uint32_t r = 0; r < 6; ++r) {
            for (std::uint32_t c = 0; c <= r; ++c) block[6 * r + c] += column.hessian[6 * r + c];
            block[7 * r] += descent_.damping_of(column.hessian[7 * r], kBundleDiagonalMin);
            right[r] -= column.gradient[r];
        }
    }
}

std::uint32_t LocalAdjustment::factorise() noexcept {
    const std::uint32_t units = 1 + system_.products_of_column(cursor_);
    if (!system_.factor_column(cursor_)) {
        refuse();
    } else if (++cursor_ == column_count_) {
        enter(Phase::kSolve);
    }
    return units;
}

std::uint32_t LocalAdjustment::solve() noexcept {
    const std::uint32_t units = 1 + column_count_ * (column_count_ + 1) / 4 + 3 * column_count_;
    system_.solve();
    descent_.predicted = descent_.candidate_cost = 0.0;
    for (std::uint32_t i = 0; i < column_count_; ++i) {
        const Column& column = columns_[i];
        Vector6 xi;
        for (int k = 0; k < 6; ++k) xi(k) = system_.vector(i)[k];
        if (!is_sane_step(xi)) {
            refuse();
            return units;
        }
        for (std::uint32_t k = 0; k < 6; ++k) {
            const double x = system_.vector(i)[k];
            descent_.predicted +=
                x * (descent_.damping_of(column.hessian[7 * k], kBundleDiagonalMin) * x - column.gradient[k]);
        }
        Keyframe& keyframe = keyframes_[column.keyframe];
        keyframe.move(current_, xi);
    }
    enter(Phase::kEvaluate);
    return units;
}

std::uint32_t LocalAdjustment::evaluate() noexcept {
    const std::uint32_t units = evaluate_point(points_[cursor_]);
    if (++cursor_ == point_count_) judge(kBundleCostExact * summary_.observations_used);
    return units;
}

// Back substitution, then the cost of the candidate. The coupling blocks are computed again: they are not stored.
std::uint32_t LocalAdjustment::evaluate_point(Point& p) noexcept {
    if (!p.is_used) return 1;
    const double* const world = p.world[current_];
    double* const candidate = p.world[1 - current_];
    double g[3] = {p.gradient[0], p.gradient[1], p.gradient[2]};
    if (p.can_move) {
        for (std::uint32_t i = p.begin; i < p.end; ++i) {
            const Observation& o = observations_[i];
            const Keyframe& keyframe = keyframes_[o.keyframe];
            if (o.is_dropped || keyframe.column < 0) continue;
            const CameraRows& camera = keyframe.camera[current_];
            const SightingResidual r = sighting_residual(camera, world, o.seen);
            if (r.is_far()) continue;
            const double weight = huber_weight(r.chi2, threshold_of(o.seen));
            const double a = weight * o.seen.info;
            const double b = weight * o.seen.info_z;
            // How the residuals move with the keyframe's step: dq = -v + q x w.
            const double* const step = system_.vector(static_cast<std::uint32_t>(keyframe.column));
            const double dq0 = r.q[1] * step[5] - r.q[2] * step[4] - step[0];
            const double dq1 = r.q[2] * step[3] - r.q[0] * step[5] - step[1];
            const double dq2 = r.q[0] * step[4] - r.q[1] * step[3] - step[2];
            const double hx = a * r.inverse_z * (r.inverse_z * (dq0 - r.u * dq2));
            const double hy = a * r.inverse_z * (r.inverse_z * (dq1 - r.v * dq2));
            const double hz = b * dq2 - r.u * hx - r.v * hy;
            for (int k = 0; k < 3; ++k) g[k] += camera.r[k] * hx + camera.r[3 + k] * hy + camera.r[6 + k] * hz;
        }
        forward(p.factor, g);
        backward(p.factor, g);
        const bool is_sane = is_sane_step(squared_norm(g));
        for (int k = 0; k < 3; ++k) {
            const double step = is_sane ? -g[k] : 0.0;
            candidate[k] = world[k] + step;
            descent_.predicted += step * (p.damping[k] * step - p.gradient[k]);
        }
    } else {
        p.stay(current_);
    }
    for (std::uint32_t i = p.begin; i < p.end; ++i) {
        const Observation& o = observations_[i];
        if (o.is_dropped) continue;
        const SightingResidual r = sighting_residual(keyframes_[o.keyframe].camera[1 - current_], candidate, o.seen);
        descent_.candidate_cost += huber_cost(r.chi2, threshold_of(o.seen));
    }
    return 1 + (p.end - p.begin);
}

void LocalAdjustment::end_round() noexcept {
    if (round_ == 0) summary_.first_round_cost = descent_.cost;
    summary_.final_cost = descent_.cost;
    enter(Phase::kClassify);
}

std::uint32_t LocalAdjustment::classify() noexcept {
    if (cursor_ == 0) summary_.outliers = 0;
    std::uint32_t n = 0;
    for (; n < kChunk && cursor_ < observation_count_; ++n, ++cursor_) {
        Observation& o = observations_[cursor_];
        const bool is_duplicate = cursor_ >= points_[o.point].end;
        if (!is_duplicate) {
            o.chi2 =
                sighting_residual(keyframes_[o.keyframe].camera[current_], points_[o.point].world[current_], o.seen)
                    .chi2;
            o.is_outlier = !(o.chi2 <= threshold_of(o.seen));
        }
        if (o.is_outlier) ++summary_.outliers;
    }
    if (cursor_ == observation_count_) finish();
    return 1 + n;
}

void LocalAdjustment::finish() noexcept {
    // A second round is for what the outliers spoilt.
    if (round_ == 0 && options_.iterations_max[1] > 0 && summary_.outliers > 0) {
        round_ = 1;
        begin_round();
        return;
    }
    if (descent_.has_converged()) {
        summary_.outcome = AdjustmentOutcome::kConverged;
    } else if (summary_.steps_accepted > 0) {
        summary_.outcome = AdjustmentOutcome::kIterationsEnded;
    }
    state_ = State::kDone;
}

double LocalAdjustment::chi2(std::uint32_t observation) const noexcept {
    STILLMESH_CHECK(is_done() && observation < observation_count_);
    return observations_[position_[observation]].chi2;
}

bool LocalAdjustment::is_outlier(std::uint32_t observation) const noexcept {
    STILLMESH_CHECK(is_done() && observation < observation_count_);
    return observations_[position_[observation]].is_outlier;
}

}  // namespace stillmesh
