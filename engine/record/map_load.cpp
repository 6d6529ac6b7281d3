#include "engine/record/map_load.hpp"

#include <algorithm>
#include <array>

#include "engine/record/map_bytes.hpp"
#include "engine/record/map_checks.hpp"

namespace stillmesh {
namespace {

using namespace map_checks;
using namespace map_records;

// In the order of MapFault.
constexpr Status kStatusOf[] = {Status::kOk,      Status::kNotFound, Status::kInvalid, Status::kEnd,
                                Status::kCorrupt, Status::kCorrupt,  Status::kCorrupt, Status::kFull,
                                Status::kInvalid, Status::kInvalid,  Status::kInvalid};
static_assert(std::size(kStatusOf) == static_cast<std::size_t>(MapFault::kOtherCamera) + 1);

Status fail(MapFileProblem& problem, MapFault fault, const char* part, double value = 0, double limit = 0) noexcept {
    problem = {fault, part, value, limit};
    return kStatusOf[static_cast<std::size_t>(fault)];
}

Status check_sections(const MapFile& file, MapFileProblem& problem) noexcept {
    for (std::uint32_t s = 0; s < sections_of(file.info); ++s) {
        const auto begin = static_cast<std::size_t>(section_at(file.info, s));
        const std::size_t size = kSectionHeadBytes + static_cast<std::size_t>(section_bytes(file.info, s));
        ByteReader reader(file.bytes.subspan(begin, size));
        std::array<char, 4> tag{};
        reader.fields(tag);
        const bool is_head =
            tag == kTags[s] && reader.u32() == records_of(file.info, s) && reader.u64() == section_bytes(file.info, s);
        ByteReader crc(file.bytes.subspan(begin + size, kCrcBytes));
        if (!is_head || crc.u32() != crc32(file.bytes.subspan(begin, size)))
            return fail(problem, MapFault::kDamaged, kNames[s]);
    }
    return Status::kOk;
}

Status check_camera(const MapFile& file, const CameraModel& ours, MapFileProblem& problem) noexcept {
    double readout_s = 0;
    const CameraModel c = file.camera(readout_s);
    if (!is_in(readout_s, -kReadoutMax_s, kReadoutMax_s))
        return fail(problem, MapFault::kImpossible, "the readout of the camera");
    const struct {
        const char* name;
        double value, ours;
    } numbers[] = {{"width", static_cast<double>(c.width), static_cast<double>(ours.width)},
                   {"height", static_cast<double>(c.height), static_cast<double>(ours.height)},
                   {"fx", c.fx, ours.fx},
                   {"fy", c.fy, ours.fy},
                   {"cx", c.cx, ours.cx},
                   {"cy", c.cy, ours.cy},
                   {"k1", c.k1, ours.k1},
                   {"k2", c.k2, ours.k2},
                   {"p1", c.p1, ours.p1},
                   {"p2", c.p2, ours.p2},
                   {"k3", c.k3, ours.k3}};
    for (const auto& number : numbers) {
        if (number.value == number.ours) continue;
        return fail(problem, MapFault::kOtherCamera, number.name, number.value, number.ours);
    }
    const std::uint32_t lens_crc = lens_crc_of(ours);
    if (file.info.lens_crc != lens_crc)
        return fail(problem, MapFault::kOtherCamera, "checksum of the lens model", file.info.lens_crc, lens_crc);
    return Status::kOk;
}

// What is wrong with the n-th keyframe but for its features; nullptr: nothing.
const char* fault_of(const MapFile& file, std::uint32_t index, const Keyframe& keyframe,
                     std::uint32_t parent) noexcept {
    const MapFileInfo& info = file.info;
    if (!is_pose(keyframe.world_from_camera)) return "the pose of a keyframe";
    if (!is_slow(keyframe.speed) || !is_slow(keyframe.pose_by_readout)) return "the speed of a keyframe";
    if (!is_in(keyframe.readout_s, -kReadoutMax_s, kReadoutMax_s)) return "the readout of a keyframe";
    if (!is_in(keyframe.time_ns, std::int64_t{0}, info.time_ns) || keyframe.frame >= info.frames ||
        keyframe.last_useful_frame > info.frames) {
        return "the time of a keyframe";
    }
    // Up to the root, in as many steps as there are keyframes at most.
    for (std::uint32_t above = parent, steps = 0; above != 0; above = file.parent(above - 1), ++steps) {
        if (above > info.keyframes || steps > info.keyframes) return "the parent of a keyframe";
    }
    for (std::uint32_t other = 0; other < index; ++other) {
        if (file.frame(other) == keyframe.frame) return "two keyframes of one frame";
    }
    return nullptr;
}

// Which of a point's observers is its reference, in the upper half of its mark; its last observer in the lower.
constexpr std::uint64_t kObserver = 0xffffffffU;
constexpr std::uint64_t kReferenceSeen = std::uint64_t{1} << 63U;

// Features [first, end) of the k-th keyframe. What is wrong with one; nullptr: nothing.
const char* check_features(const MapFile& file, std::uint32_t k, std::uint32_t first, std::uint32_t end,
                           std::span<std::uint64_t> marks) noexcept {
    double readout_s = 0;
    const CameraModel camera = file.camera(readout_s);
    for (std::uint32_t i = first; i < end; ++i) {
        Observation observation;
        Descriptor descriptor;
        if (!file.feature(i, observation, descriptor) ||
            !is_feature(observation, bounds_of(file.info), camera.width, camera.height)) {
            return "a feature";
        }
        const std::uint32_t link = file.link(i);
        if (link == 0) continue;
        if (link > file.info.points) return "a link";
        std::uint64_t& mark = marks[link - 1];
        if ((mark & kObserver) == k + 1) return "a keyframe that shows a point twice";
        mark = (mark & ~kObserver) | (k + 1);
        if ((mark >> 32U & 0x7fffffffU) == k + 1) mark |= kReferenceSeen;
    }
    return nullptr;
}

// What is wrong with points, keyframes and features; nullptr: nothing.
const char* check_records(const MapFile& file, std::span<std::uint64_t> marks) noexcept {
    const MapFileInfo& info = file.info;
    for (std::uint32_t i = 0; i < info.points; ++i) {
        MapPoint point;
        std::uint32_t reference = 0;
        if (!file.point(i, point, reference) || !is_point(point, bounds_of(info)) || reference > info.keyframes)
            return "a point";
        marks[i] = std::uint64_t{reference} << 32U;
    }
    std::uint32_t roots = 0;
    std::uint32_t first = 0;  // feature of the keyframe, in the section
    std::uint32_t most = 0;
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        std::uint32_t parent = 0;
        const Keyframe keyframe = file.keyframe(k, parent);
        if (const char* const fault = fault_of(file, k, keyframe, parent); fault != nullptr) return fault;
        roots += parent == 0 ? 1U : 0U;
        if (keyframe.observations > info.features - first) return "the number of a keyframe's features";
        most = std::max(most, keyframe.observations);
        const std::uint32_t end = first + keyframe.observations;
        if (const char* const fault = check_features(file, k, first, end, marks); fault != nullptr) return fault;
        first = end;
    }
    if (first != info.features || most != info.features_of_keyframe) return "the number of a keyframe's features";
    if (roots != 1) return "the root of the keyframes";
    for (std::uint32_t i = 0; i < info.points; ++i) {
        const bool has_observers = (marks[i] & kObserver) != 0;
        const bool has_reference = (marks[i] >> 32U) != 0;
        if (has_observers != has_reference || (has_reference && (marks[i] & kReferenceSeen) == 0))
            return "the reference of a point";
    }
    return nullptr;
}

// What is wrong with the depth images, for a picture of this layout; nullptr: nothing. Any cell can be.
const char* check_depth(const MapFile& file, const DepthLayout& layout) noexcept {
    const MapFileInfo& info = file.info;
    if (info.depth_images == 0) return nullptr;
    if (info.depth_columns != layout.columns || info.depth_rows != layout.rows) return "the size of the depth images";
    for (std::uint32_t i = 0; i < info.depth_images; ++i) {
        DepthImages::Owner owner;
        std::uint32_t keyframe = 0;
        if (!file.depth(i, owner, keyframe) || !is_pose(owner.keyframe_from_camera) || owner.frame >= info.frames ||
            !is_in(keyframe, 1U, info.keyframes)) {
            return "a depth image";
        }
        for (std::uint32_t other = 0; other < i; ++other) {
            if (file.depth_frame(other) == owner.frame) return "two depth images of one frame";
        }
    }
    for (std::uint32_t i = 0; i < records_of(info, static_cast<std::uint32_t>(Section::kRays)); ++i) {
        ByteReader ray = file.record(Section::kRays, i);
        if (!is_in(ray.f32(), -kRayMax, kRayMax) || !is_in(ray.f32(), -kRayMax, kRayMax)) return "a ray";
    }
    return nullptr;
}

// Counts and sizes that a header of its version can have.
bool is_possible(const MapFileInfo& info, std::uint32_t version) noexcept {
    if (version != info.version() || info.depth_images > kDepthImagesMax) return false;
    const bool has_size = is_in<std::uint32_t>(info.depth_columns, 1, kDepthColumnsMax) &&
                          is_in<std::uint32_t>(info.depth_rows, 1, kDepthRowsMax);
    const bool has_none = info.depth_columns == 0 && info.depth_rows == 0;
    return (info.depth_images > 0 ? has_size : has_none) && info.size_bytes == file_bytes(info);
}

}  // namespace

