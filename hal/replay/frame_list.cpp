#include "hal/replay/frame_list.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <utility>

#include "hal/replay/decimal_time.hpp"

namespace stillmesh {
namespace {

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
constexpr std::string_view kBlanks = " \t\r,;";
constexpr std::string_view kExtensions[] = {".png",  ".jpg", ".jpeg", ".pgm", ".ppm",  ".pnm", ".tif",
                                            ".tiff", ".bmp", ".npy",  ".exr", ".webp", ".raw"};

[[nodiscard]] bool are_digits(std::string_view text) {
    return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

[[nodiscard]] bool is_extension(std::string_view text) {
    std::string lower(text);
    for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    return std::find(std::begin(kExtensions), std::end(kExtensions), lower) != std::end(kExtensions);
}

// The time at the begin of `rest`, taken from there. Blanks or a comma end it; but a comma between digits, with a blank
// behind them, is that of a decimal number.
[[nodiscard]] std::string take_time(std::string_view& rest) {
    rest.remove_prefix(std::min(rest.find_first_not_of(kBlanks), rest.size()));
    std::string word(rest.substr(0, rest.find_first_of(" \t\r;")));
    const std::size_t comma = word.find(',');
    const std::size_t size = word.size();
    if (comma != std::string::npos) {
        const std::string_view view = word;
        const bool is_decimal = are_digits(view.substr(0, comma)) && are_digits(view.substr(comma + 1)) &&
                                rest.find_first_not_of(kBlanks, size) != std::string_view::npos;
        if (is_decimal) {
            word[comma] = '.';
        } else {
            word.resize(comma);
        }
    }
    rest.remove_prefix(word.empty() ? 0 : (comma == std::string::npos || word.size() == size ? size : comma));
    return word;
}

// The name at the begin of `rest`, taken from there: what stands in quotes, or up to an image file's extension with a
// blank behind it, or all.
[[nodiscard]] std::string_view take_name(std::string_view& rest) {
    rest.remove_prefix(std::min(rest.find_first_not_of(kBlanks), rest.size()));
    std::string_view name = rest;
    if (!name.empty() && (name[0] == '"' || name[0] == '\'')) {
        const std::size_t end = name.find(name[0], 1);
        if (end != std::string_view::npos) {
            rest.remove_prefix(end + 1);
            return name.substr(1, end - 1);
        }
    }
    for (std::size_t dot = name.find('.'); dot != std::string_view::npos; dot = name.find('.', dot + 1)) {
        const std::size_t end = std::min(name.find_first_of(kBlanks, dot), name.size());
        if (!is_extension(name.substr(dot, end - dot))) continue;
        name = name.substr(0, end);
        break;
    }
    rest.remove_prefix(name.size());
    return name.substr(0, name.find_last_not_of(kBlanks) + 1);
}

struct ListedLine {
    std::size_t number;
    std::string_view text;
};

// What stands above the columns of a table: "timestamp filename".
[[nodiscard]] bool is_heading(std::string_view line) {
    const std::string word = take_time(line);
    return word.find("time") != std::string::npos || word.find("Time") != std::string::npos ||
           word.find("stamp") != std::string::npos;
}

// Two bytes a letter: with a mark that says so, or seen by the zeros in the first two letters.
[[nodiscard]] bool is_utf16(std::string_view text) {
    if (text.size() < 4) return false;
    return text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff") || (text[0] == '\0') != (text[1] == '\0');
}

// The lines that say something; what all of them begin with tells the unit of their times.
[[nodiscard]] std::vector<ListedLine> lines_of(std::string_view text, TimeUnitGuess& guess) {
    std::vector<ListedLine> lines;
    std::size_t number = 0;
    bool may_be_heading = true;
    for (std::size_t begin = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0; begin < text.size();) {
        const std::size_t end = std::min(text.find_first_of("\r\n", begin), text.size());
        std::string_view line = text.substr(begin, end - begin);
        begin = end + (text.substr(end).starts_with("\r\n") ? 2 : 1);
        ++number;
        const std::size_t first = line.find_first_not_of(kBlanks);
        if (first == std::string_view::npos || line[first] == '#') continue;
        if (std::exchange(may_be_heading, false) && is_heading(line)) continue;
        lines.push_back({number, line});
        guess.see(take_time(line));
    }
    return lines;
}

// Reads one list, or one of two that stand side by side.
class ListReader {
public:
    ListReader(std::string_view text, const std::string& file, std::string& message, ListTimes& times)
        : text_(text), file_(file), message_(message), times_(times) {}

    [[nodiscard]] Status begin(std::vector<ListedLine>& lines) {
        if (text_.size() > 0xffffffffU) {
            message_ = file_ + ": the list is longer than 4 GiB; cut the recording.";
            return Status::kInvalid;
        }
        if (is_utf16(text_)) {
            message_ = file_ + ": is UTF-16, text of two bytes a letter; convert: iconv -f UTF-16 -t UTF-8 '" + file_ +
                       "' > new, and name it as this one.";
            return Status::kInvalid;
        }
        TimeUnitGuess guess;
        lines = lines_of(text_, guess);
        times_.unit = guess.unit();
        times_.step = guess.step();
        if (times_.unit != TimeUnit::kFrames || times_.frames_per_s > 0) return Status::kOk;
        message_ =
            file_ + ": times go up by " + std::to_string(static_cast<int>(times_.step)) +
            ": frame numbers? Say how many frames the camera took in a second, as in --fps 30 (--fps 1: they are "
            "seconds).";
        return Status::kInvalid;
    }
    // The time and the name at the begin of `rest`, taken from there.
    [[nodiscard]] Status take(std::size_t line, std::string_view& rest, ListedImage& image) {
        const std::string word = take_time(rest);
        auto time_ns = parse_time_ns(word, nanosecond_digits(times_.unit));
        if (!time_ns) {
            return fail(line, "'" + word.substr(0, 40) + "' is not a time in " +
                                  (times_.unit == TimeUnit::kFrames ? "seconds" : time_unit_name(times_.unit)) +
                                  "; a line is 'seconds file name'.");
        }
        if (times_.unit == TimeUnit::kFrames) {
            time_ns = static_cast<std::int64_t>(static_cast<double>(*time_ns) / times_.frames_per_s);
        }
        return take_named(line, rest, *time_ns, image);
    }
    // The same where a line has one time for both: that of the image before.
    [[nodiscard]] Status take_second(std::size_t line, std::string_view& rest, const ListedImage& first,
                                     ListedImage& image) {
        std::string_view ahead = rest;
        const bool has_time = parse_time_ns(take_time(ahead), nanosecond_digits(times_.unit)).has_value();
        const bool is_empty = rest.find_first_not_of(kBlanks) == std::string_view::npos;
        return has_time || is_empty ? take(line, rest, image) : take_named(line, rest, first.time_ns, image);
    }
    [[nodiscard]] Status check_order(const ListedLine& line, std::int64_t before_ns, std::int64_t time_ns) {
        if (time_ns > before_ns) return Status::kOk;
        std::string_view rest = line.text;
        const std::string word = "time " + take_time(rest).substr(0, 40);
        return fail(line.number, word + (time_ns == before_ns ? " repeats the line before; remove one of the two."
                                                              : " goes backwards; sort the list by time."));
    }

private:
    [[nodiscard]] Status take_named(std::size_t line, std::string_view& rest, std::int64_t time_ns,
                                    ListedImage& image) {
        const std::string_view name = take_name(rest);
        if (name.empty() || name.size() > kFileNameMax || name.find('\0') != std::string_view::npos) {
            return fail(line, "no usable file name after the time; a line is 'seconds file name'.");
        }
        image = {time_ns, static_cast<std::uint32_t>(name.data() - text_.data()),
                 static_cast<std::uint32_t>(name.size())};
        return Status::kOk;
    }
    [[nodiscard]] Status fail(std::size_t line, const std::string& sentence) {
        message_ = file_ + ", line " + std::to_string(line) + ": " + sentence;
        return Status::kInvalid;
    }

    std::string_view text_;
    const std::string& file_;
    std::string& message_;
    ListTimes& times_;
};

[[nodiscard]] bool names_depth(std::string_view name) {
    return name.find("depth") != std::string_view::npos || name.find("Depth") != std::string_view::npos;
}

}  // namespace

bool is_image_name(std::string_view name) {
    const std::size_t dot = name.rfind('.');
    return dot != std::string_view::npos && is_extension(name.substr(dot));
}

Status parse_image_list(std::string_view text, const std::string& file, std::vector<ListedImage>& images,
                        std::string& message) {
    ListTimes times{.frames_per_s = 1};
    return parse_image_list(text, file, images, message, times);
}

Status parse_image_list(std::string_view text, const std::string& file, std::vector<ListedImage>& images,
                        std::string& message, ListTimes& times) {
    images.clear();
    ListReader reader(text, file, message, times);
    std::vector<ListedLine> lines;
    STILLMESH_TRY(reader.begin(lines));
    for (const ListedLine& line : lines) {
        std::string_view rest = line.text;
        ListedImage image;
        STILLMESH_TRY(reader.take(line.number, rest, image));
        if (!images.empty()) STILLMESH_TRY(reader.check_order(line, images.back().time_ns, image.time_ns));
        images.push_back(image);
    }
    return Status::kOk;
}

Status parse_associations(std::string_view text, const std::string& file, std::vector<ImagePair>& pairs,
                          std::string& message, ListTimes& times) {
    pairs.clear();
    ListReader reader(text, file, message, times);
    std::vector<ListedLine> lines;
    STILLMESH_TRY(reader.begin(lines));
    bool is_depth_first = false;
    for (const ListedLine& line : lines) {
        std::string_view rest = line.text;
        ImagePair pair;
        STILLMESH_TRY(reader.take(line.number, rest, pair.colour));
        STILLMESH_TRY(reader.take_second(line.number, rest, pair.colour, pair.depth));
        if (pairs.empty()) {
            const auto name = [text](const ListedImage& image) {
                return text.substr(image.name_offset, image.name_size);
            };
            is_depth_first = names_depth(name(pair.colour)) && !names_depth(name(pair.depth));
        }
        if (is_depth_first) std::swap(pair.colour, pair.depth);
        if (!pairs.empty()) {
            STILLMESH_TRY(reader.check_order(line, pairs.back().colour.time_ns, pair.colour.time_ns));
        }
        pairs.push_back(pair);
    }
    return Status::kOk;
}

std::vector<ImagePair> associate(std::span<const ListedImage> colour, std::span<const ListedImage> depth,
                                 std::int64_t gap_max_ns) {
    struct Candidate {
        std::int64_t gap_ns;
        std::uint32_t colour;
        std::uint32_t depth;
    };
    std::vector<Candidate> candidates;
    candidates.reserve(colour.size() + colour.size() / 4);
    std::size_t first = 0;
    for (std::size_t i = 0; i < colour.size(); ++i) {
        // Times are at least 0: the differences cannot overflow.
        while (first < depth.size() && colour[i].time_ns - depth[first].time_ns > gap_max_ns) ++first;
        for (std::size_t j = first; j < depth.size() && depth[j].time_ns - colour[i].time_ns <= gap_max_ns; ++j) {
            const std::int64_t gap = depth[j].time_ns - colour[i].time_ns;
            candidates.push_back({gap < 0 ? -gap : gap, static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(j)});
            // More than a few partners per image are no camera's list; keeps bytes from outside from growing this n^2.
            if (j - first >= 64) break;
        }
    }
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
        if (a.gap_ns != b.gap_ns) return a.gap_ns < b.gap_ns;
        return a.colour != b.colour ? a.colour < b.colour : a.depth < b.depth;
    });
    constexpr std::uint32_t kNone = 0xffffffffU;
    std::vector<std::uint32_t> depth_of(colour.size(), kNone);
    std::vector<bool> is_used(depth.size(), false);
    for (const Candidate& candidate : candidates) {
        if (depth_of[candidate.colour] != kNone || is_used[candidate.depth]) continue;
        depth_of[candidate.colour] = candidate.depth;
        is_used[candidate.depth] = true;
    }
    std::vector<ImagePair> pairs;
    pairs.reserve(colour.size());
    for (std::size_t i = 0; i < colour.size(); ++i) {
        if (depth_of[i] == kNone) continue;
        const ListedImage& partner = depth[depth_of[i]];
        if (!pairs.empty() && partner.time_ns <= pairs.back().depth.time_ns) continue;
        pairs.push_back({colour[i], partner});
    }
    return pairs;
}

