#include "engine/geometry/depth_noise.hpp"

#include "engine/geometry/trig.hpp"

namespace stillmesh {

DepthSample sample_depth(const DepthView& depth, double metres_per_unit, std::int32_t x, std::int32_t y,
                         const DepthNoise& noise) noexcept {
    const auto width = static_cast<std::int32_t>(depth.width);
    const auto height = static_cast<std::int32_t>(depth.height);
    if (x < 0 || y < 0 || x >= width || y >= height) return {};

    // Whole units until the end: the weighted sums of d and d^2 are exact, so the centred variance
    // sum w (d - mu)^2 = (W sum w d^2 - (sum w d)^2) / W has an exact numerator, below 16 * 16 * 2^32: no cancellation.
    std::uint64_t weight_sum = 0;
    std::uint64_t sum1 = 0;
    std::uint64_t sum2 = 0;
    double sum4 = 0.0;  // of w d^4, for the sensor's own noise: (c d^2)^2
    const std::int32_t y_first = y > 0 ? y - 1 : 0;
    const std::int32_t y_last = y + 1 < height ? y + 1 : y;
    const std::int32_t x_first = x > 0 ? x - 1 : 0;
    const std::int32_t x_last = x + 1 < width ? x + 1 : x;
    for (std::int32_t row = y_first; row <= y_last; ++row) {
        const std::uint16_t* const pixels = depth.row(static_cast<std::uint32_t>(row));
        const std::uint32_t row_weight = row == y ? 2 : 1;
        for (std::int32_t column = x_first; column <= x_last; ++column) {
            const std::uint64_t d = pixels[column];
            // An invalid pixel is 0: its sums are 0 by themselves, only its weight has to go.
            const std::uint64_t weight = d != 0 ? row_weight << (column == x ? 1 : 0) : 0;
            const std::uint64_t d2 = d * d;
            weight_sum += weight;
            sum1 += weight * d;
            sum2 += weight * d2;
            const double d2_real = static_cast<double>(d2);
            sum4 += static_cast<double>(weight) * (d2_real * d2_real);
        }
    }
    if (weight_sum == 0) return {};

    const double inverse = 1.0 / static_cast<double>(weight_sum);
    const double unit2 = metres_per_unit * metres_per_unit;
    const double spread = static_cast<double>(weight_sum * sum2 - sum1 * sum1) * (inverse * inverse) * unit2;
    const double noise2 = noise.sigma_z_per_m2 * noise.sigma_z_per_m2 * (sum4 * inverse) * (unit2 * unit2);
    DepthSample sample;
    sample.mean_m = static_cast<double>(sum1) * inverse * metres_per_unit;
    const double variance = noise2 + spread;
    if (sample.mean_m < noise.z_min_m || sample.mean_m > noise.z_max_m ||
        variance > noise.sigma_max_m * noise.sigma_max_m) {
        return {};
    }
    sample.variance_m2 = variance;
    return sample;
}

Matrix3 point_covariance(const CameraModel& model, const Vector2& normalised, const DepthSample& sample,
                         double sigma_pixel_level) noexcept {
    const double x = normalised.x();  // du/fx
    const double y = normalised.y();  // dv/fy
    const double var = sample.variance_m2;
    // Of the product z * x with independent z and x: x^2 var(z) + var(x) (z^2 + var(z)).
    const double z2 = sample.mean_m * sample.mean_m + var;
    const double sigma_x = sigma_pixel_level / model.fx;
    const double sigma_y = sigma_pixel_level / model.fy;
    const double s_xx = var * (x * x) + sigma_x * sigma_x * z2;
    const double s_yy = var * (y * y) + sigma_y * sigma_y * z2;
    const double s_xy = var * (x * y);
    const double s_xz = var * x;
    const double s_yz = var * y;
    Matrix3 covariance;
    covariance << s_xx, s_xy, s_xz,  //
        s_xy, s_yy, s_yz,            //
        s_xz, s_yz, var;
    return covariance;
}

StereoPoint stereo_point(const StereoAngles& angles, const StereoNoise& noise) noexcept {
    // tan and its derivative sec^2 = 1 / cos^2.
    struct Tangent {
        double value;
        double slope;
    };
    const auto tangent = [](double angle_rad) noexcept -> Tangent {
        const SinCos sc = sin_cos(angle_rad);
        return {sc.sin / sc.cos, 1.0 / (sc.cos * sc.cos)};
    };
    const Tangent a = tangent(angles.w1_rad);
    const Tangent b = tangent(angles.w2_rad);
    const Tangent c = tangent(angles.phi1_rad);
    const Tangent d = tangent(angles.phi2_rad);

    StereoPoint result;
    const double disparity = a.value - b.value;
    if (!(disparity > 0.0)) {
        result.covariance = -Matrix3::Identity();
        return result;
    }
    const double z = noise.baseline_m / disparity;
    const double vertical = 0.5 * (c.value + d.value);
    result.point = {a.value * z, z * vertical, z};

    // One column of the Jacobian per angle. dZ/da = -Z / (a - b) = -Z^2 / B.
    const double dz_dw1 = -z / disparity * a.slope;
    const double dz_dw2 = z / disparity * b.slope;
    const double half_z = 0.5 * z;
    const Vector3 columns[4] = {
        {z * a.slope + a.value * dz_dw1, vertical * dz_dw1, dz_dw1},
        {a.value * dz_dw2, vertical * dz_dw2, dz_dw2},
        {0.0, half_z * c.slope, 0.0},
        {0.0, half_z * d.slope, 0.0},
    };
    const double sigmas[4] = {noise.sigma_w1_rad, noise.sigma_w2_rad, noise.sigma_phi1_rad, noise.sigma_phi2_rad};
    for (int i = 0; i < 4; ++i) {
        const Vector3 scaled = columns[i] * sigmas[i];
        result.covariance += scaled * scaled.transpose();
    }
    return result;
}

}  // namespace stillmesh
