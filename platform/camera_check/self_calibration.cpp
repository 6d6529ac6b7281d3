#include "platform/camera_check/self_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "engine/base/check.hpp"
#include "platform/camera_check/depth_noise.hpp"
#include "platform/camera_check/small_system.hpp"
// After CHECK: Eigen's assertions are ours.
#include <Eigen/Geometry>

namespace stillmesh {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector4 = Eigen::Matrix<double, 4, 1>;
using Matrix4 = Eigen::Matrix<double, 4, 4>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix46 = Eigen::Matrix<double, 4, 6>;

constexpr int kIterationsMax = 30;
// Cauchy's: beyond three sigma a match pulls less the farther it is.
constexpr double kCauchy2 = 9.0;
// What is not seen stays as given: factors within e, centres within half a focal length.
constexpr double kFactorSigma = 1.0, kCentreSigma = 0.5;
// Pixels are as wide as high within this, unless seen otherwise: who turns left and right alone shows fx alone.
constexpr double kAspectSigma = 0.1;

struct Motion {
    Matrix3d rotation = Matrix3d::Identity();
    Vector3d translation = Vector3d::Zero();
};

// Normal equations of one pair: correction (c) and motion (m).
struct PairSystem {
    Matrix4 cc = Matrix4::Zero();
    Matrix46 cm = Matrix46::Zero();
    Matrix6 mm = Matrix6::Zero();
    Vector4 c = Vector4::Zero();
    Vector6 m = Vector6::Zero();
    double cost = 0;
};

// value: ln of factors, and the shift of the centre in focal lengths.
PairSystem linearise(std::span<const ViewMatch> matches, const CameraModel& camera, const Vector4& value,
                     const Motion& motion) {
    PairSystem s;
    const double grow[2] = {std::exp(value(0)), std::exp(value(1))};
    const double focal[2] = {camera.fx, camera.fy};
    for (const ViewMatch& match : matches) {
        const Vector3d ray((match.a.x - value(2)) / grow[0], (match.a.y - value(3)) / grow[1], 1.0);
        const double w = match.a.inverse_depth;
        const Vector3d turned = motion.rotation * ray;
        const Vector3d p = turned + motion.translation * w;
        if (!(p.z() > 0.1)) {
            s.cost += std::log(1.0 + 100.0);
            continue;
        }
        // Of p by correction and motion.
        Eigen::Matrix<double, 3, 10> d;
        d.col(0) = -ray.x() * motion.rotation.col(0);
        d.col(1) = -ray.y() * motion.rotation.col(1);
        d.col(2) = motion.rotation.col(0) * (-1.0 / grow[0]);
        d.col(3) = motion.rotation.col(1) * (-1.0 / grow[1]);
        for (int k = 0; k < 3; ++k) {
            d.col(4 + k) = Vector3d::Unit(k) * w;
            d.col(7 + k) = Vector3d::Unit(k).cross(turned);
        }
        Eigen::Matrix<double, 3, 10> j;
        Vector3d error;
        const double seen[2] = {match.b.x, match.b.y};
        const double pixel_sigma = std::max(match.a.noise_px, match.b.noise_px);
        for (int k = 0; k < 2; ++k) {
            const double at = p(k) / p.z();
            j.row(k) = (d.row(k) - at * d.row(2)) * (grow[k] / p.z());
            j(k, k) += at * grow[k];
            j(k, 2 + k) += 1.0;
            error(k) = at * grow[k] + value(2 + k) - seen[k];
            j.row(k) *= focal[k] / pixel_sigma;
            error(k) *= focal[k] / pixel_sigma;
        }
        const double depth_sigma = 1.4 * std::max(kDepthNoise, kDepthNoiseShare * w);
        j.row(2) = d.row(2) * (-w / (p.z() * p.z()) / depth_sigma);
        error(2) = (w / p.z() - match.b.inverse_depth) / depth_sigma;
        const double chi2 = error.squaredNorm();
        s.cost += kCauchy2 * std::log(1.0 + chi2 / kCauchy2);
        const double weight = 1.0 / (1.0 + chi2 / kCauchy2);
        const Eigen::Matrix<double, 10, 3> weighted = j.transpose() * weight;
        const Eigen::Matrix<double, 10, 10> h = weighted * j;
        const Eigen::Matrix<double, 10, 1> g = weighted * error;
        s.cc += h.topLeftCorner<4, 4>();
        s.cm += h.topRightCorner<4, 6>();
        s.mm += h.bottomRightCorner<6, 6>();
        s.c += g.head<4>();
        s.m += g.tail<6>();
    }
    return s;
}

Motion moved(const Motion& from, const Vector6& step) {
    Motion to = from;
    to.translation += step.head<3>();
    const Vector3d turn = step.tail<3>();
    const double angle = turn.norm();
    if (angle > 0) to.rotation = Eigen::AngleAxisd(angle, turn / angle) * from.rotation;
    return to;
}

class Fit {
public:
    Fit(std::span<const std::vector<ViewMatch>> pairs, const CameraModel& camera) : pairs_(pairs), camera_(camera) {
        const double factor = 1 / (kFactorSigma * kFactorSigma), centre = 1 / (kCentreSigma * kCentreSigma);
        prior_.diagonal() << factor, factor, centre, centre;
        const double aspect = 1 / (kAspectSigma * kAspectSigma);
        prior_(0, 0) += aspect;
        prior_(1, 1) += aspect;
        prior_(0, 1) = prior_(1, 0) = -aspect;
        pull_ << aspect, -aspect, 0, 0;
        pull_ *= std::log(camera.fx / camera.fy);
    }
    // Returns the cost; `is_correcting`: the calibration too, not the motions alone.
    double run(Vector4& value, bool is_correcting) {
        double cost = evaluate(value, motions_, systems_);
        double damping = 1e-3;
        for (int round = 0; round < kIterationsMax; ++round) {
            Matrix4 h = prior_;
            Vector4 g = prior_ * value + pull_;
            reduce(h, g, damping);
            Vector4 step = Vector4::Zero();
            if (is_correcting) {
                const Vector4 diagonal = h.diagonal() * damping;
                h.diagonal() += diagonal;
                step = -solved(h, g);
                for (int k = 0; k < 4; ++k) step(k) = std::clamp(step(k), -0.3, 0.3);
            }
            const Vector4 to = value + step;
            for (std::size_t i = 0; i < pairs_.size(); ++i) {
                const Matrix6 mm = damped(systems_[i].mm, damping);
                const Vector6 right = systems_[i].m + systems_[i].cm.transpose() * step;
                tried_[i] = moved(motions_[i], -solved(mm, right));
            }
            Systems systems;
            const double at = evaluate(to, tried_, systems);
            if (at < cost) {
                const bool is_done = cost - at < 1e-5 * cost;
                cost = at;
                value = to;
                motions_ = tried_;
                systems_ = systems;
                damping = std::max(damping * 0.2, 1e-7);
                if (is_done) break;
            } else {
                damping *= 8;
                if (damping > 1e4) break;
            }
        }
        return cost;
    }
    [[nodiscard]] Matrix4 information() {
        Matrix4 h = prior_;
        Vector4 g = Vector4::Zero();
        reduce(h, g, 0);
        return h;
    }

private:
    using Motions = std::array<Motion, SelfCalibration::kPairs>;
    using Systems = std::array<PairSystem, SelfCalibration::kPairs>;

