#include "hal/realtime/realtime_camera.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>

namespace stillmesh::realtime_camera_test {
namespace {

constexpr std::int64_t kPeriod_ns = 33'000'000;

// A clock that stands until somebody moves it: nobody sleeps.
struct HandClock {
    std::atomic<std::int64_t> now_ns = 5'000'000'000;
    RealtimeClock clock() {
        return {[this] { return now_ns.load(); },
                [this](std::int64_t until_ns) {
                    if (until_ns > now_ns) now_ns = until_ns;
                }};
    }
};

// Frames of 8x6 pixels, all of the value of their number; statuses and slowness as told.
class Source final : public DepthCamera {
public:
    std::uint32_t frames = 30;
    std::function<Status(std::uint32_t)> status_of = [](std::uint32_t) { return Status::kOk; };
    std::function<void(std::uint32_t)> before = [](std::uint32_t) {};
    std::atomic<std::uint32_t> polled = 0;

    Source() {
        info_.model = {8, 6, 8, 8, 4, 3};
        info_.frames_per_s = 1e9 / kPeriod_ns;
    }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame& frame) noexcept override {
        const std::uint32_t i = polled;
        if (i >= frames) return Status::kEnd;
        before(i);
        ++polled;
        if (const Status status = status_of(i); status != Status::kOk) return status;
        std::fill(std::begin(colour_), std::end(colour_), static_cast<std::uint8_t>(i));
        std::fill(std::begin(depth_), std::end(depth_), static_cast<std::uint16_t>(i));
        frame = {};
        frame.time_ns = 100'000'000 + i * kPeriod_ns;
        frame.colour = {colour_, 8, 6, 10};
        frame.depth = {depth_, 8, 6, 9};
        return Status::kOk;
    }
    Status wait(std::uint32_t) noexcept override { return Status::kOk; }

private:
    CameraInfo info_;
    std::uint8_t colour_[60] = {};
    std::uint16_t depth_[54] = {};
};

void wait_until_ahead(RealtimeCamera& camera) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!camera.is_ahead() && std::chrono::steady_clock::now() < limit) std::this_thread::yield();
    ASSERT_TRUE(camera.is_ahead());
}

// Its number; -1: kTimedOut, -2: kEnd, -3: anything else.
int next(RealtimeCamera& camera) {
    wait_until_ahead(camera);
    Frame frame;
    const Status status = camera.poll(frame);
    if (status == Status::kTimedOut) return -1;
    if (status == Status::kEnd) return -2;
    if (status != Status::kOk) return -3;
    const int number = frame.colour.at(0, 0);
    // Every pixel is this frame's, and the times belong to it.
    for (std::uint32_t y = 0; y < 6; ++y) {
        for (std::uint32_t x = 0; x < 8; ++x) {
            EXPECT_EQ(frame.colour.at(x, y), number);
            EXPECT_EQ(frame.depth.at(x, y), number);
        }
    }
    EXPECT_EQ(frame.time_ns, 100'000'000 + number * kPeriod_ns);
    return number;
}

// Promise: frames come at their times and not before; nothing is dropped while the caller is in time.
TEST(RealtimeCamera, ServesAtRecordedTimes) {
    HandClock clock;
    Source source;
    RealtimeCamera camera(source, clock.clock());
    ASSERT_EQ(camera.open(), Status::kOk);
    const std::int64_t begin_ns = clock.now_ns;
    for (int i = 0; i < 30; ++i) {
        clock.now_ns = begin_ns + i * kPeriod_ns - (i > 0 ? 1 : 0);
        if (i > 0) {
            ASSERT_EQ(next(camera), -1) << i;
        }
        clock.now_ns = begin_ns + i * kPeriod_ns;
        ASSERT_EQ(next(camera), i);
        ASSERT_EQ(camera.due_ns(), begin_ns + i * kPeriod_ns);
        if (i + 1 < 30) {
            ASSERT_EQ(camera.next_due_ns(), begin_ns + (i + 1) * kPeriod_ns);
        }
    }
    clock.now_ns += kPeriod_ns;
    EXPECT_EQ(next(camera), -2);
    EXPECT_EQ(next(camera), -2);
    EXPECT_EQ(camera.dropped(), 0U);
    EXPECT_EQ(camera.source_late_ns(), 0);
}

