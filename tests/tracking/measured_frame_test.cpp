#include "engine/tracking/measured_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::measured_frame_test {
namespace {

class Measured : public testing::Test {
protected:
    explicit Measured(const Parameters& parameters = test::small_parameters()) : world_(parameters), frame_(*world_) {}
    [[nodiscard]] const MeasuredFeature& seen(std::size_t i) const { return frame_.measured[i]; }

    test::SmallWorld world_;
    test::SmallFrame frame_;
};

// Promise: a feature has the ray of its pixel, the depth there, the depth's variance (c z^2)^2 on a flat patch, and the
// pixel's variance (sigma s^level)^2 / (fx fy); without depth it has its ray.
TEST_F(Measured, RaysDepthsAndVariances) {
    const Parameters& c = world_->parameters;
    const CameraModel camera = test::small_camera();
    const double depths_m[] = {0.5, 1.0, 2.5, 5.0, 0.0};
    std::uint32_t n = 0;
    for (const double z_m : depths_m) {
        for (std::uint8_t level = 0; level < 3; ++level) {
            frame_.add(10 + 9 * n, 8 + 7 * n, z_m, test::descriptor_of(n), level);
            ++n;
        }
    }
    frame_.measure();
    ASSERT_EQ(frame_.measured.size(), n);
    EXPECT_EQ(frame_.measured.with_depth_count(), n - 3);
    for (std::uint32_t i = 0; i < n; ++i) {
        const double z_m = depths_m[i / 3];
        const MeasuredFeature& m = seen(i);
        const Vector3 p = test::point_at_pixel(10 + 9 * i, 8 + 7 * i, 1);
        EXPECT_LT(std::sqrt((m.normalised - Vector2(p.x(), p.y())).squaredNorm()), 1e-9);
        EXPECT_EQ(m.has_depth(), z_m > 0);
        if (z_m > 0) {
            EXPECT_NEAR(m.z_m, z_m, 1e-12);
            EXPECT_NEAR(m.var_z, std::pow(c.depth.sigma_z_per_m2 * z_m * z_m, 2), 1e-15);
            EXPECT_LT(std::sqrt((m.point() - p * z_m).squaredNorm()), 1e-9);
        }
        const double sigma = c.depth.sigma_pixel * std::pow(c.features.scale_factor, i % 3);
        EXPECT_NEAR(m.var_pixel, sigma * sigma / (camera.fx * camera.fy), 1e-15);
        EXPECT_EQ(frame_.measured.keypoint(i).x, 10 + 9 * i);
        EXPECT_EQ(frame_.measured.descriptor(i), test::descriptor_of(i));
    }
}

// Promise: at a border the depth is the mean of the pixels around, weighted 1 2 1, and its variance the sensor's with
// the spread; holes have no weight.
TEST_F(Measured, BordersAreUnsure) {
    frame_.add(40, 40, 2.0, test::descriptor_of(0));
    for (std::uint32_t y = 39; y <= 41; ++y) frame_.depth()[y * 160 + 41] = 10'200;  // 2.04 m, a quarter of the weight
    frame_.depth()[40 * 160 + 39] = 0;                                               // two sixteenths
    frame_.measure();
    const double weight = 14, far = 4, near = 10;
    const double mean = (near * 2.0 + far * 2.04) / weight;
    const double spread = (near * std::pow(2.0 - mean, 2) + far * std::pow(2.04 - mean, 2)) / weight;
    const double coefficient = world_->parameters.depth.sigma_z_per_m2;
    const double sensor = coefficient * coefficient * (near * std::pow(2.0, 4) + far * std::pow(2.04, 4)) / weight;
    EXPECT_NEAR(seen(0).z_m, mean, 1e-12);
    EXPECT_NEAR(seen(0).var_z, sensor + spread, 1e-12);
}

// Promise: depth nearer than z_min_m, farther than z_max_m or less certain than sigma_max_m is none; each limit is the
// parameters's.
TEST(MeasuredFrameParameters, DepthsThatAreUsed) {
    struct Case {
        double z_min_m, z_max_m, sigma_max_m, z_m;
        bool is_used;
    };
    const double sigma_at_4_m = DepthParameters{}.sigma_z_per_m2 * 16;
    const Case cases[] = {
        {0.3, 6, 0.15, 0.29, false},
        {0.3, 6, 0.15, 0.31, true},
        {0.2, 6, 0.15, 0.29, true},
        {0.3, 6, 0.15, 6.01, false},
        {0.3, 6, 0.15, 5.99, true},
        {0.3, 8, 0.15, 6.01, true},
        {0.3, 6, 1.01 * sigma_at_4_m, 4, true},
        {0.3, 6, 0.99 * sigma_at_4_m, 4, false},
    };
    for (const Case& c : cases) {
        Parameters parameters = test::small_parameters();
        parameters.depth.z_min_m = c.z_min_m;
        parameters.depth.z_max_m = c.z_max_m;
        parameters.depth.sigma_max_m = c.sigma_max_m;
        test::SmallWorld world(parameters);
        test::SmallFrame frame(*world);
        frame.add(40, 40, c.z_m, {});
        frame.measure();
        EXPECT_EQ(frame.measured[0].has_depth(), c.is_used) << c.z_m << " m of " << c.z_min_m << " to " << c.z_max_m;
        EXPECT_EQ(frame.measured.with_depth_count(), c.is_used ? 1U : 0U);
    }
}

// Promise: noise is the parameters's: twice the deviation is four times the variance, and a level is as coarse as
// its scale.
TEST(MeasuredFrameParameters, NoiseIsConfigured) {
    const auto measured = [](double sigma_z_per_m2, double sigma_pixel, double scale_factor) {
        Parameters parameters = test::small_parameters();
        parameters.depth.sigma_z_per_m2 = sigma_z_per_m2;
        parameters.depth.sigma_pixel = sigma_pixel;
        parameters.features.scale_factor = scale_factor;
        test::SmallWorld world(parameters);
        test::SmallFrame frame(*world);
        frame.add(40, 40, 2, {}, 2);
        frame.measure();
        return frame.measured[0];
    };
    const MeasuredFeature usual = measured(1e-3, 1.0, 1.2);
    EXPECT_NEAR(measured(2e-3, 1.0, 1.2).var_z, 4 * usual.var_z, 1e-15);
    EXPECT_NEAR(measured(1e-3, 2.0, 1.2).var_pixel, 4 * usual.var_pixel, 1e-15);
    EXPECT_NEAR(measured(1e-3, 1.0, 1.8).var_pixel / usual.var_pixel, std::pow(1.5, 4), 1e-9);
}

// Promise: what a row sees is carried to the middle row along the camera's motion, by the share of it between the
// two; what has no depth is turned only. Carried again it starts from what was seen, not from what was carried.
TEST_F(Measured, RowsAreCarriedToTheMiddle) {
    const std::uint32_t rows[] = {5, 30, 60, 90, 114};
    std::uint32_t n = 0;
    for (const std::uint32_t y : rows) {
        frame_.add(30, y, 1.5, test::descriptor_of(n++));
        frame_.add(120, y, 0, test::descriptor_of(n++));
    }
    frame_.measure();
    Vector6 sweep;
    sweep << 0.006, -0.004, 0.002, 0.001, 0.004, -0.002;  // within a frame a turn bends the slide by a thousandth
    for (const double sign : {1.0, -0.5, 0.0}) {
        frame_.measured.carry_to_middle_row(sweep * sign);
        for (std::uint32_t i = 0; i < n; ++i) {
            const double row = rows[i / 2] / 120.0 - 0.5;
            EXPECT_EQ(frame_.measured.row_of(i), row);
            const bool has_depth = i % 2 == 0;
            const Vector3 then = test::point_at_pixel(has_depth ? 30 : 120, rows[i / 2], has_depth ? 1.5 : 1.0);
            Vector6 moved = sweep * (sign * row);
            if (!has_depth) {
                for (int k = 0; k < 3; ++k) moved(k) = 0;
            }
            const Vector3 p = se3_exp(moved) * then;
            EXPECT_NEAR(seen(i).normalised.x(), p.x() / p.z(), 5e-6);
            EXPECT_NEAR(seen(i).normalised.y(), p.y() / p.z(), 5e-6);
            EXPECT_NEAR(seen(i).z_m, has_depth ? p.z() : 0, 5e-6);
            EXPECT_NEAR(seen(i).seen.x(), then.x() / then.z(), 1e-12);
            EXPECT_EQ(seen(i).seen_z_m, has_depth ? 1.5 : 0);
        }
    }
}

// Promise: a motion that carries a feature behind the camera leaves it where it was seen.
TEST_F(Measured, WhatWouldBeBehindTheCameraStays) {
    frame_.add(30, 5, 1.5, test::descriptor_of(0));
    frame_.add(60, 5, 0, test::descriptor_of(1));
    frame_.measure();
    Vector6 sweep = Vector6::Zero();
    sweep(2) = 10;
    sweep(3) = 10;
    frame_.measured.carry_to_middle_row(sweep);
    for (std::size_t i = 0; i < 2; ++i) {
        EXPECT_EQ(seen(i).normalised.x(), seen(i).seen.x());
        EXPECT_EQ(seen(i).normalised.y(), seen(i).seen.y());
        EXPECT_EQ(seen(i).z_m, seen(i).seen_z_m);
    }
}

// Promise: an extractor that fails, or whose features do not keep to the contract, leaves a frame without features, and
// the next frame is none the worse; whatever is at the edge of the contract is used.
TEST_F(Measured, ABrokenExtractorCostsTheFrame) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float inside = std::nextafter(160.0F, 0.0F);
    struct Case {
        float x, y;
        std::uint8_t level;
        Status status;
        int descriptors_more;
        bool is_used;
    };
    const Case cases[] = {
        {0, 0, 0, Status::kOk, 0, true},
        {inside, 119.99F, kPyramidLevelsMax - 1, Status::kOk, 0, true},
        {-0.001F, 40, 0, Status::kOk, 0, false},
        {40, -0.001F, 0, Status::kOk, 0, false},
        {160, 40, 0, Status::kOk, 0, false},
        {40, 120, 0, Status::kOk, 0, false},
        {nan, 40, 0, Status::kOk, 0, false},
        {40, nan, 0, Status::kOk, 0, false},
        {40, 40, kPyramidLevelsMax, Status::kOk, 0, false},
        {40, 40, 0, Status::kInvalid, 0, false},
        {40, 40, 0, Status::kOk, 1, false},
        {40, 40, 0, Status::kOk, -1, false},
    };
    for (const Case& c : cases) {
        frame_.extractor.keypoints.assign(2, {});
        frame_.extractor.keypoints[0].x = frame_.extractor.keypoints[0].y = 20;
        frame_.extractor.keypoints[1].x = c.x;
        frame_.extractor.keypoints[1].y = c.y;
        frame_.extractor.keypoints[1].level = c.level;
        frame_.extractor.descriptors.assign(static_cast<std::size_t>(2 + c.descriptors_more), {});
        frame_.extractor.status = c.status;
        frame_.measure();
        EXPECT_EQ(frame_.measured.size(), c.is_used ? 2U : 0U) << c.x << ' ' << c.y << ' ' << int{c.level};
        EXPECT_EQ(frame_.measured.with_depth_count(), 0U);
    }
    frame_.extractor.status = Status::kOk;
    frame_.extractor.descriptors.assign(2, {});
    frame_.extractor.keypoints[1] = frame_.extractor.keypoints[0];
    frame_.measure();
    EXPECT_EQ(frame_.measured.size(), 2U);
    frame_.measured.clear();
    EXPECT_EQ(frame_.measured.size(), 0U);
}

