#include "hal/live/reconnecting_camera.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace stillmesh::reconnecting_camera_test {
namespace {

// A world with a clock of its own: 30 frames a second while the camera is plugged in, streams, and is open. Nobody
// waits.
class World final : public DepthCamera {
public:
    std::int64_t now_ns = 50'000'000'000;
    bool is_plugged = true, is_stalled = false, is_frozen = false, needs_reset = false;
    std::uint32_t width = 64;          // of its mode
    std::uint32_t image_width = 64;    // of its images
    Status open_status = Status::kOk;  // when it is plugged in
    std::int64_t open_takes_ns = 20'000'000;
    int opens = 0, closes = 0, resets = 0;

    Status open() noexcept override {
        ++opens;
        now_ns += open_takes_ns;
        if (!is_plugged) return Status::kUnavailable;
        if (open_status != Status::kOk) return open_status;
        is_open_ = true;
        info_.model = {width, 48, 50, 50, 31.5, 23.5};
        info_.frames_per_s = 30;
        next_ns_ = now_ns + 30'000'000;
        return Status::kOk;
    }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame& frame) noexcept override {
        EXPECT_TRUE(is_open_);
        if (!is_plugged) return Status::kUnavailable;
        if (is_stalled || needs_reset || now_ns < next_ns_) return Status::kTimedOut;
        while (next_ns_ + 33'333'333 <= now_ns) next_ns_ += 33'333'333;
        if (!is_frozen) ++value_;
        colour_.assign(std::size_t{image_width} * 48, value_);
        depth_.assign(std::size_t{image_width} * 48, static_cast<std::uint16_t>(1000 + value_));
        frame = {};
        frame.time_ns = next_ns_ - 40'000'000'000;
        next_ns_ += 33'333'333;
        frame.colour = {colour_.data(), image_width, 48, image_width};
        frame.depth = {depth_.data(), image_width, 48, image_width};
        return Status::kOk;
    }
    Status wait(std::uint32_t timeout_ms) noexcept override {
        EXPECT_TRUE(is_open_);
        now_ns += std::min<std::int64_t>(std::int64_t{timeout_ms} * 1'000'000, 5'000'000);
        return Status::kTimedOut;
    }
    void close() noexcept override {
        ++closes;
        is_open_ = false;
    }
    ReconnectOptions options() {
        ReconnectOptions o;
        o.now_ns = [this] { return now_ns; };
        o.sleep_until_ns = [this](std::int64_t until_ns) { now_ns = std::max(now_ns, until_ns); };
        o.source_message = [] { return std::string("the world says no"); };
        o.reset = [this] {
            ++resets;
            needs_reset = false;
            return true;
        };
        return o;
    }

private:
    CameraInfo info_;
    std::vector<std::uint8_t> colour_;
    std::vector<std::uint16_t> depth_;
    std::int64_t next_ns_ = 0;
    std::uint8_t value_ = 0;
    bool is_open_ = false;
};

// Polls for so long; how many frames came.
int run(ReconnectingCamera& camera, World& world, double seconds) {
    const std::int64_t end_ns = world.now_ns + static_cast<std::int64_t>(seconds * 1e9);
    int frames = 0;
    std::int64_t last_ns = 0;
    while (world.now_ns < end_ns) {
        Frame frame;
        const Status status = camera.poll(frame);
        if (status == Status::kOk) {
            EXPECT_GT(frame.time_ns, last_ns);
            last_ns = frame.time_ns;
            ++frames;
            continue;
        }
        EXPECT_EQ(status, Status::kTimedOut) << "nothing else comes through";
        static_cast<void>(camera.wait(10));
    }
    return frames;
}

std::string news(ReconnectingCamera& camera) {
    std::string all;
    for (std::string one = camera.take_news(); !one.empty(); one = camera.take_news()) all += one + "\n";
    return all;
}

