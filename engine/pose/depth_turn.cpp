#include "engine/pose/depth_turn.hpp"

#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/pose/residual.hpp"
#include "engine/pose/row_turn.hpp"

namespace stillmesh {
namespace {

constexpr int kDepthPasses = 3;
constexpr std::size_t kDepthMatchesMax = 128;
constexpr double kStep_px = 3;       // between the looks that tell how depth slopes, and the ray
constexpr double kLeapShare = 0.08;  // of depth: what changes by more has an edge between, and no slope

// How a point's image moves as the camera turns, per radian.
struct ImageByTurn {
    Vector3 x, y;
};

ImageByTurn image_by_turn(double x, double y) noexcept {
    return {Vector3(x * y, -(1.0 + x * x), y), Vector3(1.0 + y * y, -(x * y), -x)};
}

DepthSample look(const DepthPicture& p, const Vector2& at_px) noexcept {
    return sample_depth(p.frame->depth, 1.0 / p.frame->depth_units_per_m, round_clamped(at_px.x()),
                        round_clamped(at_px.y()), *p.range);
}

Vector2 turned(const DepthPicture& p, const Vector2& pixel, const ImageByTurn& by, const Vector3& turn) noexcept {
    return {pixel.x() + p.camera->fx * by.x.dot(turn), pixel.y() + p.camera->fy * by.y.dot(turn)};
}

// Slope of depth along `step`, m per pixel; 0 where there is none.
double slope(const DepthPicture& p, const Vector2& at_px, const Vector2& step) noexcept {
    const DepthSample before = look(p, at_px - step);
    const DepthSample behind = look(p, at_px + step);
    if (!before.is_valid() || !behind.is_valid()) return 0;
    const double change = behind.mean_m - before.mean_m;
    return std::fabs(change) > kLeapShare * before.mean_m ? 0 : change / (2.0 * kStep_px);
}

// Of one pass, with depth of a camera that had turned by `turn`.
struct DepthSums {
    Vector3 turn;
    double chi2_max = 0;
    RowEquations equations;
};

// How the depth of a match changes as that turn does, m/rad.
Vector3 depth_by_turn(const DepthPicture& picture, const Vector2& pixel, const Vector2& ray, const Vector3& turn,
                      double z_m) noexcept {
    const ImageByTurn by = image_by_turn(ray.x(), ray.y());
    const Vector2 at_px = turned(picture, pixel, by, turn);
    return by.x * (picture.camera->fx * slope(picture, at_px, {kStep_px, 0})) +
           by.y * (picture.camera->fy * slope(picture, at_px, {0, kStep_px})) + Vector3(ray.y(), -ray.x(), 0) * z_m;
}

// A match as the camera at `camera_from_world` sees it, whose depth was looked up with the turn `looked_up`.
void add_match(const Correspondence& match, const DepthPicture& picture, const SE3& camera_from_world,
               const Vector3& looked_up, DepthSums& sums) noexcept {
    const Vector3 q = camera_from_world * match.p_world;
    if (q.z() < kDepthMin_m) return;
    Residual r = residual_of(match, q, match.map_var_lateral, match.map_var_z);
    Vector3 by_turn = Vector3::Zero();
    if (match.has_depth) {
        const Keypoint& keypoint = picture.keypoints[match.feature];
        const Vector2 pixel(static_cast<double>(keypoint.x), static_cast<double>(keypoint.y));
        const DepthSample sample = depth_behind(picture, pixel, match.normalised, sums.turn);
        // Of the row's own camera, which was carried to the middle row's.
        r.z += depth_behind(picture, pixel, match.normalised, looked_up).mean_m - sample.mean_m;
        if (!sample.is_valid()) r.info_z = 0;
        by_turn = depth_by_turn(picture, pixel, match.normalised, sums.turn, sample.mean_m);
    }
    const double chi2 = r.chi2();
    const double weight = match.weight * (chi2 <= sums.chi2_max ? 1.0 : sums.chi2_max / chi2);
    // Rows and columns of the turn are those that RowEquations has for the turn of rows: here depth moves with it, not
    // the image.
    RowEquations::visit_rows(q, 0.0, r, [&](RowEquations::Vector9 by, double residual, double info, int axis) {
        if (axis == 2) by.tail<3>() = -by_turn;
        sums.equations.add(by, residual, weight * info);
    });
}

}  // namespace

DepthSample depth_behind(const DepthPicture& picture, const Vector2& pixel, const Vector2& ray,
                         const Vector3& turn) noexcept {
    DepthSample sample = look(picture, turned(picture, pixel, image_by_turn(ray.x(), ray.y()), turn));
    sample.mean_m /= 1.0 - ray.y() * turn.x() + ray.x() * turn.y();  // along the axis of the camera that had not turned
    return sample;
}

Result<Vector3> measure_depth_turn(std::span<const Correspondence> correspondences,
                                   std::span<const std::uint16_t> chosen, const DepthPicture& picture,
                                   const DepthTurnPrior& prior, double chi2_max) noexcept {
    const std::size_t step = (chosen.size() + kDepthMatchesMax - 1) / kDepthMatchesMax;
    SE3 pose = prior.world_from_camera;
    Vector3 turn = prior.looked_up;
    for (int pass = 0; pass < kDepthPasses; ++pass) {
        DepthSums sums{turn, chi2_max, {}};
        const SE3 camera_from_world = pose.inverse();
        for (std::size_t i = 0; i < chosen.size(); i += step)
            add_match(correspondences[chosen[i]], picture, camera_from_world, prior.looked_up, sums);
        RowEquations& equations = sums.equations;
        equations.h *= prior.trust;
        equations.g *= prior.trust;
        equations.expect_turn(turn - prior.expected, prior.sigma_rad * prior.sigma_rad);
        if (!equations.step(pose, turn)) return Status::kInvalid;
    }
    return turn;
}

}  // namespace stillmesh
