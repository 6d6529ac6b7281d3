// How a depth camera errs beyond its noise: it lies beside the colour camera, its scale is off over the image, its
// noise stays for a while, dark things seem farther, it comes late. Everything follows from seed and time.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/simulated/depth_sensor.hpp"
#include "hal/simulated/dirt.hpp"
#include "hal/simulated/vector3.hpp"

namespace stillmesh::simulated {

class DepthDirt {
public:
    DepthDirt(const Dirt& dirt, std::uint64_t seed, const Pinhole& colour);

    // Where it truly is, in the camera it is said to be, and how it truly looks.
    [[nodiscard]] const Rigid& place() const noexcept { return place_; }
    [[nodiscard]] const Pinhole& pinhole() const noexcept { return pinhole_; }
    // How late it is at this time.
    [[nodiscard]] double late_s(double time_s) const noexcept;
    // What the sensor is to add at this time; `grey` (0..255) is the colour picture. Valid until the next call.
    [[nodiscard]] DepthErrors errors(double time_s, const std::vector<float>& grey);

private:
    void add_scale(double time_s);
    void add_darkness(const std::vector<float>& grey);
    void add_noise(double time_s);

    Dirt dirt_;
    std::uint32_t key_;
    Pinhole pinhole_;
    Rigid place_;
    double late_phase_ = 0, drift_phase_ = 0;
    std::vector<float> pattern_;  // -1 to 1
    Lattice before_, after_;      // of noise that stays
    std::vector<float> nearness_, disparity_;
};

}  // namespace stillmesh::simulated
