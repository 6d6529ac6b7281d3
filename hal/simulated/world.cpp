#include "hal/simulated/world.hpp"

#include <algorithm>

#include "hal/simulated/mirror.hpp"

namespace stillmesh::simulated {
namespace {

constexpr std::size_t kWallBefore = 2;  // of the quads: after floor and ceiling, the wall before the camera

}  // namespace

World::World(const Scene& scene, std::uint64_t seed, std::uint64_t day, double duration_s, const Dirt& dirt)
    : scene_(scene),
      day_(day),
      dirt_(dirt),
      random_(seed * 0x9e37'79b9ULL + 0x5ce'e0ffULL),
      side_(random_.uniform() < 0.5 ? -1.0 : 1.0),
      duration_s_(duration_s),
      camera_(scene.motion, side_, day) {
    if (scene.motion == CameraMotion::kCorridor) {
        build_corridor();
        return;
    }
    const Coat plain = coat(Pattern::kPlainWall, 200);
    const Coat carpet = coat(Pattern::kCarpet, 300);
    const Coat ceiling = coat(Pattern::kCeiling, 420);
    const double x = kRoomHalfX;
    const double y = kRoomHalfY;
    const double z = kRoomHeight;
    add_quad(quads_, {-x, y, 0}, {2 * x, 0, 0}, {0, -2 * y, 0}, carpet);
    add_quad(quads_, {-x, -y, z}, {2 * x, 0, 0}, {0, 2 * y, 0}, ceiling);
    const Wall walls[4] = {{{-x, y, 0}, {1, 0, 0}, {0, -1, 0}, 2 * x},  // before the camera
                           {{x, y, 0}, {0, -1, 0}, {-1, 0, 0}, 2 * y},
                           {{x, -y, 0}, {-1, 0, 0}, {0, 1, 0}, 2 * x},
                           {{-x, -y, 0}, {0, 1, 0}, {1, 0, 0}, 2 * y}};
    for (int i = 0; i < 4; ++i) {
        add_on_wall(walls[i], 0, 0, walls[i].width, z, 0, plain);
        furnish(walls[i], i == 0);
    }
    add_desk(desk_place(scene_, side_));
    if (scene.cast == Cast::kWalking) add_people(3);
    if (scene.cast == Cast::kSitting) add_people(2);
    if (scene.cast == Cast::kCrowd) add_people(2);
    if (scene.cast == Cast::kLift) add_lift();
    if (has_trolley(scene.cast)) {
        add_trolley();
        place_trolley();
    }
    if (scene.cast == Cast::kRearranged) add_movables();
    if (dirt.manners > 0) add_seats();
    if (dirt.things > 0) add_things();
}

float World::light_at(const Vec3& at, const Vec3& normal) const noexcept {
    Vec3 p = at;
    if (scene_.motion == CameraMotion::kCorridor) {  // every section has its own lamps
        while (p.x > kCorridorSection / 2) p.x -= kCorridorSection;
        while (p.x < -kCorridorSection / 2) p.x += kCorridorSection;
    }
    double sum = 0.58;
    for (const double lx : {-1.5, 1.5}) {
        for (const double ly : {-1.2, 1.2}) {
            const Vec3 way = Vec3{lx, ly, kRoomHeight - 0.05} - p;
            const double distance2 = dot(way, way) + 0.3;
            const double slant = dot(way, normal) / std::sqrt(distance2);
            sum += 1.1 * std::max(0.0, slant) / (distance2 + 1.5);
        }
    }
    return static_cast<float>(std::min(sum, 1.3));
}

World::Coat World::coat(Pattern pattern, double texels_per_m, Infrared infrared) {
    textures_.push_back(paint(pattern, random_.next()));
    return {&textures_.back(), texels_per_m, infrared};
}

void World::add_quad(std::vector<Quad>& to, const Vec3& top_left, const Vec3& right, const Vec3& down, const Coat& coat,
                     bool is_dynamic) {
    Quad quad;
    const Vec3 normal = normalised(cross(down, right));
    const double u =
        coat.texels_per_m > 0 ? length(right) * coat.texels_per_m : static_cast<double>(coat.texture->width);
    const double v =
        coat.texels_per_m > 0 ? length(down) * coat.texels_per_m : static_cast<double>(coat.texture->height);
    const Vec3 corners[4] = {top_left, top_left + right, top_left + right + down, top_left + down};
    for (int i = 0; i < 4; ++i) {
        quad.corners[i].p = corners[i];
        quad.corners[i].u = i == 1 || i == 2 ? static_cast<float>(u) : 0.0F;
        quad.corners[i].v = i >= 2 ? static_cast<float>(v) : 0.0F;
        quad.corners[i].light = light_at(corners[i], normal);
    }
    // Light is affine over a face: three corners decide.
    quad.material = {coat.texture, coat.infrared, is_dynamic};
    to.push_back(quad);
}

void World::add_box(std::vector<Quad>& to, const Vec3& centre, const Vec3& half, double yaw_rad, const Coat& front,
                    const Coat& rest, bool is_dynamic) {
    const Mat3 turn = rotation_z(yaw_rad);
    const Vec3 x = turn.a * half.x;
    const Vec3 y = turn.b * half.y;
    const Vec3 z{0, 0, half.z};
    add_quad(to, centre - x - y + z, x * 2, z * -2, front, is_dynamic);  // front: -y
    add_quad(to, centre + x + y + z, x * -2, z * -2, rest, is_dynamic);  // back
    add_quad(to, centre + x - y + z, y * 2, z * -2, rest, is_dynamic);   // right: +x
    add_quad(to, centre - x + y + z, y * -2, z * -2, rest, is_dynamic);  // left
    add_quad(to, centre - x + y + z, x * 2, y * -2, rest, is_dynamic);   // top
    add_quad(to, centre - x - y - z, x * 2, y * 2, rest, is_dynamic);    // bottom
}

void World::add_on_wall(const Wall& wall, double left, double bottom, double width, double height, double out,
                        const Coat& coat) {
    add_quad(quads_, wall.corner + wall.right * left + Vec3{0, 0, bottom + height} + wall.inward * out,
             wall.right * width, {0, 0, -height}, coat);
}

void World::add_box_at_wall(const Wall& wall, double left, double bottom, double width, double height, double depth,
                            const Coat& front, const Coat& rest) {
    const Vec3 centre = wall.corner + wall.right * (left + width / 2) + wall.inward * (depth / 2 + 0.005) +
                        Vec3{0, 0, bottom + height / 2};
    // The box's front is -y of its own: turn that inwards.
    const double yaw = arc_tangent2(wall.right.y, wall.right.x);
    add_box(quads_, centre, {width / 2, depth / 2, height / 2}, yaw, front, rest);
}

void World::add_shelf(const Wall& wall, double left, double width) {
    constexpr double kDepth = 0.30;
    const Coat board = coat(Pattern::kWood, 350);
    const double height = random_.uniform(1.7, 2.1);
    add_box_at_wall(wall, left, 0, 0.03, height, kDepth, board, board);
    add_box_at_wall(wall, left + width - 0.03, 0, 0.03, height, kDepth, board, board);
    constexpr int kRows = 5;
    const double pitch = (height - 0.06) / kRows;
    for (int i = 0; i <= kRows; ++i)
        add_box_at_wall(wall, left + 0.03, 0.02 + i * pitch, width - 0.06, 0.03, kDepth, board, board);
    for (int i = 0; i < kRows; ++i) {
        const double bottom = 0.05 + i * pitch;
        if (random_.uniform() < 0.2) {  // boxes instead of books
            const Coat box = coat(Pattern::kParcel, 0);
            add_box_at_wall(wall, left + 0.08, bottom, width * 0.35, pitch * 0.75, 0.24, box, box);
            const Coat other = coat(Pattern::kParcel, 0);
            add_box_at_wall(wall, left + width * 0.52, bottom, width * 0.35, pitch * 0.6, 0.2, other, other);
            add_on_wall(wall, left + 0.03, bottom, width - 0.06, pitch, 0.01, coat(Pattern::kDark, 100));
        } else {
            const double out = random_.uniform(0.2, 0.27);
            add_on_wall(wall, left + 0.03, bottom, width - 0.06, pitch - 0.03, out, coat(Pattern::kBooks, 0));
        }
    }
}

void World::furnish(const Wall& wall, bool is_seen_first) {
    // Slots of a bit over a metre, each with something of its own; one of them stays bare.
    const auto slots = static_cast<std::uint32_t>(wall.width / 1.2);
    const double pitch = wall.width / slots;
    const std::uint32_t bare = is_seen_first ? (random_.uniform() < 0.5 ? 0 : slots - 1) : random_.below(slots);
    if (is_seen_first) bare_left_m_ = bare * pitch + 0.06;
    std::uint32_t last = 99;
    for (std::uint32_t i = 0; i < slots; ++i) {
        const double left = i * pitch + 0.06;
        const double width = pitch - 0.12;
        if (i == bare && (scene_.motion != CameraMotion::kLoop || is_seen_first)) continue;
        std::uint32_t kind = random_.below(is_seen_first ? 4 : 6);
        if (kind == last) kind = (kind + 1) % 4;
        last = kind;
        switch (kind) {
            case 0: add_shelf(wall, left, std::min(width, 1.1)); break;
            case 1: {  // a cabinet with a poster above
                const Coat front = coat(Pattern::kMetal, 0);
                const double height = random_.uniform(0.9, 1.15);
                add_box_at_wall(wall, left, 0, width * 0.85, height, 0.42, front, coat(Pattern::kWood, 300));
                const double up = height + random_.uniform(0.12, 0.25);
                add_on_wall(wall, left + 0.1, up, 0.75, 0.75, 0.006, coat(Pattern::kPoster, 0));
                const Coat box = coat(Pattern::kParcel, 0);
                add_box_at_wall(wall, left + 0.05, height, 0.3, 0.22, 0.3, box, box);
                break;
            }
            case 2: {  // pinboard over a side desk
                add_on_wall(wall, left, 1.05, width, 0.95, 0.008, coat(Pattern::kPinboard, 0));
                const Coat wood = coat(Pattern::kWood, 350);
                add_box_at_wall(wall, left, 0.70, width, 0.04, 0.5, wood, wood);
                add_box_at_wall(wall, left, 0, 0.05, 0.70, 0.5, wood, wood);
                add_box_at_wall(wall, left + width - 0.05, 0, 0.05, 0.70, 0.5, wood, wood);
                const Coat box = coat(Pattern::kParcel, 0);
                add_box_at_wall(wall, left + 0.2, 0.74, 0.32, 0.2, 0.3, box, box);
                const Coat bin = coat(Pattern::kParcel, 0);
                add_box_at_wall(wall, left + 0.25, 0, 0.4, 0.4, 0.35, bin, bin);
                break;
            }
            case 3: {  // two or three posters
                const double first = random_.uniform(0.95, 1.25);
                add_on_wall(wall, left, first, 0.8, 0.9, 0.006, coat(Pattern::kPoster, 0));
                const double second = random_.uniform(0.3, 0.6);
                add_on_wall(wall, left + 0.25, first - 0.05 - second, second * 1.2, second, 0.006,
                            coat(Pattern::kPoster, 0));
                const Coat box = coat(Pattern::kParcel, 0);
                add_box_at_wall(wall, left + 0.1, 0, 0.35, 0.3, 0.3, box, box);
                break;
            }
            case 4: {
                const double notice = random_.uniform(1.05, 1.3);
                add_on_wall(wall, left, 0, 0.9, 2.05, 0.01, coat(Pattern::kDoor, 0));
                add_on_wall(wall, left + 0.16, notice, 0.45, 0.5, 0.015, coat(Pattern::kPoster, 0));
                break;
            }
            default: {
                add_on_wall(wall, left, 0.9, width, 0.9, 0.006, coat(Pattern::kPoster, 0));
                break;
            }
        }
    }
}

// Sections with the same doors, cabinets, signs and floors at nearly the same places, as corridors have; papers,
// parcels and every other picture are of each section alone, as they are too. Nowhere is like another, and everywhere
// nearly.
void World::build_corridor() {
    const Coat plain = coat(Pattern::kPlainWall, 200);
    const Coat carpet = coat(Pattern::kCarpet, 300);
    const Coat ceiling = coat(Pattern::kCeiling, 420);
    const Coat door = coat(Pattern::kDoor, 0);
    const Coat wood = coat(Pattern::kWood, 350);
    const Coat metal = coat(Pattern::kMetal, 0);
    const Coat sign = coat(Pattern::kPoster, 0);
    const Coat picture = coat(Pattern::kPoster, 0);
    const Coat parcel = coat(Pattern::kParcel, 0);
    const double h = kCorridorHalfY;
    const double length = kCorridorSection;
    constexpr int kSections = 9;  // two beyond the end of the way
    for (int i = -1; i < kSections; ++i) {
        const double begin = (i - 0.5) * length;
        add_quad(quads_, {begin, h, 0}, {length, 0, 0}, {0, -2 * h, 0}, carpet);
        add_quad(quads_, {begin, -h, kRoomHeight}, {length, 0, 0}, {0, 2 * h, 0}, ceiling);
        const Wall walls[2] = {{{begin, h, 0}, {1, 0, 0}, {0, -1, 0}, length},
                               {{begin + length, -h, 0}, {-1, 0, 0}, {0, 1, 0}, length}};
        for (const Wall& wall : walls) {
            add_on_wall(wall, 0, 0, length, kRoomHeight, 0, plain);
            const double at_door = 0.15 + random_.uniform(0.0, 0.1);
            add_on_wall(wall, at_door, 0, 0.9, 2.05, 0.01, door);
            add_on_wall(wall, at_door + 0.16, 1.2, 0.45, 0.5, 0.015, sign);
            const double at_cabinet = 1.3 + random_.uniform(0.0, 0.1);
            add_box_at_wall(wall, at_cabinet, 0, 0.9, 1.0, 0.3, metal, wood);
            add_box_at_wall(wall, at_cabinet + 0.1, 1.0, 0.3, 0.22, 0.25, parcel, parcel);
            const Coat own_parcel = coat(Pattern::kParcel, 0);
            const double at_parcel = at_cabinet + 0.5 + random_.uniform(0.0, 0.1);
            add_box_at_wall(wall, at_parcel, 1.0, 0.25, 0.18, 0.2, own_parcel, own_parcel);
            add_on_wall(wall, at_cabinet + 0.1, 1.35, 0.7, 0.7, 0.006, picture);
            const double at_board = 2.5 + random_.uniform(0.0, 0.15);
            const Coat board = coat(i % 2 == 0 ? Pattern::kPinboard : Pattern::kPoster, 0);
            add_on_wall(wall, at_board, 1.05, 1.2, 0.95, 0.008, board);
            add_box_at_wall(wall, at_board, 0.45, 1.2, 0.04, 0.3, wood, wood);
            add_box_at_wall(wall, at_board + 0.2, 0.49, 0.35, 0.25, 0.25, parcel, parcel);
        }
    }
    const Wall ends[2] = {{{(kSections - 0.5) * length, h, 0}, {0, -1, 0}, {-1, 0, 0}, 2 * h},
                          {{-1.5 * length, -h, 0}, {0, 1, 0}, {1, 0, 0}, 2 * h}};
    for (const Wall& wall : ends) {
        add_on_wall(wall, 0, 0, wall.width, kRoomHeight, 0, plain);
        add_on_wall(wall, 0.75, 0.9, 0.9, 0.9, 0.006, picture);
    }
}

void World::add_monitor(double x, double y, double z, double yaw_rad) {
    const Coat dark = coat(Pattern::kDark, 200, Infrared::kPoor);
    const Coat screen = coat(Pattern::kScreen, 0, Infrared::kBad);
    add_box(quads_, {x, y, z + 0.27}, {0.26, 0.025, 0.17}, yaw_rad, dark, dark);
    const Mat3 turn = rotation_z(yaw_rad);
    add_quad(dirt_.things > 0 ? screens_ : quads_, Vec3{x, y, z + 0.425} - turn.a * 0.24 - turn.b * 0.028,
             turn.a * 0.48, {0, 0, -0.3}, screen);
    add_box(quads_, {x, y, z + 0.05}, {0.03, 0.02, 0.05}, yaw_rad, dark, dark);
    add_box(quads_, {x, y, z + 0.01}, {0.12, 0.09, 0.01}, yaw_rad, dark, dark);
}

void World::add_chair(double x, double y, double yaw_rad) {
    const Coat cloth = coat(Pattern::kTrousers, 300);
    const Coat dark = coat(Pattern::kDark, 200, Infrared::kPoor);
    const Mat3 turn = rotation_z(yaw_rad);
    const Vec3 at{x, y, 0};
    add_box(quads_, at + Vec3{0, 0, 0.44}, {0.22, 0.22, 0.03}, yaw_rad, cloth, cloth);
    add_box(quads_, at + turn.b * 0.22 + Vec3{0, 0, 0.75}, {0.2, 0.025, 0.2}, yaw_rad, cloth, cloth);
    add_box(quads_, at + Vec3{0, 0, 0.22}, {0.03, 0.03, 0.2}, yaw_rad, dark, dark);
    add_box(quads_, at + Vec3{0, 0, 0.04}, {0.22, 0.22, 0.02}, yaw_rad, dark, dark);
}

void World::add_desk(const DeskPlace& place) {
    constexpr double kTop = 0.73;
    const Coat wood = coat(Pattern::kWood, 450);
    const Coat side = coat(Pattern::kMetal, 300);
    const double hx = place.half_x;
    const double hy = place.half_y;
    const Vec3 centre{place.x, place.y, 0};
    add_box(quads_, centre + Vec3{0, 0, kTop - 0.02}, {hx, hy, 0.02}, 0, wood, wood);
    for (const double sx : {-1.0, 1.0}) {
        add_box(quads_, centre + Vec3{sx * (hx - 0.22), 0, (kTop - 0.04) / 2}, {0.2, hy - 0.05, (kTop - 0.04) / 2}, 0,
                side, side);
    }
    // On the desk: screens at the back, keyboards before them, paper, books and parcels where there is room.
    for (const double sx : {-0.5, 0.5}) {
        const double x = place.x + sx * hx * 1.05;
        const double yaw = -sx * random_.uniform(0.1, 0.4);
        add_monitor(x, place.y + hy * 0.45, kTop, yaw);
        const double keyboard_yaw = random_.uniform(-0.15, 0.15);
        const Coat dark = coat(Pattern::kDark, 200);
        const Coat keys = coat(Pattern::kKeyboard, 0);
        add_box(quads_, {x, place.y - hy * 0.35, kTop + 0.012}, {0.21, 0.075, 0.012}, keyboard_yaw, dark, keys);
    }
    for (int i = 0; i < 7; ++i) {
        const double x = place.x + random_.uniform(-0.85, 0.85) * hx;
        const double y = place.y + random_.uniform(-0.85, 0.3) * hy;
        const Mat3 turn = rotation_z(random_.uniform(-0.6, 0.6));
        add_quad(quads_, Vec3{x, y, kTop + 0.003 + 0.001 * i} - turn.a * 0.1 + turn.b * 0.14, turn.a * 0.2,
                 turn.b * -0.28, coat(Pattern::kPaper, 0));
    }
    for (int i = 0; i < 6; ++i) {
        const double x = place.x + random_.uniform(-0.9, 0.9) * hx;
        const double y =
            place.y + (random_.uniform() < 0.6 ? random_.uniform(0.55, 0.85) : random_.uniform(-0.9, -0.6)) * hy;
        const double yaw = random_.uniform(-0.7, 0.7);
        const double half_x = random_.uniform(0.06, 0.13);
        const double half_y = random_.uniform(0.05, 0.1);
        const double half_z = random_.uniform(0.02, 0.09);
        const Coat cover = coat(random_.uniform() < 0.5 ? Pattern::kPoster : Pattern::kParcel, 0);
        add_box(quads_, {x, y, kTop + half_z}, {half_x, half_y, half_z}, yaw, cover, cover);
    }
}

void World::add_people(std::uint32_t count) {
    random_ = Random(day_ * 0x2545'f491ULL + 0x9e09'1eULL);  // whatever stands about changes nobody's way
    const DeskPlace desk = desk_place(scene_, side_);
    people_.resize(count);
    for (Person& person : people_) {
        person.height_m = random_.uniform(1.62, 1.9);
        person.girth = random_.uniform(0.95, 1.15);
        const auto wear = [&](Pattern pattern) { return Material{coat(pattern, 0).texture, Infrared::kGood, true}; };
        person.shirt = wear(Pattern::kCloth);
        person.trousers = wear(Pattern::kTrousers);
        person.skin = wear(Pattern::kSkin);
        person.face = wear(Pattern::kFace);
        person.shoes = wear(Pattern::kDark);
    }
    const std::uint64_t seed = random_.next();
    if (dirt_.manners > 0) {
        constexpr Manner kManners[] = {Manner::kComesClose, Manner::kStandsStill, Manner::kSitsFirst};
        const bool is_walking = scene_.cast == Cast::kWalking;
        for (std::size_t i = 0; i < people_.size(); ++i) {
            people_[i].manner = is_walking ? kManners[i % 3] : (i == 0 ? Manner::kSitsFirst : Manner::kNone);
            people_[i].manner_scale = dirt_.manners;
        }
    }
    if (scene_.cast == Cast::kCrowd) {
        const Lane before_the_camera[] = {{0.6, 0.72, -0.4, 0.1, 0.55, 0.5}, {0.62, 0.8, -0.1, 0.4, 0.55, 0.5}};
        plan_walks(people_, before_the_camera, camera_, {{desk.x, desk.y, desk.half_x, desk.half_y}}, duration_s_,
                   seed);
        return;
    }
    if (scene_.cast == Cast::kWalking) {
        // The first close enough to hide much of the room, the others where the desk leaves room.
        const double a = side_ > 0 ? -0.42 : -0.08;  // the side without the desk
        const double b = side_ > 0 ? 0.08 : 0.42;
        const Lane room[] = {{0.95, 1.06, -0.36, 0.36}, {1.45, 1.7, a, b}, {2.5, 2.7, -0.42, 0.42}};
        const Lane round_desk[] = {{0.92, 1.05, -0.4, 0.4}, {2.2, 2.4, -0.5, 0.1}, {2.4, 2.7, -0.1, 0.5}};
        const Lane on_the_way[] = {{0.96, 1.1, -0.38, 0.38}, {1.55, 1.8, -0.42, 0.42}, {2.2, 2.7, -0.5, 0.5}};
        const std::span<const Lane> lanes = scene_.motion == CameraMotion::kHalfsphere ? round_desk
                                            : scene_.motion == CameraMotion::kLoop     ? on_the_way
                                                                                       : room;
        plan_walks(people_, lanes, camera_, {{desk.x, desk.y, desk.half_x, desk.half_y}}, duration_s_, seed);
        return;
    }
    // At the desk's far side and at its end, turned to each other and to the camera.
    // x, y and where they look.
    const bool is_round = scene_.motion == CameraMotion::kHalfsphere;
    const double beside = desk.x - side_ * (desk.half_x + (is_round ? 0.25 : 0.4));
    const Vec3 seats[2] = {
        {is_round ? desk.x + side_ * (desk.half_x + 0.2) : desk.x - 0.35 * side_, desk.y + desk.half_y + 0.35,
         radians(-90)},
        {beside, is_round ? desk.y + desk.half_y + 0.2 : desk.y - 0.05, side_ > 0 ? radians(-30) : radians(210)}};
    for (std::uint32_t i = 0; i < std::min(count, 2U); ++i) {
        const double heading = seats[i].z + random_.uniform(-0.4, 0.4);
        // The chair's back is +y of its own; the person looks along -y of the chair.
        add_chair(seats[i].x, seats[i].y, heading + kPi / 2);
        plan_sitting(people_[i], seats[i].x, seats[i].y, heading, duration_s_, seed + i);
    }
}

// A crate and an armchair on the free side of the floor, both in view from the first frame to the last. The chair goes
// first, nearer and aside; then the crate goes to where the chair stood, and leaves bare floor.
void World::add_movables() {
    const auto yaw = [&] { return random_.uniform(-0.3, 0.3); };
    const auto near_to = [&](double x, double y) {
        return Vec3{side_ * x + random_.uniform(-0.05, 0.05), y + random_.uniform(-0.04, 0.04), 0};
    };
    Movable chair;
    const Coat cloth = coat(Pattern::kCloth, 420);
    const Coat cushion = coat(Pattern::kPoster, 0);
    add_box(chair.quads, {0, 0, 0.2}, {0.28, 0.28, 0.2}, 0, cloth, cloth);
    add_box(chair.quads, {0, -0.05, 0.43}, {0.2, 0.2, 0.03}, 0, cushion, cushion);
    add_box(chair.quads, {0, 0.22, 0.63}, {0.28, 0.06, 0.23}, 0, cloth, cloth);
    chair.from = near_to(-0.45, 1.6);
    chair.to = near_to(-0.8, 0.92);
    chair.yaw_rad = yaw();
    chair.turn_rad = random_.uniform(0.5, 1.0) * (random_.uniform() < 0.5 ? -1 : 1);
    chair.begin_s = 2.0;
    chair.end_s = 3.2;
    movables_.push_back(chair);
    Movable crate;
    const Coat front = coat(Pattern::kPoster, 0);
    const Coat rest = coat(Pattern::kParcel, 0);
    add_box(crate.quads, {0, 0, 0.23}, {0.3, 0.22, 0.23}, 0, front, rest);
    crate.from = near_to(-0.05, 1.12);
    crate.to = near_to(-0.5, 1.62);
    crate.yaw_rad = yaw();
    crate.turn_rad = yaw();
    crate.begin_s = 3.5;
    crate.end_s = 4.5;
    movables_.push_back(crate);
}

void World::add_seats() {
    random_ = Random(day_ ^ 0x7365'6174ULL);
    for (const Person& person : people_) {
        if (person.manner != Manner::kSitsFirst || person.is_sitting) continue;
        const BodyState seat = person.at(0);
        const Coat cloth = coat(Pattern::kCloth, 420);
        add_box(quads_, {seat.x, seat.y, 0.22}, {0.2, 0.2, 0.22}, seat.heading_rad, cloth, cloth);
    }
}

void World::add_things() {
    random_ = Random(day_ ^ 0x7468'696e'6773ULL);
    Movable chair;
    const Coat cloth = coat(Pattern::kCloth, 420);
    const Coat dark = coat(Pattern::kDark, 200);
    add_box(chair.quads, {0, 0, 0.44}, {0.22, 0.22, 0.03}, 0, cloth, cloth);
    add_box(chair.quads, {0, 0.22, 0.75}, {0.2, 0.025, 0.2}, 0, cloth, cloth);
    add_box(chair.quads, {0, 0, 0.22}, {0.03, 0.03, 0.2}, 0, dark, dark);
    add_box(chair.quads, {0, 0, 0.04}, {0.22, 0.22, 0.02}, 0, dark, dark);
    chair.from = {side_ * random_.uniform(-0.55, -0.4), random_.uniform(0.9, 1.1), 0};
    chair.to = {side_ * random_.uniform(-1.2, -1.0), random_.uniform(1.3, 1.5), 0};
    chair.yaw_rad = random_.uniform(-0.4, 0.4);
    chair.turn_rad = random_.uniform(0.6, 1.2);
    chair.begin_s = random_.uniform(2.5, 3.5);
    chair.end_s = chair.begin_s + 0.8;
    movables_.push_back(chair);
    if (random_.uniform() < 0.5) {
        add_door();
    } else {
        add_mirror();
    }
}

// In the bare part of the wall, hinged at its left, with the dark of another room behind.
void World::add_door() {
    constexpr double kWidth = 0.9;
    constexpr double kHeight = 2.0;
    const Coat dark = coat(Pattern::kDark, 200);
    const Coat front = coat(Pattern::kDoor, 0);
    const Vec3 hinge{-kRoomHalfX + bare_left_m_, kRoomHalfY - 0.03, 0};
    add_quad(quads_, hinge + Vec3{0, 0.02, kHeight}, {kWidth, 0, 0}, {0, 0, -kHeight}, dark);
    Movable door;
    add_box(door.quads, {kWidth / 2, 0, kHeight / 2}, {kWidth / 2, 0.02, kHeight / 2}, 0, front, front);
    door.from = door.to = hinge;
    door.turn_rad = -random_.uniform(0.9, 1.3);
    door.begin_s = random_.uniform(5.0, 6.0);
    door.end_s = door.begin_s + 1.5;
    movables_.push_back(door);
}

// A hole in the bare part of the wall, behind which the room stands once more, the other way round. Whoever is in the
// room sees it through the hole alone.
void World::add_mirror() {
    constexpr double kLeft = 0.1, kWidth = 0.8, kBottom = 0.5, kHeight = 1.4;
    const Quad wall = quads_[kWallBefore];
    // A part of it, from one corner to the other in shares of the wall.
    const auto part = [&](double u0, double v0, double u1, double v1) {
        Quad out = wall;
        const auto at = [&](double u, double v) {
            const Vertex& o = wall.corners[0];
            const Vertex& right = wall.corners[1];
            const Vertex& down = wall.corners[3];
            const auto mixed = [&](float a, float b, float c) {
                const double along = static_cast<double>(b - a) * u;
                return static_cast<float>(static_cast<double>(a) + along + static_cast<double>(c - a) * v);
            };
            return Vertex{o.p + (right.p - o.p) * u + (down.p - o.p) * v, mixed(o.u, right.u, down.u),
                          mixed(o.v, right.v, down.v), mixed(o.light, right.light, down.light)};
        };
        out.corners[0] = at(u0, v0);
        out.corners[1] = at(u1, v0);
        out.corners[2] = at(u1, v1);
        out.corners[3] = at(u0, v1);
        return out;
    };
    const double left = (bare_left_m_ + kLeft) / (2 * kRoomHalfX);
    const double right = left + kWidth / (2 * kRoomHalfX);
    const double top = 1 - (kBottom + kHeight) / kRoomHeight;
    const double bottom = 1 - kBottom / kRoomHeight;
    quads_[kWallBefore] = part(0, 0, left, 1);
    quads_.push_back(part(right, 0, 1, 1));
    quads_.push_back(part(left, 0, right, top));
    quads_.push_back(part(left, bottom, right, 1));
    const Coat frame = coat(Pattern::kDark, 200);
    const double x = -kRoomHalfX + bare_left_m_ + kLeft;
    for (const double at : {x, x + kWidth}) {
        add_box(quads_, {at, kRoomHalfY - 0.012, kBottom + kHeight / 2}, {0.02, 0.012, kHeight / 2}, 0, frame, frame);
    }
    for (const double at : {kBottom, kBottom + kHeight}) {
        add_box(quads_, {x + kWidth / 2, kRoomHalfY - 0.012, at}, {kWidth / 2, 0.012, 0.02}, 0, frame, frame);
    }
    has_mirror_ = true;
}

void World::draw_screens(Canvas& canvas, double time_s) const {
    // A film: another picture ten times a second, the texture's own from elsewhere.
    const auto picture = static_cast<std::uint32_t>(floor_clamped(time_s * 10, -1000, 100'000'000) + 1000);
    Random random(picture * 0x9e37'79b9ULL + day_);
    for (const Quad& quad : screens_) {
        Vertex corners[4];
        const auto u = static_cast<float>(random.uniform(0, 256));
        const auto v = static_cast<float>(random.uniform(0, 256));
        for (int i = 0; i < 4; ++i) {
            corners[i] = quad.corners[i];
            corners[i].u += u;
            corners[i].v += v;
        }
        canvas.draw(corners, 4, quad.material);
    }
}

void World::find_posts(double time_s, std::vector<Post>& posts) const {
    posts.clear();
    for (const Person& person : people_) {
        const BodyState b = person.at(time_s);
        const double seated = person.is_sitting ? 1 - b.change : b.change;
        posts.push_back({{b.x, b.y, 0}, mix(person.height_m, 0.72 * person.height_m, seated)});
    }
}

void World::draw_movable(Canvas& canvas, const Movable& movable, double time_s) {
    const double p = clamp01((time_s - movable.begin_s) / (movable.end_s - movable.begin_s));
    const double s = p * p * (3 - 2 * p);
    const Rigid pose{rotation_z(movable.yaw_rad + s * movable.turn_rad), mix(movable.from, movable.to, s)};
    for (const Quad& quad : movable.quads) {
        Vertex corners[4];
        for (int i = 0; i < 4; ++i) {
            corners[i] = quad.corners[i];
            corners[i].p = pose * quad.corners[i].p;
        }
        Material material = quad.material;
        material.is_dynamic = p > 0 && p < 1;
        canvas.draw(corners, 4, material);
    }
}

void World::draw_bodies(Canvas& canvas, double time_s) const {
    for (const Movable& movable : movables_) draw_movable(canvas, movable, time_s);
    for (const Person& person : people_) draw_person(canvas, person, time_s, dirt_.folds);
    if (!trolley_.empty()) draw_trolley(canvas, time_s);
    draw_screens(canvas, time_s);
    if (!lift_.empty()) draw_lift(canvas, time_s);
}

void World::draw_moving(Canvas& canvas, double time_s) const {
    draw_bodies(canvas, time_s);
    if (!has_mirror_) return;
    Mirror mirror(canvas, Mirror::Plane::kWallBefore);
    draw_bodies(mirror, time_s);
}

void World::draw_still(Canvas& canvas) const {
    if (!lift_.empty()) return;  // what is seen through its doors changes
    for (const Quad& quad : quads_) canvas.draw(quad.corners, 4, quad.material);
    if (!has_mirror_) return;
    Mirror mirror(canvas, Mirror::Plane::kWallBefore);
    for (const Quad& quad : quads_) mirror.draw(quad.corners, 4, quad.material);
}

void World::draw(Canvas& canvas, double time_s) const {
    draw_moving(canvas, time_s);
    draw_still(canvas);
}

}  // namespace stillmesh::simulated
