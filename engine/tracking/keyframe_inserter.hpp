// When a frame becomes a keyframe (paper 2.1.6: too little of what the last one saw is still tracked, and there is
// something new to see), and how: room is made in full pools by the map's policy, what the frame showed becomes
// observations, and what it could not match becomes points. A new point beside moving ones begins without a weight.
// Limits: those of the map's pools and of the queue of mapping. Cost: a keyframe is some passes over the
// features, and one over the points where room has to be made.
#pragma once

#include <cstdint>
#include <span>

#include "engine/matching/correspondence.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/parameters.hpp"
#include "engine/tracking/free_space.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/point_judge.hpp"
#include "engine/tracking/still_depth.hpp"
#include "engine/tracking/tracked_shutter.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class KeyframeInserter {
public:
    // The frame that is to become one.
    struct Source {
        PosedFrame posed;
        const MapMatcher& matcher;
        const PointJudge& judge;
        std::uint32_t static_count = 0;                // matches with a weight
        double drift_m = 0;                            // that odometry can have gathered
        std::span<const Correspondence> matches = {};  // with what moves marked; for the depth image
    };

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FreeSpace::plan(arena, limits);
        StillDepth::plan(arena, limits);
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept {
        parameters_ = &configuration;
        free_space_.create(arena, limits, configuration);
        still_depth_.create(arena, limits, configuration.depth);
    }
    void reset() noexcept { begin_after(0); }
    // As if the last keyframe had been made in frame `number`, with nothing tracked.
    void begin_after(std::uint64_t number) noexcept;

    // Features that show no point yet, with depth: what a keyframe would add.
    [[nodiscard]] static std::uint32_t new_points_possible(const MeasuredFrame& frame,
                                                           const MapMatcher& matcher) noexcept;
    [[nodiscard]] bool wants(std::uint64_t number, std::uint32_t static_count,
                             std::uint32_t new_points_possible) const noexcept;
    // The share of the local map that the keyframe renews: points added over points tracked and added.
    double insert(const Source& source, World& world) noexcept;
    // A frame that becomes none: once a while what it sees is kept beside that of the keyframe nearest to it.
    void look(const Source& source, World& world) noexcept;
    // What later frames are compared with: the first keyframe of a map counts differently.
    void set_tracked(std::uint32_t count) noexcept { tracked_ = count; }

private:
    void make_room(std::uint32_t points_wanted, std::uint64_t number, World& world) const noexcept;
    [[nodiscard]] bool is_suspicious(const Source& source, std::size_t feature) const noexcept;
    [[nodiscard]] bool has_come(std::size_t feature) const noexcept;
    [[nodiscard]] bool lies_among_moving(const Source& source, std::size_t feature) const noexcept;
    void keep_depth(const Source& source, const DepthImages::Owner& owner, World& world) noexcept;
    void add_point(const Source& source, std::size_t feature, Handle<Keyframe> keyframe, std::uint32_t weight_tenths,
                   World& world) const noexcept;

    const Parameters* parameters_ = nullptr;  // outlives it
    FreeSpace free_space_;
    StillDepth still_depth_;
    std::int64_t begun_ns_ = -1;  // the first frame that could have had a depth image
    std::int64_t looked_ns_ = 0;  // the last that had
    std::uint64_t frame_ = 0;     // of the last keyframe
    std::uint32_t tracked_ = 0;   // static points right after it
};

}  // namespace stillmesh
