#include "engine/geometry/camera.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/geometry/trig.hpp"

namespace stillmesh {
namespace {

// Newton doubles the correct digits: from the distorted position, lenses like those of the TUM cameras take 2 to 4
// steps.
constexpr int kNewtonStepsMax = 12;
// A step this small in normalised units (1e-5 px at a focal length of 500 px) leaves an error of its square.
constexpr double kStep2Enough = 4e-16;
constexpr double kResidualMaxPx = 0.01;
// How far out a lens sees: so many times as far as one without distortion, and so much more (normalised). Farther out
// the polynomial may bend a point back into the picture, which no lens does.
constexpr double kReachFactor = 1.2;
constexpr double kReach = 0.2;

struct Distorted {
    Vector2 position;   // normalised, distorted
    double xx, xy, yy;  // the Jacobian; it is symmetric: the distortion is the gradient of a potential
};

struct Radial {
    double factor;
    double slope;  // d factor / d r2, times 2
};

Radial brown(const CameraModel& m, double r2) noexcept {
    return {1.0 + r2 * (m.k1 + r2 * (m.k2 + r2 * m.k3)), 2.0 * (m.k1 + r2 * (2.0 * m.k2 + r2 * (3.0 * m.k3)))};
}

Radial rational(const CameraModel& m, double r2) noexcept {
    constexpr double kLeast = 1e-6;  // at its pole a lens ends
    const Radial above = brown(m, r2);
    const double below = std::max(1.0 + r2 * (m.k4 + r2 * (m.k5 + r2 * m.k6)), kLeast);
    const double below_slope = 2.0 * (m.k4 + r2 * (2.0 * m.k5 + r2 * (3.0 * m.k6)));
    const double factor = above.factor / below;
    return {factor, (above.slope - factor * below_slope) / below};
}

Radial fisheye(const CameraModel& m, double r2) noexcept {
    // Near the axis both would be differences of equal numbers: there theta is r - r^3 / 3.
    if (r2 < 1e-6) return {1.0 + r2 * (m.k1 - 1.0 / 3.0), 2.0 * (m.k1 - 1.0 / 3.0)};
    const double r = std::sqrt(r2);
    const double theta = arc_tan2(r, 1.0);
    const double t2 = theta * theta;
    const double factor = theta * polynomial(t2, m.k4, m.k3, m.k2, m.k1, 1.0) / r;
    const double by_theta = polynomial(t2, 9.0 * m.k4, 7.0 * m.k3, 5.0 * m.k2, 3.0 * m.k1, 1.0);
    return {factor, (by_theta / (1.0 + r2) - factor) / r2};
}

Distorted distort(const CameraModel& m, const Vector2& n) noexcept {
    const double x = n.x();
    const double y = n.y();
    const double r2 = x * x + y * y;
    const auto [radial, slope] = m.is_plain_brown()         ? brown(m, r2)
                                 : m.lens == Lens::kFisheye ? fisheye(m, r2)
                                                            : rational(m, r2);
    Distorted d;
    d.position.x() = x * radial + 2.0 * m.p1 * x * y + m.p2 * (r2 + 2.0 * x * x);
    d.position.y() = y * radial + m.p1 * (r2 + 2.0 * y * y) + 2.0 * m.p2 * x * y;
    d.xx = radial + x * x * slope + 2.0 * m.p1 * y + 6.0 * m.p2 * x;
    d.xy = x * y * slope + 2.0 * m.p1 * x + 2.0 * m.p2 * y;
    d.yy = radial + y * y * slope + 6.0 * m.p1 * y + 2.0 * m.p2 * x;
    return d;
}

bool has_distortion(const CameraModel& m) noexcept {
    return m.k1 != 0.0 || m.k2 != 0.0 || m.p1 != 0.0 || m.p2 != 0.0 || m.k3 != 0.0 || !m.is_plain_brown();
}

Vector2 pixel_to_distorted(const CameraModel& m, const Vector2& pixel) noexcept {
    return {(pixel.x() - m.cx) / m.fx, (pixel.y() - m.cy) / m.fy};
}

// Solves distort(n) = target from `start`. Stays finite: a singular Jacobian ends the search where it stands.
Vector2 undistort_from(const CameraModel& m, const Vector2& target, const Vector2& start) noexcept {
    Vector2 n = start;
    for (int step = 0; step < kNewtonStepsMax; ++step) {
        const Distorted d = distort(m, n);
        const double ex = target.x() - d.position.x();
        const double ey = target.y() - d.position.y();
        const double determinant = d.xx * d.yy - d.xy * d.xy;
        if (!(determinant > 1e-6)) break;
        const double inverse = 1.0 / determinant;
        const double sx = (d.yy * ex - d.xy * ey) * inverse;
        const double sy = (d.xx * ey - d.xy * ex) * inverse;
        n.x() += sx;
        n.y() += sy;
        if (sx * sx + sy * sy < kStep2Enough) break;
    }
    return n;
}

double distance2(const Vector2& a, const Vector2& b) noexcept {
    return (a - b).squaredNorm();
}

// Follows the ray from the principal point to `pixel` in small steps, each solved from the one before: the branch of
// the distortion that belongs to the lens. The direct solution must be on the same branch, and the Jacobian positive.
bool is_monotonic_along_ray(const CameraModel& m, const Vector2& pixel) noexcept {
    constexpr int kSteps = 24;
    const Vector2 end = pixel_to_distorted(m, pixel);
    Vector2 followed = Vector2::Zero();
    for (int step = 0; step <= kSteps; ++step) {
        const Vector2 target = end * (static_cast<double>(step) / kSteps);
        followed = undistort_from(m, target, followed);
        const Distorted d = distort(m, followed);
        if (!(d.xx + d.yy > 0.0 && d.xx * d.yy - d.xy * d.xy > 1e-3)) return false;
        const double residual_x = (d.position.x() - target.x()) * m.fx;
        const double residual_y = (d.position.y() - target.y()) * m.fy;
        if (!(residual_x * residual_x + residual_y * residual_y < kResidualMaxPx * kResidualMaxPx)) return false;
        if (!(distance2(undistort_from(m, target, target), followed) < 1e-10)) return false;
    }
    return true;
}

}  // namespace

Status validate(const CameraModel& model) noexcept {
    if (model.width == 0 || model.height == 0) return Status::kInvalid;
    for (const double value : {model.fx, model.fy, model.cx, model.cy, model.k1, model.k2, model.p1, model.p2, model.k3,
                               model.k4, model.k5, model.k6}) {
        if (!is_finite(value)) return Status::kInvalid;
    }
    if (model.lens != Lens::kBrown && model.lens != Lens::kFisheye) return Status::kInvalid;
    const bool has_others = model.p1 != 0.0 || model.p2 != 0.0 || model.k5 != 0.0 || model.k6 != 0.0;
    if (model.lens == Lens::kFisheye && has_others) return Status::kInvalid;
    if (!(model.fx > 0.0 && model.fy > 0.0)) return Status::kInvalid;
    if (!has_distortion(model)) return Status::kOk;
    // Rays to the border, every 8 px: about 7000 solutions for VGA, once per camera.
    const double right = static_cast<double>(model.width) - 1.0;
    const double bottom = static_cast<double>(model.height) - 1.0;
    for (std::uint32_t x = 0; x < model.width + 7; x += 8) {
        const double px = x < model.width ? static_cast<double>(x) : right;
        if (!is_monotonic_along_ray(model, {px, 0.0}) || !is_monotonic_along_ray(model, {px, bottom})) {
            return Status::kInvalid;
        }
    }
    for (std::uint32_t y = 0; y < model.height + 7; y += 8) {
        const double py = y < model.height ? static_cast<double>(y) : bottom;
        if (!is_monotonic_along_ray(model, {0.0, py}) || !is_monotonic_along_ray(model, {right, py})) {
            return Status::kInvalid;
        }
    }
    return Status::kOk;
}

Vector2 distort_to_pixel(const CameraModel& model, const Vector2& normalised) noexcept {
    const Vector2 d = has_distortion(model) ? distort(model, normalised).position : normalised;
    return {model.fx * d.x() + model.cx, model.fy * d.y() + model.cy};
}

bool project(const CameraModel& model, const Vector3& q, double z_min_m, Vector2& pixel) noexcept {
    if (!(q.z() >= z_min_m)) return false;  // NaN too
    const Vector2 n(q.x() / q.z(), q.y() / q.z());
    const double out_x = kReachFactor * std::max(model.cx, model.width - model.cx) + kReach * model.fx;
    const double out_y = kReachFactor * std::max(model.cy, model.height - model.cy) + kReach * model.fy;
    if (model.is_plain_brown()) {
        if (std::abs(n.x()) * model.fx > out_x || std::abs(n.y()) * model.fy > out_y) return false;
        pixel = distort_to_pixel(model, n);
        return true;
    }
    // A wide lens bends much in from far out: what it truly sees there comes back when the bend is taken off again.
    constexpr double kBackMax = 1e-4;  // of 1 + r^2, as the tangent of an angle grows
    const Vector2 d = distort(model, n).position;
    if (!(std::abs(d.x()) * model.fx <= out_x && std::abs(d.y()) * model.fy <= out_y)) return false;
    const double far = kBackMax * (1.0 + n.squaredNorm());
    if (!(distance2(undistort_from(model, d, d), n) < far * far)) return false;
    pixel = {model.fx * d.x() + model.cx, model.fy * d.y() + model.cy};
    return true;
}

Vector2 undistort_to_normalised(const CameraModel& model, const Vector2& pixel) noexcept {
    const Vector2 distorted = pixel_to_distorted(model, pixel);
    return has_distortion(model) ? undistort_from(model, distorted, distorted) : distorted;
}

double view_cosine(const CameraModel& model) noexcept {
    double cosine = 1.0;
    for (const double x : {0.0, static_cast<double>(model.width)}) {
        for (const double y : {0.0, static_cast<double>(model.height)}) {
            const Vector2 n = undistort_to_normalised(model, {x, y});
            cosine = std::min(cosine, 1.0 / std::sqrt(1.0 + n.squaredNorm()));
        }
    }
    return cosine;
}

}  // namespace stillmesh
