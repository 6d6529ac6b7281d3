#include "hal/live/frame_guard.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace stillmesh::frame_guard_test {
namespace {

constexpr std::int64_t kPeriod_ns = 33'333'333;

class Images {
public:
    Images() {
        info.model.width = 64;
        info.model.height = 48;
        info.frames_per_s = 30;
    }
    Frame frame(std::int64_t time_ns, bool is_new = true) {
        if (is_new) {
            for (std::uint8_t& value : colour) value = static_cast<std::uint8_t>(random_());
        }
        Frame f;
        f.time_ns = time_ns;
        f.depth_time_ns = std::min(time_ns, INT64_MAX - 2'000'000) + 2'000'000;
        f.format = PixelFormat::kGrey8;
        f.colour = {colour.data(), 64, 48, 64};
        f.depth = {depth.data(), 64, 48, 64};
        return f;
    }
    CameraInfo info;
    std::vector<std::uint8_t> colour = std::vector<std::uint8_t>(64 * 48);
    std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(64 * 48, 1000);

private:
    std::mt19937 random_{5};
};

// Promise: with any sequence of times, the times of admitted frames only grow, and by what the host's clock says within
// half a second.
TEST(FrameGuard, TimeOnlyGoesOn) {
    Images images;
    std::mt19937 random(1);
    for (int trial = 0; trial < 40; ++trial) {
        FrameGuard guard(images.info, true);
        std::int64_t device_ns = 1'000'000'000;
        std::int64_t last_out_ns = -1;
        std::int64_t last_arrival_ns = 0;
        std::uint64_t admitted = 0;
        for (std::int64_t i = 0; i < 300; ++i) {
            const std::int64_t arrival_ns = 500'000'000'000 + i * kPeriod_ns;
            device_ns += kPeriod_ns;
            std::int64_t time_ns = device_ns;
            switch (random() % 40) {
                case 0: time_ns -= 40'000'000; break;                            // out of order
                case 1: time_ns -= kPeriod_ns; break;                            // repeated
                case 2: time_ns += 100'000'000'000; break;                       // one far away
                case 3: device_ns = static_cast<std::int64_t>(random()); break;  // a clock that restarts or wraps
                case 4: time_ns = std::numeric_limits<std::int64_t>::max(); break;
                case 5: time_ns = -5; break;
                case 6: guard.reopened(); break;
                default: break;
            }
            Frame frame = images.frame(time_ns);
            if (guard.admit(frame, arrival_ns) != Status::kOk) continue;
            ++admitted;
            if (last_out_ns >= 0) {
                ASSERT_GT(frame.time_ns, last_out_ns);
                ASSERT_LT(std::abs(frame.time_ns - last_out_ns - (arrival_ns - last_arrival_ns)), 600'000'000);
            }
            last_out_ns = frame.time_ns;
            last_arrival_ns = arrival_ns;
        }
        ASSERT_GT(admitted, 200U);
    }
}

// Promise: good frames pass untouched; a restarted clock costs two frames, then time goes on by the host's clock, and
// the lag of depth is kept.
TEST(FrameGuard, ARestartedClockIsCarriedOn) {
    Images images;
    FrameGuard guard(images.info, true);
    std::int64_t arrival_ns = 0;
    for (std::int64_t i = 0; i < 10; ++i) {
        arrival_ns = 9'000'000'000 + i * kPeriod_ns;
        Frame frame = images.frame(1'000'000'000 + i * kPeriod_ns);
        ASSERT_EQ(guard.admit(frame, arrival_ns), Status::kOk);
        ASSERT_EQ(frame.time_ns, 1'000'000'000 + i * kPeriod_ns);
        ASSERT_EQ(frame.depth_time_ns, frame.time_ns + 2'000'000);
    }
    for (std::int64_t i = 0; i < 10; ++i) {
        arrival_ns += kPeriod_ns;
        Frame frame = images.frame(1000 + i * kPeriod_ns);
        ASSERT_EQ(guard.admit(frame, arrival_ns), i < 2 ? Status::kCorrupt : Status::kOk) << i;
        if (i < 2) continue;
        ASSERT_EQ(frame.time_ns, 1'000'000'000 + (10 + i) * kPeriod_ns);
        ASSERT_EQ(frame.depth_time_ns, frame.time_ns + 2'000'000);
    }
    EXPECT_EQ(guard.counts().clock_restarts, 1U);
    EXPECT_EQ(guard.counts().wrong_time, 2U);
}

// Promise: a recording whose clock restarts or jumps loses two frames and no time: there the frames themselves say what
// has passed.
TEST(FrameGuard, ARecordingsClockIsCarriedOnByItsFrames) {
    for (const std::int64_t shift_ns : {-5'000'000'000LL, -200'000'000LL, 3'600'000'000'000LL}) {
        Images images;
        FrameGuard guard(images.info, false);
        for (std::int64_t i = 0; i < 20; ++i) {
            const std::int64_t time_ns = 10'000'000'000 + i * kPeriod_ns;
            Frame frame = images.frame(time_ns + (i < 10 ? 0 : shift_ns));
            const Status status = guard.admit(frame, 0);
            if (status == Status::kOk) {
                ASSERT_EQ(frame.time_ns, time_ns) << shift_ns;
            } else {
                ASSERT_TRUE(i >= 10 && i < 12) << i;
            }
        }
        EXPECT_EQ(guard.counts().wrong_time, 2U) << shift_ns;
    }
}

// Promise: every wrong form is refused: sizes, strides, missing pixels, units that are no numbers.
TEST(FrameGuard, RefusesWrongForms) {
    Images images;
    FrameGuard guard(images.info, true);
    const auto refused = [&](auto spoil) {
        Frame frame = images.frame(1'000'000'000);
        spoil(frame);
        return guard.admit(frame, 0) == Status::kInvalid;
    };
    EXPECT_TRUE(refused([](Frame& f) { f.colour.width = 63; }));
    EXPECT_TRUE(refused([](Frame& f) { f.depth.height = 49; }));
    EXPECT_TRUE(refused([](Frame& f) { f.colour.stride = 63; }));
    EXPECT_TRUE(refused([](Frame& f) { f.format = PixelFormat::kRgb8; }));
    EXPECT_TRUE(refused([](Frame& f) { f.depth.data = nullptr; }));
    EXPECT_TRUE(refused([](Frame& f) { f.depth_units_per_m = 0; }));
    EXPECT_TRUE(refused([](Frame& f) { f.depth_units_per_m = std::nan(""); }));
    EXPECT_FALSE(refused([](Frame&) {}));
    EXPECT_EQ(guard.counts().wrong_form, 7U);
}

// Promise: it says how long the same image has come, and forgets with the first that differs.
TEST(FrameGuard, SeesFrozenImages) {
    Images images;
    FrameGuard guard(images.info, true);
    for (std::int64_t i = 0; i < 100; ++i) {
        Frame frame = images.frame(i * kPeriod_ns + 1, i < 20 || i > 80);
        ASSERT_EQ(guard.admit(frame, i * kPeriod_ns), Status::kOk);
        const std::int64_t same = i < 20 || i > 80 ? 0 : i - 19;
        ASSERT_EQ(guard.frozen_ns(), same * kPeriod_ns) << i;
    }
}

}  // namespace
}  // namespace stillmesh::frame_guard_test
