// What the program's exit says; a stop by a signal ends with 128 + its number (130: Ctrl-C, 143: SIGTERM), after
// everything has been written.
#pragma once

namespace stillmesh {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;  // it ran, but: a lost camera, no pose, a broken image, a full disk
inline constexpr int kExitUsage = 2;   // bad usage or input; nothing was started

}  // namespace stillmesh
