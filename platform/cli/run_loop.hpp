// The main job: frames from a camera into a session, poses out to files, numbers into a record. Poses are on disk
// before the next frame is looked at; whatever stops the run, what was given out stays.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_times.hpp"
#include "platform/cli/frame_diagnosis.hpp"
#include "platform/cli/session.hpp"
#include "platform/mavlink/mavlink_output.hpp"
#include "platform/record/frame_folder_writer.hpp"
#include "platform/report/run_film.hpp"
#include "platform/ros2/ros_publisher.hpp"
#include "platform/view/view_feed.hpp"

namespace stillmesh {

// A silence that is worth a word, and no failure.
inline constexpr std::int64_t kGapNoted_ns = 250'000'000;

struct RunLoopOptions {
    std::string trajectory;                  // file; "-": standard output; empty: none
    bool adds_to_trajectory = false;         // to what is in the file already
    std::uint64_t trajectory_bytes_max = 0;  // beyond, it becomes FILE.1 and begins anew; 0: no limit
    std::vector<std::string> poses;          // destinations of poses with their trust; files as the trajectory's
    RosOptions ros;                          // the same as messages of ROS 2
    MavlinkOptions mavlink;                  // and for an autopilot
    std::string trajectory_final;            // file; empty: none
    std::string state_hashes;                // file, a line per frame; empty: none
    std::uint64_t frames_max = 0;            // 0: all
    std::uint64_t frames_expected = 0;       // 0: unknown; only for the progress
    bool keep_trajectory = false;            // in record.estimate
    bool show_progress = true;
    bool checks_camera = false;            // while a fault of calibration or streams holds, nothing is `tracked`
    FrameTimes* times = nullptr;           // the camera's, if frames come by the clock: late ones are dropped
    bool is_live = false;                  // a silence is the camera's life, and no failure of the run
    std::function<std::string()> news;     // sentences about the camera, oldest first, then an empty one; may be empty
    FrameFolderWriter* frames = nullptr;   // where every frame is written to, if anywhere
    std::int64_t frame_period_ns = 0;      // of the camera; longer from frame to pose is a deadline missed; 0: unknown
    std::int64_t new_map_after_ns = 0;     // lost for so long, another map is begun; 0: never
    ViewFeed* view = nullptr;              // for a page that looks on, or a report; null: neither
    ViewControls controls;                 // what may be asked of this run by who looks on
    RunFilm* film = nullptr;               // for a report; null: none
    CameraModel camera;                    // for the view
    bool begins_in_map = false;            // in one that was read
    bool is_localising = false;            // and it stays as it is, until somebody wants otherwise
    DepthRange depth_range;                // that the engine uses
    std::int64_t lost_ns = 1'000'000'000;  // longer without a measured pose, or without a frame, is a failure
    // Hears what became of each frame, before the next is asked for; may be empty.
    std::function<void(const PoseEstimate&)> posed;
};

// Runs until the camera's end, frames_max, a failure or a signal. Returns an exit code (exit_code.hpp); sentences for
// the user are in record.problems. `camera_message` says what a camera's last failure was.
[[nodiscard]] int run_loop(DepthCamera& camera, const std::function<std::string()>& camera_message,
                           TrackingSession& session, const RunLoopOptions& options, RunRecord& record);

}  // namespace stillmesh
