// What the numbers of a camera are called in camera files, ours and those of other programs, and between what they
// lie. Inner.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>

namespace stillmesh::camera_keys {

// The numbers of a camera, in the order of kNumbers below.
enum Number : std::size_t {
    kWidth,
    kHeight,
    kFx,
    kFy,
    kCx,
    kCy,
    kK1,
    kK2,
    kP1,
    kP2,
    kK3,
    kK4,
    kK5,
    kK6,
    kDepthUnits,
    kFps,
    kReadout,
    kNumbersCount
};

inline constexpr double kSizeMax = 4096;        // what may be halved; the engine takes less
inline constexpr double kFocalMax = 20000;      // px
inline constexpr double kReadoutMax_s = 0.1;    // three frames of a usual camera
inline constexpr double kDistortionMax = 1000;  // a real lens stays far below; the engine checks the shape itself

struct NumberKind {
    std::string_view name;  // ours
    double min;
    double max;
};
// Focal lengths have a lower bound above 0, the factor one that a 16-bit image can use at all.
inline constexpr std::array<NumberKind, kNumbersCount> kNumbers = {{{"width", 1, kSizeMax},
                                                                    {"height", 1, kSizeMax},
                                                                    {"fx", 1, kFocalMax},
                                                                    {"fy", 1, kFocalMax},
                                                                    {"cx", -kSizeMax, 2 * kSizeMax},
                                                                    {"cy", -kSizeMax, 2 * kSizeMax},
                                                                    {"k1", -kDistortionMax, kDistortionMax},
                                                                    {"k2", -kDistortionMax, kDistortionMax},
                                                                    {"p1", -kDistortionMax, kDistortionMax},
                                                                    {"p2", -kDistortionMax, kDistortionMax},
                                                                    {"k3", -kDistortionMax, kDistortionMax},
                                                                    {"k4", -kDistortionMax, kDistortionMax},
                                                                    {"k5", -kDistortionMax, kDistortionMax},
                                                                    {"k6", -kDistortionMax, kDistortionMax},
                                                                    {"depth_units_per_m", 100, 100000},
                                                                    {"frames_per_s", 0.1, 1000},
                                                                    {"readout_s", 0, kReadoutMax_s}}};

struct Alias {
    std::string_view key;
    Number number;
};
inline constexpr Alias kAliases[] = {{"image_width", kWidth},
                                     {"image_height", kHeight},
                                     {"cols", kWidth},
                                     {"rows", kHeight},
                                     {"W", kWidth},
                                     {"H", kHeight},
                                     {"w", kWidth},
                                     {"h", kHeight},
                                     {"fu", kFx},
                                     {"fv", kFy},
                                     {"cu", kCx},
                                     {"cv", kCy},
                                     {"fl_x", kFx},
                                     {"fl_y", kFy},
                                     {"ppx", kCx},
                                     {"ppy", kCy},
                                     {"fps", kFps},
                                     {"rate_hz", kFps}};
// Of the depth images: many files have them beside the camera, not in it.
inline constexpr std::string_view kDepthKeys[] = {"depth_units_per_m", "DepthMapFactor",  "RGBD.DepthMapFactor",
                                                  "depthmap_factor",   "png_depth_scale", "depth_factor"};
inline constexpr std::string_view kDepthScaleKeys[] = {"depth_scale", "depth_unit"};
inline constexpr std::string_view kMatrixKeys[] = {
    "K", "k", "camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "intrinsic_matrix", "intrinsic"};
inline constexpr std::string_view kIntrinsicsKeys[] = {"intrinsics"};
inline constexpr std::string_view kCoefficientKeys[] = {"D",
                                                        "d",
                                                        "distortion_coefficients",
                                                        "Distortion_Coefficients",
                                                        "DistortionCoefficients",
                                                        "distortion_coeffs",
                                                        "dist_coeffs",
                                                        "distCoeffs",
                                                        "coeffs"};
inline constexpr std::string_view kSizeKeys[] = {"resolution", "image_size"};
inline constexpr std::string_view kLensKeys[] = {"lens", "distortion_model", "camera_model", "model", "type"};
inline constexpr std::string_view kScaledInputKeys[] = {"newWidth", "newHeight", "imageScale", "new_width",
                                                        "new_height"};
inline constexpr std::string_view kBinningKeys[] = {"binning_x", "binning_y", "roi.x_offset", "roi.y_offset"};
// Of the Camera section of ORB-SLAM and stella_vslam, about other things than the lens.
inline constexpr std::string_view kOtherCameraKeys[] = {"bf",
                                                        "RGB",
                                                        "name",
                                                        "setup",
                                                        "color_order",
                                                        "focal_x_baseline",
                                                        "depth_threshold",
                                                        "overlappingBegin",
                                                        "overlappingEnd",
                                                        "lappingBegin",
                                                        "lappingEnd"};

template <typename List>
[[nodiscard]] bool holds(const List& list, std::string_view key) {
    return std::find(std::begin(list), std::end(list), key) != std::end(list);
}
// `camera_matrix` as OpenCV writes it is a map with `data`.
[[nodiscard]] std::string_view without_data(std::string_view key);
[[nodiscard]] std::optional<Number> number_named(std::string_view key);
// What a file must have to be of a camera at all.
[[nodiscard]] bool is_core(std::string_view key);
[[nodiscard]] std::string number_text(double value);
[[nodiscard]] std::string quoted(std::string_view text);
[[nodiscard]] std::string lower(std::string_view text);
[[nodiscard]] bool names_colour(std::string_view text);

}  // namespace stillmesh::camera_keys
