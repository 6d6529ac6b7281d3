#include "hal/simulated/person.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"

namespace stillmesh::simulated {
namespace {

constexpr double kStepsPerSecond = 60.0;
constexpr double kPrerollS = 8.0;  // people are on their way before the first frame

// Radii of a tube at `s` of its length.
struct Ring {
    double s, r1, r2;
};

// Folds of cloth: how far out the surface lies, m, at a place along and around a tube. They wander.
struct Folds {
    double amplitude = 0;  // m; 0: none
    double phase = 0;

    [[nodiscard]] double at(double along_m, double share_around) const noexcept {
        const double slant = 2 * kPi * share_around;
        return amplitude * (0.6 * sine(2 * kPi * along_m / 0.14 + slant + phase) +
                            0.4 * sine(2 * kPi * along_m / 0.23 - 2 * slant + 0.7 * phase));
    }
};
constexpr double kFoldStepM = 0.035;  // rings of folded cloth: four a wave

constexpr std::uint32_t kFineRingsMax = 64;

// Rings in between, close enough for folds. The number depends on the tube alone, not on how it bends.
std::uint32_t refine(const Ring* rings, std::uint32_t count, double tube_length, Ring* fine) noexcept {
    std::uint32_t out = 0;
    fine[out++] = rings[0];
    for (std::uint32_t i = 0; i + 1 < count; ++i) {
        const double way = (rings[i + 1].s - rings[i].s) * tube_length;
        const auto steps = static_cast<std::uint32_t>(floor_clamped(way / kFoldStepM + 1.01, 1, 8));
        for (std::uint32_t k = 1; k <= steps; ++k) {
            const double share = static_cast<double>(k) / steps;
            fine[out++] = {mix(rings[i].s, rings[i + 1].s, share), mix(rings[i].r1, rings[i + 1].r1, share),
                           mix(rings[i].r2, rings[i + 1].r2, share)};
        }
    }
    return out;
}

// A closed tube from `from` to `to`; `e1` is where its first radius points (made perpendicular).
void draw_tube(Canvas& canvas, const Vec3& from, const Vec3& to, const Vec3& e1_hint, const Ring* rings,
               std::uint32_t ring_count, std::uint32_t segments, double texels_per_m, bool fits_texture,
               const Material& material, const Folds& folds = {}) {
    constexpr std::uint32_t kSegmentsMax = 20;
    const Vec3 axis = normalised(to - from);
    const double tube_length = length(to - from);
    const Vec3 e1 = normalised(e1_hint - axis * dot(axis, e1_hint));
    const Vec3 e2 = cross(axis, e1);
    double radius_max = 0;
    for (std::uint32_t i = 0; i < ring_count; ++i) radius_max = std::max(radius_max, (rings[i].r1 + rings[i].r2) / 2);
    const double around =
        fits_texture ? static_cast<double>(material.texture->width) : 2 * kPi * radius_max * texels_per_m;
    const double along = fits_texture ? static_cast<double>(material.texture->height) : tube_length * texels_per_m;
    Vertex before[kSegmentsMax + 1];
    Vertex now[kSegmentsMax + 1];
    Ring fine[kFineRingsMax];
    if (folds.amplitude > 0) {
        ring_count = refine(rings, ring_count, tube_length, fine);
        rings = fine;
    }
    for (std::uint32_t i = 0; i < ring_count; ++i) {
        const Ring& ring = rings[i];
        const Vec3 centre = mix(from, to, ring.s);
        for (std::uint32_t j = 0; j <= segments; ++j) {
            const double share = static_cast<double>(j) / segments;
            const double c = cosine(2 * kPi * share);
            const double s = sine(2 * kPi * share);
            const Vec3 normal = normalised(e1 * (c * ring.r2) + e2 * (s * ring.r1) + axis * ((ring.s - 0.5) * 0.05));
            Vertex& vertex = now[j];
            vertex.p = centre + e1 * (c * ring.r1) + e2 * (s * ring.r2);
            vertex.u = static_cast<float>(share * around);
            vertex.v = static_cast<float>((fits_texture ? 1 - ring.s : ring.s) * along);
            // Lamps at the ceiling: from above and a little from the side.
            vertex.light = static_cast<float>(0.78 + 0.22 * normal.z + 0.12 * normal.x - 0.06 * normal.y);
            if (folds.amplitude > 0 && ring.r1 > 0.02) {
                const double out = folds.at(ring.s * tube_length, share);
                vertex.p = vertex.p + normal * out;
                vertex.light *= static_cast<float>(1 + 10 * out);  // a valley of 8 mm is a tenth darker
            }
        }
        if (i > 0) {
            for (std::uint32_t j = 0; j < segments; ++j) {
                const Vertex upper[3] = {before[j + 1], before[j], now[j]};
                const Vertex lower[3] = {before[j + 1], now[j], now[j + 1]};
                canvas.draw(upper, 3, material);
                canvas.draw(lower, 3, material);
            }
        }
        std::copy(now, now + segments + 1, before);
    }
}

void draw_limb(Canvas& canvas, const Vec3& from, const Vec3& to, const Vec3& side, double r_from, double r_to,
               const Material& material, const Folds& folds = {}) {
    const double rounding = std::min(0.45, r_from / length(to - from));
    const Ring rings[] = {{-rounding * 0.8, 0.0, 0.0},
                          {-rounding * 0.5, r_from * 0.75, r_from * 0.75},
                          {0.02, r_from, r_from},
                          {0.55, r_from * 0.45 + r_to * 0.6, r_from * 0.45 + r_to * 0.6},
                          {1.0, r_to, r_to},
                          {1.0 + rounding * 0.4, r_to * 0.7, r_to * 0.7},
                          {1.0 + rounding * 0.6, 0.0, 0.0}};
    draw_tube(canvas, from, to, side, rings, 7, 10, 420, false, material, folds);
}

// A leg: hip angle forwards, knee bent backwards.
struct Leg {
    double hip, knee;
};

[[nodiscard]] double wrap(double angle) noexcept {
    while (angle > kPi) angle -= 2 * kPi;
    while (angle < -kPi) angle += 2 * kPi;
    return angle;
}

}  // namespace

BodyState Person::at(double time_s) const noexcept {
    const double step = (time_s - first_s) * kStepsPerSecond;
    const auto i = static_cast<std::size_t>(floor_clamped(step, 0, static_cast<std::int32_t>(states.size()) - 2));
    const double s = clamp01(step - static_cast<double>(i));
    const BodyState& a = states[i];
    const BodyState& b = states[i + 1];
    return {mix(a.x, b.x, s),
            mix(a.y, b.y, s),
            mix(a.heading_rad, b.heading_rad, s),
            mix(a.stride_phase, b.stride_phase, s),
            mix(a.stride, b.stride, s),
            mix(a.gesture_left, b.gesture_left, s),
            mix(a.gesture_right, b.gesture_right, s),
            mix(a.gesture_phase, b.gesture_phase, s),
            mix(a.change, b.change, s)};
}

void plan_walks(std::vector<Person>& people, std::span<const Lane> lanes, const CameraPath& camera,
                const std::vector<Obstacle>& obstacles, double duration_s, std::uint64_t seed) {
    STILLMESH_CHECK(lanes.size() >= people.size());
    struct Walker {
        Vec3 p, v, target;
        double heading = 0, phase = 0, stride = 0, pace = 1, until = -1e9, stop_until = -1e9, gesture_phase = 0;
        double gesture_left = 0, gesture_right = 0, enters_s = -1e9;
        double side = 1, enters_side = 1;
        Lane lane;
        bool gestures_left = false, gestures_right = false;
        double change = 0;
        bool is_close = false;  // comes to stand before the camera
        Random random{0};
    };
    constexpr double kMarginM = 0.5;
    constexpr double kSitsS = 5.0;
    constexpr double kRisesS = 1.2;
    constexpr double kStandsS = 5.0;
    constexpr double kCloseM = 0.65;      // before the camera
    constexpr double kCloseEveryS = 8.0;  // and of each so long, from here:
    constexpr double kCloseFromS = 2.0;
    constexpr double kComesS = 1.2;  // the way there, on top of 2 s
    constexpr double kCloseS = 2.0;
    std::vector<Walker> walkers(people.size());
    const auto inside_room = [](Vec3 p) {
        p.x = std::clamp(p.x, -kRoomHalfX + kMarginM, kRoomHalfX - kMarginM);
        p.y = std::clamp(p.y, -kRoomHalfY + kMarginM, kRoomHalfY - kMarginM);
        p.z = 0;
        return p;
    };
    const auto out_of_obstacles = [&](Vec3 p) {
        for (const Obstacle& o : obstacles) {
            const double dx = p.x - o.x;
            const double dy = p.y - o.y;
            const double rx = o.half_x + 0.18 - (dx < 0 ? -dx : dx);
            const double ry = o.half_y + 0.18 - (dy < 0 ? -dy : dy);
            if (rx > 0 && ry > 0) {
                if (rx < ry) {
                    p.x += dx < 0 ? -rx : rx;
                } else {
                    p.y += dy < 0 ? -ry : ry;
                }
            }
        }
        return p;
    };
    // Targets are kept in the camera's view, as (to the right, ahead) in metres, and move with it.
    const auto in_world = [&](const Walker& w, double t) {
        const Rigid eye = w.is_close ? camera.at(t) : camera.base_at(t + 0.35);
        const Vec3 forward = normalised({eye.rotation.c.x, eye.rotation.c.y, 0});
        const Vec3 right{forward.y, -forward.x, 0};
        return out_of_obstacles(inside_room(eye.translation + right * w.target.x + forward * w.target.y));
    };
    // In sight at first, and nowhere that the camera comes to while somebody sits there.
    const auto seat_of = [&](const Walker& w) {
        Walker seat = w;
        const double ahead = w.lane.far_m;
        Vec3 best;
        double best_gap = -1;
        for (const double share : {0.75, 0.25, 0.5, 1.0, 0.0}) {
            const double slope = mix(w.lane.left, w.lane.right, w.side > 0 ? share : 1 - share);
            seat.target = {slope * ahead, ahead, 0};
            const Vec3 at = in_world(seat, 0);
            double gap = 1.0;  // enough
            for (int quarter = 0; quarter < 4 * (kSitsS + 2); ++quarter) {
                Vec3 apart = camera.at(0.25 * quarter).translation - at;
                apart.z = 0;
                gap = std::min(gap, length(apart));
            }
            if (gap > best_gap) best = at;
            best_gap = std::max(gap, best_gap);
        }
        return best;
    };
    const auto choose = [&](Walker& w, double t) {
        const double ahead = w.random.uniform(w.lane.near_m, w.lane.far_m);
        const double share = w.random.uniform(0.0, 0.35);  // from the end of the lane that comes next
        w.side = -w.side;
        double slope = w.side < 0 ? mix(w.lane.left, w.lane.right, share) : mix(w.lane.right, w.lane.left, share);
        if (t < w.enters_s) slope = w.enters_side * 1.5;  // out of sight
        w.target = {slope * ahead, ahead, 0};
        w.pace = w.random.uniform(0.55, 1.2);
        w.until = t + w.random.uniform(2.0, 3.5);
    };
    for (std::size_t i = 0; i < people.size(); ++i) {
        Walker& w = walkers[i];
        w.random = Random(seed * 977 + i * 131 + 17);
        w.lane = lanes[i];
        w.side = i % 2 == 0 ? 1 : -1;
        w.enters_side = w.random.uniform() < 0.5 ? -1 : 1;
        w.enters_s = i == 0 || w.random.uniform() < 0.6 ? -1e9 : w.random.uniform(-0.6, 0.6);
        choose(w, -kPrerollS);
        w.p = in_world(w, -kPrerollS);
        people[i].first_s = -kPrerollS;
        people[i].states.clear();
    }
    const double dt = 1.0 / kStepsPerSecond;
    const auto steps = static_cast<std::int32_t>((duration_s + kPrerollS + 1.0) * kStepsPerSecond);
    for (std::int32_t step = 0; step < steps; ++step) {
        const double t = -kPrerollS + step * dt;
        const Rigid eye = camera.at(t);
        for (std::size_t i = 0; i < walkers.size(); ++i) {
            Walker& w = walkers[i];
            const Person& person = people[i];
            if (t >= w.enters_s && t < w.enters_s + dt) choose(w, t);
            if (person.manner == Manner::kSitsFirst) {
                const double until = kSitsS * person.manner_scale;
                w.change = 1 - smooth_step((t - until) / kRisesS);
                if (t < until + kRisesS) {  // still, and turned to the camera
                    if (step == 0) w.p = seat_of(w);
                    if (step == 0) w.heading = arc_tangent2(eye.translation.y - w.p.y, eye.translation.x - w.p.x) + 0.5;
                    w.v = {};
                    w.stride = 0;
                    people[i].states.push_back({w.p.x, w.p.y, w.heading, w.phase, 0, 0, 0, w.gesture_phase, w.change});
                    continue;
                }
            }
            if (person.manner == Manner::kComesClose) {
                const double since = t < 0 ? -1.0 : t - kCloseEveryS * floor_clamped(t / kCloseEveryS, 0, 100'000);
                const bool was_close = w.is_close;
                w.is_close = since >= kCloseFromS && since < kCloseFromS + kComesS + kCloseS * person.manner_scale;
                if (w.is_close) w.target = {0.06 * w.enters_side, kCloseM, 0};
                if (w.is_close) w.pace = 1.1;
                if (w.is_close) w.until = 1e9;
                if (was_close && !w.is_close) choose(w, t);
            }
            const Vec3 goal = in_world(w, t);
            const Vec3 carried = (in_world(w, t + dt) - goal) * kStepsPerSecond;  // how the view itself moves on
            const Vec3 way = goal - w.p;
            const double left = length(way);
            if (person.manner == Manner::kStandsStill && t >= w.stop_until && (left < 0.22 || t > w.until)) {
                w.stop_until = t + kStandsS * person.manner_scale;
                w.gestures_left = w.gestures_right = false;
                choose(w, t);
                w.until += kStandsS * person.manner_scale;
            }
            if (t >= w.stop_until && !w.is_close && (left < 0.22 || t > w.until)) {
                if (left < 0.5 && length(carried) < 0.3 && w.random.uniform() < 0.22) {
                    w.stop_until = t + w.random.uniform(0.5, 1.3);
                    w.gestures_left = w.random.uniform() < 0.5;
                    w.gestures_right = w.random.uniform() < 0.6;
                }
                choose(w, t);
            }
            const bool is_standing = t < w.stop_until || (w.is_close && left < 0.05);
            Vec3 wanted = is_standing ? Vec3{} : carried + normalised(way) * w.pace;
            const bool is_rooted = is_standing && person.manner == Manner::kStandsStill;
            for (std::size_t j = 0; j < walkers.size(); ++j) {  // nobody walks through anybody
                if (j == i || is_rooted) continue;
                const Vec3 apart = w.p - walkers[j].p;
                const double gap = length(apart);
                if (gap < w.lane.apart_m) wanted = wanted + normalised(apart) * (2.5 * (w.lane.apart_m - gap));
            }
            Vec3 from_eye = w.p - eye.translation;
            from_eye.z = 0;
            const double distance = length(from_eye);
            const double keep = w.is_close ? kCloseM - 0.05 : w.lane.from_camera_m + 0.15;
            if (distance < keep) wanted = wanted + normalised(from_eye) * (5 * (keep - distance));
            w.v = w.v + (wanted - w.v) * (4.5 * dt);
            const double speed_wanted = length(w.v);
            if (speed_wanted > 1.5) w.v = w.v * (1.5 / speed_wanted);
            const Vec3 old = w.p;
            w.p = out_of_obstacles(inside_room(w.p + w.v * dt));
            w.v = (w.p - old) * kStepsPerSecond;
            const double speed = length(w.v);
            if (speed > 1.8) w.v = w.v * (1.8 / speed);
            const double towards = speed > 0.15 ? arc_tangent2(w.v.y, w.v.x) : arc_tangent2(-from_eye.y, -from_eye.x);
            const double turn = wrap(towards - w.heading);
            w.heading += std::clamp(turn, -3.2 * dt, 3.2 * dt);
            w.phase += speed * dt * (2 * kPi / 1.35);
            w.stride += (std::min(1.0, speed / 1.0) - w.stride) * (5 * dt);
            w.gesture_phase += dt * 5.5;
            w.gesture_left += ((is_standing && w.gestures_left ? 1.0 : 0.0) - w.gesture_left) * (4 * dt);
            w.gesture_right += ((is_standing && w.gestures_right ? 1.0 : 0.0) - w.gesture_right) * (4 * dt);
            people[i].states.push_back({w.p.x, w.p.y, w.heading, w.phase, w.stride, w.gesture_left, w.gesture_right,
                                        w.gesture_phase, w.change});
        }
    }
}

void plan_sitting(Person& person, double x, double y, double heading_rad, double duration_s, std::uint64_t seed) {
    Random random(seed);
    person.is_sitting = true;
    person.first_s = 0;
    person.states.clear();
    const auto steps = static_cast<std::int32_t>((duration_s + 1.0) * kStepsPerSecond);
    double change_s = 0;
    double left_wanted = 0;
    double right_wanted = 0;
    BodyState state{x, y, heading_rad, 0, 0, 0, 0, 0, 0};
    // With a manner: still for 5 s, talking for 3, up for 3, and again.
    constexpr double kStillS = 5.0;
    constexpr double kTalksS = 3.0;
    constexpr double kUpS = 3.0;
    constexpr double kRisesS = 1.2;
    double swayed_s = 0;
    const double phase = random.uniform(0, 2 * kPi);
    for (std::int32_t step = 0; step < steps; ++step) {
        const double t = step / kStepsPerSecond;
        if (t >= change_s) {
            left_wanted = random.uniform() < 0.6 ? random.uniform(0.3, 1.0) : 0.0;
            right_wanted = random.uniform() < 0.6 ? random.uniform(0.3, 1.0) : 0.0;
            change_s = t + random.uniform(0.8, 2.5);
        }
        const double still_s = kStillS * person.manner_scale;
        const double period = still_s + kTalksS + kUpS;
        const double since = t - period * floor_clamped(t / period, 0, 1'000'000);
        if (person.manner == Manner::kSitsFirst && since < still_s) {
            state.change = 0;
            person.states.push_back(state);
            continue;
        }
        if (person.manner == Manner::kSitsFirst) {
            const double up = since - still_s - kTalksS;
            state.change = smooth_step(up / kRisesS) - smooth_step((up - kUpS + kRisesS) / kRisesS);
        }
        swayed_s = person.manner == Manner::kSitsFirst ? swayed_s + 1 / kStepsPerSecond : t;
        state.gesture_left += (left_wanted - state.gesture_left) * 0.06;
        state.gesture_right += (right_wanted - state.gesture_right) * 0.06;
        state.gesture_phase += 0.09;
        state.heading_rad = heading_rad + radians(9) * sine(0.7 * swayed_s + phase);
        person.states.push_back(state);
    }
}

void draw_person(Canvas& canvas, const Person& person, double time_s, double folds) {
    const BodyState b = person.at(time_s);
    const double seated = person.is_sitting ? 1 - b.change : b.change;
    const auto by_posture = [&](double sitting, double standing) {
        return seated >= 1 ? sitting : (seated <= 0 ? standing : mix(standing, sitting, seated));
    };
    // One and a half seconds for a fold to where the next one was, and on with each step.
    const double wander = 0.67 * 2 * kPi * time_s + b.stride_phase + 3 * b.heading_rad;
    const Folds cloth{folds * (0.0085 + 0.0025 * sine(0.9 * time_s + person.girth * 40)), wander};
    const double h = person.height_m / 1.75;
    const double g = person.girth;
    const Vec3 forward{cosine(b.heading_rad), sine(b.heading_rad), 0};
    const Vec3 right{forward.y, -forward.x, 0};
    const Vec3 up{0, 0, 1};
    const double swing = sine(b.stride_phase);

    // Legs first: the pelvis is as high as the lower foot allows.
    constexpr double kThigh = 0.43;
    constexpr double kShin = 0.43;
    const auto leg_at = [&](double phase) {
        const double s = sine(phase);
        const double lift = std::max(0.0, cosine(phase));  // the leg that comes forward is bent
        return Leg{b.stride * (0.48 * s + 0.12 * lift), 0.06 + b.stride * (0.15 + 0.75 * lift)};
    };
    Leg legs[2] = {leg_at(b.stride_phase), leg_at(b.stride_phase + kPi)};
    double pelvis_z = 0;
    for (const Leg& leg : legs) {
        pelvis_z = std::max(pelvis_z, h * (kThigh * cosine(leg.hip) + kShin * cosine(leg.hip - leg.knee) + 0.09));
    }
    for (Leg& leg : legs) leg = {by_posture(radians(84), leg.hip), by_posture(radians(80), leg.knee)};
    pelvis_z = by_posture(0.53, pelvis_z);
    const double sway = by_posture(0.02 * sine(b.gesture_phase * 0.31), 0.022 * b.stride * swing);
    Vec3 pelvis = Vec3{b.x, b.y, pelvis_z} + right * sway;
    if (person.is_sitting && b.change > 0) pelvis = pelvis + forward * (0.32 * b.change);  // up from the chair

    for (int i = 0; i < 2; ++i) {
        const double side = i == 0 ? 1.0 : -1.0;
        const Leg& leg = legs[i];
        const Vec3 hip = pelvis + right * (0.095 * side * h);
        const Vec3 knee = hip + (forward * sine(leg.hip) - up * cosine(leg.hip)) * (kThigh * h);
        const double shin_angle = leg.hip - leg.knee;
        const Vec3 ankle = knee + (forward * sine(shin_angle) - up * cosine(shin_angle)) * (kShin * h);
        draw_limb(canvas, hip, knee, right, 0.085 * g, 0.06 * g, person.trousers, cloth);
        draw_limb(canvas, knee, ankle, right, 0.062 * g, 0.045 * g, person.trousers, cloth);
        draw_limb(canvas, ankle - up * 0.045 - forward * 0.06, ankle - up * 0.045 + forward * 0.15, right, 0.045, 0.04,
                  person.shoes);
    }

    // Trunk: twists against the legs, leans a little into the walk.
    const double twist = b.stride * 0.16 * swing;
    const Vec3 twisted_right = normalised(right * cosine(twist) + forward * sine(twist));
    const double lean = by_posture(0.05 + 0.05 * sine(b.gesture_phase * 0.23), 0.05 * b.stride);
    const Vec3 spine = normalised(up + forward * lean);
    const Vec3 neck = pelvis + spine * (0.55 * h);
    const Ring trunk[] = {{-0.16, 0.04, 0.04},        {-0.12, 0.15 * g, 0.11 * g}, {0.0, 0.175 * g, 0.125 * g},
                          {0.3, 0.16 * g, 0.115 * g}, {0.6, 0.19 * g, 0.13 * g},   {0.82, 0.205 * g, 0.125 * g},
                          {0.93, 0.17 * g, 0.10 * g}, {1.0, 0.07, 0.07},           {1.1, 0.055, 0.055}};
    draw_tube(canvas, pelvis, neck, twisted_right, trunk, 9, 18, 420, false, person.shirt, cloth);

    const double look = 0.3 * sine(b.gesture_phase * 0.17);
    const Vec3 face = normalised(forward * cosine(look) + right * sine(look));
    const Vec3 chin = neck + spine * (0.045 * h);
    const Vec3 crown = chin + normalised(spine + face * 0.03) * (0.235 * h);
    // The texture's middle looks forward: the seam is at the back.
    const Ring head[] = {{0.0, 0.03, 0.03},    {0.08, 0.062, 0.056}, {0.25, 0.086, 0.07}, {0.5, 0.1, 0.078},
                         {0.72, 0.098, 0.076}, {0.9, 0.07, 0.055},   {1.0, 0.0, 0.0}};
    draw_tube(canvas, chin, crown, -face, head, 7, 14, 0, true, person.face);

    for (int i = 0; i < 2; ++i) {
        const double side = i == 0 ? 1.0 : -1.0;
        const double gesture = i == 0 ? b.gesture_right : b.gesture_left;
        const double beat = sine(b.gesture_phase + (i == 0 ? 0.0 : 1.9));
        const double other = sine(b.gesture_phase * 0.63 + (i == 0 ? 0.7 : 2.4));
        const double rest = by_posture(0.35, -side * 0.5 * b.stride * swing);
        const double shoulder_angle = mix(rest, 0.9 + 0.45 * other, gesture);
        const double elbow = mix(by_posture(1.0, 0.25 + 0.25 * b.stride), 1.25 + 0.5 * beat, gesture);
        const double spread = mix(0.12, 0.35 + 0.25 * beat, gesture);
        const Vec3 shoulder = pelvis + spine * (0.475 * h) + twisted_right * (0.215 * side * g);
        const Vec3 down = -spine;
        const auto direction = [&](double angle) {
            return normalised(forward * sine(angle) + down * cosine(angle) + twisted_right * (spread * side));
        };
        const Vec3 elbow_p = shoulder + direction(shoulder_angle) * (0.29 * h);
        const Vec3 wrist = elbow_p + direction(shoulder_angle + elbow) * (0.25 * h);
        const Vec3 finger = wrist + direction(shoulder_angle + elbow + 0.2 * beat * gesture) * (0.15 * h);
        draw_limb(canvas, shoulder, elbow_p, forward, 0.056 * g, 0.045 * g, person.shirt, cloth);
        draw_limb(canvas, elbow_p, wrist, forward, 0.045 * g, 0.036 * g, person.shirt, cloth);
        draw_limb(canvas, wrist, finger, forward, 0.034, 0.03, person.skin);
    }
}

}  // namespace stillmesh::simulated
