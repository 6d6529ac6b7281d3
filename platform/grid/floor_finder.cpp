#include "platform/grid/floor_finder.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

using Vector = std::array<double, 3>;

constexpr std::uint32_t kStride = 2;     // cells
constexpr double kUprightCosine = 0.64;  // 50 degrees
constexpr double kLevelCosine = 0.978;   // 12 degrees: the noise of a cell's normal
constexpr double kStepMax = 0.15;        // of its depth, to the next cell of one surface
constexpr double kBin_m = 0.04, kLowest_m = -5;
constexpr double kCameraMin_m = 0.1, kCameraMax_m = 3;  // above the floor
constexpr double kBelow_m = 0.12;                       // under the floor by more: something lies below it
constexpr double kBelowShareMax = 0.02;
constexpr double kFloorShareMin = 0.03;
constexpr std::uint64_t kFloorCellsMin = 200;
constexpr double kPeakShare = 0.15;   // of the largest level surface: large enough for a floor
constexpr double kSpreadMin_m = 0.1;  // standard deviation across
constexpr double kFitWithin_m[] = {0.12, 0.06, 0.04};

double dot(const Vector& a, const Vector& b) noexcept {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector cross(const Vector& a, const Vector& b) noexcept {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector minus(const Vector& a, const Vector& b) noexcept {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Vector unit(const Vector& a) noexcept {
    const double length = std::sqrt(dot(a, a));
    return {a[0] / length, a[1] / length, a[2] / length};
}
Vector times(const RotationMatrix& r, const Vector& p) noexcept {
    return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2], r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
            r[6] * p[0] + r[7] * p[1] + r[8] * p[2]};
}
Vector point_of(const DepthImage& depth, std::size_t cell) noexcept {
    const double z = depth.depth_mm[cell] * 1e-3;
    return {static_cast<double>(depth.rays[2 * cell]) * z, static_cast<double>(depth.rays[2 * cell + 1]) * z, z};
}

// Of the surface of one cell, in the map. False: it is none that the camera looks down on.
bool normal_at(const DepthImage& depth, std::size_t cell, const RotationMatrix& rotation, Vector& normal) noexcept {
    const std::size_t right = cell + kStride, down = cell + std::size_t{kStride} * depth.columns;
    if (!depth.is_still(right) || !depth.is_still(down)) return false;
    const Vector p = point_of(depth, cell);
    const Vector to_right = minus(point_of(depth, right), p), to_down = minus(point_of(depth, down), p);
    if (!(std::abs(to_right[2]) < kStepMax * p[2] && std::abs(to_down[2]) < kStepMax * p[2])) return false;
    const Vector across = cross(to_down, to_right);
    const double length = std::sqrt(dot(across, across));
    if (!(length > 0 && -across[1] > kUprightCosine * length)) return false;
    normal = unit(times(rotation, across));
    return true;
}

}  // namespace

void FloorFinder::add(const DepthImage& depth, const RigidTransform& map_from_camera) noexcept {
    const RotationMatrix rotation = matrix_of(map_from_camera.rotation_xyzw);
    const auto& t = map_from_camera.translation_m;
    for (std::uint32_t row = 0; row + kStride < depth.rows; row += kStride) {
        for (std::uint32_t column = 0; column + kStride < depth.columns; column += kStride) {
            const std::size_t cell = std::size_t{row} * depth.columns + column;
            if (!depth.is_still(cell)) continue;
            ++total_;
            const Vector p = point_of(depth, cell), turned = times(rotation, p);
            const Vector at{turned[0] + t[0], turned[1] + t[1], turned[2] + t[2]};
            // Normals cost most: only of what this pass asks about.
            Vector normal;
            if (is_asked(at, -dot(turned, up_)) && normal_at(depth, cell, rotation, normal)) {
                take(at, normal, 1 / (p[2] * p[2]));
            }
        }
    }
}

// `camera_height`: of the camera above it, along the direction that is up so far.
bool FloorFinder::is_asked(const Vector& at, double camera_height) noexcept {
    if (pass_ == Pass::kDirections) return true;
    if (pass_ == Pass::kHeights) return camera_height >= kCameraMin_m && camera_height <= kCameraMax_m;
    const double within_m = kFitWithin_m[static_cast<std::size_t>(pass_) - static_cast<std::size_t>(Pass::kFirstFit)];
    const double z = dot(at, up_) - height_m_;
    below_ += z < -kBelow_m ? 1U : 0U;
    return std::abs(z) <= within_m;
}

void FloorFinder::take(const Vector& at, const Vector& normal, double weight) noexcept {
    if (pass_ == Pass::kDirections) {
        take_direction(normal);
    } else if (dot(normal, up_) < kLevelCosine) {
        return;
    } else if (pass_ == Pass::kHeights) {
        const int bin = static_cast<int>((dot(at, up_) - kLowest_m) / kBin_m);
        if (bin >= 0 && bin < kHeights) ++flat_[static_cast<std::size_t>(bin)];
    } else {
        take_fit(at, weight);
    }
}

void FloorFinder::take_direction(const Vector& normal) noexcept {
    const auto bin_of = [](double value) {
        return std::clamp(static_cast<int>((value + 1) * (kSide / 2)), 0, kSide - 1);
    };
    Direction& bin = directions_[static_cast<std::size_t>(bin_of(normal[0]) * kSide + bin_of(normal[2]))];
    bin.x += static_cast<float>(normal[0]);
    bin.y += static_cast<float>(normal[1]);
    bin.z += static_cast<float>(normal[2]);
    ++bin.count;
}