// Promise: an observation is what a keyframe needs of the feature: the raw pixel, the carried ray and depth, and no
// point.
TEST_F(Measured, ObservationsShowNoPoint) {
    frame_.add(30, 114, 1.5, {}, 2);
    frame_.add(120, 5, 0, {}, 1);
    frame_.extractor.keypoints[0].angle_rad = 0.7F;
    frame_.measure();
    Vector6 sweep = Vector6::Zero();
    sweep(0) = 0.02;
    sweep(1) = -0.014;
    frame_.measured.carry_to_middle_row(sweep);
    const Observation o = frame_.measured.observation_of(0);
    EXPECT_TRUE(o.point.is_null());
    EXPECT_EQ(o.x, 30);
    EXPECT_EQ(o.y, 114);
    EXPECT_EQ(o.normalised_x, static_cast<float>(seen(0).normalised.x()));
    EXPECT_NE(o.normalised_x, static_cast<float>(seen(0).seen.x()));
    EXPECT_EQ(o.normalised_y, static_cast<float>(seen(0).normalised.y()));
    EXPECT_NE(o.normalised_y, static_cast<float>(seen(0).seen.y()));
    EXPECT_EQ(o.z_m, static_cast<float>(seen(0).z_m));
    EXPECT_EQ(o.var_z, static_cast<float>(seen(0).var_z));
    EXPECT_EQ(o.angle_rad, 0.7F);
    EXPECT_EQ(o.level, 2);
    EXPECT_EQ(o.averaged, 1);
    EXPECT_LT(frame_.measured.observation_of(1).var_z, 0);
}

