// A pose as programs see it: plain data.
#pragma once

namespace stillmesh {

struct RigidTransform {
    double rotation_xyzw[4] = {0, 0, 0, 1};  // unit quaternion
    double translation_m[3] = {0, 0, 0};
};

}  // namespace stillmesh
