/* Promise: the header is C99, and every call does from C what its comment says. A check that fails says its line, and
 * the program ends with 1. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "wall.h"

static int failures = 0;
#define EXPECT(condition)                                                \
    do {                                                                 \
        if (!(condition)) {                                              \
            ++failures;                                                  \
            printf("line %d: %s does not hold\n", __LINE__, #condition); \
        }                                                                \
    } while (0)

static sm_problem problem = {sizeof(sm_problem), SM_OK, ""};
#define SAYS(words) (strstr(problem.sentence, words) != NULL)

static sm_settings settings_of(const char* limits) {
    sm_settings settings = {sizeof(sm_settings), 0, {0}};
    EXPECT(sm_settings_init(&settings, limits, "indoor", &problem) == SM_OK);
    return settings;
}
static sm_camera camera_of(uint32_t width, uint32_t height) {
    sm_camera camera = {sizeof(sm_camera), 0, 0, SM_LENS_BROWN, 130, 130, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    camera.width = width;
    camera.height = height;
    camera.cx = width / 2.0;
    camera.cy = height / 2.0;
    return camera;
}

/* Promise: keys are set by name, within their ranges, and a text of them is taken as a whole or not at all. */
static void settings_by_name(void) {
    sm_settings none = {sizeof(sm_settings), 0, {0}}, settings = settings_of("room"), again = settings_of("pocket");
    sm_key key = {sizeof(sm_key), 0, NULL, NULL, NULL, 0, 0, 0};
    double value = 0;
    uint32_t keys = 0;
    static char text[65536];
    EXPECT(sm_settings_set(&none, "seed", 1, &problem) == SM_INVALID && SAYS("sm_settings_init"));
    EXPECT(sm_settings_init(&none, "huge", "indoor", &problem) == SM_NOT_FOUND && SAYS("'huge'"));
    EXPECT(sm_settings_init(&none, "room", "moon", &problem) == SM_NOT_FOUND && SAYS("'moon'"));
    EXPECT(sm_engine_bytes(&none) == 0 && sm_engine_bytes(NULL) == 0);

    EXPECT(sm_settings_get(&again, "features.count", &value) == SM_OK && value == 500);
    EXPECT(sm_settings_set(&settings, "depth.z_max_m", 4.5, &problem) == SM_OK && problem.sentence[0] == 0);
    EXPECT(sm_settings_get(&settings, "depth.z_max_m", &value) == SM_OK && value == 4.5);
    EXPECT(sm_settings_set(&settings, "depth.z_mac_m", 4.5, &problem) == SM_NOT_FOUND && SAYS("'depth.z_mac_m'"));
    EXPECT(sm_settings_set(&settings, "depth.z_max_m", 1e9, &problem) == SM_INVALID && SAYS("0.5 to 50 m"));
    EXPECT(sm_settings_set(&settings, "depth.z_max_m", NAN, &problem) == SM_INVALID);
    EXPECT(sm_settings_set(&settings, "features.count", 99.5, &problem) == SM_INVALID && SAYS("whole number"));
    EXPECT(sm_settings_set(&settings, "loop.is_enabled", 0, &problem) == SM_OK);
    EXPECT(sm_settings_get(&settings, "depth.z_max_m", &value) == SM_OK && value == 4.5);
    EXPECT(sm_settings_get(&settings, "none", &value) == SM_NOT_FOUND);

    while (sm_settings_key(&settings, keys, &key) == SM_OK) {
        EXPECT(key.value >= key.min && key.value <= key.max && strlen(key.sentence) > 3);
        EXPECT(sm_settings_get(&settings, key.name, &value) == SM_OK && value == key.value);
        if (strcmp(key.name, "loop.is_enabled") == 0) EXPECT(key.kind == SM_KEY_FLAG);
        if (strcmp(key.name, "depth.z_max_m") == 0) EXPECT(key.kind == SM_KEY_REAL && strcmp(key.unit, "m") == 0);
        ++keys;
    }
    EXPECT(keys > 40);

    EXPECT(sm_settings_write(&settings, text, sizeof text) == strlen(text));
    EXPECT(sm_settings_read(&again, text, "room.toml", &problem) == SM_OK);
    EXPECT(sm_settings_get(&again, "limits.features_max", &value) == SM_OK && value == 1000);
    EXPECT(memcmp(&settings, &again, sizeof settings) == 0);
    EXPECT(sm_settings_read(&again, "[features]\ncount = 700\nlevls = 3\n", "my.toml", &problem) == SM_INVALID);
    EXPECT(SAYS("my.toml") && SAYS("features.levels"));
    EXPECT(sm_settings_get(&again, "features.count", &value) == SM_OK && value == 1000);
    text[5] = 'x';
    EXPECT(sm_settings_write(&settings, text, 5) > 1000 && text[4] == 0 && text[5] == 'x');

    EXPECT(sm_settings_set(&again, "limits.features_max", 600, &problem) == SM_OK);
    EXPECT(sm_settings_check(&again, &problem) == SM_INVALID && SAYS("features.count") && sm_engine_bytes(&again) == 0);
    EXPECT(sm_settings_set(&again, "features.count", 600, &problem) == SM_OK);
    EXPECT(sm_settings_check(&again, &problem) == SM_OK);
}

