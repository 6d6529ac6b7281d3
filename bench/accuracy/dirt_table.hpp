// What each effect of hal/simulated/dirt.hpp costs the engine: the same scenes and seeds clean, with each effect alone,
// with all of them, and with all but each.
#pragma once

#include <string>
#include <vector>

#include "bench/accuracy/runs.hpp"

namespace stillmesh::accuracy {

struct DirtRun {
    std::string name;  // "clean", "shake", "all", "all but shake"
    Dirt dirt;
};
// Clean and all first, then alone and all but for each effect.
[[nodiscard]] std::vector<DirtRun> dirt_runs();

// A row per effect, in Markdown, for each variant of the engine: mean and worst ATE, the shares of frames tracked and
// of frames with a pose (tracked or unsure), and lost runs, of the effect alone and of all but it. The first row is
// clean and all. A run without an ATE counts as lost and in no mean.
[[nodiscard]] std::string dirt_table(const std::vector<Result>& results);

}  // namespace stillmesh::accuracy
