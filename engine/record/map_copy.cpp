#include "engine/record/map_copy.hpp"

#include <algorithm>
#include <new>

namespace stillmesh {
namespace {

// Of 1280 bytes, as 16 features have them.
constexpr std::uint32_t kImageUnits = 8, kRaysUnits = 30;

using namespace map_copy_detail;
using namespace map_records;

// Where an array lies in a workspace; with no workspace, only how far it reaches.
class Places {
public:
    explicit constexpr Places(std::byte* begin) noexcept : begin_(begin) {}
    template <typename T>
    constexpr std::span<T> array(std::size_t count) noexcept {
        used_ = align_up(used_, kArenaAlignment);
        const std::size_t at = used_;
        used_ += count * sizeof(T);
        return begin_ == nullptr ? std::span<T>{} : std::span<T>{reinterpret_cast<T*>(begin_ + at), count};
    }
    [[nodiscard]] constexpr std::size_t used() const noexcept { return used_; }

private:
    std::byte* begin_;
    std::size_t used_ = 0;
};

std::size_t parts_of(std::byte* begin, const Limits& limits, Parts& parts) noexcept {
    Places places(begin);
    const std::size_t features = std::size_t{limits.keyframes_max} * limits.features_max;
    const std::span<Head> head = places.array<Head>(1);
    parts.head = head.data();
    parts.keyframes = places.array<StagedKeyframe>(limits.keyframes_max);
    parts.order = places.array<std::uint32_t>(limits.keyframes_max);
    parts.places = places.array<PointPlace>(limits.map_points_max);
    parts.points = places.array<MapPoint>(limits.map_points_max);
    parts.observations = places.array<Observation>(features);
    parts.descriptors = places.array<Descriptor>(features);
    const std::size_t images = limits.depth_images_max;
    parts.owners = places.array<DepthImages::Owner>(images);
    parts.images = places.array<std::uint32_t>(images);
    parts.depth_mm = places.array<std::uint16_t>(images * kDepthCellsMax);
    parts.rays = places.array<float>(images == 0 ? 0 : std::size_t{2} * kDepthCellsMax);
    return places.used();
}

// The workspace is only read; Parts has one type for both directions.
Parts parts_of(std::span<const std::byte> workspace) noexcept {
    auto* const begin = const_cast<std::byte*>(workspace.data());
    Parts parts;
    static_cast<void>(parts_of(begin, reinterpret_cast<const Head*>(begin)->limits, parts));
    return parts;
}

std::uint32_t place_of(const Parts& parts, Handle<Keyframe> keyframe) noexcept {
    if (keyframe.is_null()) return 0;
    const StagedKeyframe& staged = parts.keyframes[keyframe.slot()];
    return staged.handle == keyframe ? staged.place_plus_one : 0;
}
std::uint32_t place_of(const Parts& parts, Handle<MapPoint> point) noexcept {
    if (point.is_null()) return 0;
    const PointPlace& place = parts.places[point.slot()];
    return place.generation == point.generation ? place.plus_one : 0;
}

// The record at the cursor (feature: of the keyframe), into `out`; its size.
std::size_t write_record(const Parts& parts, std::uint32_t section, std::uint32_t record, std::uint32_t feature,
                         std::span<std::byte> out) noexcept {
    ByteWriter writer(out);
    switch (static_cast<Section>(section)) {
        case Section::kCamera:
            camera_fields(writer, parts.head->camera);
            writer.f64(parts.head->readout_s);
            break;
        case Section::kKeyframes: writer.bytes(parts.keyframes[parts.order[record]].record); break;
        case Section::kPoints:
            point_fields(writer, parts.points[record], place_of(parts, parts.points[record].reference));
            break;
        case Section::kFeatures:
        case Section::kLinks: {
            const std::size_t at = std::size_t{parts.order[record]} * parts.head->limits.features_max + feature;
            if (static_cast<Section>(section) == Section::kFeatures) {
                feature_fields(writer, parts.observations[at], parts.descriptors[at]);
            } else {
                writer.u32(place_of(parts, parts.observations[at].point));
            }
            break;
        }
        case Section::kDepth: {
            const DepthImages::Owner& owner = parts.owners[parts.images[record]];
            depth_fields(writer, owner, place_of(parts, owner.keyframe));
            break;
        }
        case Section::kRays:
            writer.fields(parts.rays[std::size_t{2} * record], parts.rays[std::size_t{2} * record + 1]);
            break;
        case Section::kCells: {
            const MapFileInfo& info = parts.head->info;
            const std::size_t at = std::size_t{parts.images[record / info.depth_rows]} * kDepthCellsMax +
                                   std::size_t{record % info.depth_rows} * info.depth_columns;
            writer.fields(parts.depth_mm.subspan(at, info.depth_columns));
            break;
        }
    }
    STILLMESH_CHECK(writer.is_ok());
    return writer.position();
}

constexpr bool is_by_feature(std::uint32_t section) noexcept {
    return section == static_cast<std::uint32_t>(Section::kFeatures) ||
           section == static_cast<std::uint32_t>(Section::kLinks);
}

// The record at the cursor, into `out`, and on to the next; its size, 0: there was none left.
std::size_t write_next(const Parts& parts, std::uint32_t section, MapFileWriter::Cursor& at,
                       std::span<std::byte> out) noexcept {
    if (at.record == records_of(parts.head->info, section)) return 0;
    ++at.record;
    if (!is_by_feature(section)) return write_record(parts, section, at.record - 1, 0, out);
    while (at.feature == parts.keyframes[parts.order[at.keyframe]].features) {
        ++at.keyframe;
        at.feature = 0;
    }
    return write_record(parts, section, at.keyframe, at.feature++, out);
}

void write_header(const MapFileInfo& info, std::span<std::byte> out) noexcept {
    ByteWriter writer(out);
    writer.fields(kMapMagic, info.version(), static_cast<std::uint32_t>(kMapHeaderBytes));
    header_fields(writer, info);
    writer.u32(crc32(writer.written()));
    STILLMESH_CHECK(writer.position() == kMapHeaderBytes);
}

}  // namespace

std::size_t map_copy_bytes(const Limits& limits) noexcept {
    Parts parts;
    return parts_of(nullptr, limits, parts);
}

// --- the copy --------------------------------------------------------------------------------------------------------

Status MapCopy::begin(std::span<std::byte> workspace, const Limits& limits, const MapOrigin& origin) noexcept {
    stage_ = Stage::kIdle;
    if (workspace.size() < map_copy_bytes(limits)) return Status::kFull;
    STILLMESH_CHECK(reinterpret_cast<std::uintptr_t>(workspace.data()) % kArenaAlignment == 0);
    static_cast<void>(parts_of(workspace.data(), limits, parts_));
    Head& head = *::new (static_cast<void*>(parts_.head)) Head;
    head.limits = limits;
    head.camera = origin.camera;
    head.info.pyramid_levels = origin.pyramid_levels;
    head.info.scale_factor = origin.scale_factor;
    head.info.extractor = origin.extractor;
    head.info.lens_crc = lens_crc_of(origin.camera);
    for (StagedKeyframe& staged : parts_.keyframes) staged.handle = {};
    for (DepthImages::Owner& owner : parts_.owners) owner = {};
    stage_ = Stage::kFeatures;
    cursor_ = 0;
    return Status::kOk;
}

bool MapCopy::is_due(const Map& map, std::uint32_t slot) const noexcept {
    if (!map.keyframes().is_taken(slot)) return false;
    const StagedKeyframe& staged = parts_.keyframes[slot];
    return staged.handle != map.keyframes().handle_of(slot) ||
           staged.observations_changed != map.keyframes().at(slot).observations_changed;
}

bool MapCopy::is_due(const Map& map, const DepthImages& images, std::uint32_t index) const noexcept {
    const DepthImages::Owner& owner = images.owners()[index];
    if (map.keyframes().find(owner.keyframe) == nullptr) return false;
    return parts_.owners[index].keyframe != owner.keyframe || parts_.owners[index].frame != owner.frame;
}

// Not const: the parts that it writes are behind spans.
// NOLINTNEXTLINE(readability-make-member-function-const)
std::uint32_t MapCopy::stage(const Map& map, std::uint32_t slot) noexcept {
    StagedKeyframe& staged = parts_.keyframes[slot];
    staged.handle = map.keyframes().handle_of(slot);
    staged.observations_changed = map.keyframes().at(slot).observations_changed;
    const std::span<const Observation> observations = map.observations(staged.handle);
    const std::span<const Descriptor> descriptors = map.descriptors(staged.handle);
    staged.features = static_cast<std::uint32_t>(observations.size());
    const auto at = static_cast<std::ptrdiff_t>(std::size_t{slot} * parts_.head->limits.features_max);
    std::copy(observations.begin(), observations.end(), parts_.observations.begin() + at);
    std::copy(descriptors.begin(), descriptors.end(), parts_.descriptors.begin() + at);
    return staged.features / 16 + 1;
}

// NOLINTNEXTLINE(readability-make-member-function-const)
std::uint32_t MapCopy::stage(const DepthImages& images, std::uint32_t index) noexcept {
    parts_.owners[index] = images.owners()[index];
    const std::span<const std::uint16_t> depth_mm = images.depth_mm(index);
    const auto at = static_cast<std::ptrdiff_t>(std::size_t{index} * kDepthCellsMax);
    std::copy(depth_mm.begin(), depth_mm.end(), parts_.depth_mm.begin() + at);
    return kImageUnits;
}

Progress MapCopy::step(const Map& map, const DepthImages& images, const MapMoment& moment,
                       WorkBudget& budget) noexcept {
    if (stage_ == Stage::kIdle) return Progress::kIdle;
    while (!budget.is_spent()) {
        if (stage_ == Stage::kFeatures) {
            if (cursor_ == map.keyframes().slots_count()) {
                stage_ = Stage::kImages;
                cursor_ = 0;
                continue;
            }
            const std::uint32_t slot = cursor_++;
            if (is_due(map, slot)) budget.spend(stage(map, slot));
        } else if (stage_ == Stage::kImages) {
            if (cursor_ == images.owners().size()) {
                stage_ = Stage::kInstant;
                continue;
            }
            const std::uint32_t index = cursor_++;
            if (is_due(map, images, index)) budget.spend(stage(images, index));
        } else if (take_instant(map, images, moment, budget)) {
            stage_ = Stage::kIdle;
            return Progress::kDone;
        } else {
            stage_ = Stage::kFeatures;
            cursor_ = 0;
        }
    }
    return Progress::kWorking;
}

bool MapCopy::take_instant(const Map& map, const DepthImages& images, const MapMoment& moment,
                           WorkBudget& budget) noexcept {
    const std::uint32_t slots = map.keyframes().slots_count();
    std::uint32_t late = 0;
    for (std::uint32_t slot = 0; slot < slots; ++slot) late += is_due(map, slot) ? 1U : 0U;
    const auto places = static_cast<std::uint32_t>(images.owners().size());
    for (std::uint32_t index = 0; index < places; ++index) late += is_due(map, images, index) ? 1U : 0U;
    budget.spend((slots + places) / 16 + 1);
    if (late > kLateMax) return false;
    MapFileInfo& info = parts_.head->info;
    info.frames = moment.frames;
    info.time_ns = moment.time_ns;
    parts_.head->readout_s = map.readout_s();
    take_keyframes(map, budget);
    const Pool<MapPoint>& points = map.points();
    info.points = 0;
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        PointPlace& place = parts_.places[slot];
        place = {};
        if (!points.is_taken(slot)) continue;
        parts_.points[info.points++] = points.at(slot);
        place = {points.handle_of(slot).generation, info.points};
    }
    budget.spend(points.slots_count() / 16);
    take_images(map, images, budget);
    info.size_bytes = file_bytes(info);
    return true;
}

