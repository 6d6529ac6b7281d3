#include "bench/accuracy/hints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace stillmesh::accuracy {
namespace {

constexpr HintKind kKinds[] = {
    {"wheels", HintSource::kWheels, 1, false, false, "odometry, 2 % off and .3 mm and .3 mrad a frame"},
    {"gyro", HintSource::kGyroscope, 1, false, false, "a gyroscope with a bias of .5 degrees/s"},
    {"both", HintSource::kBoth, 1, false, false, "the translation of the one, the rotation of the other"},
    {"slip", HintSource::kWheels, 1, false, true, "odometry that stands from second 2 to 4 and runs on from 5 to 6"},
    {"slip1", HintSource::kWheels, 1, true, false, "odometry that stands for the first second"},
    {"wheels5", HintSource::kWheels, 5, false, false, "odometry, five times as far off as it claims"},
    {"gyro5", HintSource::kGyroscope, 5, false, false, "a gyroscope, five times as far off as it claims"},
};

}  // namespace

const HintKind* hint_kind(const std::string& name) {
    const auto* const found =
        std::find_if(std::begin(kKinds), std::end(kKinds), [&](const HintKind& kind) { return name == kind.name; });
    return found == std::end(kKinds) ? nullptr : found;
}

std::string hint_kinds_text() {
    std::string out;
    for (const HintKind& kind : kKinds)
        out += fmt::format("{}{}: {}", out.empty() ? "" : "; ", kind.name, kind.sentence);
    return out;
}

HintMaker::HintMaker(const HintKind* kind, std::uint64_t seed)
    : kind_(kind), motion_(seed, {}, kind == nullptr ? 1 : kind->excess) {}

const MotionHint* HintMaker::hint(const TrajectoryPose& truth, double second) {
    if (kind_ == nullptr || !motion_.step(truth)) return nullptr;
    hint_ = kind_->source == HintSource::kGyroscope ? motion_.gyroscope() : motion_.wheels();
    if (kind_->source == HintSource::kBoth) {
        const MotionHint gyroscope = motion_.gyroscope();
        std::copy_n(gyroscope.last_from_camera.rotation_xyzw, 4, hint_.last_from_camera.rotation_xyzw);
        hint_.sigma_rad = gyroscope.sigma_rad;
    }
    const bool stands = (kind_->slips_first && second < 1) || (kind_->slips && second >= 2 && second < 4);
    const bool runs_on = kind_->slips && second >= 5 && second < 6;
    if (stands || runs_on) {
        constexpr double kStep_m = 0.01;  // .3 m/s forward
        const MotionErrors claimed;
        hint_.last_from_camera = RigidTransform{};
        hint_.last_from_camera.translation_m[2] = runs_on ? kStep_m : 0;
        hint_.sigma_m = claimed.way_share * (runs_on ? kStep_m : 0) + claimed.step_m;
        hint_.sigma_rad = claimed.step_rad;
    }
    return &hint_;
}

}  // namespace stillmesh::accuracy
