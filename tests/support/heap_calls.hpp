// How often this thread called the heap: malloc and its kin, hence operator new too (heap_calls.cpp).
#pragma once

#include <cstdint>

namespace stillmesh::test {

[[nodiscard]] bool heap_calls_are_counted() noexcept;
[[nodiscard]] std::uint64_t heap_calls() noexcept;

}  // namespace stillmesh::test
