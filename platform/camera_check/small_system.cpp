#include "platform/camera_check/small_system.hpp"

#include <Eigen/Cholesky>

namespace stillmesh {

SmallMatrix solved(const SmallMatrix& normal, const SmallMatrix& right) {
    return normal.ldlt().solve(right);
}

}  // namespace stillmesh
