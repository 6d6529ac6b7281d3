// A canvas that shows the room the other way round.
#pragma once

#include "engine/base/check.hpp"
#include "hal/simulated/renderer.hpp"
#include "hal/simulated/scene.hpp"

namespace stillmesh::simulated {

class Mirror final : public Canvas {
public:
    // kWallBefore: what stands in the room stands behind the wall before the camera, too. kMiddle: left is right.
    enum class Plane : std::uint8_t { kWallBefore, kMiddle };
    Mirror(Canvas& canvas, Plane plane) : canvas_(canvas), plane_(plane) {}
    void draw(const Vertex* vertices, std::uint32_t count, const Material& material) override {
        STILLMESH_CHECK(count <= 8);
        Vertex reflected[8];
        for (std::uint32_t i = 0; i < count; ++i) {
            reflected[i] = vertices[count - 1 - i];  // its other side is the front
            Vec3& p = reflected[i].p;
            if (plane_ == Plane::kWallBefore) p.y = 2 * kRoomHalfY - p.y;
            if (plane_ == Plane::kMiddle) p.x = -p.x;
        }
        canvas_.draw(reflected, count, material);
    }

private:
    Canvas& canvas_;
    Plane plane_;
};

}  // namespace stillmesh::simulated
