// `--view` and `--report`: what the run tells a page that looks on, and a report that is written at its end. Called by
// the run loop, on the engine's thread: cheap when nobody looks (a place on the path, and what a new keyframe saw),
// below a millisecond when somebody does; a picture for the report costs another (run_film.hpp). It reads what the
// engine shows and changes nothing. Without a feed every call returns at once.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/geometry/camera_model.hpp"
#include "platform/cli/session.hpp"
#include "platform/report/run_film.hpp"
#include "platform/view/view_feed.hpp"

namespace stillmesh {

class LiveView {
public:
    // `feed`: null for none; `film`: null for no report, else there is a feed as well. They outlive this.
    LiveView(ViewFeed* feed, RunFilm* film, const CameraModel& camera, std::int64_t frame_period_ns);

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
        if (film_ != nullptr) film_->event(last_time_ns_, sentence);
    }
    void begin_map() {
        if (feed_ != nullptr) feed_->begin_map();
    }
    // The run is over: the report is given the map as it is.
    void finish(TrackingSession& session);

private:
    void fill(const Moment& moment, const Frame& frame, ViewSnapshot& to) const;
    void keep_cloud(const Frame& frame, const SessionLook& look);

    void keep_place(const Frame& frame, const SessionFrame& out);
    void keep_on_film(const Moment& moment, const Frame& frame, const SessionFrame& out);

    ViewFeed* feed_;
    RunFilm* film_;
    CameraModel camera_;
    float budget_ms_;
    SessionLook look_;
    ViewCloud cloud_;
    std::int64_t last_time_ns_ = 0;  // of the last frame
    bool had_pose_ = false;          // of the frame before
};

}  // namespace stillmesh
