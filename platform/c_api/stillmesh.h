/* The engine for C and for whatever calls C: frames in, poses out, everything that engine/engine.hpp can do.
 *
 *   sm_settings settings = {.size = sizeof settings};
 *   sm_settings_init(&settings, "room", "indoor", &problem);
 *   sm_camera camera = {sizeof camera, 640, 480, SM_LENS_BROWN, 525, 525, 319.5, 239.5};
 *   size_t bytes = sm_engine_bytes(&settings);
 *   sm_engine* engine;
 *   sm_engine_create(malloc(bytes), bytes, &settings, &camera, NULL, &engine, &problem);
 *   sm_submit(engine, &frame, NULL, &problem);           // tracks the frame
 *   sm_step(engine, 20000);                              // background work, in the time that is left
 *   sm_get_pose(engine, &pose);
 *
 * Memory: the caller's, at any address; nothing is allocated after sm_engine_create but by the functions that say so.
 * An engine is given back by giving back its memory. One engine is used by one thread.
 *
 * Structs that begin with `size` have it set to sizeof by the caller: newer libraries know older structs by it, and
 * leave out or take as 0 what they do not have. The others never change.
 *
 * Errors: a status, and where there is an sm_problem (or NULL) a sentence for people. No exception leaves a call. NULL
 * where a pointer is needed is SM_INVALID, or nothing is done; a mistake of the library's own ends the process at once.
 */
#ifndef STILLMESH_H
#define STILLMESH_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SM_API __attribute__((visibility("default")))

/* --- Words --- */

typedef int32_t sm_status;
#define SM_OK 0
#define SM_FULL 1        /* no room */
#define SM_TIMED_OUT 2   /* nothing came within the time allowed */
#define SM_UNAVAILABLE 3 /* a file or memory that is not to be had */
#define SM_CORRUPT 4     /* bytes that do not mean what they must */
#define SM_INVALID 5     /* an argument or a value out of its range */
#define SM_DEGENERATE 6
#define SM_NOT_FOUND 7
#define SM_END 8

typedef struct sm_problem {
    uint32_t size;
    sm_status status;
    char sentence[504]; /* what is wrong, and what helps; empty with SM_OK */
} sm_problem;

SM_API const char* sm_version(void); /* "0.1.0" */
SM_API const char* sm_status_name(sm_status status);
SM_API const char* sm_pose_state_name(int32_t state);
SM_API const char* sm_unsure_reason_name(int32_t reason);
SM_API const char* sm_stage_name(int32_t stage);

/* --- Settings: the limits, which decide all memory, and every key of the configuration, by name --- */

typedef struct sm_settings {
    uint32_t size;
    uint32_t is_set;
    uint64_t inside[127];
} sm_settings;

#define SM_KEY_WHOLE 0
#define SM_KEY_REAL 1
#define SM_KEY_FLAG 2
typedef struct sm_key {
    uint32_t size;
    int32_t kind;
    const char *name, *unit, *sentence; /* "depth.z_max_m", "m": those of `stillmesh run --print-config` */
    double value, min, max;
} sm_key;

/* limits: "room", "pocket" or "tiny"; scene: "indoor" or "outdoor". The keys are brought within the limits. */
SM_API sm_status sm_settings_init(sm_settings* settings, const char* limits, const char* scene, sm_problem* problem);
/* SM_NOT_FOUND: no such key. SM_INVALID: out of its range. Nothing is changed then. */
SM_API sm_status sm_settings_set(sm_settings* settings, const char* key, double value, sm_problem* problem);
SM_API sm_status sm_settings_get(const sm_settings* settings, const char* key, double* value);
/* The text of a configuration file (TOML); `name` stands for it in sentences. All of it is taken, or nothing.
 * Allocates. */
