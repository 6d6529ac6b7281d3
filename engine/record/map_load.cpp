#include "engine/record/map_load.hpp"

#include <algorithm>
#include <array>

#include "engine/record/map_checks.hpp"

namespace stillmesh {
namespace {

using namespace map_checks;
using namespace map_records;

Status fail(MapFileProblem& problem, Status status, MapFault fault, const char* part, double value = 0,
            double limit = 0) noexcept {
    problem = {fault, part, value, limit};
    return status;
}

MapBounds bounds_of(const MapFileInfo& info) noexcept {
    return {info.time_ns, info.frames, info.pyramid_levels};
}

// The n-th record of a section.
std::span<const std::byte> record_of(std::span<const std::byte> bytes, const MapFileInfo& info, Section section,
                                     std::uint32_t index) noexcept {
    const auto s = static_cast<std::uint32_t>(section);
    return bytes.subspan(static_cast<std::size_t>(records_at(info, s)) + index * kRecordBytes[s], kRecordBytes[s]);
}
Keyframe keyframe_at(std::span<const std::byte> bytes, const MapFileInfo& info, std::uint32_t index,
                     std::uint32_t& parent_plus_one) noexcept {
    ByteReader reader(record_of(bytes, info, Section::kKeyframes, index));
    Keyframe keyframe;
    read_keyframe(reader, keyframe, parent_plus_one);
    return keyframe;
}
// Single fields, for loops within loops.
std::uint32_t parent_at(std::span<const std::byte> bytes, const MapFileInfo& info, std::uint32_t index) noexcept {
    return ByteReader(record_of(bytes, info, Section::kKeyframes, index).subspan(kKeyframeParentAt)).u32();
}
std::uint64_t frame_at(std::span<const std::byte> bytes, const MapFileInfo& info, std::uint32_t index) noexcept {
    return ByteReader(record_of(bytes, info, Section::kKeyframes, index).subspan(kKeyframeFrameAt)).u64();
}
bool point_at(std::span<const std::byte> bytes, const MapFileInfo& info, std::uint32_t index, MapPoint& point,
              std::uint32_t& reference_plus_one) noexcept {
    ByteReader reader(record_of(bytes, info, Section::kPoints, index));
    return read_point(reader, point, reference_plus_one);
}
std::uint32_t link_at(std::span<const std::byte> bytes, const MapFileInfo& info, std::uint32_t index) noexcept {
    return ByteReader(record_of(bytes, info, Section::kLinks, index)).u32();
}

Status check_sections(std::span<const std::byte> bytes, const MapFileInfo& info, MapFileProblem& problem) noexcept {
    for (std::uint32_t s = 0; s < kSections; ++s) {
        const auto begin = static_cast<std::size_t>(records_at(info, s)) - kSectionHeadBytes;
        const std::size_t size = kSectionHeadBytes + static_cast<std::size_t>(section_bytes(info, s));
        ByteReader reader(bytes.subspan(begin, size + kCrcBytes));
        bool is_right = true;
        for (const char letter : kTags[s]) is_right = reader.u8() == static_cast<std::uint8_t>(letter) && is_right;
        is_right = reader.u32() == records_of(info, s) && is_right;
        is_right = reader.u64() == section_bytes(info, s) && is_right;
        ByteReader crc(bytes.subspan(begin + size, kCrcBytes));
        if (!is_right || crc.u32() != crc32(bytes.subspan(begin, size))) {
            return fail(problem, Status::kCorrupt, MapFault::kDamaged, kNames[s]);
        }
    }
    return Status::kOk;
}

Status check_camera(std::span<const std::byte> bytes, const MapFileInfo& info, const CameraModel& ours,
                    MapFileProblem& problem) noexcept {
    ByteReader reader(record_of(bytes, info, Section::kCamera, 0));
    double readout_s = 0;
    const CameraModel c = read_camera(reader, readout_s);
    if (!is_in(readout_s, -kReadoutMax_s, kReadoutMax_s)) {
        return fail(problem, Status::kCorrupt, MapFault::kImpossible, "the readout of the camera");
    }
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
        return fail(problem, Status::kInvalid, MapFault::kOtherCamera, number.name, number.value, number.ours);
    }
    return Status::kOk;
}

Status check_keyframes(std::span<const std::byte> bytes, const MapFileInfo& info, const CameraModel& camera,
                       std::span<std::uint64_t> marks, MapFileProblem& problem) noexcept {
    const auto impossible = [&](const char* what) {
        return fail(problem, Status::kCorrupt, MapFault::kImpossible, what);
    };
    // Which of a point's observers is its reference, in the upper half of its mark; its last observer in the lower.
    for (std::uint32_t i = 0; i < info.points; ++i) {
        MapPoint point;
        std::uint32_t reference = 0;
        if (!point_at(bytes, info, i, point, reference) || !is_point(point, bounds_of(info)) ||
            reference > info.keyframes) {
            return impossible("a point");
        }
        marks[i] = std::uint64_t{reference} << 32U;
    }
    constexpr std::uint64_t kReferenceSeen = std::uint64_t{1} << 63U;
    std::uint32_t roots = 0;
    std::uint32_t first = 0;  // feature of the keyframe, in the section
    std::uint32_t most = 0;
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        std::uint32_t parent = 0;
        const Keyframe keyframe = keyframe_at(bytes, info, k, parent);
        if (!is_pose(keyframe.world_from_camera)) return impossible("the pose of a keyframe");
        if (!is_slow(keyframe.speed) || !is_slow(keyframe.pose_by_readout)) {
            return impossible("the speed of a keyframe");
        }
        if (!is_in(keyframe.readout_s, -kReadoutMax_s, kReadoutMax_s)) return impossible("the readout of a keyframe");
        if (!is_in(keyframe.time_ns, std::int64_t{0}, info.time_ns) || keyframe.frame >= info.frames ||
            keyframe.last_useful_frame >= info.frames) {
            return impossible("the time of a keyframe");
        }
        if (parent > info.keyframes) return impossible("the parent of a keyframe");
        roots += parent == 0 ? 1U : 0U;
        // Up to the root, in as many steps as there are keyframes at most.
        std::uint32_t above = parent;
        for (std::uint32_t steps = 0; above != 0; ++steps) {
            const std::uint32_t next = parent_at(bytes, info, above - 1);
            if (next > info.keyframes || steps > info.keyframes) return impossible("the parent of a keyframe");
            above = next;
        }
        for (std::uint32_t other = 0; other < k; ++other) {
            if (frame_at(bytes, info, other) == keyframe.frame) return impossible("two keyframes of one frame");
        }
        if (keyframe.observations > info.features - first || keyframe.observations > info.features_of_keyframe) {
            return impossible("the number of a keyframe's features");
        }
        most = std::max(most, keyframe.observations);
        for (std::uint32_t i = first; i < first + keyframe.observations; ++i) {
            ByteReader reader(record_of(bytes, info, Section::kFeatures, i));
            Observation observation;
            Descriptor descriptor;
            if (!read_feature(reader, observation, descriptor) ||
                !is_feature(observation, bounds_of(info), camera.width, camera.height)) {
                return impossible("a feature");
            }
            const std::uint32_t link = link_at(bytes, info, i);
            if (link == 0) continue;
            if (link > info.points) return impossible("a link");
            std::uint64_t& mark = marks[link - 1];
            if ((mark & 0xffffffffU) == k + 1) return impossible("a keyframe that shows a point twice");
            mark = (mark & ~std::uint64_t{0xffffffffU}) | (k + 1);
            if ((mark >> 32U & 0x7fffffffU) == k + 1) mark |= kReferenceSeen;
        }
        first += keyframe.observations;
    }
    if (first != info.features || most != info.features_of_keyframe) {
        return impossible("the number of a keyframe's features");
    }
    if (roots != (info.keyframes > 0 ? 1U : 0U)) return impossible("the root of the keyframes");
    for (std::uint32_t i = 0; i < info.points; ++i) {
        const bool has_observers = (marks[i] & 0xffffffffU) != 0;
        const bool has_reference = (marks[i] >> 32U) != 0;
        if (has_observers != has_reference || (has_reference && (marks[i] & kReferenceSeen) == 0)) {
            return impossible("the reference of a point");
        }
    }
    return Status::kOk;
}

}  // namespace

