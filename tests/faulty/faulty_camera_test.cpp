#include "hal/faulty/faulty_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "hal/live/reconnecting_camera.hpp"

namespace stillmesh::faulty_camera_test {
namespace {

constexpr std::int64_t kPeriod_ns = 33'333'333;

// 30 frames a second of a world with a clock of its own; every pixel of a frame says its number.
class World final : public DepthCamera {
public:
    std::int64_t now_ns = 50'000'000'000;

    World() {
        info_.model = {32, 24, 30, 30, 15.5, 11.5};
        info_.frames_per_s = 30;
    }
    Status open() noexcept override {
        is_open_ = true;
        next_ns_ = now_ns;
        return Status::kOk;
    }
    const CameraInfo& info() const noexcept override { return info_; }
    Status poll(Frame& frame) noexcept override {
        EXPECT_TRUE(is_open_);
        if (now_ns < next_ns_) return Status::kTimedOut;
        while (next_ns_ + kPeriod_ns <= now_ns) next_ns_ += kPeriod_ns;
        ++number_;
        std::fill(colour_.begin(), colour_.end(), static_cast<std::uint8_t>(1 + number_ % 253));
        std::fill(depth_.begin(), depth_.end(), static_cast<std::uint16_t>(1000 + number_ % 5000));
        frame = {};
        frame.time_ns = frame.depth_time_ns = next_ns_;
        frame.colour = {colour_.data(), 32, 24, 32};
        frame.depth = {depth_.data(), 32, 24, 32};
        next_ns_ += kPeriod_ns;
        return Status::kOk;
    }
    Status wait(std::uint32_t timeout_ms) noexcept override {
        const std::int64_t until_ns = now_ns + std::int64_t{timeout_ms} * 1'000'000;
        now_ns = std::min(until_ns, std::max(now_ns + 1000, next_ns_));
        return Status::kOk;
    }
    void close() noexcept override { is_open_ = false; }

