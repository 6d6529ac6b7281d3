# Debian's arm64 from Debian's own cross compiler, against the folder that toolchains/sysroot makes. Nothing else belongs
# here: the compiler contract is the same on every processor.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(STILLMESH_TRIPLET aarch64-linux-gnu)
set(STILLMESH_DEBIAN_ARCHITECTURE arm64)
set(STILLMESH_EMULATOR qemu-aarch64)
# The Raspberry Pi 4's. A newer one signs return addresses (hardening.cmake), which is a cipher a call to the emulator:
# test_mesh takes 41 s instead of 3.6. tests/package/run runs the packed program on such a one.
set(STILLMESH_EMULATOR_ARGUMENTS -cpu cortex-a72)
include(${CMAKE_CURRENT_LIST_DIR}/debian_cross.cmake)
