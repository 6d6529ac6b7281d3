#include "platform/camera_check/rigidity.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/check.hpp"
#include "engine/base/random.hpp"
#include "platform/camera_check/depth_noise.hpp"
#include "platform/camera_check/small_system.hpp"
// After CHECK: Eigen's assertions are ours.
#include <Eigen/LU>

namespace stillmesh {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using LinearMotion = Eigen::Matrix<double, 3, 4>;

constexpr int kHypotheses = 100;
constexpr double kAsksPicture = 0.7;  // more cannot be far from what the pictures say
constexpr double kPixelGate = 3.0;    // sigma
constexpr double kDepthGate = 4.0;

Vector4d from(const ViewMatch& m) {
    return {m.a.x, m.a.y, 1.0, m.a.inverse_depth};
}
Vector3d to(const ViewMatch& m) {
    return Vector3d(m.b.x, m.b.y, 1.0) *
           (static_cast<double>(m.a.inverse_depth) / static_cast<double>(m.b.inverse_depth));
}

class Gate {
public:
    Gate(const std::vector<ViewMatch>& matches, double focal_px) : focal_px_(focal_px) {
        double sum = 0;
        for (const ViewMatch& m : matches) sum += static_cast<double>(m.b.inverse_depth);
        depth_ = kDepthGate * std::max(kDepthNoise, kDepthNoiseShare * sum / static_cast<double>(matches.size()));
    }
    [[nodiscard]] bool takes(const ViewMatch& m, const LinearMotion& motion) const {
        const Vector3d p = motion * from(m);
        if (!(p.z() > 0.1)) return false;
        const double pixels =
            kPixelGate * std::max(static_cast<double>(m.b.noise_px), static_cast<double>(m.a.noise_px));
        const double ex = (p.x() / p.z() - static_cast<double>(m.b.x)) * focal_px_;
        const double ey = (p.y() / p.z() - static_cast<double>(m.b.y)) * focal_px_;
        const double ew = static_cast<double>(m.a.inverse_depth) / p.z() - static_cast<double>(m.b.inverse_depth);
        return ex * ex + ey * ey < pixels * pixels && std::abs(ew) < depth_;
    }

private:
    double focal_px_;
    double depth_;
};

template <typename Takes>
std::size_t mark(const std::vector<ViewMatch>& matches, Takes&& takes, std::vector<bool>& marks) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < matches.size(); ++i) {
        marks[i] = takes(matches[i]);
        count += marks[i] ? 1U : 0U;
    }
    return count;
}

double explained_with_depth(const std::vector<ViewMatch>& matches, double focal_px, std::vector<bool>& is_inlier) {
    const Gate gate(matches, focal_px);
    const auto count = static_cast<std::uint32_t>(matches.size());
    Random random(1);
    LinearMotion best = LinearMotion::Zero();
    std::size_t most = 0;
    for (int round = 0; round < kHypotheses; ++round) {
        Matrix4d a;
        Eigen::Matrix<double, 4, 3> b;
        for (int i = 0; i < 4; ++i) {
            const ViewMatch& m = matches[random.below(count)];
            a.row(i) = from(m);
            b.row(i) = to(m);
        }
        if (std::abs(a.determinant()) < 1e-9) continue;
        const LinearMotion motion = (a.inverse() * b).transpose();
        std::size_t taken = 0;
        for (const ViewMatch& m : matches) taken += gate.takes(m, motion) ? 1U : 0U;
        if (taken > most) {
            most = taken;
            best = motion;
        }
    }
    most = mark(
        matches, [&](const ViewMatch& m) { return gate.takes(m, best); }, is_inlier);
    std::vector<bool>& marks = is_inlier;
    for (int round = 0; round < 3 && most >= 8; ++round) {
        Matrix4d normal = Matrix4d::Zero();
        Eigen::Matrix<double, 4, 3> right = Eigen::Matrix<double, 4, 3>::Zero();
        for (std::size_t i = 0; i < matches.size(); ++i) {
            if (!marks[i]) continue;
            normal += from(matches[i]) * from(matches[i]).transpose();
            right += from(matches[i]) * to(matches[i]).transpose();
        }
        const LinearMotion motion = solved(normal, right).transpose();
        std::size_t taken = 0;
        for (const ViewMatch& m : matches) taken += gate.takes(m, motion) ? 1U : 0U;
        if (taken < most) break;
        most = mark(
            matches, [&](const ViewMatch& m) { return gate.takes(m, motion); }, marks);
    }
    return static_cast<double>(most) / count;
}

// The eight point algorithm, RANSAC around it.
double explained_by_picture(const std::vector<ViewMatch>& matches, double focal_px) {
    const auto count = static_cast<std::uint32_t>(matches.size());
    Random random(2);
    std::size_t most = 0;
    for (int round = 0; round < kHypotheses; ++round) {
        Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
        for (int i = 0; i < 8; ++i) {
            const ViewMatch& m = matches[random.below(count)];
            const Vector3d p(m.a.x, m.a.y, 1), q(m.b.x, m.b.y, 1);
            Eigen::Matrix<double, 9, 1> row;
            row << q.x() * p, q.y() * p, p;
            normal += row * row.transpose();
        }
        // The vector that the eight do not bind, by inverse iteration.
        normal.diagonal().array() += 1e-9;
        const SmallMatrix inverse = solved(normal, Eigen::Matrix<double, 9, 9>::Identity());
        Eigen::Matrix<double, 9, 1> f = Eigen::Matrix<double, 9, 1>::Ones();
        for (int i = 0; i < 3; ++i) f = (inverse * f).normalized();
        Matrix3d fundamental;
        for (int row = 0; row < 3; ++row) fundamental.row(row) = f.segment<3>(3 * row);
        std::size_t taken = 0;
        for (const ViewMatch& m : matches) {
            const Vector3d p(m.a.x, m.a.y, 1), q(m.b.x, m.b.y, 1);
            const Vector3d line = fundamental * p, back = fundamental.transpose() * q;
            const double error = q.dot(line);
            const double slope2 = line.head<2>().squaredNorm() + back.head<2>().squaredNorm();
            const double pixels = 1.5 * std::max(static_cast<double>(m.b.noise_px), static_cast<double>(m.a.noise_px));
            if (error * error * focal_px * focal_px < pixels * pixels * slope2) ++taken;
        }
        most = std::max(most, taken);
    }
    return static_cast<double>(most) / count;
}

}  // namespace

void measure_rigidity(const std::vector<ViewMatch>& matches, double focal_px, Rigidity& out) {
    out.is_inlier.assign(matches.size(), false);
    out.by_picture = 1;
    out.with_depth = explained_with_depth(matches, focal_px, out.is_inlier);
    if (out.with_depth < kAsksPicture) out.by_picture = explained_by_picture(matches, focal_px);
}

}  // namespace stillmesh
