#include "platform/evaluation/trajectory.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>

#include "hal/replay/decimal_time.hpp"

namespace stillmesh {

Status parse_trajectory(std::string_view text, const std::string& file, Trajectory& trajectory, std::string& message) {
    constexpr std::string_view kBlanks = " \t\r,";
    trajectory.clear();
    std::size_t line_number = 0;
    for (std::size_t begin = 0; begin < text.size();) {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        const std::string_view line = text.substr(begin, end - begin);
        begin = end + 1;
        ++line_number;
        std::array<std::string_view, 8> words;
        std::size_t count = 0;
        for (std::size_t at = line.find_first_not_of(kBlanks); at < line.size() && count < words.size(); ++count) {
            const std::size_t word_end = std::min(line.find_first_of(kBlanks, at), line.size());
            words[count] = line.substr(at, word_end - at);
            at = line.find_first_not_of(kBlanks, word_end);
        }
        if (count == 0 || words[0][0] == '#') continue;
        const auto fail = [&](const std::string& sentence) {
            message = file + ", line " + std::to_string(line_number) + ": " + sentence +
                      "; a line is 'timestamp tx ty tz qx qy qz qw'.";
            return Status::kInvalid;
        };
        if (count < words.size()) return fail("only " + std::to_string(count) + " words");
        TrajectoryPose pose;
        const auto time_ns = parse_time_ns(words[0]);
        if (!time_ns) return fail("'" + std::string(words[0].substr(0, 40)) + "' is not a time in seconds");
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
        if (!is_finite) continue;  // as the TUM tools do: a pose of NaNs is no pose
        const double length =
            std::sqrt(pose.q[0] * pose.q[0] + pose.q[1] * pose.q[1] + pose.q[2] * pose.q[2] + pose.q[3] * pose.q[3]);
        if (!(length > 1e-6 && length < 1e6)) return fail("the quaternion is zero or far too long");
        for (double& value : pose.q) value /= length;
        trajectory.push_back(pose);
    }
    std::stable_sort(trajectory.begin(), trajectory.end(),
                     [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.time_ns < b.time_ns; });
    return Status::kOk;
}

Status read_trajectory(const std::string& file, Trajectory& trajectory, std::string& message) {
    std::ifstream stream(file, std::ios::binary);
    if (!stream) {
        message = file + ": cannot be opened: " + std::strerror(errno) + ".";
        return Status::kUnavailable;
    }
    const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (stream.bad()) {
        message = file + ": cannot be read; is it a folder?";
        return Status::kUnavailable;
    }
    return parse_trajectory(text, file, trajectory, message);
}

std::string time_text(std::int64_t time_ns) {
    std::array<char, 40> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%lld.%09lld", static_cast<long long>(time_ns / 1'000'000'000),
                  static_cast<long long>(time_ns % 1'000'000'000));
    return buffer.data();
}

std::string pose_line(const TrajectoryPose& pose) {
    // The largest double has 309 digits before its point; a trajectory read from a file may hold it.
    std::array<char, 3 * 320 + 4 * 16 + 32> buffer{};
    std::snprintf(buffer.data(), buffer.size(), "%s %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n",
                  time_text(pose.time_ns).c_str(), pose.t[0], pose.t[1], pose.t[2], pose.q[0], pose.q[1], pose.q[2],
                  pose.q[3]);
    return buffer.data();
}

}  // namespace stillmesh