Status read_map_header(std::span<const std::byte> bytes, MapFileInfo& info, MapFileProblem& problem) noexcept {
    ByteReader reader(bytes);
    for (std::size_t i = 0; i < kMapMagic.size(); ++i) {
        if (i == bytes.size() && i > 0) break;  // cut off inside the letters
        if (reader.u8() != static_cast<std::uint8_t>(kMapMagic[i])) {
            return fail(problem, Status::kNotFound, MapFault::kNoMap, "");
        }
    }
    const std::uint32_t version = reader.u32();
    if (reader.is_ok() && version != kMapVersion) {
        return fail(problem, Status::kInvalid, MapFault::kOtherVersion, "", static_cast<double>(version),
                    static_cast<double>(kMapVersion));
    }
    if (bytes.size() < kMapHeaderBytes) {
        return fail(problem, Status::kEnd, MapFault::kCutOff, "", static_cast<double>(bytes.size()),
                    static_cast<double>(kMapHeaderBytes));
    }
    const std::uint32_t header_bytes = reader.u32();
    info.size_bytes = reader.u64();
    info.keyframes = reader.u32();
    info.points = reader.u32();
    info.features = reader.u32();
    info.features_of_keyframe = reader.u32();
    info.pyramid_levels = reader.u32();
    const std::uint32_t extractor = reader.u32();
    info.extractor = static_cast<std::uint8_t>(extractor);
    info.scale_factor = reader.f64();
    info.time_ns = reader.i64();
    info.frames = reader.u64();
    info.hash = reader.u64();
    const std::uint64_t zero = reader.u64();
    const std::uint32_t zeros = reader.u32();
    const std::uint32_t wanted = crc32(bytes.first(reader.position()));
    if (reader.u32() != wanted) return fail(problem, Status::kCorrupt, MapFault::kDamaged, "header");
    if (header_bytes != kMapHeaderBytes || zero != 0 || zeros != 0 || extractor > 255 ||
        info.size_bytes != records_at(info, kSections) || !is_in(info.time_ns, std::int64_t{0}, kTimeMax_ns) ||
        info.frames > kFramesMax) {
        return fail(problem, Status::kCorrupt, MapFault::kImpossible, "the header");
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
        if (count.value > count.limit) {
            return fail(problem, Status::kFull, MapFault::kTooManyFor, count.key, static_cast<double>(count.value),
                        static_cast<double>(count.limit));
        }
    }
    if (bytes.size() != info.size_bytes) {
        const bool is_short = bytes.size() < info.size_bytes;
        return fail(problem, is_short ? Status::kEnd : Status::kCorrupt,
                    is_short ? MapFault::kCutOff : MapFault::kTooLong, "", static_cast<double>(bytes.size()),
                    static_cast<double>(info.size_bytes));
    }
    STILLMESH_TRY(check_sections(bytes, info, problem));
    if (info.extractor != origin.extractor) {
        return fail(problem, Status::kInvalid, MapFault::kOtherExtractor, "", static_cast<double>(info.extractor),
                    static_cast<double>(origin.extractor));
    }
    if (info.pyramid_levels != origin.pyramid_levels) {
        return fail(problem, Status::kInvalid, MapFault::kOtherFeatures, "features.levels",
                    static_cast<double>(info.pyramid_levels), static_cast<double>(origin.pyramid_levels));
    }
    if (info.scale_factor != origin.scale_factor) {
        return fail(problem, Status::kInvalid, MapFault::kOtherFeatures, "features.scale_factor", info.scale_factor,
                    origin.scale_factor);
    }
    STILLMESH_TRY(check_camera(bytes, info, origin.camera, problem));
    if (info.keyframes == 0) return fail(problem, Status::kCorrupt, MapFault::kImpossible, "a map without keyframes");
    return check_keyframes(bytes, info, origin.camera, map.scratch(), problem);
}

