// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// Places beyond memory (engine/paging/map_pager.hpp). Nothing of it without a store.
#define STILLMESH_TUNING_store(KEY) \
    KEY(store, std::uint32_t, pause_frames, 3, 1.0, 1e6, "frames", "between two regions that come back") \
    KEY(store, double, score_share, 0.5, 0.0, 1.0, "", "of the least score among neighbours, to come back") \
    KEY(store, double, lost_score_min, 0.01, 0.0, 1.0, "", "of a lost camera's picture, to come back")
struct StoreTuning { STILLMESH_TUNING_store(STILLMESH_FIELD) };
struct StoreParameters : StoreKeys, StoreTuning {};

// clang-format on

}  // namespace stillmesh
