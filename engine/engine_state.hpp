// What lies behind an Engine at the begin of its block: the state of everything. Inner; engine.hpp is the front door.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/engine.hpp"
#include "engine/loop_closing/loop_closing.hpp"
#include "engine/mapping/global_refinement.hpp"
#include "engine/mapping/mapping.hpp"
#include "engine/paging/map_pager.hpp"
#include "engine/place/vocabulary.hpp"
#include "engine/recognition/place_search.hpp"
#include "engine/recognition/relocalisation.hpp"
#include "engine/record/map_copy.hpp"
#include "engine/schedule/scheduler.hpp"
#include "engine/tracking/tracking.hpp"

namespace stillmesh {

struct EngineState final : Engine {
    World world;
    Vocabulary vocabulary;  // empty: none
    Tracking tracking;
    Mapping mapping;
    MapOrigin map_origin;
    MapCopy map_copy;
    PlaceSearch places;
    LoopClosing loop_closing;
    GlobalRefinement refinement;
    Relocalisation relocalisation;
    std::span<MapPager> pager;  // one, if the limits ask for a store
    Scheduler scheduler;        // of the background tasks, in the order of add() in create()
    std::size_t arena_used_bytes = 0;
    std::int64_t last_time_ns = 0;
    bool has_time = false;
};

}  // namespace stillmesh
