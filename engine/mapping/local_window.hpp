// The window of a local adjustment (paper 2.1, method.md 6): a new keyframe with its best covisible neighbours moves,
// the keyframes that see the same points hold still, and the points are those that two of them see.
//   choose    which keyframes and points; not where the new keyframe sees few points of the map
//   collect   the observations, a keyframe a piece
//   adjust    LocalAdjustment, on a copy: the map may change meanwhile
//   commit    the map moves (engine/map/map_correction.hpp): what was evicted or changed since is skipped, newer
//             keyframes follow their parent in the spanning tree, other points their reference keyframe, the camera the
//             newest keyframe; observations that fit nowhere end
// Limits: kFreeMax and kFixedMax keyframes, 2 features_max points, 8 features_max observations. Cost: units are
// residuals evaluated, or what takes as long; all calls but adjust() are one piece.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/local_adjustment.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class LocalWindow {
public:
    static constexpr std::uint32_t kFreeMax = 12;
    static constexpr std::uint32_t kFixedMax = 24;

    static constexpr AdjustmentSizes sizes(const Limits& limits) noexcept {
        const std::uint32_t free = limits.keyframes_max < kFreeMax ? limits.keyframes_max : kFreeMax;
        const std::uint32_t fixed = limits.keyframes_max < kFixedMax ? limits.keyframes_max : kFixedMax;
        return {free, fixed, 2 * limits.features_max, 8 * limits.features_max};
    }
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        LocalAdjustment::plan(arena, sizes(limits));
        arena.array<WindowKeyframe>(sizes(limits).free_keyframes_max + sizes(limits).fixed_keyframes_max);
        arena.array<WindowPoint>(sizes(limits).points_max);
        arena.array<WindowObservation>(sizes(limits).observations_max);
        arena.array<std::uint32_t>(limits.map_points_max);
        arena.array<std::uint16_t>(limits.keyframes_max);
    }
    void create(Arena& arena, World& world) noexcept;

    // Around a live keyframe; `neighbours` are the keyframes that share most with it. Units. What there is to adjust is
    // left in is_chosen().
    [[nodiscard]] std::uint32_t choose(Handle<Keyframe> keyframe,
                                       std::span<const Handle<Keyframe>> neighbours) noexcept;
    [[nodiscard]] bool is_chosen() const noexcept { return is_chosen_; }
    // The observations of the next keyframe; the adjustment has started when is_collected(). Units.
    [[nodiscard]] std::uint32_t collect() noexcept;
    [[nodiscard]] bool is_collected() const noexcept { return adjustment_.is_running() || adjustment_.is_done(); }
    [[nodiscard]] Progress adjust(WorkBudget& budget) noexcept { return adjustment_.step(budget); }
    // Units.
    [[nodiscard]] std::uint32_t commit() noexcept;
    // The window is given up.
    void cancel() noexcept;

private:
    struct WindowKeyframe {
        Handle<Keyframe> handle;
        SE3 world_from_camera;  // when the window was chosen
        bool is_fixed = false;
    };
    struct WindowPoint {
        Handle<MapPoint> handle;
        double world[3] = {};  // when the window was chosen
    };
    struct WindowObservation {
        std::uint16_t keyframe = 0;  // in keyframes_
        std::uint16_t feature = 0;
    };
    [[nodiscard]] std::uint32_t take_in(Handle<Keyframe> handle, bool is_fixed) noexcept;
    [[nodiscard]] std::uint32_t choose_points() noexcept;
    [[nodiscard]] std::uint32_t choose_fixed() noexcept;
    void hold_the_oldest() noexcept;
    void fill_adjustment() noexcept;
    void forget_points() noexcept;
    // Of a point by slot; nullptr: it is not in the window.
    [[nodiscard]] const WindowPoint* find(Handle<MapPoint> point) const noexcept;
    void correct_map() noexcept;
    [[nodiscard]] std::uint32_t drop_outliers() noexcept;

    World* world_ = nullptr;  // outlives it
    LocalAdjustment adjustment_;
    std::span<WindowKeyframe> keyframes_;  // free ones first, that at hand before all; numbered as in the adjustment
    std::span<WindowPoint> points_;        // likewise
    std::span<WindowObservation> observations_;
    std::span<std::uint32_t> index_;   // by point slot: its number in the window + 1
    std::span<std::uint16_t> counts_;  // by keyframe slot: observations of points of the window
    std::uint32_t keyframe_count_ = 0, free_count_ = 0;
    std::uint32_t point_count_ = 0;
    std::uint32_t newest_point_count_ = 0;  // that the keyframe at hand sees
    std::uint32_t observation_count_ = 0;
    std::uint32_t cursor_ = 0;  // keyframes collected
    bool is_chosen_ = false;
};

}  // namespace stillmesh