    static Matrix6 damped(Matrix6 mm, double damping) {
        const Vector6 diagonal = mm.diagonal() * damping + Vector6::Constant(1e-9);
        mm.diagonal() += diagonal;
        return mm;
    }
    // The motions eliminated.
    void reduce(Matrix4& h, Vector4& g, double damping) const {
        for (const PairSystem& s : std::span(systems_).first(pairs_.size())) {
            Eigen::Matrix<double, 6, 5> right;
            right << s.cm.transpose(), s.m;
            const Eigen::Matrix<double, 4, 5> eliminated = s.cm * solved(damped(s.mm, damping), right);
            h += s.cc - eliminated.leftCols<4>();
            g += s.c - eliminated.col(4);
        }
    }
    double evaluate(const Vector4& value, const Motions& motions, Systems& systems) const {
        double cost = value.dot(prior_ * value) + 2 * value.dot(pull_);
        for (std::size_t i = 0; i < pairs_.size(); ++i) {
            systems[i] = linearise(pairs_[i], camera_, value, motions[i]);
            cost += systems[i].cost;
        }
        return cost;
    }

    std::span<const std::vector<ViewMatch>> pairs_;
    const CameraModel& camera_;
    Matrix4 prior_ = Matrix4::Zero();
    Vector4 pull_;
    Motions motions_;
    Systems systems_;
    Motions tried_;
};

}  // namespace

SelfCalibration::SelfCalibration(const CameraModel& camera) : camera_(camera) {
    for (auto& pair : pairs_) pair.reserve(kMatches);
}

void SelfCalibration::add(const std::vector<ViewMatch>& matches, const std::vector<bool>& is_inlier) {
    std::vector<ViewMatch>& pair = pairs_[static_cast<std::size_t>(added_++ % kPairs)];
    pair.clear();
    const auto inliers = static_cast<std::size_t>(std::count(is_inlier.begin(), is_inlier.end(), true));
    const std::size_t step = (inliers + kMatches - 1) / kMatches;
    std::size_t n = 0;
    for (std::size_t i = 0; i < matches.size(); ++i) {
        if (is_inlier[i] && n++ % step == 0) pair.push_back(matches[i]);
    }
}

CameraCorrection SelfCalibration::estimate() const {
    CameraCorrection out;
    out.pairs = static_cast<std::uint32_t>(std::min<std::uint64_t>(added_, kPairs));
    const std::span<const std::vector<ViewMatch>> pairs = std::span(pairs_).first(out.pairs);
    std::size_t count = 0;
    for (const auto& pair : pairs) count += pair.size();
    if (count < 60) return out;
    Fit fit(pairs, camera_);
    Vector4 value = Vector4::Zero();
    out.cost_before = fit.run(value, false) / static_cast<double>(count);
    out.cost = fit.run(value, true) / static_cast<double>(count);
    const Matrix4 covariance = solved(fit.information(), Matrix4::Identity());
    const double focal[4] = {1, 1, camera_.fx, camera_.fy};
    for (int k = 0; k < 4; ++k) {
        const auto i = static_cast<std::size_t>(k);
        out.value[i] = value(k) * focal[k];
        out.sigma[i] = std::sqrt(std::max(covariance(k, k), 0.0)) * focal[k];
    }
    out.is_known = true;
    return out;
}

}  // namespace stillmesh
