// When the heap is empty: a reserve is given up, once, so that what was being done succeeds and the program can end in
// order: whoever loops asks has_memory_run_out() and stops. What fails after that throws std::bad_alloc, and where
// nobody may catch that (noexcept), the program ends with a sentence. Any thread. Costs addresses, no memory.
#pragma once

namespace stillmesh {

inline constexpr const char* kNoMemory = "the system has no memory left";

// Once, at the program's start.
void keep_memory_reserve() noexcept;
[[nodiscard]] bool has_memory_run_out() noexcept;
// Says on standard error, without any memory, that there is none.
void say_no_memory() noexcept;

}  // namespace stillmesh