void MapCopy::take_keyframes(const Map& map, WorkBudget& budget) noexcept {
    const Pool<Keyframe>& keyframes = map.keyframes();
    MapFileInfo& info = parts_.head->info;
    info.keyframes = info.features = info.features_of_keyframe = 0;
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        StagedKeyframe& staged = parts_.keyframes[slot];
        staged.place_plus_one = 0;
        if (!keyframes.is_taken(slot)) continue;
        if (is_due(map, slot)) budget.spend(stage(map, slot));
        parts_.order[info.keyframes++] = slot;
        staged.place_plus_one = info.keyframes;
        info.features += staged.features;
        info.features_of_keyframe = std::max(info.features_of_keyframe, staged.features);
    }
    for (std::uint32_t i = 0; i < info.keyframes; ++i) {
        const Keyframe& keyframe = keyframes.at(parts_.order[i]);
        ByteWriter writer(parts_.keyframes[parts_.order[i]].record);
        keyframe_fields(writer, keyframe, place_of(parts_, keyframe.parent));
        STILLMESH_CHECK(writer.is_ok());
    }
    budget.spend(keyframes.slots_count() / 16);
}

void MapCopy::take_images(const Map& map, const DepthImages& images, WorkBudget& budget) noexcept {
    MapFileInfo& info = parts_.head->info;
    info.depth_images = 0;
    for (std::uint32_t index = 0; index < images.owners().size(); ++index) {
        if (map.keyframes().find(images.owners()[index].keyframe) == nullptr) continue;
        if (is_due(map, images, index)) budget.spend(stage(images, index));
        parts_.images[info.depth_images++] = index;
    }
    const bool has_some = info.depth_images > 0;
    info.depth_columns = static_cast<std::uint16_t>(has_some ? images.columns() : 0);
    info.depth_rows = static_cast<std::uint16_t>(has_some ? images.rows() : 0);
    if (!has_some) return;
    std::copy(images.rays().begin(), images.rays().end(), parts_.rays.begin());
    budget.spend(kRaysUnits);
}

