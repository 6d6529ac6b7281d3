// Rotations and rigid motions. Names say the frames: `a_from_b` maps coordinates in b to coordinates in a.
// Increments: xi = [translation m, rotation rad], applied on the right, in the frame of the camera:
// T * exp(xi) (method.md 6). Jacobians and 6x6 covariances everywhere use this order and this side.
#pragma once

#include "engine/geometry/eigen.hpp"
#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

struct SE3 {
    Matrix3 rotation = Matrix3::Identity();
    Vector3 translation = Vector3::Zero();  // m

    [[nodiscard]] SE3 operator*(const SE3& other) const noexcept {
        SE3 out;
        out.rotation.noalias() = rotation * other.rotation;
        out.translation.noalias() = rotation * other.translation;
        out.translation += translation;
        return out;
    }
    [[nodiscard]] Vector3 operator*(const Vector3& point) const noexcept {
        Vector3 out;
        out.noalias() = rotation * point;
        out += translation;
        return out;
    }
    [[nodiscard]] SE3 inverse() const noexcept {
        SE3 out;
        out.rotation = rotation.transpose();
        out.translation.noalias() = -(out.rotation * translation);
        return out;
    }
};

[[nodiscard]] Matrix3 skew(const Vector3& v) noexcept;
[[nodiscard]] Matrix3 so3_exp(const Vector3& rotation_vector_rad) noexcept;
[[nodiscard]] Vector3 so3_log(const Matrix3& rotation) noexcept;  // length in [0, pi]
// How the logarithm moves: so3_log(R exp(w)) = so3_log(R) + this(so3_log(R)) w, to first order of w.
[[nodiscard]] Matrix3 so3_log_derivative(const Vector3& log_rad) noexcept;
[[nodiscard]] SE3 se3_exp(const Vector6& xi) noexcept;
// exp(xi) p to second order of the rotation: for motions within a frame, where the angle stays below 0.1 rad.
[[nodiscard]] Vector3 moved_a_little(const Vector6& xi, const Vector3& p) noexcept;
[[nodiscard]] Vector6 se3_log(const SE3& motion) noexcept;
// Adjoint for xi = [translation, rotation]: exp(Ad(T) xi) = T exp(xi) T^-1.
[[nodiscard]] Matrix6 se3_adjoint(const SE3& motion) noexcept;
// Within 1e-6 of a rotation: what is stored in single precision passes; a mirror and what is not finite do not.
[[nodiscard]] bool is_rotation(const Matrix3& r) noexcept;
// The nearest rotation after many multiplications: one Newton step of the polar decomposition, repeated to the last
// bit.
void renormalise(Matrix3& rotation) noexcept;
// Unit quaternion [x, y, z, w] with w >= 0.
[[nodiscard]] Vector4 quaternion_from_rotation(const Matrix3& rotation) noexcept;
// Rotation angle in [0, pi], rad.
[[nodiscard]] double rotation_angle(const Matrix3& rotation) noexcept;

// For programs.
[[nodiscard]] inline RigidTransform transform_of(const SE3& pose) noexcept {
    RigidTransform out;
    const Vector4 q = quaternion_from_rotation(pose.rotation);
    for (int i = 0; i < 4; ++i) out.rotation_xyzw[i] = q(i);
    for (int i = 0; i < 3; ++i) out.translation_m[i] = pose.translation(i);
    return out;
}
// From programs: a unit quaternion to three decimals, since files have five, and nothing of 1000 m or more.
inline constexpr double kPoseMost = 1e3;
[[nodiscard]] bool is_pose(const RigidTransform& transform) noexcept;
[[nodiscard]] SE3 pose_of(const RigidTransform& transform) noexcept;

}  // namespace stillmesh
