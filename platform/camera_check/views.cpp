#include "platform/camera_check/views.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/features/hamming.hpp"
#include "engine/geometry/lens.hpp"

namespace stillmesh {
namespace {

constexpr float kCell_px = 40;
constexpr std::int32_t kColumns = 52, kRows = 52;  // of pictures up to 2047 px
// Of 256 bits. Below 60 a pair of ORB descriptors is seldom wrong, with the next best a fifth worse hardly ever.
constexpr int kDistanceMax = 60;
constexpr int kFar = 257;

// The mean of the inverse over 5x5 pixels, where all is one surface: on a border, depth of one side would be mixed with
// the picture of the other.
float inverse_depth_at(const Frame& frame, float u, float v) {
    constexpr int kSide = 2;
    const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
    if (x < kSide || y < kSide || x + kSide >= static_cast<int>(frame.depth.width) ||
        y + kSide >= static_cast<int>(frame.depth.height)) {
        return 0;
    }
    double sum = 0, least = 1e9, most = 0;
    int count = 0;
    for (int row = y - kSide; row <= y + kSide; ++row) {
        const std::uint16_t* const pixels = frame.depth.row(static_cast<std::uint32_t>(row));
        for (int column = x - kSide; column <= x + kSide; ++column) {
            if (pixels[column] == 0) continue;
            const double w = frame.depth_units_per_m / pixels[column];
            sum += w;
            least = std::min(least, w);
            most = std::max(most, w);
            ++count;
        }
    }
    if (count < 18 || most - least > 0.08 * most) return 0;
    return static_cast<float>(sum / count);
}

std::int32_t cell_of(float u) {
    return std::clamp(static_cast<std::int32_t>(u / kCell_px), 0, kColumns - 1);
}

}  // namespace

View::View(std::uint32_t features_max) {
    features_.reserve(features_max);
}

void View::take(const Frame& frame, const FeatureSet& features, const CameraModel& camera) {
    features_.clear();
    for (std::size_t i = 0; i < features.size() && features_.size() < features_.capacity(); ++i) {
        const Keypoint& k = features.keypoints[i];
        ViewFeature f;
        f.inverse_depth = inverse_depth_at(frame, k.x, k.y);
        if (f.inverse_depth <= 0) continue;
        f.u = k.x;
        f.v = k.y;
        const ImagePoint ray = ray_of_pixel(camera, {double{k.x}, double{k.y}});
        f.x = static_cast<float>(ray.x);
        f.y = static_cast<float>(ray.y);
        f.level = k.level;
        f.noise_px = std::pow(1.2F, static_cast<float>(k.level));
        f.descriptor = features.descriptors[i];
        features_.push_back(f);
    }
}

ViewMatcher::ViewMatcher(std::uint32_t features_max) : begins_(kColumns * kRows + 2) {
    ordered_.reserve(features_max);
    forward_.reserve(features_max);
    back_.reserve(features_max);
    matches_.reserve(features_max);
    lengths_.reserve(features_max);
}

void ViewMatcher::order(const View& view) {
    std::fill(begins_.begin(), begins_.end(), 0U);
    const auto cell = [](const ViewFeature& f) {
        return static_cast<std::size_t>(cell_of(f.v) * kColumns + cell_of(f.u));
    };
    for (const ViewFeature& f : view.features()) ++begins_[cell(f) + 1];
    for (std::size_t i = 1; i < begins_.size(); ++i) begins_[i] += begins_[i - 1];
    ordered_.resize(view.features().size());
    // From the last on, each to the end of its cell; the order within a cell stays, and begins_[cell + 1] becomes its
    // begin.
    for (std::size_t j = view.features().size(); j-- > 0;) {
        ordered_[--begins_[cell(view.features()[j]) + 1]] = static_cast<std::uint16_t>(j);
    }
}

void ViewMatcher::Best::see(int new_distance, std::size_t index) {
    if (new_distance < distance) {
        second = distance;
        distance = new_distance;
        other = static_cast<std::int32_t>(index);
    } else if (new_distance < second) {
        second = new_distance;
    }
}

const std::vector<ViewMatch>& ViewMatcher::match(const View& a, const View& b, float reach_px, float u, float v,
                                                 std::size_t every) {
    const std::vector<ViewFeature>& from = a.features();
    const std::vector<ViewFeature>& in = b.features();
    order(b);
    forward_.assign(from.size(), {kFar, kFar, -1});
    back_.assign(in.size(), {kFar, kFar, -1});
    for (std::size_t i = 0; i < from.size(); i += every) {
        const ViewFeature& f = from[i];
        const float at_u = f.u + u, at_v = f.v + v;
        for (std::int32_t row = cell_of(at_v - reach_px); row <= cell_of(at_v + reach_px); ++row) {
            const auto first = static_cast<std::size_t>(row * kColumns + cell_of(at_u - reach_px));
            const auto last = static_cast<std::size_t>(row * kColumns + cell_of(at_u + reach_px));
            for (std::uint32_t k = begins_[first + 1]; k < begins_[last + 2]; ++k) {
                const std::size_t j = ordered_[k];
                if (std::abs(in[j].level - f.level) > 1) continue;
                const int distance = static_cast<int>(hamming_distance(f.descriptor, in[j].descriptor));
                forward_[i].see(distance, j);
                back_[j].see(distance, i);
            }
        }
    }
    matches_.clear();
    for (std::size_t i = 0; i < forward_.size(); ++i) {
        const Best& best = forward_[i];
        if (best.other < 0 || best.distance > kDistanceMax || best.distance * 5 > best.second * 4) continue;
        const auto other = static_cast<std::size_t>(best.other);
        if (back_[other].other == static_cast<std::int32_t>(i)) matches_.push_back({from[i], in[other]});
    }
    return matches_;
}

float ViewMatcher::median() {
    if (lengths_.empty()) return 0;
    float* const middle = lengths_.data() + lengths_.size() / 2;
    std::nth_element(lengths_.data(), middle, lengths_.data() + lengths_.size());
    const float value = *middle;
    lengths_.clear();
    return value;
}

ViewMatcher::Flow ViewMatcher::flow() {
    Flow flow;
    for (const ViewMatch& m : matches_) lengths_.push_back(m.b.u - m.a.u);
    flow.u = median();
    for (const ViewMatch& m : matches_) lengths_.push_back(m.b.v - m.a.v);
    flow.v = median();
    for (const ViewMatch& m : matches_) lengths_.push_back(std::hypot(m.b.u - m.a.u, m.b.v - m.a.v));
    flow.length = median();
    return flow;
}

}  // namespace stillmesh
