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
        static_cast<CameraParameters&>(camera) = c.camera;
        features = c.features;
        static_cast<DepthParameters&>(depth) = c.depth;
        static_cast<RegionKeys&>(region) = c.region;
        static_cast<PoseKeys&>(pose) = c.pose;
        static_cast<WeightKeys&>(weights) = c.weights;
        static_cast<PredictionKeys&>(prediction) = c.prediction;
        static_cast<RecoveryKeys&>(recovery) = c.recovery;
        static_cast<KeyframeKeys&>(keyframes) = c.keyframes;
        static_cast<ScheduleParameters&>(schedule) = c.schedule;
        static_cast<MappingKeys&>(mapping) = c.mapping;
        static_cast<LoopKeys&>(loop) = c.loop;
        static_cast<StoreKeys&>(store) = c.store;
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
    STILLMESH_KEYS_camera(STILLMESH_VISIT) STILLMESH_KEYS_features(STILLMESH_VISIT) STILLMESH_KEYS_depth(
        STILLMESH_VISIT) STILLMESH_KEYS_region(STILLMESH_VISIT) STILLMESH_KEYS_pose(STILLMESH_VISIT)
        STILLMESH_KEYS_weights(STILLMESH_VISIT) STILLMESH_KEYS_prediction(STILLMESH_VISIT) STILLMESH_KEYS_recovery(
            STILLMESH_VISIT) STILLMESH_KEYS_keyframes(STILLMESH_VISIT) STILLMESH_KEYS_schedule(STILLMESH_VISIT)
            STILLMESH_KEYS_mapping(STILLMESH_VISIT) STILLMESH_KEYS_loop(STILLMESH_VISIT) STILLMESH_KEYS_store(
                STILLMESH_VISIT) STILLMESH_TUNING_shutter(STILLMESH_VISIT) STILLMESH_TUNING_pose(STILLMESH_VISIT)
                STILLMESH_TUNING_matching(STILLMESH_VISIT) STILLMESH_TUNING_region(STILLMESH_VISIT)
                    STILLMESH_TUNING_weights(STILLMESH_VISIT) STILLMESH_TUNING_noise(STILLMESH_VISIT)
                        STILLMESH_TUNING_prediction(STILLMESH_VISIT) STILLMESH_TUNING_emptiness(STILLMESH_VISIT)
                            STILLMESH_TUNING_keyframes(STILLMESH_VISIT) STILLMESH_TUNING_recovery(STILLMESH_VISIT)
                                STILLMESH_TUNING_mapping(STILLMESH_VISIT) STILLMESH_TUNING_map(STILLMESH_VISIT)
                                    STILLMESH_TUNING_local_map(STILLMESH_VISIT) STILLMESH_TUNING_loop(STILLMESH_VISIT)
                                        STILLMESH_TUNING_store(STILLMESH_VISIT)
                                            v("seed", c.seed, 0.0, 9007199254740992.0, "", "of the random numbers");
}

}  // namespace stillmesh
