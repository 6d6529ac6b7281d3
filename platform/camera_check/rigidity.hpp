// Whether what two views see moves as one body, without believing the calibration. A point seen at (x, y) with inverse
// depth w is, up to its depth, (x, y, 1, w); a rigid motion takes that linearly to the other view, whatever focal
// length, centre and depth unit are: (w / w') (x', y', 1) = M (x, y, 1, w), with twelve numbers in M, four matches.
// If that explains few matches while two views of one rigid scene (a fundamental matrix, of pictures alone) explain
// most, then depth and picture do not belong together. Cost: 100 hypotheses over the matches; the second only if the
// first explains little.
#pragma once

#include <cstdint>
#include <vector>

#include "platform/camera_check/views.hpp"

namespace stillmesh {

struct Rigidity {
    double with_depth = 0;        // share of the matches that one motion explains, picture and depth
    double by_picture = 1;        // of the pictures alone; 1: not asked
    std::vector<bool> is_inlier;  // with depth, match by match
};

// `focal_px`: roughly; turns errors of rays into pixels.
void measure_rigidity(const std::vector<ViewMatch>& matches, double focal_px, Rigidity& out);

}  // namespace stillmesh