/* Promise: an engine lies in memory at any address, touches nothing beside it, and its bits do not depend on where. */
static void any_address(void) {
    sm_settings settings = settings_of("tiny");
    sm_camera camera = camera_of(160, 120);
    sm_options options = {sizeof(sm_options), 0, NULL, 0, NULL, NULL};
    size_t bytes = sm_engine_bytes(&settings), offset;
    uint8_t* memory = (uint8_t*)malloc(bytes + 72);
    uint64_t hash = 0;
    wall w = wall_of(160, 120);
    for (offset = 0; offset < 64; offset += 7) {
        sm_engine* engine = NULL;
        sm_frame frame = wall_frame(&w, 0);
        memset(memory, 0x5a, bytes + 72);
        EXPECT(sm_engine_create(memory + offset, bytes - 1, &settings, &camera, &options, &engine, &problem) ==
               SM_FULL);
        EXPECT(SAYS("are needed") && engine == NULL);
        EXPECT(sm_engine_create(memory + offset, bytes, &settings, &camera, &options, &engine, &problem) == SM_OK);
        EXPECT(sm_submit(engine, &frame, NULL, &problem) == SM_OK);
        if (offset == 0) hash = sm_state_hash(engine);
        EXPECT(sm_state_hash(engine) == hash && hash != 0);
        EXPECT(memory[offset + bytes] == 0x5a && (offset == 0 || memory[offset - 1] == 0x5a));
    }
    free(memory);
    wall_end(&w);
}

/* Promise: who is to blame for an engine that is not made is said: camera, vocabulary, settings, extractor, store. */
static void refusals(void) {
    sm_settings settings = settings_of("tiny");
    sm_camera camera = camera_of(160, 120);
    sm_extractor extractor = {sizeof(sm_extractor), 7, NULL, NULL};
    sm_options options = {sizeof(sm_options), 0, NULL, 0, NULL, NULL};
    size_t bytes = sm_engine_bytes(&settings);
    void* memory = malloc(bytes);
    sm_engine* engine = NULL;
    EXPECT(sm_engine_create(NULL, bytes, &settings, &camera, &options, &engine, &problem) == SM_INVALID);
    EXPECT(sm_engine_create(memory, bytes, NULL, &camera, &options, &engine, &problem) == SM_INVALID);
    EXPECT(sm_engine_create(memory, bytes, &settings, NULL, &options, &engine, NULL) == SM_INVALID);
    camera.width = 161;
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_INVALID);
    EXPECT(SAYS("camera.width") && SAYS("160"));
    camera = camera_of(160, 120);
    camera.lens = 5;
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_INVALID);
    EXPECT(SAYS("camera.lens"));
    camera = camera_of(160, 120);
    /* the default vocabulary is larger than these limits */
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, NULL, &engine, &problem) == SM_CORRUPT &&
           SAYS("vocabulary"));
    options.extractor = &extractor;
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_INVALID &&
           SAYS("extractor"));
    EXPECT(engine == NULL && problem.status == SM_INVALID);
    EXPECT(strcmp(sm_status_name(SM_CORRUPT), "corrupt") == 0 && strcmp(sm_status_name(77), "unknown") == 0);
    EXPECT(strcmp(sm_pose_state_name(SM_POSE_TRACKED), "tracked") == 0 && strcmp(sm_stage_name(-1), "unknown") == 0);
    EXPECT(strcmp(sm_unsure_reason_name(1), "rival motion") == 0 && strcmp(sm_version(), STILLMESH_VERSION_TEXT) == 0);
    free(memory);
}

