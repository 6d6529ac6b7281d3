// The features of one image, and the port behind which they are found.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/check.hpp"
#include "engine/base/fixed_vector.hpp"
#include "engine/base/status.hpp"
#include "engine/features/moving_cells.hpp"
#include "engine/frame/image_view.hpp"

namespace stillmesh {

// A corner, in pixels of the full image (not of its pyramid level).
struct Keypoint {
    float x = 0;              // px, raw (distorted)
    float y = 0;              // px, raw (distorted)
    float angle_rad = 0;      // of the intensity centroid, (-pi, pi]
    std::uint16_t score = 0;  // corner score, larger is stronger
    std::uint8_t level = 0;   // pyramid level; its scale is scale_factor^level
};

// 256 binary tests (ORB, Rublee et al. 2011).
struct Descriptor {
    std::uint64_t words[4] = {0, 0, 0, 0};
    friend constexpr bool operator==(const Descriptor&, const Descriptor&) noexcept = default;
};

// Keypoints and their descriptors, index by index.
struct FeatureSet {
    FixedVector<Keypoint> keypoints;
    FixedVector<Descriptor> descriptors;

    static constexpr void plan(ArenaPlan& arena, std::uint32_t features_max) noexcept {
        FixedVector<Keypoint>::plan(arena, features_max);
        FixedVector<Descriptor>::plan(arena, features_max);
    }
    void create(Arena& arena, std::uint32_t features_max) noexcept {
        keypoints.create(arena, features_max);
        descriptors.create(arena, features_max);
    }
    void clear() noexcept {
        keypoints.clear();
        descriptors.clear();
    }
    [[nodiscard]] std::size_t size() const noexcept { return keypoints.size(); }
};

// The port: whoever finds features. Own extractor: OrbExtractor; OpenCV's: platform/opencv.
class FeatureExtractor {
public:
    // Replaces what is in `features`; never more than its capacity. `image` is borrowed until the call returns.
    //   kOk  also when nothing was found    kInvalid  image larger than the limits or too small for one level
    [[nodiscard]] virtual Status extract(const GreyView& image, FeatureSet& features) noexcept {
        static_cast<void>(image);
        static_cast<void>(features);
        check_failed("FeatureExtractor::extract not implemented", __FILE__, __LINE__);
    }

    // Where bodies move in the pictures that follow, until it is said anew; before that nowhere. An extractor may give
    // fewer features there.
    virtual void set_moving(const MovingCells& moving) noexcept { static_cast<void>(moving); }

protected:
    ~FeatureExtractor() = default;
};

}  // namespace stillmesh
