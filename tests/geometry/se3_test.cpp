#include "engine/geometry/se3.hpp"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "engine/base/random.hpp"

namespace stillmesh::se3_test {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kHalfPi = 0.5 * kPi;

Vector3 random_direction(Random& random) {
    Vector3 v(random.normal(), random.normal(), random.normal());
    while (v.norm() < 1e-3) v = Vector3(random.normal(), random.normal(), random.normal());
    return v / v.norm();
}

// Rotation vectors of every size that matters: ordinary, tiny, around the switch of the series, up to pi.
Vector3 random_rotation_vector(Random& random, double angle_max) {
    double angle = 0;
    switch (random.below(5)) {
        case 0: angle = random.uniform(0.0, angle_max); break;
        case 1: angle = std::ldexp(random.uniform(), -static_cast<int>(random.below(80))); break;
        case 2: angle = random.uniform(0.49, 0.51); break;
        case 3: angle = angle_max - std::ldexp(random.uniform(), -static_cast<int>(random.below(40))); break;
        default: angle = random.uniform(0.0, 0.2);
    }
    return random_direction(random) * std::fabs(angle);
}

Vector6 random_xi(Random& random, double angle_max, double length) {
    Vector6 xi;
    xi.head<3>() = random_direction(random) * random.uniform(0.0, length);
    xi.tail<3>() = random_rotation_vector(random, angle_max);
    return xi;
}

using Wide4 = std::array<std::array<long double, 4>, 4>;

// exp of the 4x4 twist matrix by its power series in long double: the definition.
Wide4 exp_by_series(const Vector6& xi) {
    const Matrix3 k = skew(xi.tail<3>());
    Wide4 twist{};
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) twist[r][c] = k(static_cast<int>(r), static_cast<int>(c));
        twist[r][3] = xi[static_cast<int>(r)];
    }
    Wide4 sum{};
    Wide4 term{};
    for (std::size_t i = 0; i < 4; ++i) sum[i][i] = term[i][i] = 1;
    for (int n = 1; n < 60; ++n) {
        Wide4 next{};
        for (std::size_t r = 0; r < 4; ++r) {
            for (std::size_t c = 0; c < 4; ++c) {
                for (std::size_t i = 0; i < 4; ++i) next[r][c] += term[r][i] * twist[i][c];
                next[r][c] /= n;
                sum[r][c] += next[r][c];
            }
        }
        term = next;
    }
    return sum;
}

double distance(const SE3& a, const SE3& b) {
    return (a.rotation - b.rotation).norm() + (a.translation - b.translation).norm();
}

// Promise: exp is the matrix exponential of the twist, to 1e-15 of its size, at small angles as at large ones.
TEST(Se3, ExpIsTheMatrixExponential) {
    Random random(1);
    double worst = 0;
    for (int i = 0; i < 5000; ++i) {
        const Vector6 xi = random_xi(random, kPi, 3.0);
        const SE3 motion = se3_exp(xi);
        const Wide4 want = exp_by_series(xi);
        const Matrix3 rotation = so3_exp(xi.tail<3>());
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
                const auto value = static_cast<double>(want[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)]);
                worst = std::max(worst, std::fabs(motion.rotation(r, c) - value));
                ASSERT_EQ(rotation(r, c), motion.rotation(r, c));
            }
            const auto value = static_cast<double>(want[static_cast<std::size_t>(r)][3]);
            worst = std::max(worst, std::fabs(motion.translation(r) - value) / 3.0);
        }
        ASSERT_LT(worst, 2e-15) << xi[3] << " " << xi[4] << " " << xi[5];
    }
    std::printf("se3_exp: worst %.1e\n", worst);
}

// Promise: log undoes exp for every angle below pi, tiny and nearly pi included.
TEST(Se3, LogUndoesExp) {
    Random random(2);
    double worst = 0;
    for (int i = 0; i < 100'000; ++i) {
        const Vector6 xi = random_xi(random, kPi - 1e-7, 3.0);
        const double error = (se3_log(se3_exp(xi)) - xi).norm();
        worst = std::max(worst, error);
        ASSERT_LT(error, 2e-14) << xi.tail<3>().norm();
    }
    std::printf("log(exp(xi)) - xi: worst %.1e\n", worst);
}

