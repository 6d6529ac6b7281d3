// Preloaded into a program (LD_PRELOAD): counts every call of malloc and its kin, in every thread, by the stack that
// made it, between two lines that the program writes, and puts the stacks into a file. The steady state of `stillmesh
// run
// --trajectory FILE` is one line a frame. free is not counted: what is freed was taken. Nothing here calls the heap: a
// table of fixed size, and the dynamic linker asked for names only at the end.
//   STILLMESH_HEAP_TRACE        the file
//   STILLMESH_HEAP_TRACE_FROM   counting begins when so many lines are written (to files, not standard streams)
//   STILLMESH_HEAP_TRACE_TO     and ends here; the file is written
#include <dlfcn.h>
#include <execinfo.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>

// What glibc's names stand for when somebody takes the plain ones.
extern "C" {
void* __libc_malloc(std::size_t size_bytes);
void* __libc_calloc(std::size_t count, std::size_t size_bytes);
void* __libc_realloc(void* block, std::size_t size_bytes);
void* __libc_memalign(std::size_t alignment, std::size_t size_bytes);
}

namespace {

constexpr int kDepth = 24;
constexpr std::size_t kStacksMax = 16384;

struct Stack {
    std::uint64_t hash = 0;
    std::uint64_t calls = 0;
    int depth = 0;
    void* callers[kDepth] = {};
};
Stack stacks[kStacksMax];
std::uint64_t lost = 0;
pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
std::atomic<bool> is_counting{false};
std::atomic<long> lines{0};
long from = 0, to = 0;
__thread bool is_inside = false;  // backtrace may call the heap itself, the first time

void count() noexcept {
    if (!is_counting.load(std::memory_order_relaxed) || is_inside) return;
    is_inside = true;
    void* callers[kDepth + 2];
    const int depth = backtrace(callers, kDepth + 2) - 2;  // without this function and malloc
    std::uint64_t hash = 14695981039346656037U;
    for (int i = 0; i < depth; ++i) hash = (hash ^ reinterpret_cast<std::uintptr_t>(callers[i + 2])) * 1099511628211U;
    pthread_mutex_lock(&mutex);
    std::size_t at = hash % kStacksMax;
    std::size_t looked = 0;
    while (stacks[at].calls != 0 && stacks[at].hash != hash && looked < kStacksMax) {
        at = (at + 1) % kStacksMax;
        ++looked;
    }
    if (looked == kStacksMax) {
        ++lost;
    } else if (stacks[at].calls++ == 0) {
        stacks[at].hash = hash;
        stacks[at].depth = depth < 0 ? 0 : depth;
        for (int i = 0; i < depth; ++i) stacks[at].callers[i] = callers[i + 2];
    }
    pthread_mutex_unlock(&mutex);
    is_inside = false;
}

// One line a stack: calls, then module+offset from the inside out.
void write_stacks() noexcept {
    const char* const name = std::getenv("STILLMESH_HEAP_TRACE");
    std::FILE* const file = name == nullptr ? nullptr : std::fopen(name, "w");
    if (file == nullptr) return;
    std::fprintf(file, "lost %llu\n", static_cast<unsigned long long>(lost));
    for (const Stack& stack : stacks) {
        if (stack.calls == 0) continue;
        std::fprintf(file, "%llu", static_cast<unsigned long long>(stack.calls));
        for (int i = 0; i < stack.depth; ++i) {
            Dl_info info{};
            // A return address: the call stands one byte before it.
            const char* const address = static_cast<const char*>(stack.callers[i]) - 1;
            const bool is_known = dladdr(address, &info) != 0 && info.dli_fname != nullptr;
            std::fprintf(
                file, " %s+0x%llx", is_known ? info.dli_fname : "?",
                static_cast<unsigned long long>(is_known ? address - static_cast<const char*>(info.dli_fbase) : 0));
        }
        std::fprintf(file, "\n");
    }
    std::fclose(file);
}

[[nodiscard]] long number(const char* name) noexcept {
    const char* const text = std::getenv(name);
    return text == nullptr ? 0 : std::strtol(text, nullptr, 10);
}

__attribute__((constructor)) void begin() {
    void* callers[4];
    static_cast<void>(backtrace(callers, 4));  // loads the unwinder
    from = number("STILLMESH_HEAP_TRACE_FROM");
    to = number("STILLMESH_HEAP_TRACE_TO");
}

}  // namespace

extern "C" ssize_t write(int descriptor, const void* bytes, std::size_t size_bytes) {
    const bool is_line =
        descriptor > STDERR_FILENO && size_bytes > 0 && static_cast<const char*>(bytes)[size_bytes - 1] == '\n';
    if (is_line) {
        const long line = ++lines;
        if (line == from) is_counting = true;
        if (line == to) {
            is_counting = false;
            write_stacks();
        }
    }
    return syscall(SYS_write, descriptor, bytes, size_bytes);
}

extern "C" {
void* malloc(std::size_t size_bytes) noexcept {
    count();
    return __libc_malloc(size_bytes);
}
void* calloc(std::size_t count_of, std::size_t size_bytes) noexcept {
    count();
    return __libc_calloc(count_of, size_bytes);
}
void* realloc(void* block, std::size_t size_bytes) noexcept {
    count();
    return __libc_realloc(block, size_bytes);
}
void* memalign(std::size_t alignment, std::size_t size_bytes) noexcept {
    count();
    return __libc_memalign(alignment, size_bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t size_bytes) noexcept {
    count();
    return __libc_memalign(alignment, size_bytes);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t size_bytes) noexcept {
    count();
    *block = __libc_memalign(alignment, size_bytes);
    return *block == nullptr ? 12 : 0;
}
}