std::optional<std::int64_t> constant_offset_ns(std::span<const ListedImage> colour, std::span<const ListedImage> depth,
                                               std::int64_t gap_max_ns) {
    constexpr std::size_t kTried = 4;  // of each list's first: one of them has a partner, or the offset is not constant
    std::int64_t best_ns = 0;
    std::size_t most = 0;
    double least_apart_ns = std::numeric_limits<double>::infinity();
    std::vector<ListedImage> moved(depth.begin(), depth.end());
    for (std::size_t i = 0; i < std::min(kTried, colour.size()); ++i) {
        for (std::size_t j = 0; j < std::min(kTried, depth.size()); ++j) {
            const std::int64_t offset_ns = depth[j].time_ns - colour[i].time_ns;
            if (offset_ns < 0 && depth.back().time_ns > std::numeric_limits<std::int64_t>::max() + offset_ns) continue;
            for (std::size_t k = 0; k < depth.size(); ++k) {
                moved[k].time_ns = std::max<std::int64_t>(depth[k].time_ns - offset_ns, 0);
            }
            const std::vector<ImagePair> pairs = associate(colour, moved, gap_max_ns);
            double apart_ns = 0;
            for (const ImagePair& pair : pairs) {
                apart_ns += std::fabs(static_cast<double>(pair.depth.time_ns - pair.colour.time_ns));
            }
            // An image more or less at the begin fits as well, but for the unevenness of a camera's clock.
            if (pairs.size() < most || (pairs.size() == most && apart_ns >= least_apart_ns)) continue;
            most = pairs.size();
            least_apart_ns = apart_ns;
            best_ns = offset_ns;
        }
    }
    if (2 * most < std::min(colour.size(), depth.size())) return std::nullopt;
    return best_ns;
}

