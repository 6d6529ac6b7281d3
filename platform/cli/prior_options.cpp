#include "platform/cli/prior_options.hpp"

#include <string>

#include "platform/poses/body_frames.hpp"

namespace stillmesh {

void add_prior_options(CLI::App& app, RunArguments& arguments, const char* group) {
    app.add_option("--odometry", arguments.odometry,
                   "how the camera moved, by wheels or another tracker: 'time x y z qx qy qz qw', poses of the camera "
                   "in any frame; a recording's own odometry.txt if not given; none: without; ros2: /odom_in beside "
                   "--camera ros2")
        ->type_name("FILE|ros2[:TOPIC]")
        ->group(group);
    app.add_option("--gyro", arguments.gyroscope,
                   "how it turned: 'time wx wy wz', rad/s in the camera's frame; a recording's own gyro.txt if not "
                   "given; none: without; ros2: /imu")
        ->type_name("FILE|ros2[:TOPIC]")
        ->group(group);
    app.add_option("--accelerometer", arguments.accelerometer,
                   "of --level gravity: 'time ax ay az', m/s^2 in the camera's axes; a recording's own "
                   "accelerometer.txt if not given; ros2: /imu")
        ->type_name("FILE|ros2[:TOPIC]")
        ->group(group);
    app.add_option_function<double>(
           "--odometry-error",
           [&arguments](double percent) {
               arguments.motion_errors.way_share = arguments.motion_errors.turn_share = percent / 100;
           },
           "of the odometry, percent of way and turn (2)")
        ->check(CLI::Range(0.0, 100.0).description(""))
        ->type_name("PERCENT")
        ->group(group);
    app.add_option_function<double>(
           "--gyro-error",
           [&arguments](double degrees) { arguments.motion_errors.gyro_rad_s = degrees * 0.017453292519943295; },
           "of the gyroscope, degrees per second (.5)")
        ->check(CLI::Range(0.0, 180.0).description(""))
        ->type_name("DEGREES")
        ->group(group);
    app.add_option("--mask", arguments.mask,
                   "an image of the camera's size, white where nothing is to be looked at: what it always sees of its "
                   "own robot; or a folder with a PNG for each colour image of a recording, of its name, white where a "
                   "detector saw what may move (else mask/ in the recording; none: without)")
        ->type_name("FILE|DIR")
        ->group(group);
    add_start_option(app, arguments.session.start,
                     "where the camera (x right, y down, z forward) is at its first frame: poses, and the map, count "
                     "from there; 0,0,0 if not given",
                     group);
}

void add_start_option(CLI::App& app, std::optional<RigidTransform>& start, const char* sentence, const char* group) {
    CLI::Option* const option = app.add_option_function<std::string>(
        "--start-pose",
        [&start](const std::string& text) {
            RigidTransform pose;
            if (!parse_pose(text, pose)) {
                throw CLI::ValidationError("--start-pose " + text, "give x,y,z (m) or x,y,z,qx,qy,qz,qw");
            }
            start = pose;
        },
        sentence);
    option->type_name("X,Y,Z[,QX,QY,QZ,QW]");
    if (*group != '\0') option->group(group);
}

}  // namespace stillmesh
