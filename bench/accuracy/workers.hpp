// Runs on all cores: one process per run, so that a failed check ends one run and is told, not the bench.
#pragma once

#include <string>
#include <vector>

#include "bench/accuracy/runs.hpp"

namespace stillmesh::accuracy {

struct Outcome {
    std::vector<Result> results;        // in the order of the inputs
    std::vector<std::string> failures;  // runs that gave no result, and why
    bool is_stopped = false;            // by a signal; what was done is kept
};

[[nodiscard]] Outcome run_all(const std::vector<Input>& inputs, const std::vector<Variant>& variants,
                              const RunOptions& options, std::uint32_t jobs);

}  // namespace stillmesh::accuracy
