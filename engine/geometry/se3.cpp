#include "engine/geometry/se3.hpp"

#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/geometry/trig.hpp"

namespace stillmesh {
namespace {

// Below this squared angle the closed forms of so3 and se3 lose digits to cancellation, and short series take over.
constexpr double kSmallAngle2 = 0.25;  // rad^2

// The coefficients of exp: sin(t)/t, (1 - cos t)/t^2, (t - sin t)/t^3 as functions of t^2.
struct ExpTerms {
    double a;
    double b;
    double c;
};

// sum over n of (-1)^n t^2n / (2n + first)!, times first! : seven terms leave 2e-19 at t^2 = 0.25.
double alternating_series(double t2, int first) noexcept {
    double sum = 1.0;
    for (int n = 7; n >= 1; --n) {
        const int k = 2 * n + first;
        sum = 1.0 - t2 / static_cast<double>(k * (k - 1)) * sum;
    }
    return sum;
}

ExpTerms exp_terms(double t2) noexcept {
    if (t2 < kSmallAngle2) {
        return {alternating_series(t2, 1), alternating_series(t2, 2) / 2.0, alternating_series(t2, 3) / 6.0};
    }
    const double t = std::sqrt(t2);
    const SinCos half = sin_cos(0.5 * t);
    const double a = 2.0 * half.sin * half.cos / t;
    return {a, 2.0 * half.sin * half.sin / t2, (1.0 - a) / t2};
}

// (1 - (t/2) cot(t/2)) / t^2: the second-order coefficient of the inverse of se3's left Jacobian.
double inverse_jacobian_term(double t2) noexcept {
    if (t2 < kSmallAngle2) {  // |B_2n| / (2n)!; the ninth term is below 1e-17 of the first
        return polynomial(t2, 3617.0 / 10670622842880000.0, 1.0 / 74724249600.0, 691.0 / 1307674368000.0,
                          1.0 / 47900160.0, 1.0 / 1209600.0, 1.0 / 30240.0, 1.0 / 720.0, 1.0 / 12.0);
    }
    const double half_t = 0.5 * std::sqrt(t2);
    const SinCos half = sin_cos(half_t);
    return (1.0 - half_t * half.cos / half.sin) / t2;
}

// I + b K + c K^2 with K = skew(w).
Matrix3 rodrigues(const Vector3& w, double b, double c) noexcept {
    const Matrix3 k = skew(w);
    Matrix3 k2;
    k2.noalias() = k * k;
    return Matrix3::Identity() + b * k + c * k2;
}

}  // namespace

Matrix3 skew(const Vector3& v) noexcept {
    Matrix3 m;
    m << 0.0, -v.z(), v.y(),  //
        v.z(), 0.0, -v.x(),   //
        -v.y(), v.x(), 0.0;
    return m;
}

Matrix3 so3_exp(const Vector3& rotation_vector_rad) noexcept {
    const ExpTerms terms = exp_terms(rotation_vector_rad.squaredNorm());
    return rodrigues(rotation_vector_rad, terms.a, terms.b);
}

Vector3 so3_log(const Matrix3& rotation) noexcept {
    // By the quaternion: well conditioned at every angle, pi included, where the trace says nothing about the axis.
    const Vector4 q = quaternion_from_rotation(rotation);
    const Vector3 axis(q.x(), q.y(), q.z());
    const double sin_half = std::sqrt(axis.squaredNorm());
    if (sin_half < 1e-150) return 2.0 * axis;  // squares would underflow; the angle is twice its sine to the last bit
    return (2.0 * arc_tan2(sin_half, q.w()) / sin_half) * axis;
}

Matrix3 so3_log_derivative(const Vector3& log_rad) noexcept {
    return rodrigues(log_rad, 0.5, inverse_jacobian_term(log_rad.squaredNorm()));
}

SE3 se3_exp(const Vector6& xi) noexcept {
    const Vector3 rho = xi.head<3>();
    const Vector3 w = xi.tail<3>();
    const ExpTerms terms = exp_terms(w.squaredNorm());
    SE3 motion;
    motion.rotation = rodrigues(w, terms.a, terms.b);
    motion.translation.noalias() = rodrigues(w, terms.b, terms.c) * rho;
    return motion;
}

Vector3 moved_a_little(const Vector6& xi, const Vector3& p) noexcept {
    const Vector3 w(xi(3), xi(4), xi(5));
    const Vector3 turned = w.cross(p);
    Vector3 out = p + turned;
    out += 0.5 * w.cross(turned);
    out += Vector3(xi(0), xi(1), xi(2));
    return out;
}

Vector6 se3_log(const SE3& motion) noexcept {
    const Vector3 w = so3_log(motion.rotation);
    Vector6 xi;
    xi.head<3>().noalias() = rodrigues(w, -0.5, inverse_jacobian_term(w.squaredNorm())) * motion.translation;
    xi.tail<3>() = w;
    return xi;
}

Matrix6 se3_adjoint(const SE3& motion) noexcept {
    Matrix6 adjoint;
    adjoint.topLeftCorner<3, 3>() = motion.rotation;
    adjoint.topRightCorner<3, 3>().noalias() = skew(motion.translation) * motion.rotation;
    adjoint.bottomLeftCorner<3, 3>().setZero();
    adjoint.bottomRightCorner<3, 3>() = motion.rotation;
    return adjoint;
}

bool is_rotation(const Matrix3& r) noexcept {
    constexpr double kTolerance = 1e-6;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) {
            const double dot = r(i, 0) * r(j, 0) + r(i, 1) * r(j, 1) + r(i, 2) * r(j, 2);
            const double off = dot - (i == j ? 1.0 : 0.0);
            if (!(off <= kTolerance && off >= -kTolerance)) return false;  // NaN too
        }
    }
    const Vector3 r0 = r.row(0);
    const Vector3 r1 = r.row(1);
    return r0.cross(r1).dot(Vector3(r.row(2))) > 0.0;
}

