// Loops over pixels that are compiled for AVX2 as well, of which the loader chooses: the same operations in the same
// order, so the same bits, in a half to two thirds of the time. Other compilers, C libraries and processors have the
// loops as they are.
#pragma once

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define STILLMESH_FOR_EACH_PROCESSOR __attribute__((target_clones("avx2", "default")))
#else
#define STILLMESH_FOR_EACH_PROCESSOR
#endif