SM_API sm_status sm_settings_read(sm_settings* settings, const char* text, const char* name, sm_problem* problem);
/* Such a text with every key, as long as `bytes` hold it, with a 0 behind it; how long all of it is. Allocates. */
SM_API size_t sm_settings_write(const sm_settings* settings, char* text, size_t bytes);
/* The keys from 0 on, in the order of the file; SM_NOT_FOUND: no more. */
SM_API sm_status sm_settings_key(const sm_settings* settings, uint32_t index, sm_key* key);
/* Whether the keys go together; sm_engine_create asks the same. */
SM_API sm_status sm_settings_check(const sm_settings* settings, sm_problem* problem);

/* --- Engine --- */

typedef struct sm_engine sm_engine;

#define SM_LENS_BROWN 0   /* radial-tangential, with k4 to k6 rational */
#define SM_LENS_FISHEYE 1 /* k1 to k4 of Kannala and Brandt */
typedef struct sm_camera {
    uint32_t size, width, height;
    int32_t lens;
    double fx, fy, cx, cy;                 /* px */
    double k1, k2, p1, p2, k3, k4, k5, k6; /* distortion */
} sm_camera;

typedef struct sm_grey {
    const uint8_t* data;
    size_t stride; /* bytes from one row to the next */
    uint32_t width;
    uint32_t height;
} sm_grey;
typedef struct sm_keypoint {
    float x, y; /* px of the full image */
    float angle_rad;
    uint16_t score;
    uint8_t level;
} sm_keypoint;
typedef struct sm_descriptor {
    uint64_t words[4];
} sm_descriptor;
typedef struct sm_feature_room {
    sm_keypoint* keypoints; /* to be filled, at most `capacity` */
    sm_descriptor* descriptors;
    uint32_t capacity;
    uint32_t count;
} sm_feature_room;
/* Another feature extractor; its number stands in maps: not 0. One that does not say SM_OK makes a frame without
 * features. */
typedef struct sm_extractor {
    uint32_t size;
    uint32_t number;
    void* user;
    sm_status (*extract)(void* user, const sm_grey* image, sm_feature_room* room);
} sm_extractor;

typedef struct sm_word_weight {
    uint32_t weight;
    uint16_t word;
} sm_word_weight;
typedef struct sm_store_content {
    uint64_t regions;
    uint64_t ids_end; /* above every id in it; beyond 2^37 not believed */
    int64_t time_ns;  /* the latest; beyond 2^61 not believed */
} sm_store_content;
typedef struct sm_region {
    uint64_t id;
    int64_t time_ns;
    float position_m[3];
    float axis[3];
    uint32_t alike_score;
    uint32_t words_count;
    const sm_word_weight* words;
    const void* body;
    size_t body_bytes;
} sm_region;
typedef struct sm_question {
    uint64_t number;
    uint64_t older_than;
    const sm_word_weight* words;
    const uint64_t* without;
    uint32_t words_count;
    uint32_t without_count;
    uint32_t score_min;
    uint32_t reserved;
} sm_question;
typedef struct sm_answer {
    uint64_t question;
    uint64_t id;
    size_t body_bytes; /* 0: larger than the room for it */
    uint32_t score;
    uint32_t reserved;
} sm_answer;
/* Where places go that memory has no room for; what each has to do: engine/paging/map_store.hpp. Not from another
 * thread. */
typedef struct sm_store {
    uint32_t size;
    uint32_t reserved;
    void* user;
    void (*content)(void* user, sm_store_content* content);
    sm_status (*keep)(void* user, const sm_region* region);
    sm_status (*ask)(void* user, const sm_question* question);
    sm_status (*poll)(void* user, sm_answer* answer, void* body, size_t body_bytes);
    void (*note_use)(void* user, uint64_t id);
} sm_store;

typedef struct sm_options {
    uint32_t size;
    uint32_t reserved;
    const void* vocabulary; /* used where it lies; NULL: no place is ever recognised */
    size_t vocabulary_bytes;
    const sm_extractor* extractor; /* NULL: the engine's own */
    const sm_store* store;         /* NULL: none; else limits.store_features_max must not be 0 */
} sm_options;

