#include "platform/cli/arguments.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <new>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"
#include "platform/cli/base_option.hpp"
#include "platform/cli/cameras_command.hpp"
#include "platform/cli/capture_command.hpp"
#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/cli/grid_options.hpp"
#include "platform/cli/map_command.hpp"
#include "platform/cli/map_merge_command.hpp"
#include "platform/cli/prior_options.hpp"
#include "platform/cli/publish_options.hpp"
#include "platform/cli/report_command.hpp"
#include "platform/cli/rerun_command.hpp"
#include "platform/cli/run_command.hpp"
#include "platform/cli/simulate_command.hpp"
#include "platform/cli/summary.hpp"
#include "platform/cli/view_of_run.hpp"
#include "platform/cli/vocabulary_command.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "platform/linux/memory_reserve.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh {
namespace {

constexpr const char* kDirtHelp =
    "of a simulation: what cameras, hands and rooms do, 0 off, 1 ordinary; 'stillmesh simulate --help' lists";
constexpr const char* kCameraGroup = "Camera (--camera, --replay or --simulate)";

constexpr const char* kReplayHelp =
    "recording: a folder in the TUM layout (rgb.txt, depth.txt, camera.yaml), or a bag of ROS 1 or 2 (.bag, .db3, "
    ".mcap, or the folder of one)";

int eval(const std::string& truth_file, const std::string& trajectory_file, bool is_json) {
    Trajectory truth;
    Trajectory estimate;
    std::string message;
    if (read_trajectory(truth_file, truth, message) != Status::kOk) return refuse(message);
    if (read_trajectory(trajectory_file, estimate, message) != Status::kOk) return refuse(message);
    const auto evaluation = evaluate(truth, estimate);
    if (!evaluation) {
        return refuse(trajectory_file + ": fewer than three poses lie within 20 ms of a pose of " + truth_file +
                      "; do both use one clock?");
    }
    if (is_json) {
        std::fputs(evaluation_json(*evaluation).c_str(), stdout);
    } else {
        std::fputs(evaluation_text(*evaluation).c_str(), stdout);
        std::printf("coverage      %.1f %% of the ground truth's time\n", 100 * evaluation->coverage);
    }
    return kExitDone;
}

void add_camera_options(CLI::App& app, LiveCameraOptions& options, bool& does_wait, const char* group) {
    app.add_option(
           "--camera", options.camera,
           "auto (the first that V4L2, OpenNI2 or libfreenect finds), v4l2 (RealSense and its kind), v4l2:SERIAL, "
           "v4l2:ir (its left infrared camera for colour), v4l2:alternate (with the projector by turns), "
           "v4l2:DEPTH_NODE,COLOUR_NODE, openni2:URI, openni2:SERIAL, openni2:FILE.oni (a recording of OpenNI2), "
           "freenect (a Kinect), or ros2[:COLOUR,DEPTH,INFO] (images of a driver of ROS 2); 'stillmesh cameras' lists "
           "what is "
           "plugged in")
        ->type_name("NAME")
        ->group(group);
    app.add_flag("--wait", does_wait, "for a camera, if none is plugged in yet")->group(group);
    app.add_option("--exposure", options.exposure, "of a live camera: auto (default) or fixed (as it stands)")
        ->check(CLI::IsMember({"auto", "fixed"}).description(""))
        ->type_name("NAME")
        ->group(group);
    app.add_option("--registration", options.registration,
                   "of depth to colour: auto (default: by the camera, else here), here, or none (it is already)")
        ->check(CLI::IsMember({"auto", "here", "none"}).description(""))
        ->type_name("NAME")
        ->group(group);
}

void add_depth_units_option(CLI::App& app, double& depth_units_per_m, const char* group) {
    app.add_option("--depth-units", depth_units_per_m,
                   "of a recording: so many make a metre (millimetres: 1000; TUM: 5000), whatever its camera file says")
        ->check(CLI::Range(100.0, 100000.0).description(""))
        ->type_name("N")
        ->group(group);
}

void add_topics_option(CLI::App& app, std::string& topics, const char* group) {
    CLI::Option* const option =
        app.add_option("--topics", topics, "of a bag: where colour, depth and CameraInfo are; found if not given")
            ->type_name("COLOUR,DEPTH[,INFO]");
    if (*group != '\0') option->group(group);
}

}  // namespace

