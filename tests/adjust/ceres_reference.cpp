// ceres_reference FILE: solves an adjustment problem with Ceres and prints cost, poses and points, for tests to
// compare. The file, numbers with 17 digits, as ceres_test.cpp writes it:
//   chi2_max_pixel chi2_max_depth keyframes points observations
//   per keyframe:    fixed(0/1), world_from_camera: rotation by rows (9), translation (3)
//   per point:       x y z
//   per observation: keyframe point x y var_pixel z_m var_z(0: no depth)
// The output: cost (sum of Huber's rho, not halved); then poses (12 numbers) and points (3) in the order of the file.
#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <vector>

namespace {

struct Observation {
    std::size_t keyframe = 0, point = 0;
    double x = 0, y = 0, var_pixel = 0, z_m = 0, var_z = 0;
};

// Parameters: camera_from_world as angle-axis and translation; the point in the world.
struct Residual {
    const Observation* o;
    template <typename T>
    bool operator()(const T* pose, const T* point, T* residual) const {
        T q[3];
        ceres::AngleAxisRotatePoint(pose, point, q);
        for (int k = 0; k < 3; ++k) q[k] += pose[3 + k];
        const double root = 1.0 / std::sqrt(o->var_pixel);
        residual[0] = (q[0] / q[2] - o->x) * root;
        residual[1] = (q[1] / q[2] - o->y) * root;
        if (o->var_z > 0) residual[2] = (q[2] - o->z_m) / std::sqrt(o->var_z);
        return true;
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        std::cerr << "usage: ceres_reference FILE\n";
        return 2;
    }
    std::ifstream in(argv[1]);
    double chi2_max_pixel = 0, chi2_max_depth = 0;
    std::size_t keyframe_count = 0, point_count = 0, observation_count = 0;
    in >> chi2_max_pixel >> chi2_max_depth >> keyframe_count >> point_count >> observation_count;
    std::vector<std::array<double, 6>> poses(keyframe_count);
    std::vector<int> fixed(keyframe_count);
    std::vector<std::array<double, 3>> points(point_count);
    std::vector<Observation> observations(observation_count);
    for (std::size_t i = 0; i < keyframe_count && in; ++i) {
        double r[9], t[3], transposed[9];  // Ceres reads matrices by columns
        in >> fixed[i];
        for (double& v : r) in >> v;
        for (double& v : t) in >> v;
        for (int row = 0; row < 3; ++row) {
            poses[i][3 + static_cast<std::size_t>(row)] = -(r[row] * t[0] + r[3 + row] * t[1] + r[6 + row] * t[2]);
        }
        for (int k = 0; k < 9; ++k) transposed[k] = r[k];  // by rows: camera_from_world by columns
        ceres::RotationMatrixToAngleAxis(transposed, poses[i].data());
    }
    for (auto& point : points) {
        for (double& v : point) in >> v;
    }
    for (Observation& o : observations) {
        in >> o.keyframe >> o.point >> o.x >> o.y >> o.var_pixel >> o.z_m >> o.var_z;
        if (!in || o.keyframe >= keyframe_count || o.point >= point_count) {
            std::cerr << "ceres_reference: " << argv[1] << " is broken\n";
            return 2;
        }
    }
    ceres::Problem problem;
    for (const Observation& o : observations) {
        const bool has_depth = o.var_z > 0;
        ceres::CostFunction* cost = nullptr;
        if (has_depth) {
            cost = new ceres::AutoDiffCostFunction<Residual, 3, 6, 3>(new Residual{&o});
        } else {
            cost = new ceres::AutoDiffCostFunction<Residual, 2, 6, 3>(new Residual{&o});
        }
        problem.AddResidualBlock(cost, new ceres::HuberLoss(std::sqrt(has_depth ? chi2_max_depth : chi2_max_pixel)),
                                 poses[o.keyframe].data(), points[o.point].data());
    }
    for (std::size_t i = 0; i < keyframe_count; ++i) {
        if (fixed[i] != 0 && problem.HasParameterBlock(poses[i].data())) {
            problem.SetParameterBlockConstant(poses[i].data());
        }
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.max_num_iterations = 5000;
    options.function_tolerance = 1e-16;
    options.gradient_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    std::cout << std::setprecision(17) << 2.0 * summary.final_cost << '\n';
    for (const auto& pose : poses) {
        double r[9];  // camera_from_world by columns: world_from_camera by rows
        ceres::AngleAxisToRotationMatrix(pose.data(), r);
        for (const double v : r) std::cout << v << ' ';
        for (int row = 0; row < 3; ++row) {
            std::cout << -(r[3 * row] * pose[3] + r[3 * row + 1] * pose[4] + r[3 * row + 2] * pose[5]) << ' ';
        }
        std::cout << '\n';
    }
    for (const auto& point : points) std::cout << point[0] << ' ' << point[1] << ' ' << point[2] << '\n';
    return summary.IsSolutionUsable() ? 0 : 1;
}