/* The vocabulary that is part of this library. */
SM_API const void* sm_default_vocabulary(size_t* bytes);
/* How many bytes an engine of these settings lies in; 0: the settings do not go together (sm_settings_check). */
SM_API size_t sm_engine_bytes(const sm_settings* settings);
/* options: NULL: the default vocabulary, the engine's own features, no store. What they point to has to outlive the
 * engine. SM_INVALID, SM_FULL (too few bytes), SM_CORRUPT (no vocabulary): the problem names what is wrong. */
SM_API sm_status sm_engine_create(void* memory, size_t bytes, const sm_settings* settings, const sm_camera* camera,
                                  const sm_options* options, sm_engine** engine, sm_problem* problem);
/* Forgets everything: as a new engine. */
SM_API void sm_reset(sm_engine* engine);

/* --- Frames --- */

#define SM_GREY8 1
#define SM_RGB8 3
#define SM_BGR8 4
typedef struct sm_frame {
    uint32_t size;
    int32_t format;
    int64_t time_ns;       /* of the colour image, later than the last frame's */
    int64_t depth_time_ns; /* 0: not known */
    uint32_t width;
    uint32_t height;
    const uint8_t* colour;
    size_t colour_stride_bytes;
    const uint16_t* depth;     /* registered to colour; 0: not measured */
    size_t depth_stride_bytes; /* in bytes here, unlike in C++ */
    double depth_units_per_m;  /* 1000: millimetres */
    const uint8_t* mask;       /* of colour's size, from 128 on: what a detector takes for a body; NULL: none */
    size_t mask_stride_bytes;
} sm_frame;
typedef struct sm_transform {
    double rotation_xyzw[4];
    double translation_m[3];
} sm_transform;
/* Where the camera is at the first frame, in the map that is made from there: before that frame. Forgotten by sm_reset
 * and sm_load_map. SM_INVALID: no unit quaternion, a size of 1000 or more, or frames were taken, or a map is there. */
SM_API sm_status sm_start_at(sm_engine* engine, const sm_transform* map_from_camera, sm_problem* problem);
/* What wheels or a gyroscope say of the motion since the last frame: the camera now, seen from the camera then. */
typedef struct sm_motion_hint {
    uint32_t size;
    uint32_t reserved;
    sm_transform last_from_camera;
    double sigma_m;   /* negative: nothing is said of the translation */
    double sigma_rad; /* negative: nothing is said of the rotation */
} sm_motion_hint;

/* Tracks a frame to completion; its pixels are borrowed for the call. hint: or NULL. SM_INVALID: it was refused and
 * counted. */
SM_API sm_status sm_submit(sm_engine* engine, const sm_frame* frame, const sm_motion_hint* hint, sm_problem* problem);

#define SM_IDLE 0    /* nothing was waiting */
#define SM_WORKING 1 /* the units ended first */
#define SM_DONE 2
/* Background work between frames: mapping, loop closing. Equal calls give equal bits. */
SM_API int32_t sm_step(sm_engine* engine, uint32_t units);
/* Gives the store what it has not got yet, at the end of a run. */
SM_API int32_t sm_step_store(sm_engine* engine, uint32_t units);

/* --- Results --- */

