// What the hand adds to the way it carries the camera: a tremor (physiological tremor lies at 8 to 12 Hz) and looks
// aside. A smooth function of time, for any time.
#pragma once

#include <cstdint>

#include "hal/simulated/dirt.hpp"
#include "hal/simulated/vector3.hpp"

namespace stillmesh::simulated {

class Hand {
public:
    Hand(const Dirt& dirt, std::uint64_t seed);

    // world_from_camera with what the hand does at this time.
    [[nodiscard]] Rigid carry(const Rigid& world_from_camera, double time_s) const noexcept;
    // How far the look is aside, rad.
    [[nodiscard]] double aside_rad(double time_s) const noexcept;

private:
    static constexpr int kAxes = 6, kWaves = 3;

    double shake_, aside_;
    double phase_[kAxes][kWaves] = {}, frequency_hz_[kAxes][kWaves] = {};
    double first_side_ = 1;
};

}  // namespace stillmesh::simulated
