// What it takes to repeat a run bit for bit, given its frames: limits, configuration and camera once; then for every
// frame what went in (a digest), what was granted to background work, what was decided, and the state hash. Every byte
// is described in docs/SPEC-recording.md. Encoding goes into the caller's buffer; decoding trusts no length and no
// number: a damaged or torn record is told from a whole one by its CRC, and everything before it stays readable.
// Cost: some 100 bytes and a CRC of them per frame; the digest is one pass over the pixels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/status.hpp"
#include "engine/configuration.hpp"
#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/limits.hpp"
#include "engine/motion_hint.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kRecordingVersion = 3;         // with hints of the motion
inline constexpr std::uint32_t kRecordingVersionWithout = 2;  // as it is written without
inline constexpr std::size_t kRecordingHeaderBytesMax = 32 * 1024;
inline constexpr std::uint32_t kGrantRunsMax = 64;
inline constexpr std::uint32_t kGrantCallsMax = 65536;  // of Engine::step behind one frame
inline constexpr std::size_t kRecordingEntryBytesMax = 168 + 8 * kGrantRunsMax;

struct RecordingHeader {
    Limits limits;
    Configuration configuration;
    CameraModel camera;
    double depth_units_per_m = 5000.0;
    std::uint8_t extractor = 0;        // 0: the engine's own, 1: cv::ORB; others: a program's own
    std::uint32_t vocabulary_crc = 0;  // of its bytes; 0: none
    // Of the map store at the begin; only with limits.store_features_max above 0.
    std::uint64_t store_regions = 0, store_sequence = 0, store_checksum = 0;
    bool has_hints = false;          // frames may have a hint of the motion
    std::uint32_t unknown_keys = 0;  // read, and not of this program; the first is named in the problem
};

// So many calls of Engine::step in a row, each with so many units.
struct GrantRun {
    std::uint32_t units = 0;
    std::uint32_t calls = 0;
};

struct RecordedFrame {
    std::uint64_t index = 0;  // in the recording, from 0
    std::int64_t time_ns = 0;
    std::uint64_t digest = 0;     // frame_digest of what was submitted
    Status status = Status::kOk;  // that submit returned
    std::uint8_t pose_state = 0;  // PoseState
    bool is_keyframe = false;
    std::uint32_t features = 0;
    std::uint32_t matches = 0;
    std::uint32_t static_matches = 0;
    std::uint32_t groups = 0;
    std::uint64_t hash_tracked = 0;  // state hash right after submit
    std::uint64_t hash = 0;          // and after the steps granted behind it
    std::uint32_t grant_runs = 0;
    std::array<GrantRun, kGrantRunsMax> grants;
    bool has_store = false;            // the two below count
    std::uint64_t store_answered = 0;  // question whose answer could be polled from here on; 0: none
    bool is_store_accepting = true;    // regions were taken until the next frame

    bool has_hint = false;  // the next counts: what submit was given
    MotionHint hint;

    // One call of Engine::step. False: the record has no room for it, and the call must not be made.
    [[nodiscard]] constexpr bool add_grant(std::uint32_t units) noexcept {
        std::uint64_t calls = 0;
        for (std::uint32_t i = 0; i < grant_runs; ++i) calls += grants[i].calls;
        if (calls >= kGrantCallsMax) return false;
        if (grant_runs > 0 && grants[grant_runs - 1].units == units) {
            ++grants[grant_runs - 1].calls;
            return true;
        }
        if (grant_runs == kGrantRunsMax) return false;
        grants[grant_runs++] = {units, 1};
        return true;
    }
};

enum class RecordingEnd : std::uint8_t {
    kDone = 0,      // the run was over
    kOverflow = 1,  // the disk was too slow: the run went on, the recording stopped here
};

struct RecordingEntry {
    bool is_end = false;
    RecordedFrame frame;           // unless is_end
    RecordingEnd end{};            // if is_end
    std::uint64_t end_frames = 0;  // if is_end: frames before it
};

// What is wrong with a header: why, and the key it is about (empty: none).
struct RecordingProblem {
    const char* sentence = "";
    std::array<char, 64> key{};
};

// Bytes written, or kFull.
[[nodiscard]] Result<std::size_t> encode_header(const RecordingHeader& header, std::span<std::byte> out) noexcept;
[[nodiscard]] Result<std::size_t> encode_frame(const RecordedFrame& frame, std::span<std::byte> out) noexcept;
[[nodiscard]] Result<std::size_t> encode_end(RecordingEnd end, std::uint64_t frames, std::span<std::byte> out) noexcept;

// Reads the header at the begin of `bytes` and says how many it took. On failure `header` is not to be used.
//   kNotFound  these bytes are no recording           kEnd      it is cut off: more bytes are needed
//   kInvalid   another version, or another set of parameters or limits: `problem` says which
//   kCorrupt   its CRC or its contents are wrong
// The values are typed, and no more: whether they are in range is for validate() to say.
[[nodiscard]] Result<std::size_t> decode_header(std::span<const std::byte> bytes, RecordingHeader& header,
                                                RecordingProblem& problem) noexcept;
// Reads the record at the begin of `bytes` and says how many it took.
//   kEnd      it is cut off (or `bytes` is empty): more bytes are needed, at most kRecordingEntryBytesMax in all
//   kCorrupt  its length, CRC or contents are wrong; nothing behind it can be trusted
[[nodiscard]] Result<std::size_t> decode_entry(std::span<const std::byte> bytes, RecordingEntry& entry) noexcept;

// Of everything in a frame that tracking looks at, except its time: sizes, format, pixels, depth factor, time of depth
// against colour. Differs for certain when 8 bytes of one row differ. Padding between rows is not looked at. 0 when a
// view is missing or too narrow for its own size: such a frame is refused.
[[nodiscard]] std::uint64_t frame_digest(const Frame& frame) noexcept;

}  // namespace stillmesh
