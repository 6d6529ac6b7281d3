// A thousand random lives of the emulated camera behind ReconnectingCamera: unplugged, silent, refused calls, images
// that are damaged or cut off, tables with another checksum, no permission, other names, in any order and together.
#include <gtest/gtest.h>

#include <cerrno>
#include <cstdlib>
#include <random>
#include <string>

#include "hal/live/reconnecting_camera.hpp"
#include "hal/v4l2/v4l2_camera.hpp"
#include "tests/v4l2/emulated_device.hpp"

namespace stillmesh::random_lives_test {
namespace {

using test::EmulatedDevice;

class Life {
public:
    explicit Life(std::uint32_t seed) : random_(seed) {
        // Small, and grey, so that the number of an image can be read from both.
        device_->depth().modes = {{v4l2::kZ16, 64, 48, {30}}};
        device_->colour().modes = {{v4l2::kGrey, 64, 48, {30}}};
        device_->infrared().modes.clear();
        is_alternating_ = seed % 4 == 3;
        if (is_alternating_) {
            device_->depth().modes = {{v4l2::kZ16, 64, 48, {60}}};
            device_->infrared().modes = {{v4l2::kGrey, 64, 48, {60}}};
            device_->colour().modes = {{v4l2::kYuyv, 64, 48, {30}}};
        }
        picture_ = is_alternating_ ? &device_->infrared() : &device_->colour();
        picture_->delay_us = draw(is_alternating_ ? 4'000 : 12'000);
        picture_->way_us = draw(is_alternating_ ? 1'000 : 2'000);
        device_->clock_us = static_cast<std::uint32_t>(random_());
        device_->clock_ppm = static_cast<double>(draw(200)) - 100;
        device_->fault = [this](const char* call) { return fault(call); };
        V4l2Options options;
        options.has_thread = false;
        options.is_registered = true;
        if (is_alternating_) options.device = "alternate";
        camera_ = std::make_unique<V4l2Camera>(options, device_);
        ReconnectOptions reconnect;
        reconnect.now_ns = [this] { return device_->now_ns(); };
        reconnect.sleep_until_ns = [this](std::int64_t until_ns) {
            device_->advance_ns(std::max<std::int64_t>(until_ns - device_->now_ns(), 0));
        };
        reconnect.source_message = [this] { return camera_->message(); };
        reconnect.silence = [this] { return camera_->silence(); };
        reconnect.reset = [this] {
            EXPECT_EQ(device_->open_now(), 0);
            if (draw(2) == 0) heal_streams();
            return draw(2) == 0;
        };
        reconnect.times = camera_.get();
        lasting_ = std::make_unique<ReconnectingCamera>(*camera_, reconnect);
    }

    void live() {
        if (draw(4) == 0) strike();  // before it is opened
        if (lasting_->open() != Status::kOk) {
            EXPECT_FALSE(camera_->message().empty());
            end();
            return;
        }
        const std::int64_t end_ns = device_->now_ns() + 1'000'000'000 * (2 + std::int64_t{draw(6)});
        while (device_->now_ns() < end_ns && !testing::Test::HasFailure()) {
            if (draw(25) == 0) strike();
            if (draw(40) == 0) heal();
            listen();
        }
        // Whatever happened, it comes back.
        heal();
        const std::int64_t patience_ns = device_->now_ns() + 30'000'000'000;
        frames_ = 0;
        while (device_->now_ns() < patience_ns && frames_ < 5) listen();
        EXPECT_GE(frames_, 5U) << lasting_->take_news() << " / " << camera_->message();
        end();
    }

    std::uint64_t frames_ever = 0, calls = 0;

private:
    [[nodiscard]] std::uint32_t draw(std::uint32_t below) { return static_cast<std::uint32_t>(random_() % below); }

    int fault(const char*) {
        ++calls;
        if (refusals_ == 0 || draw(4) != 0) return 0;
        --refusals_;
        constexpr int kErrors[] = {EIO,       ENODEV, EBUSY,  ENOSPC, EINVAL, EPIPE,
                                   ETIMEDOUT, ENOMEM, EACCES, EAGAIN, ERANGE};
        return kErrors[draw(std::size(kErrors))];
    }