// Promise: unplugged, there is silence and one sentence; back, there are frames within half a second and a moment.
TEST(ReconnectingCamera, UnpluggedAndBack) {
    World world;
    ReconnectingCamera camera(world, world.options());
    ASSERT_EQ(camera.open(), Status::kOk);
    EXPECT_NEAR(run(camera, world, 2), 59, 1);
    EXPECT_EQ(camera.life(), CameraLife::kStreaming);
    for (int i = 0; i < 5; ++i) {
        world.is_plugged = false;
        EXPECT_EQ(run(camera, world, 7.3 * i + 0.3), 0);
        EXPECT_EQ(camera.life(), CameraLife::kAway);
        EXPECT_NE(news(camera).find("the camera is gone (the world says no)"), std::string::npos);
        world.is_plugged = true;
        EXPECT_GT(run(camera, world, 0.7), 1);
        EXPECT_EQ(camera.life(), CameraLife::kStreaming);
        EXPECT_NE(news(camera).find("the camera is back after"), std::string::npos);
    }
    EXPECT_EQ(camera.counts().unplugs, 5U);
    EXPECT_EQ(camera.counts().returns, 5U);
    EXPECT_EQ(world.resets, 0);
    EXPECT_GT(camera.counts().away_longest_ns, 29'000'000'000);
}

// Promise: a second of silence is a stall: reset, closed, opened. A device that only a reset wakes is back within two
// seconds of stalling; one that stays silent is reset less and less often, and heard at once when it speaks.
TEST(ReconnectingCamera, StallsAreResetWithBackOff) {
    World world;
    ReconnectingCamera camera(world, world.options());
    ASSERT_EQ(camera.open(), Status::kOk);
    EXPECT_GT(run(camera, world, 1), 25);
    world.needs_reset = true;
    EXPECT_GT(run(camera, world, 1.2), 1);
    EXPECT_EQ(world.resets, 1);
    EXPECT_EQ(camera.counts().stalls, 1U);
    EXPECT_NE(news(camera).find("no frames for 1.0 s: the camera is reset and opened again"), std::string::npos);
    world.is_stalled = true;
    EXPECT_EQ(run(camera, world, 60), 0);
    EXPECT_NEAR(world.resets, 1 + 4 + (60 - 15) / 8, 2) << "after 1, 2, 4, 8, 8, ... s";
    world.is_stalled = false;
    EXPECT_GT(run(camera, world, 0.2), 2);
    const int before = world.resets;
    world.is_stalled = true;
    EXPECT_EQ(run(camera, world, 1.5), 0);
    EXPECT_EQ(world.resets, before + 1) << "frames end the back-off";
}

// Promise: who does not ask for frames for a while, because the machine is busy or the process was stopped, has heard
// no silence: a camera that is well is not reset.
TEST(ReconnectingCamera, LateListenersResetNobody) {
    World world;
    ReconnectOptions options = world.options();
    options.stall_ns = 1'000'000'000;
    ReconnectingCamera camera(world, options);
    ASSERT_EQ(camera.open(), Status::kOk);
    for (int i = 0; i < 20; ++i) {
        EXPECT_GT(run(camera, world, 0.1), 0);
        world.now_ns += 3'000'000'000;
        world.is_stalled = true;  // the moment in which it is asked again, its next image is not there yet
        Frame frame;
        EXPECT_EQ(camera.poll(frame), Status::kTimedOut);
        world.is_stalled = false;
    }
    EXPECT_EQ(camera.counts().stalls, 0U);
    EXPECT_EQ(world.resets, 0);
    world.is_stalled = true;
    EXPECT_EQ(run(camera, world, 1.1), 0);
    EXPECT_EQ(camera.counts().stalls, 1U) << "silence that was heard is one";
}

// Promise: frozen images and images of another size are stalls too.
TEST(ReconnectingCamera, FrozenAndWrongImagesAreStalls) {
    World world;
    ReconnectingCamera camera(world, world.options());
    ASSERT_EQ(camera.open(), Status::kOk);
    run(camera, world, 1);
    world.is_frozen = true;
    run(camera, world, 1.3);
    EXPECT_EQ(camera.counts().stalls, 1U);
    EXPECT_NE(news(camera).find("the same image again and again"), std::string::npos);
    world.is_frozen = false;
    run(camera, world, 1);
    world.image_width = 32;
    EXPECT_EQ(run(camera, world, 0.5), 0);
    EXPECT_EQ(camera.counts().stalls, 2U);
    EXPECT_NE(news(camera).find("another size"), std::string::npos);
    EXPECT_GE(camera.guard_counts().wrong_form, 10U);
    world.image_width = 64;
    EXPECT_GT(run(camera, world, 0.5), 5);
}

// Promise: a camera that comes back with another mode is not used, and that is said once; a refusal to open too.
TEST(ReconnectingCamera, AnotherCameraIsNotUsed) {
    World world;
    ReconnectingCamera camera(world, world.options());
    ASSERT_EQ(camera.open(), Status::kOk);
    run(camera, world, 0.5);
    world.is_plugged = false;
    run(camera, world, 0.5);
    world.is_plugged = true;
    world.width = world.image_width = 32;
    news(camera);
    EXPECT_EQ(run(camera, world, 5), 0);
    const std::string told = news(camera);
    EXPECT_NE(told.find("32x48 instead of 64x48"), std::string::npos) << told;
    EXPECT_EQ(std::count(told.begin(), told.end(), '\n'), 1);
    world.open_status = Status::kInvalid;
    EXPECT_EQ(run(camera, world, 5), 0);
    EXPECT_EQ(news(camera), "the world says no\n");
    world.open_status = Status::kOk;
    world.width = world.image_width = 64;
    EXPECT_GT(run(camera, world, 1), 5);
    camera.close();
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
}

// Promise: the first opening fails as the source says: nobody waits there.
TEST(ReconnectingCamera, TheFirstOpeningIsTheSources) {
    World world;
    world.is_plugged = false;
    ReconnectingCamera camera(world, world.options());
    EXPECT_EQ(camera.open(), Status::kUnavailable);
    EXPECT_EQ(camera.life(), CameraLife::kClosed);
    world.is_plugged = true;
    world.open_status = Status::kInvalid;
    EXPECT_EQ(camera.open(), Status::kInvalid);
}

}  // namespace
}  // namespace stillmesh::reconnecting_camera_test
