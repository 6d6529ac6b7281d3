// The integer kernels of the engine as a table of functions: plain C++, SSE2, AVX2 (later NEON) give the same bits, and
// `platform` chooses the fastest that the processor has.
#pragma once
namespace stillmesh {
struct Kernels;
}  // namespace stillmesh
