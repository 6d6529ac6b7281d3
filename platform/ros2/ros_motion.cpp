#include "platform/ros2/ros_motion.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <system_error>
#include <thread>

#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros_loan.hpp"
#include "hal/ros2/ros_readers.hpp"
#include "platform/poses/body_frames.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kClockBack_ns = 1'000'000'000;  // farther back than late messages: another clock
constexpr RosQos kMotionData{.is_reliable = false, .depth = 100};

[[nodiscard]] std::int64_t time_of(const ros::Header& header) {
    return std::int64_t{header.stamp.sec} * 1'000'000'000 + header.stamp.nanosec;
}

// In the order of their times; what is late is left out, and of too many the older half goes.
template <typename Sample>
void add(std::vector<Sample>& samples, const Sample& sample) {
    if (!samples.empty() && samples.back().time_ns - sample.time_ns > kClockBack_ns) samples.clear();
    if (!samples.empty() && sample.time_ns <= samples.back().time_ns) return;
    if (samples.size() == RosMotion::kSamplesMax)
        samples.erase(samples.begin(), samples.begin() + RosMotion::kSamplesMax / 2);
    samples.push_back(sample);
}

}  // namespace

class RosMotion::Listener {
public:
    explicit Listener(const RosMotionOptions& options)
        : base_from_optical_(compose(options.base_from_camera_link, kLinkFromOptical)),
          optical_from_base_(inverse_of(base_from_optical_)) {
        samples_.errors = options.errors;
        samples_.odometry.reserve(kSamplesMax);
        samples_.gyroscope.reserve(kSamplesMax);
        accelerations_.reserve(kSamplesMax);
    }
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

    [[nodiscard]] bool open(const RosMotionOptions& options, std::string& message) {
        context_ = RosContext::get(message);
        if (context_ == nullptr) return false;
        if (!subscribe(options.odometry, ros::kOdometry, odometry_, message) ||
            !subscribe(options.imu, ros::kImu, imu_, message) ||
            !subscribe(options.accelerometer, ros::kImu, accelerometer_, message)) {
            return false;
        }
        try {
            thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
        } catch (const std::system_error& failure) {
            message = std::string("there is no thread to listen from: ") + failure.what() + ".";
            return false;
        }
        return true;
    }
    [[nodiscard]] std::optional<MotionHint> between_times(std::int64_t from_ns, std::int64_t to_ns) const {
        const std::lock_guard lock(mutex_);
        return samples_.between_times(from_ns, to_ns);
    }
    void between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const {
        const std::lock_guard lock(mutex_);
        copy_between(accelerations_, after_ns, to_ns, out);
    }

private:
    [[nodiscard]] bool subscribe(const std::string& topic, const dds_topic_descriptor_t& type, dds_entity_t& reader,
                                 std::string& message) {
        if (topic.empty()) return true;
        reader = readers_.add(*context_, topic, type, kMotionData, message);
        return reader >= 0;
    }
    void serve(const std::stop_token& stop) {
        while (!stop.stop_requested()) {
            readers_.wait();
            while (odometry_ > 0 && take_pose() && !stop.stop_requested()) {
            }
            while (imu_ > 0 && take_rate() && !stop.stop_requested()) {
            }
            while (accelerometer_ > 0 && take_acceleration() && !stop.stop_requested()) {
            }
        }
    }
    bool take_pose() {
        const RosLoan<ros::Odometry> loan(odometry_);
        if (loan.message() == nullptr) return loan.is_any();
        const auto& [p, q] = loan.message()->pose.pose;
        const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
        if (!(length > 1e-6) || !std::isfinite(length + p.x + p.y + p.z)) return true;
        const RigidTransform base{{q.x / length, q.y / length, q.z / length, q.w / length}, {p.x, p.y, p.z}};
        const RigidTransform camera = compose(base, base_from_optical_);
        TrajectoryPose sample{.time_ns = time_of(loan.message()->header)};
        std::copy(std::begin(camera.translation_m), std::end(camera.translation_m), sample.t.begin());
        std::copy(std::begin(camera.rotation_xyzw), std::end(camera.rotation_xyzw), sample.q.begin());
        const std::lock_guard lock(mutex_);
        add(samples_.odometry, sample);
        return true;
    }
    // What the message says in one of its vectors, in the camera's axes, to be kept.
    template <typename Vector, typename Keep>
    bool take_imu(dds_entity_t reader, Vector ros::Imu::*said, Keep keep) {
        const RosLoan<ros::Imu> loan(reader);
        if (loan.message() == nullptr) return loan.is_any();
        const ros::Imu& imu = *loan.message();
        const Vector& v = imu.*said;
        if (!std::isfinite(v.x + v.y + v.z)) return true;
        const std::lock_guard lock(mutex_);
        keep(time_of(imu.header), in_camera(imu, v));
        return true;
    }
    bool take_rate() {
        return take_imu(imu_, &ros::Imu::angular_velocity, [this](std::int64_t time_ns, const Triple& rad_s) {
            add(samples_.gyroscope, TurningRate{.time_ns = time_ns, .rad_s = rad_s});
        });
    }
    bool take_acceleration() {
        return take_imu(accelerometer_, &ros::Imu::linear_acceleration,
                        [this](std::int64_t time_ns, const Triple& m_s2) {
                            add(accelerations_, Acceleration{.time_ns = time_ns, .m_s2 = m_s2});
                        });
    }
    // What such a message says is in the axes that its frame names.
    template <typename Vector>
    [[nodiscard]] Triple in_camera(const ros::Imu& imu, const Vector& v) const {
        const std::string_view frame = imu.header.frame_id != nullptr ? imu.header.frame_id : "";
        const Triple as_told{v.x, v.y, v.z};
        return frame.ends_with("optical_frame") ? as_told : stillmesh::rotated(optical_from_base_, as_told);
    }

    RigidTransform base_from_optical_, optical_from_base_;
    std::shared_ptr<RosContext> context_;
    RosReaders readers_;
    dds_entity_t odometry_ = 0, imu_ = 0, accelerometer_ = 0;
    mutable std::mutex mutex_;  // of the samples
    MotionSamples samples_;
    std::vector<Acceleration> accelerations_;
    std::jthread thread_;  // ends before what it reads
};

RosMotion::RosMotion() = default;
RosMotion::~RosMotion() = default;

bool RosMotion::open(const RosMotionOptions& options, std::string& message) {
    listener_ = std::make_unique<Listener>(options);
    sources_ = "ROS 2's ";
    for (const std::string& topic : {options.odometry, options.imu, options.accelerometer}) {
        if (!topic.empty()) sources_ += (sources_.ends_with(' ') ? "" : " and ") + topic;
    }
    return listener_->open(options, message);
}

std::optional<MotionHint> RosMotion::between_times(std::int64_t from_ns, std::int64_t to_ns) const {
    if (listener_ == nullptr) return std::nullopt;
    return listener_->between_times(from_ns, to_ns);
}

void RosMotion::between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const {
    out.clear();
    if (listener_ != nullptr) listener_->between(after_ns, to_ns, out);
}

}  // namespace stillmesh
