#include "hal/simulated/row_renderer.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/check.hpp"
#include "engine/base/numbers.hpp"
#include "hal/simulated/shading.hpp"

namespace stillmesh::simulated {
namespace {

// People bend and swing with up to some 30 m/s^2: in 8 ms their way is .25 mm from straight.
constexpr double kStepS = 0.008;

[[nodiscard]] float f32(double value) noexcept {
    return static_cast<float>(value);
}

}  // namespace

void Recording::begin(double first_s, double last_s) {
    const std::int32_t steps = std::max(1, -floor_clamped((first_s - last_s) / kStepS, -100, 0));
    first_s_ = first_s;
    step_s_ = (last_s - first_s) / steps;
    moving_.resize(static_cast<std::size_t>(steps) + 1);
    for (std::vector<Vertex>& vertices : moving_) vertices.clear();
    still_.clear();
    faces_.clear();
    pass_ = 0;
    is_still_ = false;
}

void Recording::draw(const Vertex* vertices, std::uint32_t count, const Material& material) {
    std::vector<Vertex>& to = is_still_ ? still_ : moving_[pass_];
    if (is_still_ || pass_ == 0) faces_.push_back({material, static_cast<std::uint32_t>(to.size()), count, !is_still_});
    to.insert(to.end(), vertices, vertices + count);
}

Recording::Moment Recording::at(double time_s) const noexcept {
    const double steps = step_s_ > 0 ? (time_s - first_s_) / step_s_ : 0.0;
    const std::int32_t pass = floor_clamped(steps, 0, static_cast<std::int32_t>(count()) - 2);
    return {static_cast<std::uint32_t>(pass), clamp01(steps - pass)};
}

bool Recording::is_complete() const noexcept {
    for (const std::vector<Vertex>& vertices : moving_) {
        if (vertices.size() != moving_[0].size()) return false;
    }
    return true;
}

RowRenderer::RowRenderer(const Pinhole& camera) : Picture(camera), rows_(camera.height) {}

void RowRenderer::set_camera(const Pinhole& camera) {
    STILLMESH_CHECK(camera.width == camera_.width && camera.height == camera_.height);
    camera_ = camera;
}

void RowRenderer::draw(const Recording& recording, std::span<const RowPose> poses, double offset_x, double offset_y) {
    STILLMESH_CHECK(poses.size() == rows_.size() && recording.is_complete());
    recording_ = &recording;
    cx_ = camera_.cx - offset_x;
    cy_ = camera_.cy - offset_y;
    clear();
    drawn_.clear();
    for (std::size_t y = 0; y < rows_.size(); ++y) {
        const Mat3& r = poses[y].world_from_camera.rotation;
        rows_[y].pose = poses[y].world_from_camera;
        rows_[y].ray_by_x = r.a * (1 / camera_.fx);
        rows_[y].ray = r.a * (-cx_ / camera_.fx) + r.b * ((static_cast<double>(y) - cy_) / camera_.fy) + r.c;
        rows_[y].moment = recording.at(poses[y].time_s);
    }
    for (const Recording::Face& face : recording.faces()) draw_face(face);
}

RowRenderer::RowRange RowRenderer::rows_of(const Recording::Face& face) const noexcept {
    const auto height = static_cast<std::int32_t>(camera_.height);
    constexpr double kMargin = 1.5;  // px; what the rounds below leave of the way a corner makes is far less
    // px; while a tall face is read, the camera may swing to it and back between its corners.
    constexpr double kSwing = 16;
    const double slope_left = -(cx_ + kSwing) / camera_.fx;
    const double slope_right = (camera_.width - cx_ + kSwing) / camera_.fx;
    double top = 1e9;
    double bottom = -1e9;
    std::uint32_t near = 0;
    std::uint32_t left = 0;
    std::uint32_t right = 0;
    for (std::uint32_t i = 0; i < face.count; ++i) {
        // The row that sees the corner is the row in which it is then.
        std::int32_t y = height / 2;
        Vec3 p;
        double at = 0;
        for (int round = 0; round < 3; ++round) {
            const Row& row = rows_[static_cast<std::size_t>(y)];
            p = row.pose.rotation.transposed_times(recording_->corner(face, i, row.moment) - row.pose.translation);
            if (p.z < kNearM) break;
            at = camera_.fy * p.y / p.z + cy_;
            y = round_clamped(at, 0, height - 1);
        }
        near += p.z < kNearM;
        left += p.x < slope_left * p.z;
        right += p.x > slope_right * p.z;
        top = std::min(top, at);
        bottom = std::max(bottom, at);
    }
    if (near == face.count || left == face.count || right == face.count) return {};
    if (near > 0) return {0, height, true};
    return {-floor_clamped(kMargin - top, -height, 0), -floor_clamped(-bottom - kMargin, -height, 0), false};
}

bool RowRenderer::see(const Recording::Face& face, const Row& row, Seen& seen) const noexcept {
    for (std::uint32_t i = 0; i < face.count; ++i) {
        seen.corners[i] = recording_->corner(face, i, row.moment) - row.pose.translation;
    }
    const double det = dot(seen.corners[0], cross(seen.corners[1], seen.corners[2]));
    if (!(det > 1e-9)) return false;  // from behind, or from its edge
    seen.scale = 1 / det;
    // Both faces at an edge have the same plane there, but for the sign: no gap, no overlap.
    for (std::uint32_t i = 0; i < face.count; ++i) {
        seen.edges[i] = cross(seen.corners[i], seen.corners[i + 1 == face.count ? 0 : i + 1]);
    }
    return true;
}

void RowRenderer::draw_face(const Recording::Face& face) {
    const RowRange range = rows_of(face);
    const auto width = static_cast<std::int32_t>(camera_.width);
    const auto id = static_cast<std::uint32_t>(faces_.size());
    bool is_drawn = false;
    Seen seen;
    for (std::int32_t y = range.begin; y < range.end; ++y) {
        const Row& row = rows_[static_cast<std::size_t>(y)];
        if (!see(face, row, seen)) continue;
        double low = -1;
        double high = width;
        const auto keep = [&](double at_0, double by_x) {  // where at_0 + by_x * x >= 0
            if (by_x > 0) {
                low = std::max(low, -at_0 / by_x);
            } else if (by_x < 0) {
                high = std::min(high, -at_0 / by_x);
            } else if (at_0 < 0) {
                high = -2;
            }
        };
        for (std::uint32_t i = 0; i < face.count; ++i)
            keep(dot(seen.edges[i], row.ray), dot(seen.edges[i], row.ray_by_x));
        const Vec3 across = face.count == 3 ? seen.edges[2] : cross(seen.corners[2], seen.corners[0]);
        const Vec3 n = (seen.edges[1] + across + seen.edges[0]) * seen.scale;
        const double w = dot(n, row.ray);
        const double w_by_x = dot(n, row.ray_by_x);
        if (range.is_near) keep(1 / kNearM - w, -w_by_x);
        if (!(low < high)) continue;
        const std::int32_t x_begin = -floor_clamped(-low, -width, 0);
        const std::int32_t x_end = -floor_clamped(-high, -width, 0);
        if (x_begin >= x_end) continue;
        if (!is_drawn) {
            is_drawn = true;
            faces_.push_back(visible(face, row));
            drawn_.push_back(&face);
        }
        fill_row(static_cast<std::uint32_t>(y), x_begin, x_end, {f32(w_by_x), 0.0F, f32(w)}, id);
    }
}

VisibleFace RowRenderer::visible(const Recording::Face& face, const Row& row) const noexcept {
    VisibleFace out;
    out.material = face.material;
    Seen seen;
    if (!see(face, row, seen)) return out;
    const Vec3 r0 = seen.edges[1];
    const Vec3 r1 = face.count == 3 ? seen.edges[2] : cross(seen.corners[2], seen.corners[0]);
    const Vec3 r2 = seen.edges[0];
    const Vertex* v[3];
    for (std::uint32_t i = 0; i < 3; ++i) v[i] = &recording_->vertex(face, i, row.moment);
    const auto linear = [&](double a0, double a1, double a2) { return (r0 * a0 + r1 * a1 + r2 * a2) * seen.scale; };
    const auto over_row = [&](const Vec3& n) {
        return ImagePlane{f32(dot(n, row.ray_by_x)), 0.0F, f32(dot(n, row.ray))};
    };
    const Vec3 n = linear(1, 1, 1);
    const Vec3 nu = linear(static_cast<double>(v[0]->u), static_cast<double>(v[1]->u), static_cast<double>(v[2]->u));
    const Vec3 nv = linear(static_cast<double>(v[0]->v), static_cast<double>(v[1]->v), static_cast<double>(v[2]->v));
    out.inverse_depth = over_row(n);
    out.u = over_row(nu);
    out.v = over_row(nv);
    out.light = over_row(
        linear(static_cast<double>(v[0]->light), static_cast<double>(v[1]->light), static_cast<double>(v[2]->light)));
    const double area = dot(nu, cross(nv, n)) / (camera_.fx * camera_.fy);
    out.footprint = f32(area < 0 ? -area : area);
    out.normal_length = f32(length(n));
    return out;
}

void RowRenderer::shade_into(std::vector<float>& sum, float level_offset) {
    for (std::uint32_t y = 0; y < camera_.height; ++y) {
        const std::size_t row = static_cast<std::size_t>(y) * camera_.width;
        visit_runs(face_ids_.data() + row, camera_.width, [&](std::uint32_t id, std::uint32_t x, std::uint32_t end) {
            VisibleFace seen;
            if (id != kNoFace) seen = visible(*drawn_[id], rows_[y]);
            shade_run(id == kNoFace ? nullptr : &seen, {x, end, 0.0F}, level_offset, inverse_depth_.data() + row,
                      sum.data() + row);
        });
    }
}

}  // namespace stillmesh::simulated
