/* A program in C of somebody who installed libstillmesh-dev: a frame of noise, and the pose that it gets. */
#include <stdio.h>
#include <stdlib.h>

#include "stillmesh.h"

int main(void) {
    static uint8_t grey[160 * 120];
    static uint16_t depth[160 * 120];
    sm_problem problem = {sizeof problem, SM_OK, ""};
    sm_settings settings = {sizeof settings, 0, {0}};
    sm_camera camera = {sizeof camera, 160, 120, SM_LENS_BROWN, 130, 130, 80, 60, 0, 0, 0, 0, 0, 0, 0, 0};
    sm_options options = {sizeof options, 0, NULL, 0, NULL, NULL};
    sm_frame frame = {sizeof frame, SM_GREY8, 0, 0, 160, 120, grey, 160, depth, 320, 1000, NULL, 0};
    sm_pose pose;
    sm_engine* engine;
    size_t bytes, i;
    for (i = 0; i < sizeof grey; ++i) {
        uint32_t cell = ((uint32_t)(i % 160 / 8) * 2654435761U) ^ ((uint32_t)(i / 160 / 8) * 2246822519U);
        grey[i] = (uint8_t)((cell ^ cell >> 15) * 97U);
        depth[i] = 2000;
    }
    if (sm_settings_init(&settings, "tiny", "indoor", &problem) != SM_OK) return 1;
    bytes = sm_engine_bytes(&settings);
    if (sm_engine_create(malloc(bytes), bytes, &settings, &camera, &options, &engine, &problem) != SM_OK ||
        sm_submit(engine, &frame, NULL, &problem) != SM_OK) {
        printf("%s\n", problem.sentence);
        return 1;
    }
    pose.size = sizeof pose;
    sm_get_pose(engine, &pose);
    printf("from C: %s\n", sm_pose_state_name(pose.state));
    return pose.state == SM_POSE_TRACKED ? 0 : 1;
}
