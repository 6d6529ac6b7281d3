// How far the camera turned while the rows of one frame were read. A hand or a robot that trembles at 8 to 12 Hz turns
// within the frame otherwise than from frame to frame, by up to 30 degrees per second; rows then lie pixels beside their
// place. So the turn from the first row to the last is an unknown of the frame beside its pose, three numbers with a
// prior: the turn that the motion from frame to frame makes expect, and how far frames have been off it of late (the
// likeliest variance, by expectation and maximisation; a global shutter brings it to nothing). Cost: some passes over
// the matches given.
#pragma once

#include <cstdint>
#include <span>

#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

// In the camera, rad, from the first row to the last.
struct RowTurn {
    Vector3 turn = Vector3::Zero();
    Matrix3 covariance = Matrix3::Zero();
};

// The most likely turn, for a pose near `world_from_camera_guess`; the correspondences have their rows carried with the turn
// `carried`. False: too few matches, or a singular system.
[[nodiscard]] bool measure_row_turn(std::span<const Correspondence> correspondences,
                                    std::span<const std::uint16_t> chosen, const SE3& world_from_camera_guess,
                                    const Vector3& carried, const Vector3& expected, double variance, double chi2_max,
                                    RowTurn& out) noexcept;

}  // namespace stillmesh
