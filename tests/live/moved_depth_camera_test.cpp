#include "hal/live/moved_depth_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace stillmesh::moved_depth_camera_test {
namespace {

constexpr std::int64_t kPeriod_ns = 33'333'333, kLag_ns = 16'666'667;
constexpr std::uint32_t kWidth = 320, kHeight = 240;
constexpr double kUnits = 5000;

using Vector = std::array<double, 3>;

[[nodiscard]] RigidTransform turned_by(const Vector& rad_per_s, double s) {
    const double angle = std::hypot(rad_per_s[0], rad_per_s[1], rad_per_s[2]) * s;
    const double scale = angle != 0 ? std::sin(angle / 2) / (angle / s) : 0;
    return {{scale * rad_per_s[0], scale * rad_per_s[1], scale * rad_per_s[2], std::cos(angle / 2)}, {0, 0, 0}};
}

// A camera that turns and moves, evenly, before a slanted wall and a board that stands before it.
class MovingCamera final : public DepthCamera {
public:
    MovingCamera(const Vector& given_rate, const Vector& given_velocity) : rate(given_rate), velocity(given_velocity) {
        info_.model = {kWidth, kHeight, 260, 255, 158.7, 121.2};
        info_.depth_units_per_m = kUnits;
        info_.is_depth_older = true;
    }
    Status open() noexcept override { return Status::kOk; }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame& frame) noexcept override {
        if (status != Status::kOk) return status;
        time_ns += kPeriod_ns;
        frame.time_ns = time_ns;
        frame.depth_time_ns = lag_ns < 0 ? 0 : time_ns - lag_ns;
        depth = seen_at(time_ns - std::max<std::int64_t>(lag_ns, 0));
        frame.depth = {depth.data(), width, kHeight, width};
        return Status::kOk;
    }
    Status wait(std::uint32_t) noexcept override { return Status::kTimedOut; }

    // Wherever it began.
    [[nodiscard]] RigidTransform pose_at(std::int64_t at_ns) const {
        return compose({{0.5, -0.5, 0.5, 0.5}, {1, 2, 3}}, place_at(at_ns));
    }
    [[nodiscard]] RigidTransform place_at(std::int64_t at_ns) const {
        const double s = static_cast<double>(at_ns) * 1e-9;
        RigidTransform out = turned_by(rate, s);
        for (std::size_t i = 0; i < 3; ++i) out.translation_m[i] = velocity[i] * s;
        return out;
    }
    [[nodiscard]] std::vector<std::uint16_t> seen_at(std::int64_t at_ns) const {
        const RigidTransform place = place_at(at_ns);
        const double(&p)[3] = place.translation_m;
        std::vector<std::uint16_t> out(std::size_t{kWidth} * kHeight);
        for (std::uint32_t v = 0; v < kHeight; ++v) {
            for (std::uint32_t u = 0; u < kWidth; ++u) {
                const CameraModel& m = info_.model;
                const Vector ray = rotated(place, {(u - m.cx) / m.fx, (v - m.cy) / m.fy, 1});
                const double wall = (3 - p[2] - 0.2 * p[0]) / (ray[2] + 0.2 * ray[0]), board = (1.2 - p[2]) / ray[2];
                const bool is_board = std::abs(p[0] + board * ray[0]) < 0.5 && std::abs(p[1] + board * ray[1]) < 0.4;
                out[std::size_t{v} * kWidth + u] =
                    static_cast<std::uint16_t>(std::lround(kUnits * (is_board ? board : wall)));
            }
        }
        return out;
    }

    Vector rate, velocity;  // rad/s about the camera's axes, m/s
    CameraInfo info_;
    std::int64_t time_ns = 0, lag_ns = kLag_ns;
    std::vector<std::uint16_t> depth;
    std::uint32_t width = kWidth;
    Status status = Status::kOk;
};

struct Score {
    int empty = 0;
    int wrong = 0;  // none of the true ones round it
};

// But for a strip at the sides.
[[nodiscard]] Score compare(const DepthView& got, const std::vector<std::uint16_t>& truth) {
    constexpr std::uint32_t kStrip = 16;
    Score score;
    for (std::uint32_t v = kStrip; v + kStrip < kHeight; ++v) {
        for (std::uint32_t u = kStrip; u + kStrip < kWidth; ++u) {
            score.empty += got.at(u, v) == 0;
            if (got.at(u, v) == 0) continue;
            double nearest = 65535;
            for (std::uint32_t dv = v - 1; dv <= v + 1; ++dv) {
                for (std::uint32_t du = u - 1; du <= u + 1; ++du) {
                    nearest = std::min(nearest, std::abs(double(truth[std::size_t{dv} * kWidth + du]) - got.at(u, v)));
                }
            }
            score.wrong += nearest > 0.004 * truth[std::size_t{v} * kWidth + u];
        }
    }
    return score;
}