#define SM_POSE_NONE 0
#define SM_POSE_PREDICTED 1
#define SM_POSE_UNSURE 2
#define SM_POSE_TRACKED 3
typedef struct sm_pose {
    uint32_t size;
    int32_t state;
    int64_t time_ns;
    sm_transform odom_from_camera; /* continuous */
    sm_transform map_from_odom;    /* changed by loops and relocalisation alone */
    sm_transform map_from_camera;  /* both */
    double covariance[36];         /* of xi in odom_from_camera * exp(xi), translation first, row by row */
} sm_pose;
typedef struct sm_frame_statistics {
    uint32_t size;
    int32_t unsure; /* why a pose is unsure */
    uint64_t frame;
    uint32_t features, features_with_depth;
    uint32_t matches, static_matches, dynamic_matches;
    uint32_t mesh_edges, mesh_edges_kept, groups;
    uint32_t is_keyframe, pose_iterations;
    double region_score, region_margin;
    double chosen_share, rival_share; /* of the surface in view: what the motion chosen explains, its rival */
    int64_t strayed_since_ns;         /* poses since then and before this frame have strayed; -1: nothing is seen */
} sm_frame_statistics;
typedef struct sm_statistics {
    uint32_t size, reserved;
    uint64_t keyframes_evicted, keyframes_redundant;
    uint64_t points_culled, points_emptied, points_fused, points_evicted;
    uint64_t frames, frames_refused, keyframes_made, keyframes_forgotten;
    uint64_t points_forgotten, frames_lost, recoveries;
    uint64_t keyframes_refused;
    uint32_t keyframes_size, keyframes_high_water, keyframes_capacity;
    uint32_t map_points_size, map_points_high_water, map_points_capacity;
    uint32_t keyframe_queue_size, keyframe_queue_high_water, keyframe_queue_capacity;
    uint32_t schedule_largest_slice_units, schedule_largest_overdraw_units, reserved_too;
    uint64_t schedule_steps, schedule_steps_idle, schedule_slices, schedule_units_granted, schedule_units_spent;
    uint64_t schedule_units_lost;
    uint64_t mapping_keyframes_inserted, mapping_adjustments, mapping_adjustments_dropped, mapping_adjustment_slices;
    uint64_t mapping_adjustment_iterations, mapping_observations_found, mapping_observations_dropped;
    uint64_t loop_queries, loop_candidates, loop_closed, loop_confirmed, loop_refused_matches, loop_refused_pose;
    uint64_t loop_refused_inliers, loop_refused_spread, loop_refused_far, loop_refused_unlikely, loop_refused_gone;
    uint64_t loop_dropped, loop_points_fused, loop_observations_found, loop_graph_iterations, loop_adjustments;
    uint64_t loop_adjustments_dropped, loop_adjustment_iterations;
    double loop_largest_correction_m, loop_last_correction_m;
    uint64_t loop_relocalisations, loop_matched_by_words, loop_relocalisation_queries, loop_relocalisation_candidates;
    uint64_t store_kept, store_known, store_poor, store_refused, store_asked, store_not_found, store_late;
    uint64_t store_damaged, store_no_room, store_returned, store_useful, store_points_made, store_points_known;
    uint64_t store_corrections, arena_used_bytes;
} sm_statistics;
typedef struct sm_tracked_feature {
    float x, y;    /* px */
    int32_t group; /* of the mesh; -1: in none */
    uint8_t is_matched, is_static, is_dynamic;
} sm_tracked_feature;
typedef struct sm_tracked_edge {
    float x0, y0, x1, y1; /* px */
    uint8_t is_kept;
} sm_tracked_edge;
/* Motions that explain a feature: the one chosen, and the one that it is held against. */
#define SM_BY_CHOICE 1
#define SM_BY_RIVAL 2
/* Borrowed until the next frame. */
typedef struct sm_tracking_view {
    uint32_t size;
    uint32_t reserved;
    const sm_tracked_feature* features;
    size_t features_count;
    const sm_tracked_edge* edges;
    size_t edges_count;
    const uint8_t* explained_by; /* by feature: SM_BY_CHOICE, SM_BY_RIVAL, both or 0 */
} sm_tracking_view;
typedef struct sm_features {
    uint32_t size;
    uint32_t reserved;
    const sm_keypoint* keypoints;
    const sm_descriptor* descriptors;
    size_t count;
} sm_features;
#define SM_NO_KEYFRAME UINT64_MAX
typedef struct sm_keyframe {
    uint64_t id; /* the number of the frame that it was made from */
    uint64_t parent_id;
    sm_transform map_from_camera;
} sm_keyframe;
/* Two keyframes that hold each other: by points that both see, or by a loop that was closed or confirmed. */
#define SM_LOOP_LINKS_MAX 64
enum { SM_LINK_COVISIBLE = 0, SM_LINK_LOOP = 1 };
typedef struct sm_keyframe_link {
    uint64_t older_id, newer_id;
    uint32_t shared_points; /* that both see */
    uint32_t kind;
} sm_keyframe_link;
/* What was seen at one moment, small: mm along the camera's axis, row by row, 0 where there is none. Cell i lies on the
   ray (rays[2 i], rays[2 i + 1], 1) of the camera. What moved then has SM_DEPTH_MOVING added: it is no part of the
   room. */
