#include "platform/ros2/ros_base.hpp"

#include <array>
#include <memory>

#include "hal/calibration/frame_tree.hpp"
#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros_loan.hpp"
#include "hal/ros2/ros_readers.hpp"
#include "platform/linux/process.hpp"
#include "platform/poses/body_frames.hpp"

namespace stillmesh {
namespace {

constexpr RosQos kSensorData{.is_reliable = false, .depth = 4};
constexpr RosQos kStatic{.is_reliable = true, .history = RosHistory::kLatched, .depth = 100};

[[nodiscard]] std::string text_of(const char* text) {
    return text != nullptr ? text : "";
}

// True: something came.
bool take_frames(dds_entity_t reader, FrameTree& frames) {
    const RosLoan<ros::Tf> loan(reader);
    if (loan.message() == nullptr) return loan.is_any();
    for (std::uint32_t i = 0; i < loan.message()->transforms._length; ++i) {
        const ros::TransformStamped& one = loan.message()->transforms._buffer[i];
        const auto& [t, q] = one.transform;
        frames.add(text_of(one.child_frame_id), text_of(one.header.frame_id), std::array{t.x, t.y, t.z},
                   std::array{q.x, q.y, q.z, q.w});
    }
    return true;
}

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
    const dds_entity_t tf = readers.add(*context, "/tf_static", ros::kTf, kStatic, message);
    if (tf < 0) return std::nullopt;
    const dds_entity_t info = readers.add(*context, question.info, ros::kCameraInfo, kSensorData, message);
    if (info < 0) return std::nullopt;
    FrameTree frames;
    std::string optical;
    const std::int64_t end_ns = monotonic_ns() + std::int64_t{kRosBaseWait_ms} * 1'000'000;
    while (monotonic_ns() < end_ns) {
        readers.wait();
        while (take_frames(tf, frames)) {
        }
        while (take_name(info, optical)) {
        }
        if (optical.empty()) continue;
        if (const auto base_from_optical = frames.between(optical, question.base)) {
            return compose(*base_from_optical, inverse_of(kLinkFromOptical));
        }
    }
    message = optical.empty() ? "no message on " + question.info + " names the camera's frame"
                              : "/tf_static does not say how '" + optical + "' lies to '" + question.base + "'";
    message += ": is the robot's description published (robot_state_publisher)? Else give X,Y,Z.";
    return std::nullopt;
}

}  // namespace stillmesh
