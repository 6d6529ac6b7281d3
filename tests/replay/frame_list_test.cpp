#include "hal/replay/frame_list.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "engine/base/random.hpp"
#include "hal/replay/decimal_time.hpp"

namespace stillmesh {
namespace {

// Promise: decimal seconds become nanoseconds without a rounding error, whatever way they are written.
TEST(DecimalTime, IsExact) {
    EXPECT_EQ(parse_time_ns("1305031229.528748"), 1305031229528748000);
    EXPECT_EQ(parse_time_ns("1305031229.528748001"), 1305031229528748001);
    EXPECT_EQ(parse_time_ns("1305031229.5287480019999"), 1305031229528748001);
    EXPECT_EQ(parse_time_ns("1.305031229528747940e+09"), 1305031229528747940);
    EXPECT_EQ(parse_time_ns("1.5E-3"), 1500000);
    EXPECT_EQ(parse_time_ns("12345e-2"), 123450000000);
    EXPECT_EQ(parse_time_ns("0"), 0);
    EXPECT_EQ(parse_time_ns(".5"), 500000000);
    EXPECT_EQ(parse_time_ns("+7."), 7000000000);
    EXPECT_EQ(parse_time_ns("9223372036.854775807"), std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(parse_time_ns("1e-400"), 0);
}

// Promise: what is no time, is negative or overflows is refused, never wrapped.
TEST(DecimalTime, RefusesTheRest) {
    for (const char* text : {"", ".", "-1", "1.2.3", "1e", "1e+", "abc", "1 ", "nan", "inf", "0x10",
                             "9223372036.854775808", "1305031229528748000", "1e30", "1e99999999999999999999"}) {
        EXPECT_FALSE(parse_time_ns(text).has_value()) << text;
    }
}

// Promise: comments, blank lines, CRLF and tabs are fine; names are found where they stand in the text.
TEST(ImageList, ReadsTumLists) {
    const std::string text = "# comment\r\n\n 1.5\trgb/a b.png\r\n2.25 rgb/c.png extra words\n#3 x\n4 d";
    std::vector<ListedImage> images;
    std::string message;
    ASSERT_EQ(parse_image_list(text, "rgb.txt", images, message), Status::kOk) << message;
    ASSERT_EQ(images.size(), 3U);
    EXPECT_EQ(images[0].time_ns, 1500000000);
    EXPECT_EQ(text.substr(images[1].name_offset, images[1].name_size), "rgb/c.png");
    EXPECT_EQ(text.substr(images[2].name_offset, images[2].name_size), "d");
}

// Promise: a broken line is an error that names file and line and says what to do.
TEST(ImageList, NamesFileAndLine) {
    const auto message_of = [](const std::string& text) {
        std::vector<ListedImage> images;
        std::string message;
        EXPECT_EQ(parse_image_list(text, "x/rgb.txt", images, message), Status::kInvalid) << text;
        return message;
    };
    EXPECT_NE(message_of("1 a\n1 b\n").find("x/rgb.txt, line 2: time 1 repeats"), std::string::npos);
    EXPECT_NE(message_of("1 a\n\n0.5 b\n").find("x/rgb.txt, line 3: time 0.5 goes backwards"), std::string::npos);
    EXPECT_NE(message_of("one a\n").find("'one' is not a time"), std::string::npos);
    EXPECT_NE(message_of("1\n").find("no usable file name"), std::string::npos);
    EXPECT_NE(message_of("1 " + std::string(300, 'x')).find("no usable file name"), std::string::npos);
}

[[nodiscard]] std::vector<ListedImage> random_list(Random& random, std::uint32_t count, std::uint32_t step_ms_max) {
    std::vector<ListedImage> images;
    std::int64_t time_ns = random.below(20) * 1000000;
    for (std::uint32_t i = 0; i < count; ++i) {
        images.push_back({time_ns, i, 1});
        time_ns += (1 + random.below(step_ms_max)) * 1000000;
    }
    return images;
}

// Promise: pairs are those of the TUM tools' greedy association (brute force over all pairs), but for crossing ones.
TEST(Associate, EqualsTheGreedyBruteForce) {
    Random random(1);
    for (int round = 0; round < 300; ++round) {
        const auto colour = random_list(random, 1 + random.below(30), 45);
        const auto depth = random_list(random, 1 + random.below(30), 45);
        const std::int64_t gap_max = 20'000'000;
        std::set<std::size_t> colour_used;
        std::set<std::size_t> depth_used;
        std::vector<std::pair<std::size_t, std::size_t>> expected;
        for (;;) {
            std::int64_t best = gap_max + 1;
            std::pair<std::size_t, std::size_t> pair;
            for (std::size_t i = 0; i < colour.size(); ++i) {
                for (std::size_t j = 0; j < depth.size(); ++j) {
                    const std::int64_t gap = std::abs(colour[i].time_ns - depth[j].time_ns);
                    if (!colour_used.contains(i) && !depth_used.contains(j) && gap < best) {
                        best = gap;
                        pair = {i, j};
                    }
                }
            }
            if (best > gap_max) break;
            colour_used.insert(pair.first);
            depth_used.insert(pair.second);
            expected.push_back(pair);
        }
        std::sort(expected.begin(), expected.end());
        std::erase_if(expected, [last = -1](const auto& pair) mutable {
            if (static_cast<int>(pair.second) < last) return true;
            last = static_cast<int>(pair.second);
            return false;
        });
        const auto pairs = associate(colour, depth, gap_max);
        ASSERT_EQ(pairs.size(), expected.size()) << "round " << round;
        for (std::size_t i = 0; i < pairs.size(); ++i) {
            EXPECT_EQ(pairs[i].colour.name_offset, expected[i].first);
            EXPECT_EQ(pairs[i].depth.name_offset, expected[i].second);
        }
    }
}

}  // namespace
}  // namespace stillmesh
