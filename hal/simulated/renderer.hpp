// A small software renderer: convex planar faces go through a z-buffer that keeps the nearest face of each pixel, then
// every visible pixel is shaded once (grey texture, bilinear, mip level by the area of the pixel's footprint). Pictures
// drawn at several instants of the exposure, each shifted by a part of a pixel, add up to motion blur and smooth edges.
// Single precision in the pixel loops, in source order: same bits on every processor. Cost: some 8 ms for one pass over
// 640x480.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/simulated/texture.hpp"
#include "hal/simulated/vector3.hpp"

namespace stillmesh::simulated {

// How a surface answers the infrared light of the depth sensor.
enum class Infrared : std::uint8_t { kGood, kPoor, kBad };

struct Material {
    const Texture* texture = nullptr;
    Infrared infrared = Infrared::kGood;
    bool is_dynamic = false;  // belongs to a moving body
};

struct Vertex {
    Vec3 p;       // world, m
    float u = 0;  // texels of level 0
    float v = 0;
    float light = 1;  // factor on the texture
};

// Linear over the image: value = a x + b y + c.
struct ImagePlane {
    float a = 0, b = 0, c = 0;
};

// A face as seen in the current picture; all but the inverse depth are divided by depth.
struct VisibleFace {
    ImagePlane inverse_depth, u, v, light;
    float footprint = 0;      // texels^2 per pixel = footprint * z^3
    float normal_length = 0;  // of n in n . p = 1, camera frame
    Material material;
};

inline constexpr std::uint32_t kNoFace = 0xffffffffU;

struct Pinhole {
    std::uint32_t width = 0, height = 0;
    double fx = 0, fy = 0, cx = 0, cy = 0;
};

// Takes faces: a renderer, or a recording of them.
class Canvas {
public:
    // Convex, planar, counter-clockwise seen from its front; 3 <= count <= 8. u, v and light are affine over it.
    virtual void draw(const Vertex* vertices, std::uint32_t count, const Material& material) = 0;

protected:
    ~Canvas() = default;
};

// What was drawn: the nearest face of each pixel and its depth.
class Picture {
public:
    explicit Picture(const Pinhole& camera);

    // Of the current picture, row by row; 0 and kNoFace where nothing was drawn.
    [[nodiscard]] const std::vector<float>& inverse_depth() const noexcept { return inverse_depth_; }
    [[nodiscard]] const std::vector<std::uint32_t>& face_ids() const noexcept { return face_ids_; }
    [[nodiscard]] const VisibleFace& face(std::uint32_t id) const noexcept { return faces_[id]; }
    [[nodiscard]] const Pinhole& camera() const noexcept { return camera_; }

protected:
    void clear();
    void fill_row(std::uint32_t y, std::int32_t x_begin, std::int32_t x_end, const ImagePlane& plane,
                  std::uint32_t id) noexcept;

    Pinhole camera_;
    std::vector<float> inverse_depth_;
    std::vector<std::uint32_t> face_ids_;
    std::vector<VisibleFace> faces_;
};

inline constexpr double kNearM = 0.08;  // nearer is clipped

class Renderer final : public Picture, public Canvas {
public:
    explicit Renderer(const Pinhole& camera);

    // Starts a picture. The offset, in pixels, shifts the sampling points.
    void begin(const Rigid& world_from_camera, double offset_x, double offset_y);
    void draw(const Vertex* vertices, std::uint32_t count, const Material& material) override;
    // Adds the grey of every pixel (0..255) to `sum`. `level_offset` in [0, 1) moves the switch between mip levels.
    void shade_into(std::vector<float>& sum, float level_offset);

private:
    Rigid world_from_camera_;
    double cx_ = 0, cy_ = 0;                    // with the offset
    std::vector<double> span_low_, span_high_;  // of the face being drawn, per row
};

}  // namespace stillmesh::simulated