struct Motion {
    const char* name;
    Vector rate, velocity;
    int empty_max = 0;
};

// Promise: turned about each axis, moved along each, and all of it, depth lies where the picture sees it, borders
// within a pixel. Empty are a pixel in a thousand when it turns about the axis of sight, and beside the board what it
// hid. As it came, it lies elsewhere.
TEST(MovedDepthCamera, LiesWhereThePictureSeesIt) {
    for (const Motion& motion :
         {Motion{"nods", {1, 0, 0}, {}}, Motion{"turns", {0, -1.2, 0}, {}}, Motion{"rolls", {0, 0, 1.5}, {}, 75},
          Motion{"aside", {}, {1.2, 0, 0}, 700}, Motion{"up", {}, {0, -1.2, 0}, 1000},
          Motion{"ahead", {}, {0, 0, 2}, 200}, Motion{"all", {-0.7, 0.9, -0.4}, {0.8, 0.3, -0.5}, 700}}) {
        SCOPED_TRACE(motion.name);
        MovingCamera source(motion.rate, motion.velocity);
        MovedDepthCamera camera(source);
        for (int i = 0; i < 4; ++i) {
            Frame frame;
            ASSERT_EQ(camera.poll(frame), Status::kOk);
            EXPECT_EQ(frame.depth_time_ns, frame.time_ns - kLag_ns);
            camera.learn(frame.time_ns, source.pose_at(frame.time_ns));
            if (i < 2) continue;
            const std::vector<std::uint16_t> truth = source.seen_at(frame.time_ns);
            const Score moved = compare(frame.depth, truth);
            EXPECT_EQ(moved.wrong, 0);
            EXPECT_LE(moved.empty, motion.empty_max);
            EXPECT_GT(compare({source.depth.data(), kWidth, kHeight, kWidth}, truth).wrong, 200);
        }
    }
}

// Promise: depth stays as it comes, in its own memory, while nobody knows how the camera moves or where it is of no
// use: before two poses in a row, behind one that is not measured, behind a gap, without a distance in time, when
// hardly anything moves, when it turns like nothing on earth, and where an image has another size.
TEST(MovedDepthCamera, StaysAsItComes) {
    const auto is_moved = [](MovingCamera& source, bool is_measured, std::int64_t gap_ns) {
        MovedDepthCamera camera(source);
        Frame frame;
        for (const bool is_first : {true, false}) {
            EXPECT_EQ(camera.poll(frame), Status::kOk);
            EXPECT_EQ(frame.depth.data, source.depth.data()) << "nothing is known yet";
            camera.learn(frame.time_ns,
                         is_first || is_measured ? std::optional(source.pose_at(frame.time_ns)) : std::nullopt);
        }
        source.time_ns += gap_ns;
        EXPECT_EQ(camera.poll(frame), Status::kOk);
        return frame.depth.data != source.depth.data();
    };
    const auto turning = [](double rate) { return MovingCamera({0, rate, 0}, {}); };
    MovingCamera good = turning(1), lost = turning(1), gap = turning(1), none = turning(1), still = turning(0.01),
                 wild = turning(10), narrow = turning(1);
    EXPECT_TRUE(is_moved(good, true, 0));
    MovingCamera walking({}, {0.5, 0, 0}), creeping({}, {0.005, 0, 0});
    EXPECT_TRUE(is_moved(walking, true, 0));
    EXPECT_FALSE(is_moved(creeping, true, 0));
    EXPECT_FALSE(is_moved(lost, false, 0));
    EXPECT_FALSE(is_moved(gap, true, 100'000'000));
    none.lag_ns = -1;
    EXPECT_FALSE(is_moved(none, true, 0));
    none = turning(1), none.lag_ns = 0;
    EXPECT_FALSE(is_moved(none, true, 0));
    EXPECT_FALSE(is_moved(still, true, 0));
    EXPECT_FALSE(is_moved(wild, true, 0));
    narrow.width = kWidth - 2;
    EXPECT_FALSE(is_moved(narrow, true, 0));
}

// Promise: what the source says of itself and of a frame is said.
TEST(MovedDepthCamera, PassesOnWhatIsWrong) {
    MovingCamera source({0, 1, 0}, {});
    MovedDepthCamera camera(source);
    source.status = Status::kUnavailable;
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
    EXPECT_EQ(frame.time_ns, 0) << "untouched";
    EXPECT_EQ(camera.wait(1), Status::kTimedOut);
    EXPECT_TRUE(camera.info().is_depth_older);
}

}  // namespace
}  // namespace stillmesh::moved_depth_camera_test
