/* Yesterday a map was made and saved; today the camera is found in it, and its poses are those of the map. */
#include <stdio.h>
#include <stdlib.h>

#include "wall.h"

static sm_problem problem = {.size = sizeof(sm_problem)};

/* With the library's vocabulary: by its words a place is found again. */
static sm_engine* engine_of(const sm_settings* settings) {
    const size_t bytes = sm_engine_bytes(settings);
    sm_engine* engine = NULL;
    sm_engine_create(malloc(bytes), bytes, settings, &wall_camera, NULL, &engine, &problem);
    return engine;
}

int main(void) {
    static const char file[] = "localise_in_c.map";
    sm_settings settings = {.size = sizeof settings};
    sm_engine *yesterday, *today;
    uint32_t i;
    sm_settings_init(&settings, "pocket", "indoor", &problem);
    if ((yesterday = engine_of(&settings)) == NULL || (today = engine_of(&settings)) == NULL) return 1;
    for (i = 0; i < 40; ++i) {
        const sm_frame frame = wall_frame(i, 6 * i);
        sm_submit(yesterday, &frame, NULL, &problem);
        sm_step(yesterday, 20000);
    }
    if (sm_save_map(yesterday, file, &problem) != SM_OK ||
        sm_load_map_file(today, file, SM_MAP_LOCALISE, &problem) != SM_OK) { /* the map stays as it is */
        fprintf(stderr, "%s\n", problem.sentence);
        return 1;
    }
    for (i = 0; i < 20; ++i) {
        sm_frame frame = wall_frame(i, 100 + 6 * i);
        sm_pose pose = {.size = sizeof pose};
        frame.time_ns += 1000000000000;
        sm_submit(today, &frame, NULL, &problem);
        sm_step(today, 20000);
        sm_get_pose(today, &pose);
        if (pose.state == SM_POSE_NONE || i % 4 != 0) continue;
        printf("frame %u: %s, %.3f m along the wall of the map\n", i, sm_pose_state_name(pose.state),
               pose.map_from_camera.translation_m[0]);
    }
    remove(file);
    return 0;
}
