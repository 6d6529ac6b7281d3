// Where up is in a map, by an accelerometer: what it measured, turned into the map by the camera's poses and averaged.
// It measures gravity and how the camera's speed changes; the camera's own poses say the second, so that of each second
// the change of speed is taken off, and nobody has to hold still. What seconds in a row say apart from each other, and
// what an accelerometer is off by for good, is the doubt; where that is too large, up is unknown. Poses are the
// odometry's, which do not jump; each second is turned by what map_from_odom was at its end. Memory: 32
// bytes for each reading between two frames. Cost: a rotation a reading.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "platform/motion/motion_steps.hpp"

namespace stillmesh {

inline constexpr double kGravity_m_s2 = 9.81;

// In the camera's axes, at rest gravity's upwards.
struct Acceleration {
    std::int64_t time_ns = 0;
    Triple m_s2{};
};

// Who has them: a file, or a robot.
class AccelerationSource {
public:
    virtual ~AccelerationSource() = default;
    // Replaces `out` by those after one moment and not after another, in the order of their times, as far as they are
    // known yet. Any thread.
    virtual void between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const = 0;
};
// All of them known beforehand, in the order of their times.
class AccelerationList final : public AccelerationSource {
public:
    std::vector<Acceleration> readings;
    void between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const override;
};
// Of readings in the order of their times, likewise.
void copy_between(const std::vector<Acceleration>& readings, std::int64_t after_ns, std::int64_t to_ns,
                  std::vector<Acceleration>& out);

struct Gravity {
    bool is_known = false;
    Triple up{0, -1, 0};   // in the map
    double doubt_rad = 0;  // of each of its two directions, and more
    double seconds = 0;    // that it is of
    std::string why_not;   // a clause; empty: it is known
};

class GravityFinder {
public:
    static constexpr double kBias_m_s2 = 0.1;       // an ordinary MEMS accelerometer, calibrated once
    static constexpr double kDoubtMax_rad = 0.035;  // two degrees, apart from the bias
    static constexpr int kPartsMin = 3;             // seconds

    // `source` is borrowed; nullptr: nothing is ever known.
    void begin(const AccelerationSource* source) { *this = GravityFinder(source); }
    GravityFinder() = default;
    // A frame's measured pose, and what turns it into the map.
    void add(const TrajectoryPose& odom_from_camera, const Quaternion& map_from_odom);
    // A frame without one.
    void add_nothing() { last_.reset(); }
    [[nodiscard]] Gravity gravity() const;

private:
    explicit GravityFinder(const AccelerationSource* source) : source_(source) {
        if (source != nullptr) readings_.reserve(kReadingsUsual);
    }
    // The mean of the readings between two poses, in the odometry's frame; empty: there are none.
    [[nodiscard]] std::optional<Triple> mean_between(const TrajectoryPose& from, const TrajectoryPose& to);
    void end_part(const Quaternion& map_from_odom);

    static constexpr std::size_t kReadingsUsual = 1024;  // between two frames: more take memory anew

    const AccelerationSource* source_ = nullptr;
    std::vector<Acceleration> readings_;  // between the last two poses
    std::optional<TrajectoryPose> last_;
    bool has_part_ = false;  // a second has begun: its speed at the begin, so far
    Triple speed_begin_{}, speed_{}, sum_{};
    double part_s_ = 0;
    int parts_ = 0;
    Triple total_{};
    double squares_ = 0;  // of the parts' lengths
    double seconds_ = 0;
};

// x ahead (where the map's z axis points, or its -y axis where that points up or down), y to the left, z up; the origin
// stays where it is.
[[nodiscard]] RigidTransform level_from_up(const Triple& up);

}  // namespace stillmesh
