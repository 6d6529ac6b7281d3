#include "hal/simulated/renderer.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "hal/for_each_processor.hpp"
#include "hal/simulated/shading.hpp"

namespace stillmesh::simulated {
namespace {

constexpr double kNear = kNearM;
constexpr std::uint32_t kCornersMax = 10;

[[nodiscard]] float f32(double value) noexcept {
    return static_cast<float>(value);
}

// A face along a row: its inverse depth at x = 0, what it grows by from pixel to pixel.
struct Slope {
    float begin, step;
    std::uint32_t id;
};

STILLMESH_FOR_EACH_PROCESSOR void keep_nearest(const Slope& face, std::int32_t x_begin, std::int32_t x_end,
                                               float* __restrict depth, std::uint32_t* __restrict ids) {
    for (std::int32_t x = x_begin; x < x_end; ++x) {
        const float w = face.begin + face.step * static_cast<float>(x);
        const float old = depth[x];
        const std::uint32_t old_id = ids[x];
        const bool is_nearer = w > old;
        depth[x] = is_nearer ? w : old;
        ids[x] = is_nearer ? face.id : old_id;
    }
}

}  // namespace

Picture::Picture(const Pinhole& camera) : camera_(camera) {
    const std::size_t pixels = static_cast<std::size_t>(camera.width) * camera.height;
    inverse_depth_.resize(pixels);
    face_ids_.resize(pixels);
    faces_.reserve(8192);
}

void Picture::clear() {
    faces_.clear();
    std::fill(inverse_depth_.begin(), inverse_depth_.end(), 0.0F);
    std::fill(face_ids_.begin(), face_ids_.end(), kNoFace);
}

Renderer::Renderer(const Pinhole& camera) : Picture(camera) {
    span_low_.resize(camera.height);
    span_high_.resize(camera.height);
}

void Renderer::begin(const Rigid& world_from_camera, double offset_x, double offset_y) {
    world_from_camera_ = world_from_camera;
    cx_ = camera_.cx - offset_x;
    cy_ = camera_.cy - offset_y;
    clear();
}

void Renderer::draw(const Vertex* vertices, std::uint32_t count, const Material& material) {
    // Into the camera, and away with what lies behind it or beside the image.
    Vec3 p[8];
    const double slope_left = -(cx_ + 1) / camera_.fx;
    const double slope_right = (camera_.width - cx_) / camera_.fx;
    const double slope_top = -(cy_ + 1) / camera_.fy;
    const double slope_bottom = (camera_.height - cy_) / camera_.fy;
    std::uint32_t outside[5] = {};
    for (std::uint32_t i = 0; i < count; ++i) {
        p[i] = world_from_camera_.rotation.transposed_times(vertices[i].p - world_from_camera_.translation);
        outside[0] += p[i].z < kNear;
        outside[1] += p[i].x < slope_left * p[i].z;
        outside[2] += p[i].x > slope_right * p[i].z;
        outside[3] += p[i].y < slope_top * p[i].z;
        outside[4] += p[i].y > slope_bottom * p[i].z;
    }
    for (const std::uint32_t n : outside) {
        if (n == count) return;
    }
    // A pixel's ray d hits the face's plane at z d = b0 p0 + b1 p1 + b2 p2, so that b / z = M^-1 d: everything affine
    // over the face is, divided by z, linear over the image. The determinant's sign is the side seen.
    const Vec3 r0 = cross(p[1], p[2]);
    const Vec3 r1 = cross(p[2], p[0]);
    const Vec3 r2 = cross(p[0], p[1]);
    const double det = dot(p[0], r0);
    if (!(det > 1e-9)) return;
    const double scale = 1.0 / det;
    const auto linear = [&](double a0, double a1, double a2) { return (r0 * a0 + r1 * a1 + r2 * a2) * scale; };
    const auto over_image = [&](const Vec3& n) {
        const double a = n.x / camera_.fx;
        const double b = n.y / camera_.fy;
        return ImagePlane{f32(a), f32(b), f32(n.z - a * cx_ - b * cy_)};
    };
    const Vec3 n = linear(1, 1, 1);

    // Clip at the near plane and project.
    double px[kCornersMax];
    double py[kCornersMax];
    std::uint32_t corners = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vec3& a = p[i];
        const Vec3& b = p[i + 1 == count ? 0 : i + 1];
        const auto add = [&](const Vec3& q) {
            px[corners] = camera_.fx * q.x / q.z + cx_;
            py[corners] = camera_.fy * q.y / q.z + cy_;
            ++corners;
        };
        if (a.z >= kNear) add(a);
        if ((a.z >= kNear) != (b.z >= kNear)) {
            // From the far end to the near one, whichever comes first: both faces at an edge cut it alike.
            const Vec3& far_end = a.z >= kNear ? a : b;
            const Vec3& near_end = a.z >= kNear ? b : a;
            Vec3 q = mix(far_end, near_end, (far_end.z - kNear) / (far_end.z - near_end.z));
            q.z = kNear;
            add(q);
        }
    }
    if (corners < 3) return;
    double top = py[0];
    double bottom = py[0];
    for (std::uint32_t i = 1; i < corners; ++i) {
        top = std::min(top, py[i]);
        bottom = std::max(bottom, py[i]);
    }
    const auto height = static_cast<std::int32_t>(camera_.height);
    const auto width = static_cast<std::int32_t>(camera_.width);
    const std::int32_t y_begin = -floor_clamped(-top, -height, 0);   // ceil
    const std::int32_t y_end = -floor_clamped(-bottom, -height, 0);  // first row below
    if (y_begin >= y_end) return;

