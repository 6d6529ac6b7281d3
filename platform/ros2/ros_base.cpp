#include "platform/ros2/ros_base.hpp"

#include <memory>

#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros2_camera.hpp"
#include "hal/ros2/ros_frames.hpp"
#include "hal/ros2/ros_loan.hpp"
#include "hal/ros2/ros_readers.hpp"
#include "platform/linux/process.hpp"
#include "platform/poses/body_frames.hpp"

namespace stillmesh {
namespace {

constexpr RosQos kSensorData{.is_reliable = false, .depth = 4};

bool take_name(dds_entity_t reader, std::string& name) {
    const RosLoan<ros::CameraInfo> loan(reader);
    if (loan.message() == nullptr) return loan.is_any();
    name = text_of(loan.message()->header.frame_id);
    return true;
}

}  // namespace

std::optional<RigidTransform> base_from_camera_by_tf(const RosBaseQuestion& question, std::string& message) {
    const std::shared_ptr<RosContext> context = RosContext::get(message);
    if (context == nullptr) return std::nullopt;
    RosReaders readers;
    Ros2Options camera;
    if (!question.topics.empty() && !parse_ros2_topics(question.topics, camera)) return std::nullopt;
    RosFrames frames;
    if (!frames.listen(readers, *context, camera.colour, message)) return std::nullopt;
    const dds_entity_t info = readers.add(*context, camera.info, ros::kCameraInfo, kSensorData, message);
    if (info < 0) return std::nullopt;
    std::string optical;
    const std::int64_t end_ns = monotonic_ns() + std::int64_t{kRosBaseWait_ms} * 1'000'000;
    while (monotonic_ns() < end_ns) {
        readers.wait();
        while (frames.take()) {
        }
        while (take_name(info, optical)) {
        }
        if (optical.empty()) continue;
        if (const auto base_from_optical = frames.tree().between(optical, question.base)) {
            return compose(*base_from_optical, inverse_of(kLinkFromOptical));
        }
    }
    message = optical.empty()
                  ? "no message on " + camera.info + " names the camera's frame"
                  : frames.told_by() + " does not say how '" + optical + "' lies to '" + question.base + "'";
    message += ": is the robot's description published (robot_state_publisher)? Else give X,Y,Z.";
    return std::nullopt;
}

}  // namespace stillmesh
