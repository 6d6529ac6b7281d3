// A stack of printed boxes on wheels, which is pushed through the view.
#include <algorithm>

#include "hal/simulated/world.hpp"

namespace stillmesh::simulated {

void World::add_trolley() {
    trolley_direction_ = random_.uniform() < 0.5 ? -1 : 1;
    trolley_pace_ = random_.uniform(0.9, 1.15);
    const Coat dark = coat(Pattern::kDark, 200);
    const Coat frame = coat(Pattern::kMetal, 300);
    add_box(trolley_, {0, 0, 0.14}, {0.45, 0.3, 0.025}, 0, frame, frame, true);
    for (const double x : {-0.38, 0.38}) {
        for (const double y : {-0.24, 0.24}) add_box(trolley_, {x, y, 0.06}, {0.05, 0.02, 0.06}, 0, dark, dark, true);
    }
    // Parcels and pictures in three layers, none quite in line with the others.
    double bottom = 0.165;
    for (int layer = 0; layer < 3; ++layer) {
        const double height = random_.uniform(0.38, 0.44);
        const double split = random_.uniform(-0.12, 0.12);
        for (const double s : {-1.0, 1.0}) {
            const double x0 = s < 0 ? -0.45 : split + 0.005;
            const double x1 = s < 0 ? split - 0.005 : 0.45;
            const double h = height - random_.uniform(0.0, 0.04);
            const double y = random_.uniform(-0.03, 0.03);
            const Coat cover = coat(random_.uniform() < 0.4 ? Pattern::kPoster : Pattern::kParcel, 0);
            add_box(trolley_, {(x0 + x1) / 2, y, bottom + h / 2}, {(x1 - x0) / 2, 0.27, h / 2}, 0, cover, cover, true);
        }
        bottom += height;
    }
}

double World::trolley_peak() const {
    Pinhole pinhole;
    pinhole.width = 64;
    pinhole.height = 48;
    pinhole.fx = 52.8;
    pinhole.fy = 52.8;
    pinhole.cx = 31.5;
    pinhole.cy = 23.5;
    Renderer renderer(pinhole);
    std::size_t peak = 0;
    for (int frame = 0; frame < 300; frame += 3) {
        const double time_s = frame / 30.0;
        renderer.begin(camera_.at(time_s), 0, 0);
        draw_trolley(renderer, time_s);
        const auto& ids = renderer.face_ids();
        peak = std::max(peak, ids.size() - static_cast<std::size_t>(std::count(ids.begin(), ids.end(), kNoFace)));
    }
    return static_cast<double>(peak) / (64.0 * 48.0);
}

void World::place_trolley() {
    // The camera's own sway decides how near is too near: the seed's nearest lane that leaves some of the room in
    // sight throughout. Always the first 10 s, so that a shorter run is the beginning of a longer one.
    const double most_of_the_picture = scene_.cast == Cast::kTrolleyReturns ? 0.95 : 0.80;
    constexpr double kStepM = 0.02;
    trolley_distance_m_ = 1.50;
    while (trolley_distance_m_ > 0.72 && trolley_peak() < most_of_the_picture) trolley_distance_m_ -= kStepM;
    if (trolley_peak() >= most_of_the_picture) trolley_distance_m_ += kStepM;
}

Rigid World::trolley_at(double time_s) const noexcept {
    // Across the view, about one metre before the camera, slower in the middle; back again after a rest.
    const Rigid eye = camera_.base_at(0);
    const Vec3 forward = normalised({eye.rotation.c.x, eye.rotation.c.y, 0});
    const Vec3 right{forward.y, -forward.x, 0};
    constexpr double kOutside = 2.05;  // m to the side: out of view
    double t = time_s;
    double s = 0;
    double nearer = 0;
    if (scene_.cast == Cast::kTrolleyFirst) {
        s = 0.35 * sine(0.55 * trolley_pace_ * t);
    } else if (scene_.cast == Cast::kTrolleyReturns) {
        // To and fro, to each side in 4 s, and meanwhile nearer and farther.
        constexpr double kSideS = 4.0;
        t = std::max(0.0, t - 3.0) * trolley_pace_;
        constexpr double kAside = 1.3;
        const double side = cosine(kPi * t / kSideS);
        const double cube = side * side * side;
        s = kAside * (0.15 * side + 0.85 * cube * side * side) + (kOutside - kAside) * (1 - clamp01(t));
        nearer = 0.15 * (1 - cosine(2 * kPi * t / 3.1));
    } else {
        constexpr double kPassS = 7.5;
        constexpr double kRestS = 2.0;
        t = std::max(0.0, t - 3.0) * trolley_pace_;
        double direction = -1;
        while (t > kPassS + kRestS) {
            t -= kPassS + kRestS;
            direction = -direction;
        }
        const double p = clamp01(t / kPassS) * 2 - 1;  // -1..1
        s = -direction * kOutside * (0.35 * p + 0.65 * p * p * p);
    }
    const Vec3 at = eye.translation + forward * (trolley_distance_m_ + nearer) + right * (s * trolley_direction_);
    return {rotation_z(arc_tangent2(right.y, right.x) + 0.12 * s), {at.x, at.y, 0}};
}

void World::draw_trolley(Canvas& canvas, double time_s) const {
    const Rigid pose = trolley_at(time_s);
    for (const Quad& quad : trolley_) {
        Vertex corners[4];
        for (int i = 0; i < 4; ++i) {
            corners[i] = quad.corners[i];
            corners[i].p = pose * quad.corners[i].p;
        }
        canvas.draw(corners, 4, quad.material);
    }
}

}  // namespace stillmesh::simulated
