// Points whose place is in view, with depth measured clearly beyond it: what they showed has gone, and after some such
// frames so do they. A lone hole or border in the depth image proves nothing: all looks around the place must agree.
// Cost: places_per_frame points of the local map a frame, in turn.
#pragma once

#include <cstdint>

#include "engine/configuration.hpp"
#include "engine/frame/frame.hpp"
#include "engine/map/local_map.hpp"
#include "engine/map/map.hpp"
#include "engine/tasks/measured_frame.hpp"

namespace stillmesh {

class EmptyPlaces {
public:
    void create(const Configuration& configuration) noexcept;
    void reset() noexcept { cursor_ = 0; }

    // `number`: of the frame, as the points it saw carry it. `noise_depth`: factor on the depth's variance.
    void look(const Frame& frame, const MeasuredFrame& measured, const SE3& world_from_camera, std::uint64_t number,
              double noise_depth, const LocalMap& local_map, Map& map) noexcept;

private:
    EmptinessParameters parameters_;
    double z_min_m_ = 0;
    double z_max_m_ = 0;
    std::uint32_t cursor_ = 0;  // in the local map's points
};

}  // namespace stillmesh
