// A plug-in for qemu-user: counts the instructions of the emulated program by stage and frame, as engine_workload marks
// them. The interface is declared here because Debian ships no header of it; only what is used (version 1).
#include <cstdint>
#include <cstdio>

extern "C" {
using qemu_plugin_id_t = std::uint64_t;
struct qemu_plugin_tb;
struct qemu_info_t;
using TranslationCallback = void (*)(qemu_plugin_id_t id, qemu_plugin_tb* block);
using SyscallCallback = void (*)(qemu_plugin_id_t id, unsigned vcpu, std::int64_t number, std::uint64_t a1,
                                 std::uint64_t a2, std::uint64_t a3, std::uint64_t a4, std::uint64_t a5,
                                 std::uint64_t a6, std::uint64_t a7, std::uint64_t a8);
std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb* block);
enum qemu_plugin_op { QEMU_PLUGIN_INLINE_ADD_U64 };
void qemu_plugin_register_vcpu_tb_exec_inline(qemu_plugin_tb* block, qemu_plugin_op op, void* at, std::uint64_t number);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id, TranslationCallback callback);
void qemu_plugin_register_vcpu_syscall_cb(qemu_plugin_id_t id, SyscallCallback callback);
__attribute__((visibility("default"))) extern int qemu_plugin_version;
int qemu_plugin_version = 1;
__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t* info, int argc,
                                                               char** argv);
}

namespace {

constexpr unsigned kStages = 32, kFrameDone = 3;

std::uint64_t executed = 0;  // by the emulated code itself, which adds to it: no call for every block
std::uint64_t before = 0;    // executed, at the last marker
std::uint64_t counts[kStages];
unsigned current = 0;

void translated(qemu_plugin_id_t, qemu_plugin_tb* block) {
    qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &executed,
                                             qemu_plugin_tb_n_insns(block));
}

void called(qemu_plugin_id_t, unsigned, std::int64_t, std::uint64_t a1, std::uint64_t, std::uint64_t, std::uint64_t,
            std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t) {
    if ((a1 & 0xffff0000U) != 0x57110000U || (a1 & 0xffff) >= kStages) return;
    counts[current] += executed - before;
    before = executed;
    current = static_cast<unsigned>(a1 & 0xffff);
    if (current != kFrameDone) return;
    std::fprintf(stderr, "instructions");
    for (unsigned i = 1; i < kStages; ++i) {
        if (counts[i] != 0) std::fprintf(stderr, " %u:%llu", i, static_cast<unsigned long long>(counts[i]));
        counts[i] = 0;
    }
    std::fprintf(stderr, "\n");
}

}  // namespace

int qemu_plugin_install(qemu_plugin_id_t id, const qemu_info_t*, int, char**) {
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_vcpu_syscall_cb(id, called);
    return 0;
}
