#include "hal/ros2/ros_frames.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros_loan.hpp"

namespace stillmesh {
namespace {

constexpr RosQos kStatic{.is_reliable = true, .history = RosHistory::kLatched, .depth = 100};
constexpr std::size_t kTopicsMax = 8;

}  // namespace

bool RosFrames::listen(RosReaders& readers, const RosContext& context, std::string_view beside_topic,
                       std::string& message) {
    topics_.push_back({told_by_});
    for (std::size_t slash = beside_topic.find('/', 1); slash != std::string_view::npos && topics_.size() < kTopicsMax;
         slash = beside_topic.find('/', slash + 1)) {
        topics_.push_back({std::string(beside_topic.substr(0, slash)) + "/tf_static"});
    }
    for (Topic& topic : topics_) {
        topic.reader = readers.add(context, topic.name, ros::kTf, kStatic, message);
        if (topic.reader < 0) return false;
    }
    return true;
}

bool RosFrames::take() {
    bool is_any = false;
    for (const Topic& topic : topics_) {
        const RosLoan<ros::Tf> loan(topic.reader);
        is_any = loan.is_any() || is_any;
        if (loan.message() == nullptr) continue;
        told_by_ = topic.name;
        for (std::uint32_t i = 0; i < loan.message()->transforms._length; ++i) {
            const ros::TransformStamped& one = loan.message()->transforms._buffer[i];
            const auto& [t, q] = one.transform;
            tree_.add(text_of(one.child_frame_id), text_of(one.header.frame_id), std::array{t.x, t.y, t.z},
                      std::array{q.x, q.y, q.z, q.w});
        }
    }
    return is_any;
}

}  // namespace stillmesh
