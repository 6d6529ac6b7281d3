# One compiler contract for every target of the house: C++20, warnings, floating point in source order.
# Linked as usage requirements, never as global flags, so that a consumer's project is left alone.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    if(PROJECT_IS_TOP_LEVEL)
        set(CMAKE_BUILD_TYPE Release CACHE STRING "Debug, Release, RelWithDebInfo or None" FORCE)
    else()
        set(CMAKE_BUILD_TYPE Release)  # here and below: what the project around this one is built as is its own business
    endif()
endif()
# Nothing may depend on NDEBUG: checks are always on, and Debian builds with CMAKE_BUILD_TYPE=None.
set(CMAKE_CXX_FLAGS_RELEASE "-O2")
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g")
if(STILLMESH_SANITIZE)  # enough to name file and line of what is found, and compiled a tenth faster
    set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g1")
    if(STILLMESH_SANITIZE STREQUAL "THREADS")  # compiled in two thirds of the time
        set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1")
    endif()
endif()
# For the folder at hand, of which nothing counts in a frame's time (arguments, tables, tests): two thirds of the compiling,
# and where somebody waits for it (STILLMESH_HURRY) less: the demo's program is built in 89 s instead of 112.
function(stillmesh_compile_quickly)
    add_compile_options($<$<CONFIG:Release>:$<IF:$<BOOL:${STILLMESH_HURRY}>,-Og,-O1>>)
endfunction()

add_library(stillmesh_contract INTERFACE)
target_include_directories(stillmesh_contract INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
target_compile_options(stillmesh_contract INTERFACE
    # Errors in the project's own presets only: a packager's compiler warns of what ours does not know yet.
    -Wall -Wextra -Wpedantic $<$<BOOL:${STILLMESH_WERROR}>:-Werror> -Wshadow -Wconversion -Wsign-conversion
    -Wold-style-cast -Wnon-virtual-dtor -Wunused-const-variable
    -Wno-unknown-warning-option
    # A file's own types stay its own where several files are included in one.
    $<$<AND:$<COMPILE_LANG_AND_ID:CXX,GNU>,$<BOOL:${CMAKE_UNITY_BUILD}>>:-Wno-subobject-linkage>
    $<$<BOOL:${CMAKE_CROSSCOMPILING}>:-Wno-psabi>  # gcc 10 mended how ARM passes pairs; nothing here is older
    # Same bits everywhere: no fused multiply-add behind our back, no reassociation; errno is not worth a libm call for
    # sqrt (the order matters: -fno-fast-math turns errno on again).
    -fno-fast-math -fno-math-errno -ffp-contract=off
    # What a failed check prints is a path inside the project.
    -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_FLAGS MATCHES "-O3")
    # There gcc 12 sees overlapping copies inside std::string where there are none (gcc's bug 105651).
    target_compile_options(stillmesh_contract INTERFACE -Wno-restrict)
endif()
if(CMAKE_SYSROOT)
    # A failed check in a header of the target's packages prints where the header lies there. Behind the project's own, since
    # the last that fits is used and the sysroot may lie inside the project; and by both its names, if it is behind a link.
    file(REAL_PATH "${CMAKE_SYSROOT}" stillmesh_sysroot)
    target_compile_options(stillmesh_contract INTERFACE -fmacro-prefix-map=${CMAKE_SYSROOT}=
        -fmacro-prefix-map=${stillmesh_sysroot}=)
endif()
if(CMAKE_SIZEOF_VOID_P EQUAL 4)  # files above 2 GB, and folders of file systems that number their files with 64 bits
    target_compile_definitions(stillmesh_contract INTERFACE _FILE_OFFSET_BITS=64)
endif()
if(STILLMESH_SANITIZE STREQUAL "THREADS")  # a race is printed and the program ends with 66 (tests/proofs/tsan)
    target_compile_options(stillmesh_contract INTERFACE -fsanitize=thread -fno-omit-frame-pointer)
    target_link_options(stillmesh_contract INTERFACE -fsanitize=thread)
elseif(STILLMESH_SANITIZE)
    target_compile_options(stillmesh_contract INTERFACE -fsanitize=address,undefined -fno-sanitize-recover=all
        -fno-sanitize=vptr  # would need RTTI of the engine
        -fno-omit-frame-pointer)
    target_link_options(stillmesh_contract INTERFACE -fsanitize=address,undefined)
endif()
include(toolchains/hardening.cmake)
if(STILLMESH_BUILD_FUZZERS)  # every line tells libFuzzer that it was reached
    target_compile_options(stillmesh_contract INTERFACE -fsanitize=fuzzer-no-link)
endif()
if(STILLMESH_FUZZ_COVERAGE)
    target_compile_options(stillmesh_contract INTERFACE -fprofile-instr-generate -fcoverage-mapping)
    target_link_options(stillmesh_contract INTERFACE -fprofile-instr-generate)
endif()

# The engine's own rules on top: no exceptions, no RTTI, no thread-safe statics, Eigen without heap, streams or SIMD.
add_library(stillmesh_engine_contract INTERFACE)
target_link_libraries(stillmesh_engine_contract INTERFACE stillmesh_contract)
target_compile_options(stillmesh_engine_contract INTERFACE -fno-exceptions -fno-rtti -fno-threadsafe-statics
    -fvisibility=hidden -fvisibility-inlines-hidden -ffunction-sections -fdata-sections -fno-asynchronous-unwind-tables
    # Unique symbols are global and stay so whatever objcopy is told (engine/CMakeLists.txt).
    $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>
    # One .su file beside each object: tests/house holds every frame against a limit.
    $<$<CXX_COMPILER_ID:GNU>:-fstack-usage>)
if(STILLMESH_BUILD_FUZZERS)
    # What two numbers were compared helps to read a format, not to see a picture: over the pixels it was two thirds of the
    # time. Files of the engine that read bytes have it back (engine/CMakeLists.txt).
    # And Eigen's small functions are too long to be inlined with the checks of the sanitizers in them: a tenth.
    target_compile_options(stillmesh_engine_contract INTERFACE -fno-sanitize-coverage=trace-cmp
        "SHELL:-mllvm -inlinehint-threshold=3000")
endif()

# What every translation unit that sees the engine's inner headers must agree on (tests too): Eigen's configuration.
add_library(stillmesh_eigen INTERFACE)
target_include_directories(stillmesh_eigen SYSTEM INTERFACE ${EIGEN3_INCLUDE_DIRS})
target_link_libraries(stillmesh_eigen INTERFACE Eigen3::Eigen)
target_compile_definitions(stillmesh_eigen INTERFACE EIGEN_DONT_VECTORIZE EIGEN_NO_MALLOC EIGEN_NO_IO
    EIGEN_NO_AUTOMATIC_RESIZING EIGEN_DONT_PARALLELIZE "eigen_assert=STILLMESH_CHECK")
