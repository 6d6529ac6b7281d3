// A simulated room as the engine tracked it, whole or in part, its grid, and how right that is by what the renderer
// drew.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/engine.hpp"
#include "engine/map_merge.hpp"
#include "engine/record/map_file.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/grid/grid_job.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"
#include "tests/grid/true_plan.hpp"

namespace stillmesh::test {

// The frames of a scene that are tracked; it has `frames`, 0: its own length.
struct Part {
    std::uint32_t frames = 0;
    std::uint32_t first = 0;
    std::uint32_t end = 0;  // 0: to the last
};

// A scene, tracked to its end or in part.
class TrackedRoom {
public:
    TrackedRoom(const std::string& scene, std::uint64_t seed, const Part& part = {}) : scene_(scene), seed_(seed) {
        SimulationOptions options;
        options.scene = scene;
        options.seed = seed;
        options.frames = part.frames;
        // A quarter of the pixels: depth images that a map keeps are smaller still.
        options.width = 320;
        options.height = 240;
        SimulatedCamera camera(options);
        EXPECT_EQ(camera.open(), Status::kOk);
        camera.seek(part.first);
        frames_ = camera.frame_count();
        create(camera.info());
        Frame frame;
        const std::uint32_t end = part.end == 0 ? frames_ : part.end;
        for (std::uint32_t i = part.first; i < end && camera.poll(frame) == Status::kOk; ++i) {
            if (i == part.first) first_ = camera.true_pose();
            EXPECT_EQ(engine_->submit(frame), Status::kOk);
            static_cast<void>(engine_->step(configuration_.schedule.units_per_frame));
        }
        make_grid();
    }
    // Two of one scene as one map, that of the first, brought within limits.
    TrackedRoom(const TrackedRoom& one, const TrackedRoom& other, const Limits& limits)
        : scene_(one.scene_), seed_(one.seed_), frames_(one.frames_), first_(one.first_) {
        limits_.keyframes_max *= 2;
        limits_.map_points_max *= 2;
        create(one.info_);
        MapFileProblem problem;
        MapMerge merge;
        EXPECT_EQ(engine_->load_map(one.map(), MapUse::kContinue, problem), Status::kOk) << problem.part;
        EXPECT_EQ(merge_map(*engine_, other.map(), problem, merge), Status::kOk) << problem.part << merge.agreeing;
        while (engine_->step(1'000'000) != Progress::kIdle) {
        }
        fit_map(*engine_, limits);
        make_grid();
    }

