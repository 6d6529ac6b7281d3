// Learns the 256 tests of engine/features/orb_pattern_table.inc and prints them:
//   build/release/bench/features/learn_pattern > engine/features/orb_pattern_table.inc
// After the greedy search of Rublee et al. 2011, with one term more. Corners of synthetic pictures (dead leaves,
// shaded, noisy) are found again in turned, scaled, blurred, noisy copies of them. A random test of two pixels of the
// upright patch is worth how much more often it differs between two corners than between two views of the same corner.
// The best are taken in turn, unless they say the same as one taken before. Same output on every run.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "bench/features/frames.hpp"
#include "engine/geometry/trig.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/finders.hpp"

namespace {

using namespace stillmesh;

constexpr int kRadius = kPatchRadius;

struct Point {
    int x;
    int y;
};

std::vector<Point> disc() {
    std::vector<Point> points;
    for (int y = -kRadius; y <= kRadius; ++y)
        for (int x = -kRadius; x <= kRadius; ++x)
            if (x * x + y * y <= kRadius * kRadius) points.push_back({x, y});
    return points;
}

// All pixels of the upright, blurred patch of every feature of an image; one row per feature.
std::vector<std::vector<std::uint8_t>> patches(const cv::Mat& image, testing::Rig& rig,
                                               const std::vector<Point>& points) {
    const Status status = rig.extractor.extract(bench::view_of(image), rig.features);
    STILLMESH_CHECK(status == Status::kOk);
    const Pyramid& pyramid = rig.extractor.pyramid();
    std::vector<cv::Mat> blurred;
    for (std::uint32_t i = 0; i < pyramid.levels(); ++i) {
        const GreyView level = pyramid.level(i);
        const cv::Mat view(static_cast<int>(level.height), static_cast<int>(level.width), CV_8UC1,
                           const_cast<std::uint8_t*>(level.data), level.stride);
        cv::Mat out;
        cv::GaussianBlur(view, out, cv::Size(7, 7), 2);
        blurred.push_back(out);
    }
    std::vector<std::vector<std::uint8_t>> all;
    for (const Keypoint& k : rig.features.keypoints.span()) {
        const int x = static_cast<int>(std::lround(pyramid.level_x(k.level, static_cast<double>(k.x))));
        const int y = static_cast<int>(std::lround(pyramid.level_y(k.level, static_cast<double>(k.y))));
        const SinCos turn = sin_cos(static_cast<double>(k.angle_rad));
        std::vector<std::uint8_t> patch;
        for (const Point& p : points) {
            const int u = static_cast<int>(std::lround(turn.cos * p.x - turn.sin * p.y));
            const int v = static_cast<int>(std::lround(turn.sin * p.x + turn.cos * p.y));
            patch.push_back(blurred[k.level].at<std::uint8_t>(y + v, x + u));
        }
        all.push_back(std::move(patch));
    }
    return all;
}

struct Test {
    std::size_t a;
    std::size_t b;
    double worth;
    double same;
    std::vector<std::uint64_t> bits;
};

}  // namespace

