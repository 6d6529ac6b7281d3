// The front door of the engine: one block of memory in, frames in, poses out. No call here allocates, throws, waits or
// reads a clock. One engine is used by one thread.
//
//   std::span<std::byte> block = ...;                        // bytes_needed(limits), aligned to kArenaAlignment
//   auto engine = Engine::create(block, limits, configuration, camera, kernels);
//   engine.value()->submit(frame);                           // tracks the frame
//   engine.value()->step(units);                             // background work, in the time that is left
//   const PoseEstimate& pose = engine.value()->pose();
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/api.hpp"
#include "engine/base/status.hpp"
#include "engine/base/version.hpp"
#include "engine/configuration.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/frame/kernels.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/limits.hpp"
#include "engine/motion_hint.hpp"
#include "engine/outputs.hpp"
#include "engine/paging/map_store.hpp"
#include "engine/record/map_file.hpp"
#include "engine/schedule/scheduler.hpp"

namespace stillmesh {

// Block size for these limits, bytes; exactly what the engine uses. Valid for limits that validate() accepts. The same
// at compile time, for a static block: static_bytes_needed(), which is with the source only.
[[nodiscard]] STILLMESH_API std::size_t bytes_needed(const Limits& limits) noexcept;

// What is wrong with a configuration: the key's name, why, its value and what is allowed, given the other keys;
// key == nullptr: nothing.
struct ConfigurationProblem {
    const char* key = nullptr;
    const char* sentence = nullptr;
    double value = 0;
    double min = 0;
    double max = 0;
};
// Limits that hold together and that handles, links and exact predicates can name: bytes_needed() is valid for them.
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(const Limits& limits) noexcept;
// A configuration within its ranges, without contradictions, and within limits that validate() accepts.
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(const Configuration& configuration,
                                                          const Limits& limits) noexcept;
// A camera that an engine within these limits takes: the key is "camera.width" and the like; where its lens folds the
// image over, or is none, "camera.lens".
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(const CameraModel& camera, const Limits& limits) noexcept;
// A block that an engine within these limits can lie in: "block.address" not aligned to kArenaAlignment (that of a
// std::vector seldom is), or "block.bytes" too few.
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(std::span<const std::byte> block,
                                                          const Limits& limits) noexcept;

// What to do with a map that was loaded.
enum class MapUse : std::uint8_t {
    kContinue = 0,  // find the camera in it, then go on mapping
    kLocalise = 1,  // find the camera in it; the map stays as it is
};

class STILLMESH_API Engine {
public:
    // The engine lies inside `block` (at least bytes_needed(limits), aligned to kArenaAlignment), which must outlive
    // it; so must `kernels`, `extractor` (nullptr: the engine's own) and the bytes of `vocabulary` (empty: no place is
    // ever recognised), which are checked here and then used where they lie.
    // `store`: where places go that memory has no room for (nullptr: nowhere; else limits.store_features_max must not
    // be 0); it must outlive the engine. One with regions in it is a map to begin in, as with load_map().
    //   kInvalid  what one of the four validate() refuses and names: limits, configuration, camera, or a block that is
    //             not aligned; or a store, and limits.store_features_max is 0
    //   kCorrupt  no vocabulary that Vocabulary::open() takes, which says why
    //   kFull     block too small
    [[nodiscard]] static Result<Engine*> create(std::span<std::byte> block, const Limits& limits,
                                                const Configuration& configuration, const CameraModel& camera,
                                                const Kernels& kernels, FeatureExtractor* extractor = nullptr,
                                                std::span<const std::byte> vocabulary = {},
                                                MapStore* store = nullptr) noexcept;

    // Where the camera is at the first frame, in the map that is made from there: in a room whose axes are known
    // already. Before the first frame; forgotten by reset() and load_map().
    //   kInvalid  no unit quaternion, a size of 1000 or more; frames were taken, or a map is there: nothing changed
    [[nodiscard]] Status start_at(const RigidTransform& map_from_camera) noexcept;

    // Tracks one frame to completion; its pixels are borrowed until the call returns. `hint`: what wheels or a
    // gyroscope say of the motion since the last frame that was taken; nullptr: nothing.
    //   kOk       pose() is for this frame, whatever its state
    //   kInvalid  size, stride or format other than the camera's, a mask of another size, time not after the last
    //   frame's, negative or above
    //             2^62 ns (146 years), a depth factor that is not positive, or a hint with what is no number, no unit
    //             quaternion or a size of 1000 or more: the frame is refused and counted, nothing else changed
    [[nodiscard]] Status submit(const Frame& frame, const MotionHint* hint = nullptr) noexcept;
    // Background work (mapping, then loop closing) for so many work units, to be called between frames: any number of
    // times, 0 included. Without it tracking still tracks. The same submit and step calls give the same bits, however
    // fast the machine is; step(a), step(b) is step(a + b). Rule and bounds: engine/schedule/scheduler.hpp.
    //   kIdle     nothing was waiting: no step is needed before the next submit
    //   kWorking  the units ended first              kDone  finished all that was waiting
    Progress step(std::uint32_t units) noexcept;