// Promise: small increments keep their relative precision: nothing is lost to 1 - cos.
TEST(Se3, TinyAnglesKeepTheirDigits) {
    Random random(3);
    for (int exponent = -1; exponent > -300; --exponent) {
        Vector6 xi;
        xi.head<3>() = random_direction(random);
        xi.tail<3>() = random_direction(random) * std::pow(10.0, exponent);
        const Vector6 back = se3_log(se3_exp(xi));
        ASSERT_LT((back.tail<3>() - xi.tail<3>()).norm(), 4e-16 * xi.tail<3>().norm() + 1e-300) << exponent;
        ASSERT_LT((back.head<3>() - xi.head<3>()).norm(), 4e-16) << exponent;
    }
    EXPECT_EQ(se3_log(SE3{}), Vector6::Zero());
}

// Promise: exp undoes log for every rotation, half turns included, where the axis is +-; the length stays in [0, pi].
TEST(Se3, ExpUndoesLogUpToPi) {
    Random random(4);
    for (int i = 0; i < 20'000; ++i) {
        const Vector3 axis = random_direction(random);
        const double angle = kPi + (i % 3 - 1) * std::ldexp(random.uniform(), -static_cast<int>(random.below(60)));
        const Matrix3 rotation = so3_exp(axis * angle);
        const Vector3 w = so3_log(rotation);
        ASSERT_LE(w.norm(), kPi + 1e-15);
        ASSERT_LT((so3_exp(w) - rotation).norm(), 3e-15) << angle;
        ASSERT_NEAR(rotation_angle(rotation), w.norm(), 1e-14);
    }
    for (int axis = 0; axis < 3; ++axis) {  // exact half turns
        Matrix3 rotation = -Matrix3::Identity();
        rotation(axis, axis) = 1.0;
        const Vector3 w = so3_log(rotation);
        EXPECT_NEAR(std::fabs(w[axis]), kPi, 1e-15);
        EXPECT_NEAR(w.norm(), kPi, 1e-15);
        EXPECT_NEAR(rotation_angle(rotation), kPi, 1e-15);
    }
}

// Promise: increments act on the right, in the camera frame, translation first: the Jacobian of T exp(xi) p at 0 is
// R [I, -skew(p)], found here by central differences.
TEST(Se3, IncrementsActOnTheRight) {
    Random random(5);
    for (int i = 0; i < 500; ++i) {
        const SE3 motion = se3_exp(random_xi(random, 3.0, 2.0));
        const Vector3 p = random_direction(random) * random.uniform(0.5, 4.0);
        for (int k = 0; k < 6; ++k) {
            const double h = 1e-5;
            Vector6 step = Vector6::Zero();
            step[k] = h;
            const Vector3 numeric = ((motion * se3_exp(step)) * p - (motion * se3_exp(-step)) * p) / (2 * h);
            const Vector3 analytic =
                k < 3 ? Vector3(motion.rotation.col(k)) : Vector3(-(motion.rotation * skew(p)).col(k - 3));
            ASSERT_LT((numeric - analytic).norm(), 1e-8);
        }
    }
}

// Promise: the group laws: T T^-1 = 1, (A B) p = A (B p), (A B) C = A (B C), Ad(A B) = Ad(A) Ad(B).
TEST(Se3, GroupLaws) {
    Random random(6);
    for (int i = 0; i < 2000; ++i) {
        const SE3 a = se3_exp(random_xi(random, kPi, 2.0));
        const SE3 b = se3_exp(random_xi(random, kPi, 2.0));
        const SE3 c = se3_exp(random_xi(random, kPi, 2.0));
        const Vector3 p = random_direction(random) * 3.0;
        ASSERT_LT(distance(a * a.inverse(), SE3{}), 4e-15);
        ASSERT_LT(distance(a.inverse() * a, SE3{}), 4e-15);
        ASSERT_LT(((a * b) * p - a * (b * p)).norm(), 1e-14);
        ASSERT_LT(distance((a * b) * c, a * (b * c)), 2e-14);
        ASSERT_LT((se3_adjoint(a * b) - se3_adjoint(a) * se3_adjoint(b)).norm(), 4e-14);
    }
}

// Promise: the adjoint moves an increment to the other side: exp(Ad(T) xi) = T exp(xi) T^-1, for large xi too.
TEST(Se3, AdjointMovesIncrementsAcross) {
    Random random(7);
    for (int i = 0; i < 2000; ++i) {
        const SE3 motion = se3_exp(random_xi(random, kPi, 2.0));
        const Vector6 xi = random_xi(random, kPi, 2.0);
        const SE3 left = se3_exp(Vector6(se3_adjoint(motion) * xi));
        const SE3 right = motion * se3_exp(xi) * motion.inverse();
        ASSERT_LT(distance(left, right), 4e-14);
    }
}