static int begins = 0, ends = 0;
static void on_stage(void* user, int32_t stage, int32_t is_begin) {
    EXPECT(user == &begins && strcmp(sm_stage_name(stage), "unknown") != 0);
    ++*(is_begin ? &begins : &ends);
}

static void follow(sm_engine* engine, wall* w) {
    sm_trajectory* trajectory = sm_trajectory_create(engine);
    sm_pose pose = {sizeof(sm_pose), 0, 0, {{0}, {0}}, {{0}, {0}}, {{0}, {0}}, {0}};
    int64_t times_ns[10];
    sm_transform poses[10];
    char line[256];
    uint32_t i;
    for (i = 0; i < 10; ++i) {
        sm_motion_hint hint = {sizeof(sm_motion_hint), 0, {{0, 0, 0, 1}, {4.0 / 130, 0, 0}}, 0.01, 0.01};
        sm_frame frame = wall_frame(w, i);
        EXPECT(sm_submit(engine, &frame, i == 0 ? NULL : &hint, &problem) == SM_OK);
        EXPECT(sm_trajectory_add(trajectory) == SM_OK);
        EXPECT(sm_submit(engine, &frame, NULL, &problem) == SM_INVALID && SAYS("time_ns"));
        sm_step(engine, 20000);
    }
    EXPECT(sm_get_pose(engine, &pose) == SM_OK && pose.state >= SM_POSE_UNSURE && pose.time_ns == 9 * 33000000);
    EXPECT(fabs(pose.map_from_camera.translation_m[0] - 9 * 4.0 / 130) < 0.01 && pose.covariance[0] > 0);
    EXPECT(sm_pose_line(&pose, line, sizeof line) == strlen(line) && strncmp(line, "0.297000000 0.27", 16) == 0);
    EXPECT(sm_pose_line(&pose, line, 4) > 60 && strcmp(line, "0.2") == 0);
    EXPECT(sm_trajectory_known(trajectory, NULL, NULL, 0) == 10);
    EXPECT(sm_trajectory_known(trajectory, times_ns, poses, 10) == 10 && times_ns[9] == pose.time_ns);
    EXPECT(fabs(poses[9].translation_m[0] - pose.map_from_camera.translation_m[0]) < 0.01);
    sm_trajectory_destroy(trajectory);
}

/* Promise: a frame that does not fit is refused with its fault, and counted. */
static void refused_frames(sm_engine* engine, wall* w) {
    sm_frame good = wall_frame(w, 20), bad = good;
    sm_motion_hint hint = {sizeof(sm_motion_hint), 0, {{0, 0, 0, 3}, {0, 0, 0}}, 0.01, 0.01};
    EXPECT(sm_submit(engine, NULL, NULL, &problem) == SM_INVALID);
#define REFUSED(change, words) \
    bad = good;                \
    change;                    \
    EXPECT(sm_submit(engine, &bad, NULL, &problem) == SM_INVALID && SAYS(words))
    REFUSED(bad.format = 77, "format");
    REFUSED(bad.colour = NULL, "NULL");
    REFUSED(bad.width = 80, "size");
    REFUSED(bad.colour_stride_bytes = 159, "colour_stride_bytes");
    REFUSED(bad.depth_stride_bytes = 160, "depth_stride_bytes");
    REFUSED(bad.depth_stride_bytes = 321, "depth_stride_bytes");
    REFUSED(bad.depth_units_per_m = 0, "depth_units_per_m");
    REFUSED(bad.time_ns = -1, "time_ns");
    EXPECT(sm_submit(engine, &good, &hint, &problem) == SM_INVALID && SAYS("quaternion"));
}

/* Promise: everything that the engine says of itself is there, and structs of an older, shorter header are left whole.
 */
