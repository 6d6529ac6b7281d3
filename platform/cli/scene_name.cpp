#include "platform/cli/scene_name.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

namespace stillmesh {

bool parse_scene_name(std::string_view text, SceneName& out, std::string& message) {
    const std::size_t colon = text.find(':');
    out.name = text.substr(0, colon);
    if (colon == std::string_view::npos) return true;
    const std::string_view seeds = text.substr(colon + 1);
    const std::size_t plus = std::min(seeds.find('+'), seeds.size());
    const auto read = [](std::string_view digits, std::uint64_t& number) {
        const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
        return error == std::errc() && end == digits.data() + digits.size();
    };
    if (read(seeds.substr(0, plus), out.seed) &&
        (plus == seeds.size() || (read(seeds.substr(plus + 1), out.day) && out.day != 0)))
        return true;
    message = fmt::format(
        "{}: the seed is a whole number, as in walking_xyz:2; walking_xyz:2+7 is the same room on day 7, with other "
        "people, another camera's way and other light",
        text);
    return false;
}

}  // namespace stillmesh