// Seldom two clocks are all that differs: then the sentence says by how much, and what takes it.
std::string why_no_pairs(std::span<const ListedImage> colour, std::span<const ListedImage> depth,
                         std::int64_t gap_max_ns) {
    constexpr std::int64_t kGap_ns = 100'000'000;  // of images that still show one scene, more or less
    char text[200];
    const std::string sentence =
        "no colour image has a depth image within " + std::to_string(gap_max_ns / 1'000'000) + " ms; ";
    std::vector<std::int64_t> gaps_ns;  // from each colour image to the nearest depth image
    for (const ListedImage& image : colour) {
        auto at = std::lower_bound(depth.begin(), depth.end(), image.time_ns,
                                   [](const ListedImage& d, std::int64_t time_ns) { return d.time_ns < time_ns; });
        std::int64_t gap_ns = std::numeric_limits<std::int64_t>::max();
        if (at != depth.end()) gap_ns = at->time_ns - image.time_ns;
        if (at != depth.begin()) gap_ns = std::min(gap_ns, image.time_ns - (at - 1)->time_ns);
        gaps_ns.push_back(gap_ns);
    }
    std::sort(gaps_ns.begin(), gaps_ns.end());
    const std::int64_t gap_ns = gaps_ns[gaps_ns.size() * 9 / 10];  // the last of a list may have none near
    if (gap_ns <= kGap_ns) {
        std::snprintf(text, sizeof(text),
                      "depth is %.1f ms away: --pair-gap %.3f pairs them all the same, --depth-offset takes a "
                      "constant one off.",
                      static_cast<double>(gap_ns) * 1e-6, static_cast<double>(gap_ns / 1'000'000 + 1) * 1e-3);
        return sentence + text;
    }
    const auto offset_ns = constant_offset_ns(colour, depth, gap_max_ns);
    if (!offset_ns) return sentence + "do colour and depth share one clock?";
    const double offset_s = static_cast<double>(*offset_ns) * 1e-9;
    std::snprintf(text, sizeof(text),
                  "two clocks, %.3f s apart throughout? If images of one moment are, give --depth-offset=%.3f.",
                  std::fabs(offset_s), offset_s);
    return sentence + text;
}

}  // namespace stillmesh
