/* A robot drives along a wall that its camera looks at, and its wheels say how far: evidence for the engine, frame by
 * frame. */
#include <stdio.h>
#include <stdlib.h>

#include "wall.h"

#define TICK_M 0.0001 /* what a wheel rolls from one tick of its encoder to the next */

int main(void) {
    sm_problem problem = {.size = sizeof problem};
    sm_settings settings = {.size = sizeof settings};
    sm_options options = {.size = sizeof options};
    sm_engine* engine;
    size_t bytes;
    uint32_t i, ticks_then = 0;
    sm_settings_init(&settings, "pocket", "indoor", &problem);
    bytes = sm_engine_bytes(&settings);
    if (sm_engine_create(malloc(bytes), bytes, &settings, &wall_camera, &options, &engine, &problem) != SM_OK) return 1;
    for (i = 0; i < 5; ++i) {
        const uint32_t ticks = 228 * i; /* both wheels: it drives straight on */
        const double driven_m = (ticks - ticks_then) * TICK_M;
        const sm_frame frame = wall_frame(i, 6 * i);
        /* The camera looks to the side: its x axis is where the robot drives. 2 % of slip, and half a millirad of turn.
         */
        sm_motion_hint hint = {sizeof hint, 0, {{0, 0, 0, 1}, {0, 0, 0}}, 0, 5e-4};
        sm_pose pose = {.size = sizeof pose};
        hint.last_from_camera.translation_m[0] = driven_m;
        hint.sigma_m = 0.02 * driven_m + 1e-4;
        if (sm_submit(engine, &frame, i > 0 ? &hint : NULL, &problem) != SM_OK) return 1;
        ticks_then = ticks;
        sm_step(engine, 20000);
        sm_get_pose(engine, &pose);
        printf("frame %u: %s, %.3f m, by the wheels %.3f m\n", i, sm_pose_state_name(pose.state),
               pose.odom_from_camera.translation_m[0], ticks * TICK_M);
    }
    return 0;
}
