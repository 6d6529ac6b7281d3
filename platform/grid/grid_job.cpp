#include "platform/grid/grid_job.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace stillmesh {

RigidTransform aligned_level(const RigidTransform& level_from_map, const RigidTransform& frame_from_map) {
    const RigidTransform level_from_frame = compose(level_from_map, inverse_of(frame_from_map));
    const std::array<double, 3> x = rotated(level_from_frame, {1, 0, 0});
    const double half = -0.5 * std::atan2(x[1], x[0]);
    RigidTransform turn{{0, 0, std::sin(half), std::cos(half)}, {0, 0, 0}};
    const auto& t = level_from_frame.translation_m;
    const std::array<double, 3> origin = rotated(turn, {t[0], t[1], 0});
    turn.translation_m[0] = -origin[0];
    turn.translation_m[1] = -origin[1];
    return compose(turn, level_from_map);
}

bool GridJob::open(const Limits& limits, const GridOptions& options, std::string& message) {
    images_max_ = limits.depth_images_max;
    looks_.reserve(images_max_);
    if (!block_.allocate(OccupancyGrid::bytes(options))) {
        message = fmt::format("the system has no {:.1f} MiB of memory left for the grid.",
                              static_cast<double>(OccupancyGrid::bytes(options)) / (1024.0 * 1024.0));
        return false;
    }
    grid_.create(block_.bytes(), options);
    return true;
}

void GridJob::begin(const DepthSource& images) {
    looks_.clear();
    for (std::uint32_t index = 0; index < images_max_; ++index) {
        const DepthImage image = images.depth_image(index);
        if (image.columns > 0) looks_.push_back({image.frame, index, image.map_from_camera});
    }
    std::sort(looks_.begin(), looks_.end(), [](const Look& a, const Look& b) { return a.frame < b.frame; });
    finder_.begin();
    floor_ = {};
    grid_.begin();
    has_grid_ = false;
    next_ = 0;
    pass_ = Pass::kFloor;
}

bool GridJob::step(const DepthSource& images) {
    if (pass_ == Pass::kDone) return false;
    const DepthImage image = next_ < looks_.size() ? images.depth_image(looks_[next_].index) : DepthImage{};
    if (image.columns > 0 && image.frame == looks_[next_].frame) {
        const RigidTransform& map_from_camera = looks_[next_].map_from_camera;
        if (pass_ == Pass::kFloor) {
            finder_.add(image, map_from_camera);
        } else if (pass_ == Pass::kCover) {
            grid_.cover(image, compose(floor().level_from_map, map_from_camera));
        } else {
            grid_.add(image, compose(floor().level_from_map, map_from_camera));
        }
    }
    next_ += pass_ == Pass::kFloor ? std::max<std::size_t>(1, looks_.size() / kFloorLooks) : 1;
    if (next_ >= looks_.size()) end_pass();
    return pass_ != Pass::kDone;
}

void GridJob::end_pass() {
    next_ = 0;
    switch (pass_) {
        case Pass::kFloor:
            if (!finder_.end_pass()) break;
            floor_ = finder_.floor();
            if (frame_from_map_) floor_.level_from_map = aligned_level(floor_.level_from_map, *frame_from_map_);
            pass_ = floor_.is_known ? Pass::kCover : Pass::kDone;
            break;
        case Pass::kCover:
            grid_.lay_out();
            pass_ = Pass::kGrid;
            break;
        case Pass::kGrid:
            grid_.finish();
            has_grid_ = grid_.width() > 0;
            pass_ = Pass::kDone;
            break;
        case Pass::kDone: break;
    }
}

}  // namespace stillmesh
