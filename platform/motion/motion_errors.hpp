// What wheels and a gyroscope are off by: what a simulated one is given, and what is claimed of one read from a file.
#pragma once

namespace stillmesh {

struct MotionErrors {
    double way_share = 0.02;   // of the way, by wheels; one sign for a whole run
    double turn_share = 0.02;  // of the turn, by wheels
    double step_m = 0.0003;    // noise from frame to frame
    double step_rad = 0.0003;  // and of the turn
    double gyro_rad_s =
        0.0087266463;  // bias of a gyroscope: half a degree per second, in one direction for a whole run
    double gyro_noise_rad_s = 0.00087;  // its noise from frame to frame
};

}  // namespace stillmesh