static void results(sm_engine* engine) {
    sm_frame_statistics frame = {sizeof(sm_frame_statistics), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    sm_statistics all;
    sm_tracking_view view = {sizeof(sm_tracking_view), 0, NULL, 0, NULL, 0, NULL};
    sm_features features = {sizeof(sm_features), 0, NULL, NULL, 0};
    sm_keyframe keyframes[8];
    sm_keyframe_link links[64];
    sm_depth_image depth;
    size_t i;
    uint32_t count, links_count;
    memset(&all, 0x77, sizeof all);
    all.size = offsetof(sm_statistics, frames_refused);
    EXPECT(sm_get_statistics(engine, &all) == SM_OK && all.frames == 10);
    EXPECT(all.frames_refused == 0x7777777777777777U && all.size == offsetof(sm_statistics, frames_refused));
    all.size = sizeof all;
    EXPECT(sm_get_statistics(engine, &all) == SM_OK && all.frames_refused == 10 && all.arena_used_bytes > 100000);
    EXPECT(all.keyframes_size > 0 && all.keyframes_capacity == 8 && all.map_points_capacity == 262);
    EXPECT(all.schedule_steps == 10 && all.schedule_units_granted == 200000);
    EXPECT(sm_get_frame_statistics(engine, &frame) == SM_OK && frame.frame == 9 && frame.features > 20);
    EXPECT(frame.static_matches > 8 && frame.static_matches <= frame.matches);
    EXPECT(sm_get_features(engine, &features) == SM_OK && features.count == frame.features);
    for (i = 0; i < features.count; ++i) EXPECT(features.keypoints[i].x >= 0 && features.keypoints[i].x < 160);
    EXPECT(sm_get_tracking_view(engine, &view) == SM_OK && view.features_count == features.count);
    for (i = 0, count = 0; i < view.features_count; ++i) count += view.features[i].is_static;
    EXPECT(count > 8 && view.edges_count == frame.mesh_edges);
    for (i = 0, count = 0; i < view.features_count; ++i) {
        EXPECT(view.explained_by[i] <= (SM_BY_CHOICE | SM_BY_RIVAL));
        count += view.explained_by[i] & SM_BY_CHOICE;
    }
    EXPECT(count > 8 && frame.chosen_share > 0 && frame.chosen_share <= 1 && frame.rival_share >= 0 &&
           frame.strayed_since_ns == -1);
    count = sm_keyframes(engine, keyframes, 8);
    EXPECT(count == all.keyframes_size && keyframes[0].id != SM_NO_KEYFRAME && sm_keyframes(engine, NULL, 8) == 0);
    links_count = sm_keyframe_links(engine, links, 64, 8);
    EXPECT(links_count > 0 && links_count <= 8 * count && sm_keyframe_links(engine, links, 1, 8) == 1);
    EXPECT(links[0].older_id < links[0].newer_id && links[0].shared_points > 0 && links[0].kind == SM_LINK_COVISIBLE);
    EXPECT(sm_keyframe_links(engine, links, 64, 0) == 0 && sm_keyframe_links(engine, NULL, 64, 8) == 0);
    EXPECT(sm_reference_keyframe(engine) != SM_NO_KEYFRAME);
    /* these limits keep no depth images */
    memset(&depth, 0x77, sizeof depth);
    depth.size = sizeof depth;
    EXPECT(sm_get_depth_image(engine, 0, &depth) == SM_OK && depth.columns == 0 && depth.rows == 0);
    EXPECT(sm_get_depth_image(NULL, 0, &depth) == SM_INVALID);
}

static size_t bytes_of(const char* name, uint8_t* bytes, size_t room) {
    FILE* file = fopen(name, "rb");
    size_t size = file == NULL ? 0 : fread(bytes, 1, room, file);
    if (file != NULL) fclose(file);
    return size;
}

/* Promise: a map goes to a file at once or in slices, the same bytes, and comes back whole or not at all. */
static void maps(sm_engine* engine, const sm_settings* settings, wall* w) {
    static const char name[] = "c99_test.map";
    static uint8_t whole[1 << 20], sliced[1 << 20];
    size_t room = sm_map_copy_bytes(settings), size, piece, at = 0;
    uint8_t *memory = (uint8_t*)malloc(room + 64), *workspace = memory + (64 - (uintptr_t)memory % 64);
    sm_map_writer writer = {sizeof(sm_map_writer), 0, {0}};
    sm_map_info info = {sizeof(sm_map_info), 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 9, 9};
    sm_map_merge merge;
    sm_settings fewer = *settings;
    sm_keyframe keyframes[8];
    uint64_t hash = sm_state_hash(engine);
    sm_frame frame;
    sm_pose pose = {sizeof(sm_pose), 0, 0, {{0}, {0}}, {{0}, {0}}, {{0}, {0}}, {0}};
    EXPECT(sm_save_map(engine, "/dev/null/no.map", &problem) == SM_UNAVAILABLE && SAYS("no.map"));
    EXPECT(sm_save_map(engine, name, &problem) == SM_OK);
    size = bytes_of(name, whole, sizeof whole);
    EXPECT(sm_begin_map_copy(engine, workspace + 1, room, &problem) == SM_INVALID && SAYS("aligned"));
    EXPECT(sm_begin_map_copy(engine, workspace, 64, &problem) == SM_FULL);
    EXPECT(sm_begin_map_copy(engine, workspace, room, &problem) == SM_OK);
    while (sm_step_map_copy(engine, 100) == SM_WORKING) {
    }
    EXPECT(sm_map_writer_next(&writer, sliced, 512) == 0);
    EXPECT(sm_map_writer_init(&writer, workspace, room) == SM_OK);
    while (at + 512 <= sizeof sliced && (piece = sm_map_writer_next(&writer, sliced + at, 512)) > 0) at += piece;
    EXPECT(size > 1000 && at == size && memcmp(whole, sliced, size) == 0 && sm_state_hash(engine) == hash);
    EXPECT(sm_read_map_header(whole, size, &info, &problem) == SM_OK && info.size_bytes == size && info.extractor == 0);
    EXPECT(info.depth_images == 0 && info.depth_columns == 0 && info.depth_rows == 0);

    sliced[size / 2] ^= 1;
    EXPECT(sm_load_map(engine, sliced, size, SM_MAP_LOCALISE, &problem) == SM_CORRUPT && SAYS("damaged"));
    EXPECT(sm_load_map(engine, whole, size - 1, SM_MAP_LOCALISE, &problem) != SM_OK && SAYS("cut off"));
    EXPECT(sm_load_map_file(engine, "not.there", SM_MAP_LOCALISE, &problem) == SM_UNAVAILABLE && SAYS("not.there"));
    EXPECT(sm_load_map(engine, whole, size, 7, &problem) == SM_INVALID && sm_state_hash(engine) == hash);
    EXPECT(sm_set_map_use(engine, 7, &problem) == SM_INVALID &&
           sm_set_map_use(NULL, SM_MAP_CONTINUE, NULL) == SM_INVALID);
    EXPECT(sm_set_map_use(engine, SM_MAP_CONTINUE, &problem) == SM_OK);
    EXPECT(sm_load_map(engine, whole, size, SM_MAP_LOCALISE, &problem) == SM_OK);
    EXPECT(sm_load_map_file(engine, name, SM_MAP_LOCALISE, &problem) == SM_OK && problem.sentence[0] == 0);
    merge.size = sizeof merge;
    EXPECT(sm_merge_map(engine, whole, size, &merge, &problem) == SM_UNAVAILABLE && SAYS("a vocabulary"));
    EXPECT(merge.keyframes == 0 && merge.map_from_second.rotation_xyzw[3] == 1);
    EXPECT(sm_merge_map_file(engine, "not.there", NULL, &problem) == SM_UNAVAILABLE && SAYS("not.there"));
    EXPECT(sm_merge_map(engine, NULL, size, NULL, NULL) == SM_INVALID);
    merge.size = 0;
    EXPECT(sm_merge_map(engine, whole, size, &merge, &problem) == SM_INVALID && SAYS("no size"));
    EXPECT(sm_fit_map(engine, NULL, &problem) == SM_INVALID && SAYS("sm_settings_init"));
    EXPECT(sm_fit_map(engine, settings, &problem) == SM_OK && sm_keyframes(engine, keyframes, 8) == info.keyframes);
    EXPECT(info.keyframes > 1 && sm_settings_set(&fewer, "limits.keyframes_max", 2, NULL) == SM_OK);
    EXPECT(sm_fit_map(engine, &fewer, &problem) == SM_OK && sm_keyframes(engine, keyframes, 8) == 2);
    EXPECT(sm_load_map(engine, whole, size, SM_MAP_LOCALISE, &problem) == SM_OK);
    frame = wall_frame(w, 11);
    EXPECT(sm_submit(engine, &frame, NULL, &problem) == SM_OK && sm_get_pose(engine, &pose) == SM_OK);
    EXPECT(pose.state == SM_POSE_NONE); /* not found at once without a vocabulary */
    remove(name);
    free(memory);
}

static void tracking(void) {
    sm_settings settings = settings_of("tiny");
    sm_camera camera = camera_of(160, 120);
    sm_options options = {sizeof(sm_options), 0, NULL, 0, NULL, NULL};
    size_t bytes = sm_engine_bytes(&settings);
    void* memory = malloc(bytes);
    sm_engine* engine = NULL;
    wall w = wall_of(160, 120);
    uint64_t hash, begin;
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_OK);
    begin = sm_state_hash(engine);
    sm_set_stage_observer(engine, on_stage, &begins);
    follow(engine, &w);
    EXPECT(begins == ends && begins >= 40);
    hash = sm_state_hash(engine);
    sm_set_stage_observer(engine, NULL, NULL);
    sm_reset(engine);
    EXPECT(sm_state_hash(engine) == begin);
    begins = ends = 0;
    follow(engine, &w);
    EXPECT(sm_state_hash(engine) == hash && begins == 0);
    results(engine);
    refused_frames(engine, &w);
    EXPECT(sm_step_store(engine, 1000) == SM_IDLE);
    maps(engine, &settings, &w);
    wall_end(&w);
    free(memory);
}

