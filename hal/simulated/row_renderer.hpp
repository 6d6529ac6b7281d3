// Pictures whose rows are taken one after the other: each row has its own camera pose and finds what moves where it is
// at the row's own time. Nothing is warped: per row, a face is where the planes through the eye and its edges cut the
// row, and its depth and texture follow from its corners at that time, so that there are no steps between rows. What
// moves is recorded every few milliseconds and goes straight in between. Cost: some 2 to 3 times the renderer's.
#pragma once

#include <span>
#include <vector>

#include "hal/simulated/renderer.hpp"

namespace stillmesh::simulated {

// The faces of a world over a while.
class Recording final : public Canvas {
public:
    // Forgets everything; the moments [first_s, last_s] are to be recorded, in as many as count() passes, the moment of
    // each of which is moment_s(i): begin_pass(i), what moves drawn; begin_still(), what stands drawn. Each pass draws
    // the same faces.
    void begin(double first_s, double last_s);
    [[nodiscard]] std::uint32_t count() const noexcept { return static_cast<std::uint32_t>(moving_.size()); }
    [[nodiscard]] double moment_s(std::uint32_t i) const noexcept { return first_s_ + i * step_s_; }
    void begin_pass(std::uint32_t i) noexcept { pass_ = i; }
    void begin_still() noexcept { is_still_ = true; }
    void draw(const Vertex* vertices, std::uint32_t count, const Material& material) override;

    struct Face {
        Material material;
        std::uint32_t first = 0, count = 0;  // corners
        bool moves = false;
    };
    // Between two passes.
    struct Moment {
        std::uint32_t pass = 0;
        double share = 0;  // on the way to the next
    };
    [[nodiscard]] Moment at(double time_s) const noexcept;
    // Every pass drew as much as the first.
    [[nodiscard]] bool is_complete() const noexcept;
    [[nodiscard]] const std::vector<Face>& faces() const noexcept { return faces_; }
    [[nodiscard]] Vec3 corner(const Face& face, std::uint32_t i, const Moment& moment) const noexcept {
        if (!face.moves) return still_[face.first + i].p;
        const Vec3& a = moving_[moment.pass][face.first + i].p;
        return a + (moving_[moment.pass + 1][face.first + i].p - a) * moment.share;
    }
    // Its texture and light, without the place.
    [[nodiscard]] const Vertex& vertex(const Face& face, std::uint32_t i, const Moment& moment) const noexcept {
        return face.moves ? moving_[moment.pass][face.first + i] : still_[face.first + i];
    }

private:
    double first_s_ = 0, step_s_ = 0;
    std::uint32_t pass_ = 0;
    bool is_still_ = false;
    std::vector<Face> faces_;
    std::vector<Vertex> still_;
    std::vector<std::vector<Vertex>> moving_;  // per pass
};

// Where and when a row is taken.
struct RowPose {
    Rigid world_from_camera;
    double time_s = 0;
};

class RowRenderer final : public Picture {
public:
    explicit RowRenderer(const Pinhole& camera);

    // A picture of the recording, one pose for each row. The offset, in pixels, shifts the sampling points.
    void draw(const Recording& recording, std::span<const RowPose> poses, double offset_x, double offset_y);
    // As the renderer's.
    void shade_into(std::vector<float>& sum, float level_offset);
    // For the next pictures; of the same size.
    void set_camera(const Pinhole& camera);

private:
    struct Row {
        Rigid pose;
        Vec3 ray, ray_by_x;  // the ray of pixel x is ray + ray_by_x * x, in the world, of depth 1
        Recording::Moment moment;
    };
    // A face as a row sees it.
    struct Seen {
        Vec3 corners[8];  // from the eye
        Vec3 edges[8];    // normals of the planes through eye and edge
        double scale = 0;
    };
    struct RowRange {
        std::int32_t begin = 0, end = 0;
        bool is_near = false;  // part of it may be too near
    };

    [[nodiscard]] RowRange rows_of(const Recording::Face& face) const noexcept;
    [[nodiscard]] bool see(const Recording::Face& face, const Row& row, Seen& seen) const noexcept;
    void draw_face(const Recording::Face& face);
    [[nodiscard]] VisibleFace visible(const Recording::Face& face, const Row& row) const noexcept;

    const Recording* recording_ = nullptr;
    double cx_ = 0, cy_ = 0;
    std::vector<Row> rows_;
    std::vector<const Recording::Face*> drawn_;  // by id
};

}  // namespace stillmesh::simulated
