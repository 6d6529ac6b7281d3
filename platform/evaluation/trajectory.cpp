#include "platform/evaluation/trajectory.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <span>

#include "hal/replay/decimal_time.hpp"
#include "hal/replay/time_unit.hpp"
#include "platform/evaluation/text_lines.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {

namespace {

constexpr std::size_t kColumns = 8;
constexpr std::size_t kBytesMax = std::size_t{256} << 20U;  // a day at 30 poses a second

// The first kColumns words of a line, and how many there are.
std::size_t split(std::string_view line, std::string_view separators, std::array<std::string, kColumns>& words) {
    std::size_t count = 0;
    for (std::size_t at = line.find_first_not_of(separators); at < line.size(); ++count) {
        const std::size_t end = std::min(line.find_first_of(separators, at), line.size());
        if (count < words.size()) words[count] = line.substr(at, end - at);
        at = line.find_first_not_of(separators, end);
    }
    return count;
}

// Columns are parted by blanks; or by commas, with blanks or without. In blank-parted columns a comma is that of a
// decimal number.
std::size_t columns_of(std::string_view line, std::array<std::string, kColumns>& words) {
    constexpr std::string_view kBlanks = " \t\r";
    if (split(line, kBlanks, words) != kColumns) return split(line, kTextBlanks, words);
    for (std::string& word : words) {
        if (word.size() > 1 && word.back() == ',') word.pop_back();
        std::replace(word.begin(), word.end(), ',', '.');
    }
    return kColumns;
}

// What all of its times are.
TimeUnit unit_of(std::string_view text) {
    TimeUnitGuess guess;
    std::array<std::string, kColumns> words;
    for_lines(text, [&](std::size_t, std::string_view line) {
        if (guess.wants_more() && columns_of(line, words) == kColumns) guess.see(words[0]);
        return guess.wants_more();
    });
    return guess.unit();
}

}  // namespace

Status parse_trajectory(std::string_view text, const std::string& file, Trajectory& trajectory, std::string& message,
                        double frames_per_s) {
    trajectory.clear();
    const TimeUnit unit = unit_of(text);
    message.clear();
    for_lines(text, [&](std::size_t line_number, std::string_view line) {
        const auto fail = [&](const std::string& sentence) {
            message = file + ", line " + std::to_string(line_number) + ": " + sentence +
                      "; a line is 'timestamp tx ty tz qx qy qz qw'.";
            return false;
        };
        std::array<std::string, kColumns> words;
        const std::size_t count = columns_of(line, words);
        if (count < kColumns) return fail("only " + std::to_string(count) + " words");
        if (count > kColumns) {
            const bool has_commas = line.find(',') != std::string_view::npos;
            return fail(std::to_string(count) + " words" + (has_commas ? " (are there decimal commas?)" : ""));
        }
        TrajectoryPose pose;
        auto time_ns = parse_time_ns(words[0], nanosecond_digits(unit));
        if (!time_ns) return fail("'" + words[0].substr(0, 40) + "' is not a time in seconds");
        if (unit == TimeUnit::kFrames && frames_per_s >= 1) {
            time_ns = static_cast<std::int64_t>(static_cast<double>(*time_ns) / frames_per_s);
        }
        pose.time_ns = *time_ns;
        bool is_finite = true;
        for (std::size_t i = 1; i < words.size(); ++i) {
            double value = 0;
            std::string_view word = words[i];
            if (word.starts_with('+')) word.remove_prefix(1);
            const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), value);
            if (error != std::errc() || rest != word.data() + word.size()) {
                return fail("'" + std::string(word.substr(0, 40)) + "' is not a number");
            }
            is_finite = is_finite && std::isfinite(value);
            (i < 4 ? pose.t[i - 1] : pose.q[i - 4]) = value;
        }
        if (!is_finite) return true;  // as the TUM tools do: a pose of NaNs is no pose
        const double length =
            std::sqrt(pose.q[0] * pose.q[0] + pose.q[1] * pose.q[1] + pose.q[2] * pose.q[2] + pose.q[3] * pose.q[3]);
        if (!(length > 1e-6 && length < 1e6)) return fail("the quaternion is zero or far too long");
        for (double& value : pose.q) value /= length;
        trajectory.push_back(pose);
        return true;
    });
    if (!message.empty()) return Status::kInvalid;
    std::stable_sort(trajectory.begin(), trajectory.end(),
                     [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.time_ns < b.time_ns; });
    return Status::kOk;
}

Status read_trajectory(const std::string& file, Trajectory& trajectory, std::string& message, double frames_per_s) {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    if (!read_whole_file(file, kBytesMax, block, bytes, message)) return Status::kUnavailable;
    return parse_trajectory({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file, trajectory, message,
                            frames_per_s);
}

std::string time_text(std::int64_t time_ns) {
    std::string text;
    append_time(time_ns, text);
    return text;
}

void append_time(std::int64_t time_ns, std::string& text) {
    std::array<char, 40> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%lld.%09lld", static_cast<long long>(time_ns / 1'000'000'000),
                  static_cast<long long>(time_ns % 1'000'000'000));
    text += buffer.data();
}

std::string pose_line(const TrajectoryPose& pose) {
    std::string line;
    append_pose_line(pose, line);
    return line;
}

void append_pose_line(const TrajectoryPose& pose, std::string& text) {
    // The largest double has 309 digits before its point; a trajectory read from a file may hold it.
    std::array<char, 3 * 320 + 4 * 16 + 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", pose.t[0], pose.t[1],
                  pose.t[2], pose.q[0], pose.q[1], pose.q[2], pose.q[3]);
    append_time(pose.time_ns, text);
    text += buffer.data();
}

}  // namespace stillmesh
