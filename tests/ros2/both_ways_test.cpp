// Every message of messages.idl, from Fast DDS to Cyclone DDS and back.
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/ros2/messages.hpp"
#include "hal/ros2/ros_context.hpp"
#include "hal/ros2/ros_loan.hpp"
#include "tests/ros2/fast_dds.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::both_ways_test {
namespace {

using test::within;
namespace fast = test::fast;

constexpr std::int64_t kPatience_ms = 30'000;
constexpr std::uint32_t kNumbers = 24;  // every remainder that lengths of texts and lists are made of

[[nodiscard]] bool has_writer(dds_entity_t reader) {
    dds_subscription_matched_status_t status{};
    return dds_get_subscription_matched_status(reader, &status) == 0 && status.current_count > 0;
}
[[nodiscard]] bool has_reader(dds_entity_t writer) {
    dds_publication_matched_status_t status{};
    return dds_get_publication_matched_status(writer, &status) == 0 && status.current_count > 0;
}

// Fast DDS writes; Cyclone reads it into its own structure, and writes that; Fast DDS reads.
template <typename Message>
void come_back(const RosContext& cyclone, fast::Node& node, const dds_topic_descriptor_t& type) {
    SCOPED_TRACE(Message::kType);
    const std::string type_name = Message::kType;
    const std::string name = type_name.substr(type_name.rfind(':') + 1);
    const std::string there = "/there/" + name, back = "/back/" + name;
    std::string message;
    const dds_entity_t reader = cyclone.reader(there, type, {}, message);
    const dds_entity_t writer = cyclone.writer(back, type, {}, message);
    ASSERT_TRUE(reader > 0 && writer > 0) << message;
    fast::Node::Writer<Message> sender(node, there, {});
    fast::Node::Reader<Message> receiver(node, back, {});
    ASSERT_TRUE(within(kPatience_ms, [&] {
        return sender.is_matched() && receiver.is_matched() && has_writer(reader) && has_reader(writer);
    }));
    for (std::uint32_t number = 0; number < kNumbers; ++number) {
        const Message sent = fast::filled<Message>(number);
        ASSERT_TRUE(sender.write(sent));
        std::optional<RosLoan<void>> loan;
        ASSERT_TRUE(within(kPatience_ms, [&] {
            loan.emplace(reader);
            return loan->message() != nullptr;
        })) << "Cyclone reads none";
        ASSERT_EQ(dds_write(writer, loan->message()), 0);
        std::vector<Message> received;
        ASSERT_TRUE(within(kPatience_ms, [&] {
            received = receiver.take();
            return !received.empty();
        })) << "Fast DDS reads none";
        ASSERT_EQ(received.size(), 1U);
        ASSERT_EQ(fast::bytes_of(received[0]), fast::bytes_of(sent)) << number;
    }
    static_cast<void>(dds_delete(reader));
    static_cast<void>(dds_delete(writer));
}

// Promise: every type of messages.idl is the same in Fast DDS and in Cyclone DDS, both ways: whatever texts and lists
// it holds, each takes all that the other wrote, and no byte of it has changed on the way there and back. (That fields
// stand in ROS's order: Ros2.Definitions.)
TEST(RosMessages, ComeBackFromCycloneByteForByte) {
    std::string message;
    const std::shared_ptr<RosContext> cyclone = RosContext::get(message);
    ASSERT_NE(cyclone, nullptr) << message;
    fast::Node node;
    come_back<fast::Empty>(*cyclone, node, ros::kEmpty);
    come_back<fast::Bool>(*cyclone, node, ros::kBool);
    come_back<fast::Odometry>(*cyclone, node, ros::kOdometry);
    come_back<fast::Tf>(*cyclone, node, ros::kTf);
    come_back<fast::PoseWithCovarianceStamped>(*cyclone, node, ros::kPoseWithCovarianceStamped);
    come_back<fast::Path>(*cyclone, node, ros::kPath);
    come_back<fast::OccupancyGrid>(*cyclone, node, ros::kOccupancyGrid);
    come_back<fast::PointCloud>(*cyclone, node, ros::kPointCloud);
    come_back<fast::Image>(*cyclone, node, ros::kImage);
    come_back<fast::CompressedImage>(*cyclone, node, ros::kCompressedImage);
    come_back<fast::Imu>(*cyclone, node, ros::kImu);
    come_back<fast::CameraInfo>(*cyclone, node, ros::kCameraInfo);
    come_back<fast::DiagnosticArray>(*cyclone, node, ros::kDiagnosticArray);
}

}  // namespace
}  // namespace stillmesh::both_ways_test
