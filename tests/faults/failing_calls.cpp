// Put before a program with LD_PRELOAD: its n-th call of a kind fails, from main() on. What is counted is what the
// program and its libraries ask the C library for; calls that the C library makes of itself (fopen's open) are not.
//
//   STILLMESH_FAULTS   KIND:FROM:COUNT:WHAT, several with a comma between them; COUNT 0: from there on, always
//   STILLMESH_FAULTS_SEED      of what a power cut leaves
//   STILLMESH_FAULTS_COUNTS    file for "KIND CALLS" lines, written when the program ends by itself
//
// KIND: memory, map, thread, open, read, write, sync, rename, make, cut, close, look, or io: any but the first three;
// clock: readings of a clock. WHAT: the name of an errno; SHORT: half of a read or write; CEILING: memory, as long as
// no more is in use than at that call; KILL, POWER, TERM, INT, HUP: the call is made, and the program is ended at once,
// or with the power (what was not synced is lost, torn, or there in another order), or sent a signal; STEP1, STEP3600,
// STEPBACK: every clock but the monotonic one jumps by so many seconds (back: a day), the monotonic ones by the
// positive ones.
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <malloc.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>

extern "C" {
void* __libc_malloc(size_t);            // NOLINT(bugprone-reserved-identifier): the C library's own
void* __libc_calloc(size_t, size_t);    // NOLINT(bugprone-reserved-identifier)
void* __libc_realloc(void*, size_t);    // NOLINT(bugprone-reserved-identifier)
void* __libc_memalign(size_t, size_t);  // NOLINT(bugprone-reserved-identifier)
void __libc_free(void*);                // NOLINT(bugprone-reserved-identifier)
}