// Promise: whoever is late gets the newest frame that is due; those before it are dropped and counted; a frame in use
// is not touched meanwhile.
TEST(RealtimeCamera, LateFramesAreDropped) {
    HandClock clock;
    Source source;
    RealtimeCamera camera(source, clock.clock());
    ASSERT_EQ(camera.open(), Status::kOk);
    const std::int64_t begin_ns = clock.now_ns;
    std::uint64_t dropped = 0;
    int last = 0;
    ASSERT_EQ(next(camera), 0);
    for (const int now : {1, 3, 4, 12, 13, 29}) {
        clock.now_ns = begin_ns + now * kPeriod_ns + 1000;
        ASSERT_EQ(next(camera), now);
        dropped += static_cast<std::uint64_t>(now - last - 1);
        ASSERT_EQ(camera.dropped(), dropped);
        ASSERT_EQ(camera.due_ns(), begin_ns + now * kPeriod_ns);
        last = now;
    }
    EXPECT_EQ(next(camera), -2);
}

// Promise: the pixels given out stay as they are until the next poll, however many frames are overtaken behind them.
TEST(RealtimeCamera, AFrameInUseIsNotTouched) {
    HandClock clock;
    Source source;
    RealtimeCamera camera(source, clock.clock());
    ASSERT_EQ(camera.open(), Status::kOk);
    wait_until_ahead(camera);
    Frame frame;
    ASSERT_EQ(camera.poll(frame), Status::kOk);
    clock.now_ns += 20 * kPeriod_ns;
    wait_until_ahead(camera);
    for (std::uint32_t y = 0; y < 6; ++y) {
        for (std::uint32_t x = 0; x < 8; ++x) ASSERT_EQ(frame.colour.at(x, y), 0);
    }
    EXPECT_EQ(next(camera), 20);
}

// Promise: a source that needs longer than a frame lasts loses no frame: the clock waits for it, and that is counted.
TEST(RealtimeCamera, SlowSourceIsNotTheEnginesLateness) {
    HandClock clock;
    Source source;
    source.frames = 10;
    std::atomic<std::uint32_t> allowed = 0;
    source.before = [&](std::uint32_t i) {
        while (allowed < i) std::this_thread::yield();
        if (i > 0) clock.now_ns += 2 * kPeriod_ns;
    };
    RealtimeCamera camera(source, clock.clock());
    ASSERT_EQ(camera.open(), Status::kOk);
    const std::int64_t begin_ns = clock.now_ns;
    for (std::uint32_t i = 0; i < 10; ++i) {
        allowed = i;
        Frame frame;
        Status status = Status::kTimedOut;
        while (status == Status::kTimedOut) status = camera.poll(frame);
        ASSERT_EQ(status, Status::kOk);
        ASSERT_EQ(frame.colour.at(0, 0), i);
        ASSERT_EQ(camera.due_ns(), begin_ns + 2 * i * kPeriod_ns);
    }
    EXPECT_EQ(camera.dropped(), 0U);
    EXPECT_EQ(camera.source_late_ns(), 9 * kPeriod_ns);
    allowed = 99;
}

// Promise: what the source says instead of a frame comes in its place, once, and the source rests until the next poll.
TEST(RealtimeCamera, TroubleComesInItsPlace) {
    HandClock clock;
    Source source;
    source.frames = 5;
    source.status_of = [](std::uint32_t i) { return i == 2 ? Status::kCorrupt : Status::kOk; };
    RealtimeCamera camera(source, clock.clock());
    ASSERT_EQ(camera.open(), Status::kOk);
    EXPECT_EQ(next(camera), 0);
    clock.now_ns += kPeriod_ns;
    EXPECT_EQ(next(camera), 1);
    EXPECT_EQ(next(camera), -3);
    EXPECT_EQ(source.polled, 3U) << "it rests";
    clock.now_ns += 2 * kPeriod_ns;
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kTimedOut) << "the next poll wakes it";
    EXPECT_EQ(next(camera), 3);
    clock.now_ns += kPeriod_ns;
    EXPECT_EQ(next(camera), 4);
    EXPECT_EQ(next(camera), -2);
}

// Promise: wait() returns when the next frame is due, or after its time; closing in the middle ends the thread, and a
// new open() begins anew.
TEST(RealtimeCamera, WaitsAndCloses) {
    HandClock clock;
    Source source;
    RealtimeCamera camera(source, clock.clock());
    ASSERT_EQ(camera.open(), Status::kOk);
    ASSERT_EQ(next(camera), 0);
    const std::int64_t begin_ns = clock.now_ns;
    wait_until_ahead(camera);
    EXPECT_EQ(camera.wait(10), Status::kTimedOut);
    EXPECT_EQ(clock.now_ns, begin_ns + 10'000'000);
    EXPECT_EQ(camera.wait(100), Status::kOk);
    EXPECT_EQ(clock.now_ns, begin_ns + kPeriod_ns);
    camera.close();
    camera.close();
    const auto polled = static_cast<int>(source.polled.load());
    ASSERT_EQ(camera.open(), Status::kOk);
    EXPECT_EQ(next(camera), polled);
}

}  // namespace
}  // namespace stillmesh::realtime_camera_test
