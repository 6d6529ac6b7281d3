#include "engine/record/map_bytes.hpp"
#include "engine/record/map_load.hpp"

namespace stillmesh {
namespace {

using namespace map_records;

// Whether there is room for it among `places`: fewer than that are worth more.
bool is_kept(const MapFile& file, std::uint32_t index, std::size_t places) noexcept {
    if (file.info.depth_images <= places) return true;
    const std::uint64_t worth = file.depth_worth(index);
    std::size_t better = 0;
    for (std::uint32_t other = 0; other < file.info.depth_images; ++other)
        better += file.depth_worth(other) > worth ? 1U : 0U;
    return better < places;
}

// The cells of its n-th depth image.
void read_cells(const MapFile& file, std::uint32_t index, std::span<std::uint16_t> depth_mm) noexcept {
    const MapFileInfo& info = file.info;
    for (std::uint32_t row = 0; row < info.depth_rows; ++row) {
        ByteReader cells = file.record(Section::kCells, index * info.depth_rows + row);
        for (std::uint16_t& mm : depth_mm.first(info.depth_columns)) mm = cells.u16();
        depth_mm = depth_mm.subspan(info.depth_columns);
    }
}

// The records of a file into slots behind those that are taken: a pool that has released nothing since it was reset
// gives its slots in order.
void add_records(const MapFile& file, const MapEnd& end, Map& map) noexcept {
    const MapFileInfo& info = file.info;
    const auto first_point = static_cast<std::uint32_t>(map.points().size());
    const auto first_keyframe = static_cast<std::uint32_t>(map.keyframes().size());
    for (std::uint32_t i = 0; i < info.points; ++i) {
        const Result<Handle<MapPoint>> taken = map.add_point();
        STILLMESH_CHECK(taken.is_ok() && taken.value().slot() == first_point + i);
        MapPoint& point = map.points().at(first_point + i);
        std::uint32_t reference = 0;
        STILLMESH_CHECK(file.point(i, point, reference));
        point.last_seen_frame += end.frames;
        point.created_ns += end.time_ns;
        point.anchor_ns += end.time_ns;
    }
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        const Handle<Keyframe> handle = map.add_keyframe();
        STILLMESH_CHECK(!handle.is_null() && handle.slot() == first_keyframe + k);
    }
    std::uint32_t at = 0;
    for (std::uint32_t k = 0; k < info.keyframes; ++k) {
        std::uint32_t parent = 0;
        const Handle<Keyframe> handle = map.keyframes().handle_of(first_keyframe + k);
        Keyframe& keyframe = map.keyframes().at(handle.slot());
        keyframe = file.keyframe(k, parent);
        keyframe.frame += end.frames;
        keyframe.last_useful_frame += end.frames;
        keyframe.time_ns += end.time_ns;
        const std::uint32_t features_end = at + keyframe.observations;
        keyframe.observations = 0;
        if (parent != 0) keyframe.parent = map.keyframes().handle_of(first_keyframe + parent - 1);
        for (; at < features_end; ++at) {
            Observation observation;
            Descriptor descriptor;
            STILLMESH_CHECK(file.feature(at, observation, descriptor));
            const std::uint32_t link = file.link(at);
            if (link != 0) observation.point = map.points().handle_of(first_point + link - 1);
            map.add_observation(handle, observation, descriptor);
        }
    }
    for (std::uint32_t i = 0; i < info.points; ++i) {
        MapPoint point;
        std::uint32_t reference = 0;
        STILLMESH_CHECK(file.point(i, point, reference));
        map.points().at(first_point + i).reference =
            reference == 0 ? Handle<Keyframe>{} : map.keyframes().handle_of(first_keyframe + reference - 1);
    }
}

}  // namespace

void restore_map(std::span<const std::byte> bytes, const MapFileInfo& info, Map& map) noexcept {
    const MapFile file{bytes, info};
    map.reset();
    add_records(file, {}, map);
    double readout_s = 0;
    static_cast<void>(file.camera(readout_s));
    map.begin_with_readout(readout_s);
    map.note_change(info.hash);
}

void restore_depth_images(std::span<const std::byte> bytes, const MapFileInfo& info, const Map& map,
                          DepthImages& images) noexcept {
    const MapFile file{bytes, info};
    images.reset();
    std::uint32_t place = 0;
    for (std::uint32_t i = 0; i < info.depth_images; ++i) {
        if (!is_kept(file, i, images.owners().size())) continue;
        DepthImages::Owner owner;
        std::uint32_t keyframe = 0;
        STILLMESH_CHECK(file.depth(i, owner, keyframe));
        owner.keyframe = map.keyframes().handle_of(keyframe - 1);
        read_cells(file, i, images.put(place++, owner));
    }
}

void append_map(std::span<const std::byte> bytes, const MapFileInfo& info, const MapEnd& end, Map& map) noexcept {
    const MapFile file{bytes, info};
    const double readout_before_s = map.readout_s();
    double readout_s = 0;
    static_cast<void>(file.camera(readout_s));
    map.express_with_readout(readout_s);
    add_records(file, end, map);
    map.express_with_readout(readout_before_s);
    map.note_change(info.hash);
}

void append_depth_images(std::span<const std::byte> bytes, const MapFileInfo& info, const MapEnd& end, const Map& map,
                         DepthImages& images) noexcept {
    if (!images.is_on()) return;
    const MapFile file{bytes, info};
    const auto first_keyframe = static_cast<std::uint32_t>(map.keyframes().size()) - info.keyframes;
    for (std::uint32_t i = 0; i < info.depth_images; ++i) {
        DepthImages::Owner owner;
        std::uint32_t keyframe = 0;
        STILLMESH_CHECK(file.depth(i, owner, keyframe));
        owner.keyframe = map.keyframes().handle_of(first_keyframe + keyframe - 1);
        owner.frame += end.frames;
        const std::span<std::uint16_t> depth_mm = images.join(owner, map.keyframes());
        if (!depth_mm.empty()) read_cells(file, i, depth_mm);
    }
}

}  // namespace stillmesh