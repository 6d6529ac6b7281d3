#include "engine/paging/region.hpp"

#include "engine/base/bytes.hpp"
#include "engine/base/hash.hpp"
#include "engine/record/map_checks.hpp"

namespace stillmesh {
namespace {

using namespace map_records;

// What comes before the features, behind the version, for a ByteWriter and a ByteReader alike. False: it has a parent,
// which a region's keyframe has not, or says two numbers of features.
template <typename Bytes>
bool head_fields(Bytes& bytes, RegionInfo& info, std::uint32_t features) noexcept {
    Keyframe& keyframe = info.keyframe;
    std::uint32_t parent = 0;
    keyframe.observations = features;
    bytes.fields(features, info.map_readout_s, info.left_at, keyframe.drift_m);
    bytes.zeros(12);
    keyframe_fields(bytes, keyframe, parent);
    return parent == 0 && keyframe.observations == features;
}

}  // namespace

std::uint64_t point_name(const MapPoint& point) noexcept {
    StateHash hash;
    for (const std::uint64_t word : point.descriptor.words) hash.add(word);
    hash.add(point.angle_rad);
    hash.add(point.distance_m);
    hash.add(std::uint32_t{point.level});
    return hash.value();
}

std::size_t encode_region(const Map& map, Handle<Keyframe> handle, std::uint32_t weight_min, std::uint64_t left_at,
                          std::span<std::byte> out) noexcept {
    const Keyframe* const keyframe = map.keyframes().find(handle);
    STILLMESH_CHECK(keyframe != nullptr && out.size() >= kRegionHeadBytes);
    const std::span<const Observation> seen = map.observations(handle);
    const std::span<const Descriptor> descriptors = map.descriptors(handle);
    ByteWriter body(out.subspan(kRegionHeadBytes));
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < seen.size() && body.remaining() >= kRegionFeatureBytes; ++i) {
        const MapPoint* const point = map.points().find(seen[i].point);
        if (!is_static(point, weight_min)) continue;
        feature_fields(body, seen[i], descriptors[i]);
        point_fields(body, *point, std::uint32_t{0});
        ++count;
    }
    ByteWriter head(out.first(kRegionHeadBytes));
    head.u32(kRegionVersion);
    RegionInfo info{*keyframe, map.readout_s(), left_at};
    STILLMESH_CHECK(head_fields(head, info, count));
    STILLMESH_CHECK(head.is_ok() && head.remaining() == 0 && body.is_ok());
    return kRegionHeadBytes + body.position();
}

Status check_region(std::span<const std::byte> bytes, const RegionBounds& bounds, RegionInfo& info) noexcept {
    using namespace map_checks;
    ByteReader reader(bytes);
    const std::uint32_t version = reader.u32();
    if (reader.is_ok() && version != kRegionVersion) return Status::kInvalid;
    Keyframe& k = info.keyframe;
    k = Keyframe{};
    if (!head_fields(reader, info, 0) || !reader.is_ok()) return Status::kCorrupt;
    const std::uint32_t features = k.observations;
    if (features > bounds.features_max) return Status::kFull;
    if (bytes.size() != region_bytes_max(features)) return Status::kCorrupt;
    const bool is_possible =
        is_pose(k.world_from_camera) && is_slow(k.speed) && is_slow(k.pose_by_readout) &&
        is_in(k.readout_s, -kReadoutMax_s, kReadoutMax_s) && is_in(info.map_readout_s, -kReadoutMax_s, kReadoutMax_s) &&
        is_in(k.drift_m, 0.0F, static_cast<float>(kFar_m)) && is_in(k.time_ns, std::int64_t{0}, kTimeMax_ns) &&
        k.frame < kFramesMax && k.last_useful_frame < kFramesMax;
    if (!is_possible) return Status::kCorrupt;
    MapBounds map_bounds;
    map_bounds.pyramid_levels = bounds.pyramid_levels;
    for (std::uint32_t i = 0; i < features; ++i) {
        Observation observation;
        Descriptor descriptor;
        MapPoint point;
        std::uint32_t reference = 0;
        feature_fields(reader, observation, descriptor);
        point_fields(reader, point, reference);
        if (!reader.is_ok() || reference != 0 || point.is_suspect || !is_point(point, map_bounds) ||
            !is_feature(observation, map_bounds, bounds.width, bounds.height)) {
            return Status::kCorrupt;
        }
    }
    STILLMESH_CHECK(reader.is_ok() && reader.remaining() == 0);
    return Status::kOk;
}

void read_region_feature(std::span<const std::byte> bytes, std::uint32_t index, Observation& observation,
                         Descriptor& descriptor, MapPoint& point) noexcept {
    ByteReader reader(bytes.subspan(kRegionHeadBytes + kRegionFeatureBytes * index, kRegionFeatureBytes));
    std::uint32_t reference = 0;
    feature_fields(reader, observation, descriptor);
    point_fields(reader, point, reference);
    STILLMESH_CHECK(reader.is_ok());
}

}  // namespace stillmesh
