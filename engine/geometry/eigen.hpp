// The one door to Eigen inside the engine: small fixed-size types, unvectorised (so that sums keep the source's order),
// no heap, no streams, assertions through CHECK. Never in a public header.
#pragma once

#include "engine/base/check.hpp"

#ifndef EIGEN_DONT_VECTORIZE
#error "compile the engine with EIGEN_DONT_VECTORIZE (see engine/CMakeLists.txt)"
#endif

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace stillmesh {

using Vector2 = Eigen::Matrix<double, 2, 1>;
using Vector3 = Eigen::Matrix<double, 3, 1>;
using Vector4 = Eigen::Matrix<double, 4, 1>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix3 = Eigen::Matrix<double, 3, 3>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

}  // namespace stillmesh