int main() {
    cv::setNumThreads(1);
    const std::vector<Point> points = disc();
    testing::Rig rig(Limits::room(), cpu_kernels());
    std::vector<std::vector<std::uint8_t>> first;
    std::vector<std::vector<std::uint8_t>> second;
    Random random(2011);
    for (std::uint64_t n = 0; n < 40; ++n) {
        testing::Image leaves(640, 480);
        testing::fill_leaves(leaves, 1000 + n, 1500, 60 + 35 * (static_cast<std::uint32_t>(n) % 5));
        cv::Mat image(480, 640, CV_8UC1, leaves.pixels.data());
        // Shading across the picture, soft edges, and a camera's noise.
        for (int y = 0; y < image.rows; ++y)
            for (int x = 0; x < image.cols; ++x)
                image.at<std::uint8_t>(y, x) =
                    static_cast<std::uint8_t>(image.at<std::uint8_t>(y, x) * (500 + x + y / 2) / 1500 + 20);
        cv::GaussianBlur(image, image, cv::Size(), 0.7);
        const auto originals = patches(image, rig, points);
        const std::vector<Keypoint> keypoints(rig.features.keypoints.begin(), rig.features.keypoints.end());
        const auto copies = testing::transformations(image);
        for (std::size_t i = n % 3; i < copies.size(); i += 3) {
            const testing::Transformed& t = copies[i];
            const auto found = patches(t.image, rig, points);
            const double scale = std::sqrt(t.map(0, 0) * t.map(1, 1) - t.map(0, 1) * t.map(1, 0));
            for (std::size_t k = 0; k < keypoints.size(); ++k) {
                const cv::Vec2d q = t.map * cv::Vec3d(keypoints[k].x, keypoints[k].y, 1);
                const double level = keypoints[k].level + std::log(scale) / std::log(1.2);
                const double side = scale * std::pow(1.2, keypoints[k].level);
                double best = 1.5 * side;
                std::size_t match = found.size();
                for (std::size_t m = 0; m < found.size(); ++m) {
                    const Keypoint& other = rig.features.keypoints[m];
                    if (std::abs(other.level - level) > 1) continue;
                    const double distance =
                        std::hypot(static_cast<double>(other.x) - q[0], static_cast<double>(other.y) - q[1]);
                    if (distance < best) {
                        best = distance;
                        match = m;
                    }
                }
                if (match == found.size() || random.below(6) != 0) continue;
                first.push_back(originals[k]);
                second.push_back(found[match]);
            }
        }
    }
    const std::size_t pairs = first.size();
    std::fprintf(stderr, "%zu pairs of views\n", pairs);
    std::vector<Test> tests;
    for (int n = 0; n < 30000; ++n) {
        Test test;
        test.a = random.below(static_cast<std::uint32_t>(points.size()));
        test.b = random.below(static_cast<std::uint32_t>(points.size()));
        const int dx = points[test.a].x - points[test.b].x;
        const int dy = points[test.a].y - points[test.b].y;
        if (dx * dx + dy * dy < 4) continue;
        test.bits.assign((pairs + 63) / 64, 0);
        std::size_t ones = 0;
        std::size_t flips = 0;
        for (std::size_t i = 0; i < pairs; ++i) {
            const bool bit = first[i][test.a] < first[i][test.b];
            const bool again = second[i][test.a] < second[i][test.b];
            test.bits[i / 64] |= static_cast<std::uint64_t>(bit) << (i % 64);
            ones += bit ? 1 : 0;
            flips += bit != again ? 1 : 0;
        }
        const double mean = static_cast<double>(ones) / static_cast<double>(pairs);
        test.same = static_cast<double>(flips) / static_cast<double>(pairs);
        test.worth = 2 * mean * (1 - mean) - test.same;
        tests.push_back(std::move(test));
    }
    std::stable_sort(tests.begin(), tests.end(), [](const Test& a, const Test& b) { return a.worth > b.worth; });
    // Greedy: worth, less the more it repeats the one among those taken that it is most like.
    std::vector<const Test*> taken;
    double most_alike = 0;
    std::vector<double> likeness(tests.size(), 0);
    while (taken.size() < 256) {
        std::size_t best = 0;
        double best_value = -1;
        for (std::size_t i = 0; i < tests.size(); ++i) {
            const double value = tests[i].worth * std::pow(1 - likeness[i], 2);
            if (value > best_value) {
                best_value = value;
                best = i;
            }
        }
        taken.push_back(&tests[best]);
        most_alike = std::max(most_alike, likeness[best]);
        for (std::size_t i = 0; i < tests.size(); ++i) {
            if (tests[i].worth * std::pow(1 - likeness[i], 2) < 0.3 * best_value) continue;
            std::size_t different = 0;
            for (std::size_t w = 0; w < tests[i].bits.size(); ++w)
                different += static_cast<std::size_t>(std::popcount(tests[i].bits[w] ^ tests[best].bits[w]));
            const double agreement = std::abs(1 - 2 * static_cast<double>(different) / static_cast<double>(pairs));
            likeness[i] = std::max(likeness[i], agreement);
        }
    }
    double worth = 0;
    double same = 0;
    for (const Test* test : taken) {
        worth += test->worth / 256;
        same += test->same / 256;
    }
    std::fprintf(stderr, "agreement at most %.3f, mean worth %.3f, flips between views %.3f\n", most_alike, worth,
                 same);
    for (std::size_t i = 0; i < taken.size(); ++i) {
        const Point a = points[taken[i]->a];
        const Point b = points[taken[i]->b];
        std::printf("%s{%d, %d, %d, %d},%s", i % 6 == 0 ? "    " : " ", a.x, a.y, b.x, b.y, i % 6 == 5 ? "\n" : "");
    }
    std::printf("\n");
    return 0;
}
