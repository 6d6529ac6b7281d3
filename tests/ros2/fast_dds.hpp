// The other side of ROS 2 for tests, as a node with Fast DDS would be (ROS 2 Humble's default): readers and writers of
// eProsima Fast DDS on this machine's loopback, with messages of the test's own whose bytes Fast CDR reads and writes.
// Nothing here is shared with what is tested but the names of topics and types. Fields stand in the order of ROS's
// message definitions.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace stillmesh::test::fast {

using Covariance = std::array<double, 36>;
struct Header {
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
    std::string frame_id;
    [[nodiscard]] std::int64_t time_ns() const { return sec * 1'000'000'000LL + nanosec; }
};
struct Pose {
    std::array<double, 3> p{};
    std::array<double, 4> q{};
};
struct PoseStamped {
    Header header;
    Pose pose;
};
struct PoseWithCovarianceStamped {
    static constexpr const char* kType = "geometry_msgs::msg::dds_::PoseWithCovarianceStamped_";
    Header header;
    Pose pose;
    Covariance covariance{};
};
struct Odometry {
    static constexpr const char* kType = "nav_msgs::msg::dds_::Odometry_";
    Header header;
    std::string child_frame_id;
    Pose pose;
    Covariance pose_covariance{};
    std::array<double, 6> twist{};
    Covariance twist_covariance{};
};
struct TransformStamped {
    Header header;
    std::string child_frame_id;
    Pose transform;
};
struct Tf {
    static constexpr const char* kType = "tf2_msgs::msg::dds_::TFMessage_";
    std::vector<TransformStamped> transforms;
};
struct Path {
    static constexpr const char* kType = "nav_msgs::msg::dds_::Path_";
    Header header;
    std::vector<PoseStamped> poses;
};
struct OccupancyGrid {
    static constexpr const char* kType = "nav_msgs::msg::dds_::OccupancyGrid_";
    Header header;
    std::int32_t load_sec = 0;
    std::uint32_t load_nanosec = 0;
    float resolution = 0;
    std::uint32_t width = 0, height = 0;
    Pose origin;
    std::vector<std::int8_t> data;
};
struct Empty {
    static constexpr const char* kType = "std_msgs::msg::dds_::Empty_";
    std::uint8_t nothing = 0;
};
struct Bool {
    static constexpr const char* kType = "std_msgs::msg::dds_::Bool_";
    bool data = false;
};
struct PointField {
    std::string name;
    std::uint32_t offset = 0;
    std::uint8_t datatype = 0;
    std::uint32_t count = 0;
};
struct PointCloud {
    static constexpr const char* kType = "sensor_msgs::msg::dds_::PointCloud2_";
    Header header;
    std::uint32_t height = 0, width = 0;
    std::vector<PointField> fields;
    bool is_bigendian = false;
    std::uint32_t point_step = 0, row_step = 0;
    std::vector<std::uint8_t> data;
    bool is_dense = false;
};
struct DiagnosticStatus {
    std::uint8_t level = 0;
    std::string name, message, hardware_id;
    std::vector<std::pair<std::string, std::string>> values;
};
struct DiagnosticArray {
    static constexpr const char* kType = "diagnostic_msgs::msg::dds_::DiagnosticArray_";
    Header header;
    std::vector<DiagnosticStatus> status;
};
struct Image {
    static constexpr const char* kType = "sensor_msgs::msg::dds_::Image_";
    Header header;
    std::uint32_t height = 0, width = 0;
    std::string encoding;
    std::uint8_t is_bigendian = 0;
    std::uint32_t step = 0;
    std::vector<std::uint8_t> data;
};
struct CompressedImage {
    static constexpr const char* kType = "sensor_msgs::msg::dds_::CompressedImage_";
    Header header;
    std::string format;
    std::vector<std::uint8_t> data;
};
struct Imu {
    static constexpr const char* kType = "sensor_msgs::msg::dds_::Imu_";
    Header header;
    std::array<double, 4> orientation{};
    std::array<double, 9> orientation_covariance{};
    std::array<double, 3> angular_velocity{};
    std::array<double, 9> angular_velocity_covariance{};
    std::array<double, 3> linear_acceleration{};
    std::array<double, 9> linear_acceleration_covariance{};
};
struct CameraInfo {
    static constexpr const char* kType = "sensor_msgs::msg::dds_::CameraInfo_";
    Header header;
    std::uint32_t height = 0, width = 0;
    std::string distortion_model;
    std::vector<double> d;
    std::array<double, 9> k{}, r{};
    std::array<double, 12> p{};
    std::uint32_t binning_x = 0, binning_y = 0;
    std::uint32_t x_offset = 0, y_offset = 0, roi_height = 0, roi_width = 0;
    bool do_rectify = false;
};

// One in which no two numbers are the same; from another number on, another content. Texts have 0 to 5 letters, lists
// 0 to 3 items, so that what follows them lies at every alignment.
template <typename Message>
[[nodiscard]] Message filled(std::uint32_t number);
// As Fast CDR writes it, without what pads the end.
template <typename Message>
[[nodiscard]] std::vector<std::uint8_t> bytes_of(const Message& message);

struct Qos {
    bool is_reliable = true;
    bool is_latched = false;
    std::int32_t depth = 10;
    bool is_stuck = false;  // of a reader: keeps all it was promised, has room for one, and never takes it
};

// One participant in the domain of ROS_DOMAIN_ID, on the loopback alone.
class Node {
public:
    Node();
    ~Node();
    Node(const Node&) = delete;
    Node& operator=(const Node&) = delete;

    // Messages are kept until they are taken. `topic` as ROS names it, as /odom.
    template <typename Message>
    class Reader;
    template <typename Message>
    class Writer;

private:
    template <typename Message>
    friend class Reader;
    template <typename Message>
    friend class Writer;
    struct Inside;
    std::unique_ptr<Inside> inside_;
};

template <typename Message>
class Node::Reader {
public:
    Reader(Node& node, const std::string& topic, const Qos& qos);
    ~Reader();
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;
    [[nodiscard]] std::vector<Message> take();
    [[nodiscard]] bool is_matched() const;

private:
    struct Listener;
    std::unique_ptr<Listener> listener_;
};

template <typename Message>
class Node::Writer {
public:
    Writer(Node& node, const std::string& topic, const Qos& qos);
    ~Writer();
    Writer(const Writer&) = delete;
    Writer& operator=(const Writer&) = delete;
    [[nodiscard]] bool write(const Message& message);
    [[nodiscard]] bool is_matched() const;

private:
    struct Inside;
    std::unique_ptr<Inside> inside_;
};

}  // namespace stillmesh::test::fast
