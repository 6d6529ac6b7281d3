#include "platform/motion/motion_file.hpp"

#include <fmt/format.h>

#include "platform/motion/triple_lines.hpp"

namespace stillmesh {
namespace {

constexpr TripleKind kGyroscope = {"'timestamp wx wy wz' in s and rad/s", 100,
                                   "rad/s is no turning of a camera; are these degrees?"};

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
    return take_gyroscope(file, [&](const auto& take) { return read_triples(file, kGyroscope, take, message); });
}

Status MotionFile::parse_gyroscope(std::string_view text, const std::string& file, std::string& message) {
    return take_gyroscope(file, [&](const auto& take) { return parse_triples(text, file, kGyroscope, take, message); });
}

template <typename Read>
Status MotionFile::take_gyroscope(const std::string& file, const Read& read) {
    samples_.gyroscope.clear();
    STILLMESH_TRY(read([this](std::int64_t time_ns, const Triple& rad_s) {
        samples_.gyroscope.push_back({time_ns, rad_s});
    }));
    sources_ += (sources_.empty() ? "" : " and ") + file;
    return Status::kOk;
}

}  // namespace stillmesh