static uint32_t extractor_count = 0;
static sm_status extract(void* user, const sm_grey* image, sm_feature_room* room) {
    uint32_t i;
    EXPECT(user == &extractor_count && image->width == 160 && image->height == 120 && room->capacity == 100);
    for (i = 0; i < extractor_count && i < room->capacity; ++i) {
        sm_keypoint corner = {0, 0, 0, 9, 0};
        corner.x = (float)(20 + i % 10 * 12);
        corner.y = (float)(20 + i / 10 * 8);
        room->keypoints[i] = corner;
        memset(&room->descriptors[i], (int)(i + 1), sizeof(sm_descriptor));
    }
    room->count = extractor_count;
    return SM_OK;
}
/* Promise: features come from the caller's extractor; one that breaks its contract makes a frame without any. */
static void own_extractor(void) {
    sm_settings settings = settings_of("tiny");
    sm_camera camera = camera_of(160, 120);
    sm_extractor extractor = {sizeof(sm_extractor), 7, &extractor_count, extract};
    sm_options options = {sizeof(sm_options), 0, NULL, 0, NULL, NULL};
    sm_features features = {sizeof(sm_features), 0, NULL, NULL, 0};
    size_t bytes = sm_engine_bytes(&settings);
    void* memory = malloc(bytes);
    sm_engine* engine = NULL;
    wall w = wall_of(160, 120);
    uint32_t i;
    static const uint32_t counts[] = {60, 0, 101};
    static const uint32_t found[] = {60, 0, 0};
    options.extractor = &extractor;
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_OK);
    for (i = 0; i < 3; ++i) {
        sm_frame frame = wall_frame(&w, i);
        extractor_count = counts[i];
        EXPECT(sm_submit(engine, &frame, NULL, &problem) == SM_OK);
        EXPECT(sm_get_features(engine, &features) == SM_OK && features.count == found[i]);
        if (found[i] > 5)
            EXPECT(features.keypoints[5].x == 80 && features.descriptors[5].words[3] == 0x0606060606060606U);
    }
    wall_end(&w);
    free(memory);
}

