// People of elliptic tubes in patterned clothes, who walk with swinging limbs, stop, turn, sit and gesture.
// Their way is worked out once, before the first frame, 60 steps a second; in between they are interpolated.
#pragma once

#include <span>
#include <vector>

#include "engine/base/random.hpp"
#include "hal/simulated/renderer.hpp"
#include "hal/simulated/scene.hpp"

namespace stillmesh::simulated {

struct BodyState {
    double x = 0, y = 0;                         // on the floor, m
    double heading_rad = 0;                      // 0 looks along x
    double stride_phase = 0;                     // rad, 2 pi for two steps
    double stride = 0;                           // 0 stands, 1 walks briskly
    double gesture_left = 0, gesture_right = 0;  // 0 arm swings, 1 arm is up
    double gesture_phase = 0;
    double change = 0;  // 1: sits, of those who walk; stands, of those who sit
};

// What somebody does beside walking or talking.
enum class Manner : std::uint8_t { kNone, kSitsFirst, kStandsStill, kComesClose };

struct Person {
    double height_m = 1.75;
    double girth = 1.0;
    bool is_sitting = false;
    Manner manner = Manner::kNone;
    double manner_scale = 1;  // on how long it lasts
    Material shirt, trousers, skin, face, shoes;
    double first_s = 0;             // time of states[0]
    std::vector<BodyState> states;  // 60 a second

    [[nodiscard]] BodyState at(double time_s) const noexcept;
};

struct Obstacle {
    double x = 0, y = 0, half_x = 0, half_y = 0;
};

// Where somebody walks to and fro, as the camera sees it: so far ahead, between two slopes (sideways over ahead).
struct Lane {
    double near_m = 1, far_m = 2;
    double left = -0.45, right = 0.45;
    double from_camera_m = 0.7, apart_m = 0.75;  // kept from the camera, and from each other
};

// Ways of people who keep crossing before the camera, each in a lane of their own, round the obstacles.
void plan_walks(std::vector<Person>& people, std::span<const Lane> lanes, const CameraPath& camera,
                const std::vector<Obstacle>& obstacles, double duration_s, std::uint64_t seed);
// Someone on a chair, who talks with hands and body.
void plan_sitting(Person& person, double x, double y, double heading_rad, double duration_s, std::uint64_t seed);

// `folds`: of the clothes, 1 is 6 to 11 mm.
void draw_person(Canvas& canvas, const Person& person, double time_s, double folds = 0);

}  // namespace stillmesh::simulated