Status read_map_header(std::span<const std::byte> bytes, MapFileInfo& info, MapFileProblem& problem) noexcept {
    if (bytes.empty() || !begins_with(bytes, kMapMagic)) return fail(problem, MapFault::kNoMap, "");
    ByteReader reader(bytes);
    static_cast<void>(reader.bytes(kMapMagic.size()));
    const std::uint32_t version = reader.u32();
    if (reader.is_ok() && version != kMapVersion && version != kMapVersionWithDepth)
        return fail(problem, MapFault::kOtherVersion, "", version, kMapVersionWithDepth);
    if (bytes.size() < kMapHeaderBytes) {
        return fail(problem, MapFault::kCutOff, "", static_cast<double>(bytes.size()),
                    static_cast<double>(kMapHeaderBytes));
    }
    ByteReader crc(bytes.subspan(kMapHeaderBytes - kCrcBytes));
    if (crc.u32() != crc32(bytes.first(kMapHeaderBytes - kCrcBytes)))
        return fail(problem, MapFault::kDamaged, "header");
    const std::uint32_t header_bytes = reader.u32();
    header_fields(reader, info);
    if (!reader.is_ok() || header_bytes != kMapHeaderBytes || !is_possible(info, version) ||
        !is_in(info.time_ns, std::int64_t{0}, kTimeMax_ns) || info.frames > kFramesMax) {
        return fail(problem, MapFault::kImpossible, "the header");
    }
    return Status::kOk;
}

