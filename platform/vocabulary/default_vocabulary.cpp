// The default vocabulary as a part of the program: the assembler takes the file in, the linker puts it among what is
// read only.
#include "platform/vocabulary/vocabulary_file.hpp"

// Global for the assembler: of a local name it keeps section and offset alone, and arm64's table of addresses (-fPIC)
// then has one entry for both ends. Hidden: nobody else's.
asm(".pushsection .rodata\n"
    ".globl stillmesh_default_vocabulary_begin, stillmesh_default_vocabulary_end\n"
    ".hidden stillmesh_default_vocabulary_begin, stillmesh_default_vocabulary_end\n"
    ".balign 64\n"
    "stillmesh_default_vocabulary_begin:\n"
    ".incbin \"" STILLMESH_DEFAULT_VOCABULARY
    "\"\n"
    "stillmesh_default_vocabulary_end:\n"
    ".byte 0\n"
    ".popsection\n");

extern "C" {
extern const std::byte stillmesh_default_vocabulary_begin[] __attribute__((visibility("hidden")));
extern const std::byte stillmesh_default_vocabulary_end[] __attribute__((visibility("hidden")));
}

namespace stillmesh {

std::span<const std::byte> default_vocabulary() noexcept {
    return {stillmesh_default_vocabulary_begin, stillmesh_default_vocabulary_end};
}

}  // namespace stillmesh
