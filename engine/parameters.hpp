// All numbers of the engine: what the configuration gives, and the tuning of every room. Inner; programs know the
// configuration alone.
#pragma once

#include "engine/configuration.hpp"
#include "engine/loop_closing/tuning.hpp"
#include "engine/map/tuning.hpp"
#include "engine/mapping/tuning.hpp"
#include "engine/matching/tuning.hpp"
#include "engine/paging/tuning.hpp"
#include "engine/pose/tuning.hpp"
#include "engine/recognition/tuning.hpp"
#include "engine/static_region/tuning.hpp"
#include "engine/tracking/tuning.hpp"

namespace stillmesh {

struct Parameters {
    constexpr Parameters() noexcept = default;
    constexpr Parameters(const Configuration& c) noexcept { *this = c; }  // NOLINT: a configuration is parameters
    constexpr Parameters& operator=(const Configuration& c) noexcept {
        STILLMESH_ALL_KEYS(STILLMESH_ASSIGN)
        seed = c.seed;
        return *this;
    }

    CameraParameters camera;
    ShutterParameters shutter;
    FeatureParameters features;
    DepthParameters depth;
    MatchingParameters matching;
    RegionParameters region;
    PoseParameters pose;
    WeightParameters weights;
    NoiseParameters noise;
    PredictionParameters prediction;
    HintParameters hint;
    MaskParameters mask;
    AttentionParameters attention;
    RecoveryParameters recovery;
    EmptinessParameters emptiness;
    KeyframeParameters keyframes;
    ScheduleParameters schedule;
    MappingParameters mapping;
    MapParameters map;
    LocalMapParameters local_map;
    LoopParameters loop;
    StoreParameters store;
    std::uint64_t seed = 1;  // of RANSAC
};

// As visit_parameters() of a configuration, for every number of every tier.
template <typename Visitor>
constexpr void visit_all_parameters(Parameters& c, Visitor&& v) {
    // clang-format off
    STILLMESH_ALL_KEYS(STILLMESH_VISIT)
    STILLMESH_TUNING_shutter(STILLMESH_VISIT) STILLMESH_TUNING_pose(STILLMESH_VISIT)
    STILLMESH_TUNING_matching(STILLMESH_VISIT) STILLMESH_TUNING_region(STILLMESH_VISIT)
    STILLMESH_TUNING_weights(STILLMESH_VISIT) STILLMESH_TUNING_noise(STILLMESH_VISIT)
    STILLMESH_TUNING_prediction(STILLMESH_VISIT) STILLMESH_TUNING_hint(STILLMESH_VISIT)
    STILLMESH_TUNING_mask(STILLMESH_VISIT) STILLMESH_TUNING_attention(STILLMESH_VISIT)
    STILLMESH_TUNING_emptiness(STILLMESH_VISIT)
    STILLMESH_TUNING_keyframes(STILLMESH_VISIT) STILLMESH_TUNING_recovery(STILLMESH_VISIT)
    STILLMESH_TUNING_mapping(STILLMESH_VISIT) STILLMESH_TUNING_map(STILLMESH_VISIT)
    STILLMESH_TUNING_local_map(STILLMESH_VISIT) STILLMESH_TUNING_loop(STILLMESH_VISIT)
    STILLMESH_TUNING_store(STILLMESH_VISIT)
        // clang-format on
        v("seed", c.seed, 0.0, 9007199254740992.0, "", "of the random numbers");
}

}  // namespace stillmesh
