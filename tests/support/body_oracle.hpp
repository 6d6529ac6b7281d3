// What a body's frames and covariances must be, computed another way than in platform/poses: by 4x4 matrices, and
// covariances by moving the pose a little along each of its six ways and looking where the robot goes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/random.hpp"
#include "engine/geometry/se3.hpp"
#include "platform/poses/velocity.hpp"

namespace stillmesh::test {

class BodyOracle {
public:
    explicit BodyOracle(std::uint64_t seed) : random_(seed) { set_mount({}); }

    // The camera on the robot: base_link from camera_link.
    void set_mount(const RigidTransform& mount) {
        Eigen::Matrix4d link_from_optical = Eigen::Matrix4d::Zero();
        link_from_optical(0, 2) = 1;   // forward is the camera's z
        link_from_optical(1, 0) = -1;  // left is against its x
        link_from_optical(2, 1) = -1;  // up is against its y
        link_from_optical(3, 3) = 1;
        mount_ = matrix(mount) * link_from_optical;
        back_ = mount_.inverse();
    }
    [[nodiscard]] RigidTransform of_base(const RigidTransform& of_camera) const {
        return rigid(mount_ * matrix(of_camera) * back_);
    }
    // Of the engine's map, in ROS's.
    [[nodiscard]] std::array<float, 3> point(const double (&in_map)[3]) const {
        const Eigen::Vector4d p = mount_ * Eigen::Vector4d(in_map[0], in_map[1], in_map[2], 1);
        return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    }
    // As nav_msgs has it: of x, y, z and rotations about the parent's axes.
    [[nodiscard]] Matrix6 in_parent(const double (&of_camera)[36], const RigidTransform& parent_from_camera) const {
        return carried(of_camera, parent_from_camera, [](const Eigen::Matrix4d& before, const Eigen::Matrix4d& after) {
            Vector6 way;
            way.head<3>() = after.block<3, 1>(0, 3) - before.block<3, 1>(0, 3);
            way.tail<3>() = turn(after.block<3, 3>(0, 0) * before.block<3, 3>(0, 0).transpose());
            return way;
        });
    }
    // Of a motion in the child's own axes.
    [[nodiscard]] Matrix6 in_child(const double (&of_camera)[36], const RigidTransform& parent_from_camera) const {
        return carried(of_camera, parent_from_camera, [](const Eigen::Matrix4d& before, const Eigen::Matrix4d& after) {
            const Eigen::Matrix4d step = before.inverse() * after;
            Vector6 way;
            way.head<3>() = step.block<3, 1>(0, 3);
            way.tail<3>() = turn(step.block<3, 3>(0, 0));
            return way;
        });
    }
    // Of the velocity of base_link, by where it went.
    [[nodiscard]] double velocity_error(const Velocity& velocity, const RigidTransform& from, const RigidTransform& to,
                                        double seconds) const {
        const Eigen::Matrix4d step = (mount_ * matrix(from) * back_).inverse() * (mount_ * matrix(to) * back_);
        const Eigen::Vector3d linear = step.block<3, 1>(0, 3) / seconds;
        const Eigen::Vector3d angular = turn(step.block<3, 3>(0, 0)) / seconds;
        double error = 0;
        for (int i = 0; i < 3; ++i) {
            error = std::max(error, std::abs(velocity.linear_m_s[i] - linear[i]));
            error = std::max(error, std::abs(velocity.angular_rad_s[i] - angular[i]));
        }
        return error;
    }

    [[nodiscard]] RigidTransform random_pose() { return random_motion(2, 3); }
    [[nodiscard]] RigidTransform small_motion(double size) { return random_motion(size, size); }
    // Symmetric and positive: the product of a random matrix with its transpose.
    void random_covariance(double (&out)[36]) {
        Matrix6 half;
        for (int i = 0; i < 36; ++i) half(i / 6, i % 6) = 0.1 * uniform();
        const Matrix6 whole = half * half.transpose();
        for (int i = 0; i < 36; ++i) out[i] = whole(i / 6, i % 6);
    }

    [[nodiscard]] static double distance(const RigidTransform& a, const RigidTransform& b) {
        return (matrix(a) - matrix(b)).cwiseAbs().maxCoeff();
    }
    template <typename Numbers>
    [[nodiscard]] static double difference(const Numbers& numbers, const Matrix6& expected) {
        double largest = 0;
        for (int i = 0; i < 36; ++i) {
            largest = std::max(largest, std::abs(numbers[static_cast<std::size_t>(i)] - expected(i / 6, i % 6)));
        }
        return largest;
    }

private:
    [[nodiscard]] double uniform() { return 2 * random_.uniform() - 1; }
    [[nodiscard]] RigidTransform random_motion(double way_m, double turn_rad) {
        Eigen::Vector3d axis, way;
        for (int i = 0; i < 3; ++i) axis[i] = uniform();
        for (int i = 0; i < 3; ++i) way[i] = way_m * uniform();
        const Eigen::Quaterniond q(Eigen::AngleAxisd(turn_rad * uniform(), axis.normalized()));
        return {{q.x(), q.y(), q.z(), q.w()}, {way[0], way[1], way[2]}};
    }
    [[nodiscard]] static Eigen::Matrix4d matrix(const RigidTransform& pose) {
        const auto& [x, y, z, w] = pose.rotation_xyzw;
        Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
        out.block<3, 3>(0, 0) = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
        for (int i = 0; i < 3; ++i) out(i, 3) = pose.translation_m[i];
        return out;
    }
    [[nodiscard]] static RigidTransform rigid(const Eigen::Matrix4d& m) {
        const Eigen::Quaterniond q(Eigen::Matrix3d(m.block<3, 3>(0, 0)));
        return {{q.x(), q.y(), q.z(), q.w()}, {m(0, 3), m(1, 3), m(2, 3)}};
    }
    [[nodiscard]] static Eigen::Vector3d turn(const Eigen::Matrix3d& rotation) {
        const Eigen::AngleAxisd angle(rotation);
        return angle.angle() * angle.axis();
    }
    template <typename Way>
    [[nodiscard]] Matrix6 carried(const double (&of_camera)[36], const RigidTransform& pose, Way way) const {
        constexpr double kStep = 1e-5;
        Matrix6 jacobian;
        const Eigen::Matrix4d before = mount_ * matrix(pose) * back_;
        for (int i = 0; i < 6; ++i) {
            Eigen::Matrix4d moved = Eigen::Matrix4d::Identity();
            if (i < 3) {
                moved(i, 3) = kStep;
            } else {
                moved.block<3, 3>(0, 0) = Eigen::AngleAxisd(kStep, Eigen::Vector3d::Unit(i - 3)).toRotationMatrix();
            }
            jacobian.col(i) = way(before, mount_ * matrix(pose) * moved * back_) / kStep;
        }
        Matrix6 covariance;
        for (int i = 0; i < 36; ++i) covariance(i / 6, i % 6) = of_camera[i];
        return jacobian * covariance * jacobian.transpose();
    }

    Random random_;
    Eigen::Matrix4d mount_, back_;
};

}  // namespace stillmesh::test
