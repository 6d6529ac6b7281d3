#include "engine/geometry/depth_noise.hpp"

namespace stillmesh {

DepthSample sample_depth(const DepthView& depth, double metres_per_unit, std::int32_t x, std::int32_t y,
                         const DepthParameters& noise) noexcept {
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

}  // namespace stillmesh
