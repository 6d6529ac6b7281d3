#include "engine/paging/region.hpp"

#include "engine/base/bytes.hpp"
#include "engine/base/hash.hpp"
#include "engine/record/map_checks.hpp"

namespace stillmesh {
namespace {

using namespace map_records;

void write_head(ByteWriter& out, const Keyframe& keyframe, std::uint32_t features, double readout_s,
                std::uint64_t left_at) noexcept {
    out.u32(kRegionVersion);
    out.u32(features);
    out.f64(readout_s);
    out.u64(left_at);
    out.f32(keyframe.drift_m);
    out.u32(0);
    out.u64(0);
    Keyframe copy = keyframe;
    copy.observations = features;
    write_keyframe(out, copy, 0);
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
        write_feature(body, seen[i], descriptors[i]);
        write_point(body, *point, 0);
        ++count;
    }
    ByteWriter head(out.first(kRegionHeadBytes));
    write_head(head, *keyframe, count, map.readout_s(), left_at);
    STILLMESH_CHECK(head.is_ok() && head.remaining() == 0 && body.is_ok());
    return kRegionHeadBytes + body.position();
}

Status check_region(std::span<const std::byte> bytes, const RegionBounds& bounds, RegionInfo& info) noexcept {
    using namespace map_checks;
    ByteReader reader(bytes);
    const std::uint32_t version = reader.u32();
    if (reader.is_ok() && version != kRegionVersion) return Status::kInvalid;
    const std::uint32_t features = reader.u32();
    info.map_readout_s = reader.f64();
    info.left_at = reader.u64();
    const float drift_m = reader.f32();
    const std::uint32_t zero = reader.u32();
    const std::uint64_t zeros = reader.u64();
    std::uint32_t parent = 0;
    Keyframe& k = info.keyframe;
    k = Keyframe{};
    read_keyframe(reader, k, parent);
    k.drift_m = drift_m;
    if (!reader.is_ok() || zero != 0 || zeros != 0 || parent != 0 || k.observations != features) {
        return Status::kCorrupt;
    }
    if (features > bounds.features_max) return Status::kFull;
    if (bytes.size() != region_bytes_max(features)) return Status::kCorrupt;
    const bool is_possible =
        is_pose(k.world_from_camera) && is_slow(k.speed) && is_slow(k.pose_by_readout) &&
        is_in(k.readout_s, -kReadoutMax_s, kReadoutMax_s) && is_in(info.map_readout_s, -kReadoutMax_s, kReadoutMax_s) &&
        is_in(drift_m, 0.0F, static_cast<float>(kFar_m)) && is_in(k.time_ns, std::int64_t{0}, kTimeMax_ns) &&
        k.frame < kFramesMax && k.last_useful_frame < kFramesMax;
    if (!is_possible) return Status::kCorrupt;
    MapBounds map_bounds;
    map_bounds.pyramid_levels = bounds.pyramid_levels;
    for (std::uint32_t i = 0; i < features; ++i) {
        Observation observation;
        Descriptor descriptor;
        if (!read_feature(reader, observation, descriptor)) return Status::kCorrupt;
        if (!is_feature(observation, map_bounds, bounds.width, bounds.height)) return Status::kCorrupt;
        MapPoint point;
        std::uint32_t reference = 0;
        if (!read_point(reader, point, reference) || reference != 0 || point.is_suspect) return Status::kCorrupt;
        if (!is_point(point, map_bounds)) return Status::kCorrupt;
    }
    STILLMESH_CHECK(reader.is_ok() && reader.remaining() == 0);
    return Status::kOk;
}

void read_region_feature(std::span<const std::byte> bytes, std::uint32_t index, Observation& observation,
                         Descriptor& descriptor, MapPoint& point) noexcept {
    ByteReader reader(bytes.subspan(kRegionHeadBytes + kRegionFeatureBytes * index, kRegionFeatureBytes));
    std::uint32_t reference = 0;
    const bool is_read = read_feature(reader, observation, descriptor) && read_point(reader, point, reference);
    STILLMESH_CHECK(is_read);
}

}  // namespace stillmesh
