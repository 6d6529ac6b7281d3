// Watches whether calibration and streams can be what they are said to be, while a camera is tracked: beside the
// engine, from its features and the depth images, without its poses. Three questions, each with its own evidence:
// depth unit (depth_steps.hpp), focal lengths and centre (self_calibration.hpp), and whether depth belongs to colour at
// all (depth_edges.hpp and rigidity.hpp together). How far depth is registered is told, and no fault. It rather misses
// a fault than to see one that is not there (docs/camera.md says what is missed). Cost: .8 ms a frame in the mean,
// 2 ms at first, up to 15 ms where a calibration is fitted.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "platform/camera_check/depth_edges.hpp"
#include "platform/camera_check/depth_steps.hpp"
#include "platform/camera_check/rigidity.hpp"
#include "platform/camera_check/self_calibration.hpp"
#include "platform/camera_check/views.hpp"

namespace stillmesh {

enum class CameraFault : std::uint8_t { kDepthUnit = 0, kLens = 1, kStranger = 2 };
inline constexpr std::size_t kCameraFaults = 3;

class CameraCheck {
public:
    explicit CameraCheck(const CameraInfo& camera, std::uint32_t features_max = 1000);

    // The features that were found in the frame's colour image.
    void frame(const Frame& frame, const FeatureSet& features);

    // Whether a fault holds now: nothing that comes out of these frames is to be trusted.
    [[nodiscard]] bool holds() const;
    // A fault that was not told yet, and then the next; at last empty.
    [[nodiscard]] std::string news();
    // All that was ever found and not taken back, as it is known now.
    [[nodiscard]] std::vector<std::string> faults() const;
    // What is known and what is not, a line each.
    [[nodiscard]] std::vector<std::string> report() const;

    [[nodiscard]] double depth_factor() const { return factor_; }  // by which depth is too large; 0: not known
    [[nodiscard]] const CameraCorrection& correction() const { return correction_; }
    // The camera as it would be right, where lens or depth unit are off now.
    [[nodiscard]] std::optional<CameraInfo> corrected() const;
    [[nodiscard]] std::uint64_t frames_of_strangers() const { return stranger_frames_; }

private:
    [[nodiscard]] bool looks_closely() const;
    void take_edges(const EdgeCurve& curve);
    void look_at_motion();
    void look_at_unit(const Frame& frame);
    void fit();
    void decide_belonging();
    void look_for_shift();
    [[nodiscard]] bool is_off(std::size_t number) const;
    [[nodiscard]] bool is_likely_camera() const;
    [[nodiscard]] std::string sentence(CameraFault fault) const;
    [[nodiscard]] std::string lens_sentence() const;
    [[nodiscard]] double right_unit() const;

    static constexpr std::size_t kEdgeFrames = 5, kRatios = 3;
    struct Ratio {
        double value = 1;
        std::uint64_t frame = 0;
    };

    CameraInfo camera_;
    double px_ = 1;  // of this picture, for one of 640 px width
    View current_, before_, reference_;
    ViewMatcher matcher_;
    Rigidity rigidity_;
    SelfCalibration calibration_;
    DepthSteps steps_;
    std::array<EdgeCurve, kEdgeFrames> edges_;
    std::uint64_t edge_frames_ = 0;
    EdgeCurve all_edges_;
    std::array<Ratio, kRatios> ratios_;
    std::uint64_t ratio_count_ = 0;
    ViewMatcher::Flow reference_flow_;  // so far
    std::uint64_t frames_ = 0, stranger_frames_ = 0, fitted_pairs_ = 0;
    std::int64_t first_ns_ = -1, now_ns_ = 0, stranger_since_ns_ = 0;
    double factor_ = 0;
    CameraCorrection correction_;
    std::uint32_t wrong_fits_ = 0;  // one after the other
    bool is_lens_known_ = false;
    int shift_px_ = 0;
    std::array<bool, kCameraFaults> is_on_{}, is_ever_{}, is_told_{};
};

}  // namespace stillmesh
