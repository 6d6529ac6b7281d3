/* Instead of a camera: a patterned wall 2 m away that passes by. */
#ifndef WALL_H
#define WALL_H

#include "stillmesh.h"

static uint8_t wall_grey[480 * 640];
static uint16_t wall_depth[480 * 640];

/* Frame number i, the wall having passed by so many pixels. */
static sm_frame wall_frame(uint32_t i, uint32_t passed_px) {
    sm_frame frame = {sizeof frame, SM_GREY8, 0, 0, 640, 480, wall_grey, 640, wall_depth, 2 * 640, 1000, NULL, 0};
    uint32_t x, y;
    for (y = 0; y < 480; ++y) {
        for (x = 0; x < 640; ++x) {
            uint32_t cell = ((x + passed_px) / 8 * 2654435761U) ^ (y / 8 * 2246822519U);
            wall_grey[y * 640 + x] = (uint8_t)((cell ^ cell >> 15) * 97U);
            wall_depth[y * 640 + x] = 2000;
        }
    }
    frame.time_ns = (int64_t)i * 33333333;
    return frame;
}

static const sm_camera wall_camera = {
    sizeof(sm_camera), 640, 480, SM_LENS_BROWN, 525, 525, 319.5, 239.5, 0, 0, 0, 0, 0, 0, 0, 0};

#endif