#define SM_DEPTH_MOVING 0x8000
typedef struct sm_depth_image {
    uint32_t size, reserved;
    uint32_t columns, rows; /* 0: there is none */
    const uint16_t* depth_mm;
    const float* rays;
    uint64_t frame;               /* that it is of */
    sm_transform map_from_camera; /* as the map lies now */
} sm_depth_image;

SM_API sm_status sm_get_pose(const sm_engine* engine, sm_pose* pose);
SM_API sm_status sm_get_frame_statistics(const sm_engine* engine, sm_frame_statistics* statistics);
SM_API sm_status sm_get_statistics(const sm_engine* engine, sm_statistics* statistics);
SM_API sm_status sm_get_tracking_view(sm_engine* engine, sm_tracking_view* view);
SM_API sm_status sm_get_features(const sm_engine* engine, sm_features* features);
/* All keyframes, as many as `out` takes (limits.keyframes_max: all); how many were written. */
SM_API uint32_t sm_keyframes(const sm_engine* engine, sm_keyframe* out, uint32_t count);
/* The graph over them, as many links as `out` takes; how many were written. First loops, the newest first; then each
   keyframe with the older ones that it shares most points with, at most `of_each`. All: limits.keyframes_max * of_each
   + SM_LOOP_LINKS_MAX. */
SM_API uint32_t sm_keyframe_links(const sm_engine* engine, sm_keyframe_link* out, uint32_t count, uint32_t of_each);
/* index < limits.depth_images_max; borrowed until the next sm_submit or sm_step. */
SM_API sm_status sm_get_depth_image(const sm_engine* engine, uint32_t index, sm_depth_image* image);
SM_API uint64_t sm_reference_keyframe(const sm_engine* engine);
/* Over everything that has been decided so far: equal on every build, frame by frame. */
SM_API uint64_t sm_state_hash(const sm_engine* engine);
/* Called at the begin and the end of every stage of a frame; NULL: no more. */
typedef void (*sm_stage_function)(void* user, int32_t stage, int32_t is_begin);
SM_API void sm_set_stage_observer(sm_engine* engine, sm_stage_function function, void* user);

/* --- Trajectories --- */

/* A line as TUM's tools write it: time, position, quaternion, camera to map. Length as snprintf says it. */
SM_API size_t sm_pose_line(const sm_pose* pose, char* text, size_t bytes);
/* Every frame's pose as it is known at the end, after all corrections of the map. Allocates; 100 bytes a frame. */
typedef struct sm_trajectory sm_trajectory;
SM_API sm_trajectory* sm_trajectory_create(const sm_engine* engine); /* NULL: no memory */
SM_API void sm_trajectory_destroy(sm_trajectory* trajectory);
/* After each sm_submit, before sm_step. Frames without a pose are left out. SM_UNAVAILABLE: no memory. */
SM_API sm_status sm_trajectory_add(sm_trajectory* trajectory);
/* How many poses; as many as there is room for are written: time and map_from_camera of each. */
SM_API size_t sm_trajectory_known(sm_trajectory* trajectory, int64_t* times_ns, sm_transform* poses, size_t count);

/* --- Maps --- */

