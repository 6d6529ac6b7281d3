#include "engine/tracking/measured_frame.hpp"

#include "engine/base/numbers.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

// The contract that an extractor of the program must keep (features/features.hpp).
bool are_usable(const FeatureSet& features, const CameraModel& camera) noexcept {
    if (features.keypoints.size() != features.descriptors.size()) return false;
    const auto width = static_cast<float>(camera.width);
    const auto height = static_cast<float>(camera.height);
    for (std::size_t i = 0; i < features.size(); ++i) {
        const Keypoint& k = features.keypoints[i];
        // NaN compares false.
        if (!(k.x >= 0.0F && k.x < width && k.y >= 0.0F && k.y < height && k.level < kPyramidLevelsMax)) return false;
    }
    return true;
}

}  // namespace

void MeasuredFrame::create(Arena& arena, const Limits& limits, const Parameters& configuration,
                           const CameraModel& camera, const Kernels& kernels, FeatureExtractor* extractor) noexcept {
    camera_ = camera;
    kernels_ = &kernels;
    orb_.create(arena, limits, orb_options(configuration.features), kernels);
    extractor_ = extractor != nullptr ? extractor : &orb_;
    features_.create(arena, limits.features_max);
    grey_ = arena.array<std::uint8_t>(static_cast<std::size_t>(limits.image_width_max) * limits.image_height_max);
    measured_.create(arena, limits.features_max);
    depth_ = configuration.depth;
    mask_.create(configuration.mask);
    pixel_noise_.create(configuration, camera);
    set_moving({});  // an extractor of the program's may have served another engine
}

GreyView MeasuredFrame::grey_of(const Frame& frame) noexcept {
    const ImageView<std::uint8_t>& colour = frame.colour;
    if (frame.format == PixelFormat::kGrey8) return colour;
    const auto convert = frame.format == PixelFormat::kRgb8 ? kernels_->grey_from_rgb : kernels_->grey_from_bgr;
    for (std::uint32_t y = 0; y < colour.height; ++y)
        convert(colour.row(y), colour.width, grey_.data() + static_cast<std::size_t>(y) * colour.width);
    return {grey_.data(), colour.width, colour.height, colour.width};
}

void MeasuredFrame::extract(const GreyView& grey) noexcept {
    if (extractor_->extract(grey, features_) != Status::kOk || !are_usable(features_, camera_)) features_.clear();
}

void MeasuredFrame::measure(const Frame& frame) noexcept {
    frame_ = &frame;
    mask_.begin(frame);
    measured_.set_size(features_.size());
    const double metres_per_unit = 1.0 / frame.depth_units_per_m;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        const Keypoint& keypoint = features_.keypoints[i];
        MeasuredFeature& m = measured_[i];
        const auto x = static_cast<double>(keypoint.x);
        const auto y = static_cast<double>(keypoint.y);
        m.normalised = undistort_to_normalised(camera_, {x, y});
        const DepthSample sample =
            sample_depth(frame.depth, metres_per_unit, round_clamped(x), round_clamped(y), depth_);
        m.z_m = sample.mean_m;
        m.seen = m.normalised;
        m.seen_z_m = m.z_m;
        m.var_z = sample.variance_m2;
        m.var_pixel = pixel_noise_.var(keypoint.level);
    }
}

void MeasuredFrame::look_up_depth(const Vector3& turn) noexcept {
    const DepthPicture picture = depth_picture();
    for (std::size_t i = 0; i < features_.size(); ++i) {
        const Keypoint& keypoint = features_.keypoints[i];
        MeasuredFeature& m = measured_[i];
        const DepthSample sample =
            depth_behind(picture, {static_cast<double>(keypoint.x), static_cast<double>(keypoint.y)}, m.seen, turn);
        m.normalised = m.seen;
        m.z_m = m.seen_z_m = sample.mean_m;
        m.var_z = sample.variance_m2;
    }
}

void MeasuredFrame::carry_to_middle_row(const Vector6& sweep) noexcept {
    Vector6 turning = sweep;
    for (int k = 0; k < 3; ++k) turning(k) = 0;
    for (std::size_t i = 0; i < features_.size(); ++i) {
        MeasuredFeature& m = measured_[i];
        const bool has_depth = m.has_depth();  // without, its distance is not known: turned only
        const Vector3 p = moved_a_little((has_depth ? sweep : turning) * row_of(i),
                                         back_project(m.seen, has_depth ? m.seen_z_m : 1.0));
        if (p.z() < kDepthMin_m) continue;
        m.normalised = Vector2(p.x() / p.z(), p.y() / p.z());
        if (has_depth) m.z_m = p.z();
    }
}

std::uint32_t MeasuredFrame::with_depth_count() const noexcept {
    std::uint32_t count = 0;
    for (const MeasuredFeature& m : measured_) count += m.has_depth() ? 1U : 0U;
    return count;
}

Observation MeasuredFrame::observation_of(std::size_t feature) const noexcept {
    const Keypoint& keypoint = features_.keypoints[feature];
    const MeasuredFeature& m = measured_[feature];
    Observation observation;
    observation.x = keypoint.x;
    observation.y = keypoint.y;
    observation.normalised_x = static_cast<float>(m.normalised.x());
    observation.normalised_y = static_cast<float>(m.normalised.y());
    observation.z_m = static_cast<float>(m.z_m);
    observation.var_z = static_cast<float>(m.var_z);
    observation.angle_rad = keypoint.angle_rad;
    observation.level = keypoint.level;
    return observation;
}

}  // namespace stillmesh
