#include "platform/camera_check/depth_steps.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

namespace stillmesh {
namespace {

constexpr double kFirst = 1e-4, kLogStep = 0.05;
constexpr double kKinectStep = 2.9e-3;  // 1/m
constexpr int kSide_px = 8;
constexpr double kBorder = 0.05;  // a larger change is another surface
// Below four units the unit itself makes the steps.
constexpr int kUnitsMin = 4;
constexpr double kEnough = 20'000;  // of several million that a second of a room has

int bin_of(double difference) {
    return difference > kFirst ? static_cast<int>(std::log(difference / kFirst) / kLogStep) : 0;
}
double middle_of(int bin) {
    return kFirst * std::exp(kLogStep * (bin + 0.5));
}

}  // namespace

void DepthSteps::add(const Frame& frame) {
    const double units = frame.depth_units_per_m;
    for (std::uint32_t y = 0; y < frame.depth.height; y += 2) {
        const std::uint16_t* const row = frame.depth.row(y);
        for (std::uint32_t x = kSide_px; x + kSide_px < frame.depth.width; ++x) {
            const int here = row[x], next = row[x + 1];
            if (here == 0 || next == 0) continue;
            const double w = units / here;
            if (std::abs(here - next) >= kUnitsMin && std::abs(here - next) < kBorder * here) {
                const int bin = bin_of(std::abs(w - units / next));
                if (bin < kBins) differences_[static_cast<std::size_t>(bin)] += 1;
            }
            const int left = row[x - kSide_px], right = row[x + kSide_px];
            if (left == 0 || right == 0 || std::abs(left - right) > kBorder * here) continue;
            const int bin = std::min(bin_of(std::abs(w - 0.5 * (units / left + units / right))), kBins - 1);
            bends_[static_cast<std::size_t>(bin)] += 1;
        }
    }
}

double DepthSteps::factor() const {
    const double all = std::accumulate(differences_.begin(), differences_.end(), 0.0);
    if (all < kEnough) return 0;
    const int commonest =
        static_cast<int>(std::max_element(differences_.begin(), differences_.end()) - differences_.begin());
    const double about = middle_of(commonest);
    // One step is by far the commonest, half of one and one and a half hardly occur.
    double one = 0, sum = 0, beside = 0;
    for (int i = 0; i < kBins; ++i) {
        const double share = differences_[static_cast<std::size_t>(i)] / all;
        const double ratio = middle_of(i) / about;
        if (ratio > 0.84 && ratio < 1.19) {
            one += share;
            sum += share * middle_of(i);
        } else if (ratio > 0.3 && ratio < 1.75) {
            beside += share;
        }
    }
    if (one < 0.5 || beside > 0.3 * one) return 0;
    const double step = sum / one;
    // And what noise there is stays within a step: finer steps under more noise are another kind of sensor.
    const double bends = std::accumulate(bends_.begin(), bends_.end(), 0.0);
    double below = 0;
    for (int i = 0; i < kBins && middle_of(i) < step; ++i) below += bends_[static_cast<std::size_t>(i)];
    if (below < 0.6 * bends) return 0;
    return kKinectStep / step;
}

}  // namespace stillmesh
