#include "hal/simulated/dirt.hpp"

#include <algorithm>
#include <charconv>

namespace stillmesh {

Dirt laid_over(const Dirt& under, const Dirt& over) noexcept {
    Dirt out = over;
#define STILLMESH_DIRT_LAY(name, text) \
    if (out.name < 0) out.name = under.name;
    STILLMESH_DIRT(STILLMESH_DIRT_LAY)
#undef STILLMESH_DIRT_LAY
    return out;
}

bool is_clean(const Dirt& dirt) noexcept {
    bool is_on = false;
    visit_dirt(dirt, [&](const char*, double strength, const char*) { is_on = is_on || strength > 0; });
    return !is_on;
}

bool parse_dirt(const std::string& text, Dirt& dirt, std::string& message) {
    std::size_t begin = 0;
    while (begin < text.size()) {
        const std::size_t end = std::min(text.find(',', begin), text.size());
        const std::string part = text.substr(begin, end - begin);
        begin = end + 1;
        const std::size_t equals = std::min(part.find('='), part.size());
        const std::string wanted = part.substr(0, equals);
        double strength = 1;  // a name alone: at 1
        if (equals < part.size()) {
            const char* const last = part.data() + part.size();
            const auto [at, error] = std::from_chars(part.data() + equals + 1, last, strength);
            if (error != std::errc() || at != last || !(strength >= 0 && strength <= kDirtMax)) {
                message = "'" + part + "': a strength is a number from 0 (off) over 1 (ordinary) to 10";
                return false;
            }
        }
        bool is_known = false;
        visit_dirt(dirt, [&](const char* name, double& value, const char*) {
            if (wanted != "all" && wanted != name) return;
            value = strength;
            is_known = true;
        });
        if (!is_known) {
            message = "there is no effect '" + wanted + "'; there are: all";
            visit_dirt(dirt, [&](const char* name, double, const char*) { message += std::string(" ") + name; });
            return false;
        }
    }
    return true;
}

std::string dirt_text(const Dirt& dirt) {
    std::string out;
    visit_dirt(dirt, [&](const char* name, double strength, const char*) {
        if (strength < 0) return;
        char text[32];
        const auto [end, error] = std::to_chars(text, text + sizeof text, strength);
        static_cast<void>(error);
        out += (out.empty() ? "" : ",") + std::string(name) + "=" + std::string(text, end);
    });
    return out;
}

}  // namespace stillmesh