namespace {

enum Kind {
    kMemory,
    kMap,
    kThread,
    kOpen,
    kRead,
    kWrite,
    kSync,
    kRename,
    kMake,
    kCut,
    kClose,
    kLook,
    kIo,
    kClock,
    kKinds
};
constexpr const char* kKindNames[kKinds] = {"memory", "map",  "thread", "open",  "read", "write", "sync",
                                            "rename", "make", "cut",    "close", "look", "io",    "clock"};

enum What { kErrno, kShort, kCeiling, kKill, kPower, kSignal, kStep };
struct Fault {
    Kind kind;
    unsigned long from, count;
    What what;
    int number;  // errno, signal or seconds
};
struct Name {
    const char* name;
    What what;
    int number;
};
constexpr Name kWhats[] = {{"ENOSPC", kErrno, ENOSPC}, {"EIO", kErrno, EIO},       {"EMFILE", kErrno, EMFILE},
                           {"ENOMEM", kErrno, ENOMEM}, {"EINTR", kErrno, EINTR},   {"EROFS", kErrno, EROFS},
                           {"EACCES", kErrno, EACCES}, {"EAGAIN", kErrno, EAGAIN}, {"SHORT", kShort, 0},
                           {"CEILING", kCeiling, 0},   {"KILL", kKill, 0},         {"POWER", kPower, 0},
                           {"TERM", kSignal, SIGTERM}, {"INT", kSignal, SIGINT},   {"HUP", kSignal, SIGHUP},
                           {"STEP1", kStep, 1},        {"STEP3600", kStep, 3600},  {"STEPBACK", kStep, -86400}};

constexpr int kFaultsMax = 32;
Fault faults[kFaultsMax];
int fault_count = 0;
std::atomic<bool> is_on{false};
std::atomic<unsigned long> calls[kKinds];
std::atomic<long> in_use{0}, ceiling{0};
std::atomic<long> step_s{0}, step_monotonic_s{0};
std::uint64_t seed = 1;

template <typename Function>
Function real(Function, const char* name) {
    return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}
// The C library's function of this name, looked up once.
#define REAL(name) static const auto next = real(&name, #name)

[[noreturn]] void die(const char* what, const char* word) {
    static_cast<void>(!::syscall(1, 2, what, strlen(what)));
    static_cast<void>(!::syscall(1, 2, word, strlen(word)));
    static_cast<void>(!::syscall(1, 2, "\n", 1));
    _exit(99);
}

std::uint64_t random_bits() {
    seed += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = seed;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
}

void read_faults() {
    if (const char* const text = getenv("STILLMESH_FAULTS_SEED")) seed = strtoull(text, nullptr, 10);
    const char* text = getenv("STILLMESH_FAULTS");
    while (text != nullptr && *text != '\0') {
        char kind[16] = {}, what[16] = {};
        Fault& fault = faults[fault_count];
        int length = 0;
        if (fault_count == kFaultsMax ||
            sscanf(text, "%15[a-z]:%lu:%lu:%15[A-Z0-9]%n", kind, &fault.from, &fault.count, what, &length) != 4) {
            die("failing_calls: not understood: ", text);
        }
        int k = 0, w = 0;
        constexpr int kWhatCount = sizeof kWhats / sizeof kWhats[0];
        while (k < kKinds && strcmp(kind, kKindNames[k]) != 0) ++k;
        while (w < kWhatCount && strcmp(what, kWhats[w].name) != 0) ++w;
        if (k == kKinds || w == kWhatCount) die("failing_calls: not understood: ", text);
        fault.kind = static_cast<Kind>(k);
        fault.what = kWhats[w].what;
        fault.number = kWhats[w].number;
        ++fault_count;
        text += length;
        if (*text == ',') ++text;
    }
}

// --- what a power cut takes ------------------------------------------------------------------------------------------

// A file that was written to and not synced since, or renamed and its folder not.
struct Unsynced {
    char path[512];
    char kept[560];      // a second name of what the rename replaced; empty: there was none, or it was no rename
    off_t synced_bytes;  // whole up to here
    int descriptor;      // -1: closed
    bool is_used, is_renamed;
};
constexpr int kUnsyncedMax = 512;
Unsynced unsynced[kUnsyncedMax];
std::atomic_flag is_unsynced_busy = ATOMIC_FLAG_INIT;
bool has_power_fault = false;
struct UnsyncedLock {
    UnsyncedLock() {
        while (is_unsynced_busy.test_and_set(std::memory_order_acquire)) sched_yield();
    }
    ~UnsyncedLock() { is_unsynced_busy.clear(std::memory_order_release); }
};

void note_write(int descriptor) {
    if (!has_power_fault) return;
    struct stat status {};
    REAL(fstat);
    if (next(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) return;
    char link[64], path[512];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0) return;
    path[length] = '\0';
    const UnsyncedLock lock;
    Unsynced* free_place = nullptr;
    for (Unsynced& file : unsynced) {
        if (file.is_used && !file.is_renamed && strcmp(file.path, path) == 0) {
            file.descriptor = descriptor;
            return;
        }
        if (!file.is_used && free_place == nullptr) free_place = &file;
    }
    if (free_place == nullptr) return;
    // Before this write: what is there now is taken for synced only up to what was there when we first saw it.
    *free_place = {};
    memcpy(free_place->path, path, static_cast<size_t>(length) + 1);
    free_place->synced_bytes = status.st_size;
    free_place->descriptor = descriptor;
    free_place->is_used = true;
}

void note_sync(int descriptor) {
    if (!has_power_fault) return;
    struct stat status {};
    REAL(fstat);
    if (next(descriptor, &status) != 0) return;
    char link[64], path[512];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0) return;
    path[length] = '\0';
    const UnsyncedLock lock;
    for (Unsynced& file : unsynced) {
        if (!file.is_used) continue;
        if (S_ISDIR(status.st_mode) && file.is_renamed && strncmp(file.path, path, static_cast<size_t>(length)) == 0 &&
            strchr(file.path + length + 1, '/') == nullptr) {
            if (file.kept[0] != '\0') ::unlinkat(AT_FDCWD, file.kept, 0);
            file.is_used = false;
        } else if (!file.is_renamed && strcmp(file.path, path) == 0) {
            file.is_used = false;
        }
    }
}

void absolute(const char* path, char (&out)[512]) {
    if (path[0] == '/' || getcwd(out, sizeof out) == nullptr) {
        snprintf(out, sizeof out, "%s", path);
    } else {
        const size_t length = strlen(out);
        snprintf(out + length, sizeof out - length, "/%s", path);
    }
}