    void strike() {
        EmulatedDevice::Node& node = draw(2) == 0 ? device_->depth() : *picture_;
        switch (draw(16)) {
            case 0: device_->unplug(); break;
            case 1: device_->unplug(), device_->plug(static_cast<int>(draw(9))); break;
            case 2: node.is_silent = true; break;
            case 3: refusals_ = 1 + draw(20); break;
            case 4: node.broken = 1 + draw(40); break;
            case 5: node.cut_off = 1 + draw(40); break;
            case 6: node.overlong = 1 + draw(3); break;
            case 7: node.misnumbered = 1 + draw(8); break;
            case 8: device_->answers[25 * 256 + 0x15][20 + draw(400)] ^= 0x10; break;
            case 9: node.open_error = draw(2) == 0 ? EACCES : ENOENT; break;
            case 10: node.ignores_mode = draw(2) == 0, node.is_held = !node.ignores_mode; break;
            case 11: device_->advance_ns(std::int64_t{draw(3000)} * 1'000'000); break;
            case 12:
                // Where a wrong bit says that the projector was off, nobody can know better.
                (is_alternating_ ? device_->metadata_of(node).cut_off : device_->metadata_of(node).spoiled) =
                    1 + draw(60);
                break;
            case 13: device_->metadata_of(node).is_silent = true; break;
            case 14: device_->clock_us += static_cast<std::uint32_t>(random_()); break;
            default: node.has_failed = true; break;
        }
    }

    void heal_streams() {
        for (EmulatedDevice::Node& node : device_->devices) {
            node.is_silent = node.has_failed = false;
            node.broken = node.cut_off = node.overlong = node.misnumbered = node.spoiled = 0;
        }
    }

    void heal() {
        heal_streams();
        for (EmulatedDevice::Node& node : device_->devices) {
            node.ignores_mode = node.is_held = false;
            node.open_error = 0;
        }
        refusals_ = 0;
        device_->answers[25 * 256 + 0x15] = test::answer(0x15, test::depth_table());
        device_->plug(static_cast<int>(draw(9)));
    }

    void listen() {
        Frame frame;
        static_cast<void>(lasting_->wait(20));
        const Status status = lasting_->poll(frame);
        ASSERT_TRUE(status == Status::kOk || status == Status::kTimedOut);
        if (status == Status::kTimedOut) {
            device_->advance_ns(1'000'000);  // looking takes time, too
            return;
        }
        ++frames_;
        ++frames_ever;
        ASSERT_GT(frame.time_ns, last_ns_) << "time goes on";
        last_ns_ = frame.time_ns;
        const std::uint32_t number = frame.depth.at(0, 0);
        // A picture without dots, and depth of the image before or behind it, which had them.
        std::uint32_t picture = is_alternating_ ? number + 1 : number;
        if (is_alternating_ && frame.colour.row(0)[0] != test::colour_byte(picture, 0, 0)) picture -= 2;
        ASSERT_EQ(frame.colour.row(0)[0], test::colour_byte(picture, 0, 0)) << "colour and depth of two instants";
        for (std::uint32_t i = 1; i < 48; ++i) {
            ASSERT_EQ(frame.depth.at(i, i), test::depth_pixel(number, i, i));
            ASSERT_EQ(frame.colour.row(i)[i], test::colour_byte(picture, i, i));
        }
    }

    void end() {
        lasting_->close();
        camera_.reset();
        EXPECT_EQ(device_->open_now(), 0);
        EXPECT_EQ(device_->mapped_now(), 0);
        EXPECT_EQ(device_->misuse, "");
        EXPECT_LT(calls, 200'000U) << "a loop that never rests";
    }

    std::mt19937 random_;
    std::shared_ptr<EmulatedDevice> device_ = std::make_shared<EmulatedDevice>();
    std::unique_ptr<V4l2Camera> camera_;
    std::unique_ptr<ReconnectingCamera> lasting_;
    bool is_alternating_ = false;
    EmulatedDevice::Node* picture_ = nullptr;  // whose images are tracked
    std::uint32_t refusals_ = 0;
    std::uint64_t frames_ = 0;
    std::int64_t last_ns_ = INT64_MIN;
};

// Promise: no crash, no hang, nothing left open or mapped, no image of two instants, time goes on; and healed, it
// streams again within 30 s of simulated time.
TEST(V4l2Lives, AThousand) {
    const char* const only = std::getenv("STILLMESH_LIFE");
    std::uint64_t frames = 0, calls = 0;
    const std::uint32_t begin = only != nullptr ? static_cast<std::uint32_t>(std::atoi(only)) : 0;
    const std::uint32_t end = only != nullptr ? begin + 1 : 1000;
    for (std::uint32_t seed = begin; seed < end; ++seed) {
        SCOPED_TRACE("life " + std::to_string(seed) + " (STILLMESH_LIFE lives it alone)");
        Life life(seed);
        life.live();
        frames += life.frames_ever;
        calls += life.calls;
        if (HasFailure()) break;
    }
    std::printf("%llu frames, %llu calls\n", static_cast<unsigned long long>(frames),
                static_cast<unsigned long long>(calls));
    EXPECT_GT(frames, only != nullptr ? 0U : 20'000U);
}

}  // namespace
}  // namespace stillmesh::random_lives_test
