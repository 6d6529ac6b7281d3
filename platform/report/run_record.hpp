// What a run leaves behind for its summary and its report: plain numbers. A run of any length is
// kept in bounded memory: when the frames are full, every second one is dropped.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "platform/report/percentiles.hpp"

namespace stillmesh {

struct FrameRecord {
    std::int64_t time_ns = 0;
    float ms = 0;  // frame in to pose out
    std::uint16_t features = 0;
    std::uint16_t static_features = 0;   // in the chosen group
    std::uint16_t dynamic_features = 0;  // matched, but moving against it
    PoseState state = PoseState::kNone;
    UnsureReason unsure = UnsureReason::kNone;
};

struct StageRecord {
    std::string name;
    Percentiles ms;
};

struct PoolRecord {
    std::string name;
    std::size_t high_water = 0;
    std::size_t limit = 0;
};

// A map that was read or written.
struct MapRecord {
    std::string what;  // "read", "localised in", "written"
    std::string file;
    std::uint64_t size_bytes = 0;
    std::uint32_t keyframes = 0;
    std::uint32_t points = 0;
    std::uint64_t hash = 0;   // of its content
    double seconds = 0;       // to read and check it; to copy and write it
    std::uint64_t times = 1;  // that it was written
};

// What was made of depth images.
struct GridRecord {
    std::string grid;   // NAME.yaml; empty: none
    std::string cloud;  // file; empty: none
    bool has_floor = false, is_level = false, is_cut = false;
    double floor_share = 0;  // of what was looked at
    std::uint32_t width = 0, height = 0;
    std::size_t looks = 0, memory_bytes = 0;
    double build_ms = 0;
};

// Where up is, by an accelerometer (--level gravity).
struct GravityRecord {
    bool is_asked = false, is_known = false;
    std::array<double, 3> up{};  // in the map
    double doubt_degrees = 0;
    double seconds = 0;   // that it is of
    std::string why_not;  // a clause
};

// The map store of a run.
struct StoreRecord {
    std::string folder;  // empty: none
    StoreStatistics engine;
    std::uint64_t regions = 0;  // in it at the end
    std::uint64_t bytes = 0;
    std::uint64_t written = 0, forgotten = 0, damaged = 0;  // in this run
};

// A camera that was plugged in, or an .oni file.
struct CameraRecord {
    static constexpr std::size_t kEventsMax = 64;

    std::string device;  // empty: none
    std::uint64_t pairs = 0, colour_alone = 0, depth_alone = 0;
    std::uint64_t images_missing = 0;                        // lost before us: gaps in the driver's numbers
    double lag_mean_ms = 0, lag_min_ms = 0, lag_max_ms = 0;  // depth after colour
    double exposure_mean_ms = 0;                             // as the camera says; 0: it does not
    std::uint64_t unplugs = 0, stalls = 0, returns = 0;
    std::uint64_t frames_refused = 0;  // wrong size, format or time
    std::uint64_t clock_restarts = 0;
    double away_s = 0, away_longest_s = 0;
    double layer_cpu_ms = 0;  // per frame, of the camera layer
    std::vector<std::string> events;
    std::string faults;  // injected: how many of which
};

// What the streams of the run were like (platform/cli/stream_log.hpp).
struct StreamRecord {
    static constexpr std::size_t kEpisodesMax = 64;
    struct Episode {
        std::string stream;
        double second = 0, length_s = 0;
        std::uint64_t frames = 0;
    };
    std::uint64_t colour_repeats = 0, depth_repeats = 0;  // frames without a pose for it
    std::uint64_t times_stuck = 0;
    std::vector<Episode> stuck;  // the first of them
    double no_depth_s = 0, no_depth_longest_s = 0, no_depth_longest_at_s = 0;
};

struct RunRecord {
    static constexpr std::size_t kFramesMax = 32768;

