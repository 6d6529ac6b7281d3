// A map file's bytes, record by record: for those that check them and those that make a map of them. Inner.
#pragma once

#include <cstdint>
#include <span>

#include "engine/record/map_checks.hpp"
#include "engine/record/map_records.hpp"

namespace stillmesh::map_records {

[[nodiscard]] inline map_checks::MapBounds bounds_of(const MapFileInfo& info) noexcept {
    return {info.time_ns, info.frames, info.pyramid_levels};
}

// A file, record by record.
struct MapFile {
    std::span<const std::byte> bytes;
    const MapFileInfo& info;

    // The n-th record of a section, from the byte `at` of it on.
    [[nodiscard]] ByteReader record(Section section, std::uint32_t index, std::size_t at = 0) const noexcept {
        const auto s = static_cast<std::uint32_t>(section);
        const std::size_t begin =
            static_cast<std::size_t>(records_at(info, s)) + std::size_t{index} * record_bytes(info, s);
        return ByteReader(bytes.subspan(begin + at, record_bytes(info, s) - at));
    }
    [[nodiscard]] Keyframe keyframe(std::uint32_t index, std::uint32_t& parent_plus_one) const noexcept {
        ByteReader reader = record(Section::kKeyframes, index);
        Keyframe keyframe;
        keyframe_fields(reader, keyframe, parent_plus_one);
        return keyframe;
    }
    // Single fields, for loops within loops.
    [[nodiscard]] std::uint32_t parent(std::uint32_t index) const noexcept {
        return record(Section::kKeyframes, index, kKeyframeParentAt).u32();
    }
    [[nodiscard]] std::uint64_t frame(std::uint32_t index) const noexcept {
        return record(Section::kKeyframes, index, kKeyframeFrameAt).u64();
    }
    [[nodiscard]] std::uint32_t link(std::uint32_t index) const noexcept {
        return record(Section::kLinks, index).u32();
    }
    // False: a byte of it cannot be.
    [[nodiscard]] bool point(std::uint32_t index, MapPoint& point, std::uint32_t& reference_plus_one) const noexcept {
        ByteReader reader = record(Section::kPoints, index);
        point_fields(reader, point, reference_plus_one);
        return reader.is_ok();
    }
    [[nodiscard]] bool feature(std::uint32_t index, Observation& observation, Descriptor& descriptor) const noexcept {
        ByteReader reader = record(Section::kFeatures, index);
        feature_fields(reader, observation, descriptor);
        return reader.is_ok();
    }
    // Likewise.
    [[nodiscard]] bool depth(std::uint32_t index, DepthImages::Owner& owner,
                             std::uint32_t& keyframe_plus_one) const noexcept {
        ByteReader reader = record(Section::kDepth, index);
        depth_fields(reader, owner, keyframe_plus_one);
        return reader.is_ok();
    }
    [[nodiscard]] std::uint64_t depth_frame(std::uint32_t index) const noexcept {
        return record(Section::kDepth, index, kDepthFrameAt).u64();
    }
    // What a depth image is worth where there is no room for all: what a keyframe saw itself, then what is new.
    [[nodiscard]] std::uint64_t depth_worth(std::uint32_t index) const noexcept {
        const bool is_later = record(Section::kDepth, index, kDepthLaterAt).u8() != 0;
        return depth_frame(index) + (is_later ? 0U : 2 * map_checks::kFramesMax);
    }
    [[nodiscard]] CameraModel camera(double& readout_s) const noexcept {
        ByteReader reader = record(Section::kCamera, 0);
        CameraModel camera;
        camera_fields(reader, camera);
        readout_s = reader.f64();
        return camera;
    }
};

}  // namespace stillmesh::map_records