    FaultOptions faults(std::uint64_t seed) {
        FaultOptions options;
        options.seed = seed;
        options.now_ns = [this] { return now_ns; };
        options.sleep_until_ns = [this](std::int64_t until_ns) { now_ns = std::max(now_ns, until_ns); };
        return options;
    }
    ReconnectOptions life() {
        ReconnectOptions options;
        options.now_ns = [this] { return now_ns; };
        options.sleep_until_ns = [this](std::int64_t until_ns) { now_ns = std::max(now_ns, until_ns); };
        return options;
    }

private:
    CameraInfo info_;
    std::vector<std::uint8_t> colour_ = std::vector<std::uint8_t>(32 * 24);
    std::vector<std::uint16_t> depth_ = std::vector<std::uint16_t>(32 * 24);
    std::int64_t next_ns_ = 0;
    std::uint32_t number_ = 0;
    bool is_open_ = false;
};

// What was seen over so many seconds of the world's clock, as numbers to compare.
std::vector<std::int64_t> seen(DepthCamera& camera, World& world, double seconds) {
    std::vector<std::int64_t> list;
    const std::int64_t end_ns = world.now_ns + static_cast<std::int64_t>(seconds * 1e9);
    while (world.now_ns < end_ns) {
        Frame frame;
        const Status status = camera.poll(frame);
        if (status == Status::kOk) {
            list.push_back(frame.time_ns);
            list.push_back(frame.colour.at(3, 3) * 100000 + frame.depth.at(3, 3));
            continue;
        }
        if (status == Status::kUnavailable) {
            list.push_back(-1);
            camera.close();
            static_cast<void>(camera.open());
        }
        if (camera.wait(20) == Status::kUnavailable) world.now_ns += 20'000'000;
    }
    return list;
}

// Promise: the same seed gives the same faults, another one others; every kind happens.
TEST(FaultyCamera, RepeatsItself) {
    std::uint64_t counts[kFaults] = {};
    std::vector<std::int64_t> first;
    for (const std::uint64_t seed : {5U, 5U, 6U}) {
        World world;
        FaultOptions options = world.faults(seed);
        options.is_absent_at_start = true;
        options.good_frames_mean = 10;
        FaultyCamera camera(world, options);
        while (camera.open() != Status::kOk) {
        }
        const std::vector<std::int64_t> list = seen(camera, world, 300);
        if (first.empty()) {
            first = list;
        } else {
            EXPECT_EQ(list == first, seed == 5);
        }
        for (std::uint32_t i = 0; i < kFaults; ++i) counts[i] += camera.count(static_cast<Fault>(i));
        EXPECT_NE(camera.summary().find("torn"), std::string::npos) << camera.summary();
    }
    for (std::uint32_t i = 0; i < kFaults; ++i) EXPECT_GT(counts[i], 0U) << fault_name(static_cast<Fault>(i));
}

// Promise: each kind does what its name says.
TEST(FaultyCamera, EachKindIsWhatItSays) {
    for (std::uint32_t kind = 0; kind < kFaults; ++kind) {
        const auto fault = static_cast<Fault>(kind);
        World world;
        FaultOptions options = world.faults(3);
        options.faults = 1U << kind;
        options.good_frames_mean = 5;
        FaultyCamera camera(world, options);
        ASSERT_EQ(camera.open(), Status::kOk);
        bool has_shown = false;
        std::int64_t last_ns = 0;
        int last_colour = 0;
        for (int i = 0; i < 3000 && !has_shown; ++i) {
            Frame frame;
            const Status status = camera.poll(frame);
            if (status == Status::kUnavailable) has_shown = fault == Fault::kAbsent || fault == Fault::kUnplugged;
            if (status == Status::kTimedOut && camera.is_faulty()) {
                has_shown = fault == Fault::kTimeout || fault == Fault::kDropped;
            }
            if (status == Status::kOk) {
                const int colour = frame.colour.at(1, 1);
                const int lower = frame.colour.at(1, frame.colour.height - 1);
                const int depth = frame.depth.at(1, 1);
                const int expected_depth = 999 + colour;  // the world's, below 254 frames
                const std::int64_t step_ns = frame.time_ns - last_ns;
                switch (fault) {
                    case Fault::kDuplicate:
                    case Fault::kOutOfOrder: has_shown = last_ns > 0 && step_ns <= 0 && colour <= last_colour; break;
                    case Fault::kBackwards: has_shown = last_ns > 0 && step_ns < 0; break;
                    case Fault::kJump: has_shown = last_ns > 0 && step_ns > kPeriod_ns + 500'000; break;
                    case Fault::kWrap: has_shown = last_ns > 0 && frame.time_ns == 0; break;
                    case Fault::kFrozen: has_shown = last_ns > 0 && step_ns > 0 && colour == last_colour; break;
                    case Fault::kBlack: has_shown = colour == 0 && depth > 0; break;
                    case Fault::kSaturated: has_shown = colour == 255; break;
                    case Fault::kZeroDepth: has_shown = depth == 0 && colour > 0; break;
                    case Fault::kSaturatedDepth: has_shown = depth == 65535; break;
                    case Fault::kRandomPixels: has_shown = colour != frame.colour.at(2, 1); break;
                    case Fault::kWrongSize: has_shown = frame.colour.width != 32; break;
                    case Fault::kTorn: has_shown = colour != lower; break;
                    case Fault::kDifferentInstants: has_shown = depth == expected_depth - 1; break;
                    default: break;
                }
                last_ns = frame.time_ns;
                last_colour = colour;
            }
            static_cast<void>(camera.wait(20));
        }
        EXPECT_TRUE(has_shown) << fault_name(fault);
    }
}

// Promise: behind a ReconnectingCamera every fault of a thousand seeds comes down to silence or frames of the right
// size whose time goes on, and within two seconds of the end of a fault there are frames again.
TEST(FaultyCamera, AThousandSeedsAreSurvived) {
    std::uint64_t faults = 0;
    for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
        World world;
        FaultOptions options = world.faults(seed);
        options.good_frames_mean = 8;
        FaultyCamera faulty(world, options);
        ReconnectingCamera camera(faulty, world.life());
        ASSERT_EQ(camera.open(), Status::kOk);
        std::int64_t last_ns = -1;
        std::int64_t well_since_ns = world.now_ns;
        const std::int64_t end_ns = world.now_ns + 15'000'000'000;
        for (std::uint64_t polls = 0; world.now_ns < end_ns; ++polls) {
            ASSERT_LT(polls, 1'000'000U) << "time stands still, seed " << seed;
            Frame frame;
            const Status status = camera.poll(frame);
            if (faulty.is_faulty()) well_since_ns = world.now_ns;
            if (status == Status::kOk) {
                ASSERT_GT(frame.time_ns, last_ns) << seed;
                ASSERT_EQ(frame.colour.width, 32U);
                ASSERT_EQ(frame.colour.height, 24U);
                ASSERT_EQ(frame.depth.width, 32U);
                last_ns = frame.time_ns;
                well_since_ns = world.now_ns;
            } else {
                ASSERT_EQ(status, Status::kTimedOut) << seed;
                ASSERT_LT(world.now_ns - well_since_ns, 2'000'000'000) << seed << " " << faulty.summary();
                static_cast<void>(camera.wait(20));
            }
            while (!camera.take_news().empty()) {
            }
        }
        for (std::uint32_t i = 0; i < kFaults; ++i) faults += faulty.count(static_cast<Fault>(i));
    }
    std::printf("%llu faults\n", static_cast<unsigned long long>(faults));
    EXPECT_GT(faults, 10'000U);
}

// Promise: faults of any seed in a recording leave it a recording: it is opened once, its frames come in order and with
// the times they have, also behind an unplug, and it ends.
TEST(FaultyCamera, ARecordingGoesOnWhereItWas) {
    constexpr std::int64_t kBegin_ns = 7'000'000'000;
    class Recording final : public DepthCamera {
    public:
        explicit Recording(World& world) : world_(world) {}
        Status open() noexcept override {
            ++opens;
            number_ = 0;
            return world_.open();
        }
        const CameraInfo& info() const noexcept override { return world_.info(); }
        Status poll(Frame& frame) noexcept override {
            if (number_ == 600) return Status::kEnd;
            while (world_.poll(frame) != Status::kOk) static_cast<void>(world_.wait(20));
            frame.time_ns = frame.depth_time_ns = kBegin_ns + kPeriod_ns * number_++;
            return Status::kOk;
        }
        Status wait(std::uint32_t) noexcept override { return Status::kOk; }
        void close() noexcept override { world_.close(); }

        int opens = 0;

    private:
        World& world_;
        std::int64_t number_ = 0;
    };
    std::uint64_t unplugs = 0;
    for (std::uint64_t seed = 1; seed <= 300; ++seed) {
        World world;
        Recording recording(world);
        FaultOptions options = world.faults(seed);
        options.good_frames_mean = 10;
        options.is_recording = true;
        FaultyCamera faulty(recording, options);
        ReconnectOptions life = world.life();
        life.is_live = false;
        ReconnectingCamera camera(faulty, life);
        ASSERT_EQ(camera.open(), Status::kOk);
        std::int64_t last_ns = 0;
        Status status = Status::kOk;
        for (int polls = 0; status != Status::kEnd; ++polls) {
            ASSERT_LT(polls, 100'000) << "it never ends, seed " << seed;
            Frame frame;
            status = camera.poll(frame);
            if (status == Status::kOk) {
                ASSERT_GT(frame.time_ns, last_ns) << seed;
                last_ns = frame.time_ns;
            } else if (status == Status::kTimedOut) {
                world.now_ns += 1'000'000;
                static_cast<void>(camera.wait(20));
            }
            while (!camera.take_news().empty()) {
            }
        }
        EXPECT_EQ(recording.opens, 1);
        // A clock that jumps among frames that do not come is set anew; no more than a moment goes wrong.
        EXPECT_LE(last_ns, kBegin_ns + 600 * kPeriod_ns) << seed << " " << faulty.summary();
        unplugs += faulty.count(Fault::kUnplugged) + faulty.count(Fault::kAbsent);
    }
    EXPECT_GT(unplugs, 300U);
}

}  // namespace
}  // namespace stillmesh::faulty_camera_test
