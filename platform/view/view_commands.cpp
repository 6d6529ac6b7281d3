#include "platform/view/view_commands.hpp"

#include <charconv>
#include <cmath>
#include <system_error>

namespace stillmesh {
namespace {

// A number that is the whole text, within [0, most].
[[nodiscard]] std::optional<double> number_of(std::string_view text, double most) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value <= most)) return std::nullopt;
    return value;
}

}  // namespace

std::optional<ViewCommand> parse_view_command(std::string_view text) {
    using enum ViewVerb;
    if (text == "pause") return ViewCommand{kPause};
    if (text == "resume") return ViewCommand{kResume};
    if (text == "step") return ViewCommand{kStep};
    if (text == "reset") return ViewCommand{kReset};
    if (text == "save_map") return ViewCommand{kSaveMap};
    constexpr std::string_view kSpeedIs = "speed=";
    if (text.starts_with(kSpeedIs)) {
        const auto speed = number_of(text.substr(kSpeedIs.size()), kViewSpeedMax);
        if (speed) return ViewCommand{kSpeed, *speed};
    }
    if (text == "localise=0" || text == "localise=1") return ViewCommand{kLocaliseOnly, text.back() == '1' ? 1.0 : 0.0};
    if (text == "saving=0" || text == "saving=1") return ViewCommand{kSaving, text.back() == '1' ? 1.0 : 0.0};
    return std::nullopt;
}

}  // namespace stillmesh
