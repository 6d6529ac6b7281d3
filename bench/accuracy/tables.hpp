// Results as tables that people read.
#pragma once

#include <string>
#include <vector>

#include "bench/accuracy/runs.hpp"

namespace stillmesh::accuracy {

[[nodiscard]] std::string run_table(const std::vector<Result>& results);     // a line per run
[[nodiscard]] std::string scene_table(const std::vector<Result>& results);   // mean and worst over the seeds
[[nodiscard]] std::string shares_table(const std::vector<Result>& results);  // method.md 11, for the engine
[[nodiscard]] std::string nees_table(const std::vector<Result>& results);    // static scenes
// With mapping and without it, where there are both.
[[nodiscard]] std::string mapping_table(const std::vector<Result>& results);
[[nodiscard]] std::string summary(const std::vector<Result>& results);  // the promises over all runs

}  // namespace stillmesh::accuracy