    // Its file.
    [[nodiscard]] std::vector<std::byte> map() const {
        MemoryBlock workspace;
        EXPECT_TRUE(workspace.allocate(map_copy_bytes(limits_)));
        EXPECT_EQ(engine_->begin_map_copy(workspace.bytes()), Status::kOk);
        while (engine_->step_map_copy(100'000) == Progress::kWorking) {
        }
        MapFileWriter writer(workspace.bytes());
        std::vector<std::byte> out, piece(65536);
        while (const std::size_t size = writer.next(piece))
            out.insert(out.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(size));
        return out;
    }
    [[nodiscard]] const GridJob& job() const { return job_; }
    [[nodiscard]] RigidTransform world_from_level() const {
        RigidTransform world_from_map;
        std::copy(first_.q.begin(), first_.q.end(), world_from_map.rotation_xyzw);
        std::copy(first_.t.begin(), first_.t.end(), world_from_map.translation_m);
        return compose(world_from_map, inverse_of(job_.floor().level_from_map));
    }
    // Of what images show, that is floor in truth.
    [[nodiscard]] double true_floor_share() const {
        RigidTransform world_from_map;
        std::copy(first_.q.begin(), first_.q.end(), world_from_map.rotation_xyzw);
        std::copy(first_.t.begin(), first_.t.end(), world_from_map.translation_m);
        std::size_t floor = 0, all = 0;
        for (const GridJob::Look& look : job_.looks()) {
            const DepthImage image = engine_->depth_image(look.index);
            const RigidTransform world_from_camera = compose(world_from_map, look.map_from_camera);
            for (std::size_t i = 0; i < image.depth_mm.size(); ++i) {
                if (!image.is_still(i)) continue;
                const double z = image.depth_mm[i] * 1e-3;
                const double height = transformed(
                    world_from_camera,
                    {static_cast<double>(image.rays[2 * i]) * z, static_cast<double>(image.rays[2 * i + 1]) * z, z})[2];
                ++all;
                floor += std::abs(height) < 0.05 ? 1U : 0U;
            }
        }
        return all == 0 ? 0.0 : static_cast<double>(floor) / static_cast<double>(all);
    }
    [[nodiscard]] TruePlan plan() const {
        const GridOptions& options = job_.grid().options();
        return {world_of(scene_, seed_, frames_), (frames_ - 1) / 30.0, options.obstacle_m, options.robot_m};
    }

private:
    void create(const CameraInfo& info) {
        info_ = info;
        std::string message;
        configuration_.camera.readout_s = info.readout_s;
        EXPECT_TRUE(vocabulary_.open("default", limits_.vocabulary_words_max, message)) << message;
        EXPECT_TRUE(block_.allocate(bytes_needed(limits_)));
        engine_ = Engine::create(block_.bytes(), limits_, configuration_, info.model, cpu_kernels(), nullptr,
                                 vocabulary_.bytes())
                      .value();
    }
    void make_grid() {
        std::string message;
        EXPECT_TRUE(job_.open(limits_, GridOptions{}, message)) << message;
        job_.begin(*engine_);
        while (job_.step(*engine_)) {
        }
    }

    std::string scene_;
    std::uint64_t seed_;
    std::uint32_t frames_ = 0;  // of the scene
    SimulatedPose first_;
    Limits limits_ = Limits::room();
    CameraInfo info_;
    Configuration configuration_;
    VocabularyFile vocabulary_;
    MemoryBlock block_;
    Engine* engine_ = nullptr;
    GridJob job_;
};

// A cell of 5 cm is right when what it says is true within a cell's side of it: an obstacle within 5 cm of its middle,
// or floor that can be reached within 2.5 cm.
struct Score {
    int seen = 0, right = 0, occupied = 0;
    int ghosts = 0;  // occupied, and no obstacle within two cells
    int people = 0;  // of them, on somebody's way
    [[nodiscard]] double share() const { return static_cast<double>(right) / seen; }
};
inline Score score_of(const TrackedRoom& room) {
    const OccupancyGrid& grid = room.job().grid();
    const TruePlan plan = room.plan();
    const RigidTransform world_from_level = room.world_from_level();
    const double side = grid.options().resolution_m;
    Score score;
    for (std::uint32_t row = 0; row < grid.height(); ++row) {
        for (std::uint32_t column = 0; column < grid.width(); ++column) {
            const GridCell cell = grid.at(column, row);
            if (cell == GridCell::kUnknown) continue;
            const std::array<double, 3> p = transformed(
                world_from_level, {grid.origin_x() + (column + 0.5) * side, grid.origin_y() + (row + 0.5) * side, 0});
            const bool is_occupied = cell == GridCell::kOccupied;
            const bool is_right = is_occupied ? plan.has_within(TruePlan::Square::kObstacle, p[0], p[1], side)
                                              : plan.has_within(TruePlan::Square::kOpen, p[0], p[1], side / 2);
            ++score.seen;
            score.right += is_right ? 1 : 0;
            score.occupied += is_occupied ? 1 : 0;
            if (is_occupied && !plan.has_within(TruePlan::Square::kObstacle, p[0], p[1], 2 * side)) {
                ++score.ghosts;
                score.people += plan.is_on_a_path(p[0], p[1], 0.03) ? 1 : 0;
            }
        }
    }
    ::testing::Test::RecordProperty("share_right", std::to_string(score.share()));
    return score;
}

}  // namespace stillmesh::test
