// Registration against rendered truth: a room of people seen by a wide depth camera and, 15 mm aside and turned a
// little, by a colour camera, both without noise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "hal/live/depth_registration.hpp"
#include "hal/simulated/renderer.hpp"
#include "hal/simulated/scene.hpp"
#include "hal/simulated/world.hpp"

namespace stillmesh::registration_truth_test {
namespace {

using namespace simulated;

constexpr double kUnits = 5000;

[[nodiscard]] std::vector<std::uint16_t> depth_of(const Picture& picture) {
    std::vector<std::uint16_t> out(picture.inverse_depth().size());
    for (std::size_t i = 0; i < out.size(); ++i) {
        const double w = picture.inverse_depth()[i];
        const double z = w > 0 ? kUnits / w : 0;
        out[i] = z < 65535 ? static_cast<std::uint16_t>(std::lround(z)) : std::uint16_t{0};
    }
    return out;
}

// Promise: borders lie within 1 px of where they are (every registered pixel has the depth of one of the nine true ones
// round it), nothing of the background lies on the foreground, and what is left without depth is what the depth camera
// cannot see, a few in a hundred.
TEST(RegistrationTruth, BordersWithinAPixelAndNoBackgroundOnTheForeground) {
    CameraModel colour, depth;
    colour.width = 640, colour.height = 480, colour.fx = colour.fy = 528, colour.cx = 319.5, colour.cy = 239.5;
    depth.width = 848, depth.height = 480, depth.fx = depth.fy = 424, depth.cx = 424.6, depth.cy = 238.2;
    RigidTransform pose{{0.0022, -0.0031, 0.0017, 0.0}, {0.0149, 0.0003, 0.0002}};
    double norm = 1;
    for (int i = 0; i < 3; ++i) norm -= pose.rotation_xyzw[i] * pose.rotation_xyzw[i];
    pose.rotation_xyzw[3] = std::sqrt(norm);
    const auto [x, y, z, w] = pose.rotation_xyzw;
    const Rigid colour_from_depth{{{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
                                   {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
                                   {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}},
                                  {pose.translation_m[0], pose.translation_m[1], pose.translation_m[2]}};
    DepthRegistration registration(depth, colour, pose, kUnits);
    Renderer true_view({colour.width, colour.height, colour.fx, colour.fy, colour.cx, colour.cy});
    Renderer depth_view({depth.width, depth.height, depth.fx, depth.fy, depth.cx, depth.cy});
    std::vector<std::uint16_t> registered(640 * 480);
    for (const Scene& scene : scenes()) {
        if (std::string_view(scene.name) != "walking_xyz" && std::string_view(scene.name) != "sitting_rpy") continue;
        World world(scene, 3, 3, 4.0, {});
        for (const double time_s : {0.5, 2.0, 3.5}) {
            const Rigid view = world.camera().at(time_s);
            true_view.begin(view, 0, 0);
            world.draw(true_view, time_s);
            depth_view.begin({view.rotation * colour_from_depth.rotation, view * colour_from_depth.translation}, 0, 0);
            world.draw(depth_view, time_s);
            const std::vector<std::uint16_t> truth = depth_of(true_view), seen = depth_of(depth_view);
            registration.reproject({seen.data(), 848, 480, 848}, registered.data());
            int wrong = 0, shining = 0, empty = 0, all = 0;
            for (std::size_t v = 2; v + 2 < 480; ++v) {
                for (std::size_t u = 2; u + 2 < 640; ++u) {
                    const double got = registered[v * 640 + u];
                    double lowest = 65535, highest = 0, nearest_gap = 65535;
                    for (std::size_t dv = v - 1; dv <= v + 1; ++dv) {
                        for (std::size_t du = u - 1; du <= u + 1; ++du) {
                            const double z_true = truth[dv * 640 + du];
                            lowest = std::min(lowest, z_true);
                            highest = std::max(highest, z_true);
                            nearest_gap = std::min(nearest_gap, std::abs(z_true - got));
                        }
                    }
                    ++all;
                    empty += got == 0;
                    if (got == 0) continue;
                    // On a slanted surface depth lies between those round it.
                    const double slack = 0.01 * got;
                    const bool is_between = got > lowest - slack && got < highest + slack;
                    const bool is_edge = highest - lowest > 0.05 * got;
                    wrong += is_edge ? nearest_gap > 0.03 * got : !is_between;
                    shining += got > highest + 0.03 * got;
                }
            }
            EXPECT_EQ(shining, 0) << scene.name << " " << time_s;
            EXPECT_LE(wrong, all / 2000) << scene.name << " " << time_s;
            EXPECT_LE(empty, all * 6 / 100) << scene.name << " " << time_s;
        }
    }
}

}  // namespace
}  // namespace stillmesh::registration_truth_test