// Promise: nothing jumps where the closed forms hand over to the series.
TEST(Se3, LogIsSmoothAcrossTheSeriesSwitch) {
    Random random(8);
    for (int i = 0; i < 300; ++i) {
        const Vector3 axis = random_direction(random);
        Vector6 below;
        below.head<3>() = random_direction(random);
        Vector6 above = below;
        below.tail<3>() = axis * (0.5 - 1e-12);
        above.tail<3>() = axis * (0.5 + 1e-12);
        ASSERT_LT(distance(se3_exp(below), se3_exp(above)), 2e-11);
        ASSERT_LT((se3_log(se3_exp(below)) - below).norm(), 2e-15);
        ASSERT_LT((se3_log(se3_exp(above)) - above).norm(), 2e-15);
    }
}

// Promise: renormalise gives the nearest rotation (the polar factor, by SVD), orthogonal to the last bits, even far
// off.
TEST(Se3, RenormaliseGivesTheNearestRotation) {
    Random random(9);
    for (int i = 0; i < 2000; ++i) {
        const double size = i % 2 == 0 ? 1e-6 : 0.1;
        Matrix3 rotation = so3_exp(random_rotation_vector(random, kPi));
        for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) += size * random.uniform(-1.0, 1.0);
        const Eigen::JacobiSVD<Matrix3, Eigen::NoQRPreconditioner> svd(rotation,
                                                                       Eigen::ComputeFullU | Eigen::ComputeFullV);
        const Matrix3 nearest = svd.matrixU() * svd.matrixV().transpose();
        renormalise(rotation);
        ASSERT_LT((rotation - nearest).norm(), 2e-14);
        ASSERT_LT((rotation * rotation.transpose() - Matrix3::Identity()).norm(), 1e-15);
        ASSERT_NEAR(rotation.determinant(), 1.0, 1e-15);
    }
    // A hundred thousand multiplications drift; one call brings the product back.
    Matrix3 product = Matrix3::Identity();
    const Matrix3 turn = so3_exp(Vector3(0.01, -0.02, 0.03));
    for (int i = 0; i < 100'000; ++i) product = product * turn;
    renormalise(product);
    EXPECT_LT((product * product.transpose() - Matrix3::Identity()).norm(), 1e-15);
}

// Promise: quaternions agree with Eigen's, have w >= 0 and unit length, and come back as the same rotation.
TEST(Se3, Quaternions) {
    Random random(10);
    std::array<int, 4> largest{};
    for (int i = 0; i < 20'000; ++i) {
        const Matrix3 rotation = so3_exp(random_rotation_vector(random, kPi));
        const Vector4 q = quaternion_from_rotation(rotation);
        ASSERT_GE(q.w(), 0.0);
        ASSERT_NEAR(q.norm(), 1.0, 4e-16);
        const Eigen::Quaterniond eigen(rotation);
        const double sign = eigen.coeffs().dot(q) < 0 ? -1.0 : 1.0;
        ASSERT_LT((eigen.coeffs() * sign - q).norm(), 4e-15);
        ASSERT_LT((Eigen::Quaterniond(q).toRotationMatrix() - rotation).norm(), 3e-15);
        int index = 0;
        q.cwiseAbs().maxCoeff(&index);
        ++largest.at(static_cast<std::size_t>(index));
    }
    for (const int count : largest) EXPECT_GT(count, 100) << "a branch was hardly tested";
}

// Promise: the rotation angle has full relative precision where acos of the trace has none.
TEST(Se3, RotationAngle) {
    Random random(11);
    for (int exponent = 0; exponent > -100; --exponent) {
        const double angle = std::pow(10.0, exponent) * kHalfPi;
        const Matrix3 rotation = so3_exp(random_direction(random) * angle);
        ASSERT_NEAR(rotation_angle(rotation) / angle, 1.0, 4e-15) << exponent;
    }
    EXPECT_EQ(rotation_angle(Matrix3::Identity()), 0.0);
}

// Promise: a pose goes to a quaternion and back; a quaternion that is not of length one turns as the one that is.
TEST(Se3, QuaternionsAndBack) {
    Random random(21);
    for (int i = 0; i < 2000; ++i) {
        const SE3 pose = se3_exp(random_xi(random, kPi, 3.0));
        RigidTransform transform = transform_of(pose);
        ASSERT_TRUE(is_pose(transform));
        const double length = random.uniform(0.5, 2.0);
        for (double& q : transform.rotation_xyzw) q *= length;
        const SE3 back = pose_of(transform);
        ASSERT_LT((back.rotation - pose.rotation).norm(), 1e-12) << i;
        ASSERT_EQ(back.translation, pose.translation);
    }
}

}  // namespace
}  // namespace stillmesh::se3_test
