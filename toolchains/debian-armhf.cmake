# Debian's armhf (armv7-a, VFPv3-D16, hard float; NEON is not in it) from Debian's own cross compiler, against the folder
# that toolchains/sysroot makes. Nothing else belongs here: the compiler contract is the same on every processor.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(STILLMESH_TRIPLET arm-linux-gnueabihf)
set(STILLMESH_DEBIAN_ARCHITECTURE armhf)
set(STILLMESH_EMULATOR qemu-arm)
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
