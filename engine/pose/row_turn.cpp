#include "engine/pose/row_turn.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

constexpr double kFramesMin = 5;
constexpr double kNegligible_rad = 0.002;  // half a pixel in the first and the last row
constexpr double kStayingShare = 0.25;     // a hand at 8 to 12 Hz: below none; a map: .3 to .6
constexpr int kRowPasses = 4;
constexpr double kVarianceFactorMin = 0.01;
constexpr std::size_t kRowMatchesMax = 256;  // .0002 rad; more say little more

// Of one pass over the matches.
struct RowSums {
    RowEquations equations;
    double squares = 0;  // of what image rows are off by, over their variances
    double rows = 0;

    // By how much less matches are off than their variances say: those are guessed where no motion explains the frame
    // that does not know of the turn.
    [[nodiscard]] double variance_factor() const noexcept {
        const double expected = rows - RowEquations::kUnknowns;
        return squares < expected ? std::max(squares / expected, kVarianceFactorMin) : 1.0;
    }
};

// With the turn off by `off` from what rows were carried with.
void add_match(const Correspondence& c, const SE3& camera_from_world, const Vector3& off, double chi2_max,
               RowSums& sums) noexcept {
    const Vector3 q = camera_from_world * c.p_world;
    if (q.z() < kDepthMin_m) return;
    Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
    RowEquations::visit_rows(q, c.row, r, [&](const RowEquations::Vector9& by, double, double, int axis) {
        if (axis == 2) return;
        double& moved = axis == 0 ? r.x : r.y;
        for (int i = 0; i < 3; ++i) moved += by(6 + i) * off(i);
    });
    const double chi2 = r.chi2();
    const double weight = c.weight * (chi2 <= chi2_max ? 1.0 : std::sqrt(chi2_max / chi2));
    sums.squares += weight * (r.x * r.x * r.info_x + r.y * r.y * r.info_y);
    sums.rows += 2.0 * c.weight;
    RowEquations::visit_rows(q, c.row, r, [&](const RowEquations::Vector9& by, double residual, double info, int) {
        sums.equations.add(by, residual, weight * info);
    });
}

}  // namespace

Result<RowTurn> measure_row_turn(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                                 const SE3& world_from_camera_guess, const RowTurnPrior& prior,
                                 double chi2_max) noexcept {
    const std::size_t step = (chosen.size() + kRowMatchesMax - 1) / kRowMatchesMax;
    SE3 pose = world_from_camera_guess;
    Vector3 off = Vector3::Zero();
    RowSums sums;
    for (int pass = 0; pass < kRowPasses; ++pass) {
        sums = RowSums{};
        const SE3 camera_from_world = pose.inverse();
        for (std::size_t i = 0; i < chosen.size(); i += step)
            add_match(correspondences[chosen[i]], camera_from_world, off, chi2_max, sums);
        RowEquations equations = sums.equations;
        equations.expect_turn(prior.carried + off - prior.expected, prior.variance);
        if (!equations.step(pose, off)) return Status::kInvalid;
    }
    RowTurn out;
    out.turn = prior.carried + off;
    sums.equations.h /= sums.variance_factor();
    sums.equations.expect_turn(Vector3::Zero(), prior.variance);
    RowEquations::Matrix9 l;
    if (!sums.equations.factorise(l)) return Status::kInvalid;
    for (int k = 0; k < 3; ++k) {  // of the inverse, what belongs to the turn
        RowEquations::Vector9 column = RowEquations::Vector9::Zero();
        column(6 + k) = 1.0;
        out.covariance.col(k) = RowEquations::solve(l, column).tail<3>();
    }
    return out;
}

void Trembling::note(const Vector3& off, double measured_variance, const Vector3& speed) noexcept {
    Vector3 aside = off;  // of the motion: along it the readout may be what is off
    const double square = speed.squaredNorm();
    if (square > 0) aside -= speed * (speed.dot(off) / square);
    ++frames_;
    const double weight = std::max(1.0 / frames_, 1.0 - fading_);
    variance_ += weight * (aside.squaredNorm() / 2.0 - measured_variance - variance_);
    staying_ += weight * (aside.dot(off_before_) / 2.0 - staying_);
    off_before_ = aside;
}

bool Trembling::is_found() const noexcept {
    return frames_ >= kFramesMin && variance_ > kNegligible_rad * kNegligible_rad &&
           staying_ < kStayingShare * variance_;
}

}  // namespace stillmesh
