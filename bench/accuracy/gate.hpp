// The bars. They are what the product promises: a run that misses one is a failure with a name, never a reason to move
// the bar.
#pragma once

#include <string>
#include <vector>

#include "bench/accuracy/runs.hpp"

namespace stillmesh::accuracy {

// kMinority: a body covers most of the picture again and again. kOpen: nothing is promised yet (trolley_first,
// crowd_close, lift).
enum class Group { kStatic, kSitting, kWalking, kTrolley, kMinority, kOpen, kRearranged, kDirty, kRecording };

[[nodiscard]] Group group_of(const Result& result);
// Largest ATE RMSE, m; 0: no bar. Tracking alone (variant "alone") has bars of its own.
[[nodiscard]] double ate_bar(const Result& result);

inline constexpr double kCoverageMin = 0.98;
inline constexpr double kWrongTrackedMax = 0.001;
inline constexpr double kRightTrackedMin = 0.90;
inline constexpr double kNeesMin = 3, kNeesMax = 12;
inline constexpr double kRegionEarnsMin = 4;  // mean ATE of the walking scenes, region off over on

// What mapping is to earn over tracking alone, and what it is held to today (docs/accuracy.md): of the mean ATE over
// all sets, and of every single set, whose seeds are taken together.
inline constexpr double kMappingMeanGoal = 0.8, kMappingMeanMax = 1.1;
inline constexpr double kMappingSetGoal = 1.1, kMappingSetSlack_m = 0.001;
inline constexpr std::uint64_t kMappingFramesMin = 300;

// Sums over the runs that count: variant "on", without the open and the dirty scenes. What is wrong on a recording
// is not summed: its truth is not good enough (docs/accuracy.md).
struct Sureness {
    std::uint64_t judged_tracked = 0, wrong_tracked = 0, right = 0, right_tracked = 0;
};
[[nodiscard]] Sureness sureness_of(const std::vector<Result>& results);

struct Consistency {
    std::uint64_t frames = 0, covariance_bad = 0;
    double first = 0, fit = 0, ate = 0;  // mean NEES over the frames of the static scenes
};
[[nodiscard]] Consistency consistency_of(const std::vector<Result>& results);

struct RegionEarns {
    std::size_t runs = 0;
    double on_m = 0, off_m = 0;  // mean ATE of the walking scenes
    [[nodiscard]] double ratio() const { return on_m > 0 ? off_m / on_m : 0; }
};
[[nodiscard]] RegionEarns region_earns(const std::vector<Result>& results);

// A scene, its seeds together, or a recording, of which there are runs with mapping ("on") and without ("alone").
struct MappingSet {
    std::string name;
    std::size_t runs = 0;
    double on_m = 0, alone_m = 0;  // mean ATE
    [[nodiscard]] double ratio() const { return alone_m > 0 ? on_m / alone_m : 0; }
};
// Of at least kMappingFramesMin frames, and without bodies that hide the room, and the dirty scenes.
[[nodiscard]] std::vector<MappingSet> mapping_sets(const std::vector<Result>& results);
[[nodiscard]] MappingSet mapping_mean(const std::vector<MappingSet>& sets);

// Names of gates: static, sitting, walking, trolley, recordings (error, coverage, not lost); minority (error); tracked
// (hardly a tracked frame is wrong), right (most right frames are tracked), nees, region (extraction earns its place),
// mapping (no worse than tracking alone).
[[nodiscard]] const std::vector<std::string>& gate_names();
// One sentence per failure, in the order of gate_names(). A gate without a run to look at fails.
[[nodiscard]] std::vector<std::string> failures_of(const std::vector<Result>& results,
                                                   const std::vector<std::string>& names);

}  // namespace stillmesh::accuracy
