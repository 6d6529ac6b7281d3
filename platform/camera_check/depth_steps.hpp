// The depth unit, from the steps of the sensor. Nothing that a camera sees tells the unit: with all depths twice as
// large, the world and the way through it are twice as large, and that is all. But a Kinect, an Xtion and their kin
// measure disparity in eighths of a pixel: their inverse depths lie 2.87e-3 / m apart (a focal length of 580 px times a
// baseline of 75 mm, Konolige & Mihelich 2010; 2.9e-3 measured in TUM's recordings), and from pixel to pixel they
// change by one such step or none. A unit that is wrong changes that distance by as much. Cameras without steps (time
// of flight) or with finer ones and more noise (RealSense) tell nothing here. Cost: every second row of a frame.
#pragma once

#include <array>
#include <cstdint>

#include "engine/frame/frame.hpp"

namespace stillmesh {

class DepthSteps {
public:
    void add(const Frame& frame);
    // By how much depth is too large: 1 within a tenth or so where it is right. 0: the sensor does not tell, or has not
    // yet.
    [[nodiscard]] double factor() const;

private:
    // Of ratios of 5 %, from 1e-4 / m on: a tenth to ten times the steps of a Kinect, and more.
    static constexpr int kBins = 160;
    std::array<double, kBins> differences_{};  // of neighbours' inverse depths, where there is one
    std::array<double, kBins> bends_{};        // of three in a row, 8 px apart, from a straight line
};

}  // namespace stillmesh