    const auto id = static_cast<std::uint32_t>(faces_.size());
    VisibleFace& face = faces_.emplace_back();
    face.inverse_depth = over_image(n);
    const Vec3 nu = linear(static_cast<double>(vertices[0].u), static_cast<double>(vertices[1].u),
                           static_cast<double>(vertices[2].u));
    const Vec3 nv = linear(static_cast<double>(vertices[0].v), static_cast<double>(vertices[1].v),
                           static_cast<double>(vertices[2].v));
    face.u = over_image(nu);
    face.v = over_image(nv);
    face.light = over_image(linear(static_cast<double>(vertices[0].light), static_cast<double>(vertices[1].light),
                                   static_cast<double>(vertices[2].light)));
    // d(u, v)/d(x, y) of u = U/W, v = V/W has the determinant |U V W| / W^3.
    const double area = dot(nu, cross(nv, n)) / (camera_.fx * camera_.fy);
    face.footprint = f32(area < 0 ? -area : area);
    face.normal_length = f32(length(n));
    face.material = material;

    for (std::int32_t y = y_begin; y < y_end; ++y) {
        span_low_[static_cast<std::size_t>(y)] = 1e30;
        span_high_[static_cast<std::size_t>(y)] = -1e30;
    }
    for (std::uint32_t i = 0; i < corners; ++i) {
        std::uint32_t lo = i;
        std::uint32_t hi = i + 1 == corners ? 0 : i + 1;
        if (py[hi] < py[lo]) std::swap(lo, hi);  // one direction for both faces at an edge: no gap, no overlap
        const std::int32_t y0 = std::max(-floor_clamped(-py[lo], -height, 0), y_begin);
        const std::int32_t y1 = std::min(-floor_clamped(-py[hi], -height, 0), y_end);
        if (y0 >= y1) continue;
        const double slope = (px[hi] - px[lo]) / (py[hi] - py[lo]);
        for (std::int32_t y = y0; y < y1; ++y) {
            const double x = px[lo] + (y - py[lo]) * slope;
            const auto row = static_cast<std::size_t>(y);
            span_low_[row] = std::min(span_low_[row], x);
            span_high_[row] = std::max(span_high_[row], x);
        }
    }
    for (std::int32_t y = y_begin; y < y_end; ++y) {
        const auto row = static_cast<std::size_t>(y);
        const std::int32_t x_begin = -floor_clamped(-span_low_[row], -width, 0);
        const std::int32_t x_end = -floor_clamped(-span_high_[row], -width, 0);
        if (x_begin < x_end) fill_row(static_cast<std::uint32_t>(y), x_begin, x_end, face.inverse_depth, id);
    }
}

void Picture::fill_row(std::uint32_t y, std::int32_t x_begin, std::int32_t x_end, const ImagePlane& plane,
                       std::uint32_t id) noexcept {
    const std::size_t row = static_cast<std::size_t>(y) * camera_.width;
    keep_nearest({plane.b * static_cast<float>(y) + plane.c, plane.a, id}, x_begin, x_end, inverse_depth_.data() + row,
                 face_ids_.data() + row);
}

void Renderer::shade_into(std::vector<float>& sum, float level_offset) {
    for (std::uint32_t y = 0; y < camera_.height; ++y) {
        const std::size_t row = static_cast<std::size_t>(y) * camera_.width;
        visit_runs(face_ids_.data() + row, camera_.width, [&](std::uint32_t id, std::uint32_t x, std::uint32_t end) {
            shade_run(id == kNoFace ? nullptr : &faces_[id], {x, end, static_cast<float>(y)}, level_offset,
                      inverse_depth_.data() + row, sum.data() + row);
        });
    }
}

}  // namespace stillmesh::simulated
