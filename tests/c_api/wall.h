/* A patterned wall 2 m away that passes by, a frame at a time: all that it takes to follow a camera. */
#ifndef STILLMESH_TESTS_WALL_H
#define STILLMESH_TESTS_WALL_H

#include <stdint.h>
#include <stdlib.h>

#include "stillmesh.h"

typedef struct wall {
    uint32_t width;
    uint32_t height;
    uint8_t* grey;
    uint16_t* depth;
} wall;

static wall wall_of(uint32_t width, uint32_t height) {
    wall w = {width, height, NULL, NULL};
    size_t pixels = (size_t)width * height, i;
    w.grey = (uint8_t*)malloc(pixels);
    w.depth = (uint16_t*)malloc(2 * pixels);
    for (i = 0; i < pixels; ++i) w.depth[i] = 10000;
    return w;
}
static void wall_end(wall* w) {
    free(w->grey);
    free(w->depth);
}
/* Frame number i: two pixels farther than the one before. */
static sm_frame wall_frame(wall* w, uint32_t i) {
    sm_frame frame = {sizeof(sm_frame), SM_GREY8, 0, 0, 0, 0, NULL, 0, NULL, 0, 5000, NULL, 0};
    uint32_t x, y;
    for (y = 0; y < w->height; ++y) {
        for (x = 0; x < w->width; ++x) {
            uint32_t cell = ((x + 2 * i) / 8 * 2654435761U) ^ (y / 8 * 2246822519U);
            cell ^= cell >> 15;
            w->grey[(size_t)y * w->width + x] = (uint8_t)(cell * 97U);
        }
    }
    frame.time_ns = (int64_t)i * 33000000;
    frame.width = w->width;
    frame.height = w->height;
    frame.colour = w->grey;
    frame.colour_stride_bytes = w->width;
    frame.depth = w->depth;
    frame.depth_stride_bytes = 2 * (size_t)w->width;
    return frame;
}

#endif
