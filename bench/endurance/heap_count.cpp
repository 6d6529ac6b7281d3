#include "bench/endurance/heap_count.hpp"

#include <cstddef>

// Every heap call of the program comes by here, operator new too.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
}

namespace stillmesh::endurance {

thread_local bool is_counting_heap_calls = false;
thread_local std::uint64_t heap_calls = 0;

namespace {
void count() {
    if (is_counting_heap_calls) ++heap_calls;
}
}  // namespace
}  // namespace stillmesh::endurance

extern "C" {
void* malloc(std::size_t size) noexcept {
    stillmesh::endurance::count();
    return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) noexcept {
    stillmesh::endurance::count();
    return __libc_calloc(count, size);
}
void* realloc(void* block, std::size_t size) noexcept {
    stillmesh::endurance::count();
    return __libc_realloc(block, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
    stillmesh::endurance::count();
    return __libc_memalign(alignment, size);
}
}
