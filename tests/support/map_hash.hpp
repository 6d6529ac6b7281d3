// The hash that the file of a map would carry, of the map itself: written apart from what writes the file.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/record/map_records.hpp"

namespace stillmesh::test {

inline std::uint64_t map_hash(const Map& map, const CameraModel& camera) {
    using namespace map_records;
    // Places in the file, by slot: of points, and of keyframes counted anew each time.
    std::vector<std::uint64_t> places(map.points().slots_count());
    std::uint64_t place = 0;
    for (std::uint32_t slot = 0; slot < map.points().slots_count(); ++slot) {
        places[slot] = map.points().is_taken(slot) ? ++place : 0;
    }
    const Pool<Keyframe>& keyframes = map.keyframes();
    const auto keyframe_place = [&](Handle<Keyframe> handle) {
        std::uint32_t out = 0;
        if (keyframes.find(handle) == nullptr) return out;
        for (std::uint32_t slot = 0; slot <= handle.slot(); ++slot) out += keyframes.is_taken(slot) ? 1U : 0U;
        return out;
    };
    StateHash hash;
    std::array<std::byte, kMapPieceBytesMin> buffer{};
    const auto add = [&](Section section, auto&& write) {
        ByteWriter writer(buffer);
        write(writer);
        add_record(hash, static_cast<std::uint32_t>(section), writer.written());
    };
    const auto each_keyframe = [&](auto&& visit) {
        for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
            if (keyframes.is_taken(slot)) visit(keyframes.handle_of(slot));
        }
    };
    add(Section::kCamera, [&](ByteWriter& out) {
        camera_fields(out, camera);
        out.f64(map.readout_s());
    });
    each_keyframe([&](Handle<Keyframe> handle) {
        const Keyframe& keyframe = *keyframes.find(handle);
        add(Section::kKeyframes,
            [&](ByteWriter& out) { keyframe_fields(out, keyframe, keyframe_place(keyframe.parent)); });
    });
    for (std::uint32_t slot = 0; slot < map.points().slots_count(); ++slot) {
        if (places[slot] == 0) continue;
        const MapPoint& point = map.points().at(slot);
        add(Section::kPoints, [&](ByteWriter& out) { point_fields(out, point, keyframe_place(point.reference)); });
    }
    each_keyframe([&](Handle<Keyframe> handle) {
        const std::span<const Observation> observations = map.observations(handle);
        for (std::size_t i = 0; i < observations.size(); ++i) {
            add(Section::kFeatures,
                [&](ByteWriter& out) { feature_fields(out, observations[i], map.descriptors(handle)[i]); });
        }
    });
    each_keyframe([&](Handle<Keyframe> handle) {
        for (const Observation& o : map.observations(handle)) {
            const bool is_alive = map.points().find(o.point) != nullptr;
            add(Section::kLinks,
                [&](ByteWriter& out) { out.u32(is_alive ? static_cast<std::uint32_t>(places[o.point.slot()]) : 0U); });
        }
    });
    return hash.value();
}

}  // namespace stillmesh::test