// Before a rename: what it replaces is kept under a second name, for as long as the folder is not synced.
void note_rename(const char* from, const char* to) {
    if (!has_power_fault) return;
    char source[512], target[512];
    absolute(from, source);
    absolute(to, target);
    const UnsyncedLock lock;
    Unsynced* place = nullptr;
    for (Unsynced& file : unsynced) {
        if (file.is_used && !file.is_renamed && strcmp(file.path, source) == 0) {
            memcpy(file.path, target, sizeof target);  // its bytes may be lost under the new name
        } else if (!file.is_used && place == nullptr) {
            place = &file;
        }
    }
    if (place == nullptr) return;
    *place = {};
    memcpy(place->path, target, sizeof target);
    snprintf(place->kept, sizeof place->kept, "%s.kept%d", target, static_cast<int>(place - unsynced));
    ::unlinkat(AT_FDCWD, place->kept, 0);
    if (::linkat(AT_FDCWD, target, AT_FDCWD, place->kept, 0) != 0) place->kept[0] = '\0';
    place->is_renamed = place->is_used = true;
}

// What is on the disk after the lights have gone out: of what was not synced, all, a part, or some blocks of it.
void lose_power() {
    const auto put = reinterpret_cast<ssize_t (*)(int, const void*, size_t, off_t)>(dlsym(RTLD_NEXT, "pwrite"));
    static const auto cut = reinterpret_cast<int (*)(int, off_t)>(dlsym(RTLD_NEXT, "ftruncate"));
    static const auto open_file = reinterpret_cast<int (*)(const char*, int, ...)>(dlsym(RTLD_NEXT, "open"));
    for (const Unsynced& file : unsynced) {
        if (!file.is_used || file.is_renamed) continue;
        const int descriptor = open_file(file.path, O_RDWR);
        struct stat status {};
        if (descriptor < 0 || fstat(descriptor, &status) != 0) continue;
        const off_t fresh = status.st_size - file.synced_bytes;
        const std::uint64_t fate = random_bits() % 4;
        if (fresh > 0 && fate == 1) {
            cut(descriptor, file.synced_bytes);
        } else if (fresh > 0 && fate == 2) {
            cut(descriptor, file.synced_bytes + static_cast<off_t>(random_bits() % static_cast<std::uint64_t>(fresh)));
        } else if (fresh > 0 && fate == 3) {
            constexpr char kZeros[512] = {};
            for (off_t at = file.synced_bytes; at < status.st_size; at += 512) {
                if (random_bits() % 2 == 0) continue;
                const off_t left = status.st_size - at;
                static_cast<void>(!put(descriptor, kZeros, static_cast<size_t>(left < 512 ? left : 512), at));
            }
        }
    }
    static const auto move = reinterpret_cast<int (*)(const char*, const char*)>(dlsym(RTLD_NEXT, "rename"));
    for (const Unsynced& file : unsynced) {
        if (!file.is_used || !file.is_renamed) continue;
        if (random_bits() % 2 == 0) {
            if (file.kept[0] != '\0') move(file.kept, file.path);
        } else if (file.kept[0] != '\0') {
            ::unlinkat(AT_FDCWD, file.kept, 0);
        }
    }
    ::kill(getpid(), SIGKILL);
    for (;;) pause();
}

// --- which call fails ------------------------------------------------------------------------------------------------

struct Verdict {
    int error = 0;  // 0: the call is made
    bool is_short = false;
    const Fault* after = nullptr;  // once the call was made
};

[[nodiscard]] Verdict judge(Kind kind) {
    Verdict out;
    if (!is_on.load(std::memory_order_relaxed)) return out;
    const unsigned long n = ++calls[kind];
    const bool is_io = kind >= kOpen && kind <= kLook;
    const unsigned long n_io = is_io ? ++calls[kIo] : 0;
    for (int i = 0; i < fault_count; ++i) {
        const Fault& fault = faults[i];
        const unsigned long at = fault.kind == kind ? n : fault.kind == kIo && is_io ? n_io : 0;
        if (at < fault.from || at == 0 || (fault.count != 0 && at >= fault.from + fault.count)) continue;
        switch (fault.what) {
            case kErrno: out.error = fault.number; break;
            case kShort: out.is_short = kind == kRead || kind == kWrite; break;
            case kCeiling:
                if (ceiling == 0) ceiling = in_use.load();
                break;
            case kStep:
                step_s += fault.number;
                if (fault.number > 0) step_monotonic_s += fault.number;
                break;
            default: out.after = &fault;
        }
    }
    return out;
}

void finish(const Verdict& verdict) {
    if (verdict.after == nullptr) return;
    const int error = errno;
    if (verdict.after->what == kKill) ::kill(getpid(), SIGKILL);
    if (verdict.after->what == kPower) lose_power();
    if (verdict.after->what == kSignal) ::kill(getpid(), verdict.after->number);
    errno = error;
}

