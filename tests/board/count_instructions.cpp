// A plug-in for qemu-user: counts the instructions of the emulated program by stage, as engine_workload marks them. The
// interface is declared here because Debian ships no header of it; only what is used (version 1).
#include <cstdint>
#include <cstdio>

extern "C" {
using qemu_plugin_id_t = std::uint64_t;
struct qemu_plugin_tb;
struct qemu_info_t;
using VcpuCallback = void (*)(unsigned vcpu, void* user);
using TranslationCallback = void (*)(qemu_plugin_id_t id, qemu_plugin_tb* block);
using SyscallCallback = void (*)(qemu_plugin_id_t id, unsigned vcpu, std::int64_t number, std::uint64_t a1,
                                 std::uint64_t a2, std::uint64_t a3, std::uint64_t a4, std::uint64_t a5,
                                 std::uint64_t a6, std::uint64_t a7, std::uint64_t a8);
using ExitCallback = void (*)(qemu_plugin_id_t id, void* user);
std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb* block);
void qemu_plugin_register_vcpu_tb_exec_cb(qemu_plugin_tb* block, VcpuCallback callback, int flags, void* user);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, TranslationCallback callback);
void qemu_plugin_register_vcpu_syscall_cb(qemu_plugin_id_t id, SyscallCallback callback);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, ExitCallback callback, void* user);
__attribute__((visibility("default"))) extern int qemu_plugin_version;
int qemu_plugin_version = 1;
__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t* info, int argc,
                                                               char** argv);
}

namespace {

std::uint64_t counts[32];
unsigned current = 0;

void executed(unsigned, void* user) {
    counts[current] += reinterpret_cast<std::uintptr_t>(user);
}

void translated(qemu_plugin_id_t, qemu_plugin_tb* block) {
    qemu_plugin_register_vcpu_tb_exec_cb(block, executed, 0, reinterpret_cast<void*>(qemu_plugin_tb_n_insns(block)));
}

void called(qemu_plugin_id_t, unsigned, std::int64_t, std::uint64_t a1, std::uint64_t, std::uint64_t, std::uint64_t,
            std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t) {
    if ((a1 & 0xffff0000U) == 0x57110000U && (a1 & 0xffff) < 32) current = static_cast<unsigned>(a1 & 0xffff);
}

void finished(qemu_plugin_id_t, void*) {
    for (unsigned i = 0; i < 32; ++i)
        if (counts[i] != 0)
            std::fprintf(stderr, "instructions %u %llu\n", i, static_cast<unsigned long long>(counts[i]));
}

}  // namespace

int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t*, int, char**) {
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_vcpu_syscall_cb(id, called);
    qemu_plugin_register_atexit_cb(id, finished, nullptr);
    return 0;
}
