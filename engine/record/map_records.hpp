// The records of a map file, one function each way (docs/SPEC-map.md), and the places of the sections. Inner.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/bytes.hpp"
#include "engine/base/hash.hpp"
#include "engine/map/map.hpp"
#include "engine/record/map_file.hpp"

namespace stillmesh::map_records {

enum class Section : std::uint8_t { kCamera, kKeyframes, kPoints, kFeatures, kLinks };
inline constexpr std::uint32_t kSections = 5;
inline constexpr std::array<const char*, kSections> kNames = {"camera", "keyframes", "points", "features", "links"};
inline constexpr std::array<std::array<char, 4>, kSections> kTags = {
    {{'C', 'A', 'M', 'R'}, {'K', 'E', 'Y', 'F'}, {'P', 'N', 'T', 'S'}, {'F', 'E', 'A', 'T'}, {'L', 'I', 'N', 'K'}}};

inline constexpr std::size_t kSectionHeadBytes = 16;  // tag, count, size
inline constexpr std::size_t kCrcBytes = 4;
inline constexpr std::size_t kCameraBytes = 88;
inline constexpr std::size_t kKeyframeBytes = 328;
inline constexpr std::size_t kPointBytes = 184;
inline constexpr std::size_t kFeatureBytes = 64;
inline constexpr std::size_t kLinkBytes = 4;
inline constexpr std::array<std::size_t, kSections> kRecordBytes = {kCameraBytes, kKeyframeBytes, kPointBytes,
                                                                    kFeatureBytes, kLinkBytes};
inline constexpr std::size_t kKeyframeParentAt = 296;
inline constexpr std::size_t kKeyframeFrameAt = 312;
// Marks of use, which the hash of the content leaves out: 8 bytes at these places.
inline constexpr std::size_t kKeyframeUseAt = 320;
inline constexpr std::size_t kPointUseAt = 128;
inline constexpr std::array<std::size_t, kSections> kUseAt = {kCameraBytes, kKeyframeUseAt, kPointUseAt, kFeatureBytes,
                                                              kLinkBytes};

[[nodiscard]] constexpr std::uint32_t records_of(const MapFileInfo& info, std::uint32_t section) noexcept {
    switch (static_cast<Section>(section)) {
        case Section::kCamera: return 1;
        case Section::kKeyframes: return info.keyframes;
        case Section::kPoints: return info.points;
        case Section::kFeatures:
        case Section::kLinks: return info.features;
    }
    return 0;
}
[[nodiscard]] constexpr std::uint64_t section_bytes(const MapFileInfo& info, std::uint32_t section) noexcept {
    return std::uint64_t{records_of(info, section)} * kRecordBytes[section];
}
// Where a section's records begin, and (section kSections) where the file ends, in 64 bits.
[[nodiscard]] constexpr std::uint64_t records_at(const MapFileInfo& info, std::uint32_t section) noexcept {
    std::uint64_t at = kMapHeaderBytes;
    for (std::uint32_t s = 0; s < section; ++s) at += kSectionHeadBytes + section_bytes(info, s) + kCrcBytes;
    return section == kSections ? at : at + kSectionHeadBytes;
}

inline void write_camera(ByteWriter& out, const CameraModel& c, double readout_s) noexcept {
    out.u32(c.width);
    out.u32(c.height);
    for (const double number : {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3}) out.f64(number);
    out.f64(readout_s);
}
[[nodiscard]] inline CameraModel read_camera(ByteReader& in, double& readout_s) noexcept {
    CameraModel c;
    c.width = in.u32();
    c.height = in.u32();
    for (double* number : {&c.fx, &c.fy, &c.cx, &c.cy, &c.k1, &c.k2, &c.p1, &c.p2, &c.k3}) *number = in.f64();
    readout_s = in.f64();
    return c;
}

inline void write_pose(ByteWriter& out, const SE3& pose) noexcept {
    for (int i = 0; i < 9; ++i) out.f64(pose.rotation(i / 3, i % 3));
    for (int i = 0; i < 3; ++i) out.f64(pose.translation(i));
}
[[nodiscard]] inline SE3 read_pose(ByteReader& in) noexcept {
    SE3 pose;
    for (int i = 0; i < 9; ++i) pose.rotation(i / 3, i % 3) = in.f64();
    for (int i = 0; i < 3; ++i) pose.translation(i) = in.f64();
    return pose;
}

inline void write_vector(ByteWriter& out, const Vector6& v) noexcept {
    for (int i = 0; i < 6; ++i) out.f64(v(i));
}
[[nodiscard]] inline Vector6 read_vector(ByteReader& in) noexcept {
    Vector6 v;
    for (int i = 0; i < 6; ++i) v(i) = in.f64();
    return v;
}

// `parent_plus_one`: place of the parent among the keyframes, plus one; 0: the root. Handles are not read or written.
inline void write_keyframe(ByteWriter& out, const Keyframe& k, std::uint32_t parent_plus_one) noexcept {
    write_pose(out, k.world_from_camera);
    write_pose(out, SE3{});  // once that of its parent: readers pass over it
    write_vector(out, k.pose_by_readout);
    write_vector(out, k.speed);
    out.f64(k.readout_s);
    out.u32(parent_plus_one);
    out.u32(k.observations);
    out.i64(k.time_ns);
    out.u64(k.frame);
    out.u64(k.last_useful_frame);
}
inline void read_keyframe(ByteReader& in, Keyframe& k, std::uint32_t& parent_plus_one) noexcept {
    k.world_from_camera = read_pose(in);
    static_cast<void>(read_pose(in));
    k.pose_by_readout = read_vector(in);
    k.speed = read_vector(in);
    k.readout_s = in.f64();
    parent_plus_one = in.u32();
    k.observations = in.u32();
    k.time_ns = in.i64();
    k.frame = in.u64();
    k.last_useful_frame = in.u64();
}

inline void write_point(ByteWriter& out, const MapPoint& p, std::uint32_t reference_plus_one) noexcept {
    for (const double w : p.world) out.f64(w);
    for (const double a : p.anchor) out.f64(a);
    for (const double v : {p.var_z, p.var_lateral, p.anchor_var_z, p.anchor_var_lateral}) out.f64(v);
    for (const std::uint64_t word : p.descriptor.words) out.u64(word);
    out.i64(p.created_ns);
    out.i64(p.anchor_ns);
    out.u64(p.last_seen_frame);
    out.u32(reference_plus_one);
    out.f32(p.distance_m);
    out.f32(p.angle_rad);
    out.u16(p.seen);
    out.u8(p.level);
    out.u8(p.weight_tenths);
    out.u8(p.empty_views);
    out.u8(p.is_suspect ? 1 : 0);
    out.u16(0);
    for (const float d : p.world_by_readout) out.f32(d);
    for (const float d : p.anchor_by_readout) out.f32(d);
    out.u32(0);
}
// False: a byte that must be 0, or 0 or 1, is not. `observers` stays 0.
[[nodiscard]] inline bool read_point(ByteReader& in, MapPoint& p, std::uint32_t& reference_plus_one) noexcept {
    for (double& w : p.world) w = in.f64();
    for (double& a : p.anchor) a = in.f64();
    for (double* v : {&p.var_z, &p.var_lateral, &p.anchor_var_z, &p.anchor_var_lateral}) *v = in.f64();
    for (std::uint64_t& word : p.descriptor.words) word = in.u64();
    p.created_ns = in.i64();
    p.anchor_ns = in.i64();
    p.last_seen_frame = in.u64();
    reference_plus_one = in.u32();
    p.distance_m = in.f32();
    p.angle_rad = in.f32();
    p.seen = in.u16();
    p.level = in.u8();
    p.weight_tenths = in.u8();
    p.empty_views = in.u8();
    const std::uint8_t is_suspect = in.u8();
    p.is_suspect = is_suspect == 1;
    const std::uint16_t zero = in.u16();
    for (float& d : p.world_by_readout) d = in.f32();
    for (float& d : p.anchor_by_readout) d = in.f32();
    return zero == 0 && in.u32() == 0 && is_suspect <= 1;
}

inline void write_feature(ByteWriter& out, const Observation& o, const Descriptor& d) noexcept {
    for (const float number : {o.x, o.y, o.normalised_x, o.normalised_y, o.z_m, o.var_z, o.angle_rad}) out.f32(number);
    out.u8(o.level);
    out.u8(o.looks);
    out.u16(0);
    for (const std::uint64_t word : d.words) out.u64(word);
}
// False: a byte that must be 0 is not, or one that must not be. `o.point` is not touched.
[[nodiscard]] inline bool read_feature(ByteReader& in, Observation& o, Descriptor& d) noexcept {
    for (float* number : {&o.x, &o.y, &o.normalised_x, &o.normalised_y, &o.z_m, &o.var_z, &o.angle_rad}) {
        *number = in.f32();
    }
    o.level = in.u8();
    o.looks = in.u8();
    const std::uint16_t zeros = in.u16();
    for (std::uint64_t& word : d.words) word = in.u64();
    return o.looks != 0 && zeros == 0;
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
