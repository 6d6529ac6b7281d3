#include "hal/simulated/scene.hpp"

#include "engine/base/random.hpp"

namespace stillmesh::simulated {
namespace {

constexpr Dirt kShaken = [] {
    Dirt dirt = all_dirt(0);
    dirt.rolling = 1;
    dirt.shake = 1;
    return dirt;
}();
constexpr Dirt kAside = [] {
    Dirt dirt = all_dirt(0);
    dirt.aside = 1;
    return dirt;
}();
constexpr Dirt kReal = all_dirt(1);

constexpr Scene kScenes[] = {
    {"static_xyz", CameraMotion::kXyz, Cast::kNobody, 300},
    {"static_rpy", CameraMotion::kRpy, Cast::kNobody, 300},
    {"static_halfsphere", CameraMotion::kHalfsphere, Cast::kNobody, 300},
    {"static_loop", CameraMotion::kLoop, Cast::kNobody, 1200},
    {"sitting_static", CameraMotion::kStatic, Cast::kSitting, 300},
    {"sitting_xyz", CameraMotion::kXyz, Cast::kSitting, 300},
    {"sitting_rpy", CameraMotion::kRpy, Cast::kSitting, 300},
    {"sitting_halfsphere", CameraMotion::kHalfsphere, Cast::kSitting, 300},
    {"walking_static", CameraMotion::kStatic, Cast::kWalking, 300},
    {"walking_xyz", CameraMotion::kXyz, Cast::kWalking, 300},
    {"walking_rpy", CameraMotion::kRpy, Cast::kWalking, 300},
    {"walking_halfsphere", CameraMotion::kHalfsphere, Cast::kWalking, 300},
    {"walking_loop", CameraMotion::kLoop, Cast::kWalking, 1200},
    {"trolley_xyz", CameraMotion::kXyz, Cast::kTrolley, 300},
    {"trolley_first", CameraMotion::kXyz, Cast::kTrolleyFirst, 300},
    {"trolley_returns", CameraMotion::kXyz, Cast::kTrolleyReturns, 450},
    {"crowd_close", CameraMotion::kXyz, Cast::kCrowd, 300},
    {"lift", CameraMotion::kXyz, Cast::kLift, 420},
    {"rearranged", CameraMotion::kXyz, Cast::kRearranged, 300},
    {"corridor", CameraMotion::kCorridor, Cast::kNobody, 1200},
    {"shaken_xyz", CameraMotion::kXyz, Cast::kNobody, 300, kShaken},
    {"shaken_rpy", CameraMotion::kRpy, Cast::kNobody, 300, kShaken},
    {"shaken_walking_xyz", CameraMotion::kXyz, Cast::kWalking, 300, kShaken},
    {"shaken_walking_rpy", CameraMotion::kRpy, Cast::kWalking, 300, kShaken},
    {"aside_xyz", CameraMotion::kXyz, Cast::kNobody, 300, kAside},
    {"real_walking_static", CameraMotion::kStatic, Cast::kWalking, 300, kReal},
    {"real_walking_xyz", CameraMotion::kXyz, Cast::kWalking, 300, kReal},
    {"real_walking_rpy", CameraMotion::kRpy, Cast::kWalking, 300, kReal},
    {"real_walking_halfsphere", CameraMotion::kHalfsphere, Cast::kWalking, 300, kReal},
    {"real_static_xyz", CameraMotion::kXyz, Cast::kNobody, 300, kReal},
    {"real_sitting_xyz", CameraMotion::kXyz, Cast::kSitting, 300, kReal},
    {"real_loop", CameraMotion::kLoop, Cast::kWalking, 1200, kReal},
};

constexpr double kRpyYaw = radians(25);
constexpr double kRpyYawHz = 0.17;

// Halfway round the desk: the point the camera turns about.
constexpr Vec3 kHalfsphereCentre{0.35, -0.1, 0.85};

}  // namespace

std::span<const Scene> scenes() noexcept {
    return kScenes;
}

DeskPlace desk_place(const Scene& scene, double side) noexcept {
    if (scene.motion == CameraMotion::kLoop) return {0, 0, 0.6, 0.35};
    if (has_trolley(scene.cast)) return {0.5 * side, 0.75, 0.75, 0.4};
    if (scene.cast == Cast::kRearranged) return {1.0 * side, 0.4, 0.6, 0.35};
    if (scene.motion == CameraMotion::kHalfsphere)
        return {kHalfsphereCentre.x * side, kHalfsphereCentre.y + 0.35, 0.55, 0.3};
    return {0.75 * side, 0.2, 0.75, 0.4};
}

CameraPath::CameraPath(CameraMotion motion, double side, std::uint64_t seed) : motion_(motion), side_(side) {
    Random random(seed ^ 0x6361'6d65'7261'0001ULL);
    for (double& phase : phase_) phase = random.uniform(0, 2 * kPi);
    for (double& pace : pace_) pace = random.uniform(0.9, 1.1);
}

double CameraPath::wave(int i, double frequency_hz, double time_s) const noexcept {
    return sine(2 * kPi * frequency_hz * pace_[i] * time_s + phase_[i]);
}

Rigid CameraPath::base_at(double time_s) const noexcept {
    if (motion_ == CameraMotion::kLoop) {
        // An ellipse round the desk in 19 s, about half a metre a second; the eyes ahead and somewhat to the wall.
        const double angle = phase_[0] + side_ * 2 * kPi * time_s / 19.0;
        const Vec3 eye{1.75 * cosine(angle), 1.3 * sine(angle), 1.4};
        const Vec3 ahead = normalised(Vec3{-1.75 * sine(angle), 1.3 * cosine(angle), 0} * side_);
        const Vec3 outward{ahead.y * side_, -ahead.x * side_, 0};
        return look_along(eye, ahead + outward * 0.1);
    }
    if (motion_ == CameraMotion::kCorridor) {
        // Ahead and to one wall; at the end of its way it stands.
        const double way = kCorridorPace_m_s * time_s;
        const Vec3 eye{way < kCorridorWay_m ? way : kCorridorWay_m, -0.45 * side_, 1.4};
        return look_along(eye, Vec3{1.0, 0.8 * side_, -0.1});
    }
    if (motion_ == CameraMotion::kHalfsphere) {
        const double azimuth = radians(62) * wave(0, 1.0 / 15, time_s);
        const double elevation = radians(25) + radians(10) * wave(1, 1.0 / 7, time_s);
        const double reach = 1.35 * cosine(elevation);
        const Vec3 centre{kHalfsphereCentre.x * side_, kHalfsphereCentre.y, kHalfsphereCentre.z};
        const Vec3 from{reach * sine(azimuth), -reach * cosine(azimuth), 1.15 * sine(elevation)};
        return look_along(centre + from, -from + Vec3{0, 0, 0.22});
    }
    const Vec3 eye{-0.05 * side_, -1.45, 1.32};
    Rigid pose = look_along(eye, Vec3{0.1 * side_, 1.0, -0.2});
    // Half of the large turns: whoever walks before the camera sees where it looks.
    if (motion_ == CameraMotion::kRpy)
        pose.rotation = rotation_z(-0.6 * kRpyYaw * wave(5, kRpyYawHz, time_s)) * pose.rotation;
    return pose;
}

Rigid CameraPath::at(double time_s) const noexcept {
    const double t = time_s;
    Rigid pose = base_at(t);
    Vec3 shift;  // in the camera's frame, m
    double roll = 0;
    double pitch = 0;
    double yaw = 0;
    switch (motion_) {
        case CameraMotion::kStatic:
            shift = {0.012 * wave(2, 0.13, t), 0.008 * wave(3, 0.17, t), 0.012 * wave(4, 0.11, t)};
            yaw = radians(0.7) * wave(5, 0.12, t);
            pitch = radians(0.5) * wave(6, 0.15, t);
            break;
        case CameraMotion::kXyz:
            shift = {0.30 * wave(2, 0.17, t), 0.22 * wave(3, 0.13, t), 0.26 * wave(4, 0.11, t)};
            yaw = radians(2.5) * wave(5, 0.21, t);
            pitch = radians(2) * wave(6, 0.17, t);
            roll = radians(1.5) * wave(7, 0.19, t);
            break;
        case CameraMotion::kRpy:
            shift = {0.04 * wave(2, 0.21, t), 0.03 * wave(3, 0.27, t), 0.03 * wave(4, 0.16, t)};
            yaw = 0.4 * kRpyYaw * wave(5, kRpyYawHz, t);  // the rest is in base_at
            pitch = radians(14) * wave(6, 0.23, t);
            roll = radians(20) * wave(7, 0.15, t);
            break;
        case CameraMotion::kHalfsphere: roll = radians(4) * wave(7, 0.15, t); break;
        case CameraMotion::kCorridor:
        case CameraMotion::kLoop:
            shift = {0.02 * wave(2, 0.9, t), 0.015 * wave(3, 1.7, t), 0};
            yaw = radians(8) * wave(5, 0.13, t);
            pitch = radians(-9) + radians(4) * wave(6, 0.19, t);
            roll = radians(1.5) * wave(7, 0.8, t);
            break;
    }
    // A hand is never still.
    const double tremor = motion_ == CameraMotion::kStatic ? 0.4 : 1.0;
    shift = shift + Vec3{wave(8, 2.3, t), wave(9, 2.9, t), wave(10, 1.9, t)} * (0.0012 * tremor);
    yaw += radians(0.12) * tremor * wave(11, 2.7, t);
    pitch += radians(0.12) * tremor * wave(12, 3.1, t);
    roll += radians(0.10) * tremor * wave(13, 2.1, t);
    pose.translation = pose * shift;
    // Pitch is positive upwards: y of the camera points down.
    pose.rotation = pose.rotation * (rotation_y(yaw) * (rotation_x(pitch) * rotation_z(roll)));
    return pose;
}

}  // namespace stillmesh::simulated
