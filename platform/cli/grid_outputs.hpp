// `--grid` and `--cloud`: what the keyframes' depth images make of the map, written at the end of a run, the grid as
// often as `--map-every` says too. While frames come a little is done behind each, on the engine's thread; files are
// written by a thread of their own. Memory: the grid's (docs/grid.md), with `--cloud` 12 bytes a point at the end.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "engine/engine.hpp"
#include "platform/grid/grid_job.hpp"
#include "platform/motion/gravity_finder.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

// What a cloud is levelled by.
enum class Level : std::uint8_t { kOff, kFloor, kGravity };

struct GridOutputOptions {
    std::string grid;           // NAME of NAME.yaml and NAME.pgm; empty: none
    std::string cloud;          // file; empty: none
    Level level = Level::kOff;  // the cloud: z up, floor at 0 where it is known
    double obstacle_m = GridOptions{}.obstacle_m;
    double robot_m = GridOptions{}.robot_m;
    [[nodiscard]] bool is_any() const { return !grid.empty() || !cloud.empty(); }
};

class GridOutputs {
public:
    // Nothing is asked for: true, and no call does anything. False: `message`.
    [[nodiscard]] bool open(const GridOutputOptions& options, const Limits& limits, std::int64_t every_ns,
                            std::string& message);
    // Who knows where up is; outlives it.
    void set_gravity(const GravityFinder* gravity) { gravity_ = gravity; }
    // Behind a frame, at `now_ns` of monotonic_ns; the next is due at `until_ns`, if that is known.
    void work(const Engine& engine, std::int64_t now_ns, std::optional<std::int64_t> until_ns);
    // What the user should hear of now; empty: nothing.
    [[nodiscard]] std::string take_news();
    // The map is laid aside: what was made of it is written, and the next gets another name.
    void begin_new_map(const Engine& engine);
    // The last of it, into the record.
    void finish(const Engine& engine, RunRecord& record);

private:
    void save_aside();
    void write_all(const Engine& engine);
    void join() {
        if (thread_.joinable()) thread_.join();
    }
    void fail(const std::string& problem);
    [[nodiscard]] std::string why_no_grid() const;
    // Of the cloud; empty: it is not to be, or cannot be, and `why_not` says why.
    [[nodiscard]] std::optional<RigidTransform> level(std::string& why_not) const;

    GridOutputOptions options_;
    const GravityFinder* gravity_ = nullptr;
    std::string grid_, cloud_;  // of the map at hand
    std::int64_t every_ns_ = 0, next_ns_ = 0;
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
