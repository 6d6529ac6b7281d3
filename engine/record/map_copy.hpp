// A copy of the map as it is at one instant, made between frames in slices while tracking and mapping go on.
// What is large seldom changes: the features of a living keyframe. They are copied first, keyframe by keyframe, with
// the points they show. Then one bounded step makes the instant: keyframes whose features have come or changed since
// (at most kLateMax; with more, another round of slices comes first), every keyframe's pose, every point. Depth images,
// which never change, are copied in the same way, behind the features. So the copy is the map between two commits,
// exactly, and nothing has to wait for it. Limit: the workspace, map_copy_bytes(limits). Units: 16 features, 16 points
// or 16 keyframes copied; 8 are a depth image.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/depth_images.hpp"
#include "engine/map/map.hpp"
#include "engine/record/map_file.hpp"
#include "engine/record/map_records.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

// What the copy says beside the map: how its features were made, and when it was.
struct MapMoment {
    std::uint64_t frames = 0;
    std::int64_t time_ns = 0;
};
struct MapOrigin {
    CameraModel camera;
    std::uint32_t pyramid_levels = 0;
    double scale_factor = 0;
    std::uint8_t extractor = 0;
};

namespace map_copy_detail {

struct Head {
    Limits limits;
    CameraModel camera;
    double readout_s = 0;
    MapFileInfo info;
};
struct StagedKeyframe {
    Handle<Keyframe> handle;  // whose features are here; null: nobody's
    std::uint32_t observations_changed = 0;
    std::uint32_t features = 0;
    std::uint32_t place_plus_one = 0;  // in the file
    std::byte record[map_records::kKeyframeBytes];
};
struct PointPlace {
    std::uint32_t generation = 0;
    std::uint32_t plus_one = 0;  // in the file
};
// The parts of a workspace.
struct Parts {
    Head* head = nullptr;
    std::span<StagedKeyframe> keyframes;  // by slot
    std::span<std::uint32_t> order;       // slots, as they follow in the file
    std::span<PointPlace> places;         // by slot
    std::span<MapPoint> points;           // as they follow in the file
    std::span<Observation> observations;  // features_max per keyframe slot
    std::span<Descriptor> descriptors;    // likewise
    // Of depth images:
    std::span<DepthImages::Owner> owners;  // by index; with a keyframe: whose cells are here
    std::span<std::uint32_t> images;       // indices, as they follow in the file
    std::span<std::uint16_t> depth_mm;     // kDepthCellsMax per index
    std::span<float> rays;
};

}  // namespace map_copy_detail

class MapCopy {
public:
    static constexpr std::uint32_t kLateMax = 16;

    // kFull: the workspace is smaller than map_copy_bytes(limits). It must be aligned to kArenaAlignment.
    [[nodiscard]] Status begin(std::span<std::byte> workspace, const Limits& limits, const MapOrigin& origin) noexcept;
    void cancel() noexcept { stage_ = Stage::kIdle; }
    // kIdle: nothing was begun, or it is finished. kDone: the workspace holds the copy, and is no longer touched.
    [[nodiscard]] Progress step(const Map& map, const DepthImages& images, const MapMoment& moment,
                                WorkBudget& budget) noexcept;

private:
    enum class Stage : std::uint8_t { kIdle, kFeatures, kImages, kInstant };

    // Of a keyframe's slot, or of a depth image's index: whether it is there, and not in the copy as it is.
    [[nodiscard]] bool is_due(const Map& map, std::uint32_t slot) const noexcept;
    [[nodiscard]] bool is_due(const Map& map, const DepthImages& images, std::uint32_t index) const noexcept;
    std::uint32_t stage(const Map& map, std::uint32_t slot) noexcept;
    std::uint32_t stage(const DepthImages& images, std::uint32_t index) noexcept;
    // False: too much has changed.
    [[nodiscard]] bool take_instant(const Map& map, const DepthImages& images, const MapMoment& moment,
                                    WorkBudget& budget) noexcept;
    void take_keyframes(const Map& map, WorkBudget& budget) noexcept;
    void take_images(const Map& map, const DepthImages& images, WorkBudget& budget) noexcept;

    map_copy_detail::Parts parts_;
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;
};

}  // namespace stillmesh
