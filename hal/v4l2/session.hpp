// One opening of a camera: opens, reads, pairs the images by time, puts the newest pair into one slot, closes; on a
// thread of its own, or step by step on the caller's. The camera takes pairs out of the slot on its own thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "hal/live/live_session.hpp"
#include "hal/v4l2/image_clock.hpp"
#include "hal/v4l2/opening.hpp"
#include "hal/v4l2/v4l2_camera.hpp"

namespace stillmesh::v4l2 {

struct Session : live::LiveSession<Image> {
    Session(std::shared_ptr<V4l2Link> given_link, OpeningWishes given_wishes)
        : link(std::move(given_link)), wishes(std::move(given_wishes)), opening(*link) {}
    ~Session() { close(); }  // images go back before what they are of
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    // Of the thread that serves; the camera reads it once it is opened or closed.
    std::shared_ptr<V4l2Link> link;
    OpeningWishes wishes;
    Opening opening;
    Opened opened;
    Status status = Status::kUnavailable;
    std::string message;

    // With the lock: what a user should know once of what came; empty: nothing new.
    [[nodiscard]] std::string take_remark();

    void open();
    // What has come within timeout_ms, all of it.
    void read(std::uint32_t timeout_ms);
    void close() noexcept;
    // All of it until it is told to close.
    void serve(const std::function<void()>& thread_begins) noexcept;

private:
    static constexpr std::uint32_t kWithoutMax = 30;  // images in a row without what the camera says about them

    static constexpr std::uint32_t kAlikeMax = 30;  // pictures in a row, all with the projector or all without

    void account(const ImageFacts& facts) noexcept;
    // Where the projector takes turns: whether the image is one to be used.
    [[nodiscard]] bool is_its_turn(bool is_colour, const ImageFacts& facts) noexcept;
    // What a stream gave, with the lock, under which no call of the link is made; false: nothing more is there.
    [[nodiscard]] bool take_in(bool is_colour, int error, Image image, std::int64_t arrival_ns);

    ImageClock image_clock_{0, 0};
    std::uint32_t without_ = 0;  // images in a row
    bool is_without_ = false, is_without_told_ = false;
    bool has_depth_ = false;  // of an image with the projector, for the picture after it
    bool was_laser_on_ = false;
    std::uint32_t alike_ = 0;  // pictures in a row
    bool is_alike_ = false, is_alike_told_ = false;
};

}  // namespace stillmesh::v4l2
