// The tables of a RealSense: read to the bit, and nothing that is damaged is read.
#include "hal/v4l2/realsense_tables.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/v4l2/realsense_bytes.hpp"

namespace stillmesh::v4l2::realsense_tables_test {
namespace {

using test::Bytes;

[[nodiscard]] CameraModel of_size(std::uint32_t width, std::uint32_t height) {
    CameraModel model;
    model.width = width;
    model.height = height;
    return model;
}

// Promise: a command has the form that the camera knows: length, mark, code, parameters, zeros.
TEST(RealSenseTables, Command) {
    const Message message = command_message(Command::kCalibration, 25);
    Bytes expected(1024, 0);
    expected[0] = 20;
    expected[2] = 0xab;
    expected[3] = 0xcd;
    expected[4] = 0x15;
    expected[8] = 25;
    EXPECT_TRUE(std::equal(message.begin(), message.end(), expected.begin()));
}

// Promise: an answer to something else, or the camera's error, is told; a length that cannot be is not believed.
TEST(RealSenseTables, Answer) {
    std::span<const std::uint8_t> body;
    std::string message;
    const auto read = [&](const Bytes& bytes) {
        return answer_body(Command::kDetails, std::span(bytes).first<kMessageBytes>(), body, message);
    };
    Bytes bytes = test::answer(0x10, test::details());
    ASSERT_EQ(read(bytes), Status::kOk);
    EXPECT_EQ(body.size(), test::details().size());
    test::put_u32(bytes, 1020, 0xffffffffU);
    ASSERT_EQ(read(bytes), Status::kOk);
    EXPECT_EQ(body.size(), 1016U);
    test::put_u32(bytes, 0, 0xfffffffaU);
    EXPECT_EQ(read(bytes), Status::kCorrupt);
    EXPECT_EQ(message, "command 0x10 is answered with -6");
}

// Promise: serial number and firmware as on the label.
TEST(RealSenseTables, Details) {
    DeviceDetails details;
    std::string message;
    ASSERT_EQ(parse_details(test::details(), details, message), Status::kOk);
    EXPECT_EQ(details.serial, "0123456789ab");
    EXPECT_EQ(details.firmware, "5.16.0.1");
    Bytes cut = test::details();
    cut.resize(53);
    EXPECT_EQ(parse_details(cut, details, message), Status::kCorrupt);
}

// Promise: the depth unit in units per metre; nonsense is refused.
TEST(RealSenseTables, DepthUnits) {
    double units = 7;
    std::string message;
    ASSERT_EQ(parse_depth_units(test::depth_unit(1000), units, message), Status::kOk);
    EXPECT_EQ(units, 1000);
    ASSERT_EQ(parse_depth_units(test::depth_unit(100), units, message), Status::kOk);
    EXPECT_EQ(units, 10'000);
    for (const std::uint32_t unit : {0U, 10'001U, 0xffffffffU}) {
        EXPECT_EQ(parse_depth_units(test::depth_unit(unit), units, message), Status::kCorrupt);
    }
    EXPECT_EQ(parse_depth_units({}, units, message), Status::kCorrupt);
    EXPECT_EQ(units, 10'000);
}

// Promise: every size has its own four numbers, to the bit, and no distortion; a size without is the largest, scaled.
TEST(RealSenseTables, Depth) {
    const Bytes table = test::depth_table();
    std::string message;
    for (std::size_t k = 0; k < 13; ++k) {
        const test::DepthEntry& size = test::kDepthEntries[k];
        if (size.width == 0) continue;
        CameraModel model = of_size(size.width, size.height);
        ASSERT_EQ(parse_depth_table(table, model, message), Status::kOk) << message;
        const auto numbers = test::depth_numbers(k);
        CameraModel expected = of_size(size.width, size.height);
        expected.fx = numbers[0];
        expected.fy = numbers[1];
        expected.cx = numbers[2];
        expected.cy = numbers[3];
        EXPECT_EQ(model, expected) << size.width;
    }
    CameraModel small = of_size(960, 540 / 2);
    ASSERT_EQ(parse_depth_table(table, small, message), Status::kOk);
    EXPECT_EQ(small.fx, 480);
    EXPECT_EQ(small.fy, 960.25 / 4);
}

// Promise: normalised numbers become pixels of the size that is asked for: cut at the sides, or above and below.
TEST(RealSenseTables, Colour) {
    std::string message;
    CameraModel wide = of_size(1920, 1080), square = of_size(640, 480), low = of_size(960, 270);
    RigidTransform pose;
    const Bytes table = test::colour_table();
    ASSERT_EQ(parse_colour_table(table, kD435, wide, pose, message), Status::kOk) << message;
    EXPECT_EQ(wide.fx, 1.4375 * 960);
    EXPECT_EQ(wide.fy, 2.53125 * 540);
    EXPECT_EQ(wide.cx, 1.015625 * 960);
    EXPECT_EQ(wide.cy, 0.96875 * 540);
    EXPECT_EQ(wide.k1, 0.125);
    EXPECT_EQ(wide.k2, -0.25);
    EXPECT_EQ(wide.p1, 0.001953125);
    EXPECT_EQ(wide.p2, -0.0009765625);
    EXPECT_EQ(wide.k3, 0.0625);
    EXPECT_TRUE(wide.is_plain_brown());
    // The same focal length and centre in the middle third of the image, at 480 of 1080 lines.
    ASSERT_EQ(parse_colour_table(table, kD435, square, pose, message), Status::kOk);
    EXPECT_NEAR(square.fx, wide.fx * 480 / 1080, 1e-9);
    EXPECT_NEAR(square.fy, wide.fy * 480 / 1080, 1e-9);
    EXPECT_NEAR(square.cx - 320, (wide.cx - 960) * 480 / 1080, 1e-9);
    EXPECT_NEAR(square.cy - 240, (wide.cy - 540) * 480 / 1080, 1e-9);
    ASSERT_EQ(parse_colour_table(table, kD435, low, pose, message), Status::kOk);
    EXPECT_NEAR(low.fx, wide.fx / 2, 1e-9);
    EXPECT_NEAR(low.fy, wide.fy / 2, 1e-9);
    EXPECT_NEAR(low.cy - 135, (wide.cy - 540) / 2, 1e-9);
}

// Promise: the D405's own way of cutting: 1280x720 as it is; 640x480 is 770x480 of all its 1280x800 pixels, less 65
// columns on each side.
TEST(RealSenseTables, ColourOfTheD405) {
    std::string message;
    RigidTransform pose;
    test::ColourNumbers numbers;
    numbers.fx = 1.0F;
    numbers.fy = 1.75F;
    numbers.width = 1280;
    numbers.height = 720;
    const Bytes table = test::colour_table(numbers);
    CameraModel wide = of_size(1280, 720), square = of_size(640, 480), half = of_size(640, 360);
    ASSERT_EQ(parse_colour_table(table, kD405, wide, pose, message), Status::kOk) << message;
    EXPECT_EQ(wide.fx, 640);
    EXPECT_EQ(wide.fy, 630);
    ASSERT_EQ(parse_colour_table(table, kD405, square, pose, message), Status::kOk);
    const double scale = 770.0 / 1280;
    EXPECT_NEAR(square.fx, 640 * scale, 1e-3);
    EXPECT_NEAR(square.fy, 630 * scale, 1e-3);
    EXPECT_NEAR(square.cx, 1.015625 * 640 * scale - 65, 1e-3);
    EXPECT_NEAR(square.cy, (1 - 0.03125 * 0.9) * 400 * scale - (800 * scale - 480) / 2, 1e-3);
    ASSERT_EQ(parse_colour_table(table, kD405, half, pose, message), Status::kOk);
    EXPECT_NEAR(half.fx, 320, 1e-9);
    EXPECT_NEAR(half.cx, wide.cx / 2, 1e-9);
}

// Promise: where the colour camera stands: points of the depth camera's frame come out as the table's rotation and
// translation say, for turns of every kind.
TEST(RealSenseTables, Pose) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> one(-1, 1);
    for (int i = 0; i < 1000; ++i) {
        // A rotation by rows, from two random directions.
        double rows[3][3] = {{one(random), one(random), one(random)}, {one(random), one(random), one(random)}, {}};
        const auto normalise = [](double(&v)[3]) {
            const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            for (double& x : v) x /= length;
            return length;
        };
        if (normalise(rows[0]) < 0.1) continue;
        const double along = rows[0][0] * rows[1][0] + rows[0][1] * rows[1][1] + rows[0][2] * rows[1][2];
        for (int j = 0; j < 3; ++j) rows[1][j] -= along * rows[0][j];
        if (normalise(rows[1]) < 0.1) continue;
        for (int j = 0; j < 3; ++j) {
            const int a = (j + 1) % 3, b = (j + 2) % 3;
            rows[2][j] = rows[0][a] * rows[1][b] - rows[0][b] * rows[1][a];
        }
        test::ColourNumbers numbers;
        for (std::size_t j = 0; j < 9; ++j) numbers.rotation[j] = static_cast<float>(rows[j / 3][j % 3]);
        CameraModel model = of_size(640, 480);
        RigidTransform pose;
        std::string message;
        ASSERT_EQ(parse_colour_table(test::colour_table(numbers), kD435, model, pose, message), Status::kOk) << message;
        // A point in the depth camera's frame; librealsense's pose is depth from colour, with -0.001 of the table's
        // translation: colour = R (depth + 0.001 t).
        const double p[3] = {one(random), one(random), 2 + one(random)};
        const double t[3] = {0.01475, 0.00025, -0.0005};
        const double* const q = pose.rotation_xyzw;
        EXPECT_GE(q[3], 0);
        const double cross[3] = {q[1] * p[2] - q[2] * p[1] + q[3] * p[0], q[2] * p[0] - q[0] * p[2] + q[3] * p[1],
                                 q[0] * p[1] - q[1] * p[0] + q[3] * p[2]};
        for (int j = 0; j < 3; ++j) {
            const int a = (j + 1) % 3, b = (j + 2) % 3;
            const double turned = p[j] + 2 * (q[a] * cross[b] - q[b] * cross[a]);
            double expected = 0;
            for (int k = 0; k < 3; ++k) expected += rows[j][k] * (p[k] + t[k]);
            ASSERT_NEAR(turned + pose.translation_m[j], expected, 1e-5) << i;
        }
    }
}

// Promise: one wrong bit anywhere behind the head, or in the checksum, and a table is refused with a sentence; so is
// one that is cut off. Nothing is touched then.
TEST(RealSenseTables, Damaged) {
    std::string message;
    const Bytes depth = test::depth_table(), colour = test::colour_table();
    const auto is_read = [&](const Bytes& bytes, bool is_depth) {
        CameraModel model = of_size(640, 480);
        const CameraModel before = model;
        RigidTransform pose;
        message.clear();
        const Status status = is_depth ? parse_depth_table(bytes, model, message)
                                       : parse_colour_table(bytes, kD435, model, pose, message);
        EXPECT_EQ(status == Status::kOk, message.empty());
        if (status != Status::kOk) {
            EXPECT_EQ(model, before);
        }
        return status == Status::kOk;
    };
    for (const bool is_depth : {true, false}) {
        const Bytes& whole = is_depth ? depth : colour;
        ASSERT_TRUE(is_read(whole, is_depth)) << message;
        for (std::size_t bit = 12 * 8; bit < whole.size() * 8; ++bit) {
            Bytes wrong = whole;
            wrong[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
            ASSERT_FALSE(is_read(wrong, is_depth)) << bit;
        }
        for (std::size_t size = 0; size < whole.size(); ++size) {
            ASSERT_FALSE(is_read(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)), is_depth));
        }
        // Zeros behind it, as where the answer's length is not known.
        Bytes longer = whole;
        longer.resize(1016);
        EXPECT_TRUE(is_read(longer, is_depth)) << message;
    }
}

// Promise: numbers that no camera has are refused although their checksum is right.
TEST(RealSenseTables, Implausible) {
    std::string message;
    RigidTransform pose;
    for (const float number : {0.0F, -1.0F, 1e9F, NAN, INFINITY}) {
        CameraModel model = of_size(848, 480);
        Bytes depth = test::depth_table();
        test::put_float(depth, 256 + 16 * 3, number);
        test::seal(depth, 25);
        EXPECT_EQ(parse_depth_table(depth, model, message), Status::kCorrupt);
        test::ColourNumbers numbers;
        numbers.fx = number;
        EXPECT_EQ(parse_colour_table(test::colour_table(numbers), kD435, model, pose, message), Status::kCorrupt);
        numbers = {};
        numbers.rotation[4] = number;
        EXPECT_EQ(parse_colour_table(test::colour_table(numbers), kD435, model, pose, message), Status::kCorrupt);
        if (number == 0.0F || number == -1.0F) continue;
        numbers = {};
        numbers.translation_mm[0] = number;
        EXPECT_EQ(parse_colour_table(test::colour_table(numbers), kD435, model, pose, message), Status::kCorrupt);
        numbers = {};
        numbers.distortion[2] = number;
        EXPECT_EQ(parse_colour_table(test::colour_table(numbers), kD435, model, pose, message), Status::kCorrupt);
    }
}

// Promise: the data sheet's cameras: 87 degrees at 848x480, less at 4:3; the colour camera on the side it is on.
TEST(RealSenseTables, Nominal) {
    CameraModel model = of_size(848, 480);
    RigidTransform pose;
    nominal_depth(kD435, model, pose);
    EXPECT_NEAR(2 * std::atan(848 / 2 / model.fx) * 180 / 3.14159265, 87, 0.5);
    EXPECT_GT(pose.translation_m[0], 0);
    CameraModel square = of_size(640, 480);
    nominal_depth(kD435, square, pose);
    EXPECT_NEAR(square.fx, model.fx, 5);
    nominal_depth(kD455, model, pose);
    EXPECT_LT(pose.translation_m[0], 0);
}

}  // namespace
}  // namespace stillmesh::v4l2::realsense_tables_test