// A call that fails gives `failed` and sets errno; else it is made, and what is to happen behind it happens.
template <typename Result, typename Call>
Result guarded(Kind kind, Result failed, Call call) {
    const Verdict verdict = judge(kind);
    if (verdict.error != 0) {
        errno = verdict.error;
        return failed;
    }
    const Result result = call();
    finish(verdict);
    return result;
}

template <typename Call>
ssize_t transfer(Kind kind, size_t size, Call call) {
    const Verdict verdict = judge(kind);
    if (verdict.error != 0) {
        errno = verdict.error;
        return -1;
    }
    const ssize_t result = call(verdict.is_short && size > 1 ? size / 2 : size);
    finish(verdict);
    return result;
}

// --- memory ----------------------------------------------------------------------------------------------------------

template <typename Call>
void* taken(size_t size, Call call) {
    const Verdict verdict = judge(kMemory);
    if (verdict.error != 0 || (ceiling != 0 && in_use + static_cast<long>(size) > ceiling)) {
        errno = ENOMEM;
        return nullptr;
    }
    void* const block = call();
    if (block != nullptr) in_use += static_cast<long>(malloc_usable_size(block));
    finish(verdict);
    return block;
}

mode_t mode_of(int flags, va_list list) {
    return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(list, mode_t) : 0;
}

// As after a write that has failed: ferror() is true.
int failed_stream(FILE* stream, int error) {
    constexpr int kErrorSeen = 0x20;
    if (stream != nullptr) stream->_flags |= kErrorSeen;
    errno = error;
    return EOF;
}

int (*program_main)(int, char**, char**);
int counted_main(int argc, char** argv, char** envp) {
    read_faults();
    for (int i = 0; i < fault_count; ++i) has_power_fault = has_power_fault || faults[i].what == kPower;
    is_on = true;
    return program_main(argc, argv, envp);
}

__attribute__((destructor)) void write_counts() {
    is_on = false;
    const char* const file = getenv("STILLMESH_FAULTS_COUNTS");
    if (file == nullptr) return;
    FILE* const out = fopen(file, "w");
    if (out == nullptr) return;
    for (int i = 0; i < kKinds; ++i) fprintf(out, "%s %lu\n", kKindNames[i], calls[i].load());
    fclose(out);
}

}  // namespace

extern "C" {

int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(),
                      void (*fini)(),  // NOLINT
                      void (*rtld_fini)(), void* stack_end) {
    program_main = main;
    using Start = int (*)(int (*)(int, char**, char**), int, char**, void (*)(), void (*)(), void (*)(), void*);
    return reinterpret_cast<Start>(dlsym(RTLD_NEXT, "__libc_start_main"))(counted_main, argc, argv, init, fini,
                                                                          rtld_fini, stack_end);
}

void* malloc(size_t size) {
    return taken(size, [&] { return __libc_malloc(size); });
}
void* calloc(size_t count, size_t size) {
    return taken(count * size, [&] { return __libc_calloc(count, size); });
}
void* realloc(void* block, size_t size) {
    const size_t before = block != nullptr ? malloc_usable_size(block) : 0;
    return taken(size > before ? size - before : 0, [&] {
        void* const grown = __libc_realloc(block, size);
        if (grown != nullptr || size == 0) in_use -= static_cast<long>(before);
        return grown;
    });
}
void* aligned_alloc(size_t alignment, size_t size) {
    return taken(size, [&] { return __libc_memalign(alignment, size); });
}
void* memalign(size_t alignment, size_t size) {
    return taken(size, [&] { return __libc_memalign(alignment, size); });
}
int posix_memalign(void** block, size_t alignment, size_t size) {
    void* const made = taken(size, [&] { return __libc_memalign(alignment, size); });
    if (made == nullptr) return ENOMEM;
    *block = made;
    return 0;
}
void free(void* block) {
    if (block != nullptr) in_use -= static_cast<long>(malloc_usable_size(block));
    __libc_free(block);
}

void* mmap(void* address, size_t size, int protection, int flags, int descriptor, off_t offset) {
    REAL(mmap);
    return guarded(kMap, MAP_FAILED, [&] { return next(address, size, protection, flags, descriptor, offset); });
}
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*), void* argument) {
    REAL(pthread_create);
    const Verdict verdict = judge(kThread);
    if (verdict.error != 0) return EAGAIN;
    const int result = next(thread, attributes, start, argument);
    finish(verdict);
    return result;
}

