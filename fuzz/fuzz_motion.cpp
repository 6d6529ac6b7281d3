// Files of `run --odometry` and `--gyro`, with a byte 0 between them: any bytes give a sentence, or motions between any
// two moments that the engine takes.
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/static_region/motion_hints.hpp"
#include "fuzz/fuzz.hpp"
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
    if (!has_odometry && !has_gyroscope) return 0;
    Trajectory poses;
    static_cast<void>(parse_trajectory(text.substr(0, cut), "odometry", poses, message));
    constexpr std::size_t kPosesMax = 16;
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
