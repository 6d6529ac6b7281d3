# What makes a mistake in memory harder to use: on in the project's own presets and packages (STILLMESH_HARDEN). A packager's
# compiler has flags of its own, which are left as they are. Whether what is built has it: House.hardening.
if(NOT STILLMESH_HARDEN)
    return()
endif()
include(CheckPIESupported)
check_pie_supported()
target_link_options(stillmesh_contract INTERFACE -Wl,-z,relro -Wl,-z,now -Wl,-z,noexecstack)
# Marks of where an indirect jump may land and a return may lead. Debian 12's own start-up code has none, and its linker then
# marks no program; a library keeps them, and return addresses are signed on arm64 whatever the marks say.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_options(stillmesh_contract INTERFACE -fcf-protection=full)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    target_compile_options(stillmesh_contract INTERFACE -mbranch-protection=standard)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" OR CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")  # clang 14 knows it there only
    target_compile_options(stillmesh_contract INTERFACE -fstack-clash-protection)
endif()
# A guard beside every array on the stack, and libc's calls with the size of their buffer. Not in the engine (STILLMESH_BARE),
# which needs nothing of a C library but copies (House.symbols), nor where sanitizers look themselves or nothing is optimised.
set(is_bare $<BOOL:$<TARGET_PROPERTY:STILLMESH_BARE>>)
target_compile_options(stillmesh_contract INTERFACE $<$<NOT:${is_bare}>:-fstack-protector-strong>)
if(NOT STILLMESH_SANITIZE)
    target_compile_options(stillmesh_contract INTERFACE
        $<$<NOT:$<OR:${is_bare},$<CONFIG:Debug>>>:-U_FORTIFY_SOURCE$<SEMICOLON>-D_FORTIFY_SOURCE=2>)
endif()
