// What tracking, mapping, loop closing and paging share: the configuration, the camera's model, the map with the part
// of it around the camera, and what each has to tell the others. Every task works on the world and knows no other task.
// Written by one of them at a time, between frames or within one: there is a single thread.
#pragma once

#include <cstdint>

#include "engine/base/ring.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/pixel_noise.hpp"
#include "engine/limits.hpp"
#include "engine/map/depth_images.hpp"
#include "engine/map/local_map.hpp"
#include "engine/map/map.hpp"
#include "engine/map/map_correction.hpp"
#include "engine/outputs.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

// The time that the map counts in. Frames are numbered through all sessions of a map, and their times go on from the
// last one of the session before.
struct Clock {
    std::uint64_t frame = 0;        // number of the frame at hand; between frames of the next one
    std::uint64_t first_frame = 0;  // of this session
    std::int64_t time_ns = 0;       // of the last frame
};

// How the map under the camera has moved since the last frame, on the left of world coordinates. Tracking takes it at
// the beginning of the next frame: what was given out stays given out.
struct CameraMove {
    SE3 correction;  // the camera moves along
    SE3 jump;        // the part of it that map_from_odom takes: what loops did
    bool is_any = false;
    bool has_jumped = false;
};

// What a loop did to the world around the camera.
struct LoopCorrection {
    std::uint64_t frame_old = 0, frame_new = 0;  // of the two keyframes: the drift gathered between them
    SE3 world_from_world;                        // new from old, at the newest keyframe
};

struct World {
    static constexpr std::uint32_t kKeyframeQueueMax = 3;  // more are not refined by mapping

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        Map::plan(arena, limits);
        DepthImages::plan(arena, limits);
        LocalMap::plan(arena, limits);
        MapCorrection::plan(arena, limits);
        Ring<Handle<Keyframe>>::plan(arena, kKeyframeQueueMax);
    }
    void create(Arena& arena, const Limits& limits_max, const Parameters& all, const CameraModel& model) noexcept;
    // Fewer keyframes than this hold no loop: their places are known, for a lost camera, and no more.
    static constexpr std::uint32_t kLoopKeyframesMin = 16;
    static constexpr std::uint32_t loop_keyframes_max(const Limits& limits) noexcept {
        return limits.keyframes_max < kLoopKeyframesMin ? 0 : limits.keyframes_max;
    }
    // Forgets everything but limits, configuration and camera.
    void reset() noexcept;
    // What has been counted, with what map, clock and queue say of themselves.
    [[nodiscard]] EngineStatistics all_statistics() const noexcept;

    // For mapping. False: the queue is full, and the keyframe is not refined.
    bool queue_keyframe(Handle<Keyframe> keyframe) noexcept;

    // The map around the camera was corrected by a local adjustment: the camera follows.
    void move_camera(const SE3& correction) noexcept;
    // The whole map was corrected: the camera follows, and map_from_odom takes the jump. Adjustments that began before
    // are void.
    void move_everything(const SE3& correction) noexcept;
    // Likewise, by map_correction: as its newest keyframe.
    void follow_correction() noexcept;

    Limits limits;
    Parameters parameters;
    CameraModel camera;
    PixelNoise pixel_noise;  // by pyramid level

    Map map;
    DepthImages depth_images;
    LocalMap local_map;
    MapCorrection map_correction;           // used within one step, by what moves the map
    Ring<Handle<Keyframe>> keyframe_queue;  // made by tracking, waiting for mapping; full: not refined

    Clock clock;
    NoiseFactors noise;      // measured by tracking
    PoseEstimate pose;       // given out for the last frame
    bool is_frozen = false;  // the map was loaded to localise in: it stays as it is, apart from marks of use

    CameraMove camera_move;
    std::uint64_t corrections = 0;   // times that the whole map was corrected
    std::uint64_t loops_closed = 0;  // of them, by a loop
    LoopCorrection last_loop;
    EngineStatistics statistics;  // whoever does something counts it here
};

}  // namespace stillmesh