#define SM_MAP_CONTINUE 0 /* find the camera in it, then go on mapping */
#define SM_MAP_LOCALISE 1 /* find the camera in it; the map stays as it is */
typedef struct sm_map_info {
    uint32_t size;
    uint32_t extractor;
    uint64_t size_bytes;
    uint32_t keyframes, points, features, features_of_keyframe, pyramid_levels, lens_crc;
    double scale_factor;
    int64_t time_ns;
    uint64_t frames;
    uint64_t hash;
    uint32_t depth_images;
    uint16_t depth_columns, depth_rows; /* of each; 0 where there is none */
} sm_map_info;
/* What came of joining two maps, joined or not. */
typedef struct sm_map_merge {
    uint32_t size;
    uint32_t is_alike;            /* enough agree, but too much looks alike to be sure */
    uint32_t keyframes;           /* of the second map */
    uint32_t found;               /* of them, that look like a place of the first */
    uint32_t agreeing;            /* of them, whose place is where the second map as a whole would lie */
    uint32_t points_fused;        /* by those keyframes alone */
    double elsewhere_share;       /* how much other places of the first look like them, of how much that one does */
    sm_transform map_from_second; /* where it would lie; nothing where none was found */
} sm_map_merge;

/* Writes the map to a file, which is replaced as a whole. Allocates a workspace of sm_map_copy_bytes. */
SM_API sm_status sm_save_map(sm_engine* engine, const char* file, sm_problem* problem);
/* Forgets everything and takes the map of a file; nothing is touched unless all of it is right. Allocates. */
SM_API sm_status sm_load_map_file(sm_engine* engine, const char* file, int32_t use, sm_problem* problem);
/* The same from bytes, without allocating. */
SM_API sm_status sm_load_map(sm_engine* engine, const void* bytes, size_t size, int32_t use, sm_problem* problem);
/* How the map that is there is used from the next frame on, until the next sm_load_map or sm_reset. */
SM_API sm_status sm_set_map_use(sm_engine* engine, int32_t use, sm_problem* problem);
/* Joins another map of one place to the one that was just loaded, in the coordinates of that (engine/map_merge.hpp):
 * then sm_step until SM_IDLE, and save it. For tools: it takes some milliseconds a keyframe. merge: or NULL.
 *   SM_UNAVAILABLE: no vocabulary, a frame was taken since the load, nothing was loaded; or the file cannot be read.
 *   SM_FULL, SM_INVALID, SM_CORRUPT, SM_END: no map for this engine, or both together are more than its limits.
 *   SM_NOT_FOUND: no place that both show for certain; the engine has forgotten its map. Else nothing changed. */
SM_API sm_status sm_merge_map(sm_engine* engine, const void* bytes, size_t size, sm_map_merge* merge,
                              sm_problem* problem);
/* The same from a file. Allocates. */
SM_API sm_status sm_merge_map_file(sm_engine* engine, const char* file, sm_map_merge* merge, sm_problem* problem);
/* Forgets, in the order in which full pools do, what a map has above limits.keyframes_max, .map_points_max and
 * .depth_images_max of these settings. */
SM_API sm_status sm_fit_map(sm_engine* engine, const sm_settings* settings, sm_problem* problem);
SM_API sm_status sm_read_map_header(const void* bytes, size_t size, sm_map_info* info, sm_problem* problem);

/* The same as sm_save_map in slices between frames, without allocating: begin, step until SM_DONE, then the writer, on
 * any thread. The workspace is aligned to 64 bytes and stays the engine's until SM_DONE. */
typedef struct sm_map_writer {
    uint32_t size;
    uint32_t is_set;
    uint64_t inside[63];
} sm_map_writer;
SM_API size_t sm_map_copy_bytes(const sm_settings* settings);
SM_API sm_status sm_begin_map_copy(sm_engine* engine, void* workspace, size_t bytes, sm_problem* problem);
SM_API int32_t sm_step_map_copy(sm_engine* engine, uint32_t units);
SM_API sm_status sm_map_writer_init(sm_map_writer* writer, const void* workspace, size_t bytes);
/* The next bytes of the file, into at least 512; how many, 0: that was all. */
SM_API size_t sm_map_writer_next(sm_map_writer* writer, void* out, size_t bytes);

#ifdef __cplusplus
}
#endif

#endif
