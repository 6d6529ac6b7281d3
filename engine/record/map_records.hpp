// The records of a map file, one list of fields for both ways (docs/SPEC-map.md), and the places of the sections.
// Inner.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "engine/base/hash.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/map/depth_images.hpp"
#include "engine/map/map.hpp"
#include "engine/record/map_file.hpp"

namespace stillmesh::map_records {

// The last three are there in a file with depth images.
enum class Section : std::uint8_t { kCamera, kKeyframes, kPoints, kFeatures, kLinks, kDepth, kRays, kCells };
inline constexpr std::uint32_t kSections = 8;
inline constexpr std::uint32_t kHashedSections = 5;  // the content that the hash is of
inline constexpr std::array<const char*, kSections> kNames = {"camera", "keyframes",    "points", "features",
                                                              "links",  "depth images", "rays",   "depth cells"};
inline constexpr std::array<std::array<char, 4>, kSections> kTags = {{{'C', 'A', 'M', 'R'},
                                                                      {'K', 'E', 'Y', 'F'},
                                                                      {'P', 'N', 'T', 'S'},
                                                                      {'F', 'E', 'A', 'T'},
                                                                      {'L', 'I', 'N', 'K'},
                                                                      {'D', 'P', 'T', 'H'},
                                                                      {'R', 'A', 'Y', 'S'},
                                                                      {'C', 'E', 'L', 'L'}}};

inline constexpr std::size_t kSectionHeadBytes = 16;  // tag, count, size
inline constexpr std::size_t kCrcBytes = 4;
inline constexpr std::size_t kCameraBytes = 88;
inline constexpr std::size_t kKeyframeBytes = 328;
inline constexpr std::size_t kPointBytes = 184;
inline constexpr std::size_t kFeatureBytes = 64;
inline constexpr std::size_t kLinkBytes = 4;
inline constexpr std::size_t kDepthBytes = 112;
inline constexpr std::size_t kDepthFrameAt = 96;
inline constexpr std::size_t kDepthLaterAt = 108;
inline constexpr std::size_t kRayBytes = 8;
inline constexpr std::uint32_t kDepthImagesMax = 1024;  // as limits.depth_images_max
inline constexpr std::size_t kKeyframeParentAt = 296;
inline constexpr std::size_t kKeyframeFrameAt = 312;
// Marks of use, which the hash of the content leaves out: 8 bytes at these places.
inline constexpr std::size_t kKeyframeUseAt = 320;
inline constexpr std::size_t kPointUseAt = 128;
inline constexpr std::array<std::size_t, kHashedSections> kUseAt = {kCameraBytes, kKeyframeUseAt, kPointUseAt,
                                                                    kFeatureBytes, kLinkBytes};

[[nodiscard]] constexpr std::uint32_t sections_of(const MapFileInfo& info) noexcept {
    return info.depth_images == 0 ? kHashedSections : kSections;
}
[[nodiscard]] constexpr std::uint32_t records_of(const MapFileInfo& info, std::uint32_t section) noexcept {
    switch (static_cast<Section>(section)) {
        case Section::kCamera: return 1;
        case Section::kKeyframes: return info.keyframes;
        case Section::kPoints: return info.points;
        case Section::kFeatures:
        case Section::kLinks: return info.features;
        case Section::kDepth: return info.depth_images;
        case Section::kRays: return std::uint32_t{info.depth_columns} * info.depth_rows;
        case Section::kCells: return info.depth_images * info.depth_rows;  // a row each
    }
    return 0;
}
[[nodiscard]] constexpr std::size_t record_bytes(const MapFileInfo& info, std::uint32_t section) noexcept {
    switch (static_cast<Section>(section)) {
        case Section::kCamera: return kCameraBytes;
        case Section::kKeyframes: return kKeyframeBytes;
        case Section::kPoints: return kPointBytes;
        case Section::kFeatures: return kFeatureBytes;
        case Section::kLinks: return kLinkBytes;
        case Section::kDepth: return kDepthBytes;
        case Section::kRays: return kRayBytes;
        case Section::kCells: return std::size_t{2} * info.depth_columns;
    }
    return 0;
}
[[nodiscard]] constexpr std::uint64_t section_bytes(const MapFileInfo& info, std::uint32_t section) noexcept {
    return std::uint64_t{records_of(info, section)} * record_bytes(info, section);
}
// Where a section begins, or (section sections_of(info)) the file ends, in 64 bits; and where its records do.
[[nodiscard]] constexpr std::uint64_t section_at(const MapFileInfo& info, std::uint32_t section) noexcept {
    std::uint64_t at = kMapHeaderBytes;
    for (std::uint32_t s = 0; s < section; ++s) at += kSectionHeadBytes + section_bytes(info, s) + kCrcBytes;
    return at;
}
[[nodiscard]] constexpr std::uint64_t records_at(const MapFileInfo& info, std::uint32_t section) noexcept {
    return section_at(info, section) + kSectionHeadBytes;
}
[[nodiscard]] constexpr std::uint64_t file_bytes(const MapFileInfo& info) noexcept {
    return section_at(info, sections_of(info));
}

// The fields of each record, for a ByteWriter and a ByteReader alike; handles are not read or written.
template <typename Bytes, typename Info>
void header_fields(Bytes& bytes, Info& info) noexcept {
    bytes.fields(info.size_bytes, info.keyframes, info.points, info.features, info.features_of_keyframe);
    bytes.fields(info.pyramid_levels);
    bytes.template field_as<std::uint32_t>(info.extractor);
    bytes.fields(info.scale_factor, info.time_ns, info.frames, info.hash, info.lens_crc);
    bytes.fields(info.depth_images, info.depth_columns, info.depth_rows);
}

// Lenses came after the camera's record, which has no place for them. 0: Brown's without k4 to k6.
[[nodiscard]] inline std::uint32_t lens_crc_of(const CameraModel& c) noexcept {
    if (c.is_plain_brown()) return 0;
    std::array<std::byte, 25> bytes{};
    ByteWriter writer(bytes);
    writer.u8(static_cast<std::uint8_t>(c.lens));
    writer.fields(c.k4, c.k5, c.k6);
    return crc32(writer.written());
}

template <typename Bytes, typename Camera>
void camera_fields(Bytes& bytes, Camera& c) noexcept {
    bytes.fields(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3);
}

// Row by row.
template <typename Bytes, typename Matrix>
void matrix_fields(Bytes& bytes, Matrix&& m) noexcept {
    for (int r = 0; r < m.rows(); ++r) {
        for (int c = 0; c < m.cols(); ++c) bytes.fields(m(r, c));
    }
}
template <typename Bytes, typename Pose>
void pose_fields(Bytes& bytes, Pose& pose) noexcept {
    matrix_fields(bytes, pose.rotation);
    matrix_fields(bytes, pose.translation);
}

// `parent_plus_one`: place of the parent among the keyframes, plus one; 0: the root.
template <typename Bytes, typename K, typename Place>
void keyframe_fields(Bytes& bytes, K& k, Place&& parent_plus_one) noexcept {
    pose_fields(bytes, k.world_from_camera);
    SE3 unused;  // once that of its parent: readers pass over it
    pose_fields(bytes, unused);
    matrix_fields(bytes, k.pose_by_readout);
    matrix_fields(bytes, k.speed);
    bytes.fields(k.readout_s, parent_plus_one, k.observations, k.time_ns, k.frame, k.last_useful_frame);
}

// `observers` stays 0.
template <typename Bytes, typename Point, typename Place>
void point_fields(Bytes& bytes, Point& p, Place&& reference_plus_one) noexcept {
    bytes.fields(p.world, p.anchor, p.var_z, p.var_lateral, p.anchor_var_z, p.anchor_var_lateral);
    bytes.fields(p.descriptor.words, p.created_ns, p.anchor_ns, p.last_seen_frame, reference_plus_one);
    bytes.fields(p.distance_m, p.angle_rad, p.seen, p.level, p.weight_tenths, p.empty_views, p.is_suspect);
    bytes.zeros(2);
    bytes.fields(p.world_by_readout, p.anchor_by_readout);
    bytes.zeros(4);
}

template <typename Bytes, typename Seen, typename D>
void feature_fields(Bytes& bytes, Seen& o, D& d) noexcept {
    bytes.fields(o.x, o.y, o.normalised_x, o.normalised_y, o.z_m, o.var_z, o.angle_rad, o.level, o.averaged);
    bytes.zeros(2);
    bytes.fields(d.words);
}

template <typename Bytes, typename Owner, typename Place>
void depth_fields(Bytes& bytes, Owner& o, Place&& keyframe_plus_one) noexcept {
    pose_fields(bytes, o.keyframe_from_camera);
    bytes.fields(o.frame, keyframe_plus_one, o.is_later);
    bytes.zeros(3);
}

// The hash of the content, record by record: its 64-bit words without the mark of use, or its one 32-bit word.
inline void add_record(StateHash& hash, std::uint32_t section, std::span<const std::byte> record) noexcept {
    ByteReader in(record);
    if (record.size() % 8 != 0) {
        hash.add(in.u32());
        return;
    }
    while (in.remaining() > 0) {
        const bool is_use = in.position() == kUseAt[section];
        const std::uint64_t word = in.u64();
        if (!is_use) hash.add(word);
    }
}

}  // namespace stillmesh::map_records
