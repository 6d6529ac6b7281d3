#include "tests/support/heap_calls.hpp"

#include <cstddef>

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define STILLMESH_OWN_HEAP 0
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
#define STILLMESH_OWN_HEAP 0
#endif
#ifndef STILLMESH_OWN_HEAP
#define STILLMESH_OWN_HEAP 1
#endif

namespace {
thread_local std::uint64_t calls = 0;
}

#if STILLMESH_OWN_HEAP
// What glibc's names stand for when somebody takes the plain ones.
extern "C" {
void* __libc_malloc(std::size_t size_bytes);
void* __libc_calloc(std::size_t count, std::size_t size_bytes);
void* __libc_realloc(void* block, std::size_t size_bytes);
void* __libc_memalign(std::size_t alignment, std::size_t size_bytes);
void __libc_free(void* block);

void* malloc(std::size_t size_bytes) noexcept {
    ++calls;
    return __libc_malloc(size_bytes);
}
void* calloc(std::size_t count, std::size_t size_bytes) noexcept {
    ++calls;
    return __libc_calloc(count, size_bytes);
}
void* realloc(void* block, std::size_t size_bytes) noexcept {
    ++calls;
    return __libc_realloc(block, size_bytes);
}
void* memalign(std::size_t alignment, std::size_t size_bytes) noexcept {
    ++calls;
    return __libc_memalign(alignment, size_bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t size_bytes) noexcept {
    ++calls;
    return __libc_memalign(alignment, size_bytes);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size_bytes) noexcept {
    ++calls;
    *block = __libc_memalign(alignment, size_bytes);
    return *block == nullptr ? 12 : 0;
}
void free(void* block) noexcept {
    ++calls;
    __libc_free(block);
}
}
#endif

namespace stillmesh::test {

bool heap_calls_are_counted() noexcept {
    return STILLMESH_OWN_HEAP != 0;
}
std::uint64_t heap_calls() noexcept {
    return calls;
}

}  // namespace stillmesh::test
