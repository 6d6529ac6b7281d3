// Points whose place is in view, with depth measured clearly beyond it: what they showed has gone, and after some such
// frames so do they. A lone hole or border in the depth image proves nothing: all looks around the place must agree.
// The same look tells whether a camera that was lost can be where a proposal puts it: walls and shelves of one
// building look alike, but where the room is another one, the depth image looks through the map.
// Cost: places_per_frame points of the local map a frame, in turn.
#pragma once

#include <cstdint>

#include "engine/parameters.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class EmptyPlaces {
public:
    void create(const Parameters& configuration) noexcept { parameters_ = &configuration; }
    void reset() noexcept { cursor_ = 0; }

    // `noise_depth`: factor on the depth's variance.
    void note_empty(const MeasuredFrame& measured, const SE3& world_from_camera, double noise_depth,
                    World& world) noexcept;

    static constexpr std::uint32_t kAgreementPlaces = 400;
    static constexpr std::uint32_t kAgreementColumns = 16, kAgreementRows = 12;
    // Of the static points of the map in view; hidden ones say nothing. A cell of the picture counts once, as most of
    // its points say: of a body that sat at the table when the map was made and has gone, a printed shirt had half of
    // the points in view and a quarter of the cells.
    struct Agreement {
        std::uint32_t points_there = 0;
        std::uint32_t there = 0, empty = 0;  // cells
    };
    // Some kAgreementPlaces points, spread over the local map.
    [[nodiscard]] Agreement agreement(const MeasuredFrame& measured, const SE3& world_from_camera, double noise_depth,
                                      const World& world) const noexcept;

private:
    enum class Seen : std::uint8_t { kNothing, kThere, kEmpty };
    // `pixel`: where it is seen, unless that is nowhere.
    [[nodiscard]] Seen examine(const MapPoint& point, const MeasuredFrame& measured, const SE3& camera_from_world,
                               double noise_depth, Vector2& pixel) const noexcept;

    const Parameters* parameters_ = nullptr;  // outlives it
    std::uint32_t cursor_ = 0;                // in the local map's points
};

}  // namespace stillmesh
