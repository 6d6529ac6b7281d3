// A frame before the map is asked: its features, each with its ray, its depth and how uncertain both are (paper 2.1.3,
// engine/geometry/depth_noise.hpp), as its own row's camera saw it and carried to the middle row's
// (engine/pose/rolling_shutter.hpp). An extractor may be the program's: without features that keep to the contract a
// frame is lost, not the engine. Limit: features_max features. Cost: one conversion to grey, one extraction, one pass
// over the features for measuring and one for each time they are carried.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/features/orb_extractor.hpp"
#include "engine/frame/frame.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/depth_noise.hpp"
#include "engine/geometry/pixel_noise.hpp"
#include "engine/map/map.hpp"
#include "engine/pose/depth_turn.hpp"
#include "engine/pose/rolling_shutter.hpp"
#include "engine/tracking/frame_mask.hpp"

namespace stillmesh {

// A feature with what the depth image and the camera model add to it.
struct MeasuredFeature {
    Vector2 normalised = Vector2::Zero();  // as the middle row's camera has it
    double z_m = 0;
    Vector2 seen = Vector2::Zero();  // as its own row's camera has it
    double seen_z_m = 0;
    double var_z = -1;  // < 0: no usable depth
    double var_pixel = 0;
    [[nodiscard]] bool has_depth() const noexcept { return var_z >= 0; }
    // In the camera, m; valid iff has_depth().
    [[nodiscard]] Vector3 point() const noexcept { return back_project(normalised, z_m); }
};

class MeasuredFrame {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        OrbExtractor::plan(arena, limits);
        FeatureSet::plan(arena, limits.features_max);
        arena.array<std::uint8_t>(static_cast<std::size_t>(limits.image_width_max) * limits.image_height_max);
        FixedVector<MeasuredFeature>::plan(arena, limits.features_max);
    }
    // Without an `extractor` the engine's own.
    void create(Arena& arena, const Limits& limits, const Parameters& configuration, const CameraModel& camera,
                const Kernels& kernels, FeatureExtractor* extractor) noexcept;
    // No features.
    void clear() noexcept {
        features_.clear();
        set_moving({});
    }
    // Where bodies move in the pictures that follow.
    void set_moving(const MovingCells& moving) noexcept { extractor_->set_moving(moving); }

    // The picture in grey: borrowed from the frame, or made here and valid until the next.
    [[nodiscard]] GreyView grey_of(const Frame& frame) noexcept;
    // Features of the picture, none if the extractor fails; then what the frame's depth says of them.
    void extract(const GreyView& grey) noexcept;
    void measure(const Frame& frame) noexcept;
    // Depth anew, of a camera that had turned by `turn` (rad) when its depth was taken; rows are not carried yet.
    void look_up_depth(const Vector3& turn) noexcept;
    [[nodiscard]] DepthPicture depth_picture() const noexcept { return {frame_, &camera_, &depth_, keypoints()}; }
    // That was measured last, borrowed until tracking is done with it.
    [[nodiscard]] const Frame& frame() const noexcept { return *frame_; }
    // That came with the frame.
    [[nodiscard]] FrameMask& mask() noexcept { return mask_; }
    // Carries what each row saw to the middle row of a camera that moves by `sweep` from the first row to the last.
    void carry_to_middle_row(const Vector6& sweep) noexcept;

    [[nodiscard]] std::size_t size() const noexcept { return features_.size(); }
    [[nodiscard]] const FeatureSet& features() const noexcept { return features_; }
    [[nodiscard]] std::span<const Keypoint> keypoints() const noexcept { return features_.keypoints.span(); }
    [[nodiscard]] const Keypoint& keypoint(std::size_t i) const noexcept { return features_.keypoints[i]; }
    [[nodiscard]] const Descriptor& descriptor(std::size_t i) const noexcept { return features_.descriptors[i]; }
    [[nodiscard]] const MeasuredFeature& operator[](std::size_t i) const noexcept { return measured_[i]; }
    // -.5 in the first row of the picture, .5 in the last.
    [[nodiscard]] double row_of(std::size_t i) const noexcept {
        return static_cast<double>(keypoint(i).y) / camera_.height - 0.5;
    }
    [[nodiscard]] std::uint32_t with_depth_count() const noexcept;
    // What a keyframe keeps of a feature; it shows no point yet.
    [[nodiscard]] Observation observation_of(std::size_t feature) const noexcept;

    [[nodiscard]] const CameraModel& camera() const noexcept { return camera_; }
    [[nodiscard]] const PixelNoise& pixel_noise() const noexcept { return pixel_noise_; }

private:
    CameraModel camera_;
    const Kernels* kernels_ = nullptr;
    const Frame* frame_ = nullptr;
    FeatureExtractor* extractor_ = nullptr;
    OrbExtractor orb_;
    FeatureSet features_;
    DepthParameters depth_;
    std::span<std::uint8_t> grey_;
    FixedVector<MeasuredFeature> measured_;
    PixelNoise pixel_noise_;
    FrameMask mask_;
};

}  // namespace stillmesh
