// In a file of its own: who asks for the nearest key needs no reader of YAML.
#include <algorithm>
#include <array>
#include <cstddef>

#include "hal/calibration/calibration.hpp"

namespace stillmesh {

std::string_view nearest_name(std::string_view name, std::span<const std::string_view> known) {
    constexpr std::size_t kLengthMax = 64;
    if (name.empty() || name.size() > kLengthMax) return {};
    std::string_view best;
    std::size_t best_distance = std::max<std::size_t>(name.size() / 3, 1) + 1;
    for (const std::string_view candidate : known) {
        if (candidate.size() > kLengthMax) continue;
        // Levenshtein's distance, one row at a time; a capital letter is no difference.
        std::array<std::size_t, kLengthMax + 1> row{};
        for (std::size_t j = 0; j <= candidate.size(); ++j) row[j] = j;
        for (std::size_t i = 1; i <= name.size(); ++i) {
            std::size_t diagonal = row[0];
            row[0] = i;
            for (std::size_t j = 1; j <= candidate.size(); ++j) {
                const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
                const std::size_t change = diagonal + (lower(name[i - 1]) == lower(candidate[j - 1]) ? 0U : 1U);
                diagonal = row[j];
                row[j] = std::min({row[j] + 1, row[j - 1] + 1, change});
            }
        }
        if (row[candidate.size()] < best_distance) {
            best_distance = row[candidate.size()];
            best = candidate;
        }
    }
    return best;
}

}  // namespace stillmesh