static int kept = 0;
static void content(void* user, sm_store_content* out) {
    (void)user;
    (void)out;
}
static sm_status keep(void* user, const sm_region* region) {
    EXPECT(user == &kept && region->body != NULL && region->body_bytes > 100 && region->words_count > 10);
    EXPECT(region->words[0].weight > 0 && region->words[0].word < region->words[1].word);
    ++kept;
    return SM_OK;
}
static sm_status ask(void* user, const sm_question* question) {
    EXPECT(user == &kept && question->number > 0);
    return SM_FULL;
}
static sm_status poll_store(void* user, sm_answer* answer, void* body, size_t body_bytes) {
    EXPECT(user == &kept && answer != NULL && body != NULL && body_bytes > 0);
    return SM_TIMED_OUT;
}
static void note_use(void* user, uint64_t id) {
    (void)user;
    (void)id;
}
/* Promise: what the map holds goes through the caller's store, with its words, and needs room for that. */
static void own_store(void) {
    sm_settings settings = settings_of("pocket");
    sm_camera camera = camera_of(640, 480);
    sm_store store = {sizeof(sm_store), 0, &kept, content, keep, ask, poll_store, note_use};
    sm_options options = {sizeof(sm_options), 0, NULL, 0, NULL, NULL};
    sm_statistics all;
    size_t bytes = sm_engine_bytes(&settings) + (4 << 20);
    void* memory = malloc(bytes);
    sm_engine* engine = NULL;
    wall w = wall_of(640, 480);
    uint32_t i;
    camera.fx = camera.fy = 525;
    options.store = &store;
    options.vocabulary = sm_default_vocabulary(&options.vocabulary_bytes);
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_INVALID);
    EXPECT(SAYS("limits.store_features_max"));
    EXPECT(sm_settings_set(&settings, "limits.store_features_max", 500, &problem) == SM_OK);
    EXPECT(sm_engine_create(memory, bytes, &settings, &camera, &options, &engine, &problem) == SM_OK);
    for (i = 0; i < 5; ++i) {
        sm_frame frame = wall_frame(&w, i);
        EXPECT(sm_submit(engine, &frame, NULL, &problem) == SM_OK);
        sm_step(engine, 20000);
    }
    for (i = 0; i < 10000 && sm_step_store(engine, 2000) == SM_WORKING; ++i) {
    }
    all.size = sizeof all;
    EXPECT(sm_get_statistics(engine, &all) == SM_OK && kept > 0 && all.store_kept == (uint64_t)kept);
    wall_end(&w);
    free(memory);
}

