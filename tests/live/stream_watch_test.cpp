#include "hal/live/stream_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace stillmesh::stream_watch_test {
namespace {

constexpr std::uint32_t kWidth = 80, kHeight = 60;

// A textured, slanting wall with steps, seen by a camera that has moved sideways by `x` pixels; grey levels and
// depth have noise of these sigmas.
class Room {
public:
    double colour_noise = 0, depth_noise = 0;

    Frame frame(double x, double z_mm = 2000) {
        for (std::uint32_t column = 0; column < kWidth; ++column) {
            const double u = column + x;
            const double stripe = 50 * std::sin(u / 8);
            const double z = z_mm + 3.17 * u + (std::sin(u / 25) > 0 ? 500 : 0);
            for (std::uint32_t row = 0; row < kHeight; ++row) {
                const std::size_t at = std::size_t{row} * kWidth + column;
                const double grey = 120 + stripe * (row % 8 < 4 ? 1 : -1) + colour_noise * noise();
                colour[at] = static_cast<std::uint8_t>(grey + 0.5);
                depth[at] = static_cast<std::uint16_t>(z + depth_noise * noise() + 0.5);
            }
        }
        return view();
    }
    [[nodiscard]] Frame view() const {
        Frame out;
        out.colour = {colour.data(), kWidth, kHeight, kWidth};
        out.depth = {depth.data(), kWidth, kHeight, kWidth};
        return out;
    }
    std::vector<std::uint8_t> colour = std::vector<std::uint8_t>(kWidth * kHeight);
    std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kWidth * kHeight);

private:
    // Even, of sigma 1.
    [[nodiscard]] double noise() { return (static_cast<double>(random_()) / 4294967296.0 - 0.5) * 3.464; }
    std::mt19937 random_{7};
};

// Promise: from the first repeat on, from the second where both do, a stream that repeats is stuck and another is not,
// until it changes again, of a camera that moves and of one at rest.
TEST(StreamWatch, NamesTheStreamThatIsStuck) {
    for (const double speed_px : {0.0, 0.3, 4.0}) {
        for (const int stuck : {1, 2, 3}) {  // colour, depth, both
            Room room;
            room.colour_noise = 1.5;
            room.depth_noise = 6;
            StreamWatch watch;
            for (int i = 0; i < 60; ++i) {
                const Room before = room;
                room.frame(speed_px * i);
                const bool is_stuck = i >= 20 && i < 50;
                if (is_stuck && (stuck & 1) != 0) room.colour = before.colour;
                if (is_stuck && (stuck & 2) != 0) room.depth = before.depth;
                watch.look(room.view());
                const std::string where =
                    std::to_string(speed_px) + " " + std::to_string(stuck) + " frame " + std::to_string(i);
                const bool is_seen = is_stuck && (stuck != 3 || i > 20);
                ASSERT_EQ(watch.is_stuck(StreamWatch::kColour), is_seen && (stuck & 1) != 0) << where;
                ASSERT_EQ(watch.is_stuck(StreamWatch::kDepth), is_seen && (stuck & 2) != 0) << where;
            }
        }
    }
}

// Promise: without noise, images that repeat are no fault: of a camera that never moved, and of one that came to rest.
TEST(StreamWatch, ARenderedCameraMayStandStill) {
    const std::function<double(int)> ways[] = {
        [](int) { return 0.0; },
        [](int i) { return i < 30 ? 0.05 * (900 - (30 - i) * (30 - i)) : 45.0; },       // evenly slower
        [](int i) { return i < 30 ? 20 - 20 * std::cos(i * 3.14159265 / 30) : 40.0; },  // smoothly
        [](int i) {
            return i < 20 ? 0.0 : i < 50 ? 10 - 10 * std::cos((i - 20) * 3.14159265 / 30) : 20.0;
        },  // and off again
    };
    for (const auto& way : ways) {
        Room room;
        StreamWatch watch;
        for (int i = 0; i < 80; ++i) {
            watch.look(room.frame(way(i)));
            ASSERT_FALSE(watch.is_any_stuck()) << i;
        }
        EXPECT_GT(watch.repeats(StreamWatch::kColour), 10U);
    }
}

// Promise: frames that are there twice, as a film of 25 frames a second has them at 30, are no fault.
TEST(StreamWatch, FramesMayBeThereTwice) {
    Room room;
    room.colour_noise = 1.5;
    room.depth_noise = 6;
    StreamWatch watch;
    for (int i = 0; i < 60; ++i) {
        if (i % 6 != 5) room.frame(2.0 * i);
        watch.look(room.view());
        ASSERT_FALSE(watch.is_any_stuck()) << i;
    }
}

// Promise: nor where one stream alone is rendered without noise.
TEST(StreamWatch, OneStreamMayHaveNoNoise) {
    for (const bool is_colour_clean : {true, false}) {
        Room room;
        (is_colour_clean ? room.depth_noise : room.colour_noise) = is_colour_clean ? 15 : 3;
        StreamWatch watch;
        for (int i = 0; i < 80; ++i) {
            watch.look(room.frame(0));
            ASSERT_FALSE(watch.is_any_stuck()) << i;
        }
    }
}

// Promise: a rendered camera that stops from full speed is stuck; and so is a stream that never showed anything but its
// first image, within five frames of the other's moving.
TEST(StreamWatch, AStopFromFullSpeedIsNone) {
    Room room;
    StreamWatch watch;
    for (int i = 0; i < 30; ++i) watch.look(room.frame(2.0 * std::min(i, 20)));
    EXPECT_TRUE(watch.is_stuck(StreamWatch::kColour) && watch.is_stuck(StreamWatch::kDepth));

    for (const bool is_colour : {true, false}) {
        Room first;
        first.colour_noise = 1.5;
        first.depth_noise = 6;
        first.frame(0);
        Room other = first;
        StreamWatch from_the_start;
        from_the_start.look(first.view());
        for (int i = 1; i <= 5; ++i) {
            other.frame(2.0 * i, 2000 - 10 * i);
            Room shown = other;
            if (is_colour) shown.colour = first.colour;
            if (!is_colour) shown.depth = first.depth;
            from_the_start.look(shown.view());
        }
        EXPECT_TRUE(from_the_start.is_stuck(is_colour ? StreamWatch::kColour : StreamWatch::kDepth)) << is_colour;
    }
}

// Promise: black images, and depth images without depth, repeat for another reason: they are not stuck, but frozen when
// both streams do nothing else.
TEST(StreamWatch, NothingToSeeIsNotStuck) {
    Room room;
    room.colour_noise = 1.5;
    StreamWatch watch;
    for (int i = 0; i < 40; ++i) {
        room.frame(i);
        if (i >= 10) room.depth.assign(room.depth.size(), 0);
        if (i >= 20) room.colour.assign(room.colour.size(), 0);
        watch.look(room.view());
        ASSERT_FALSE(watch.is_any_stuck()) << i;
        ASSERT_EQ(watch.is_frozen(), i > 20) << i;
    }
}

}  // namespace
}  // namespace stillmesh::stream_watch_test
