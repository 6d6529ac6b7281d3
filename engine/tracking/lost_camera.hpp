// What becomes of a camera that has lost its way, in one machine:
//   kTracked     the last frame was measured
//   kPredicted   nothing was measured for some frames: the motion is carried on, and expected again
//   kLost        for longer, or in a map that was loaded: only a place that is recognised says where it is
//   kProbation   found where nothing foretold it. Meanwhile the map stays as it is and no pose is given out: a
//                person who stands like one that the map still holds is a place, too, for a frame or two
// A lost camera is looked for near where it was by the descriptors of one keyframe a frame (recovery.hpp), and anywhere
// by the words of its picture (relocalisation.hpp). A place is tried on the camera's state; what fails, at once or in
// its probation, puts the state back whole. Cost: nothing while the camera is tracked.
#pragma once

#include <cstdint>

#include "engine/recognition/relocalisation.hpp"
#include "engine/tracking/camera_state.hpp"
#include "engine/tracking/empty_places.hpp"
#include "engine/tracking/frame_estimate.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class LostCamera {
public:
    enum class State : std::uint8_t { kTracked, kPredicted, kLost, kProbation };

    // All outlive it. `relocalisation`: nullptr without a vocabulary.
    void create(World& world, FrameEstimator& estimator, const EmptyPlaces& empty_places,
                Relocalisation* relocalisation) noexcept;
    void reset() noexcept;

    [[nodiscard]] State state(const CameraState& camera) const noexcept;
    // A map that was loaded to localise in, or while it is not sure that the camera is here: nothing is learnt.
    [[nodiscard]] bool keeps_map() const noexcept { return world_->is_frozen || is_on_probation_; }
    // Something foretells this frame's pose.
    [[nodiscard]] bool is_foretold(const CameraState& camera) const noexcept { return state(camera) != State::kLost; }

    // A new frame. True: a probation has taken too long, and the camera is where it was before.
    [[nodiscard]] bool begin_frame(CameraState& camera) noexcept;
    // The map under a camera on probation moved: where it was before moves along.
    void follow(const CameraMove& move) noexcept { before_.follow(move); }
    // Whether an estimate around what the motion foretold is the camera's pose. What is not sure and lies where the
    // camera cannot be, or follows from nothing, is the motion of a body.
    [[nodiscard]] bool accepts(const Estimate& estimate, const CameraState& camera) noexcept;
    // The frame of a probation was `measured` or not. False: the probation failed, and the camera is where it was
    // before.
    [[nodiscard]] bool prove(bool is_measured, CameraState& camera) noexcept;
    // Looks for a lost camera; `expected`: what the frame was expected to be. True: `estimate` is to be learnt from,
    // and then settle() to be called.
    [[nodiscard]] bool find(const RegionContext& expected, CameraState& camera, Estimate& estimate) noexcept;
    void settle(CameraState& camera) noexcept;
    // One more frame without a pose. True: the motion is carried on.
    [[nodiscard]] bool lose(CameraState& camera) noexcept;
    // A frame on probation, for which no pose is given out.
    void count_unproven() noexcept { world_->statistics.frames_lost += before_.is_placed ? 1U : 0U; }

private:
    [[nodiscard]] bool recover(const RegionContext& expected, CameraState& camera, Estimate& estimate) noexcept;
    [[nodiscard]] bool relocalise(const RegionContext& expected, CameraState& camera, Estimate& estimate) noexcept;
    [[nodiscard]] bool try_place(const SE3& world_from_camera, RegionContext expected, CameraState& camera,
                                 Estimate& estimate) noexcept;
    [[nodiscard]] bool is_place(const Estimate& estimate) const noexcept;
    [[nodiscard]] bool is_out_of_touch(const CameraState& camera) const noexcept;
    [[nodiscard]] bool sees_through(const SE3& world_from_camera, double noise_depth) noexcept;
    [[nodiscard]] bool is_outweighed(const CameraState& camera) noexcept;
    void query_places(const NoiseFactors& noise) noexcept;
    void confirm(CameraState& camera) noexcept;
    void put_back(CameraState& camera) noexcept;

    World* world_ = nullptr;
    FrameEstimator* estimator_ = nullptr;
    const EmptyPlaces* empty_places_ = nullptr;
    Relocalisation* relocalisation_ = nullptr;

    CameraState before_;      // the camera before a place was tried
    std::uint64_t here_ = 0;  // evidence of all frames of a probation (relocalisation.hpp)
    std::uint64_t elsewhere_ = 0;
    std::uint32_t frames_ = 0;       // of the probation
    std::uint32_t frames_left_ = 0;  // that have to agree
    bool is_on_probation_ = false;
    bool is_by_words_ = false;  // the place that is tried
    bool is_unexpected_ = false;
};

}  // namespace stillmesh