// Promise: a grey picture is borrowed as it is, padding and all; a coloured one is converted row by row, and its two
// orders of channels agree.
TEST_F(Measured, ColoursBecomeGrey) {
    Frame& frame = frame_.frame();
    EXPECT_EQ(frame_.measured.grey_of(frame).data, frame.colour.data);
    const std::uint32_t stride = 3 * 160 + 5;
    std::vector<std::uint8_t> rgb(std::size_t{stride} * 120), bgr(rgb.size());
    Random random(1);
    for (std::uint32_t y = 0; y < 120; ++y) {
        for (std::uint32_t x = 0; x < 160; ++x) {
            for (std::uint32_t k = 0; k < 3; ++k) {
                const auto value = static_cast<std::uint8_t>(random.below(256));
                rgb[y * stride + 3 * x + k] = value;
                bgr[y * stride + 3 * x + 2 - k] = value;
            }
        }
    }
    frame.format = PixelFormat::kRgb8;
    frame.colour = {rgb.data(), 160, 120, stride};
    const GreyView from_rgb = frame_.measured.grey_of(frame);
    ASSERT_EQ(from_rgb.width, 160U);
    ASSERT_EQ(from_rgb.height, 120U);
    std::vector<std::uint8_t> kept;
    for (std::uint32_t y = 0; y < 120; ++y) kept.insert(kept.end(), from_rgb.row(y), from_rgb.row(y) + 160);
    for (std::uint32_t y = 0; y < 120; y += 7) {
        for (std::uint32_t x = 0; x < 160; x += 3) {
            const std::uint8_t* const p = &rgb[y * stride + 3 * x];
            EXPECT_NEAR(kept[y * 160 + x], 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2], 1.5);
        }
    }
    frame.format = PixelFormat::kBgr8;
    frame.colour = {bgr.data(), 160, 120, stride};
    const GreyView from_bgr = frame_.measured.grey_of(frame);
    for (std::uint32_t y = 0; y < 120; ++y) {
        for (std::uint32_t x = 0; x < 160; ++x) ASSERT_EQ(from_bgr.row(y)[x], kept[y * 160 + x]);
    }
}

}  // namespace
}  // namespace stillmesh::measured_frame_test
