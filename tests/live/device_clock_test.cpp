#include "hal/live/device_clock.hpp"

#include <gtest/gtest.h>

#include <random>

namespace stillmesh::device_clock_test {
namespace {

// Promise: a clock that drifts and delays that vary: the host's time of a stamp is right to within the smallest delay
// plus what the clocks drift in two windows.
TEST(DeviceClock, FollowsADriftingClock) {
    std::mt19937 random(3);
    DeviceClock clock;
    const std::int64_t start_ns = 77'000'000'000;
    for (std::int64_t i = 0; i < 60 * 30 * 10; ++i) {
        const std::int64_t true_ns = start_ns + i * 33'333'000;
        const auto stamp_us = static_cast<std::int64_t>(5e6 + static_cast<double>(true_ns - start_ns) * 1e-3 * 1.00005);
        const std::int64_t delay_ns = 2'000'000 + static_cast<std::int64_t>(random() % 8'000'000);
        const std::int64_t host_ns = clock.host_ns(stamp_us, true_ns + delay_ns);
        ASSERT_LE(host_ns, true_ns + delay_ns);
        if (i < 100) continue;
        ASSERT_GT(host_ns, true_ns + 2'000'000 - 1'200'000) << i;
        ASSERT_LT(host_ns, true_ns + 2'000'000 + 1'200'000) << i;
    }
    EXPECT_FALSE(clock.is_host_clock());
}

// Promise: stamps of the host's own clock are taken as they are; one from the future ends that; any number is safe.
TEST(DeviceClock, HostClockAndNonsense) {
    DeviceClock clock;
    EXPECT_EQ(clock.host_ns(5'000'000, 5'003'000'000), 5'000'000'000);
    EXPECT_TRUE(clock.is_host_clock());
    EXPECT_EQ(clock.host_ns(5'033'000, 5'041'000'000), 5'033'000'000);
    EXPECT_EQ(clock.host_ns(5'066'000, 5'065'000'000), 5'065'000'000);
    EXPECT_FALSE(clock.is_host_clock());
    for (const std::int64_t stamp_us :
         {std::int64_t{-1}, std::int64_t{0}, INT64_MAX, INT64_MIN, std::int64_t{1} << 40}) {
        EXPECT_LE(clock.host_ns(stamp_us, 6'000'000'000), 6'000'000'000);
    }
}

// Promise: a pair that comes late does not make the next one expected late; a way that has become longer is believed
// within some seconds.
TEST(ArrivalForecast, LatenessIsNotPassedOn) {
    constexpr std::int64_t kPeriod_ns = 33'333'000;
    ArrivalForecast forecast;
    EXPECT_EQ(forecast.next_ns(kPeriod_ns), 0);
    std::int64_t taken_ns = 5'000'000'000;
    for (int i = 0; i < 300; ++i, taken_ns += kPeriod_ns) {
        const std::int64_t late_ns = i % 10 == 3 ? 9'000'000 : 0;
        forecast.arrived(taken_ns, taken_ns + 3'000'000 + late_ns);
        const std::int64_t true_ns = taken_ns + kPeriod_ns + 3'000'000;
        EXPECT_GE(forecast.next_ns(kPeriod_ns), true_ns);
        EXPECT_LE(forecast.next_ns(kPeriod_ns), true_ns + 50'000);
    }
    for (int i = 0; i < 300; ++i, taken_ns += kPeriod_ns) forecast.arrived(taken_ns, taken_ns + 7'000'000);
    EXPECT_EQ(forecast.next_ns(kPeriod_ns), taken_ns + 7'000'000);
}

// Promise: a device's own clock that begins as the host's does is not taken for it once that is said: after two hours,
// 60 ppm slower, a frame's time is still that of its way.
TEST(DeviceClock, ItsOwnClockIsFollowed) {
    DeviceClock clock;
    EXPECT_EQ(clock.host_ns(1'000'000, 1'003'000'000), 1'000'000'000);
    EXPECT_TRUE(clock.is_host_clock());
    clock.keep_apart();
    std::int64_t host_ns = 0, arrival_ns = 0;
    for (std::int64_t i = 1; i < 216'000; ++i) {
        arrival_ns = 1'003'000'000 + i * 33'335'000;
        host_ns = clock.host_ns(1'000'000 + i * 33'333, arrival_ns);
    }
    EXPECT_FALSE(clock.is_host_clock());
    EXPECT_LE(arrival_ns - host_ns, 2'000'000);
    EXPECT_GE(arrival_ns - host_ns, 0);
}

}  // namespace
}  // namespace stillmesh::device_clock_test
