// ceres_pose_graph FILE: solves a pose graph with Ceres (dense) and prints cost and poses, for tests to compare. The
// file, as pose_graph_ceres_test.cpp writes it:
//   nodes edges
//   per node: fixed(0/1), world_from_camera: rotation by rows (9), translation (3)
//   per edge: a b, a_from_b (12 numbers likewise), info_translation info_rotation
// The output: cost (sum of weighted squares, not halved); then poses (12 numbers) in the order of the file.
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

struct Edge {
    std::size_t a = 0, b = 0;
    double rotation[9] = {};  // by rows
    double translation[3] = {};
    double info_translation = 0, info_rotation = 0;
};

// Parameters: world_from_camera as angle-axis and translation.
struct Residual {
    const Edge* edge;
    template <typename T>
    bool operator()(const T* a, const T* b, T* residual) const {
        const T inverse_a[3] = {-a[0], -a[1], -a[2]};
        const T between[3] = {b[3] - a[3], b[4] - a[4], b[5] - a[5]};
        T q[3];
        ceres::AngleAxisRotatePoint(inverse_a, between, q);
        for (int k = 0; k < 3; ++k) {
            residual[k] = (q[k] - edge->translation[k]) * std::sqrt(edge->info_translation);
        }
        T matrix_a[9], matrix_b[9], off[9];  // by columns
        ceres::AngleAxisToRotationMatrix(a, matrix_a);
        ceres::AngleAxisToRotationMatrix(b, matrix_b);
        // off = M^T A^T B
        T relative[9];
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
                relative[3 * c + r] = matrix_a[3 * r] * matrix_b[3 * c] + matrix_a[3 * r + 1] * matrix_b[3 * c + 1] +
                                      matrix_a[3 * r + 2] * matrix_b[3 * c + 2];
            }
        }
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) {
                off[3 * c + r] = edge->rotation[r] * relative[3 * c] + edge->rotation[3 + r] * relative[3 * c + 1] +
                                 edge->rotation[6 + r] * relative[3 * c + 2];
            }
        }
        T turn[3];
        ceres::RotationMatrixToAngleAxis(off, turn);
        for (int k = 0; k < 3; ++k) residual[3 + k] = turn[k] * std::sqrt(edge->info_rotation);
        return true;
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        std::cerr << "usage: ceres_pose_graph FILE\n";
        return 2;
    }
    std::ifstream in(argv[1]);
    std::size_t node_count = 0, edge_count = 0;
    in >> node_count >> edge_count;
    std::vector<std::array<double, 6>> poses(node_count);
    std::vector<int> fixed(node_count);
    std::vector<Edge> edges(edge_count);
    for (std::size_t i = 0; i < node_count && in; ++i) {
        double r[9], columns[9];
        in >> fixed[i];
        for (double& v : r) in >> v;
        for (std::size_t k = 3; k < 6; ++k) in >> poses[i][k];
        for (int row = 0; row < 3; ++row) {
            for (int c = 0; c < 3; ++c) columns[3 * c + row] = r[3 * row + c];
        }
        ceres::RotationMatrixToAngleAxis(columns, poses[i].data());
    }
    for (Edge& edge : edges) {
        in >> edge.a >> edge.b;
        for (double& v : edge.rotation) in >> v;
        for (double& v : edge.translation) in >> v;
        in >> edge.info_translation >> edge.info_rotation;
        if (!in || edge.a >= node_count || edge.b >= node_count) {
            std::cerr << "ceres_pose_graph: " << argv[1] << " is broken\n";
            return 2;
        }
    }
    ceres::Problem problem;
    for (const Edge& edge : edges) {
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Residual, 6, 6, 6>(new Residual{&edge}), nullptr,
                                 poses[edge.a].data(), poses[edge.b].data());
    }
    for (std::size_t i = 0; i < node_count; ++i) {
        if (fixed[i] != 0 && problem.HasParameterBlock(poses[i].data())) {
            problem.SetParameterBlockConstant(poses[i].data());
        }
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 500;
    options.function_tolerance = 1e-16;
    options.gradient_tolerance = 1e-14;
    options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    std::cout << std::setprecision(17) << 2.0 * summary.final_cost << '\n';
    for (const auto& pose : poses) {
        double r[9];
        ceres::AngleAxisToRotationMatrix(pose.data(), r);
        for (int row = 0; row < 3; ++row) {
            for (int c = 0; c < 3; ++c) std::cout << r[3 * c + row] << ' ';
        }
        std::cout << pose[3] << ' ' << pose[4] << ' ' << pose[5] << '\n';
    }
    return summary.IsSolutionUsable() ? 0 : 1;
}
