// A lift that stands open to the room, shuts, and opens to the room of another floor: the same one, left for right.
#include <algorithm>

#include "hal/simulated/mirror.hpp"
#include "hal/simulated/world.hpp"

namespace stillmesh::simulated {
namespace {

// From (-kHalfX, kBack) to (kHalfX, kFront) on the floor; the camera sways about y = -1.45.
constexpr double kHalfX = 0.95, kBack = -2.3, kFront = -0.62, kHeight = 2.25, kDoorHalfX = 0.45, kDoorHeight = 2.05;

// 0 open, 1 shut.
double shut_at(double time_s) noexcept {
    const double p = time_s < kLiftOpens_s ? clamp01((time_s - kLiftCloses_s) / (kLiftShut_s - kLiftCloses_s))
                                           : 1 - clamp01((time_s - kLiftOpens_s) / (kLiftOpen_s - kLiftOpens_s));
    return p * p * (3 - 2 * p);
}

}  // namespace

void World::add_lift() {
    const Coat metal = coat(Pattern::kMetal, 250);
    const Coat wood = coat(Pattern::kWood, 350);
    const Coat carpet = coat(Pattern::kCarpet, 300);
    const Coat ceiling = coat(Pattern::kCeiling, 420);
    const double depth = kFront - kBack;
    add_quad(lift_, {-kHalfX, kFront, 0.01}, {2 * kHalfX, 0, 0}, {0, -depth, 0}, carpet);
    add_quad(lift_, {-kHalfX, kBack, kHeight}, {2 * kHalfX, 0, 0}, {0, depth, 0}, ceiling);
    add_quad(lift_, {-kHalfX, kBack, kHeight}, {0, depth, 0}, {0, 0, -kHeight}, wood);
    add_quad(lift_, {kHalfX, kFront, kHeight}, {0, -depth, 0}, {0, 0, -kHeight}, wood);
    add_quad(lift_, {kHalfX, kBack, kHeight}, {-2 * kHalfX, 0, 0}, {0, 0, -kHeight}, wood);
    // The front: beside the doors, and above them; a notice on each side, buttons on one.
    const double beside = kHalfX - kDoorHalfX;
    const double above = kHeight - kDoorHeight;
    for (const double x : {-kHalfX, kDoorHalfX})
        add_quad(lift_, {x, kFront, kHeight}, {beside, 0, 0}, {0, 0, -kHeight}, metal);
    add_quad(lift_, {-kDoorHalfX, kFront, kHeight}, {2 * kDoorHalfX, 0, 0}, {0, 0, -above}, metal);
    for (const double side : {-1.0, 1.0}) {
        const double x = side * (kDoorHalfX + beside / 2) - 0.17;
        add_quad(lift_, {x, kFront - 0.01, 1.75}, {0.34, 0, 0}, {0, 0, -0.48}, coat(Pattern::kPoster, 0));
        const Pattern below = side < 0 ? Pattern::kKeyboard : Pattern::kPaper;
        add_quad(lift_, {x + 0.06, kFront - 0.01, 1.2}, {0.22, 0, 0}, {0, 0, -0.3}, coat(below, 0));
    }
    for (const int i : {0, 1}) {
        const Coat panel = coat(Pattern::kDoor, 0);
        const double left = i == 0 ? -kDoorHalfX : 0.0;
        add_quad(lift_door_[i], {left, kFront + 0.03, kDoorHeight}, {kDoorHalfX, 0, 0}, {0, 0, -kDoorHeight}, panel);
        add_quad(lift_door_[i], {left + 0.06, kFront + 0.025, 1.8}, {0.33, 0, 0}, {0, 0, -0.45},
                 coat(Pattern::kPoster, 0));
        add_quad(lift_door_[i], {left + 0.1, kFront + 0.025, 1.2}, {0.25, 0, 0}, {0, 0, -0.33},
                 coat(Pattern::kPaper, 0));
    }
}

void World::draw_lift(Canvas& canvas, double time_s) const {
    const double shut = shut_at(time_s);
    for (const Quad& quad : lift_) canvas.draw(quad.corners, 4, quad.material);
    for (const int i : {0, 1}) {
        const double aside = (i == 0 ? -1.0 : 1.0) * (1 - shut) * (kDoorHalfX - 0.02);
        for (const Quad& quad : lift_door_[i]) {
            Vertex corners[4];
            for (int k = 0; k < 4; ++k) {
                corners[k] = quad.corners[k];
                corners[k].p.x += aside;
            }
            Material material = quad.material;
            material.is_dynamic = shut > 0 && shut < 1;
            canvas.draw(corners, 4, material);
        }
    }
    if (shut >= 1) return;
    Mirror other_floor(canvas, Mirror::Plane::kMiddle);
    Canvas& floor = time_s < kLiftOpens_s ? canvas : static_cast<Canvas&>(other_floor);
    for (const Quad& quad : quads_) floor.draw(quad.corners, 4, quad.material);
}

}  // namespace stillmesh::simulated
