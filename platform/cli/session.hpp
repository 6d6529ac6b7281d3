// What the run loop needs of an engine, without the engine's types: EngineSession is the real one; tests bring one that
// tells any story (a lost camera, a full disk in the middle).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "engine/base/status.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "platform/report/run_record.hpp"
#include "platform/ros2/map_points.hpp"
#include "platform/ros2/shown_grid.hpp"
#include "platform/view/view_downloads.hpp"

namespace stillmesh {

// What came out for one frame.
struct SessionFrame {
    PoseState state = PoseState::kNone;
    TrajectoryPose world_from_camera;  // valid unless the state is kNone
    std::uint16_t features = 0;
    std::uint16_t static_features = 0;
    std::uint16_t dynamic_features = 0;
    std::uint64_t state_hash = 0;
    UnsureReason unsure = UnsureReason::kNone;  // by the engine
    PoseEstimate estimate;                      // as the engine gave it
    FrameStatistics statistics;
    std::uint64_t keyframe = kNoKeyframe;  // that the pose hangs on
    std::int64_t background_ns = 0;        // of work(): the engine's own part
};

// What the engine shows of itself, to be drawn. Borrowed until the next submit.
struct SessionLook {
    TrackingView tracking;
    std::array<float, kStages> stage_ms{};  // of the last frame
    PoolStatistics keyframes, map_points, keyframe_queue;
    std::uint32_t keyframes_written = 0, links_written = 0;
};

class TrackingSession {
public:
    virtual ~TrackingSession() = default;
    // All is opened that a start could be refused for: what lies at the places of outputs may be moved. False:
    // `message`.
    [[nodiscard]] virtual bool begin(std::string& message) {
        static_cast<void>(message);
        return true;
    }
    // Somebody may want to see the map's points while the run goes on: they are copied behind the frames when he asks.
    // nullptr: nobody. False: there is no memory for it; `message`.
    [[nodiscard]] virtual bool show_points(MapPoints* points, std::string& message) {
        static_cast<void>(points);
        static_cast<void>(message);
        return true;
    }
    // The grid, if one is made at all, is put there too, every few seconds. nullptr: nobody asks.
    virtual void show_grid(GridShelf* shelf) { static_cast<void>(shelf); }
    // kOk: `out` is filled. Else the frame was refused and `message` says why.
    [[nodiscard]] virtual Status submit(const Frame& frame, SessionFrame& out, std::string& message) = 0;
    // Background work behind the frame: until a time of monotonic_ns, or, without one, as much as the configuration
    // grants each frame. Then the frame, whose pixels must still be there, is
    // recorded and done with. `out.state_hash` follows.
    virtual void work(std::optional<std::int64_t> until_ns, SessionFrame& out) {
        static_cast<void>(until_ns);
        static_cast<void>(out);
    }
    // From here on each pose given out is kept, to be told again as it is known at the end.
    virtual void keep_final_trajectory() {}
    // Those poses, one for each frame that was given one; empty: as they were given out.
    [[nodiscard]] virtual std::optional<Trajectory> final_trajectory() { return std::nullopt; }
    // What has happened since it was asked last that the user should hear of now (a map that could not be saved);
    // empty: nothing.
    [[nodiscard]] virtual std::string news() { return {}; }
    // Of the last frame's colour image; nullptr: not known.
    [[nodiscard]] virtual const FeatureSet* features() const { return nullptr; }
    // Of a camera that is lost: whether it would find its way if it began anew where this frame is; empty: not known
    // yet. Each frame of the loss is shown once.
    [[nodiscard]] virtual std::optional<bool> could_begin_here(const Frame& frame) {
        static_cast<void>(frame);
        return std::nullopt;
    }
    virtual void is_found_again() {}
    // Lays the map aside, written where maps are written to, and begins another. Empty: there is none yet, nothing was
    // done; else what to say.
    [[nodiscard]] virtual std::string begin_new_map() { return {}; }
    // Between frames: map, grid and cloud are written where they are written to, as soon as they can be. What to say of
    // it.
    [[nodiscard]] virtual std::string save_map() { return {}; }
    // Where that is, of the map at hand; empty: nowhere.
    [[nodiscard]] virtual ViewDownloads::Files files() const { return {}; }
    // From the next frame on the map stays as it is, or is added to again. Likewise.
    [[nodiscard]] virtual std::string localise_only(bool is_wanted) {
        static_cast<void>(is_wanted);
        return {};
    }
    // What should outlive the program is saved, without asking for memory: there is none.
    virtual void rescue() {}
    // The last frame's mesh and times, the pools, and as many keyframes and links between them (kViewLinksOfEach) as
    // there is room for. Changes nothing, calls no heap. False: there is nothing to be seen.
    [[nodiscard]] virtual bool look(SessionLook& look, std::span<KeyframePose> keyframes,
                                    std::span<KeyframeLink> links) {
        static_cast<void>(look);
        static_cast<void>(keyframes);
        static_cast<void>(links);
        return false;
    }
    // Stages with their times, pools with their high-water marks, memory.
    virtual void account(RunRecord& record) = 0;
};

}  // namespace stillmesh