int open(const char* path, int flags, ...) {
    REAL(open);
    va_list list;
    va_start(list, flags);
    const mode_t mode = mode_of(flags, list);
    va_end(list);
    return guarded(kOpen, -1, [&] { return next(path, flags, mode); });
}
int open64(const char* path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    const mode_t mode = mode_of(flags, list);
    va_end(list);
    return open(path, flags, mode);
}
int openat(int folder, const char* path, int flags, ...) {
    REAL(openat);
    va_list list;
    va_start(list, flags);
    const mode_t mode = mode_of(flags, list);
    va_end(list);
    return guarded(kOpen, -1, [&] { return next(folder, path, flags, mode); });
}
int openat64(int folder, const char* path, int flags, ...) {
    va_list list;
    va_start(list, flags);
    const mode_t mode = mode_of(flags, list);
    va_end(list);
    return openat(folder, path, flags, mode);
}
FILE* fopen(const char* path, const char* mode) {
    REAL(fopen);
    return guarded(kOpen, static_cast<FILE*>(nullptr), [&] { return next(path, mode); });
}
FILE* fopen64(const char* path, const char* mode) {
    return fopen(path, mode);
}
FILE* fdopen(int descriptor, const char* mode) noexcept {
    REAL(fdopen);
    return guarded(kOpen, static_cast<FILE*>(nullptr), [&] { return next(descriptor, mode); });
}
DIR* opendir(const char* path) {
    REAL(opendir);
    return guarded(kOpen, static_cast<DIR*>(nullptr), [&] { return next(path); });
}
DIR* fdopendir(int descriptor) {
    REAL(fdopendir);
    return guarded(kOpen, static_cast<DIR*>(nullptr), [&] { return next(descriptor); });
}
struct dirent* readdir(DIR* folder) {
    REAL(readdir);
    return guarded(kRead, static_cast<struct dirent*>(nullptr), [&] { return next(folder); });
}
struct dirent64* readdir64(DIR* folder) {
    REAL(readdir64);
    return guarded(kRead, static_cast<struct dirent64*>(nullptr), [&] { return next(folder); });
}

ssize_t read(int descriptor, void* bytes, size_t size) {
    REAL(read);
    return transfer(kRead, size, [&](size_t part) { return next(descriptor, bytes, part); });
}
ssize_t pread(int descriptor, void* bytes, size_t size, off_t at) {
    REAL(pread);
    return transfer(kRead, size, [&](size_t part) { return next(descriptor, bytes, part, at); });
}
ssize_t pread64(int descriptor, void* bytes, size_t size, off_t at) {
    return pread(descriptor, bytes, size, at);
}
size_t fread(void* bytes, size_t size, size_t count, FILE* stream) {
    REAL(fread);
    const Verdict verdict = judge(kRead);
    if (verdict.error != 0) {
        failed_stream(stream, verdict.error);
        return 0;
    }
    const size_t result = next(bytes, size, count, stream);
    finish(verdict);
    return result;
}
ssize_t write(int descriptor, const void* bytes, size_t size) {
    REAL(write);
    note_write(descriptor);
    return transfer(kWrite, size, [&](size_t part) { return next(descriptor, bytes, part); });
}
ssize_t pwrite(int descriptor, const void* bytes, size_t size, off_t at) {
    REAL(pwrite);
    note_write(descriptor);
    return transfer(kWrite, size, [&](size_t part) { return next(descriptor, bytes, part, at); });
}
ssize_t pwrite64(int descriptor, const void* bytes, size_t size, off_t at) {
    return pwrite(descriptor, bytes, size, at);
}
ssize_t writev(int descriptor, const struct iovec* parts, int count) {
    REAL(writev);
    note_write(descriptor);
    return transfer(kWrite, 0, [&](size_t) { return next(descriptor, parts, count); });
}
size_t fwrite(const void* bytes, size_t size, size_t count, FILE* stream) {
    REAL(fwrite);
    const Verdict verdict = judge(kWrite);
    if (verdict.error != 0) {
        failed_stream(stream, verdict.error);
        return 0;
    }
    const size_t result = next(bytes, size, count, stream);
    finish(verdict);
    return result;
}
int fputs(const char* text, FILE* stream) {
    REAL(fputs);
    const Verdict verdict = judge(kWrite);
    if (verdict.error != 0) return failed_stream(stream, verdict.error);
    const int result = next(text, stream);
    finish(verdict);
    return result;
}
int fflush(FILE* stream) {
    REAL(fflush);
    const Verdict verdict = judge(kWrite);
    if (verdict.error != 0) return failed_stream(stream, verdict.error);
    const int result = next(stream);
    finish(verdict);
    return result;
}
int fclose(FILE* stream) {
    REAL(fclose);
    const Verdict verdict = judge(kClose);
    const int result = next(stream);
    if (verdict.error != 0) {
        errno = verdict.error;
        return EOF;
    }
    finish(verdict);
    return result;
}

