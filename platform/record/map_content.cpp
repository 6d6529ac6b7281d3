#include "platform/record/map_content.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <utility>

#include "engine/base/bytes.hpp"
#include "engine/base/crc.hpp"
#include "engine/geometry/rigid_transform.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/record/map_saver.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kSectionHead = 16;
constexpr std::size_t kSectionsMax = 8, kSectionsWithoutDepth = 5;
constexpr std::array<const char*, kSectionsMax> kSections = {"CAMR", "KEYF", "PNTS", "FEAT",
                                                             "LINK", "DPTH", "RAYS", "CELL"};

class ContentReader {
public:
    ContentReader(std::span<const std::byte> bytes, SavedMap& content) : bytes_(bytes), content_(content) {}

    // The fault, if there is one, with the section's name.
    [[nodiscard]] Status read(MapFileProblem& problem) {
        STILLMESH_TRY(read_map_header(bytes_, content_.info, problem));
        if (bytes_.size() != content_.info.size_bytes) {
            const bool is_short = bytes_.size() < content_.info.size_bytes;
            problem = {is_short ? MapFault::kCutOff : MapFault::kTooLong, "", static_cast<double>(bytes_.size()),
                       static_cast<double>(content_.info.size_bytes)};
            return Status::kCorrupt;
        }
        std::size_t at = kMapHeaderBytes;
        const MapFileInfo& info = content_.info;
        const std::uint32_t columns = info.depth_columns, rows = info.depth_rows;
        const std::array<std::uint32_t, kSectionsMax> counts = {1,
                                                                info.keyframes,
                                                                info.points,
                                                                info.features,
                                                                info.features,
                                                                info.depth_images,
                                                                columns * rows,
                                                                info.depth_images * rows};
        const std::array<std::size_t, kSectionsMax> record_bytes = {88, 328, 184, 64, 4, 112, 8, 2 * columns};
        const std::size_t sections = info.depth_images == 0 ? kSectionsWithoutDepth : kSectionsMax;
        for (std::size_t section = 0; section < sections; ++section) {
            const std::size_t size = counts[section] * record_bytes[section];
            if (bytes_.size() - at < kSectionHead + size + 4) return damaged(section, problem);
            const auto whole = bytes_.subspan(at, kSectionHead + size);
            ByteReader crc(bytes_.subspan(at + kSectionHead + size, 4));
            ByteReader head(whole);
            const auto letters = head.bytes(4);
            const bool is_named = std::equal(letters.begin(), letters.end(), kSections[section],
                                             [](std::byte a, char b) { return a == static_cast<std::byte>(b); });
            if (!is_named || head.u32() != counts[section] || head.u64() != size || crc.u32() != crc32(whole)) {
                return damaged(section, problem);
            }
            ByteReader records(whole.subspan(kSectionHead));
            if (!take(section, records)) return damaged(section, problem);
            at += kSectionHead + size + 4;
        }
        return Status::kOk;
    }

private:
    [[nodiscard]] static Status damaged(std::size_t section, MapFileProblem& problem) {
        problem = {MapFault::kDamaged, kSections[section], 0, 0};
        return Status::kCorrupt;
    }
    [[nodiscard]] bool take(std::size_t section, ByteReader& in) {
        if (section == 0) return take_camera(in);
        if (section == 1) {
            content_.keyframes.resize(content_.info.keyframes);
            return std::all_of(content_.keyframes.begin(), content_.keyframes.end(),
                               [&](SavedKeyframe& keyframe) { return take_keyframe(in, keyframe); });
        }
        if (section == 2) {
            content_.points.resize(content_.info.points);
            return std::all_of(content_.points.begin(), content_.points.end(),
                               [&](SavedPoint& point) { return take_point(in, point); });
        }
        if (section == 4) return take_links(in);
        if (section == 5) {
            content_.depth.resize(content_.info.depth_images);
            return std::all_of(content_.depth.begin(), content_.depth.end(),
                               [&](SavedDepth& depth) { return take_depth(in, depth); });
        }
        if (section == 6) {
            content_.rays.resize(in.remaining() / sizeof(float));
            in.fields(content_.rays);
            return std::all_of(content_.rays.begin(), content_.rays.end(),
                               [](float ray) { return std::isfinite(ray); });
        }
        if (section == 7) {
            content_.depth_mm.resize(in.remaining() / sizeof(std::uint16_t));
            in.fields(content_.depth_mm);
        }
        return true;
    }
    [[nodiscard]] bool take_camera(ByteReader& in) {
        CameraModel& m = content_.camera;
        in.fields(m.width, m.height, m.fx, m.fy, m.cx, m.cy, m.k1, m.k2, m.p1, m.p2, m.k3, content_.readout_s);
        return in.is_ok() && m.fx > 0 && m.fy > 0;
    }
    [[nodiscard]] bool take_keyframe(ByteReader& in, SavedKeyframe& keyframe) const {
        if (!take_pose(in, keyframe.pose.t, keyframe.pose.q)) return false;
        static_cast<void>(in.bytes(96 + 48 + 48 + 8));
        in.fields(keyframe.parent, keyframe.features, keyframe.pose.time_ns, keyframe.frame);
        static_cast<void>(in.bytes(8));
        return in.is_ok() && keyframe.parent <= content_.info.keyframes;
    }
    [[nodiscard]] static bool take_pose(ByteReader& in, std::span<double, 3> t, std::span<double, 4> xyzw) {
        RotationMatrix rotation{};
        in.fields(rotation, t);
        double q[4] = {};
        write_quaternion(rotation, q);
        std::copy_n(q, 4, xyzw.begin());
        const auto is_finite = [](double value) { return std::isfinite(value); };
        return in.is_ok() && std::all_of(rotation.begin(), rotation.end(), is_finite) &&
               std::all_of(t.begin(), t.end(), is_finite);
    }
    [[nodiscard]] bool take_depth(ByteReader& in, SavedDepth& depth) const {
        RigidTransform keyframe_from_camera, map_from_keyframe;
        if (!take_pose(in, keyframe_from_camera.translation_m, keyframe_from_camera.rotation_xyzw)) return false;
        in.fields(depth.frame, depth.keyframe);
        static_cast<void>(in.bytes(4));
        if (!in.is_ok() || depth.keyframe == 0 || depth.keyframe > content_.keyframes.size()) return false;
        const TrajectoryPose& keyframe = content_.keyframes[depth.keyframe - 1].pose;
        std::copy(keyframe.t.begin(), keyframe.t.end(), map_from_keyframe.translation_m);
        std::copy(keyframe.q.begin(), keyframe.q.end(), map_from_keyframe.rotation_xyzw);
        depth.map_from_camera = compose(map_from_keyframe, keyframe_from_camera);
        return true;
    }
    [[nodiscard]] static bool take_point(ByteReader& in, SavedPoint& point) {
        in.fields(point.x, point.y, point.z);
        static_cast<void>(in.bytes(24));
        in.fields(point.along_m2, point.across_m2);
        static_cast<void>(in.bytes(16 + 32 + 8 + 8 + 8 + 4 + 4 + 4));
        point.seen = in.u16();
        static_cast<void>(in.u8());
        point.static_weight = in.u8() / 10.0;
        static_cast<void>(in.u8());
        in.fields(point.is_moving);
        static_cast<void>(in.bytes(2 + 12 + 12 + 4));
        return in.is_ok() && std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z);
    }
    // Features follow each other keyframe by keyframe.
    [[nodiscard]] bool take_links(ByteReader& in) {
        content_.shown.reserve(content_.info.features);
        for (SavedKeyframe& keyframe : content_.keyframes) {
            for (std::uint32_t i = 0; i < keyframe.features; ++i) {
                const std::uint32_t link = in.u32();
                if (!in.is_ok() || link > content_.info.points) return false;
                content_.shown.push_back(link);
                if (link == 0) continue;
                ++keyframe.points;
                ++content_.points[link - 1].observers;
            }
        }
        return in.remaining() == 0;
    }

    std::span<const std::byte> bytes_;
    SavedMap& content_;
};

}  // namespace