int command_line(int argc, char** argv) {
    const std::int64_t begin_ns = monotonic_ns();
    CLI::App app("Stillmesh tells where a depth camera is, in rooms full of moving people.", "stillmesh");
    app.require_subcommand(1);
    app.set_version_flag("--version", "stillmesh " STILLMESH_PROGRAM_VERSION, "print the version, and exit");
    app.footer(
        "Exit codes: 0 done; 1 ran but failed (lost camera, no pose); 2 bad usage or input; 130, 143 stopped by "
        "Ctrl-C or SIGTERM, everything written.");

    RunArguments arguments;
    arguments.loop.checks_camera = true;
    CLI::App* const run_app = app.add_subcommand("run", "track a camera and write its trajectory");
    add_camera_options(*run_app, arguments.live, arguments.does_wait, kCameraGroup);
    run_app->add_option("--replay", arguments.replay, kReplayHelp)->type_name("DIR|BAG")->group(kCameraGroup);
    add_topics_option(*run_app, arguments.replay_topics, kCameraGroup);
    run_app
        ->add_option("--fps", arguments.replay_frames_per_s, "of a recording whose lists have frame numbers for times")
        ->check(CLI::Range(1.0, 1000.0).description(""))
        ->type_name("N")
        ->group(kCameraGroup);
    run_app
        ->add_option("--pair-gap", arguments.replay_pair_gap_s,
                     "of a recording: at most between a colour image and its depth image (0.02)")
        ->check(CLI::Range(0.0, 1.0).description(""))
        ->type_name("SECONDS")
        ->group(kCameraGroup);
    run_app
        ->add_option("--depth-offset", arguments.replay_depth_offset_s,
                     "of a recording: what the clock of its depth images is ahead (negative: behind)")
        ->check(CLI::Range(-4e9, 4e9).description(""))
        ->type_name("SECONDS")
        ->group(kCameraGroup);
    add_prior_options(*run_app, arguments, kCameraGroup);
    run_app
        ->add_option("--simulate", arguments.simulate, "simulated room and people; 'stillmesh simulate --help' lists")
        ->type_name("SCENE[:SEED[+DAY]]")
        ->group(kCameraGroup);
    run_app->add_option("--dirt", arguments.dirt, kDirtHelp)->type_name("NAME=STRENGTH,...")->group(kCameraGroup);
    run_app
        ->add_option("--calibration", arguments.calibration,
                     "camera file (TOML; YAML, JSON or text of other programs), or tum-fr1, tum-fr2, tum-fr3, kinect; "
                     "the recording's own if not given")
        ->type_name("FILE|NAME")
        ->group(kCameraGroup);
    add_depth_units_option(*run_app, arguments.depth_units_per_m, kCameraGroup);
    run_app
        ->add_flag("--half", arguments.is_half,
                   "track images at half their width and height, lens and all: 1280x720 as 640x360")
        ->group(kCameraGroup);
    run_app->add_option("--frames", arguments.loop.frames_max, "stop after so many frames")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 40U).description(""))
        ->type_name("N")
        ->group(kCameraGroup);
    run_app
        ->add_flag("--check-camera,!--no-check-camera", arguments.loop.checks_camera,
                   "check whether calibration and depth can be right (the default); while not, nothing is tracked")
        ->group(kCameraGroup);
    run_app
        ->add_flag("--realtime", arguments.is_realtime,
                   "frames at their recorded times: late ones are dropped, background work gets what time is left")
        ->group(kCameraGroup);
    run_app->add_option("--inject", arguments.inject, "faults of every kind into any of these cameras, from a seed")
        ->type_name("SEED")
        ->group(kCameraGroup);
    add_view_options(*run_app, arguments.view);
    add_report_options(*run_app, arguments.report, arguments.report_frames);
    run_app
        ->add_option(
            "--trajectory", arguments.loop.trajectory,
            "each pose as it was given out, TUM format; - is standard output, and the summary goes to standard error")
        ->type_name("FILE")
        ->group("What comes out");
    run_app
        ->add_option("--poses", arguments.loop.poses,
                     "each pose with its state, covariance, velocity and more, a line of JSON a frame, to a file, - "
                     "(standard output), a named pipe, readers that connect (unix:PATH, tcp:[HOST:]PORT) or "
                     "udp:HOST:PORT; may be repeated (docs/poses.md)")
        ->type_name("DEST")
        ->allow_extra_args(false)
        ->group("What comes out");
    add_publish_options(*run_app, arguments.loop.ros, arguments.loop.mavlink);
    run_app
        ->add_flag("--append", arguments.loop.adds_to_trajectory,
                   "with --trajectory and --poses: added to what is there")
        ->group("What comes out");
    run_app
        ->add_option_function<double>(
            "--trajectory-limit",
            [&arguments](double mib) {
                arguments.loop.trajectory_bytes_max = static_cast<std::uint64_t>(mib * 1048576.0);
            },
            "a file of --trajectory or --poses that has grown beyond becomes FILE.1 and begins anew")
        ->check(CLI::Range(0.001, 1e6).description(""))
        ->type_name("MIB")
        ->group("What comes out");
    run_app->add_option("--trajectory-final", arguments.loop.trajectory_final, "each pose as it is known at the end")
        ->type_name("FILE")
        ->group("What comes out");
    run_app->add_option("--state-hashes", arguments.loop.state_hashes, "a line per frame: time and state hash")
        ->type_name("FILE")
        ->group("What comes out");
    run_app
        ->add_option("--record", arguments.session.record,
                     "what 'stillmesh rerun' needs to repeat this run bit for bit")
        ->type_name("FILE")
        ->group("What comes out");
    run_app
        ->add_option("--record-frames", arguments.record_frames,
                     "the frames, as a folder to replay, or a bag FILE.mcap")
        ->type_name("DIR")
        ->group("What comes out");
    run_app
        ->add_option("--map", arguments.map,
                     "go on in this map if it is there, and write it: every minute (--map-every) and at the end")
        ->type_name("FILE")
        ->group("Map");
    run_app
        ->add_option("--map-out", arguments.session.map_out,
                     "the map, when the run ends; Ctrl-C and SIGTERM end it too. Replaced as a whole or not at all")
        ->type_name("FILE")
        ->group("Map");
    run_app
        ->add_option("--map-store", arguments.session.map_store,
                     "places that memory has no room for go there, and come back when they are seen again, in later "
                     "runs too")
        ->type_name("DIR")
        ->group("Map");
    add_grid_options(*run_app, arguments.session.grid, ", when the run ends and as --map-every says", "Map", true);
    run_app->add_option("--map-every", arguments.session.map_every_s, "and while it runs, as often")
        ->check(CLI::Range(0.1, 1e6).description(""))
        ->type_name("SECONDS")
        ->group("Map");
    run_app
        ->add_option("--map-in", arguments.session.map_in,
                     "begin in this map: find the camera in it, then go on mapping")
        ->type_name("FILE")
        ->group("Map");
    run_app
        ->add_option("--new-map-when-lost", arguments.new_map_when_lost_s,
                     "lost for so long, begin another map; the one before is written, the next gets FILE.1")
        ->check(CLI::Range(0.5, 1e6).description(""))
        ->type_name("SECONDS")
        ->group("Map");
    run_app
        ->add_flag("--localize", arguments.session.is_localising, "with --map-in: the map stays as it is, poses only")
        ->group("Map");
    run_app->add_flag("--json", arguments.is_json, "the summary as JSON, no progress")->group("What comes out");
    run_app->add_option("--scene", arguments.session.scene, "thresholds: indoor (default) or outdoor")
        ->check(CLI::IsMember({"indoor", "outdoor"}).description(""))
        ->type_name("NAME")
        ->group("Engine");
    run_app->add_option("--method", arguments.session.method, "ours (default) or paper (the paper to the letter)")
        ->check(CLI::IsMember({"ours", "paper"}).description(""))
        ->type_name("NAME")
        ->group("Engine");
    run_app->add_option("--limits", arguments.session.limits, "memory: room (default) or pocket (a small board)")
        ->check(CLI::IsMember({"room", "pocket"}).description(""))
        ->type_name("NAME")
        ->group("Engine");
    run_app
        ->add_option("--vocabulary", arguments.session.vocabulary,
                     "places are recognised by: default, none (no loops, no way back for a lost camera), or a file")
        ->type_name("FILE")
        ->group("Engine");
    run_app->add_option("--features", arguments.session.features, "native (default) or opencv (cv::ORB)")
        ->check(CLI::IsMember({"native", "opencv"}).description(""))
        ->type_name("NAME")
        ->group("Engine");
    run_app->add_option("--config", arguments.session.configuration, "parameters, TOML")
        ->type_name("FILE")
        ->group("Engine");
    run_app->add_option("--set", arguments.session.assignments, "one parameter over the file's; may be repeated")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false)
        ->group("Engine");
    run_app->add_flag("--print-config", arguments.print_config, "print every parameter with its range, and end")
        ->group("Engine");
    run_app->footer(
        "Examples:\n"
        "  stillmesh run --camera auto --wait --trajectory path.txt     (Ctrl-C ends it, everything written)\n"
        "  stillmesh run --simulate walking_xyz:1 --report out\n"
        "  stillmesh run --replay rgbd_dataset_freiburg3_walking_xyz --calibration tum-fr3 --trajectory path.txt\n"
        "  stillmesh run --replay desk.bag --topics /camera/color/image_raw,/camera/aligned_depth_to_color/image_raw\n"
        "  stillmesh run --simulate static_xyz:1 --map-out room.map\n"
        "  stillmesh run --simulate walking_xyz:1+7 --map-in room.map --localize     (the room on another day)\n"
        "  stillmesh run --replay DIR --set region.is_enabled=false     (what the static region is worth)");
    std::string truth_file;
    std::string trajectory_file;
    bool is_eval_json = false;
    CLI::App* const eval_command =
        app.add_subcommand("eval", "compare a trajectory with the truth: ATE, RPE, coverage");
    eval_command->add_option("--groundtruth", truth_file, "TUM format")->required()->type_name("FILE");
    eval_command->add_option("--trajectory", trajectory_file, "TUM format")->required()->type_name("FILE");
    eval_command->add_flag("--json", is_eval_json, "as JSON");

    RunArguments check;
    check.is_camera_check = true;
    check.loop.checks_camera = true;
    check.loop.frames_max = 300;
    CLI::App* const check_app = app.add_subcommand(
        "check-camera", "whether focal length, centre and depth unit can be what they are said to be");
    add_camera_options(*check_app, check.live, check.does_wait, kCameraGroup);
    check_app->add_option("--replay", check.replay, kReplayHelp)->type_name("DIR|BAG")->group(kCameraGroup);
    add_topics_option(*check_app, check.replay_topics, kCameraGroup);
    check_app->add_option("--simulate", check.simulate, "simulated room")
        ->type_name("SCENE[:SEED]")
        ->group(kCameraGroup);
    check_app
        ->add_option("--calibration", check.calibration,
                     "the one to check; the camera's or recording's own if not given")
        ->type_name("FILE|NAME")
        ->group(kCameraGroup);
    add_depth_units_option(*check_app, check.depth_units_per_m, kCameraGroup);
    check_app->add_option("--frames", check.loop.frames_max, "how many are looked at (300)")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 40U).description(""))
        ->type_name("N")
        ->group(kCameraGroup);
    check_app->add_option("--out", check.corrected, "where a fault was found: the calibration that would fit (.toml)")
        ->type_name("FILE");
    check_app->add_flag("--json", check.is_json, "as JSON, with all the rest of a run");
    check_app->footer(
        "Turn the camera slowly left and right, up and down, in a room where nobody moves: ten seconds are enough.\n"
        "Exit codes: 0 no fault found; 1 a fault, or the camera was lost; 2 bad usage or input.");

    RerunOptions rerun;
    CLI::App* const rerun_command =
        app.add_subcommand("rerun", "repeat a recording bit for bit, or name the first frame that differs");
    rerun_command->add_option("file", rerun.recording, "written by 'stillmesh run --record FILE'")
        ->required()
        ->type_name("FILE");
    rerun_command
        ->add_option("--replay", rerun.folder,
                     "its frames: the folder or bag that was replayed, or written by --record-frames")
        ->required()
        ->type_name("DIR|BAG");
    add_topics_option(*rerun_command, rerun.topics, "");
    rerun_command->add_option("--map-in", rerun.map_in, "the map that the run began in, if it did")->type_name("FILE");
    rerun_command
        ->add_option("--map-store", rerun.map_store, "the map store that the run used, if it held regions before it")
        ->type_name("DIR");
    rerun_command->add_flag("--localize", rerun.is_localising, "if the run had this switch");
    add_start_option(*rerun_command, rerun.start, "if the run had one", "");
    rerun_command->add_option("--mask", rerun.mask, "if the run had one, and the folder is what was replayed")
        ->type_name("FILE|DIR");
    rerun_command->add_flag("--half", rerun.is_half, "if the run had this switch, and the folder is what was replayed");
    rerun_command
        ->add_option("--vocabulary", rerun.vocabulary, "that the recording was made with, if not the default one")
        ->type_name("FILE");
    rerun_command->add_flag("--json", rerun.is_json, "as JSON");
    rerun_command->footer(
        "Exit codes: 0 every frame was repeated bit for bit; 1 one differs; 2 bad recording or folder.");

    CaptureArguments capture;
    CLI::App* const capture_app = app.add_subcommand("capture", "record a live camera, to be run later");
    add_camera_options(*capture_app, capture.camera, capture.does_wait, "Camera");
    capture_app->get_option("--camera")->required();
    capture_app
        ->add_option("--out", capture.out, "folder to make (TUM layout), FILE.mcap (a bag of ROS 2), or FILE.oni")
        ->required()
        ->type_name("DIR|FILE.mcap|FILE.oni");
    capture_app->add_option("--calibration", capture.camera.calibration, "camera file or name, kept with the recording")
        ->type_name("FILE|NAME");
    capture_app->add_option("--frames", capture.frames, "stop after so many frames")
        ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 40U).description(""))
        ->type_name("N");
    capture_app->add_flag("--json", capture.is_json, "summary as JSON, no progress");
    capture_app->footer(
        "Examples:\n"
        "  stillmesh capture --camera auto --out desk            then: stillmesh run --replay desk\n"
        "  stillmesh capture --camera auto --out desk.oni        then: stillmesh run --camera openni2:desk.oni\n"
        "Ctrl-C ends it, everything written. Exit codes: 0 so many frames as asked for; 1 the camera went, or a frame "
        "could not be written; 2 bad usage, or no camera; 130, 143 stopped by Ctrl-C or SIGTERM.");

    SimulateOptions simulation;
    CLI::App* const simulate_command =
        app.add_subcommand("simulate", "write a simulated recording with ground truth and dynamic masks");
    simulate_command->add_option("scene", simulation.scene.name, "such as walking_xyz")
        ->required()
        ->type_name("SCENE[:SEED[+DAY]]");
    simulate_command->add_option("--seed", simulation.scene.seed, "another world; 1 if not given")->type_name("N");
    simulate_command
        ->add_option("--day", simulation.scene.day, "the same world on another day: other people, other light")
        ->type_name("N");
    simulate_command->add_option("--frames", simulation.frames, "how many; the scene's own length if not given")
        ->type_name("N");
    simulate_command->add_option("--every", simulation.every, "of these each so many-th: a camera that moves faster")
        ->check(CLI::Range(1U, 1000U))
        ->type_name("N");
    simulate_command->add_option("--width", simulation.width, "of the images, px (640)")
        ->check(CLI::Range(64U, 2044U))
        ->type_name("N");
    simulate_command->add_option("--height", simulation.height, "px; three quarters of the width if not given")
        ->check(CLI::Range(48U, 2044U))
        ->type_name("N");
    simulate_command->add_flag(
        "--separate-depth", simulation.is_depth_separate,
        "depth of a camera of its own, as in a RealSense: 848x480, 90 degrees wide, 15 mm aside, "
        "not registered; camera.toml names both");
    simulate_command->add_option("--dirt", simulation.dirt, kDirtHelp)->type_name("NAME=STRENGTH,...");
    simulate_command->add_flag(
        "--motion", simulation.has_motion,
        "odometry.txt (2 % off), gyro.txt (.5 degrees/s) and accelerometer.txt (.05 m/s^2) beside the frames");
    simulate_command->add_option("--out", simulation.out, "folder to write")->required()->type_name("DIR");
    std::string scenes = "Scenes, at 30 frames/s:\n";
    for (const SimulatedScene& scene : simulated_scenes()) {
        scenes += std::string("  ") + scene.name + ", " + std::to_string(scene.frames) + " frames\n";
    }
    scenes += "Effects of --dirt, at 1; 'all' is each of them:\n";
    Dirt effects;
    visit_dirt(effects, [&](const char* name, double, const char* text) {
        scenes += std::string("  ") + name + ": " + text + "\n";
    });
    simulate_command->footer(scenes);
    simulate_command->add_flag("--json", simulation.is_json, "summary as JSON");

    CamerasOptions cameras;
    CLI::App* const cameras_app =
        app.add_subcommand("cameras", "which depth cameras are plugged in, and what keeps one from working");
    cameras_app->add_flag("--json", cameras.is_json, "as JSON");
    cameras_app->add_flag("--udev-rules", cameras.is_udev_rules,
                          "print the rules that let a user open a camera, and end");
    CLI::Option* const reset_option =
        cameras_app
            ->add_option("--reset", cameras.reset_port, "reset the camera at this port; the only one if not given")
            ->type_name("[PORT]")
            ->expected(0, 1);
    cameras_app->footer("Exit codes: 0 a camera can stream, or was reset; 1 none can; 2 the USB bus cannot be read.");
    CLI::App* const vocabulary_command =
        app.add_subcommand("vocabulary", "what places are recognised by: train one, or show what one is");
    vocabulary_command->require_subcommand(1);
    VocabularyTrainArguments training;
    CLI::App* const train_command = vocabulary_command->add_subcommand("train", "grow a vocabulary from images");
    train_command
        ->add_option("--images", training.sources.folders,
                     "folder of PNG images (all below it), or recording with rgb.txt; may be repeated")
        ->type_name("DIR")
        ->allow_extra_args(false);
    train_command->add_option("--simulate", training.sources.scenes, "rendered scenes beside them; may be repeated")
        ->type_name("SCENE:SEED[-LAST]")
        ->allow_extra_args(false);
    train_command->add_option("--out", training.out, "file to write")->required()->type_name("FILE");
    train_command->add_option("--every", training.sources.every, "only each N-th image of a recording")
        ->check(CLI::Range(1U, 1'000'000U).description(""))
        ->type_name("N");
    train_command->add_option("--frames", training.sources.frames, "images of each rendered scene (8)")
        ->check(CLI::Range(1U, 100'000U).description(""))
        ->type_name("N");
    train_command->add_option("--features", training.sources.features, "features of an image, at most (1000)")
        ->check(CLI::Range(50U, 4000U).description(""))
        ->type_name("N");
    train_command->add_option("--branching", training.training.branching, "children of a node (10)")->type_name("N");
    train_command->add_option("--levels", training.training.levels, "levels of the tree (4)")->type_name("N");
    train_command
        ->add_option("--direct-level", training.training.direct_level, "level whose nodes features are matched by (2)")
        ->type_name("N");
    train_command->add_option("--seed", training.training.seed, "of the first medians (1)")->type_name("N");
    train_command->add_option("--name", training.training.name, "what 'vocabulary info' calls it")->type_name("TEXT");
    train_command->add_flag("--json", training.is_json, "as JSON, no progress");
    std::string vocabulary_file;
    bool is_info_json = false;
    CLI::App* const info_command = vocabulary_command->add_subcommand("info", "what a vocabulary is");
    info_command->add_option("file", vocabulary_file, "the one that comes with the program if not given")
        ->type_name("FILE");
    info_command->add_flag("--json", is_info_json, "as JSON");

    CLI::App* const map_command = app.add_subcommand(
        "map", "what a map file holds; points, grid and cloud of it for other programs; two maps in one");
    map_command->require_subcommand(1);
    MapExport map_export;
    bool is_map_json = false;
    CLI::App* const map_info = map_command->add_subcommand("info", "how large it is, what was seen, which camera");
    map_info->add_option("file", map_export.file, "a map")->required()->type_name("FILE");
    map_info->add_flag("--json", is_map_json, "as JSON");
    CLI::App* const map_out =
        map_command->add_subcommand("export", "its points and keyframes, a grid to drive in, a cloud, an OctoMap");
    map_out->add_option("file", map_export.file, "a map")->required()->type_name("FILE");
    map_out->add_option("--ply", map_export.ply, "points, for MeshLab, CloudCompare, Blender")->type_name("FILE");
    map_out->add_option("--pcd", map_export.pcd, "points, for the Point Cloud Library")->type_name("FILE");
    map_out->add_option("--tum", map_export.tum, "keyframes' poses, TUM format")->type_name("FILE");
    map_out->add_option("--json", map_export.json, "all of it")->type_name("FILE");
    map_out->add_flag("--moving", map_export.has_moving, "points that turned out to move as well");
    add_grid_options(*map_out, map_export.grid, "", "", false);
    add_base_option(*map_out, [&](const RigidTransform& pose) { map_export.grid.base_from_camera_link = pose; });
    map_out->add_option("--octomap", map_export.octomap, "what was seen empty and occupied, in cubes: an OctoMap, .bt")
        ->type_name("FILE");
    map_out->footer(
        "Coordinates: m, in the frame of the first camera, x right, y down, z forward; a grid's are level.\n"
        "Exit codes: 0 done; 1 could not be made or written; 2 no map, or bad usage.");

    MapMergeOptions map_merge;
    CLI::App* const merge_app = add_map_merge_command(*map_command, map_merge);

    ReportArguments compared;
    CLI::App* const report_app = add_report_command(app, compared);

    try {
        app.parse(argc, argv);
    } catch (const CLI::Success& success) {
        std::ostringstream out, err;
        const int code = app.exit(success, out, err);
        const int answered = answer(out.str());
        return code == kExitDone ? answered : code;
    } catch (const CLI::ParseError& error) {
        std::string command;
        for (const CLI::App* parsed = &app; !parsed->get_subcommands().empty();) {
            parsed = parsed->get_subcommands().front();
            command += parsed->get_name() + " ";
        }
        if (app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-') {
            return refuse("'" + std::string(argv[1]) + "' is no command; 'stillmesh --help' shows the commands.");
        }
        return refuse(std::string(error.what()) + "; 'stillmesh " + command + "--help' shows the " +
                      (command.empty() ? "commands." : "options."));
    }
    // An empty value is a variable that was not set, not a wish for none.
    for (const CLI::App* parsed = &app; parsed != nullptr;
         parsed = parsed->get_subcommands().empty() ? nullptr : parsed->get_subcommands().front()) {
        for (const CLI::Option* const option : parsed->get_options()) {
            if (option->get_expected_min() == 0) continue;  // such as --reset, which may stand alone
            for (const std::string& value : option->results()) {
                if (value.empty())
                    return refuse(option->get_name() + ": its value is empty; leave it out or give one.");
            }
        }
    }
    if (eval_command->parsed()) return eval(truth_file, trajectory_file, is_eval_json);
    if (rerun_command->parsed()) return stillmesh::rerun_command(rerun);
    if (cameras_app->parsed()) {
        cameras.is_reset = reset_option->count() > 0;
        return stillmesh::cameras_command(cameras);
    }
    if (capture_app->parsed()) return stillmesh::capture_command(capture);
    if (simulate_command->parsed()) return stillmesh::simulate_command(simulation);
    if (check_app->parsed()) {
        check.command = "stillmesh check-camera";
        return run_command(check, begin_ns);
    }
    if (train_command->parsed()) return vocabulary_train_command(training);
    if (map_info->parsed()) return map_info_command(map_export.file, is_map_json);
    if (map_out->parsed()) return map_export_command(map_export);
    if (merge_app->parsed()) return map_merge_command(map_merge);
    if (report_app->parsed()) return stillmesh::report_command(compared);
    if (info_command->parsed()) return vocabulary_info_command(vocabulary_file, is_info_json);
    arguments.command = command_without_token(argc, argv);
    return run_command(arguments, begin_ns);
}

}  // namespace stillmesh