/* Promise: NULL for an engine is an answer, and no crash. */
static void null_engine(void) {
    sm_pose pose = {.size = sizeof pose};
    sm_statistics all = {.size = sizeof all};
    sm_reset(NULL);
    sm_set_stage_observer(NULL, on_stage, NULL);
    EXPECT(sm_get_pose(NULL, &pose) == SM_INVALID && sm_get_statistics(NULL, &all) == SM_INVALID);
    EXPECT(sm_step(NULL, 1) == SM_IDLE && sm_step_store(NULL, 1) == SM_IDLE && sm_step_map_copy(NULL, 1) == SM_IDLE);
    EXPECT(sm_state_hash(NULL) == 0 && sm_reference_keyframe(NULL) == SM_NO_KEYFRAME &&
           sm_keyframes(NULL, NULL, 0) == 0 && sm_keyframe_links(NULL, NULL, 0, 0) == 0);
    EXPECT(sm_save_map(NULL, "a", &problem) == SM_INVALID && sm_load_map_file(NULL, "a", 0, NULL) == SM_INVALID);
    EXPECT(sm_merge_map(NULL, "a", 1, NULL, NULL) == SM_INVALID &&
           sm_merge_map_file(NULL, "a", NULL, NULL) == SM_INVALID);
    EXPECT(sm_fit_map(NULL, NULL, NULL) == SM_INVALID);
    EXPECT(sm_trajectory_create(NULL) == NULL && sm_trajectory_add(NULL) == SM_INVALID);
    EXPECT(sm_submit(NULL, NULL, NULL, NULL) == SM_INVALID);
    sm_trajectory_destroy(NULL);
}

int main(void) {
    null_engine();
    settings_by_name();
    any_address();
    refusals();
    tracking();
    own_extractor();
    own_store();
    printf("%d failures\n", failures);
    return failures == 0 ? 0 : 1;
}
