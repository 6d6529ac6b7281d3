# Debian's arm64 from Debian's own cross compiler, against the folder that toolchains/sysroot makes. Nothing else belongs
# here: the compiler contract is the same on every processor.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(STILLMESH_TRIPLET aarch64-linux-gnu)
set(STILLMESH_DEBIAN_ARCHITECTURE arm64)
set(STILLMESH_EMULATOR qemu-aarch64)
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
