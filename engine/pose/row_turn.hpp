// How far the camera turned while the rows of one frame were read. A hand or a robot that trembles at 8 to 12 Hz turns
// within the frame otherwise than from frame to frame, by up to 30 degrees per second; rows then lie pixels beside
// their place. So the turn from the first row to the last is an unknown of the frame beside its pose, three numbers
// with a prior: the turn that the motion from frame to frame makes expect. It is used while the camera trembles only:
// a map whose points were carried otherwise shows a turn, too, and a frame that follows it makes more such points
// (docs/tracking.md). Cost: some passes over at most 256 matches.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/status.hpp"
#include "engine/geometry/cholesky.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {

// Normal equations of pose (right increment) and turn, which moves what a row saw as a rotation of the pose does, times
// the row; of the matrix the lower triangle.
struct RowEquations {
    static constexpr int kUnknowns = 9;
    using Matrix9 = Eigen::Matrix<double, kUnknowns, kUnknowns>;
    using Vector9 = Eigen::Matrix<double, kUnknowns, 1>;

    Matrix9 h = Matrix9::Zero();
    Vector9 g = Vector9::Zero();

    // visit(jacobian, residual, information, axis) for the rows of a match at q in the camera: image x and y, and
    // depth, which the turn does not move: a depth image is not read out with the colour rows.
    template <typename Visit>
    static void visit_rows(const Vector3& q, double row, const Residual& r, Visit&& visit) noexcept {
        const double iz = 1.0 / q.z();
        const double x = q.x() * iz;
        const double y = q.y() * iz;
        const double of_x[3] = {x * y, -(1.0 + x * x), y};
        const double of_y[3] = {1.0 + y * y, -(x * y), -x};
        visit(Vector9{-iz, 0, x * iz, of_x[0], of_x[1], of_x[2], row * of_x[0], row * of_x[1], row * of_x[2]}, r.x,
              r.info_x, 0);
        visit(Vector9{0, -iz, y * iz, of_y[0], of_y[1], of_y[2], row * of_y[0], row * of_y[1], row * of_y[2]}, r.y,
              r.info_y, 1);
        if (r.info_z > 0) visit(Vector9{0, 0, -1.0, -q.y(), q.x(), 0, 0, 0, 0}, r.z, r.info_z, 2);
    }
    void add(const Vector9& by, double residual, double info) noexcept {
        for (int i = 0; i < kUnknowns; ++i) {
            const double weighted = by(i) * info;
            for (int j = 0; j <= i; ++j) h(i, j) += weighted * by(j);
            g(i) += weighted * residual;
        }
    }
    // The turn is off what is expected by `off`, and varies about it.
    void expect_turn(const Vector3& off, double variance) noexcept {
        for (int i = 0; i < 3; ++i) {
            h(6 + i, 6 + i) += 1.0 / variance;
            g(6 + i) += off(i) / variance;
        }
    }
    // Into `l`, for solve(); false: singular.
    [[nodiscard]] bool factorise(Matrix9& l) const noexcept {
        l = h;
        return cholesky(l, [](double pivot, double diagonal) { return pivot > 1e-12 && pivot > 1e-11 * diagonal; });
    }
    [[nodiscard]] static Vector9 solve(const Matrix9& l, Vector9 of) noexcept {
        solve_lower(l, of);
        solve_lower_transposed(l, of);
        return of;
    }
    // Pose and turn a step nearer to what fits. False: singular, not near, or no number.
    [[nodiscard]] bool step(SE3& world_from_camera, Vector3& turn) const noexcept {
        Matrix9 l;
        if (!factorise(l)) return false;
        const Vector9 change = solve(l, -g);
        if (!(change.squaredNorm() < 1.0)) return false;
        world_from_camera = world_from_camera * se3_exp(change.head<6>());
        renormalise(world_from_camera.rotation);
        turn += change.tail<3>();
        return true;
    }
};

// In the camera, rad, from the first row to the last.
struct RowTurn {
    Vector3 turn = Vector3::Zero();
    Matrix3 covariance = Matrix3::Zero();
};

// What is known of it beforehand: with which turn the correspondences' rows were carried, which one is expected, and
// its variance about that, rad^2.
struct RowTurnPrior {
    Vector3 carried = Vector3::Zero();
    Vector3 expected = Vector3::Zero();
    double variance = 0;
};

// The most likely turn, for a pose near `world_from_camera_guess`. kInvalid: a singular system.
[[nodiscard]] Result<RowTurn> measure_row_turn(std::span<const Correspondence> correspondences,
                                               std::span<const std::uint16_t> chosen,
                                               const SE3& world_from_camera_guess, const RowTurnPrior& prior,
                                               double chi2_max) noexcept;

// Whether the camera turns within frames otherwise than from frame to frame, by what frames were off. A hand's share of
// that changes from one frame to the next; what stays is the map's.
class Trembling {
public:
    // `fading`: what is left of the frames before.
    explicit Trembling(double fading = 1.0) noexcept : fading_(fading) {}
    // A frame that turned by so much more than expected, rad, measured with this variance, while the camera turned with
    // this speed, rad/s.
    void note(const Vector3& off, double measured_variance, const Vector3& speed) noexcept;
    [[nodiscard]] bool is_found() const noexcept;
    // Of what frames are off, without that of measuring, rad^2.
    [[nodiscard]] double variance() const noexcept { return variance_; }

private:
    double fading_ = 1.0;
    double frames_ = 0;
    Vector3 off_before_ = Vector3::Zero();
    double variance_ = 0;
    double staying_ = 0;  // the part of it that a frame has in common with the one before
};

}  // namespace stillmesh
