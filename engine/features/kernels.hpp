// The table of integer kernels. It lies in frame/, the first room that needs it (a room uses only rooms before it).
#pragma once

#include "engine/frame/kernels.hpp"  // IWYU pragma: export
