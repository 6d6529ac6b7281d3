// The map on disk: what a file says before it is read, what may be wrong with it, and how a copy of a map becomes a
// file. The bytes are specified with the source (SPEC-map). A file is a pure function of the map's content: slots,
// generations and free lists of the pools are not in it, so that maps of equal content give equal files on every
// processor. Writing: Engine::begin_map_copy and step_map_copy fill a workspace of map_copy_bytes(limits) between
// frames, in slices; from then on the workspace is the caller's, and MapFileWriter turns it into bytes on any thread,
// piece by piece. Reading: Engine::load_map checks all of a file before it touches anything. Limits: those of the
// engine. Depth images are a part that a file may have: one without them loads anywhere,
// and of one that has more than limits.depth_images_max those of the keyframes' own moments are taken rather than later
// ones, of each the newest; the rest is left in the file. Cost: one pass over the map to copy it, one to hash and one
// to write it; about 68 bytes a feature, 184 a point, 9.5 KiB a depth image.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/api.hpp"
#include "engine/base/crc.hpp"
#include "engine/base/status.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

inline constexpr std::array<char, 8> kMapMagic = {'S', 'T', 'I', 'L', 'L', 'M', 'A', 'P'};
inline constexpr std::uint32_t kMapVersion = 2;  // without depth images
inline constexpr std::uint32_t kMapVersionWithDepth = 3;
inline constexpr std::size_t kMapHeaderBytes = 96;
// MapFileWriter::next wants at least this much room.
inline constexpr std::size_t kMapPieceBytesMin = 512;

// What a header says.
struct MapFileInfo {
    std::uint64_t size_bytes = 0;
    std::uint32_t keyframes = 0;
    std::uint32_t points = 0;
    std::uint32_t features = 0;              // of all keyframes
    std::uint32_t features_of_keyframe = 0;  // of the one with most
    std::uint32_t pyramid_levels = 0;
    double scale_factor = 0;     // of the pyramid
    std::uint32_t lens_crc = 0;  // of what camera records have no place for (lens_crc_of); 0: nothing
    std::uint8_t extractor = 0;  // 0: the engine's own, 1: cv::ORB; others are for whoever brings one
    std::int64_t time_ns = 0;    // of the last frame
    std::uint64_t frames = 0;    // tracked so far
    std::uint64_t hash = 0;      // of the content, without depth images
    std::uint32_t depth_images = 0;
    std::uint16_t depth_columns = 0, depth_rows = 0;  // of each; 0 where there is none

    [[nodiscard]] std::uint32_t version() const noexcept {
        return depth_images == 0 ? kMapVersion : kMapVersionWithDepth;
    }
};

enum class MapFault : std::uint8_t {
    kNone = 0,
    kNoMap,           // other letters at its begin, or nothing
    kOtherVersion,    // value: its version, limit: our last (the first is kMapVersion)
    kCutOff,          // value: its bytes, limit: what there should be
    kTooLong,         // likewise
    kDamaged,         // `part` has a wrong CRC or header
    kImpossible,      // `part` says what cannot be; its CRC is right
    kTooManyFor,      // value: how many, limit: of the key `part`
    kOtherFeatures,   // value: its number, limit: this run's, of the key `part`
    kOtherExtractor,  // value: its extractor, limit: this run's
    kOtherCamera,     // value: its number, limit: this camera's, of `part`
};
struct MapFileProblem {
    MapFault fault = MapFault::kNone;
    const char* part = "";  // a section, a key, or a number of the camera
    double value = 0;
    double limit = 0;
};

// Size of the workspace that a map within these limits may need. Pages that are never touched cost nothing: a map that
// fills a tenth of the pools touches a tenth.
[[nodiscard]] STILLMESH_API std::size_t map_copy_bytes(const Limits& limits) noexcept;

// The header alone.
//   kNotFound no map   kEnd cut off   kInvalid another version   kCorrupt damaged
[[nodiscard]] STILLMESH_API Status read_map_header(std::span<const std::byte> bytes, MapFileInfo& info,
                                                   MapFileProblem& problem) noexcept;

// A workspace that a copy was finished in, as a file, from its first byte to its last. Only reads the workspace.
class STILLMESH_API MapFileWriter {
public:
    explicit MapFileWriter(std::span<const std::byte> workspace) noexcept;

    [[nodiscard]] const MapFileInfo& info() const noexcept { return info_; }
    // The next bytes of the file; how many, 0: that was all. `out`: at least kMapPieceBytesMin.
    [[nodiscard]] std::size_t next(std::span<std::byte> out) noexcept;

    // The next record of a section.
    struct Cursor {
        std::uint32_t record = 0;    // in the section
        std::uint32_t keyframe = 0;  // of the next feature
        std::uint32_t feature = 0;   // in the keyframe
    };

private:
    enum class Part : std::uint8_t { kHeader, kBegin, kRecords, kEnd, kDone };

    [[nodiscard]] std::uint64_t hash() const noexcept;

    std::span<const std::byte> workspace_;
    MapFileInfo info_;
    Crc32 crc_;
    Part part_ = Part::kHeader;
    std::uint32_t section_ = 0;
    Cursor at_;
};

}  // namespace stillmesh