// --- the file --------------------------------------------------------------------------------------------------------

MapFileWriter::MapFileWriter(std::span<const std::byte> workspace) noexcept : workspace_(workspace) {
    info_ = reinterpret_cast<const Head*>(workspace.data())->info;
    info_.hash = hash();
}

std::uint64_t MapFileWriter::hash() const noexcept {
    const Parts parts = parts_of(workspace_);
    StateHash hash;
    std::array<std::byte, kMapPieceBytesMin> buffer{};
    const std::span<std::byte> out(buffer);
    for (std::uint32_t section = 0; section < kHashedSections; ++section) {
        Cursor at;
        while (const std::size_t size = write_next(parts, section, at, out)) add_record(hash, section, out.first(size));
    }
    return hash.value();
}

std::size_t MapFileWriter::next(std::span<std::byte> out) noexcept {
    STILLMESH_CHECK(out.size() >= kMapPieceBytesMin);
    const Parts parts = parts_of(workspace_);
    std::size_t used = 0;
    while (part_ != Part::kDone && out.size() - used >= kMapPieceBytesMin) {
        const std::span<std::byte> rest = out.subspan(used);
        std::size_t size = 0;
        switch (part_) {
            case Part::kHeader:
                write_header(info_, rest);
                used += kMapHeaderBytes;
                part_ = Part::kBegin;
                continue;
            case Part::kBegin: {
                ByteWriter writer(rest);
                writer.fields(kTags[section_], records_of(info_, section_), section_bytes(info_, section_));
                size = writer.position();
                crc_ = Crc32();
                at_ = {};
                part_ = Part::kRecords;
                break;
            }
            case Part::kRecords:
                size = write_next(parts, section_, at_, rest);
                if (size > 0) break;
                part_ = Part::kEnd;
                continue;
            case Part::kEnd: {
                ByteWriter writer(rest);
                writer.u32(crc_.value());
                used += writer.position();
                part_ = ++section_ == sections_of(info_) ? Part::kDone : Part::kBegin;
                continue;
            }
            case Part::kDone: break;
        }
        crc_.add(rest.first(size));
        used += size;
    }
    return used;
}

}  // namespace stillmesh
