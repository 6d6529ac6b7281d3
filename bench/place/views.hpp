// What the place benches look at: features of rendered and recorded frames with the truth about them, and pairs of
// frames of which it is known whether they show the same place. Rendering takes most of the time.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/features/features.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/se3.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh::bench {

struct PlaceView {
    std::string set;   // such as "static_loop"
    std::string room;  // views of different rooms never overlap
    std::uint64_t day =
        0;  // of a room: people, light and the camera's way; views of different days are far apart in time
    std::int64_t time_ns = 0;
    SE3 world_from_camera;
    CameraModel camera;
    double dynamic_share = 0;
    std::vector<Keypoint> keypoints;
    std::vector<Descriptor> descriptors;
    std::vector<std::uint8_t> is_still;  // by feature: not on a moving body
    std::vector<float> z_m;              // by feature; 0: no depth
    std::vector<float> thumbnail_z_m;    // kThumbnailStep px apart, row by row; 0: none, or a moving body
    std::uint32_t thumbnail_width = 0;
};
inline constexpr std::uint32_t kThumbnailStep_px = 10;

// Frames of a scene, evenly over its length (`frames` 0: none). day 0: the seed's own.
void add_rendered(const std::string& scene, std::uint64_t seed, std::uint64_t day, std::uint32_t frames,
                  std::vector<PlaceView>& views);
// Every `step`th frame of a recording with ground truth (and masks). False: it is not there.
bool add_recorded(const std::string& folder, std::uint32_t step, std::vector<PlaceView>& views);

// Views of an earlier run, for whoever measures again and again. False: no such file, or of another time.
bool load_views(const std::string& file, std::vector<PlaceView>& views);
void save_views(const std::string& file, const std::vector<PlaceView>& views);

// Which part of what `a` measures is in sight of `b`, at the depth that b measures there: 0..1. Neither counts people.
struct Overlap {
    double seen = 0;        // at the same depth
    double in_frustum = 0;  // whatever the depth there, and wherever unmeasured pixels may be
};
[[nodiscard]] Overlap overlap_of(const PlaceView& a, const PlaceView& b);

struct ViewPair {
    std::uint32_t a = 0, b = 0;
    bool is_same = false;
};
// At most so many positive ones (more than 2 s apart, each sees at least 40 % of the other) and negative ones (another
// room, or nothing of each other in sight), chosen evenly from all there are by a fixed seed.
[[nodiscard]] std::vector<ViewPair> choose_pairs(std::span<const PlaceView> views, std::size_t positive_max,
                                                 std::size_t negative_max);

}  // namespace stillmesh::bench
