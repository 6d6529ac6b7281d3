#include "platform/linux/memory_reserve.hpp"

#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>

#include "platform/linux/service.hpp"

namespace stillmesh {
namespace {

// For a summary, a report and a path of some 50 000 poses.
constexpr std::size_t kReserveBytes = std::size_t{4} << 20U;

std::atomic<void*> reserve{nullptr};
std::atomic<bool> has_run_out{false};

void give_up_reserve() {
    has_run_out = true;
    void* const block = reserve.exchange(nullptr);
    if (block == nullptr) throw std::bad_alloc();
    std::free(block);  // NOLINT(cppcoreguidelines-no-malloc): the heap that is empty is malloc's
}

void put(const char* text) noexcept {
    static_cast<void>(!::write(STDERR_FILENO, text, std::strlen(text)));
}

// An exception that left a noexcept function or a thread: a lack of memory behind the reserve, or a bug of ours.
[[noreturn]] void end() noexcept {
    if (has_run_out) {
        say_no_memory();
        ::_exit(1);
    }
    std::abort();
}

}  // namespace

void keep_memory_reserve() noexcept {
    reserve = std::malloc(kReserveBytes);  // NOLINT(cppcoreguidelines-no-malloc)
    std::set_new_handler(give_up_reserve);
    std::set_terminate(end);
}

bool has_memory_run_out() noexcept {
    return has_run_out;
}

void say_no_memory() noexcept {
    put(log_prefix(LogLevel::kError));
    put("stillmesh: ");
    put(kNoMemory);
    put("; the last map that was saved is whole.\n");
}

}  // namespace stillmesh
