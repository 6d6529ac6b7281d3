// Normal equations of at most nine unknowns.
#pragma once

#include "engine/base/check.hpp"
// After CHECK: Eigen's assertions are ours.
#include <Eigen/Core>

namespace stillmesh {

// Its size is known when it runs: Eigen's solver is compiled once, not once a size (a third of this room's time).
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 9, 9>;

// x of normal * x = right. `normal`: symmetric, n x n; `right`: n rows, any columns.
[[nodiscard]] SmallMatrix solved(const SmallMatrix& normal, const SmallMatrix& right);

}  // namespace stillmesh
