// A region of a map store as bytes (docs/SPEC-map-store.md): one keyframe, the static points that it shows, and the
// features that show them. Points are named by what never changes of them (their first picture), so that two regions
// that come back share the points they had in common, and a point that is still in the map is not made twice.
// Reading checks everything before anything is used. Cost: one pass over the features. Limit: region_bytes_max().
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/geometry/camera_model.hpp"
#include "engine/map/map.hpp"
#include "engine/record/map_records.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kRegionVersion = 1;
inline constexpr std::size_t kRegionHeadBytes = 40 + map_records::kKeyframeBytes;
inline constexpr std::size_t kRegionFeatureBytes = map_records::kPointBytes + map_records::kFeatureBytes;
[[nodiscard]] constexpr std::size_t region_bytes_max(std::uint32_t features_max) noexcept {
    return kRegionHeadBytes + kRegionFeatureBytes * features_max;
}

struct RegionInfo {
    Keyframe keyframe;          // `observations`: how many features, each with its point; no handles
    double map_readout_s = 0;   // that poses and points are expressed with
    std::uint64_t left_at = 0;  // when it left the map: any number that grows
};

struct RegionBounds {
    std::uint32_t features_max = 0;
    std::uint32_t pyramid_levels = 0;     // below
    std::uint32_t width = 0, height = 0;  // px, of the camera
};

// Of a point that is not suspect: equal for the same point, whatever was learnt of it.
[[nodiscard]] std::uint64_t point_name(const MapPoint& point) noexcept;

// What may be kept of a keyframe: features that show a static point. At most `out` has room for; bytes written.
[[nodiscard]] std::size_t encode_region(const Map& map, Handle<Keyframe> handle, std::uint32_t weight_min,
                                        std::uint64_t left_at, std::span<std::byte> out) noexcept;

// Whether the bytes are a region that this engine can take: version, counts, every number.
//   kInvalid  another version   kFull  more than bounds.features_max features   kCorrupt  anything else
[[nodiscard]] Status check_region(std::span<const std::byte> bytes, const RegionBounds& bounds,
                                  RegionInfo& info) noexcept;
// Feature `index` of a checked region, and the point that it shows.
void read_region_feature(std::span<const std::byte> bytes, std::uint32_t index, Observation& observation,
                         Descriptor& descriptor, MapPoint& point) noexcept;

}  // namespace stillmesh
