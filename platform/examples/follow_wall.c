/* A camera passes a patterned wall 2 m away, 6 pixels a frame: all that it takes to follow it. */
#include <stdio.h>
#include <stdlib.h>

#include "wall.h"

int main(void) {
    sm_problem problem = {.size = sizeof problem};
    sm_settings settings = {.size = sizeof settings};
    sm_options options = {.size = sizeof options}; /* no vocabulary: no place is recognised */
    sm_engine* engine;
    size_t bytes;
    uint32_t i;
    sm_settings_init(&settings, "pocket", "indoor", &problem);
    bytes = sm_engine_bytes(&settings);
    if (sm_engine_create(malloc(bytes), bytes, &settings, &wall_camera, &options, &engine, &problem) != SM_OK) {
        fprintf(stderr, "%s\n", problem.sentence);
        return 1;
    }
    for (i = 0; i < 5; ++i) {
        const sm_frame frame = wall_frame(i, 6 * i);
        sm_pose pose = {.size = sizeof pose};
        if (sm_submit(engine, &frame, NULL, &problem) != SM_OK) {
            fprintf(stderr, "%s\n", problem.sentence);
            return 1;
        }
        sm_step(engine, 20000); /* background work, until the next frame comes */
        sm_get_pose(engine, &pose);
        printf("frame %u: %s, %.3f m along the wall\n", i, sm_pose_state_name(pose.state),
               pose.odom_from_camera.translation_m[0]);
    }
    return 0;
}
