#include "hal/replay/time_unit.hpp"

#include <algorithm>
#include <charconv>

namespace stillmesh {

void TimeUnitGuess::see(std::string_view word) {
    if (!wants_more()) return;
    if (word.starts_with('+')) word.remove_prefix(1);
    double time = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), time);
    if (error != std::errc() || end != word.data() + word.size()) return;  // whoever reads the line says so
    are_whole_ = are_whole_ && word.find_first_not_of("0123456789") == std::string_view::npos;
    times_.push_back(time);
}

double TimeUnitGuess::step_of(const std::vector<double>& times) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
    if (steps.empty()) return 0;
    std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
    return steps[steps.size() / 2];
}

TimeUnit TimeUnitGuess::unit() const {
    if (times_.empty()) return TimeUnit::kSeconds;
    constexpr double kYear1973 = 1e8;  // s since 1970: no frame number, and in the next unit what no uptime reaches
    const double last = times_.back();
    const double step = step_of(times_);
    if ((are_whole_ && times_.size() >= 3) || last > 1000 * kYear1973) {
        if (step >= 5 && step <= 1e3) return TimeUnit::kMilliseconds;
        if (step >= 5e3 && step <= 1e6) return TimeUnit::kMicroseconds;
        if (step >= 5e6 && step <= 1e9) return TimeUnit::kNanoseconds;
        if (are_whole_ && step >= 1 && step < 5 && last < kYear1973) return TimeUnit::kFrames;
    }
    if (last > 1e9 * kYear1973) return TimeUnit::kNanoseconds;
    if (last > 1e6 * kYear1973) return TimeUnit::kMicroseconds;
    if (last > 1e3 * kYear1973) return TimeUnit::kMilliseconds;
    return TimeUnit::kSeconds;
}

}  // namespace stillmesh