void renormalise(Matrix3& rotation) noexcept {
    // X <- (X + X^-T) / 2 converges quadratically from every matrix of positive determinant. X^-T is the matrix of
    // cofactors over the determinant; its rows are cross products.
    constexpr int kStepsMax = 20;
    for (int step = 0; step < kStepsMax; ++step) {
        const Vector3 r0 = rotation.row(0);
        const Vector3 r1 = rotation.row(1);
        const Vector3 r2 = rotation.row(2);
        Matrix3 cofactors;
        cofactors.row(0) = r1.cross(r2);
        cofactors.row(1) = r2.cross(r0);
        cofactors.row(2) = r0.cross(r1);
        const double determinant = r0.dot(Vector3(cofactors.row(0)));
        STILLMESH_CHECK(determinant > 0.0);
        const Matrix3 next = 0.5 * (rotation + cofactors / determinant);
        const double change2 = (next - rotation).squaredNorm();
        rotation = next;
        if (change2 < 1e-20) return;  // the error left is the square of the change: below the last bit
    }
}

Vector4 quaternion_from_rotation(const Matrix3& r) noexcept {
    // Shepperd 1978: divide by the largest of the four components, which is at least 1/2. Ties: the first wins.
    const double trace = r(0, 0) + r(1, 1) + r(2, 2);
    Vector4 q;
    if (trace >= r(0, 0) && trace >= r(1, 1) && trace >= r(2, 2)) {
        q << r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1), 1.0 + trace;
    } else if (r(0, 0) >= r(1, 1) && r(0, 0) >= r(2, 2)) {
        q << 1.0 + r(0, 0) - r(1, 1) - r(2, 2), r(0, 1) + r(1, 0), r(0, 2) + r(2, 0), r(2, 1) - r(1, 2);
    } else if (r(1, 1) >= r(2, 2)) {
        q << r(0, 1) + r(1, 0), 1.0 - r(0, 0) + r(1, 1) - r(2, 2), r(1, 2) + r(2, 1), r(0, 2) - r(2, 0);
    } else {
        q << r(0, 2) + r(2, 0), r(1, 2) + r(2, 1), 1.0 - r(0, 0) - r(1, 1) + r(2, 2), r(1, 0) - r(0, 1);
    }
    const double norm = std::sqrt(q.squaredNorm());
    STILLMESH_CHECK(norm > 0.0);
    return q.w() < 0.0 ? Vector4(q / -norm) : Vector4(q / norm);
}

bool is_pose(const RigidTransform& transform) noexcept {
    constexpr double kNotUnit = 1e-3;
    const double* const q = transform.rotation_xyzw;
    const double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!is_finite(norm2) || std::abs(norm2 - 1.0) > kNotUnit) return false;
    for (const double t : transform.translation_m) {
        if (!(std::abs(t) < kPoseMost)) return false;
    }
    return true;
}

SE3 pose_of(const RigidTransform& transform) noexcept {
    const double* const q = transform.rotation_xyzw;
    const double s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    SE3 out;
    out.rotation << 1 - s * (q[1] * q[1] + q[2] * q[2]), s * (q[0] * q[1] - q[2] * q[3]),
        s * (q[0] * q[2] + q[1] * q[3]), s * (q[0] * q[1] + q[2] * q[3]), 1 - s * (q[0] * q[0] + q[2] * q[2]),
        s * (q[1] * q[2] - q[0] * q[3]), s * (q[0] * q[2] - q[1] * q[3]), s * (q[1] * q[2] + q[0] * q[3]),
        1 - s * (q[0] * q[0] + q[1] * q[1]);
    out.translation = Vector3(transform.translation_m[0], transform.translation_m[1], transform.translation_m[2]);
    return out;
}

double rotation_angle(const Matrix3& rotation) noexcept {
    // 2 sin and 2 cos of the angle: exact enough at both ends, where acos of the trace is not.
    const Vector3 twice_sin(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0),
                            rotation(1, 0) - rotation(0, 1));
    return arc_tan2(std::sqrt(twice_sin.squaredNorm()), rotation(0, 0) + rotation(1, 1) + rotation(2, 2) - 1.0);
}

}  // namespace stillmesh