void restore_map(std::span<const std::byte> bytes, const MapFileInfo& info, Map& map) noexcept {
    map.reset();
    // A pool that was just reset gives its slots in order: the n-th of the file gets slot n.
    for (std::uint32_t i = 0; i < info.points; ++i) {
        const Result<Handle<MapPoint>> taken = map.add_point();
        STILLMESH_CHECK(taken.is_ok() && taken.value().slot() == i);
        std::uint32_t reference = 0;
        STILLMESH_CHECK(point_at(bytes, info, i, map.points().at(i), reference));
    }
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        const Handle<Keyframe> handle = map.add_keyframe();
        STILLMESH_CHECK(!handle.is_null() && handle.slot() == k);
    }
    std::uint32_t at = 0;
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        std::uint32_t parent = 0;
        Keyframe& keyframe = map.keyframes().at(k);
        const Keyframe read = keyframe_at(bytes, info, k, parent);
        const std::uint32_t end = at + read.observations;
        keyframe = read;
        keyframe.observations = 0;
        if (parent != 0) keyframe.parent = map.keyframes().handle_of(parent - 1);
        for (; at < end; ++at) {
            ByteReader reader(record_of(bytes, info, Section::kFeatures, at));
            Observation observation;
            Descriptor descriptor;
            STILLMESH_CHECK(read_feature(reader, observation, descriptor));
            const std::uint32_t link = link_at(bytes, info, at);
            if (link != 0) observation.point = map.points().handle_of(link - 1);
            map.add_observation(map.keyframes().handle_of(k), observation, descriptor);
        }
    }
    for (std::uint32_t i = 0; i < info.points; ++i) {
        MapPoint point;
        std::uint32_t reference = 0;
        STILLMESH_CHECK(point_at(bytes, info, i, point, reference));
        map.points().at(i).reference = reference == 0 ? Handle<Keyframe>{} : map.keyframes().handle_of(reference - 1);
    }
    ByteReader camera(record_of(bytes, info, Section::kCamera, 0));
    double readout_s = 0;
    static_cast<void>(read_camera(camera, readout_s));
    map.begin_with_readout(readout_s);
    map.note_change(info.hash);
}

}  // namespace stillmesh
