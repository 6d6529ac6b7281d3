// Heap calls of this thread, counted while switched on. Link heap_count.cpp into a program of its own: it replaces
// malloc.
#pragma once

#include <cstdint>

namespace stillmesh::endurance {

extern thread_local bool is_counting_heap_calls;
extern thread_local std::uint64_t heap_calls;

}  // namespace stillmesh::endurance
