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

double share_of(std::int64_t time_ns, std::int64_t from_ns, std::int64_t to_ns) {
    return to_ns == from_ns ? 0.0 : static_cast<double>(time_ns - from_ns) / static_cast<double>(to_ns - from_ns);
}

template <typename Item>
auto first_from(const std::vector<Item>& items, std::int64_t time_ns) {
    return std::lower_bound(items.begin(), items.end(), time_ns,
                            [](const Item& item, std::int64_t time) { return item.time_ns < time; });
}

}  // namespace

Status MotionFile::read_odometry(const std::string& file, std::string& message) {
    STILLMESH_TRY(read_trajectory(file, odometry_, message));
    return take_odometry(file, message);
}

Status MotionFile::parse_odometry(std::string_view text, const std::string& file, std::string& message) {
    STILLMESH_TRY(parse_trajectory(text, file, odometry_, message));
    return take_odometry(file, message);
}

Status MotionFile::take_odometry(const std::string& file, std::string& message) {
    if (odometry_.size() >= 2) {
        sources_ += (sources_.empty() ? "" : " and ") + file;
        return Status::kOk;
    }
    message = fmt::format("{}: has {} poses; a motion needs two. A line is 'timestamp tx ty tz qx qy qz qw'.", file,
                          odometry_.size());
    return Status::kInvalid;
}

Status MotionFile::read_gyroscope(const std::string& file, std::string& message) {
    MemoryBlock block;
    std::span<const std::byte> bytes;
    if (!read_whole_file(file, kBytesMax, block, bytes, message)) return Status::kUnavailable;
    return parse_gyroscope({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, file, message);
}

Status MotionFile::parse_gyroscope(std::string_view text, const std::string& file, std::string& message) {
    gyroscope_.clear();
    std::string wrong;
    for_lines(text, [&](std::size_t number, std::string_view line) {
        std::array<std::string_view, kColumns + 1> words;
        const std::size_t count = words_of(line, words);
        TurningRate rate;
        if (count != kColumns) {
            wrong = fmt::format("{} words", count > kColumns ? "too many" : std::to_string(count));
        } else if (const auto time_ns = parse_time_ns(words[0]); !time_ns) {
            wrong = fmt::format("'{}' is not a time in seconds", words[0].substr(0, 40));
        } else if (!gyroscope_.empty() && *time_ns <= gyroscope_.back().time_ns) {
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
        gyroscope_.push_back(rate);
        return true;
    });
    if (!wrong.empty()) return Status::kInvalid;
    if (gyroscope_.size() >= 2) {
        sources_ += (sources_.empty() ? "" : " and ") + file;
        return Status::kOk;
    }
    message = fmt::format("{}: has {} lines; a motion needs two. A line is 'timestamp wx wy wz' in s and rad/s.", file,
                          gyroscope_.size());
    return Status::kInvalid;
}

std::optional<TrajectoryPose> MotionFile::pose_at(std::int64_t time_ns) const {
    const auto next = first_from(odometry_, time_ns);
    if (next == odometry_.end()) return std::nullopt;
    if (next->time_ns == time_ns) return *next;
    if (next == odometry_.begin() || next->time_ns - (next - 1)->time_ns > kGapMax_ns) return std::nullopt;
    const TrajectoryPose& last = *(next - 1);
    return between(last, *next, share_of(time_ns, last.time_ns, next->time_ns));
}

// The rate between two lines goes evenly from one to the other.
std::optional<Quaternion> MotionFile::turn_between(std::int64_t from_ns, std::int64_t to_ns) const {
    if (gyroscope_.empty() || from_ns < gyroscope_.front().time_ns || to_ns > gyroscope_.back().time_ns) {
        return std::nullopt;
    }
    Quaternion out{0, 0, 0, 1};
    auto next = first_from(gyroscope_, from_ns);
    if (next == gyroscope_.begin()) ++next;
    for (std::int64_t at_ns = from_ns; at_ns < to_ns; ++next) {
        const TurningRate& a = *(next - 1);
        const TurningRate& b = *next;
        if (b.time_ns - a.time_ns > kGapMax_ns) return std::nullopt;
        const std::int64_t until_ns = std::min(b.time_ns, to_ns);
        const double middle = share_of(at_ns + (until_ns - at_ns) / 2, a.time_ns, b.time_ns);
        const double seconds = static_cast<double>(until_ns - at_ns) * 1e-9;
        Triple turn{};
        for (std::size_t i = 0; i < 3; ++i) turn[i] = seconds * (a.rad_s[i] + middle * (b.rad_s[i] - a.rad_s[i]));
        out = product(out, quaternion_of(turn));
        at_ns = until_ns;
    }
    return out;
}

std::optional<MotionHint> MotionFile::between_times(std::int64_t from_ns, std::int64_t to_ns) const {
    constexpr double kMost_m = 100;  // no camera leaps so far from frame to frame
    constexpr double kMost_rad = 3;  // nothing is known of a turn then
    MotionHint out;
    const auto from = pose_at(from_ns);
    const auto to = pose_at(to_ns);
    if (from && to) {
        const RigidTransform step = step_between(*from, *to);
        const double* const q = step.rotation_xyzw;
        const double way_m = length_of({step.translation_m[0], step.translation_m[1], step.translation_m[2]});
        if (way_m < kMost_m) {  // also not where it is no number
            out.last_from_camera = step;
            out.sigma_m = errors_.way_share * way_m + errors_.step_m;
            out.sigma_rad =
                errors_.turn_share * length_of(rotation_vector_of({q[0], q[1], q[2], q[3]})) + errors_.step_rad;
        }
    }
    if (const auto turn = turn_between(from_ns, to_ns)) {
        const double sigma_rad =
            (errors_.gyro_rad_s + errors_.gyro_noise_rad_s) * static_cast<double>(to_ns - from_ns) * 1e-9;
        if (sigma_rad < kMost_rad && (out.sigma_rad < 0 || sigma_rad < out.sigma_rad)) {
            std::copy(turn->begin(), turn->end(), out.last_from_camera.rotation_xyzw);
            out.sigma_rad = sigma_rad;
        }
    }
    if (out.sigma_m < 0 && out.sigma_rad < 0) return std::nullopt;
    return out;
}

std::string rate_line(std::int64_t time_ns, const Triple& rad_s) {
    return fmt::format("{} {:.9f} {:.9f} {:.9f}\n", time_text(time_ns), rad_s[0], rad_s[1], rad_s[2]);
}

}  // namespace stillmesh