    std::string input;        // folder or scene
    std::string calibration;  // where it came from
    std::string limits;       // preset
    std::string features;     // extractor
    std::string command;      // as it was typed
    std::vector<FrameRecord> frames;
    std::uint32_t frames_stride = 1;
    std::uint64_t frames_total = 0;
    std::uint64_t state_counts[4] = {0, 0, 0, 0};
    std::uint64_t unsure_counts[kUnsureReasons] = {};  // of the unsure frames; the first: by the camera's fault
    Percentiles frame_ms;
    Percentiles latency_ms;     // from when a frame was due (with --realtime; else: was there) to its pose
    Percentiles background_ms;  // behind a frame, all together
    Percentiles outputs_ms;     // of that thread for a frame, beside the engine: all that is given out, copied, written
    Percentiles slice_ms;       // one call of Engine::step that did something
    double frame_period_ms = 0;  // of the camera; 0: unknown
    bool is_realtime = false;
    std::uint64_t deadline_misses = 0;  // latency above the period
    std::uint64_t frames_dropped = 0;   // by --realtime: overtaken before they were fetched
    double source_late_s = 0;           // with --realtime: the clock waited so long for the source
    CameraRecord camera;
    std::vector<StageRecord> stages;
    std::vector<PoolRecord> pools;
    std::size_t block_bytes = 0;  // bytes_needed(limits)
    std::size_t arena_used_bytes = 0;
    std::size_t peak_resident_bytes = 0;
    double start_up_ms = 0;
    double wall_seconds = 0;
    double cpu_seconds = 0;
    std::uint64_t state_hash = 0;
    Trajectory estimate;        // poses measured from an image (tracked, unsure)
    Trajectory final_estimate;  // the same poses as known at the end; empty: not asked for
    Trajectory truth;           // empty: unknown
    std::optional<Evaluation> evaluation;
    std::optional<Evaluation> final_evaluation;  // of final_estimate
    std::uint64_t keyframes_made = 0, keyframes_forgotten = 0, points_forgotten = 0, recoveries = 0;
    std::uint64_t keyframes_refused = 0;
    bool has_vocabulary = false;
    LoopStatistics loops;
    PoolStatistics keyframe_queue;
    ScheduleStatistics schedule;
    std::string recording;  // file; empty: none
    std::uint64_t frames_recorded = 0;
    Percentiles record_ms;  // what recording a frame costs the engine's thread
    std::vector<MapRecord> maps;
    std::vector<GridRecord> grids;  // one a map, if any were asked for
    GravityRecord gravity;
    StoreRecord store;
    StreamRecord streams;
    struct NewMap {
        double second = 0;
        std::string sentence;
    };
    std::vector<NewMap> new_maps;       // that were begun while the run went on: poses behind each are in another map
    std::string corrected_calibration;  // a camera file that would fit; empty: the one that was given, or not known
    std::vector<std::string> camera_check;  // what was found of calibration and streams, a line each
    std::vector<std::string> notes;         // sentences about what was as it should not be, but did no harm
    std::vector<std::string> problems;      // sentences about what makes this a failed run

    // `is_tracked`: the engine was given it.
    void add(const FrameRecord& frame, bool is_tracked = true) {
        if (frames_total++ % frames_stride == 0) {
            if (frames.size() == kFramesMax) {
                for (std::size_t i = 0; i < kFramesMax / 2; ++i) frames[i] = frames[2 * i];
                frames.resize(kFramesMax / 2);
                frames_stride *= 2;
            }
            if ((frames_total - 1) % frames_stride == 0) frames.push_back(frame);
        }
        ++state_counts[static_cast<std::size_t>(frame.state)];
        if (frame.state == PoseState::kUnsure) ++unsure_counts[static_cast<std::size_t>(frame.unsure)];
        if (is_tracked) frame_ms.add(static_cast<double>(frame.ms));
    }
    [[nodiscard]] double units_per_frame(std::uint64_t units) const {
        return frames_total == 0 ? 0.0 : static_cast<double>(units) / static_cast<double>(frames_total);
    }
    // Share of the frames whose pose was measured: predicted ones do not count.
    [[nodiscard]] double coverage() const {
        return frames_total == 0
                   ? 0.0
                   : static_cast<double>(state_counts[2] + state_counts[3]) / static_cast<double>(frames_total);
    }
    // What the unsure frames were unsure of: "7 rival motion, 5 few points"; empty: none were.
    [[nodiscard]] std::string unsure_reasons() const {
        std::string text;
        for (std::size_t i = 0; i < kUnsureReasons; ++i) {
            if (unsure_counts[i] == 0) continue;
            const char* const name = i == 0 ? "camera fault" : unsure_reason_name(static_cast<UnsureReason>(i));
            text += (text.empty() ? "" : ", ") + std::to_string(unsure_counts[i]) + " " + name;
        }
        return text;
    }
    [[nodiscard]] double share(PoseState state) const {
        return frames_total == 0 ? 0.0
                                 : static_cast<double>(state_counts[static_cast<std::size_t>(state)]) /
                                       static_cast<double>(frames_total);
    }
};

}  // namespace stillmesh
