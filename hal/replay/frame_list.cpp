#include "hal/replay/frame_list.hpp"

#include <algorithm>

#include "hal/replay/decimal_time.hpp"

namespace stillmesh {
namespace {

constexpr std::string_view kBlanks = " \t\r,";

[[nodiscard]] std::string_view next_word(std::string_view line, std::size_t& at) {
    const std::size_t begin = std::min(line.find_first_not_of(kBlanks, at), line.size());
    const std::size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
    at = end;
    return line.substr(begin, end - begin);
}

}  // namespace

Status parse_image_list(std::string_view text, const std::string& file, std::vector<ListedImage>& images,
                        std::string& message) {
    const auto fail = [&](std::size_t line_number, const std::string& sentence) {
        message = file + ", line " + std::to_string(line_number) + ": " + sentence;
        return Status::kInvalid;
    };
    images.clear();
    if (text.size() > 0xffffffffU) {
        message = file + ": the list is longer than 4 GiB; cut the recording.";
        return Status::kInvalid;
    }
    std::size_t line_number = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string_view line = text.substr(begin, end - begin);
        ++line_number;
        std::size_t at = 0;
        const std::string_view time_word = next_word(line, at);
        if (!time_word.empty() && time_word[0] != '#') {
            const std::string_view name = next_word(line, at);
            const auto time_ns = parse_time_ns(time_word);
            if (!time_ns) {
                return fail(line_number, "'" + std::string(time_word.substr(0, 40)) +
                                             "' is not a time in seconds; a line is 'seconds file name'.");
            }
            if (name.empty() || name.size() > kFileNameMax || name.find('\0') != std::string_view::npos) {
                return fail(line_number, "no usable file name after the time; a line is 'seconds file name'.");
            }
            if (!images.empty() && *time_ns == images.back().time_ns) {
                return fail(line_number, "time " + std::string(time_word.substr(0, 40)) +
                                             " repeats the line before; remove one of the two.");
            }
            if (!images.empty() && *time_ns < images.back().time_ns) {
                return fail(line_number,
                            "time " + std::string(time_word.substr(0, 40)) + " goes backwards; sort the list by time.");
            }
            const auto offset = static_cast<std::uint32_t>(name.data() - text.data());
            images.push_back({*time_ns, offset, static_cast<std::uint32_t>(name.size())});
        }
        begin = end + 1;
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

}  // namespace stillmesh
