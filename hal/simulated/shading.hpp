// The grey of a face's pixels, shared by the renderers. Single precision in source order.
#pragma once

#include <cstdint>

#include "hal/simulated/renderer.hpp"

namespace stillmesh::simulated {

// Pixels x to end of a row, of one face.
struct Run {
    std::uint32_t x, end;
    float y;  // for the face's planes
};

// Adds the grey of the run to `out`; `depth` (inverse) and `out` are the row's. No face: what is seen of nothing.
void shade_run(const VisibleFace* seen, const Run& run, float level_offset, const float* depth, float* out);

// visit(id, x, end) for each run of one face in a row of ids.
template <typename Visit>
void visit_runs(const std::uint32_t* ids, std::uint32_t width, Visit&& visit) {
    for (std::uint32_t x = 0; x < width;) {
        std::uint32_t end = x + 1;
        while (end < width && ids[end] == ids[x]) ++end;
        visit(ids[x], x, end);
        x = end;
    }
}

}  // namespace stillmesh::simulated
