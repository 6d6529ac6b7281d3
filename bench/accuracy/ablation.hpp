// What each rule of the engine earns: the same frames with it and without it. A rule that earns less than the seeds'
// noise is to go.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "bench/accuracy/runs.hpp"

namespace stillmesh::accuracy {

// A rule of docs/method.md and the assignments of the engine's numbers that switch it off, comma separated.
struct Rule {
    const char* name;
    const char* section;  // of docs/method.md
    const char* off;
};
[[nodiscard]] std::span<const Rule> rules();

// A row per rule, in Markdown, worst loss first. "loss" is the geometric mean over the runs of ATE without the rule
// over ATE with it, less one; "+-" its standard error, which is what seeds say of themselves. `with` is the variant
// that has every rule; runs that have no ATE on one side count as lost.
[[nodiscard]] std::string ablation_table(const std::vector<Result>& results, const std::string& with);

}  // namespace stillmesh::accuracy