    [[nodiscard]] const PoseEstimate& pose() const noexcept;
    [[nodiscard]] const FrameStatistics& frame_statistics() const noexcept;
    [[nodiscard]] EngineStatistics statistics() const noexcept;
    [[nodiscard]] TrackingView tracking_view() noexcept;
    // Of the last frame, with their descriptors; borrowed until the next submit.
    [[nodiscard]] const FeatureSet& features() const noexcept;
    // All keyframes, as many as `out` takes (limits.keyframes_max: all); returns how many were written. With them poses
    // that were given out can be carried along as the map is corrected.
    [[nodiscard]] std::uint32_t keyframes(std::span<KeyframePose> out) const noexcept;
    // The graph over them, as many links as `out` takes; returns how many were written. First loops, the newest first;
    // then each keyframe with the older ones that it shares most points with, at most `of_each` of them, each sharing
    // map.shared_min. All: keyframes_max * of_each + kLoopLinksMax. Two keyframes may be linked in both ways. Loops of
    // a map that was loaded are not known, nor places that were recognised too roughly to correct anything by them.
    // Cost: keyframes_max * keyframes comparisons, and of_each for each link that is stronger than one chosen before.
    [[nodiscard]] std::uint32_t keyframe_links(std::span<KeyframeLink> out, std::uint32_t of_each) const noexcept;
    // One of the small depth images, index < limits.depth_images_max; borrowed until the next submit or step. Each
    // keyframe made from a frame has one, and once a second what is seen now is kept beside that of the nearest
    // keyframe. Without cells: none has this index.
    [[nodiscard]] DepthImage depth_image(std::uint32_t index) const noexcept;
    // The keyframe that saw most of what the last frame was measured against; kNoKeyframe: there is none yet.
    [[nodiscard]] std::uint64_t reference_keyframe() const noexcept;
    // Over everything that has been decided so far: equal on every build, frame by frame.
    [[nodiscard]] std::uint64_t state_hash() const noexcept;

    // --- The map on disk (engine/record/map_file.hpp). `extractor` is a number that names the extractor: 0 the
    // engine's own.
    // Begins a copy of the map into a workspace of map_copy_bytes(limits), aligned to kArenaAlignment, which is
    // borrowed until step_map_copy is done. A copy that was begun before is dropped.
    //   kOk    kFull  the workspace is too small    kNotFound  there is no map yet
    [[nodiscard]] Status begin_map_copy(std::span<std::byte> workspace, std::uint8_t extractor = 0) noexcept;
    // Goes on with it for so many units, between frames; poses, decisions and the state hash do not change by it. The
    // copy is the map as it is when this says kDone; MapFileWriter makes a file of it.
    //   kIdle  nothing was begun    kWorking  the units ended first    kDone  the workspace is the caller's again
    Progress step_map_copy(std::uint32_t units) noexcept;
    // Forgets everything and takes the map of a file in its place. Nothing is touched unless the whole file is right.
    // Until the camera is found in the map, poses are `none`.
    //   kOk    kNotFound, kEnd, kInvalid, kCorrupt, kFull (larger than the limits)  `problem` says what is wrong
    [[nodiscard]] Status load_map(std::span<const std::byte> file, MapUse use, MapFileProblem& problem,
                                  std::uint8_t extractor = 0) noexcept;
    // Whether the map is added to from the next frame on, or stays as it is apart from marks of use; what mapping has
    // begun is finished. Until the next load_map, or reset, after which a map is added to.
    void set_map_use(MapUse use) noexcept;
    // Gives the store what it has not been given of the map yet, for so many units; at the end of a run.
    //   kIdle  nothing is left, or there is no store    kWorking  more is waiting, for units or for room in the store
    Progress step_store(std::uint32_t units) noexcept;

    void set_stage_observer(StageObserver observer) noexcept;
    // Forgets everything: from here on it does what a new engine would do, bit by bit, hash and counters included. Only
    // the pools' high-water marks stay.
    void reset() noexcept;

protected:
    Engine() noexcept = default;  // what it holds lies behind it in the block
    ~Engine() = default;
};

}  // namespace stillmesh