DepthImage SavedMap::depth_image(std::size_t index) const {
    if (index >= depth.size()) return {};
    const std::size_t cells = std::size_t{info.depth_columns} * info.depth_rows;
    return {info.depth_columns,
            info.depth_rows,
            std::span(depth_mm).subspan(index * cells, cells),
            rays,
            depth[index].frame,
            depth[index].map_from_camera};
}

std::vector<KeyframeLink> covisible_keyframes(const SavedMap& map, std::uint32_t shared_min) {
    constexpr std::size_t kKeyframesMax = 1024;
    std::vector<KeyframeLink> links;
    if (map.keyframes.size() > kKeyframesMax) return links;
    std::vector<std::vector<std::uint32_t>> observers(map.points.size());  // of each point, in order
    std::size_t feature = 0;
    for (std::uint32_t k = 0; k < map.keyframes.size(); ++k) {
        std::vector<std::uint32_t> shared(k, 0);
        for (std::uint32_t i = 0; i < map.keyframes[k].features; ++i) {
            const std::uint32_t point = map.shown[feature++];
            if (point == 0) continue;
            std::vector<std::uint32_t>& others = observers[point - 1];
            if (!others.empty() && others.back() == k) continue;
            for (const std::uint32_t other : others) ++shared[other];
            others.push_back(k);
        }
        for (std::uint32_t other = 0; other < k; ++other) {
            if (shared[other] < std::max(shared_min, 1U)) continue;
            const auto [older, newer] = std::minmax(map.keyframes[other].frame, map.keyframes[k].frame);
            links.push_back({older, newer, shared[other], KeyframeLinkKind::kCovisible});
        }
    }
    std::sort(links.begin(), links.end(), [](const KeyframeLink& a, const KeyframeLink& b) {
        return std::pair(a.newer_id, a.older_id) < std::pair(b.newer_id, b.older_id);
    });
    return links;
}

Status parse_map_content(std::span<const std::byte> bytes, const std::string& file, SavedMap& content,
                         std::string& message) {
    SavedMap read;
    MapFileProblem problem;
    if (ContentReader(bytes, read).read(problem) != Status::kOk) {
        message = map_sentence(file, problem);
        return Status::kInvalid;
    }
    content = std::move(read);
    return Status::kOk;
}

Status read_map_content(const std::string& file, SavedMap& content, std::string& message) {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    if (!read_whole_file(file, kMapFileBytesMax, block, bytes, message)) return Status::kUnavailable;
    return parse_map_content(bytes, file, content, message);
}

}  // namespace stillmesh
