#include "hal/simulated/shadows.hpp"

#include <algorithm>

#include "hal/simulated/scene.hpp"

namespace stillmesh::simulated {
namespace {

constexpr double kRadius = 0.32;     // of a post; it ends softly
constexpr double kOfOneLamp = 0.15;  // lamps are wide and walls are bright: the rest of the light finds another way
constexpr double kSoftTop = 0.25;    // m

}  // namespace

double light_left(std::span<const Post> posts, const Vec3& point, double strength) noexcept {
    double light = 1;
    for (const double lx : {-1.5, 1.5}) {
        for (const double ly : {-1.2, 1.2}) {
            const double way_x = lx - point.x;
            const double way_y = ly - point.y;
            const double inverse = 1 / (way_x * way_x + way_y * way_y + 1e-6);
            double dark = 0;
            for (const Post& post : posts) {
                const double x = post.foot.x - point.x;
                const double y = post.foot.y - point.y;
                const double s = clamp01((x * way_x + y * way_y) * inverse);
                const double dx = x - s * way_x;
                const double dy = y - s * way_y;
                const double near = 1 - (dx * dx + dy * dy) * (1 / (kRadius * kRadius));
                if (near <= 0) continue;
                const double height = point.z + s * (kRoomHeight - point.z);
                dark = std::max(dark, near * clamp01((post.height + kSoftTop - height) * (1 / kSoftTop)));
            }
            light *= 1 - std::min(strength * kOfOneLamp, 0.9) * dark;
        }
    }
    return light;
}

}  // namespace stillmesh::simulated
