#include "engine/geometry/camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/geometry/lens.hpp"

namespace stillmesh::camera_test {
namespace {

// Published calibrations: TUM's Freiburg 1 (a strong k1..k3), 2 and the EuRoC left camera (a wide barrel).
CameraModel freiburg1() {
    return {640,      480,       517.306408, 516.469215, 318.643040, 255.313989,
            0.262383, -0.953104, -0.005358,  0.002628,   1.163314};
}
CameraModel freiburg2() {
    return {640,      480,       520.908620, 521.007327, 325.141442, 249.701764,
            0.231222, -0.784899, -0.003257,  -0.000105,  0.917205};
}
CameraModel freiburg3() {
    return {640, 480, 535.4, 539.2, 320.1, 247.6};
}
CameraModel euroc() {
    return {752, 480, 458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0};
}

// A Kinect for Azure's colour camera (eight coefficients, as its factory writes them, at 1280x720) and wide fisheyes: a
// T265's with published coefficients, and one without any, 150 degrees across the diagonal.
CameraModel azure() {
    CameraModel m{1280, 720, 607.0, 606.8, 638.5, 366.4, 0.51, -2.65, 0.0009, -0.0001, 1.52};
    m.k4 = 0.39;
    m.k5 = -2.48;
    m.k6 = 1.45;
    return m;
}
CameraModel t265() {
    CameraModel m{848, 800, 286.2, 286.1, 425.0, 402.0, -0.0069, 0.0424, 0, 0, -0.0397};
    m.k4 = 0.0063;
    m.lens = Lens::kFisheye;
    m.width = 560;  // its middle: the whole sees behind itself
    m.height = 420;
    m.cx -= 144;
    m.cy -= 190;
    return m;
}
CameraModel plain_fisheye() {
    CameraModel m{640, 480, 305.6, 305.6, 319.5, 239.5};
    m.lens = Lens::kFisheye;
    return m;
}

double residual_px(const CameraModel& model, const Vector2& pixel) {
    return (distort_to_pixel(model, undistort_to_normalised(model, pixel)) - pixel).norm();
}

// Brown's formula, written out once more in long double.
std::pair<double, double> brown(const CameraModel& m, double x, double y) {
    const long double lx = x, ly = y;
    const long double r2 = lx * lx + ly * ly;
    const long double radial = 1 + m.k1 * r2 + m.k2 * r2 * r2 + m.k3 * r2 * r2 * r2;
    const long double dx = lx * radial + 2 * m.p1 * lx * ly + m.p2 * (r2 + 2 * lx * lx);
    const long double dy = ly * radial + m.p1 * (r2 + 2 * ly * ly) + 2 * m.p2 * lx * ly;
    return {static_cast<double>(m.fx * dx + m.cx), static_cast<double>(m.fy * dy + m.cy)};
}

// Promise: distortion is Brown's formula as OpenCV, ROS and TUM write it.
TEST(Camera, DistortionIsBrowns) {
    Random random(1);
    for (const CameraModel& model : {freiburg1(), freiburg2(), freiburg3(), euroc()}) {
        for (int i = 0; i < 5000; ++i) {
            const Vector2 n(random.uniform(-0.8, 0.8), random.uniform(-0.6, 0.6));
            const auto [u, v] = brown(model, n.x(), n.y());
            ASSERT_NEAR(distort_to_pixel(model, n).x(), u, 1e-11);
            ASSERT_NEAR(distort_to_pixel(model, n).y(), v, 1e-11);
        }
    }
    // A worked value, so that an error common to both copies shows: x = 0.5, y = 0, k1 = 0.1, p2 = 0.01:
    // x' = 0.5 (1 + 0.1 * 0.25) + 0.01 (0.25 + 0.5) = 0.52; p1 = 0.02: y' = 0.02 * 0.25 = 0.005.
    CameraModel simple{640, 480, 100, 100, 0, 0, 0.1, 0, 0.02, 0.01, 0};
    EXPECT_NEAR(distort_to_pixel(simple, {0.5, 0.0}).x(), 52.0, 1e-12);
    EXPECT_NEAR(distort_to_pixel(simple, {0.5, 0.0}).y(), 0.5, 1e-12);
}

// Promise: each number of a lens alone is a lens: it bends, and it is bent back.
TEST(Camera, EveryCoefficientCounts) {
    const std::vector<double CameraModel::*> fields = {&CameraModel::k1, &CameraModel::k2, &CameraModel::p1,
                                                       &CameraModel::p2, &CameraModel::k3, &CameraModel::k4,
                                                       &CameraModel::k5, &CameraModel::k6};
    const Vector2 n(0.4, -0.3);
    for (const auto field : fields) {
        CameraModel m{640, 480, 500, 500, 320, 240};
        m.*field = 0.05;
        ASSERT_EQ(validate(m), Status::kOk);
        const Vector2 seen = distort_to_pixel(m, n);
        EXPECT_GT((seen - Vector2(520, 90)).norm(), 0.1);
        EXPECT_LT((undistort_to_normalised(m, seen) - n).norm(), 1e-9);
        const bool is_brown = field != &CameraModel::k4 && field != &CameraModel::k5 && field != &CameraModel::k6;
        if (!is_brown) continue;
        const auto [u, v] = brown(m, n.x(), n.y());
        EXPECT_NEAR(seen.x(), u, 1e-11);
        EXPECT_NEAR(seen.y(), v, 1e-11);
    }
}

// Promise: the rational lens is OpenCV's quotient of two polynomials, the fisheye its polynomial of the angle, written
// out once more with libm; a rational lens with zeros is Brown's to the bit, and near its axis a fisheye has no step.
TEST(Camera, OtherLensesAreOpenCvs) {
    Random random(3);
    for (int i = 0; i < 5000; ++i) {
        const double x = random.uniform(-0.9, 0.9), y = random.uniform(-0.6, 0.6);
        CameraModel m = azure();
        const long double r2 = static_cast<long double>(x) * x + static_cast<long double>(y) * y;
        const long double quotient = (1 + m.k1 * r2 + m.k2 * r2 * r2 + m.k3 * r2 * r2 * r2) /
                                     (1 + m.k4 * r2 + m.k5 * r2 * r2 + m.k6 * r2 * r2 * r2);
        const long double dx = x * quotient + 2 * m.p1 * x * y + m.p2 * (r2 + 2.0L * x * x);
        ASSERT_NEAR(distort_to_pixel(m, {x, y}).x(), static_cast<double>(m.fx * dx + m.cx), 1e-9);
        m = t265();
        const double theta = std::atan(std::hypot(x, y));
        const double bent = theta + m.k1 * std::pow(theta, 3) + m.k2 * std::pow(theta, 5) + m.k3 * std::pow(theta, 7) +
                            m.k4 * std::pow(theta, 9);
        const double factor = bent / std::hypot(x, y);
        ASSERT_NEAR(distort_to_pixel(m, {x, y}).x(), m.fx * x * factor + m.cx, 1e-9);
        ASSERT_NEAR(distort_to_pixel(m, {x, y}).y(), m.fy * y * factor + m.cy, 1e-9);
    }
    // A worked value: theta = 45 degrees, no coefficients: 100 px a radian.
    const CameraModel simple{640, 480, 100, 100, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, Lens::kFisheye};
    EXPECT_NEAR(distort_to_pixel(simple, {1.0, 0.0}).x(), 78.5398163397448, 1e-10);
    const double inside = distort_to_pixel(simple, {0.9999e-3, 0.0}).x(),
                 outside = distort_to_pixel(simple, {1.0001e-3, 0.0}).x();
    EXPECT_NEAR(outside - inside, 2e-7 * 100, 1e-10);
}

// Promise: undistortion undoes distortion at every pixel of the known cameras, far below the promised 0.01 px.
TEST(Camera, UndistortsEveryPixel) {
    for (const CameraModel& model :
         {freiburg1(), freiburg2(), freiburg3(), euroc(), azure(), t265(), plain_fisheye()}) {
        ASSERT_EQ(validate(model), Status::kOk);
        double worst = 0;
        for (std::uint32_t y = 0; y < model.height; ++y) {
            for (std::uint32_t x = 0; x < model.width; ++x) worst = std::max(worst, residual_px(model, Vector2(x, y)));
        }
        EXPECT_LT(worst, 1e-6);
    }
}

// Promise: what programs see of the lens is the engine's own, to the bit, both ways.
TEST(Camera, ProgramsSeeTheSameLens) {
    for (const CameraModel& model : {freiburg1(), freiburg3(), azure(), t265()}) {
        for (const Vector2& pixel :
             {Vector2(0, 0), Vector2(100.5, 37.25), Vector2(model.width - 1, model.height - 1)}) {
            const Vector2 ray = undistort_to_normalised(model, pixel);
            const ImagePoint seen = ray_of_pixel(model, {pixel.x(), pixel.y()});
            EXPECT_EQ(Vector2(seen.x, seen.y), ray);
            const ImagePoint back = pixel_of_ray(model, seen);
            EXPECT_EQ(Vector2(back.x, back.y), distort_to_pixel(model, ray));
        }
    }
}

// Promise: every model that validate() accepts has a residual below 0.01 px and no fold anywhere inside its image:
// undistorted neighbours keep their order. Random models, mild to absurd; both answers occur.
TEST(Camera, AcceptedModelsDoNotFold) {
    Random random(2);
    int accepted = 0;
    int refused = 0;
    for (int i = 0; i < 400; ++i) {
        CameraModel model{160, 120, 0, 0, 0, 0};
        model.fx = random.uniform(60.0, 250.0);
        model.fy = model.fx * random.uniform(0.9, 1.1);
        model.cx = 80.0 + random.uniform(-20.0, 20.0);
        model.cy = 60.0 + random.uniform(-20.0, 20.0);
        const double strength = random.uniform(0.0, 1.0);
        model.k1 = strength * random.uniform(-0.6, 0.6);
        model.k2 = strength * random.uniform(-1.2, 1.2);
        model.k3 = strength * random.uniform(-1.5, 1.5);
        model.p1 = strength * random.uniform(-0.03, 0.03);
        model.p2 = strength * random.uniform(-0.03, 0.03);
        if (validate(model) != Status::kOk) {
            ++refused;
            continue;
        }
        ++accepted;
        for (double y = 0; y <= 119; y += 3.5) {
            for (double x = 0; x <= 159; x += 3.5) {
                const Vector2 here = undistort_to_normalised(model, {x, y});
                const Vector2 right = undistort_to_normalised(model, {std::min(x + 0.5, 159.0), y});
                const Vector2 below = undistort_to_normalised(model, {x, std::min(y + 0.5, 119.0)});
                ASSERT_LT(residual_px(model, {x, y}), 0.01) << "model " << i << " at " << x << " " << y;
                if (x < 158 && y < 118) {
                    const Vector2 a = right - here;
                    const Vector2 b = below - here;
                    ASSERT_GT(a.x() * b.y() - a.y() * b.x(), 0.0) << "model " << i << " folds at " << x << " " << y;
                }
            }
        }
    }
    EXPECT_GT(accepted, 50);
    EXPECT_GT(refused, 50);
}

// Promise: without distortion the pinhole is exact both ways.
TEST(Camera, PinholeIsExact) {
    const CameraModel model = freiburg3();
    EXPECT_EQ(undistort_to_normalised(model, {model.cx, model.cy}), Vector2::Zero());
    EXPECT_EQ(distort_to_pixel(model, {0.0, 0.0}), Vector2(model.cx, model.cy));
    EXPECT_EQ(undistort_to_normalised(model, {model.cx + model.fx, model.cy}).x(), 1.0);
}

// Promise: whatever a pixel of the known cameras shows is projected to that pixel and visible, at any depth from the
// nearest on; of an off-centre camera too.
TEST(Camera, EveryPixelIsVisible) {
    CameraModel off_centre = freiburg3();
    off_centre.cx = 160.0;
    off_centre.cy = 400.0;
    for (const CameraModel& model :
         {freiburg1(), freiburg2(), freiburg3(), euroc(), off_centre, azure(), t265(), plain_fisheye()}) {
        for (std::uint32_t y = 0; y < model.height; y += 4) {
            for (std::uint32_t x = 0; x < model.width; x += 4) {
                const Vector2 n = undistort_to_normalised(model, Vector2(x + 0.25, y + 0.25));
                for (const double z : {0.5, 3.0}) {
                    Vector2 pixel;
                    ASSERT_TRUE(visible_pixel(model, {n.x() * z, n.y() * z, z}, 0.5, pixel)) << x << " " << y;
                    ASSERT_NEAR(pixel.x(), x + 0.25, 1e-6);
                    ASSERT_NEAR(pixel.y(), y + 0.25, 1e-6);
                    ASSERT_FALSE(visible_pixel(model, {n.x() * z, n.y() * z, z}, z + 1e-9, pixel));
                }
            }
        }
    }
}

// Promise: visible is what Brown's formula puts into the picture, its left and upper border included; but not what lies
// so far out that the formula folds it back, nor what is behind the camera or not finite.
TEST(Camera, NothingElseIsVisible) {
    Random random(7);
    int visible = 0, outside = 0;
    for (const CameraModel& model : {freiburg1(), freiburg2(), freiburg3(), euroc()}) {
        for (int i = 0; i < 20000; ++i) {
            const Vector3 q(random.uniform(-4, 4), random.uniform(-3, 3), random.uniform(-1, 4));
            Vector2 pixel;
            const bool is_visible = visible_pixel(model, q, 0.2, pixel);
            bool is_wanted = q.z() >= 0.2;
            if (is_wanted) {
                const auto [u, v] = brown(model, q.x() / q.z(), q.y() / q.z());
                is_wanted = u >= 0 && v >= 0 && u < model.width && v < model.height;
            }
            ASSERT_EQ(is_visible, is_wanted) << q.x() << " " << q.y() << " " << q.z();
            ++(is_visible ? visible : outside);
        }
    }
    EXPECT_GT(visible, 10000);
    EXPECT_GT(outside, 10000);
    // Of a fisheye: what lies before it, up to 84 degrees off its axis, and is drawn inside the picture.
    for (int i = 0; i < 20000; ++i) {
        const CameraModel m = plain_fisheye();
        const Vector3 q(random.uniform(-4, 4), random.uniform(-3, 3), random.uniform(0.5, 1));
        const double r = std::hypot(q.x(), q.y());
        const double factor = m.fx * std::atan2(r, q.z()) / r;
        const Vector2 at(q.x() * factor + m.cx, q.y() * factor + m.cy);
        Vector2 pixel;
        ASSERT_EQ(visible_pixel(m, q, 0.2, pixel), is_in_picture(m, at)) << q.x() << " " << q.y() << " " << q.z();
    }
    const CameraModel plain{640, 480, 500, 500, 320, 240};
    Vector2 pixel;
    EXPECT_TRUE(visible_pixel(plain, {-0.64, -0.48, 1.0}, 0.2, pixel));
    EXPECT_FALSE(visible_pixel(plain, {0.64, 0.0, 1.0}, 0.2, pixel));
    EXPECT_FALSE(visible_pixel(plain, {0.0, 0.48, 1.0}, 0.2, pixel));
    CameraModel barrel = plain;
    barrel.k1 = -0.2;
    ASSERT_EQ(validate(barrel), Status::kOk);
    EXPECT_TRUE(is_in_picture(barrel, distort_to_pixel(barrel, {1.8, 0.0})));  // folded back
    EXPECT_FALSE(visible_pixel(barrel, {1.8, 0.0, 1.0}, 0.2, pixel));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const double infinite = std::numeric_limits<double>::infinity();
    for (const Vector3& q : {Vector3(0, 0, nan), Vector3(nan, 0, 1), Vector3(0, nan, 1), Vector3(infinite, 0, 1),
                             Vector3(infinite, 0, infinite)}) {
        EXPECT_FALSE(visible_pixel(plain, q, 0.2, pixel));
    }
    // Around the picture there is a pixel too, for who wants to know by how much it is missed.
    EXPECT_TRUE(project(plain, {0.65, 0.0, 1.0}, 0.2, pixel));
    EXPECT_NEAR(pixel.x(), 645.0, 1e-9);
}

// Promise: around the picture of a wide lens there is a pixel, too, as far out as a fifth of the picture's larger side
// and of the focal length beyond its centre, on each side for itself, and no farther; at 45 degrees as anywhere.
TEST(Camera, HowFarAroundAWideLensSees) {
    CameraModel m = plain_fisheye();
    m.fx = m.fy = 600;
    m.cx = 250;
    m.cy = 290;
    const double reach_x = 1.2 * (640 - 250) + 0.2 * m.fx, reach_y = 1.2 * 290 + 0.2 * m.fy;
    constexpr double kEnd = 80 * 3.14159265358979 / 180;
    Random random(8);
    std::uint32_t inside = 0, outside[2] = {0, 0};
    for (int i = 0; i < 20000; ++i) {
        const double off_axis = random.uniform(0.01, kEnd), around = random.uniform(-3.14, 3.14);
        const Vector2 off = m.fx * off_axis * Vector2(std::cos(around), std::sin(around));
        const double across = std::tan(off_axis);
        Vector2 pixel;
        const bool is_seen = project(m, {2 * across * std::cos(around), 2 * across * std::sin(around), 2}, 0.2, pixel);
        const bool is_x = std::abs(off.x()) <= reach_x, is_y = std::abs(off.y()) <= reach_y;
        ASSERT_EQ(is_seen, is_x && is_y) << off.x() << " " << off.y();
        inside += is_seen ? 1U : 0U;
        outside[0] += is_x ? 0U : 1U;
        outside[1] += is_y ? 0U : 1U;
        if (!is_seen) continue;
        ASSERT_NEAR(pixel.x(), m.cx + off.x(), 1e-6);
        ASSERT_NEAR(pixel.y(), m.cy + off.y(), 1e-6);
    }
    EXPECT_GT(inside, 10000U);
    EXPECT_GT(std::min(outside[0], outside[1]), 1000U);
    Vector2 pixel;
    EXPECT_TRUE(project(m, {2, 0, 2}, 0.2, pixel));
    EXPECT_TRUE(project(m, {-std::sqrt(2.0), std::sqrt(2.0), 2}, 0.2, pixel));
}

// Promise: nonsense is refused with kInvalid: no size, no focal length, no number, an image that folds over.
TEST(Camera, RefusesNonsense) {
    const auto refuses = [](auto change) {
        CameraModel model = freiburg1();
        change(model);
        return validate(model) == Status::kInvalid;
    };
    ASSERT_EQ(validate(freiburg1()), Status::kOk);
    EXPECT_TRUE(refuses([](CameraModel& m) { m.width = 0; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.height = 0; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.fx = 0; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.fy = -500; }));
    const std::vector<double CameraModel::*> fields = {&CameraModel::fx, &CameraModel::fy, &CameraModel::cx,
                                                       &CameraModel::cy, &CameraModel::k1, &CameraModel::k2,
                                                       &CameraModel::p1, &CameraModel::p2, &CameraModel::k3};
    for (const auto field : fields) {
        EXPECT_TRUE(refuses([&](CameraModel& m) { m.*field = std::numeric_limits<double>::quiet_NaN(); }));
        EXPECT_TRUE(refuses([&](CameraModel& m) { m.*field = std::numeric_limits<double>::infinity(); }));
    }
    EXPECT_TRUE(refuses([](CameraModel& m) { m.k1 = -2.0; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.k3 = -20.0; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.k2 = 1e300; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.p1 = 2.0; }));
    // A denominator with a pole in the picture, a fisheye with tangential coefficients, one that sees behind itself.
    EXPECT_TRUE(refuses([](CameraModel& m) { m.k4 = -20.0; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.k6 = std::numeric_limits<double>::quiet_NaN(); }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m.lens = Lens::kFisheye; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m = plain_fisheye(), m.fx = m.fy = 200; }));
    EXPECT_TRUE(refuses([](CameraModel& m) { m = plain_fisheye(), m.k1 = -0.5; }));
    for (const auto field : {&CameraModel::p1, &CameraModel::p2, &CameraModel::k5, &CameraModel::k6}) {
        EXPECT_TRUE(refuses([&](CameraModel& m) { m = plain_fisheye(), m.*field = 0.01; }));
    }
    EXPECT_TRUE(refuses([](CameraModel& m) { m.lens = static_cast<Lens>(7); }));
    // Folded at the sides alone, which lie farther out than top and bottom.
    for (const double cx : {0.0, 639.0}) {
        EXPECT_TRUE(refuses([&](CameraModel& m) { m = {640, 10, 300, 300, cx, 5, -0.1}; }));
        EXPECT_FALSE(refuses([&](CameraModel& m) { m = {640, 10, 600, 600, cx, 5, -0.1}; }));
    }
    EXPECT_FALSE(refuses([](CameraModel& m) { m = plain_fisheye(); }));
}

// Promise: pixels far outside the image still give finite numbers.
TEST(Camera, StaysFiniteOutside) {
    for (const CameraModel& model : {freiburg1(), freiburg2(), euroc(), azure(), t265(), plain_fisheye()}) {
        for (double x = -3000; x <= 3000; x += 150) {
            for (double y = -3000; y <= 3000; y += 150) {
                const Vector2 n = undistort_to_normalised(model, {x, y});
                ASSERT_TRUE(std::isfinite(n.x()) && std::isfinite(n.y())) << x << " " << y;
            }
        }
    }
}

}  // namespace
}  // namespace stillmesh::camera_test