void FloorFinder::take_fit(const Vector& at, double w) noexcept {
    ++inliers_;
    const double x = dot(at, right_), y = dot(at, ahead_), z = dot(at, up_) - height_m_;
    Moments& m = moments_;
    m.w += w;
    m.x += w * x;
    m.y += w * y;
    m.z += w * z;
    m.xx += w * x * x;
    m.xy += w * x * y;
    m.yy += w * y * y;
    m.xz += w * x * z;
    m.yz += w * y * z;
    m.zz += w * z * z;
}

bool FloorFinder::end_pass() noexcept {
    bool goes_on = false;
    switch (pass_) {
        case Pass::kDirections: goes_on = find_up(); break;
        case Pass::kHeights: goes_on = find_height(); break;
        case Pass::kFirstFit:
        case Pass::kSecondFit: goes_on = fit(); break;
        case Pass::kThirdFit:
            if (fit()) judge();
            break;
        case Pass::kDone: break;
    }
    pass_ = goes_on ? static_cast<Pass>(static_cast<int>(pass_) + 1) : Pass::kDone;
    total_ = inliers_ = below_ = 0;
    moments_ = Moments{};
    return pass_ == Pass::kDone;
}

// Where most normals of three by three bins point.
bool FloorFinder::find_up() noexcept {
    Direction best;
    for (int i = 1; i + 1 < kSide; ++i) {
        for (int k = 1; k + 1 < kSide; ++k) {
            Direction sum;
            for (int at = 0; at < 9; ++at) {
                const Direction& bin = directions_[static_cast<std::size_t>((i - 1 + at / 3) * kSide + k - 1 + at % 3)];
                sum = {sum.x + bin.x, sum.y + bin.y, sum.z + bin.z, sum.count + bin.count};
            }
            if (sum.count > best.count) best = sum;
        }
    }
    if (best.count < kFloorCellsMin) return false;
    set_up({static_cast<double>(best.x), static_cast<double>(best.y), static_cast<double>(best.z)});
    return up_[1] < -kUprightCosine;
}

void FloorFinder::set_up(const Vector& up) noexcept {
    up_ = unit(up);
    const Vector z{0, 0, 1};
    right_ = unit(cross(z, up_));  // up is within 50 degrees of -y
    ahead_ = cross(up_, right_);
}

// The lowest level surface that is large, with next to nothing below.
bool FloorFinder::find_height() noexcept {
    const auto level = [this](int bin) {
        std::uint64_t sum = 0;
        for (int i = std::max(bin - 1, 0); i <= std::min(bin + 1, kHeights - 1); ++i) {
            sum += flat_[static_cast<std::size_t>(i)];
        }
        return static_cast<double>(sum);
    };
    double largest = 0;
    for (int bin = 0; bin < kHeights; ++bin) largest = std::max(largest, level(bin));
    const double enough = std::max(static_cast<double>(kFloorCellsMin), kPeakShare * largest);
    int bin = 0;
    while (bin < kHeights && level(bin) < enough) ++bin;
    while (bin + 1 < kHeights && level(bin + 1) > level(bin)) ++bin;
    if (bin >= kHeights) return false;
    height_m_ = kLowest_m + (bin + 0.5) * kBin_m;
    return true;
}

// z = a x + b y + c over what lies within reach of the plane so far; then the plane is that one.
bool FloorFinder::fit() noexcept {
    const Moments& m = moments_;
    if (inliers_ < kFloorCellsMin) return false;
    const double x = m.x / m.w, y = m.y / m.w, z = m.z / m.w;
    const double xx = m.xx / m.w - x * x, xy = m.xy / m.w - x * y, yy = m.yy / m.w - y * y;
    const double xz = m.xz / m.w - x * z, yz = m.yz / m.w - y * z, zz = m.zz / m.w - z * z;
    const double half = 0.5 * (xx + yy), apart = std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
    if (half - apart < kSpreadMin_m * kSpreadMin_m) return false;
    const double determinant = xx * yy - xy * xy;
    const double a = (yy * xz - xy * yz) / determinant, b = (xx * yz - xy * xz) / determinant;
    const double c = height_m_ + z - a * x - b * y;
    // p . up = a p . right + b p . ahead + c
    Vector normal{};
    for (std::size_t i = 0; i < 3; ++i) normal[i] = up_[i] - a * right_[i] - b * ahead_[i];
    floor_.rms_m = std::sqrt(std::max(0.0, zz - a * xz - b * yz));
    height_m_ = c / std::sqrt(dot(normal, normal));
    set_up(normal);
    return true;
}

void FloorFinder::judge() noexcept {
    const auto total = static_cast<double>(total_);
    floor_.share = static_cast<double>(inliers_) / total;
    const double below = static_cast<double>(below_) / total;
    floor_.is_known = floor_.share >= kFloorShareMin && below <= kBelowShareMax && up_[1] < -kUprightCosine;
    // x ahead, y to the left, z up
    const RotationMatrix rotation = {ahead_[0],  ahead_[1], ahead_[2], -right_[0], -right_[1],
                                     -right_[2], up_[0],    up_[1],    up_[2]};
    write_quaternion(rotation, floor_.level_from_map.rotation_xyzw);
    floor_.level_from_map.translation_m[2] = -height_m_;
}

}  // namespace stillmesh
