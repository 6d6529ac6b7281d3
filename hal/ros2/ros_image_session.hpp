// One opening of a Ros2Camera: its subscriptions, the thread that takes messages and copies each image once, the pairs,
// and what was said meanwhile of lenses and of how frames lie to each other. Inner: sees Cyclone's headers.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "hal/live/live_session.hpp"
#include "hal/ros2/ros2_camera.hpp"
#include "hal/ros2/ros_frames.hpp"
#include "hal/ros2/ros_readers.hpp"

namespace stillmesh {

// An image of either kind.
struct RosPixels {
    std::int64_t time_ns = 0;
    std::uint32_t width = 0, height = 0;
    PixelFormat format = PixelFormat::kGrey8;
    double units_per_m = 0;
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
};
// They change hands and come back, each with the memory that it has: five of a kind are there at most.
struct RosShelf {
    std::mutex mutex;
    std::vector<std::unique_ptr<RosPixels>> free;
};
struct BackToShelf {
    RosShelf* shelf = nullptr;
    void operator()(RosPixels* pixels) const noexcept {
        const std::lock_guard lock(shelf->mutex);
        shelf->free.emplace_back(pixels);
    }
};
using RosPixelsOnLoan = std::unique_ptr<RosPixels, BackToShelf>;

struct Ros2Camera::Session : live::LiveSession<RosPixelsOnLoan> {
    using Image = RosPixelsOnLoan;
    // kDepthLens says what depth is of, if it is not of colour's camera: nobody need publish it.
    enum Stream : std::uint8_t { kColour, kDepth, kLens, kDepthLens, kStreams };
    static constexpr std::size_t kNeeded = 3;  // the first

    Ros2Options options;
    std::array<std::string, kStreams> names;
    std::array<dds_entity_t, kStreams> readers{};
    RosReaders all;
    bool has_lens = false;  // this and all below: under the mutex
    bool has_depth_lens = false;
    std::string problem;  // frames came that cannot be used
    CameraInfo lens, depth_lens;
    RosFrames frames;                      // of the robot of depth's topic
    std::array<std::string, 2> frame_ids;  // of the last image of colour and depth
    std::array<RosShelf, 2> shelves;       // of colour and depth: on one, each image would come to hold memory for both
    std::vector<std::int64_t> stamps_us;   // of colour, until the rate is known
    std::int64_t period_us = 0;            // 0: not known yet
    std::array<std::int64_t, kStreams> last_ns{};  // when one came
    std::jthread thread;

    explicit Session(Ros2Options given_options);
    ~Session();
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    [[nodiscard]] bool subscribe(const RosContext& context, std::string& message);
    // Somebody publishes there, or nobody is asked to.
    [[nodiscard]] bool is_matched(std::size_t stream) const;
    [[nodiscard]] std::string unmatched() const;  // of what is needed
    [[nodiscard]] std::string silent() const;     // the same, half a second without a message; under the mutex

private:
    void serve() noexcept;
    bool take_lens(Stream stream);
    bool take_frames();
    bool take_image(Stream stream);
    template <typename Message>
    bool take_as(Stream stream);
    void take_in(Stream stream, Image image, std::int64_t arrival_ns);
    void learn_rate(std::int64_t time_us, std::int64_t arrival_ns);
};

}  // namespace stillmesh
