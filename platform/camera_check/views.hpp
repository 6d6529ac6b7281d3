// Two views of a scene as the camera check needs them: features with ray and measured depth, and which of one view is
// which of the other. Matched by descriptors and place in the picture alone: a calibration that is wrong must not
// decide what is matched. Limits: features_max of a view. Cost: some 50 comparisons of descriptors a feature.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"

namespace stillmesh {

struct ViewFeature {
    float u = 0, v = 0;       // px, as seen
    float x = 0, y = 0;       // normalised, undistorted, as the calibration has it
    float inverse_depth = 0;  // 1/m as the depth factor has it; 0: none, or not the same all around
    float noise_px = 1;       // of u and v
    std::uint8_t level = 0;
    Descriptor descriptor;
};

class View {
public:
    explicit View(std::uint32_t features_max = 1000);
    void clear() { features_.clear(); }
    void take(const Frame& frame, const FeatureSet& features, const CameraModel& camera);
    [[nodiscard]] const std::vector<ViewFeature>& features() const { return features_; }

private:
    std::vector<ViewFeature> features_;
};

struct ViewMatch {
    ViewFeature a, b;
};

class ViewMatcher {
public:
    explicit ViewMatcher(std::uint32_t features_max = 1000);
    // Features of `a` that are features of `b`, with depth in both, each the other's best. They are looked for within
    // `reach_px` of where the picture has gone by (u, v); of `a` every so many.
    const std::vector<ViewMatch>& match(const View& a, const View& b, float reach_px, float u = 0, float v = 0,
                                        std::size_t every = 1);
    // Of the last matches: how far the picture has moved, the median of both directions and of the length, px.
    struct Flow {
        float u = 0, v = 0, length = 0;
    };
    [[nodiscard]] Flow flow();

private:
    struct Best {
        int distance = 0, second = 0;
        std::int32_t other = -1;
        void see(int new_distance, std::size_t index);
    };
    void order(const View& view);
    [[nodiscard]] float median();

    std::vector<Best> forward_, back_;
    // Features in the order of their cells; where each cell begins.
    std::vector<std::uint16_t> ordered_;
    std::vector<std::uint32_t> begins_;
    std::vector<ViewMatch> matches_;
    std::vector<float> lengths_;
};

}  // namespace stillmesh