int fsync(int descriptor) {
    REAL(fsync);
    return guarded(kSync, -1, [&] {
        note_sync(descriptor);
        return next(descriptor);
    });
}
int fdatasync(int descriptor) {
    REAL(fdatasync);
    return guarded(kSync, -1, [&] {
        note_sync(descriptor);
        return next(descriptor);
    });
}
int rename(const char* from, const char* to) noexcept {
    REAL(rename);
    return guarded(kRename, -1, [&] {
        note_rename(from, to);
        return next(from, to);
    });
}
int remove(const char* path) noexcept {
    REAL(remove);
    return guarded(kRename, -1, [&] { return next(path); });
}
int unlink(const char* path) noexcept {
    REAL(unlink);
    return guarded(kRename, -1, [&] { return next(path); });
}
int mkdir(const char* path, mode_t mode) noexcept {
    REAL(mkdir);
    return guarded(kMake, -1, [&] { return next(path, mode); });
}
int ftruncate(int descriptor, off_t size) noexcept {
    REAL(ftruncate);
    return guarded(kCut, -1, [&] { return next(descriptor, size); });
}
int ftruncate64(int descriptor, off_t size) noexcept {
    return ftruncate(descriptor, size);
}
// What is closed is closed, also where that fails.
int close(int descriptor) {
    REAL(close);
    const Verdict verdict = judge(kClose);
    const int result = next(descriptor);
    if (verdict.error != 0) {
        errno = verdict.error;
        return -1;
    }
    finish(verdict);
    return result;
}
int stat(const char* path, struct stat* status) noexcept {
    REAL(stat);
    return guarded(kLook, -1, [&] { return next(path, status); });
}
int lstat(const char* path, struct stat* status) noexcept {
    REAL(lstat);
    return guarded(kLook, -1, [&] { return next(path, status); });
}
int fstat(int descriptor, struct stat* status) noexcept {
    REAL(fstat);
    return guarded(kLook, -1, [&] { return next(descriptor, status); });
}
int access(const char* path, int mode) noexcept {
    REAL(access);
    return guarded(kLook, -1, [&] { return next(path, mode); });
}
off_t lseek(int descriptor, off_t offset, int whence) noexcept {
    REAL(lseek);
    return guarded(kLook, off_t{-1}, [&] { return next(descriptor, offset, whence); });
}
off_t lseek64(int descriptor, off_t offset, int whence) noexcept {
    return lseek(descriptor, offset, whence);
}
int flock(int descriptor, int operation) noexcept {
    REAL(flock);
    return guarded(kLook, -1, [&] { return next(descriptor, operation); });
}

int clock_gettime(clockid_t clock, struct timespec* time) noexcept {
    REAL(clock_gettime);
    const Verdict verdict = judge(kClock);
    const int result = next(clock, time);
    const bool is_steady = clock == CLOCK_MONOTONIC || clock == CLOCK_BOOTTIME || clock == CLOCK_MONOTONIC_RAW;
    if (clock == CLOCK_REALTIME) time->tv_sec += step_s;
    if (is_steady) time->tv_sec += step_monotonic_s;
    finish(verdict);
    return result;
}

// A wait until a time of a clock that has jumped is one until the time before the jump.
int clock_nanosleep(clockid_t clock, int flags, const struct timespec* until, struct timespec* left) {
    REAL(clock_nanosleep);
    struct timespec there = *until;
    if ((flags & TIMER_ABSTIME) != 0) there.tv_sec -= clock == CLOCK_REALTIME ? step_s : step_monotonic_s;
    return next(clock, flags, &there, left);
}
int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex, clockid_t clock,
                           const struct timespec* until) {
    REAL(pthread_cond_clockwait);
    struct timespec there = *until;
    there.tv_sec -= clock == CLOCK_REALTIME ? step_s : step_monotonic_s;
    return next(condition, mutex, clock, &there);
}

}  // extern "C"