Status check_map_file(std::span<const std::byte> bytes, const Limits& limits, const MapOrigin& origin, Map& map,
                      MapFileInfo& info, MapFileProblem& problem) noexcept {
    STILLMESH_TRY(read_map_header(bytes, info, problem));
    const struct {
        const char* key;
        std::uint32_t value, limit;
    } counts[] = {{"limits.keyframes_max", info.keyframes, limits.keyframes_max},
                  {"limits.map_points_max", info.points, limits.map_points_max},
                  {"limits.features_max", info.features_of_keyframe, limits.features_max}};
    for (const auto& count : counts) {
        if (count.value > count.limit) return fail(problem, MapFault::kTooManyFor, count.key, count.value, count.limit);
    }
    if (bytes.size() != info.size_bytes) {
        return fail(problem, bytes.size() < info.size_bytes ? MapFault::kCutOff : MapFault::kTooLong, "",
                    static_cast<double>(bytes.size()), static_cast<double>(info.size_bytes));
    }
    const MapFile file{bytes, info};
    STILLMESH_TRY(check_sections(file, problem));
    if (info.extractor != origin.extractor)
        return fail(problem, MapFault::kOtherExtractor, "", info.extractor, origin.extractor);
    if (info.pyramid_levels != origin.pyramid_levels)
        return fail(problem, MapFault::kOtherFeatures, "features.levels", info.pyramid_levels, origin.pyramid_levels);
    if (info.scale_factor != origin.scale_factor)
        return fail(problem, MapFault::kOtherFeatures, "features.scale_factor", info.scale_factor, origin.scale_factor);
    STILLMESH_TRY(check_camera(file, origin.camera, problem));
    const char* fault = info.keyframes == 0 ? "a map without keyframes" : check_records(file, map.scratch());
    if (fault == nullptr) fault = check_depth(file, depth_layout(origin.camera));
    return fault == nullptr ? Status::kOk : fail(problem, MapFault::kImpossible, fault);
}

}  // namespace stillmesh
