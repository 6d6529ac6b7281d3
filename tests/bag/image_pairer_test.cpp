// Pairs found on the way are those of whole lists.
#include "hal/bag/image_pairer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace stillmesh::image_pairer_test {
namespace {

constexpr std::int64_t kGap_ns = 20'000'000;
constexpr std::size_t kRoom = std::size_t{1} << 20U;

struct Arrival {
    std::int64_t time_ns = 0;      // of the image
    std::int64_t recorded_ns = 0;  // when its message came
    ImagePairer::Stream stream = ImagePairer::kColour;
};

using Pairs = std::vector<std::pair<std::int64_t, std::int64_t>>;

[[nodiscard]] Pairs paired(const std::vector<Arrival>& arrivals, ImagePairer& pairer) {
    Pairs out;
    const WaitingImage *colour = nullptr, *depth = nullptr;
    const auto take = [&] {
        while (pairer.next(colour, depth)) out.emplace_back(colour->time_ns, depth->time_ns);
    };
    const std::uint8_t byte = 1;
    for (const Arrival& arrival : arrivals) {
        pairer.add(arrival.stream, arrival.time_ns, std::span(&byte, 1));
        take();
    }
    pairer.end();
    take();
    return out;
}

// Promise: whatever the jitter, the holes and the delay of messages, pairs are those that associate() finds in the
// whole lists, in the order of time, and every colour image without one is counted.
TEST(ImagePairer, FindsThePairsOfWholeLists) {
    std::mt19937 random(7);
    const auto below = [&](std::int64_t n) { return static_cast<std::int64_t>(random() % static_cast<unsigned>(n)); };
    std::size_t all_pairs = 0, all_lonely = 0;
    for (int round = 0; round < 300; ++round) {
        std::vector<Arrival> arrivals;
        std::vector<ListedImage> lists[2];
        const std::int64_t period_ns[2] = {33'333'333, below(2) == 0 ? 33'333'333 : 40'000'000};
        const std::int64_t jitter_ns = 1 + below(12'000'000), delay_ns = 1 + below(200'000'000);
        for (const auto stream : {ImagePairer::kColour, ImagePairer::kDepth}) {
            const std::int64_t stream_delay_ns = below(delay_ns);
            for (std::int64_t i = 0; i < 90; ++i) {
                if (below(8) == 0) continue;
                const std::int64_t time_ns = 1'000'000'000 + i * period_ns[stream] + below(jitter_ns);
                lists[stream].push_back({time_ns, 0, 0});
                arrivals.push_back({time_ns, time_ns + stream_delay_ns + below(5'000'000), stream});
            }
        }
        std::stable_sort(arrivals.begin(), arrivals.end(),
                         [](const Arrival& a, const Arrival& b) { return a.recorded_ns < b.recorded_ns; });
        Pairs expected;
        for (const ImagePair& pair : associate(lists[0], lists[1], kGap_ns)) {
            expected.emplace_back(pair.colour.time_ns, pair.depth.time_ns);
        }
        ImagePairer pairer(kGap_ns, kRoom);
        ASSERT_EQ(paired(arrivals, pairer), expected) << "round " << round;
        EXPECT_EQ(pairer.counts().lonely_colour, lists[0].size() - expected.size());
        EXPECT_EQ(pairer.counts().times_back, 0U);
        all_pairs += expected.size();
        all_lonely += pairer.counts().lonely_colour;
    }
    EXPECT_GT(all_pairs, 10'000U);
    EXPECT_GT(all_lonely, 1'000U);
}

// Promise: an image whose time repeats or lies behind what was given out is counted and never given out; the others are
// paired as if it had not come.
TEST(ImagePairer, PassesOverTimesThatGoBack) {
    std::vector<Arrival> arrivals;
    for (std::int64_t i = 0; i < 20; ++i) {
        for (const auto stream : {ImagePairer::kColour, ImagePairer::kDepth}) {
            arrivals.push_back({i * 33'000'000 + 1, 0, stream});
            if (i == 10) arrivals.push_back({i * 33'000'000 + 1, 0, stream});  // again
            if (i == 12) arrivals.push_back({2 * 33'000'000 + 1, 0, stream});  // long ago
        }
    }
    ImagePairer pairer(kGap_ns, kRoom);
    const Pairs pairs = paired(arrivals, pairer);
    ASSERT_EQ(pairs.size(), 20U);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
        EXPECT_EQ(pairs[i].first, static_cast<std::int64_t>(i) * 33'000'000 + 1);
        EXPECT_EQ(pairs[i].second, pairs[i].first);
    }
    EXPECT_EQ(pairer.counts().times_back, 4U);
}

// Promise: a stream that stays away costs kWaitingMax images of the other and no more, and where it comes back pairs
// are found again; so it is when bytes run out.
TEST(ImagePairer, WaitsForSoLongOnly) {
    for (const std::size_t bytes_max : {kRoom, std::size_t{10}}) {
        for (const auto absent : {ImagePairer::kColour, ImagePairer::kDepth}) {
            std::vector<Arrival> arrivals;
            for (std::int64_t i = 0; i < 400; ++i) {
                for (const auto stream : {ImagePairer::kColour, ImagePairer::kDepth}) {
                    if (stream == absent && i >= 100 && i < 300) continue;
                    arrivals.push_back({i * 33'000'000 + 1, 0, stream});
                }
            }
            ImagePairer pairer(kGap_ns, bytes_max);
            EXPECT_EQ(paired(arrivals, pairer).size(), 200U);
            EXPECT_EQ(pairer.counts().lonely_colour, absent == ImagePairer::kDepth ? 200U : 0U);
        }
    }
}

}  // namespace
}  // namespace stillmesh::image_pairer_test
