#include "hal/live/depth_registration.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/check.hpp"
#include "engine/geometry/lens.hpp"
#include "hal/for_each_processor.hpp"

namespace stillmesh {
namespace {

// Of the lens's grid: between nodes c px apart a line bends by c^2 / 8 f px times the second derivative of the lens,
// which is about 1.
constexpr double kBend_px = 0.04;
constexpr double kTanMax = 6;  // 80 degrees off the axis: no depth camera sees farther to the side

[[nodiscard]] bool is_bent(const CameraModel& m) noexcept {
    return m.lens != Lens::kBrown || m.k1 != 0 || m.k2 != 0 || m.p1 != 0 || m.p2 != 0 || m.k3 != 0 || m.k4 != 0 ||
           m.k5 != 0 || m.k6 != 0;
}

// What a row needs on its way into the picture.
struct Projection {
    float r[9] = {}, t[3] = {};             // into the colour camera's frame, depth units
    float fx = 1, fy = 1, cx = 0, cy = 0;   // of the colour camera
    float half_width = 0, half_height = 0;  // px that a pixel of depth covers at the same distance
    float columns = 0, lines = 0;           // of the picture
};

// Where the pixels of a row are seen, px; how much larger they are there than if the cameras stood in one place; how
// far they are from the colour camera: 0 if not before it, or too far for 16 bits.
STILLMESH_FOR_EACH_PROCESSOR void place(const std::uint16_t* __restrict z, const float* __restrict ray_x,
                                        const float* __restrict ray_y, std::size_t width, const Projection& projection,
                                        RegisteredRow& row) noexcept {
    const Projection p = projection;
    float* __restrict const u = row.u.data();
    float* __restrict const v = row.v.data();
    float* __restrict const size = row.size.data();
    std::uint16_t* __restrict const z_out = row.z.data();
    for (std::size_t i = 0; i < width; ++i) {
        const auto depth = static_cast<float>(z[i]);
        const float a = ray_x[i], b = ray_y[i];
        const float x = (p.r[0] * a + p.r[1] * b + p.r[2]) * depth + p.t[0];
        const float y = (p.r[3] * a + p.r[4] * b + p.r[5]) * depth + p.t[1];
        const float far = (p.r[6] * a + p.r[7] * b + p.r[8]) * depth + p.t[2];
        const float inverse = 1.0F / (far < 1.0F ? 1.0F : far);
        u[i] = x * inverse * p.fx + p.cx;
        v[i] = y * inverse * p.fy + p.cy;
        size[i] = depth * inverse;
        const float rounded = far < 1.0F || far > 65535.0F ? 0.0F : far + 0.5F;
        z_out[i] = static_cast<std::uint16_t>(static_cast<std::int32_t>(rounded));
    }
}

// The first pixel whose centre is at or behind an edge, within [0, size]: counted from the far end, where rounding
// towards zero is rounding up.
[[nodiscard]] inline std::int32_t first_centre(float edge, float size) noexcept {
    const float left = size - edge;
    const float positive = left < 0.0F ? 0.0F : left;
    return static_cast<std::int32_t>(size) - static_cast<std::int32_t>(positive > size ? size : positive);
}

STILLMESH_FOR_EACH_PROCESSOR void find_edges(std::size_t width, const Projection& projection,
                                             RegisteredRow& row) noexcept {
    const Projection p = projection;
    const float* __restrict const u = row.u.data();
    const float* __restrict const v = row.v.data();
    const float* __restrict const size = row.size.data();
    std::int32_t* __restrict const left = row.left.data();
    std::int32_t* __restrict const right = row.right.data();
    std::int32_t* __restrict const top = row.top.data();
    std::int32_t* __restrict const bottom = row.bottom.data();
    for (std::size_t i = 0; i < width; ++i) {
        const float w = p.half_width * size[i], h = p.half_height * size[i];
        left[i] = first_centre(u[i] - w, p.columns);
        right[i] = first_centre(u[i] + w, p.columns);
        top[i] = first_centre(v[i] - h, p.lines);
        bottom[i] = first_centre(v[i] + h, p.lines);
    }
}

// A slanted surface, not an edge, has no gaps: its pixels reach to where the next ones begin, to the right and below.
STILLMESH_FOR_EACH_PROCESSOR void close_gaps(const std::uint16_t* __restrict z, const std::uint16_t* __restrict z_below,
                                             std::size_t width, const std::int32_t* __restrict left,
                                             const std::int32_t* __restrict top_below, std::int32_t* __restrict right,
                                             std::int32_t* __restrict bottom) noexcept {
    const auto reach = [](std::int32_t here, std::int32_t next, std::int32_t end, std::int32_t begin_next) {
        const std::int32_t step = here > next ? here - next : next - here;
        const bool is_one_surface = (next > 0) & (step < (here >> 5) + 1);
        return (is_one_surface & (begin_next > end)) ? begin_next : end;
    };
    for (std::size_t i = 0; i + 1 < width; ++i) right[i] = reach(z[i], z[i + 1], right[i], left[i + 1]);
    for (std::size_t i = 0; i < width; ++i) bottom[i] = reach(z[i], z_below[i], bottom[i], top_below[i]);
}

[[nodiscard]] RigidTransform beside(double baseline_m) noexcept {
    RigidTransform pose;
    pose.translation_m[0] = -baseline_m;
    return pose;
}

}  // namespace

DepthRegistration::DepthRegistration(const CameraModel& depth, const CameraModel& colour, double baseline_m,
                                     double depth_units_per_m)
    : DepthRegistration(depth, colour, beside(baseline_m), depth_units_per_m) {}

DepthRegistration::DepthRegistration(const CameraModel& depth, const CameraModel& colour,
                                     const RigidTransform& colour_from_depth, double depth_units_per_m)
    : depth_(depth), colour_(colour), units_per_m_(depth_units_per_m) {
    set_pose(colour_from_depth);
    make_rays();
    if (is_bent(colour)) make_warp();
    ray_y_of_row_.resize(depth.width);
    for (RegisteredRow& row : rows_) {
        for (std::vector<float>* const values : {&row.u, &row.v, &row.size}) values->resize(depth.width);
        for (std::vector<std::int32_t>* const values : {&row.left, &row.right, &row.top, &row.bottom}) {
            values->resize(depth.width);
        }
        row.z.resize(depth.width);
    }
}

void DepthRegistration::set_pose(const RigidTransform& colour_from_depth) noexcept {
    const RotationMatrix rotation = matrix_of(colour_from_depth.rotation_xyzw);
    for (std::size_t i = 0; i < 9; ++i) rotation_[i] = static_cast<float>(rotation[i]);
    for (std::size_t i = 0; i < 3; ++i) {
        translation_[i] = static_cast<float>(colour_from_depth.translation_m[i] * units_per_m_);
    }
}

void DepthRegistration::make_rays() {
    is_depth_bent_ = is_bent(depth_);
    const std::uint32_t width = depth_.width, height = depth_.height;
    ray_x_.resize(is_depth_bent_ ? std::size_t{width} * height : width);
    ray_y_.resize(is_depth_bent_ ? std::size_t{width} * height : height);
    if (is_depth_bent_) {
        for (std::uint32_t y = 0; y < height; ++y) {
            for (std::uint32_t x = 0; x < width; ++x) {
                const ImagePoint ray = ray_of_pixel(depth_, {double(x), double(y)});
                ray_x_[std::size_t{y} * width + x] = static_cast<float>(ray.x);
                ray_y_[std::size_t{y} * width + x] = static_cast<float>(ray.y);
            }
        }
        return;
    }
    for (std::uint32_t x = 0; x < width; ++x) ray_x_[x] = static_cast<float>((x - depth_.cx) / depth_.fx);
    for (std::uint32_t y = 0; y < height; ++y) ray_y_[y] = static_cast<float>((y - depth_.cy) / depth_.fy);
}

// Over all that the picture shows, and a cell around it.
void DepthRegistration::make_warp() {
    ImagePoint low{kTanMax, kTanMax}, high{-kTanMax, -kTanMax};
    constexpr int kSteps = 64;
    for (int i = 0; i <= kSteps; ++i) {
        const double right = colour_.width - 1.0, bottom = colour_.height - 1.0;
        const double u = right * i / kSteps, v = bottom * i / kSteps;
        for (const ImagePoint pixel : {ImagePoint{u, 0}, {u, bottom}, {0, v}, {right, v}}) {
            const ImagePoint ray = ray_of_pixel(colour_, pixel);
            low = {std::min(low.x, ray.x), std::min(low.y, ray.y)};
            high = {std::max(high.x, ray.x), std::max(high.y, ray.y)};
        }
    }
    low = {std::max(low.x, -kTanMax), std::max(low.y, -kTanMax)};
    high = {std::min(high.x, kTanMax), std::min(high.y, kTanMax)};
    const double focal = std::max(colour_.fx, colour_.fy);
    const double per_cell = focal / std::sqrt(8 * focal * kBend_px);
    warp_.per_cell = static_cast<float>(per_cell);
    warp_.x0 = static_cast<float>(low.x - 1 / per_cell);
    warp_.y0 = static_cast<float>(low.y - 1 / per_cell);
    warp_.columns = static_cast<std::uint32_t>((high.x - low.x) * per_cell) + 4;
    warp_.rows = static_cast<std::uint32_t>((high.y - low.y) * per_cell) + 4;
    for (std::uint32_t j = 0; j < warp_.rows; ++j) {
        for (std::uint32_t i = 0; i < warp_.columns; ++i) {
            const ImagePoint pixel =
                pixel_of_ray(colour_, {double{warp_.x0} + i / per_cell, double{warp_.y0} + j / per_cell});
            warp_.u.push_back(static_cast<float>(pixel.x));
            warp_.v.push_back(static_cast<float>(pixel.y));
        }
    }
}

void DepthRegistration::place_row(const DepthView& source, std::uint32_t y, RegisteredRow& row) noexcept {
    const std::size_t width = depth_.width;
    const std::size_t at = is_depth_bent_ ? y * width : 0;
    const bool is_warped = warp_.columns > 0;
    Projection projection{.half_width = static_cast<float>(0.5 * colour_.fx / depth_.fx),
                          .half_height = static_cast<float>(0.5 * colour_.fy / depth_.fy),
                          .columns = static_cast<float>(colour_.width),
                          .lines = static_cast<float>(colour_.height)};
    if (!is_warped) {  // with a lens u and v are x/z and y/z first
        projection.fx = static_cast<float>(colour_.fx), projection.fy = static_cast<float>(colour_.fy);
        projection.cx = static_cast<float>(colour_.cx), projection.cy = static_cast<float>(colour_.cy);
    }
    std::copy_n(rotation_, 9, projection.r);
    std::copy_n(translation_, 3, projection.t);
    if (!is_depth_bent_) std::fill(ray_y_of_row_.begin(), ray_y_of_row_.end(), ray_y_[y]);
    place(source.row(y), ray_x_.data() + at, is_depth_bent_ ? ray_y_.data() + at : ray_y_of_row_.data(), width,
          projection, row);
    if (is_warped) bend_row(row);
    find_edges(width, projection, row);
}

void DepthRegistration::bend_row(RegisteredRow& row) const noexcept {
    const auto columns_max = static_cast<float>(warp_.columns - 1), rows_max = static_cast<float>(warp_.rows - 1);
    for (std::uint32_t i = 0; i < depth_.width; ++i) {
        const float x = (row.u[i] - warp_.x0) * warp_.per_cell;
        const float y = (row.v[i] - warp_.y0) * warp_.per_cell;
        if (!(x >= 0 && y >= 0 && x < columns_max && y < rows_max)) {
            row.u[i] = row.v[i] = -1e6F;  // outside the picture
            continue;
        }
        const auto column = static_cast<std::uint32_t>(x), line = static_cast<std::uint32_t>(y);
        const float a = x - static_cast<float>(column), b = y - static_cast<float>(line);
        const std::size_t at = std::size_t{line} * warp_.columns + column;
        const auto between = [&](const std::vector<float>& values) {
            const float* const upper = values.data() + at;
            const float* const lower = upper + warp_.columns;
            const float first = upper[0] + a * (upper[1] - upper[0]);
            return first + b * (lower[0] + a * (lower[1] - lower[0]) - first);
        };
        row.u[i] = between(warp_.u);
        row.v[i] = between(warp_.v);
    }
}

void DepthRegistration::draw_row(const RegisteredRow& row, std::uint16_t* target) const noexcept {
    for (std::size_t i = 0; i < depth_.width; ++i) {
        const std::uint16_t z = row.z[i];
        if (z == 0) continue;
        for (std::int32_t v = row.top[i]; v < row.bottom[i]; ++v) {
            std::uint16_t* const out = target + static_cast<std::size_t>(v) * colour_.width;
            for (std::int32_t u = row.left[i]; u < row.right[i]; ++u) {
                if (out[u] == 0 || z < out[u]) out[u] = z;
            }
        }
    }
}

void DepthRegistration::reproject(const DepthView& source, std::uint16_t* target) noexcept {
    STILLMESH_CHECK(source.width == depth_.width && source.height == depth_.height);
    std::fill_n(target, std::size_t{colour_.width} * colour_.height, std::uint16_t{0});
    place_row(source, 0, rows_[0]);
    for (std::uint32_t y = 0; y < source.height; ++y) {
        RegisteredRow& row = rows_[y % 2];
        RegisteredRow& below = rows_[(y + 1) % 2];
        const bool is_last = y + 1 == source.height;
        if (!is_last) place_row(source, y + 1, below);
        close_gaps(source.row(y), source.row(is_last ? y : y + 1), depth_.width, row.left.data(),
                   is_last ? row.top.data() : below.top.data(), row.right.data(), row.bottom.data());
        draw_row(row, target);
    }
}

}  // namespace stillmesh
