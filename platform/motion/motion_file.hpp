// How a camera moved by its wheels or its gyroscope, read from files in the TUM layout before a run:
//   odometry.txt  timestamp tx ty tz qx qy qz qw   poses of the camera in any frame that stays (s, m)
//   gyro.txt      timestamp wx wy wz               turning rate in the camera's frame (s, rad/s)
// '#' begins a comment. What lies between two lines: motion_samples.hpp.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/base/status.hpp"
#include "platform/motion/motion_samples.hpp"

namespace stillmesh {

class MotionFile final : public MotionSource {
public:
    // kUnavailable: no such file. kInvalid: a line that cannot be one, times that go back, or fewer than two lines;
    // `message` names file and line, and what a line is.
    [[nodiscard]] Status read_odometry(const std::string& file, std::string& message);
    [[nodiscard]] Status read_gyroscope(const std::string& file, std::string& message);
    [[nodiscard]] Status parse_odometry(std::string_view text, const std::string& file, std::string& message);
    [[nodiscard]] Status parse_gyroscope(std::string_view text, const std::string& file, std::string& message);
    // The files read.
    [[nodiscard]] const std::string& sources() const override { return sources_; }
    void set_errors(const MotionErrors& errors) { samples_.errors = errors; }

    [[nodiscard]] std::optional<MotionHint> between_times(std::int64_t from_ns, std::int64_t to_ns) const override {
        return samples_.between_times(from_ns, to_ns);
    }

private:
    [[nodiscard]] Status take_odometry(const std::string& file, std::string& message);
    template <typename Read>
    [[nodiscard]] Status take_gyroscope(const std::string& file, const Read& read);

    MotionSamples samples_;
    std::string sources_;
};

}  // namespace stillmesh
