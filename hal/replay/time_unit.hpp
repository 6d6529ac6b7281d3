// The unit of times in text. The TUM layout has seconds; recorders also write milliseconds, microseconds and
// nanoseconds, since 1970 or since the start, and frame numbers. Told by the step from one time to the next (a camera
// takes 1 to 200 images a second), else by the size: since 1970 the units lie a factor of 1000 apart.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stillmesh {

enum class TimeUnit : std::uint8_t { kSeconds, kMilliseconds, kMicroseconds, kNanoseconds, kFrames };

[[nodiscard]] constexpr const char* time_unit_name(TimeUnit unit) noexcept {
    constexpr const char* kNames[] = {"seconds", "milliseconds", "microseconds", "nanoseconds", "frame numbers"};
    return kNames[static_cast<std::uint32_t>(unit)];
}
// Digits of a nanosecond behind the point of a time in this unit; frame numbers as seconds.
[[nodiscard]] constexpr std::int64_t nanosecond_digits(TimeUnit unit) noexcept {
    constexpr std::int64_t kDigits[] = {9, 6, 3, 0, 9};
    return kDigits[static_cast<std::uint32_t>(unit)];
}

// Is shown the times of a file one by one, as they stand there, and then says what they are.
class TimeUnitGuess {
public:
    void see(std::string_view word);
    [[nodiscard]] bool wants_more() const { return times_.size() < kTimesMax; }
    [[nodiscard]] TimeUnit unit() const;
    [[nodiscard]] double step() const { return step_of(times_); }  // the one in the middle, in the unit of the file

private:
    static constexpr std::size_t kTimesMax = 1000;  // of the beginning: enough to know
    [[nodiscard]] static double step_of(const std::vector<double>& times);

    std::vector<double> times_;
    bool are_whole_ = true;
};

}  // namespace stillmesh
