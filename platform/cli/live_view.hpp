// `--view`: what the run tells a page that looks on. Called by the run loop, on the engine's thread: cheap when nobody
// looks (a place on the path, and what a new keyframe saw), below a millisecond when somebody does; it reads what the
// engine shows and changes nothing. Without a feed every call returns at once.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/geometry/camera_model.hpp"
#include "platform/cli/session.hpp"
#include "platform/view/view_feed.hpp"

namespace stillmesh {

class LiveView {
public:
    // `feed`: null for none; it outlives this.
    LiveView(ViewFeed* feed, const CameraModel& camera, std::int64_t frame_period_ns);

    // Behind submit, while the frame's pixels are there. `now_ns` of monotonic_ns; `frame_ms`: frame in to pose out.
    struct Moment {
        std::uint64_t frame = 0;
        std::size_t map = 1;
        std::int64_t now_ns = 0;
        float frame_ms = 0;
    };
    void frame(const Moment& moment, const Frame& frame, const SessionFrame& out, TrackingSession& session);
    // A frame that was not tracked.
    void no_pose(const Moment& moment, const Frame& frame, const char* reason);
    void event(const std::string& sentence) {
        if (feed_ != nullptr) feed_->event(sentence);
    }
    void begin_map() {
        if (feed_ != nullptr) feed_->begin_map();
    }

private:
    void fill(const Moment& moment, const Frame& frame, ViewSnapshot& to) const;
    void keep_cloud(const Frame& frame, const SessionLook& look);

    ViewFeed* feed_;
    CameraModel camera_;
    float budget_ms_;
    SessionLook look_;
    ViewCloud cloud_;
};

}  // namespace stillmesh
