#include "hal/replay/frame_list.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "engine/base/random.hpp"
#include "hal/replay/decimal_time.hpp"

namespace stillmesh::frame_list_test {
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

// Promise: names may have blanks, or quotes around them; a byte order mark, commas between the words and decimal commas
// are read.
TEST(ImageList, ReadsOtherSpellings) {
    const struct {
        const char *line, *name;
        std::int64_t time_ns = 1'500'000'000;
    } cases[] = {
        {"1.5 rgb/frame 7.png", "rgb/frame 7.png"},
        {"1.5 rgb/frame 7.PNG \r", "rgb/frame 7.PNG"},
        {"1.5 \"rgb/frame 7.png\"", "rgb/frame 7.png"},
        {"1.5 'my room/frame 7.jpeg' 12", "my room/frame 7.jpeg"},
        {"1.5 my.room v2/frame 7.png 12 13", "my.room v2/frame 7.png"},
        {"1.5 without an extension", "without an extension"},
        {"1.5,rgb/7.png", "rgb/7.png"},
        {"1.5, rgb/7.png,", "rgb/7.png"},
        {"1,5 rgb/7.png", "rgb/7.png"},
        {"1,5\trgb/7 8.png", "rgb/7 8.png"},
        {"1500,1500.png", "1500.png", 1'500'000'000'000},
        {"1.5;rgb/7.png", "rgb/7.png"},
        {"1.5; \"rgb/7.png\";640", "rgb/7.png"},
        {"1,5;rgb/7.png", "rgb/7.png"},
    };
    for (const auto& c : cases) {
        for (const std::string mark : {"", "\xef\xbb\xbf", "\xef\xbb\xbf# time name\n", "timestamp;filename\r\n"}) {
            const std::string text = mark + c.line + "\n";
            std::vector<ListedImage> images;
            std::string message;
            ASSERT_EQ(parse_image_list(text, "rgb.txt", images, message), Status::kOk) << message;
            ASSERT_EQ(images.size(), 1U) << c.line;
            EXPECT_EQ(text.substr(images[0].name_offset, images[0].name_size), c.name);
            EXPECT_EQ(images[0].time_ns, c.time_ns) << c.line;
        }
    }
}

// Promise: lines end as on any system, and are counted the same: a list whose lines end with carriage returns alone is
// no list of one line.
TEST(ImageList, LinesEndAnyhow) {
    for (const std::string end : {"\n", "\r\n", "\r"}) {
        const std::string text = "# a" + end + "1.5 a.png" + end + end + "1.6 b.png" + end + "x";
        std::vector<ListedImage> images;
        std::string message;
        EXPECT_EQ(parse_image_list(text, "f", images, message), Status::kInvalid);
        EXPECT_EQ(message, "f, line 5: 'x' is not a time in seconds; a line is 'seconds file name'.");
        ASSERT_EQ(parse_image_list(text.substr(0, text.size() - 1), "f", images, message), Status::kOk) << message;
        ASSERT_EQ(images.size(), 2U);
        EXPECT_EQ(text.substr(images[1].name_offset, images[1].name_size), "b.png");
    }
}

// Promise: text of two bytes a letter, which Windows' shell writes, is named with a command that converts it; only the
// first line may be a heading.
TEST(ImageList, NamesOtherText) {
    const auto message_of = [](const std::string& text) {
        std::vector<ListedImage> images;
        std::string message;
        EXPECT_EQ(parse_image_list(text, "my list.txt", images, message), Status::kInvalid);
        return message;
    };
    using namespace std::string_literals;
    for (const std::string& text : {"\xff\xfe\x31\0.\0"s, "\xfe\xff\0\x31\0."s, "1\0.\0\x35\0"s, "\0\x31\0."s}) {
        EXPECT_EQ(message_of(text),
                  "my list.txt: is UTF-16, text of two bytes a letter; convert: iconv -f UTF-16 -t UTF-8 'my list.txt' "
                  "> new, and name it as this one.");
    }
    EXPECT_NE(message_of("1 a.png\ntime name\n2 b.png\n").find("line 2: 'time' is not a time"), std::string::npos);
    EXPECT_NE(message_of("time name\ntime name\n1 b.png\n").find("line 2: 'time' is not a time"), std::string::npos);
}

// Promise: the unit of times is recognised, since 1970, since the start and since the camera was switched on, at any
// rate that a camera has; seconds stay seconds.
TEST(ImageList, RecognisesTheUnitOfTimes) {
    const double starts_s[] = {0, 100, 50'000, 1305031229.5, 1764093600.25};
    const struct {
        TimeUnit unit;
        double per_s;
    } units[] = {{TimeUnit::kMilliseconds, 1e3}, {TimeUnit::kMicroseconds, 1e6}, {TimeUnit::kNanoseconds, 1e9}};
    for (const double start_s : starts_s) {
        for (const double fps : {5.0, 15.0, 30.0, 90.0}) {
            for (const auto& unit : units) {
                std::string text;
                for (int i = 0; i < 20; ++i) {
                    const auto count =
                        static_cast<long long>(start_s * unit.per_s) + static_cast<long long>(i / fps * unit.per_s);
                    text += std::to_string(count) + " rgb/" + std::to_string(i) + ".png\n";
                }
                std::vector<ListedImage> images;
                std::string message;
                ListTimes times;
                ASSERT_EQ(parse_image_list(text, "f", images, message, times), Status::kOk) << message;
                ASSERT_EQ(times.unit, unit.unit) << text;
                EXPECT_NEAR(static_cast<double>(images[19].time_ns - images[0].time_ns) * 1e-9, 19 / fps, 2e-3);
                EXPECT_NEAR(static_cast<double>(images[0].time_ns) * 1e-9, start_s, 2e-3);
            }
            std::string text;
            for (int i = 0; i < 20; ++i) text += std::to_string(start_s + i / fps) + " a.png\n";
            std::vector<ListedImage> images;
            std::string message;
            ListTimes times;
            ASSERT_EQ(parse_image_list(text, "f", images, message, times), Status::kOk) << message;
            EXPECT_EQ(times.unit, TimeUnit::kSeconds) << text;
        }
    }
}

// Promise: frame numbers are refused with the option that takes them, and are times with it.
TEST(ImageList, FrameNumbersNeedARate) {
    for (const int step : {1, 2}) {
        std::string text;
        for (int i = 0; i < 10; ++i) text += std::to_string(7 + step * i) + " rgb/" + std::to_string(i) + ".png\n";
        std::vector<ListedImage> images;
        std::string message;
        ListTimes times;
        EXPECT_EQ(parse_image_list(text, "x/rgb.txt", images, message, times), Status::kInvalid);
        EXPECT_NE(message.find("x/rgb.txt: times go up by " + std::to_string(step) + ": frame numbers?"),
                  std::string::npos)
            << message;
        EXPECT_NE(message.find("--fps"), std::string::npos) << message;
        times.frames_per_s = 25;
        ASSERT_EQ(parse_image_list(text, "x/rgb.txt", images, message, times), Status::kOk) << message;
        EXPECT_EQ(images[9].time_ns - images[0].time_ns, 9 * step * 40'000'000);
    }
}

// Promise: one list of both is read, whichever stream stands first, names with blanks or not.
TEST(Associations, AreBothLists) {
    const char* const texts[] = {"1.5 rgb/a 1.png 1.51 depth/b 1.png\n1.6 rgb/c.png 1.61 depth/d.png\n",
                                 "1.51 depth/b 1.png 1.5 rgb/a 1.png\n1.61 depth/d.png 1.6 rgb/c.png\n"};
    for (const std::string text : texts) {
        std::vector<ImagePair> pairs;
        std::string message;
        ListTimes times;
        ASSERT_EQ(parse_associations(text, "a.txt", pairs, message, times), Status::kOk) << message;
        ASSERT_EQ(pairs.size(), 2U);
        EXPECT_EQ(pairs[0].colour.time_ns, 1'500'000'000);
        EXPECT_EQ(pairs[0].depth.time_ns, 1'510'000'000);
        EXPECT_EQ(text.substr(pairs[0].colour.name_offset, pairs[0].colour.name_size), "rgb/a 1.png");
        EXPECT_EQ(text.substr(pairs[0].depth.name_offset, pairs[0].depth.name_size), "depth/b 1.png");
        EXPECT_EQ(text.substr(pairs[1].depth.name_offset, pairs[1].depth.name_size), "depth/d.png");
    }
    std::vector<ImagePair> pairs;
    std::string message;
    ListTimes times;
    // One time for both.
    const std::string three = "1.5 rgb/a 1.png depth/b 1.png\n1.6,rgb/c.png,depth/d.png\n";
    ASSERT_EQ(parse_associations(three, "a.txt", pairs, message, times), Status::kOk) << message;
    ASSERT_EQ(pairs.size(), 2U);
    EXPECT_EQ(pairs[0].depth.time_ns, 1'500'000'000);
    EXPECT_EQ(three.substr(pairs[0].depth.name_offset, pairs[0].depth.name_size), "depth/b 1.png");
    EXPECT_EQ(three.substr(pairs[1].depth.name_offset, pairs[1].depth.name_size), "depth/d.png");
    EXPECT_EQ(parse_associations("1.5 a.png 1.5\n", "a.txt", pairs, message, times), Status::kInvalid);
    EXPECT_NE(message.find("a.txt, line 1: no usable file name"), std::string::npos) << message;
    EXPECT_EQ(parse_associations("1.5 a.png 1.5 b.png\n1.4 a.png 1.4 b.png\n", "a.txt", pairs, message, times),
              Status::kInvalid);
    EXPECT_NE(message.find("a.txt, line 2: time 1.4 goes backwards"), std::string::npos) << message;
}

// Promise: two clocks that are a constant time apart are found out, also where the first images have no partner; lists
// that have nothing to do with each other are not.
TEST(Associate, FindsTheOffsetOfTwoClocks) {
    for (const std::int64_t offset_ns : {-1'305'031'200'000'000'000LL, -500'000'000LL, 7'000'000'000LL}) {
        std::vector<ListedImage> colour, depth;
        for (std::int64_t i = 0; i < 50; ++i) {
            const std::int64_t time_ns = 1'305'031'229'000'000'000 + i * 33'333'333 + (i % 7) * 1'000'000;
            if (i >= 2) colour.push_back({time_ns, 0, 1});
            depth.push_back({time_ns + offset_ns + 4'000'000, 0, 1});
        }
        const auto found = constant_offset_ns(colour, depth, 20'000'000);
        ASSERT_TRUE(found.has_value()) << offset_ns;
        EXPECT_NEAR(static_cast<double>(*found - offset_ns), 4e6, 1.5e7);
    }
    std::vector<ListedImage> colour, depth;
    for (std::int64_t i = 0; i < 50; ++i) {
        colour.push_back({i * 33'333'333, 0, 1});
        depth.push_back({100'000'000'000 + i * i * 70'000'000, 0, 1});
    }
    EXPECT_FALSE(constant_offset_ns(colour, depth, 20'000'000).has_value());
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
}  // namespace stillmesh::frame_list_test
