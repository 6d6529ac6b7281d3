#include "platform/motion/motion_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "hal/replay/decimal_time.hpp"
#include "platform/evaluation/text_lines.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kBytesMax = std::size_t{512} << 20U;  // a gyroscope at 1 kHz for two hours
constexpr std::size_t kColumns = 4;

// The words of a line, up to one more than a line may have.
std::size_t words_of(std::string_view line, std::array<std::string_view, kColumns + 1>& words) {
    std::size_t count = 0;
    std::size_t at = line.find_first_not_of(kTextBlanks);
    while (at != std::string_view::npos && count < words.size()) {
        const std::size_t end = std::min(line.find_first_of(kTextBlanks, at), line.size());
        words[count++] = line.substr(at, end - at);
        at = line.find_first_not_of(kTextBlanks, end);
    }
    return count;
}

bool parse_number(std::string_view word, double& value) {
    if (word.starts_with('+')) word.remove_prefix(1);
    const auto [rest, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return error == std::errc() && rest == word.data() + word.size() && std::isfinite(value);
}

}  // namespace

Status MotionFile::read_odometry(const std::string& file, std::string& message) {
    STILLMESH_TRY(read_trajectory(file, samples_.odometry, message));
    return take_odometry(file, message);
}

Status MotionFile::parse_odometry(std::string_view text, const std::string& file, std::string& message) {
    STILLMESH_TRY(parse_trajectory(text, file, samples_.odometry, message));
    return take_odometry(file, message);
}

Status MotionFile::take_odometry(const std::string& file, std::string& message) {
    if (samples_.odometry.size() >= 2) {
        sources_ += (sources_.empty() ? "" : " and ") + file;
        return Status::kOk;
    }
    message = fmt::format("{}: has {} poses; a motion needs two. A line is 'timestamp tx ty tz qx qy qz qw'.", file,
                          samples_.odometry.size());
    return Status::kInvalid;
}

Status MotionFile::read_gyroscope(const std::string& file, std::string& message) {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    if (!read_whole_file(file, kBytesMax, block, bytes, message)) return Status::kUnavailable;
    return parse_gyroscope({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file, message);
}

Status MotionFile::parse_gyroscope(std::string_view text, const std::string& file, std::string& message) {
    samples_.gyroscope.clear();
    std::string wrong;
    for_lines(text, [&](std::size_t number, std::string_view line) {
        std::array<std::string_view, kColumns + 1> words;
        const std::size_t count = words_of(line, words);
        TurningRate rate;
        if (count != kColumns) {
            wrong = fmt::format("{} words", count > kColumns ? "too many" : std::to_string(count));
        } else if (const auto time_ns = parse_time_ns(words[0]); !time_ns) {
            wrong = fmt::format("'{}' is not a time in seconds", words[0].substr(0, 40));
        } else if (!samples_.gyroscope.empty() && *time_ns <= samples_.gyroscope.back().time_ns) {
            wrong = "its time is not after the one of the line before; sort the file by time";
        } else {
            rate.time_ns = *time_ns;
        }
        for (std::size_t i = 1; i < kColumns && wrong.empty(); ++i) {
            if (!parse_number(words[i], rate.rad_s[i - 1])) {
                wrong = fmt::format("'{}' is not a number", words[i].substr(0, 40));
            } else if (constexpr double kMost_rad_s = 100; std::abs(rate.rad_s[i - 1]) > kMost_rad_s) {
                wrong = fmt::format("{} rad/s is no turning of a camera; are these degrees?", rate.rad_s[i - 1]);
            }
        }
        if (!wrong.empty()) {
            message =
                fmt::format("{}, line {}: {}; a line is 'timestamp wx wy wz' in s and rad/s.", file, number, wrong);
            return false;
        }
        samples_.gyroscope.push_back(rate);
        return true;
    });
    if (!wrong.empty()) return Status::kInvalid;
    if (samples_.gyroscope.size() >= 2) {
        sources_ += (sources_.empty() ? "" : " and ") + file;
        return Status::kOk;
    }
    message = fmt::format("{}: has {} lines; a motion needs two. A line is 'timestamp wx wy wz' in s and rad/s.", file,
                          samples_.gyroscope.size());
    return Status::kInvalid;
}

std::string rate_line(std::int64_t time_ns, const Triple& rad_s) {
    return fmt::format("{} {:.9f} {:.9f} {:.9f}\n", time_text(time_ns), rad_s[0], rad_s[1], rad_s[2]);
}

}  // namespace stillmesh
