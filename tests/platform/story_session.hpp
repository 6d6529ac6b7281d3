// A session and a camera that tell any story: for testing what surrounds the engine without the engine.
#pragma once

#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "platform/cli/session.hpp"

namespace stillmesh::test {

// The camera walks along x, 1 cm per frame; `state_of` says how each frame went.
class StorySession final : public TrackingSession {
public:
    std::function<PoseState(std::uint64_t)> state_of = [](std::uint64_t) { return PoseState::kTracked; };
    std::function<Status(std::uint64_t)> status_of = [](std::uint64_t) { return Status::kOk; };

    std::vector<TrackedEdge> edges;
    std::vector<TrackedFeature> points;
    bool would_begin_here = false;
    bool is_moving = false;  // most of what is matched
    int maps_begun = 0;

    std::optional<bool> could_begin_here(const Frame&) override { return would_begin_here; }
    std::string begin_new_map() override {
        ++maps_begun;
        return "the story begins anew";
    }
    Status submit(const Frame&, SessionFrame& out, std::string& message) override {
        const std::uint64_t index = count_++;
        if (const Status status = status_of(index); status != Status::kOk) {
            message = "the story says so.";
            return status;
        }
        out.state = state_of(index);
        out.world_from_camera.t = {0.01 * static_cast<double>(index), 0.1 * std::sin(static_cast<double>(index) / 15),
                                   0};
        out.features = 900;
        out.static_features = static_cast<std::uint16_t>(400 + 100 * (index % 3));
        out.dynamic_features = static_cast<std::uint16_t>(is_moving ? 800 : 5 * (index % 50));
        out.state_hash = 0x1000 + index;
        return Status::kOk;
    }
    // A mesh over the picture: a person before a wall.
    bool look(SessionLook& look, std::span<KeyframePose>, std::span<KeyframeLink>) override {
        edges.clear();
        points.clear();
        for (float y = 30; y < 450; y += 24) {
            for (float x = 30; x < 610; x += 24) {
                const bool is_person = x > 280 && x < 420 && y > 90;
                const bool is_border = is_person && (x < 305 || x > 390);
                edges.push_back({x, y, x + 24, y, !is_border});
                points.push_back({x, y, is_person ? 1 : 0, true, !is_person, is_person});
            }
        }
        look = {};
        look.tracking = {points, edges};
        return true;
    }
    void account(RunRecord& record) override {
        for (const char* name : {"features", "matching", "mesh", "static region", "pose", "map"}) {
            StageRecord stage{name, {}};
            for (int i = 0; i < 100; ++i) stage.ms.add(0.2 + 0.01 * i);
            record.stages.push_back(stage);
        }
        record.pools = {{"keyframes", 200, 256}, {"map points", 20000, 20000}};
        record.block_bytes = 40U << 20U;
        record.arena_used_bytes = 39U << 20U;
    }

private:
    std::uint64_t count_ = 0;
};

// 30 frames per second of 64x48 pixels with texture and depth, unless the story changes them.
class StoryCamera final : public DepthCamera {
public:
    std::uint64_t frames = 90;
    std::function<Status(std::uint64_t)> status_of = [](std::uint64_t) { return Status::kOk; };
    std::function<std::int64_t(std::uint64_t)> time_of = [](std::uint64_t i) {
        return 1'000'000'000 + static_cast<std::int64_t>(i) * 33'000'000;
    };
    std::vector<std::uint8_t> colour = std::vector<std::uint8_t>(std::size_t{64} * 48);
    std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(std::size_t{64} * 48, 10000);

    StoryCamera() {
        for (std::size_t i = 0; i < colour.size(); ++i) colour[i] = static_cast<std::uint8_t>(60 + (i * i / 7) % 120);
    }
    Status poll(Frame& frame) noexcept override {
        const std::uint64_t index = count_++;
        if (index >= frames) return Status::kEnd;
        if (const Status status = status_of(index); status != Status::kOk) return status;
        frame.time_ns = frame.depth_time_ns = time_of(index);
        frame.colour = {colour.data(), 64, 48, 64};
        frame.depth = {depth.data(), 64, 48, 64};
        return Status::kOk;
    }
    Status wait(std::uint32_t) noexcept override { return Status::kOk; }

private:
    std::uint64_t count_ = 0;
};

}  // namespace stillmesh::test
