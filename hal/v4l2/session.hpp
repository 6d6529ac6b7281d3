// One opening of a camera: opens, reads, pairs the images by time, puts the newest pair into one slot, closes; on a
// thread of its own, or step by step on the caller's. The camera takes pairs out of the slot on its own thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "hal/live/live_session.hpp"
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

    void open();
    // What has come within timeout_ms, all of it.
    void read(std::uint32_t timeout_ms);
    void close() noexcept;
    // All of it until it is told to close.
    void serve(const std::function<void()>& thread_begins) noexcept;

private:
    // What a stream gave, with the lock, under which no call of the link is made; false: nothing more is there.
    [[nodiscard]] bool take_in(bool is_colour, int error, Image image, std::int64_t arrival_ns);
};

}  // namespace stillmesh::v4l2
