// Files of `run --odometry` and `--gyro`, with a byte 0 between them, the second one taken for `--accelerometer`, too:
// any bytes give a sentence, or motions between any two moments that the engine takes, and where up is, or why not.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/static_region/motion_hints.hpp"
#include "fuzz/fuzz.hpp"
#include "platform/motion/accelerometer_file.hpp"
#include "platform/motion/gravity_finder.hpp"
#include "platform/motion/motion_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    using namespace stillmesh;
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    const std::size_t cut = std::min(text.find('\0'), text.size());
    MotionFile motion;
    std::string message;
    const auto is_read = [&](Status status) {
        fuzz::expect(status == Status::kOk || (status == Status::kInvalid && !message.empty()),
                     "a bad file is kInvalid with a sentence");
        return status == Status::kOk;
    };
    const bool has_odometry = is_read(motion.parse_odometry(text.substr(0, cut), "odometry", message));
    const bool has_gyroscope =
        is_read(motion.parse_gyroscope(text.substr(std::min(cut + 1, text.size())), "gyro", message));
    AccelerationList readings;
    static_cast<void>(is_read(
        parse_accelerometer(text.substr(std::min(cut + 1, text.size())), "accelerometer", readings.readings, message)));
    if (!has_odometry && !has_gyroscope) return 0;
    Trajectory poses;
    static_cast<void>(parse_trajectory(text.substr(0, cut), "odometry", poses, message));
    constexpr std::size_t kPosesMax = 16;
    GravityFinder finder;
    finder.begin(&readings);
    for (const TrajectoryPose& pose : poses) finder.add(pose, {0, 0, 0, 1});
    const Gravity gravity = finder.gravity();
    fuzz::expect(gravity.is_known == gravity.why_not.empty(), "up is known, or a clause says why not");
    fuzz::expect(!gravity.is_known || std::abs(length_of(gravity.up) - 1) < 1e-6, "up is a direction");
    for (std::size_t i = 0; i < std::min(poses.size(), kPosesMax); ++i) {
        for (const std::int64_t later_ns : {std::int64_t{1}, std::int64_t{33'333'333}, std::int64_t{1'000'000'000}}) {
            if (poses[i].time_ns > INT64_MAX - later_ns) continue;
            const std::optional<MotionHint> hint = motion.between_times(poses[i].time_ns, poses[i].time_ns + later_ns);
            fuzz::expect(!hint || is_valid(*hint), "a motion is one that the engine takes");
            fuzz::expect(!hint || hint->sigma_m >= 0 || hint->sigma_rad >= 0, "a motion says something");
        }
    }
    return 0;
}
