// `--grid` and `--cloud`: what the keyframes' depth images make of the map, written at the end of a run, and when it is
// asked for; the grid as often as `--map-every` says too. While frames come a little is done behind each, on the
// engine's thread; files are written by a thread of their own. Memory: the grid's (docs/grid.md), with `--cloud` 12
// bytes a point while it is written.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "engine/engine.hpp"
#include "platform/cli/grid_options.hpp"
#include "platform/grid/grid_files.hpp"
#include "platform/grid/grid_job.hpp"
#include "platform/motion/gravity_finder.hpp"
#include "platform/report/run_record.hpp"
#include "platform/ros2/shown_grid.hpp"

namespace stillmesh {

class GridOutputs {
public:
    // Nothing is asked for: true, and no call does anything. False: `message`.
    [[nodiscard]] bool open(const GridOutputOptions& options, const Limits& limits, std::int64_t every_ns,
                            std::string& message);
    // Every few seconds a grid is put there as well, and has the axes that are asked for. nullptr: nobody wants it.
    void show_on(GridShelf* shelf);
    // Who knows where up is; outlives it.
    void set_gravity(const GravityFinder* gravity) { gravity_ = gravity; }
    // Behind a frame, at `now_ns` of monotonic_ns; the next is due at `until_ns`, if that is known.
    void work(const Engine& engine, std::int64_t now_ns, std::optional<std::int64_t> until_ns);
    // Both are made and written as soon as they can be. What to say of it; empty: there are none to be.
    [[nodiscard]] std::string save_soon();
    // Of the map at hand; empty: none. NAME of NAME.yaml and NAME.pgm; the cloud's file.
    [[nodiscard]] const std::string& grid_name() const { return grid_; }
    [[nodiscard]] const std::string& cloud_file() const { return cloud_; }
    // What the user should hear of now; empty: nothing.
    [[nodiscard]] std::string take_news();
    // The map is laid aside: what was made of it is written, and the next gets another name.
    void begin_new_map(const Engine& engine);
    // The last of it, into the record.
    void finish(const Engine& engine, RunRecord& record);

private:
    // What is due every so often, of monotonic_ns; 0: never.
    struct Due {
        std::int64_t every_ns = 0, next_ns = 0;
        [[nodiscard]] bool is_due(std::int64_t now_ns) {
            if (every_ns <= 0) return false;
            if (next_ns == 0) next_ns = now_ns + every_ns;
            if (now_ns < next_ns) return false;
            next_ns = now_ns + every_ns;
            return true;
        }
    };

    // Some rows of the grid that was made, to be shown. False: it was the last.
    bool show_rows();
    // Some points of the cloud. False: it was the last of them, or there is none to be.
    bool add_points(const Engine& engine);
    void save_aside();
    void write_all(const Engine& engine);
    void join() {
        if (thread_.joinable()) thread_.join();
    }
    void fail(const std::string& problem);
    // Of the cloud; empty: it is not to be, or cannot be, and `why_not` says why.
    [[nodiscard]] std::optional<RigidTransform> level(std::string& why_not) const;

    GridOutputOptions options_;
    const GravityFinder* gravity_ = nullptr;
    std::string grid_, cloud_;  // of the map at hand
    Due file_, shown_;
    bool is_asked_ = false;  // by save_soon()
    // The job at hand: what it is for, whether it answers a wish, whether the cloud has begun.
    bool is_for_file_ = false, is_shown_ = false, is_answer_ = false, has_cloud_ = false;
    CloudPoints points_;
    std::uint32_t rows_shown_ = 0;
    GridShelf* shelf_ = nullptr;
    GridJob job_;
    std::atomic<bool> is_writing_ = false;
    std::mutex mutex_;  // over the two behind it
    std::string news_;
    std::uint64_t failures_ = 0;
    std::vector<GridRecord> written_;
    std::vector<std::string> problems_;
    std::jthread thread_;  // last: it ends before what it uses
};

}  // namespace stillmesh
