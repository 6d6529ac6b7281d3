// The lines of a text file of numbers, as TUM's tools write them: words between blanks, comments behind #.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace stillmesh {

inline constexpr std::string_view kTextBlanks = " \t\r,";

// Calls line(number, text) for each line that is neither empty nor a comment, until it says false. A byte order mark is
// no part of the first.
template <typename Line>
void for_lines(std::string_view text, Line&& line) {
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
    std::size_t number = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string_view one = text.substr(begin, end - begin);
        begin = end + 1;
        ++number;
        const std::size_t first = one.find_first_not_of(kTextBlanks);
        if (first == std::string_view::npos || one[first] == '#') continue;
        if (!line(number, one)) return;
    }
}

}  // namespace stillmesh
