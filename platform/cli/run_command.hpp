// `stillmesh run`: a camera, a recording or a simulated scene tracked from end to end, with trajectory, summary and
// report.
#pragma once

#include <cstdint>
#include <string>

#include "platform/cli/engine_session.hpp"
#include "platform/cli/live_camera.hpp"
#include "platform/cli/run_loop.hpp"
#include "platform/view/view_server.hpp"

namespace stillmesh {

struct RunArguments {
    std::string replay;                // folder in the TUM layout, or a bag; this or `simulate`
    std::string replay_topics;         // of a bag: COLOUR,DEPTH,INFO; empty: found
    std::string simulate;              // SCENE[:SEED]
    std::string dirt;                  // of the simulation, as shake=1,rolling=.5; what the scene has if empty
    double replay_frames_per_s = 0;    // of a recording that numbers its frames; 0: it has times
    double replay_pair_gap_s = 0.02;   // between a colour image and its depth image, at most
    double depth_units_per_m = 0;      // of a recording, instead of its camera file's; 0: as that says
    double replay_depth_offset_s = 0;  // that depth's clock is ahead of colour's
    std::string odometry;              // file; empty: the folder's own, if it has one; "none": none
    std::string gyroscope;             // likewise
    std::string accelerometer;         // likewise; with --level gravity alone
    MotionErrors motion_errors;
    LiveCameraOptions live;                              // its calibration is `calibration`
    std::string inject;                                  // a seed for faults; empty: none
    std::string calibration;                             // file or name; empty: the folder's own
    std::string report;                                  // folder; empty: none
    std::uint32_t report_frames = kFilmPicturesDefault;  // pictures in it, at most
    std::string record_frames;                           // folder; empty: none
    std::string map;                                     // to go on in if it is there, and to write; empty: none
    double new_map_when_lost_s = 0;                      // 0: never
    std::string command;                                 // as it was typed
    SessionOptions session;
    RunLoopOptions loop;
    ViewServerOptions view;  // where a page shows the run, if anywhere
    bool is_json = false;
    bool is_realtime = false;
    std::string mask;        // image file: what is white there is not looked at; empty: none
    bool is_half = false;    // images are halved before they are tracked
    bool does_wait = false;  // for a live camera at the start
    bool print_config = false;
    bool is_camera_check = false;  // nothing but what the camera check found is written
    std::string corrected;         // file for the calibration that would fit; empty: none
};

// Returns the program's exit code; has said what there is to say on standard output and error. `begin_ns`: when the
// program began (monotonic_ns).
[[nodiscard]] int run_command(const RunArguments& arguments, std::int64_t begin_ns);

}  // namespace stillmesh
